"""The stage `fits`: load sets and single loads, whatever the batches, without the states that found no equilibrium."""

import numpy as np
import pandas as pd
import pytest

from fibrous.deformation import Load, averaged_stretch, load_path
from fibrous.errors import ConfigError, DatasetError
from fibrous.materials.hgo import HGOStructureTensor
from fibrous_study import datasets
from fibrous_study.steps import hgo_fits as fits

QUANTITIES = ("energy", "stress")
CONFIG = {"largest_C3": 50.0, "slope_fit_below_r_squared": 0.5}
EQ_2 = [{"energy": "structure_tensor", "objective": "energy"}]
FORMS = [{"energy": law, "objective": quantity} for law in ("structure_tensor", "families") for quantity in QUANTITIES]
LOADS = ["x_uniaxial", "xy_biaxial", "xz_biaxial", "xy_shear", "xz_shear"]


def curves_file(path, numbers, unconverged=(), names=None):
    """Curves of networks that answer as Eq. 2 does with C2 = 0.1 (number + 1) and C3 = 1 + number."""
    loads = [*LOADS, "yz_shear"]
    shape = (len(numbers), len(loads), 11)
    F, magnitude, stretch, energy = np.zeros((*shape, 3, 3)), np.zeros(shape), np.zeros(shape), np.zeros(shape)
    stress = np.zeros_like(F)
    tensors = np.array([np.diag([0.5 + 0.02 * k, 0.3 - 0.01 * k, 0.2 - 0.01 * k]) for k in numbers])
    for n, number in enumerate(numbers):
        law = HGOStructureTensor(0.1 * (number + 1), 1.0 + number, tensors[n])
        for j, load in enumerate(loads):
            magnitude[n, j], F[n, j] = load_path(Load.parse(load), 0.8 if "shear" in load else 1.3, 10)
            stretch[n, j] = averaged_stretch(F[n, j], tensors[n])
            energy[n, j], stress[n, j] = law.energy(F[n, j]), law(F[n, j])[0] @ np.swapaxes(F[n, j], -1, -2)
    converged = np.ones(shape, bool)
    for state in unconverged:
        converged[state] = False
    energy[~converged], stress[~converged] = 1e6, 1e6  # must not reach a fit
    zeros = np.zeros(shape)
    arrays = {
        "deformation_gradient": F, "magnitude": magnitude, "averaged_stretch": stretch, "strain_energy_density": energy,
        "cauchy_stress": stress, "first_piola_kirchhoff_stress": np.zeros_like(F),
        "largest_orientation_eigenvalue": zeros, "newton_iterations": zeros.astype(int), "cuts": zeros.astype(int),
        "converged": converged, "amplitude_limited": np.zeros(shape[:2], bool), "structure_tensor": tensors,
        "name": np.array(names or [""] * len(numbers)),
    }  # fmt: skip
    coords = {"network": list(numbers), "deformation": loads, "step": np.arange(11)}
    dataset = datasets.packed(arrays, "curves", coords)
    datasets.write(dataset, path, "curves", {"stage": "test", "config": {}, "code_hash": ""})
    return path


def run_fits(paths, output, forms=EQ_2, tension_only=True):
    load_sets = [
        {"name": "section_3_1", "loads": LOADS},
        {"name": "section_2_3", "loads": [*LOADS[:4], "yz_shear"]},
    ]
    config = {"fit": CONFIG, "forms": forms, "tension_only": tension_only, "load_sets": load_sets, "protocol": "large"}
    params = {"stage": "fibrous_study.steps.hgo_fits", "config": config, "code_hash": ""}
    fits.run({"curves": paths}, {"fits": output}, params)
    return pd.read_csv(output, keep_default_na=True)


def test_the_stage_fits_load_sets_and_loads_and_does_not_depend_on_batches(tmp_path):
    whole = [curves_file(tmp_path / "whole.nc", [0, 1, 2, 3])]
    parts = [curves_file(tmp_path / "b.nc", [2, 3]), curves_file(tmp_path / "a.nc", [0, 1])]
    table = run_fits(whole, tmp_path / "one.csv")
    run_fits(parts, tmp_path / "two.csv")
    assert (tmp_path / "one.csv").read_bytes() == (tmp_path / "two.csv").read_bytes()
    assert " ".join(table.columns) == (
        "network load_set deformation energy objective H11 H22 H33 H12 H13 H23 lambda_f_max C2_MPa C3 "
        "C2_half_width_MPa C3_half_width r_squared rule identifiable points_used points_dropped name"
    )
    keys = [("section_3_1", "all"), ("section_2_3", "all"), *(("single", load) for load in [*LOADS, "yz_shear"])]
    assert list(zip(table["load_set"], table["deformation"], strict=True)) == 4 * keys
    np.testing.assert_allclose(table["C2_MPa"], 0.1 * (table["network"] + 1.0), rtol=1e-6)
    np.testing.assert_allclose(table["C3"], 1.0 + table["network"], rtol=1e-6)
    pooled = table[table["deformation"] == "all"]
    assert list(pooled["points_used"] + pooled["points_dropped"]) == 8 * [50]
    np.testing.assert_allclose(pooled["H11"], 0.5 + 0.02 * pooled["network"])


