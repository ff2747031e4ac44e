"""What is made of finite element runs: the table, models for FEBio, states for ParaView, all called synthetic."""

import json
from pathlib import Path

import meshio
import numpy as np
import pandas as pd
import pytest
from feb_reader import Feb
from small_study import HGO, SPECIMEN_FILE, constants, other_tensors, small_specimen
from workflow_runs import job_of

from fibrous.specimen import MOVED
from fibrous_study.steps import febio

SPECIMEN, TENSORS = small_specimen(), other_tensors()


def test_the_table_says_how_far_a_refit_moved(study, other):
    models = [{"name": "matrix", "law": "matrix"}, {**HGO, "refit": True}]
    names = ("matrix", "hgo", "hgo_refit")
    small = other(*(f"results/tissue/{name}.nc" for name in names), tissue={"models": models})
    table = pd.read_csv(small.run("tissue_table")["table"]).set_index("run")
    assert list(table.index) == list(names)
    assert list(table["refits"]) == [0, 0, 1]
    assert set(table["specimen"]) == {"synthetic specimen"}
    C2, C3 = constants("structure_tensor", "energy")
    refit, changes = table.loc["hgo_refit"], [column for column in table if "_change_" in column]
    assert len(changes) == 8
    assert table.loc[["matrix", "hgo"], changes].isna().all(axis=None)
    assert refit["C2_mean_MPa"] == pytest.approx(1.5 * C2.mean(), rel=1e-12)
    assert refit["C3_mean"] == pytest.approx(C3.mean(), rel=1e-12)
    assert refit["C2_change_rms_MPa"] == pytest.approx(0.5 * np.sqrt((C2**2).mean()), rel=1e-12)
    assert refit["C2_change_largest_MPa"] == pytest.approx(0.5 * C2.max(), rel=1e-12)
    assert refit["C3_change_rms"] == refit["C3_change_largest"] == 0.0
    after, before = study.tissue("hgo_refit"), study.tissue("hgo")
    moved = ((after["displacement"] - before["displacement"])[-1].values ** 2).sum(axis=1)
    assert refit["displacement_change_rms_mm"] == pytest.approx(np.sqrt(moved.mean()), rel=1e-12)
    assert refit["displacement_change_largest_mm"] == pytest.approx(np.sqrt(moved.max()), rel=1e-12)

    def shear(state):
        principal = np.linalg.eigvals(state["cauchy_stress"].values[-1]).real
        return 0.5 * (principal.max(axis=-1) - principal.min(axis=-1)).mean(axis=-1)

    change = shear(after) - shear(before)
    assert refit["maximum_shear_stress_rms_MPa"] == pytest.approx(np.sqrt((shear(after) ** 2).mean()), rel=1e-9)
    assert refit["maximum_shear_stress_change_rms_MPa"] == pytest.approx(np.sqrt((change**2).mean()), rel=1e-9)
    assert refit["maximum_shear_stress_change_largest_MPa"] == pytest.approx(np.abs(change).max(), rel=1e-9)
    gradient = after["deformation_gradient"].values
    stretch = np.linalg.svd(gradient[-1], compute_uv=False)[..., 0].mean(axis=1)
    assert refit["stretch_percentile_99"] == pytest.approx(np.percentile(stretch, 99.0), rel=1e-12)
    assert refit["stretch_largest"] == pytest.approx(stretch.max(), rel=1e-12)
    volumes = np.prod(np.linalg.svd(gradient, compute_uv=False), axis=-1)
    assert (refit["J_least"], refit["J_largest"]) == pytest.approx((volumes.min(), volumes.max()), rel=1e-12)
    reaction = [refit[f"reaction_{axis}_N"] for axis in "xyz"]
    np.testing.assert_allclose(reaction, after["reaction_force"].sel(enthesis=MOVED)[-1], rtol=1e-12)
    assert refit["newton_iterations"] == int(after["newton_iterations"].sum())


def in_febio(study, run: str) -> Path:
    """The input file of FEBio of one run."""
    job = job_of(study.config, "febio")
    of_run = {"specimen": [study.folder / SPECIMEN_FILE], "tissue": [study.folder / f"results/tissue/{run}.nc"]}
    path = study.folder / f"results/tissue/{run}.feb"
    febio.run(of_run, {run: path}, {**job.params, "config": {**job.params["config"], "runs": [run]}})
    return path


def test_the_febio_model_is_the_problem_that_was_solved(study):
    content = in_febio(study, "hgo_refit").read_bytes()
    found, (C2, C3) = Feb(content), constants("structure_tensor", "energy")
    np.testing.assert_array_equal(found.node_position, SPECIMEN.mesh.node_position)
    np.testing.assert_array_equal(found.element_nodes, SPECIMEN.mesh.element_nodes)
    total = sum(ksi[:, None, None] * n[:, :, None] * n[:, None, :] for ksi, _, _, n in found.families())
    np.testing.assert_allclose(total, 1.5 * C2[:, None, None] * TENSORS, atol=1e-14)
    for _, alpha, beta, direction in found.families():
        np.testing.assert_allclose(alpha, C3, rtol=1e-15)
        np.testing.assert_array_equal(beta, 2.0)
        # An eigenvector of the networks' H, not of the elements'.
        mapped = np.einsum("eij,ej->ei", TENSORS, direction)
        assert np.abs(np.cross(mapped, direction)).max() < 1e-12
    (matrix,) = [solid for solid in found.material if solid.get("type") == "coupled Mooney-Rivlin"]
    assert {one.tag: float(one.text) for one in matrix} == {"c1": 0.025, "c2": 0.0, "k": 0.417}
    prescribed = found.prescribed(3)
    full = np.full_like(SPECIMEN.prescribed_displacement, np.nan)
    full[:, prescribed.nodes, prescribed.axes] = prescribed.values
    np.testing.assert_array_equal(full, SPECIMEN.prescribed_displacement)


def test_the_last_state_for_paraview(study):
    state = study.tissue("hgo_refit").isel(step=-1)
    found = meshio.read(study.folder / "results/tissue/hgo_refit.vtu")
    np.testing.assert_array_equal(found.point_data["displacement_mm"], state["displacement"])
    cells = {name: values[0] for name, values in found.cell_data.items()}
    assert set(cells) == {
        "cauchy_stress_MPa", "green_lagrange_strain", "maximum_shear_stress_MPa", "maximum_shear_strain",
        "fiber_direction", "C2_MPa", "C3",
    }  # fmt: skip
    np.testing.assert_array_equal(cells["C2_MPa"], state["C2"])
    np.testing.assert_array_equal(cells["C3"], state["C3"])
    np.testing.assert_array_equal(cells["fiber_direction"], SPECIMEN.fiber_direction)
    stress = state["cauchy_stress"].mean("gauss_point").values.reshape(-1, 9)
    np.testing.assert_allclose(cells["cauchy_stress_MPa"], stress, rtol=0.0, atol=1e-15)
    bare = meshio.read(study.folder / "results/tissue/matrix.vtu")
    assert set(cells) - set(bare.cell_data) == {"C2_MPa", "C3"}


def test_every_file_says_that_the_specimen_is_synthetic(study):
    feb = in_febio(study, "hgo")
    for path in (feb, study.folder / "results/tissue/hgo.vtu"):
        assert b"<!-- synthetic specimen; mm, N, MPa -->" in path.read_bytes()
        assert json.loads((path.parent / f"{path.name}.json").read_text())["config_hash"]
    assert study.specimen().attrs["origin"] == study.tissue("hgo").attrs["origin"] == "synthetic specimen"
