"""Networks inside the tissue: stresses and forces by geometry, files against the library, and what is drawn of them."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import synthetic
from conftest import small_network
from fibers import exponential, stress_scale
from matplotlib.collections import LineCollection
from reference import respond

from fibrous.deformation import cauchy_stress
from fibrous.errors import DatasetError
from fibrous.fe.solver import LoadStepper
from fibrous.materials.contract import Mixture
from fibrous.materials.neo_hookean import NeoHookean
from fibrous.materials.network import FiberNetworks
from fibrous.microstructure import stress_difference
from fibrous.networks.engine import Engine
from fibrous.networks.guard import EquilibriumSolver, Limits
from fibrous.networks.path import follow
from fibrous.specimen import Slab
from fibrous_study import datasets
from fibrous_study.figures import figure_microstructure as figure
from fibrous_study.steps import network_microstructure as stage

MODULUS, RADIUS, EDGE, B = 10.0, 0.1, 10.0, 2.5
SCALE = stress_scale(MODULUS, RADIUS, EDGE)
END = np.array([[1.25, 0.1, 0.0], [0.0, 0.95, 0.05], [0.02, 0.0, 0.9]])
PATH = np.stack([np.eye(3) + part * (END - np.eye(3)) for part in np.linspace(0.0, 1.0, 5)])
C1, LAME = 0.025, 0.417
LIMITS = {"residual_tolerance": 1e-11, "largest_number_of_iterations": 60, "largest_number_of_cuts": 6}
ORDER = [2, 0, 3, 1]  # network of each element
NETWORKS = [small_network(seed) for seed in range(4)]


@pytest.fixture(scope="module")
def found(engine):
    return driven_alone(engine)


def driven_alone(engine):
    response = follow(engine, PATH[None], SCALE, geometry=True)
    arrays = {name: values[0] for name, values in vars(response).items() if values is not None}
    return SimpleNamespace(**arrays, fiber_stress=MODULUS * engine.law.response(arrays["fiber_stretch"])[0])


def ends(position, fiber_nodes):
    """Vectors between the ends of the fibres, and their lengths."""
    vectors = position[fiber_nodes[:, 1]] - position[fiber_nodes[:, 0]]
    return vectors, np.linalg.norm(vectors, axis=1)


def test_stretches_and_stresses_are_those_of_the_nodes(found, network):
    for step, F in enumerate(PATH):
        vectors, lengths = ends(found.node_position[step], network.fiber_nodes)
        np.testing.assert_allclose(found.fiber_stretch[step], lengths / network.fiber_lengths, rtol=1e-12)
        green = 0.5 * (found.fiber_stretch[step] ** 2 - 1.0)
        np.testing.assert_allclose(found.fiber_stress[step], MODULUS / B * np.expm1(B * green), rtol=1e-10, atol=1e-13)
        directions = vectors / lengths[:, None]
        turned = np.einsum("m,mi,mj->ij", lengths, directions, directions) / lengths.sum()
        np.testing.assert_allclose(found.orientation_tensor[step], turned, atol=1e-13)
        # Eq. 7: forces times vectors over the deformed volume, in µN, µm and µm³.
        force = found.fiber_stress[step] * np.pi * RADIUS**2
        virial = np.einsum("m,mi,mj->ij", force, directions, EDGE * vectors) / (EDGE**3 * np.linalg.det(F))
        np.testing.assert_allclose(found.cauchy_stress[step], virial, atol=1e-9 * np.abs(virial).max() + 1e-15)
    assert found.converged.all()


def test_forces_balance_at_interior_nodes_and_the_boundary_follows(found, network):
    inside = ~network.node_is_boundary
    for step, F in enumerate(PATH):
        vectors, lengths = ends(found.node_position[step], network.fiber_nodes)
        pulls = found.fiber_stress[step][:, None] * vectors / lengths[:, None]
        total = np.zeros_like(network.node_position)
        np.add.at(total, network.fiber_nodes[:, 0], pulls)
        np.add.at(total, network.fiber_nodes[:, 1], -pulls)
        np.testing.assert_allclose(total[inside], 0.0, atol=1e-8)
        affine = network.node_position @ F.T
        np.testing.assert_allclose(found.node_position[step][~inside], affine[~inside], atol=1e-14)
    assert np.abs(found.node_position[-1] - affine)[inside].max() > 0.01
    np.testing.assert_array_equal(found.node_position[0], network.node_position)


def test_a_state_that_was_not_found_is_nan(network):
    hasty = Engine.of(network, exponential(B), Limits(largest_number_of_iterations=1, largest_number_of_cuts=0))
    lost = driven_alone(hasty)
    np.testing.assert_array_equal(lost.converged, [True, False, False, False, False])
    for name in ("node_position", "fiber_stretch", "fiber_stress", "orientation_tensor", "cauchy_stress"):
        values = getattr(lost, name)
        assert np.isfinite(values[0]).all()
        assert np.isnan(values[1:]).all()
    matrix = NeoHookean(C1, LAME)
    of_matrix = cauchy_stress(matrix(PATH)[0], PATH)
    assert stress_difference(lost.cauchy_stress, matrix, PATH, of_matrix) <= 1e-16
    assert np.isnan(stress_difference(np.full((2, 3, 3), np.nan), matrix, PATH[:2], of_matrix[:2]))


def test_the_difference_is_the_largest_of_any_component(found):
    matrix = NeoHookean(C1, LAME)
    whole = found.cauchy_stress + cauchy_stress(matrix(PATH)[0], PATH)
    whole[2, 0, 1] -= 0.25
    whole[3, 1, 1] += 0.125
    assert stress_difference(found.cauchy_stress, matrix, PATH, whole) == pytest.approx(0.25, rel=1e-12)


@pytest.fixture(scope="module")
def tissue(tmp_path_factory):
    """A coupled simulation of four elements, its files, and what the library found."""
    folder = tmp_path_factory.mktemp("microstructure")
    specimen = Slab(elements=(2, 2, 1)).specimen(2)
    networks = FiberNetworks.of([NETWORKS[number] for number in ORDER])
    material = Mixture((NeoHookean(C1, LAME), networks))
    solution = LoadStepper.of(specimen.mesh, material, specimen.prescribed).follow(specimen.prescribed.values)
    write_specimen(folder / "specimen.nc", specimen)
    write_tissue(folder / "multiscale.nc", specimen, solution)
    for batch, numbers in enumerate(([0, 1], [2, 3])):
        write_networks(folder / f"{batch}.nc", numbers)
    return folder, solution


def write_specimen(path, specimen):
    arrays = {
        "node_position": specimen.mesh.node_position,
        "element_nodes": specimen.mesh.element_nodes,
        "element_network": np.array(ORDER),
        "structure_tensor": specimen.structure_tensor,
        "fiber_direction": specimen.fiber_direction,
        "enthesis": specimen.enthesis,
        "prescribed_displacement": specimen.prescribed_displacement,
    }
    write(arrays, "specimen", path, {"step": [1, 2]}, origin=specimen.origin)


def write_tissue(path, specimen, solution):
    steps, none = 2, np.full((2, 4), np.nan)
    counts = ("network_iterations", "network_cuts", "indefinite_hessians")
    arrays = {
        "displacement": solution.displacement,
        "deformation_gradient": solution.deformation_gradient,
        "cauchy_stress": cauchy_stress(solution.piola, solution.deformation_gradient),
        "reaction_force": np.zeros((steps, 2, 3)),
        "newton_iterations": solution.newton_iterations,
        "cuts": solution.cuts,
        "converged": solution.converged,
        **dict.fromkeys(counts, np.zeros(steps, dtype=int)),
        "structure_tensor": specimen.structure_tensor,
        "C2": none,
        "C3": none,
    }
    coords = {"step": [1, 2], "enthesis": [1, 2]}
    write(arrays, "tissue", path, coords, origin=specimen.origin, C1_MPa=C1, lame_lambda_MPa=LAME)


def write_networks(path, numbers):
    networks = [NETWORKS[number] for number in numbers]
    tensors = np.tile(np.eye(3) / 3.0, (len(networks), 1, 1))
    arrays = {
        "node_count": np.array([len(network.node_position) for network in networks]),
        "fiber_count": np.array([len(network.fiber_nodes) for network in networks]),
        "node_position": np.concatenate([network.node_position for network in networks]),
        "node_is_boundary": np.concatenate([network.node_is_boundary for network in networks]),
        "fiber_nodes": np.concatenate([network.fiber_nodes for network in networks]),
        "structure_tensor": tensors,
        "target_structure_tensor": tensors,
        "volume_fraction": np.full(len(networks), 0.04),
        "shortest_fiber": np.array([network.fiber_lengths.min() for network in networks]),
        "seed": np.array(numbers),
        "name": np.array([""] * len(networks), dtype=object),
    }
    about = {"edge_length_um": EDGE, "fiber_radius_um": RADIUS, "fiber_modulus_MPa": MODULUS}
    about |= {"fiber_nonlinearity": B, "fiber_linear_beyond_stretch": np.inf, "fiber_law": "exponential"}
    write(arrays, "networks", path, {"network": numbers}, **about)


def write(arrays, kind, path, coords, **about):
    dataset = datasets.packed(arrays, kind, coords).assign_attrs(about)
    datasets.write(dataset, path, kind, synthetic.params(0))


def driven(folder, element=0, run="multiscale", law="network"):
    config = {"run": run, "element": element, "model": {"law": law}, "equilibrium": LIMITS}
    inputs = {"networks": [folder / "0.nc", folder / "1.nc"], "specimen": [folder / "specimen.nc"]}
    inputs["tissue"] = [folder / "multiscale.nc"]
    path = folder / f"{run}_{element}.nc"
    params = {"stage": "fibrous_study.steps.network_microstructure", "code_hash": "", "config": config}
    stage.run(inputs, {"states": path}, params)
    return datasets.read(path, "microstructure")


@pytest.mark.parametrize("element", range(4))
def test_networks_alone_find_the_states_of_the_coupled_simulation(tissue, element, capsys):
    folder, _ = tissue
    states = driven(folder, element)
    assert 0.0 < states.attrs["stress_difference_MPa"] < 1e-10
    assert states["converged"].all()
    assert states.attrs["network"] == ORDER[element]
    said = capsys.readouterr().err
    assert f"network {ORDER[element]}: 27 of 27 states converged" in said
    assert "its stress differs from the run's by up to" in said


def test_the_file_holds_every_gauss_point_and_their_mean(tissue):
    folder, solution = tissue
    states, F = driven(folder, 2), solution.deformation_gradient[:, 2]
    assert states["path"].values.tolist() == [*"01234567", "mean"]
    assert states["step"].values.tolist() == [0, 1, 2]
    for q in range(8):
        np.testing.assert_array_equal(states["deformation_gradient"].sel(path=str(q))[1:], F[:, q])
    mean = np.concatenate([np.eye(3)[None], sum(F[:, q] for q in range(8)) / 8.0])
    along = states.sel(path="mean")
    np.testing.assert_allclose(along["deformation_gradient"], mean, atol=1e-15)
    response = respond(EquilibriumSolver.of(NETWORKS[ORDER[2]], exponential(B)), mean, SCALE)
    np.testing.assert_allclose(along["cauchy_stress"], response.cauchy_stress, atol=1e-12)
    np.testing.assert_allclose(along["orientation_tensor"], response.orientation_tensor, atol=1e-10)
    green = 0.5 * (along["fiber_stretch"].values ** 2 - 1.0)
    np.testing.assert_allclose(along["fiber_stress"], MODULUS / B * np.expm1(B * green), rtol=1e-10, atol=1e-13)
    np.testing.assert_array_equal(states["node_position"].sel(path="3", step=0), NETWORKS[ORDER[2]].node_position)
    np.testing.assert_array_equal(states["fiber_nodes"], NETWORKS[ORDER[2]].fiber_nodes)


def test_another_state_than_the_runs_is_told(tissue, tmp_path):
    folder, _ = tissue
    for name in ("0.nc", "1.nc", "specimen.nc"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    changed = datasets.read(folder / "multiscale.nc", "tissue")
    changed["cauchy_stress"][1, 2, 5, 0, 0] += 1e-3
    datasets.write(changed, tmp_path / "multiscale.nc", "tissue", synthetic.params(0))
    assert driven(tmp_path, 2).attrs["stress_difference_MPa"] == pytest.approx(1e-3, rel=1e-6)
    assert "stress_difference_MPa" not in driven(tmp_path, 2, "hgo", "families").attrs
    with pytest.raises(DatasetError, match=r"multiscale.nc: has no element 4; name one from 0 to 3"):
        driven(tmp_path, 4)
    (tmp_path / "1.nc").write_bytes((tmp_path / "0.nc").read_bytes())
    with pytest.raises(DatasetError, match="lacks network 2; delete the folder"):
        driven(tmp_path, 0)


@pytest.fixture(scope="module")
def elements(tissue):
    folder, _ = tissue
    return {element: [driven(folder, element, run) for run in ("multiscale", "hgo_refit")] for element in (0, 3)}


def test_distributions_are_quantiles_of_the_fibers(elements, tissue, tmp_path):
    folder, _ = tissue
    outputs = {key: tmp_path / f"microstructure.{key}" for key in ("png", "svg", "data")}
    paths = [folder / f"{run}_{element}.nc" for element in (0, 3) for run in ("multiscale", "hgo_refit")]
    figure.run({"states": paths}, outputs, synthetic.params("microstructure"))
    data = pd.read_csv(outputs["data"])
    assert len(data) == 2 * 2 * 9 * 101
    for (element, run, path), own in data.groupby(["element", "run", "path"]):
        (states,) = [one for one in elements[element] if one.attrs["run"] == run]
        stretch = np.sort(states["fiber_stretch"].sel(path=path, step=2).values)
        at_most = np.searchsorted(stretch, own["fiber_stretch"] * (1.0 + 1e-12), side="right") / len(stretch)
        np.testing.assert_allclose(at_most, own["share"], atol=1.5 / len(stretch))
        assert (own["step"] == 2).all()


def test_networks_are_drawn_where_they_are(elements):
    drawn = figure.draw(elements)
    for (element, files), row in zip(elements.items(), (0, 3), strict=True):
        for states, axes in zip(files, drawn.axes[row : row + 2], strict=True):
            (lines,) = axes.findobj(LineCollection)
            state = states.sel(path="mean", step=2)
            fibers = state["node_position"].values[states["fiber_nodes"].values]
            points, depth = figure.CUBE_VIEW.project(fibers)
            np.testing.assert_allclose(lines.get_segments(), points[np.argsort(depth.mean(axis=1), kind="stable")])
            name = states.attrs["run"].replace("_", " ")
            largest = np.linalg.eigvalsh(state["orientation_tensor"].values)[-1]
            assert axes.get_title() == f"element {element}, {name}\nlargest eigenvalue of $h$: {largest:.3f}"
        shares = drawn.axes[row + 2]
        for line, states in zip(shares.lines, files, strict=True):
            stretch = states["fiber_stretch"].sel(path="mean", step=2).values
            np.testing.assert_allclose(line.get_xdata(), np.quantile(stretch, line.get_ydata()))
            assert line.get_ydata()[-1] == 1.0


def test_the_last_state_that_was_found_is_drawn(elements):
    lost = elements[0][0].copy(deep=True)
    lost["converged"].loc[{"path": "mean", "step": 2}] = False
    lost["fiber_stretch"].loc[{"path": "mean", "step": 2}] = np.nan
    assert figure.last_state(lost)["step"] == 1
    lost["converged"].loc[{"path": "4", "step": 1}] = False
    table = figure.distributions({0: [lost]})
    assert set(table["path"]) == {*"0123567", "mean"}
    assert set(table["step"]) == {1}