def test_every_form_has_its_rows_after_one_another_and_its_own_constants(tmp_path):
    path = curves_file(tmp_path / "c.nc", [0, 1], unconverged=[(0, 0, 7)])
    table = run_fits([path], tmp_path / "all.csv", FORMS)
    forms = [(form["energy"], form["objective"]) for form in FORMS for _ in range(8)]
    assert list(zip(table["energy"], table["objective"], strict=True)) == 2 * forms
    assert list(table["network"]) == 32 * [0] + 32 * [1]
    eq_2 = table[table["energy"] == "structure_tensor"]
    np.testing.assert_allclose(eq_2["C2_MPa"], 0.1 * (eq_2["network"] + 1.0), rtol=1e-6)
    np.testing.assert_allclose(eq_2["C3"], 1.0 + eq_2["network"], rtol=1e-6)
    assert eq_2["r_squared"].min() > 1.0 - 1e-9
    # Eq. 10C is the stiffer with the same constants, so fitted to the same energy its constants are smaller.
    pooled = table[(table["deformation"] == "all") & (table["objective"] == "energy")].set_index(
        ["network", "load_set"]
    )
    families, averaged = (pooled[pooled["energy"] == name] for name in ("families", "structure_tensor"))
    assert (families["C2_MPa"] < averaged["C2_MPa"]).all()
    assert families["r_squared"].lt(0.99).all()
    for form in FORMS:
        alone = run_fits([path], tmp_path / "one.csv", [form])
        rows = (table["energy"] == form["energy"]) & (table["objective"] == form["objective"])
        pd.testing.assert_frame_equal(alone, table[rows].reset_index(drop=True), check_exact=True)


def test_tension_only_or_as_printed_reaches_the_families_alone(tmp_path):
    path = curves_file(tmp_path / "c.nc", [2])
    one, other = (run_fits([path], tmp_path / f"{switch}.csv", FORMS, switch) for switch in (True, False))
    eq_2 = one["energy"] == "structure_tensor"
    pd.testing.assert_frame_equal(one[eq_2], other[eq_2], check_exact=True)
    pooled = ~eq_2 & (one["deformation"] == "all")  # loads that shorten a family stand in every set
    assert (one[pooled]["C2_MPa"] > other[pooled]["C2_MPa"]).all()


def test_the_stage_names_and_leaves_out_states_without_equilibrium(tmp_path, capsys):
    path = curves_file(tmp_path / "c.nc", [4, 5], unconverged=[(1, 2, 7)], names=["left", "right"])
    table = run_fits([path], tmp_path / "fits.csv").set_index(["network", "load_set", "deformation"])
    assert capsys.readouterr().err.splitlines() == [
        "network 5 (right), xz_biaxial, step 7: no equilibrium was found; the state is left out of the fits"
    ]
    row = table.loc[(5, "single", "xz_biaxial")]
    assert (row["points_used"], row["points_dropped"]) == (9, 1)
    assert row["C2_MPa"] == pytest.approx(0.6, rel=1e-6)
    assert set(table["name"]) == {"left", "right"}


def test_the_stage_refuses_what_does_not_belong_together(tmp_path):
    path = curves_file(tmp_path / "c.nc", [0])
    with pytest.raises(DatasetError, match="network 0"):
        run_fits([path, path], tmp_path / "fits.csv", FORMS)
    load_sets = [{"name": "a", "loads": ["y_uniaxial"]}]
    config = {"fit": CONFIG, "forms": EQ_2, "tension_only": True, "load_sets": load_sets, "protocol": "large"}
    with pytest.raises(ConfigError, match="y_uniaxial"):
        fits.run({"curves": [path]}, {"fits": tmp_path / "fits.csv"}, {"stage": "", "config": config, "code_hash": ""})
    assert not (tmp_path / "fits.csv").exists()
