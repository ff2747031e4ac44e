"""The stage `fits`: load sets and single loads, whatever the batches, without the states that found no equilibrium."""

import numpy as np
import pandas as pd
import pytest

from fibrous import datasets
from fibrous.deformation import Load, averaged_stretch, load_path
from fibrous.errors import ConfigError, DatasetError
from fibrous.fitting.hgo import strain_energy
from fibrous.study import fits

CONFIG = {"largest_C3": 50.0, "slope_fit_below_r_squared": 0.5}
LOADS = ["x_uniaxial", "xy_biaxial", "xz_biaxial", "xy_shear", "xz_shear"]


def curves_file(path, numbers, unconverged=(), names=None):
    """Curves of networks whose energy is Eq. 2 with C2 = 0.1 (number + 1) and C3 = 1 + number."""
    loads = [*LOADS, "yz_shear"]
    shape = (len(numbers), len(loads), 11)
    F, magnitude, stretch, energy = np.zeros((*shape, 3, 3)), np.zeros(shape), np.zeros(shape), np.zeros(shape)
    tensors = np.array([np.diag([0.5 + 0.02 * k, 0.3 - 0.01 * k, 0.2 - 0.01 * k]) for k in numbers])
    for n, number in enumerate(numbers):
        for j, load in enumerate(loads):
            magnitude[n, j], F[n, j] = load_path(Load.parse(load), 0.8 if "shear" in load else 1.3, 10)
            stretch[n, j] = averaged_stretch(F[n, j], tensors[n])
            energy[n, j] = strain_energy(0.1 * (number + 1), 1.0 + number, stretch[n, j])
    converged = np.ones(shape, bool)
    for state in unconverged:
        converged[state] = False
    energy[~converged] = 1e6  # must not reach a fit
    zeros = np.zeros(shape)
    arrays = {
        "deformation_gradient": F, "magnitude": magnitude, "averaged_stretch": stretch, "strain_energy_density": energy,
        "cauchy_stress": np.zeros_like(F), "first_piola_kirchhoff_stress": np.zeros_like(F),
        "largest_orientation_eigenvalue": zeros, "newton_iterations": zeros.astype(int), "cuts": zeros.astype(int),
        "converged": converged, "amplitude_limited": np.zeros(shape[:2], bool), "structure_tensor": tensors,
        "name": np.array(names or [""] * len(numbers)),
    }  # fmt: skip
    coords = {"network": list(numbers), "deformation": loads, "step": np.arange(11)}
    dataset = datasets.packed(arrays, datasets.CURVES, coords)
    datasets.write(dataset, path, "curves", {"stage": "test", "config": {}, "code_hash": ""})
    return path


def run_fits(paths, output):
    load_sets = [
        {"name": "section_3_1", "loads": LOADS},
        {"name": "section_2_3", "loads": [*LOADS[:4], "yz_shear"]},
    ]
    config = {"fit": CONFIG, "load_sets": load_sets, "protocol": "large"}
    params = {"stage": "fibrous.study.fits", "config": config, "code_hash": ""}
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
        run_fits([path, path], tmp_path / "fits.csv")
    config = {"fit": CONFIG, "load_sets": [{"name": "a", "loads": ["y_uniaxial"]}], "protocol": "large"}
    with pytest.raises(ConfigError, match="y_uniaxial"):
        fits.run({"curves": [path]}, {"fits": tmp_path / "fits.csv"}, {"stage": "", "config": config, "code_hash": ""})
    assert not (tmp_path / "fits.csv").exists()
