"""A law led along a path: stress is the derivative of its energy, and errors are what they say."""

import numpy as np
import pytest
from fibers import exponential

from fibrous.material_point import COMPONENTS, along_path, stress_errors
from fibrous.materials.affine_fibers import AffineFibers
from fibrous.materials.hgo import HGOFamilies, HGOStructureTensor
from fibrous.materials.neo_hookean import NeoHookean

H = np.diag([0.69, 0.21, 0.10])
END = np.array([[1.239, 0.0, 0.0035], [0.0, 1.048, -0.0014], [-0.0080, 0.102, 0.770]])
PATH = np.eye(3) + np.linspace(0.0, 1.0, 5)[:, None, None] * (END - np.eye(3))
TWO_FIBERS = np.array([[1.0, 0.0, 0.0], [0.6, 0.8, 0.0]])
LAWS = {
    "matrix": NeoHookean(0.025, 0.417),
    "families": HGOFamilies.of_structure_tensor(H, 0.1, 0.4),
    "structure_tensor": HGOStructureTensor(0.1, 0.4, H),
    "fibers": AffineFibers(TWO_FIBERS, np.array([0.2, 0.1]), exponential(2.5)),
    "fibers of one element": AffineFibers(TWO_FIBERS[None, None], np.array([[[0.2, 0.1]]]), exponential(2.5)),
}


@pytest.mark.parametrize("name", LAWS)
def test_stress_is_the_derivative_of_the_energy(name):
    response = along_path(LAWS[name], PATH)
    assert response.strain_energy_density.shape == (5,)
    step, derivative = 1e-6, np.empty((5, 3, 3))
    for i, j in np.ndindex(3, 3):
        change = np.zeros((3, 3))
        change[i, j] = step
        energies = [along_path(LAWS[name], PATH + sign * change).strain_energy_density for sign in (1.0, -1.0)]
        derivative[:, i, j] = (energies[0] - energies[1]) / (2.0 * step)
    expected = derivative @ PATH.swapaxes(1, 2) / np.linalg.det(PATH)[:, None, None]
    # At rest a law for tension alone has a corner in its second derivative, so that central differences are of order 1.
    np.testing.assert_allclose(response.cauchy_stress, expected, atol=2e-7)
    assert np.abs(response.cauchy_stress[-1]).max() > 0.01


def test_a_laws_fibers_may_belong_to_one_element_or_to_all():
    one, all_ = (along_path(LAWS[name], PATH) for name in ("fibers of one element", "fibers"))
    np.testing.assert_array_equal(one.cauchy_stress, all_.cauchy_stress)
    np.testing.assert_array_equal(one.strain_energy_density, all_.strain_energy_density)


def test_errors_of_components_and_of_the_tensor():
    reference = np.zeros((2, 3, 3))
    reference[:, 0, 0] = 3.0, 4.0
    stress = reference.copy()
    stress[:, 0, 0] += 2.0, -1.0
    stress[:, 1, 2] += 1.0, 0.0
    stress[:, 2, 1] += 1.0, 0.0
    errors = stress_errors(stress, reference)
    assert list(errors) == ["xx", "yy", "zz", "xy", "xz", "yz", "all"]
    xx, yz, whole = errors["xx"], errors["yz"], errors["all"]
    assert (xx.rms_error, xx.rms_reference) == pytest.approx((np.sqrt(2.5), np.sqrt(12.5)))
    assert (xx.largest_error, xx.end_error) == (2.0, -1.0)
    assert xx.relative_rms_error == pytest.approx(np.sqrt(0.2))
    assert (yz.rms_error, yz.largest_error, yz.end_error) == pytest.approx((np.sqrt(0.5), 1.0, 0.0))
    assert np.isnan(yz.relative_rms_error)
    # Both off-diagonal entries count: 4 + 1 + 1 at the first step, 1 at the second.
    assert (whole.rms_error, whole.largest_error, whole.end_error) == pytest.approx((np.sqrt(3.5), np.sqrt(6.0), 1.0))
    squares = sum((1.0 if i == j else 2.0) * errors[name].rms_error ** 2 for name, (i, j) in COMPONENTS.items())
    assert whole.rms_error**2 == pytest.approx(squares)
