"""Errors of stress are what they say, and fibres of an element may be those of all."""

import numpy as np
import pytest
from fibers import exponential

from fibrous.comparison import COMPONENTS, stress_errors
from fibrous.materials.affine_fibers import AffineFibers

END = np.array([[1.239, 0.0, 0.0035], [0.0, 1.048, -0.0014], [-0.0080, 0.102, 0.770]])
PATH = np.eye(3) + np.linspace(0.0, 1.0, 5)[:, None, None] * (END - np.eye(3))
TWO_FIBERS, WEIGHTS = np.array([[1.0, 0.0, 0.0], [0.6, 0.8, 0.0]]), np.array([0.2, 0.1])


def test_a_laws_fibers_may_belong_to_one_element_or_to_all():
    law = exponential(2.5)
    shared, of_element = (
        AffineFibers(TWO_FIBERS, WEIGHTS, law),
        AffineFibers(TWO_FIBERS[None, None], WEIGHTS[None, None], law),
    )
    np.testing.assert_array_equal(of_element.stress(PATH[None])[0], shared.stress(PATH))
    np.testing.assert_array_equal(of_element.energy(PATH[None])[0], shared.energy(PATH))


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
