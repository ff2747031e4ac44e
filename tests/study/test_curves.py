"""Curves: one form for all networks, whose parts are what they would be alone, and which a file holds unchanged."""

from dataclasses import replace

import numpy as np
import pytest
from made_up_evidence import LOADS, curves

from fibrous.curves import Curves
from fibrous.deformation import averaged_stretch
from fibrous.errors import DatasetError, FitError
from fibrous.fitting.hgo import fit_hgo
from fibrous_study import datasets
from fibrous_study.curve_datasets import read_curves, write_curves

PARAMS = {"stage": "test", "config": {}, "code_hash": ""}
TENSORS = np.array([np.diag([0.6, 0.25, 0.15]), np.diag([0.2, 0.3, 0.5])])


@pytest.fixture
def made() -> Curves:
    """Two networks, the second of which loses its equilibrium at the end of one load."""
    made = replace(curves(tensors=TENSORS, steps=4), names=np.array(["a", "b"]), numbers=np.array([7, 3]))
    for name in ("strain_energy_density", "cauchy_stress", "first_piola_kirchhoff_stress"):
        getattr(made, name)[1, 2, 3:] = np.nan
    made.amplitude_limited[0, 4] = True
    eigenvalue = np.where(made.converged, made.largest_orientation_eigenvalue, np.nan)
    return replace(made, largest_orientation_eigenvalue=eigenvalue)


def assert_equal(curves: Curves, others: Curves) -> None:
    for name, value in vars(curves).items():
        np.testing.assert_array_equal(value, getattr(others, name), err_msg=name)


def test_the_networks_of_files_come_back_with_every_bit(tmp_path, made):
    for i, name in enumerate("ab"):
        write_curves(made.network(i), tmp_path / f"{name}.nc", PARAMS)
    assert_equal(read_curves([tmp_path / "a.nc", tmp_path / "b.nc"]), made)
    file = datasets.read(tmp_path / "b.nc", "curves")
    np.testing.assert_array_equal(file["converged"][0], made.converged[1])
    np.testing.assert_array_equal(file["averaged_stretch"][0], made.averaged_stretch[1])


def test_what_a_file_holds_of_a_state_without_equilibrium_is_not_read(tmp_path, made):
    write_curves(made, tmp_path / "a.nc", PARAMS)
    file = datasets.read(tmp_path / "a.nc", "curves")
    lost = ~file["converged"].values
    assert lost.sum() == 2
    for variable in file.data_vars.values():
        if variable.shape[:3] == lost.shape and np.isnan(variable.values[lost]).any():
            variable.values[lost] = 1e9
    datasets.write(file, tmp_path / "b.nc", "curves", PARAMS)
    assert_equal(read_curves([tmp_path / "b.nc"]), made)


def test_files_of_other_loads_or_steps_are_refused(tmp_path, made):
    write_curves(made, tmp_path / "a.nc", PARAMS)
    for other in (made.under(LOADS[:2]), curves(steps=3)):
        write_curves(other, tmp_path / "b.nc", PARAMS)
        with pytest.raises(DatasetError, match=r"b\.nc: holds other deformations than .*a\.nc"):
            read_curves([tmp_path / "a.nc", tmp_path / "b.nc"])


def test_parts_put_together_are_the_whole(made):
    assert_equal(Curves.joined([made.called("a"), made.called("b")]), made)
    assert_equal(made.under(LOADS[::-1]).under(LOADS), made)
    assert_equal(made.of(made.known), made.network(0))
    assert len(made.called("nobody").averaged_stretch) == 0


def test_every_network_has_its_own_averaged_stretch(made):
    for F, H, stretch in zip(made.deformation_gradient, TENSORS, made.averaged_stretch, strict=True):
        np.testing.assert_array_equal(stretch, averaged_stretch(F, H))
        np.testing.assert_allclose(stretch**2, np.einsum("...iJ,...iK,JK", F, F, H), rtol=1e-14)


def test_constants_are_those_of_one_network(made):
    options = {"tension_only": True, "largest_C3": 50.0, "slope_fit_below_r_squared": 0.5}
    fit = fit_hgo(made.network(1), **options)
    assert pytest.approx((0.2, 0.5), rel=1e-6) == (fit.C2, fit.C3)
    with pytest.raises(FitError, match="2 networks"):
        fit_hgo(made, **options)


@pytest.mark.parametrize("name", ["numbers", "structure_tensor", "cauchy_stress", "amplitude_limited", "cuts"])
def test_arrays_that_do_not_fit_together_are_refused(made, name):
    with pytest.raises(FitError, match=name):
        replace(made, **{name: getattr(made, name)[:1]})
