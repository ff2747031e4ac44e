"""Errors against the coupled simulation: by formulas, by invariance, and by hand from the files."""

import numpy as np
import pandas as pd
import pytest
import synthetic_tissue
from scipy.spatial.transform import Rotation

from fibrous.comparison import Comparison, Deviation, Fields, peak_overlap
from fibrous.errors import DatasetError
from fibrous_study.datasets import read, write
from fibrous_study.schema import TABLES
from fibrous_study.steps import comparison

PARAMS = {"stage": "fibrous_study.steps.comparison", "code_hash": ""}
MODEL = {"name": "hgo", "law": "families", "constants": "fit", "energy": "structure_tensor", "objective": "energy"}
RUNS = [
    {"name": "hgo", "source": "", "refits": 0, "model": MODEL},
    {"name": "multiscale", "source": "", "refits": 0, "model": {"name": "multiscale", "law": "network"}},
    {"name": "hgo_refit", "source": "hgo", "refits": 1, "model": MODEL},
    {"name": "one_step", "source": "", "refits": 0, "model": {"name": "one_step", "law": "network"}},
]
AMOUNTS = {"hgo": 0.9, "multiscale": 1.0, "hgo_refit": 0.8}


def random_solutions(rng, elements=30):
    """F, Cauchy stress, displacements and the reaction of two solutions."""
    for _ in range(2):
        gradient = np.eye(3) + 0.2 * rng.normal(size=(elements, 8, 3, 3))
        stress = rng.normal(size=(elements, 8, 3, 3))
        yield gradient, stress + stress.swapaxes(-1, -2), rng.normal(size=(50, 3)), rng.normal(size=3)


def test_maximum_shear_of_an_element_is_the_mean_of_its_gauss_points():
    amounts = np.array([[0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8], np.full(8, 0.25)])
    gradient = np.tile(np.eye(3), (2, 8, 1, 1))
    gradient[..., 0, 1] = amounts
    stress = np.zeros((2, 8, 3, 3))
    stress[..., 0, 2] = stress[..., 2, 0] = 3.0 * amounts
    fields = Fields.of(gradient, stress, np.zeros((4, 3)), np.zeros(3))
    # Simple shear: E has the principal values γ²/4 ± √(γ⁴/16 + γ²/4) and 0 between them.
    expected = np.sqrt(amounts**4 / 16.0 + amounts**2 / 4.0).mean(axis=1)
    np.testing.assert_allclose(fields.shear_strain, expected, rtol=1e-14)
    np.testing.assert_allclose(fields.shear_stress, 3.0 * amounts.mean(axis=1), rtol=1e-14)


def test_deviations_of_numbers_and_of_vectors():
    numbers = Deviation.of([3.0, 1.0], [0.0, 5.0])
    assert (numbers.rms_error, numbers.rms_reference) == pytest.approx((np.sqrt(12.5), np.sqrt(12.5)))
    assert (numbers.relative_rms_error, numbers.largest_error) == pytest.approx((1.0, 4.0))
    vectors = Deviation.of([[1.0, 2.0], [0.0, 0.0]], [[1.0, -1.0], [4.0, 0.0]], component_axes=1)
    assert vectors.rms_error == pytest.approx(np.sqrt(12.5))
    assert vectors.rms_reference == pytest.approx(3.0)
    assert vectors.largest_error == 4.0
    assert np.isnan(Deviation.of([1.0], [0.0]).relative_rms_error)


