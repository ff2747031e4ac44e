"""The examples run as they stand, and what they return is physics."""

import re
import runpy
from pathlib import Path

import matplotlib
import meshio
import numpy as np
import pytest

import fibrous as fb

EXAMPLES = Path(__file__).parents[2] / "examples"
matplotlib.use("agg")


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Runs the `main` of an example in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return lambda name, *arguments: runpy.run_path(str(EXAMPLES / f"{name}.py"))["main"](*arguments)


def in_balance(solution):
    force = solution.reaction.sum(axis=1)
    return np.abs(force).max() < 1e-6 * np.abs(solution.reaction).max()


def test_energy_of_a_loaded_network_rises_with_the_work_of_its_stress(run):
    curves = run("network_under_load")
    assert curves["converged"].all()
    F, P = curves["deformation_gradient"].values, curves["first_piola_kirchhoff_stress"].values
    W = curves["strain_energy_density"].values
    assert (np.diff(W, axis=1) > 0.0).all()
    work = (0.5 * (P[:, 1:] + P[:, :-1]) * np.diff(F, axis=1)).sum(axis=(1, 2, 3))
    np.testing.assert_allclose(work, W[:, -1], rtol=0.01)


def test_a_fitted_law_predicts_the_stress_of_another_deformation(run):
    fit, of_network, of_law = run("fit_and_predict")
    assert fit.C2 > 0.0
    assert fit.r_squared > 0.8
    np.testing.assert_allclose(of_law[-1, 0, 0], of_network[-1, 0, 0], rtol=0.2)
    assert np.linalg.norm(of_law - of_network) < np.linalg.norm(of_network) / 3


def test_a_tissue_pulled_apart_pulls_back_ever_harder(run):
    specimen, solution = run("tissue_with_a_law", (3, 4, 1))
    assert specimen.mesh.element_nodes.shape[0] == 12
    assert in_balance(solution)
    force = solution.reaction[:, 1, 0]
    assert force[0] > 0.0
    assert (np.diff(force) > 0.0).all()


def test_law_and_networks_agree_in_the_tissue(run):
    coupled, hybrid = run("coupled_and_law", (3, 4, 1))
    assert in_balance(coupled)
    assert in_balance(hybrid)
    assert coupled.reaction[-1, 1, 0] > 0.0
    np.testing.assert_allclose(hybrid.reaction[-1, 1, 0], coupled.reaction[-1, 1, 0], rtol=0.1)
    np.testing.assert_allclose(hybrid.displacement[-1], coupled.displacement[-1], atol=0.2)


def test_a_law_of_ones_own_is_the_derivative_of_its_energy(run):
    law, solution = run("law_of_your_own")
    F = np.array([[1.1, 0.02, 0.0], [0.05, 0.97, 0.01], [0.0, 0.0, 0.98]])
    step = 1e-6 * np.eye(9).reshape(9, 3, 3)
    slope = (law.energy(F + step) - law.energy(F - step)) / 2e-6
    np.testing.assert_allclose(slope.reshape(3, 3), law.piola(F), atol=1e-9)
    bend = ((law.piola(F + step) - law.piola(F - step)) / 2e-6).reshape(3, 3, 3, 3)
    np.testing.assert_allclose(np.moveaxis(bend, (0, 1), (2, 3)), law.tangent(F), atol=1e-8)
    assert solution.converged.all()
    assert in_balance(solution)


def test_a_network_of_ones_own_is_the_same_from_arrays_and_files(run):
    network, read = run("network_of_your_own")
    F = np.diag([1.2, 1.2**-0.5, 1.2**-0.5])
    stress = network.stress(F)
    np.testing.assert_array_equal(read.stress(F), stress)
    np.testing.assert_allclose(stress, stress.T, atol=1e-9 * stress[0, 0])
    assert stress[0, 0] > 0.0


def test_files_for_paraview_hold_the_states(run, tmp_path):
    specimen, solution = run("results_to_paraview", (3, 4, 1))
    for step, displacement in enumerate(solution.displacement):
        state = meshio.read(tmp_path / f"tissue_{step + 1}.vtu")
        np.testing.assert_allclose(state.points, specimen.mesh.node_position)
        np.testing.assert_allclose(state.point_data["displacement_mm"], displacement)
        stress = state.cell_data["cauchy_stress_MPa"][0].reshape(-1, 3, 3)
        np.testing.assert_allclose(stress, solution.cauchy[step].mean(axis=1))


def test_every_public_name_has_its_place_in_the_reference():
    pages = "\n".join(page.read_text() for page in (EXAMPLES.parent / "docs" / "api").glob("*.md"))
    assert set(fb.__all__) <= set(re.findall(r"\w+", pages))
