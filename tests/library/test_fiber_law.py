"""The fibre law of Eq. 6 against arbitrary-precision integration and differences, and a fibre that buckles."""

import mpmath
import numpy as np
import pytest
from fibers import buckling, exponential
from hypothesis import given
from hypothesis import strategies as st

from fibrous.errors import ConfigError
from fibrous.networks.fiber_law import FIRST, SECTION

STRETCHES = [
    0.05,
    0.5,
    0.9499,
    0.9501,
    0.99,
    1 - 1e-7,
    1 + 1e-9,
    1 + 1e-4,
    1.0499,
    1.0501,
    1.3,
    1.8,
    2.6,
    3.5,
    6.0,
    10.0,
]


def exact_energy(stretch: float, nonlinearity: float) -> float:
    B = mpmath.mpf(nonlinearity)
    with mpmath.workdps(40):
        return float(
            mpmath.quad(lambda s: mpmath.expm1(B * (s * s - 1) / 2) / B, mpmath.linspace(1, mpmath.mpf(stretch), 9))
        )


@pytest.mark.parametrize("nonlinearity", [0.1, 2.5, 20.0, 50.0])
@pytest.mark.parametrize("stretch", [one for one in STRETCHES if one < 5.0])
def test_energy_is_the_integral_of_the_force(stretch, nonlinearity):
    assert exponential(nonlinearity).energy(stretch) == pytest.approx(exact_energy(stretch, nonlinearity), rel=2e-12)


@pytest.mark.parametrize("stretch", STRETCHES)
def test_force_is_the_printed_law(stretch):
    force, _ = exponential(2.5).response(stretch)
    with mpmath.workdps(40):
        green = (mpmath.mpf(stretch) ** 2 - 1) / 2
        printed = float((mpmath.exp(mpmath.mpf(2.5) * green) - 1) / mpmath.mpf(2.5))
    assert force == pytest.approx(printed, rel=1e-12)


@given(st.floats(0.01, 5.0), st.floats(0.1, 5.0))
def test_stiffness_is_the_slope_of_the_force(stretch, nonlinearity):
    law = exponential(nonlinearity)
    step = 1e-5
    slope = (law.response(stretch + step)[0] - law.response(stretch - step)[0]) / (2.0 * step)
    assert law.response(stretch)[1] == pytest.approx(slope, rel=1e-4)


def test_fibers_pull_when_stretched_push_little_when_shortened():
    law = exponential(2.5)
    force, stiffness = law.response(np.array([0.0, 0.5, 1.0, 1.5]))
    assert force[2] == 0.0
    assert (np.diff(force) > 0).all()
    assert -force[0] < 1.0 / 2.5
    assert stiffness[2] == 1.0
    assert law.energy(1.0) == 0.0
    assert (law.energy(np.array([0.2, 0.9, 1.1, 2.0])) > 0.0).all()


def test_no_overflow_at_any_stretch_of_the_study():
    force, stiffness = exponential(2.5).response(23.0)
    assert np.isfinite([force, stiffness, exponential(2.5).energy(23.0)]).all()


def test_beyond_the_cut_off_force_is_linear_and_energy_its_integral():
    law, free = exponential(2.5, linear_beyond_stretch=1.4), exponential(2.5)
    below = np.array([0.7, 1.0, 1.39])
    for extended, printed in zip(law.response(below), free.response(below), strict=True):
        np.testing.assert_array_equal(extended, printed)
    np.testing.assert_array_equal(law.energy(below), free.energy(below))
    stretches = np.linspace(1.4, 40.0, 7)
    force, stiffness = law.response(stretches)
    np.testing.assert_allclose(np.diff(force, 2), 0.0, atol=1e-9)
    np.testing.assert_allclose(stiffness, free.response(1.4)[1])
    trapezoids = np.concatenate([[0.0], np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(stretches))])
    np.testing.assert_allclose(law.energy(stretches) - free.energy(1.4), trapezoids, rtol=1e-12)


@given(st.floats(0.0, 5.0), st.floats(0.01, 3.0))
def test_a_fiber_that_buckles_is_two_springs(stretch, compressive):
    law, stiff = buckling(compressive), compressive if stretch < 1.0 else 1.0
    force, stiffness = law.response(stretch)
    assert force == pytest.approx(stiff * (stretch - 1.0), rel=1e-14)
    assert stiffness == stiff
    assert law.energy(stretch) == pytest.approx(0.5 * stiff * (stretch - 1.0) ** 2, rel=1e-14)


def test_fibers_have_sections_and_rest_lengths_of_their_own():
    lengths, rest, section = np.array([0.1, 0.2, 0.4]), np.array([0.9, 1.0, 1.1]), np.array([1.0, 2.0, 3.0])
    fibers = buckling(0.5, section=section, rest_length=rest).fibers(lengths)
    np.testing.assert_allclose(fibers.rest_lengths, [0.09, 0.2, 0.44], rtol=1e-15)
    np.testing.assert_array_equal(fibers.constants[:, SECTION], section)
    np.testing.assert_array_equal(fibers.constants[:, FIRST], 0.5)


@pytest.mark.parametrize(
    "constants", [(0.0,), (-1.0,), (np.nan,), (2.5, 1.0), (2.5, np.nan), (2.5, 2.0, 0.0), (2.5, 2.0, np.inf)]
)
def test_impossible_constants_are_refused(constants):
    with pytest.raises(ConfigError):
        exponential(**dict(zip(("nonlinearity", "linear_beyond_stretch", "modulus_MPa"), constants, strict=False)))