def test_errors_do_not_depend_on_who_looks_or_in_what_unit(rng):
    found, reference = random_solutions(rng)
    plain = Comparison.of(Fields.of(*found), Fields.of(*reference))
    turn = Rotation.from_euler("xyz", [20.0, 50.0, 70.0], degrees=True).as_matrix()
    turned = [
        Fields.of(turn @ F, 1e3 * turn @ stress @ turn.T, 1e3 * u @ turn.T, 1e3 * turn @ force)
        for F, stress, u, force in (found, reference)
    ]
    seen = Comparison.of(*turned)
    for name in ("shear_stress", "shear_strain", "cauchy_stress", "displacement", "reaction"):
        one, other = getattr(plain, name), getattr(seen, name)
        unit = 1.0 if name == "shear_strain" else 1e3
        assert other.relative_rms_error == pytest.approx(one.relative_rms_error, rel=1e-10)
        assert other.rms_error == pytest.approx(unit * one.rms_error, rel=1e-10)
        assert other.largest_error == pytest.approx(unit * one.largest_error, rel=1e-10)
        assert 0.0 < one.rms_error < one.largest_error or name == "reaction"
    assert (seen.shear_stress_overlap, seen.shear_strain_overlap) == (
        plain.shear_stress_overlap,
        plain.shear_strain_overlap,
    )


def test_a_solution_does_not_deviate_from_itself(rng):
    fields = Fields.of(*next(random_solutions(rng)))
    same = Comparison.of(fields, fields)
    assert same.cauchy_stress.rms_error == same.reaction.largest_error == 0.0
    assert same.shear_stress_overlap == same.shear_strain_overlap == 1.0


def test_peaks_are_the_top_decile_and_share_a_tenth_by_chance(rng):
    reference = rng.permutation(900).astype(float)
    values = np.where(reference >= 810.0, -reference, reference)
    values[reference >= 870.0] = 1e3
    assert peak_overlap(values, reference) == pytest.approx(30 / 90)
    assert peak_overlap(values, -reference) == pytest.approx(0.0)
    shares = [peak_overlap(rng.normal(size=900), rng.normal(size=900)) for _ in range(200)]
    assert np.mean(shares) == pytest.approx(0.1, abs=0.01)
    assert peak_overlap(np.array([1.0, 2.0]), np.array([3.0, 4.0])) == 1.0


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Files of the runs, and both tables."""
    folder = tmp_path_factory.mktemp("comparison")
    for name, amount in AMOUNTS.items():
        synthetic_tissue.write_tissue(folder / f"{name}.nc", amount)
    one_step = read(folder / "hgo.nc", "tissue").isel(step=[-1]).assign_coords(step=[1])
    write(one_step, folder / "one_step.nc", "tissue", {**PARAMS, "config": {}})
    return folder, *tables(folder)


def tables(folder):
    outputs = {"comparison": folder / "comparison.csv", "steps": folder / "steps.csv"}
    config = {"reference": "multiscale", "runs": RUNS}
    inputs = {"tissue": [folder / f"{entry['name']}.nc" for entry in RUNS]}
    comparison.run(inputs, outputs, {**PARAMS, "config": config})
    return pd.read_csv(outputs["comparison"]).fillna(""), pd.read_csv(outputs["steps"])


def shear(tensor):
    """Maximum shear from singular values: those of a symmetric tensor shifted to be positive are its principal ones."""
    shifted = np.linalg.svd(tensor + 100.0 * np.eye(3), compute_uv=False)
    return 0.5 * (shifted[..., 0] - shifted[..., 2]).mean(axis=-1)


def test_the_table_has_a_row_for_every_run_but_the_reference(written):
    folder, table, _ = written
    assert table["run"].tolist() == ["hgo", "hgo_refit", "one_step"]
    assert table["refits"].tolist() == [0, 1, 0]
    assert table["law"].tolist() == ["families", "families", "network"]
    assert table["objective"].tolist() == ["energy", "energy", ""]
    assert set(table["specimen"]) == {"synthetic specimen"}
    seconds = [read(folder / f"{name}.nc", "tissue").attrs["cpu_seconds"] for name in table["run"]]
    np.testing.assert_allclose(table["cpu_seconds"], seconds)


def test_errors_are_those_of_the_last_step(written):
    folder, table, steps = written
    reference = read(folder / "multiscale.nc", "tissue").isel(step=-1)
    for _, row in table.iterrows():
        last = read(folder / f"{row['run']}.nc", "tissue").isel(step=-1)
        stress, stress_0 = last["cauchy_stress"].values, reference["cauchy_stress"].values
        F, F_0 = last["deformation_gradient"].values, reference["deformation_gradient"].values
        tensors = {"shear_stress": (stress, stress_0, "_MPa")}
        tensors["shear_strain"] = (
            *(0.5 * (np.einsum("...iJ,...iK->...JK", one, one) - np.eye(3)) for one in (F, F_0)),
            "",
        )
        for name, (found, wanted, unit) in tensors.items():
            found, wanted = shear(found), shear(wanted)
            rms = np.sqrt(np.mean((found - wanted) ** 2))
            assert row[f"{name}_rms_error{unit}"] == pytest.approx(rms, rel=1e-8)
            assert row[f"{name}_relative_rms_error"] == pytest.approx(rms / np.sqrt(np.mean(wanted**2)), rel=1e-8)
            assert row[f"{name}_largest_error{unit}"] == pytest.approx(np.abs(found - wanted).max(), rel=1e-8)
            peaks = [set(np.argsort(values)[-4:]) for values in (found, wanted)]
            assert row[f"{name}_peak_overlap"] == pytest.approx(len(peaks[0] & peaks[1]) / 4)
        whole = np.sqrt(((stress - stress_0) ** 2).sum(axis=(2, 3)).mean())
        assert row["cauchy_stress_rms_error_MPa"] == pytest.approx(whole)
        relative = whole / np.sqrt((stress_0**2).sum(axis=(2, 3)).mean())
        assert row["cauchy_stress_relative_rms_error"] == pytest.approx(relative)
        moves = np.linalg.norm((last["displacement"] - reference["displacement"]).values, axis=1)
        assert row["displacement_rms_error_mm"] == pytest.approx(np.sqrt(np.mean(moves**2)))
        # The made-up reaction of a run that moves by a is a² times a vector; the one step is that of hgo.
        amount = AMOUNTS.get(row["run"], AMOUNTS["hgo"])
        assert row["reaction_relative_error"] == pytest.approx(1.0 - amount**2)
        assert row["reaction_error_N"] == pytest.approx((1.0 - amount**2) * np.linalg.norm([1.0, 0.1, 0.02]))
        grown = steps[steps["run"] == row["run"]].iloc[-1]
        for name in steps.columns.drop(["run", "step"]):
            assert grown[name] == row[name]


def test_a_run_in_other_steps_is_compared_at_its_end(written):
    _, _, steps = written
    assert list(zip(steps["run"], steps["step"], strict=True)) == [
        *(("hgo", 1), ("hgo", 2), ("hgo_refit", 1), ("hgo_refit", 2), ("one_step", 2))
    ]
    of_hgo, of_one = (steps[steps["run"] == name].drop(columns=["run", "specimen"]) for name in ("hgo", "one_step"))
    np.testing.assert_array_equal(of_hgo.iloc[-1], of_one.iloc[-1])
    fields = [name for name in of_hgo if "reaction" not in name]
    assert (of_hgo[fields].iloc[0] != of_hgo[fields].iloc[1]).all()


def test_a_run_on_another_mesh_is_refused(written, tmp_path):
    folder, _, _ = written
    for entry in RUNS:
        (tmp_path / f"{entry['name']}.nc").write_bytes((folder / f"{entry['name']}.nc").read_bytes())
    other = read(folder / "hgo_refit.nc", "tissue").isel(element=slice(1, None))
    write(other, tmp_path / "hgo_refit.nc", "tissue", {**PARAMS, "config": {}})
    with pytest.raises(DatasetError, match=r"hgo_refit\.nc: has 39 elements where the reference has 40"):
        tables(tmp_path)
    assert not (tmp_path / "comparison.csv").exists()


def test_every_column_is_described(written):
    _, table, steps = written
    assert list(table) == list(TABLES["comparison"].columns)
    assert list(steps) == list(TABLES["comparison_steps"].columns)
