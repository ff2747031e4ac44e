"""Eq. 2 fitted to energy: known ones are recovered, other optimisers agree, and section 2.5's rules hold."""

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brute, curve_fit, least_squares
from scipy.stats import t as student

from fibrous.curves import Curves
from fibrous.fitting.hgo import (
    LARGEST_EXPONENT,
    energy_slope,
    fit_hgo,
    strain_energy,
)

LARGEST_C3 = 50.0
CONFIG = {"largest_C3": LARGEST_C3, "slope_fit_below_r_squared": 0.5}


def fitted(stretch, energy, **changes):
    """Fit to curves of fibres along x alone, which F stretches by λ_f; the root of a square is exact."""
    stretch, energy = np.atleast_2d(stretch).astype(float), np.atleast_2d(energy).astype(float)
    F = np.tile(np.eye(3), (*stretch.shape, 1, 1))
    F[..., 0, 0] = stretch
    curves = Curves.of_network(F, np.diag([1.0, 0.0, 0.0]), energy, np.full(F.shape, np.nan))
    return fit_hgo(curves, **{**CONFIG, **changes})


def constants(fit):
    return fit.C2, fit.C3


def five_curves(end, steps=20, seed=3):
    """λ_f of five loads, shape (5, steps + 1), that end near `end`."""
    ends = end - (end - 1.0) * np.random.default_rng(seed).uniform(0.0, 0.15, 5)
    return 1.0 + np.linspace(0.0, 1.0, steps + 1) ** 1.5 * (ends[:, None] - 1.0)


def noisy(seed=0, C2=0.3, C3=0.8, end=1.6, deviation=0.02):
    stretch = five_curves(end)
    energy = strain_energy(C2, C3, stretch)
    return stretch, energy + deviation * np.random.default_rng(seed).normal(size=energy.shape)


# The law itself


@given(st.floats(0.0, 50.0), st.floats(1e-6, 3.0))
def test_energy_is_eq_2_and_its_slope_is_the_derivative(C3, above):
    stretch = 1.0 + above
    if C3 * (stretch**2 - 1.0) ** 2 > LARGEST_EXPONENT:
        return
    with mpmath.workdps(40):
        law = mpmath.mpf(C3)

        def eq_2(value):
            square = (value**2 - 1) ** 2
            return square if law == 0 else mpmath.expm1(law * square) / law

        energy = eq_2(mpmath.mpf(stretch))
    assert float(strain_energy(2.0, C3, stretch)) == pytest.approx(float(energy), rel=1e-11)


def test_energy_of_vanishing_c3_is_the_quadratic_limit():
    stretch = np.linspace(1.0, 2.0, 11)
    limit = 0.5 * 0.7 * (stretch**2 - 1.0) ** 2
    np.testing.assert_allclose(strain_energy(0.7, 0.0, stretch), limit, rtol=1e-14, atol=1e-30)
    np.testing.assert_allclose(strain_energy(0.7, 1e-12, stretch), limit, rtol=1e-10, atol=1e-30)


def test_energy_slope_is_the_stated_formula_and_exact_for_parabolas():
    stretch = 1.0 + np.array([0.0, 0.01, 0.04, 0.05, 0.11])
    np.testing.assert_allclose(energy_slope(stretch, 3.0 * stretch**2 - stretch), 6.0 * stretch - 1.0, rtol=1e-11)
    energy = strain_energy(1.0, 2.0, stretch)
    a, b = stretch[2] - stretch[1], stretch[3] - stretch[2]
    expected = (a**2 * energy[3] - b**2 * energy[1] + (b**2 - a**2) * energy[2]) / (a * b * (a + b))
    assert energy_slope(stretch, energy)[2] == pytest.approx(expected, rel=1e-12)


def test_energy_slope_converges_with_second_order():
    errors = []
    for points in (41, 81, 161):
        stretch = 1.0 + 0.5 * np.linspace(0.0, 1.0, points) ** 1.3
        exact = 2.0 * stretch * (stretch**2 - 1.0) * np.exp((stretch**2 - 1.0) ** 2)
        error = energy_slope(stretch, strain_energy(1.0, 1.0, stretch)) - exact
        errors.append(np.abs(error[1:]).max())
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(rates > 1.85)


# Recovery


@settings(deadline=None, max_examples=60)
@given(st.floats(-4.0, 2.0), st.floats(-2.0, 1.6), st.floats(1.02, 1.9))
def test_known_constants_come_back_from_pooled_curves(log_C2, log_C3, end):
    C2, C3 = 10.0**log_C2, 10.0**log_C3
    if C3 * (end**2 - 1.0) ** 2 > 25.0:
        return  # one point would hold all of the energy
    stretch = five_curves(end)
    fit = fitted(stretch, strain_energy(C2, C3, stretch))
    assert constants(fit) == pytest.approx((C2, C3), rel=1e-6)
    assert fit.r_squared == pytest.approx(1.0, abs=1e-12)
    assert fit.identifiable
    assert fit.rule == fit.objective == "energy"
    assert fit.C3_half_width < 1e-5 * C3
    assert fit.largest_stretch == stretch.max()


@pytest.mark.parametrize("seed", range(6))
def test_two_independent_optimisers_find_the_same_minimum(seed):
    stretch, energy = noisy(seed, C2=0.2, C3=0.3 + 0.5 * seed, end=1.5, deviation=0.05)
    fit = fitted(stretch, energy)
    points, data = stretch[:, 1:].ravel(), energy[:, 1:].ravel()

    def residual(constants):
        return strain_energy(*constants, points) - data

    local = least_squares(
        residual, [0.1, 1.0], bounds=([0, 0], [np.inf, LARGEST_C3]), xtol=1e-15, ftol=1e-15, gtol=1e-15
    )
    assert constants(fit) == pytest.approx(tuple(local.x), rel=1e-5)
    cells = brute(lambda c: np.sum(residual(c) ** 2), ((0.0, 0.6), (0.0, 8.0)), Ns=61, finish=None, full_output=True)
    assert np.sum(residual((fit.C2, fit.C3)) ** 2) <= cells[1]
    assert constants(fit) == pytest.approx(tuple(cells[0]), abs=0.15)


@pytest.mark.parametrize(
    ("stretch", "energy"),
    [
        ([1.0, 1.255, 1.791, 1.836], [0.0, 0.876, 0.059, 0.336]),  # C3 = 0 is a minimum too, but not the least
        ([1.0, 1.163, 1.418, 1.851, 1.912], [0.0, 0.0, 0.557, 0.072, 0.571]),
        ([1.0, 1.324, 1.371, 1.496, 1.535, 1.58, 1.892, 1.935], [0.0, 0.033, 0.21, 0.039, 0.06, 0.706, 0.012, 0.242]),
    ],
)
def test_the_least_of_several_minima_is_found(stretch, energy):
    """Hostile data with two valleys in C3, against the sum of squares on 20,000 values of C3."""
    fit = fitted(stretch, energy, slope_fit_below_r_squared=-np.inf)
    points, data = np.array(stretch[1:]), np.array(energy[1:])
    squares, q = [], (points**2 - 1) ** 2
    for C3 in np.geomspace(1e-5, LARGEST_C3, 20000):
        shape = np.exp(C3 * (q - q.max())) - np.exp(-C3 * q.max())
        squares.append(np.sum((data - shape * max(0.0, shape @ data) / (shape @ shape)) ** 2))
    inner = np.array(squares[1:-1])
    ends = (squares[0] < squares[1], squares[-1] < squares[-2])
    assert np.sum((inner < squares[:-2]) & (inner < squares[2:])) + sum(ends) == 2
    ours = np.sum((data - strain_energy(fit.C2, fit.C3, points)) ** 2)
    assert ours <= min(squares) + 1e-12


def test_order_of_the_curves_does_not_matter():
    stretch, energy = noisy(1)
    one, other = fitted(stretch, energy), fitted(stretch[::-1], energy[::-1])
    assert (one.C2, one.C3, one.C2_half_width) == pytest.approx((other.C2, other.C3, other.C2_half_width), rel=1e-9)


# Half-widths and R²


def test_half_widths_are_students_from_the_jacobian():
    stretch, energy = noisy(5)
    points, data = stretch[:, 1:].ravel(), energy[:, 1:].ravel()
    fit = fitted(stretch, energy)
    best, covariance = curve_fit(
        lambda x, C2, C3: C2 / (2 * C3) * np.expm1(C3 * (x**2 - 1) ** 2), points, data, p0=[0.3, 0.8], xtol=1e-14
    )
    expected = student.ppf(0.975, points.size - 2) * np.sqrt(np.diag(covariance))
    assert constants(fit) == pytest.approx(tuple(best), rel=1e-6)
    assert (fit.C2_half_width, fit.C3_half_width) == pytest.approx(tuple(expected), rel=1e-4)


def test_half_widths_cover_the_truth_19_times_in_20():
    """400 repetitions: the standard error of the fraction covered is 1.1 %."""
    repetitions, covered = 400, np.zeros(2)
    for seed in range(repetitions):
        fit = fitted(*noisy(seed))
        covered += abs(fit.C2 - 0.3) < fit.C2_half_width, abs(fit.C3 - 0.8) < fit.C3_half_width
    assert np.all(np.abs(covered / repetitions - 0.95) < 0.035)


def test_r_squared_is_about_the_mean_of_the_same_points():
    stretch, energy = noisy(2)
    fit = fitted(stretch, energy)
    points, data = stretch[:, 1:], energy[:, 1:]
    model = strain_energy(fit.C2, fit.C3, points)
    assert fit.r_squared == pytest.approx(1.0 - np.sum((data - model) ** 2) / np.sum((data - data.mean()) ** 2))


# Bounds, overflow, scales


def test_c3_stops_at_its_upper_bound():
    stretch = five_curves(1.15)
    fit = fitted(stretch, strain_energy(1.0, 60.0, stretch))
    assert fit.C3 == LARGEST_C3
    assert not fit.identifiable
    assert np.isnan(fit.C3_half_width)
    assert fit.C2_half_width > 0.0


def test_a_curve_that_bends_down_ends_at_c3_zero_with_the_regression_through_the_origin():
    stretch = np.linspace(1.0, 1.5, 21)
    energy = 0.4 * (stretch - 1.0) ** 1.2
    fit = fitted(stretch, energy)
    assert fit.C3 == 0.0
    assert not fit.identifiable
    assert np.isnan(fit.C3_half_width)
    regressor = 0.5 * (stretch[1:] ** 2 - 1.0) ** 2
    C2 = regressor @ energy[1:] / (regressor @ regressor)
    deviation = np.sqrt(np.sum((energy[1:] - C2 * regressor) ** 2) / 19.0 / (regressor @ regressor))
    assert constants(fit) == pytest.approx((C2, 0.0), rel=1e-12)
    assert fit.C2_half_width == pytest.approx(student.ppf(0.975, 19) * deviation, rel=1e-10)


@pytest.mark.parametrize("sign", [0.0, -1.0])
def test_c2_is_never_negative(sign):
    stretch = five_curves(1.5)
    fit = fitted(stretch, sign * strain_energy(1.0, 1.0, stretch))
    assert (fit.C2, fit.C3) == (0.0, 0.0)
    assert not fit.identifiable
    assert np.isnan(fit.C2_half_width)


@pytest.mark.parametrize("C3", [1e-3, 0.004])
def test_nothing_overflows_where_i4_less_one_is_80(C3):
    stretch = five_curves(9.0)
    with np.errstate(over="raise", invalid="raise", divide="raise"):
        fit = fitted(stretch, strain_energy(1e-3, C3, stretch))
    assert constants(fit) == pytest.approx((1e-3, C3), rel=1e-6)


@pytest.mark.parametrize("data", ["one point", "noise"])
def test_a_hopeless_curve_up_to_80_still_gives_finite_constants(data):
    stretch = np.linspace(1.0, 9.0, 21)
    energy = np.random.default_rng(0).uniform(0.5, 1.0, 21) if data == "noise" else np.eye(21)[-1]
    with np.errstate(over="raise", invalid="raise", divide="raise"):
        fit = fitted(stretch, energy)
        assert np.isfinite([fit.C2, fit.C3, fit.r_squared]).all()
        assert np.isfinite(strain_energy(fit.C2, fit.C3, stretch)).all()
    assert 0.0 <= fit.C3 <= LARGEST_C3
    if data == "one point":
        assert not fit.identifiable
        assert fit.C2 > 0.0


@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_units_of_energy_scale_c2_alone(factor):
    single = np.linspace(1.0, 1.3, 21)
    for stretch, energy in [noisy(4), (single, 1.0 + strain_energy(1.0, 2.0, single)), (single, (single - 1.0))]:
        one, other = fitted(stretch, energy), fitted(stretch, factor * energy)
        assert other.C2_half_width == pytest.approx(factor * one.C2_half_width, rel=1e-9, nan_ok=True)
        assert constants(other) == pytest.approx((factor * one.C2, one.C3), rel=1e-9)
        decisions = ("rule", "objective", "identifiable", "points_used", "points_dropped")
        assert [getattr(one, name) for name in decisions] == [getattr(other, name) for name in decisions]


def test_a_single_point_cannot_tell_the_constants_apart():
    fit = fitted([1.0, 1.4], [0.0, 0.5])
    assert constants(fit) == pytest.approx((2 * 0.5 / (1.4**2 - 1) ** 2, 0.0))
    assert not fit.identifiable
    assert np.isnan([fit.C2_half_width, fit.C3_half_width, fit.r_squared]).all()


# The rules of section 2.5


def test_no_stretch_above_one_means_no_fibres():
    fit = fitted([1.0, 0.98, 0.95, 1.0], [0.0, 0.1, 0.2, 0.3])
    assert (fit.C2, fit.rule, fit.points_used, fit.points_dropped) == (0.0, "zero", 0, 3)
    assert fit.largest_stretch == 1.0
    assert not fit.identifiable


def test_stretches_above_one_without_equilibrium_are_no_zero_fit():
    fit = fitted([1.0, 0.98, 1.1], [0.0, 0.1, np.nan])
    assert fit.rule == "none"
    assert np.isnan([fit.C2, fit.C3]).all()
    assert fit.points_dropped == 2


def dipping_curve(steps=400):
    """λ_f falls below 1 and the network stores energy meanwhile; afterwards its slope is that of Eq. 2."""
    stretch = 1.0 + np.linspace(0.0, 1.0, steps + 1) * (np.linspace(0.0, 1.0, steps + 1) - 0.4)
    turn = int(np.argmin(stretch))
    energy = np.where(np.arange(steps + 1) < turn, 2.0, 5.0 + strain_energy(0.4, 1.5, np.maximum(stretch, 1.0)))
    energy[0] = 0.0
    return stretch, energy


def test_a_poor_fit_to_one_deformation_becomes_a_fit_of_the_slope():
    stretch, energy = dipping_curve()
    fit = fitted(stretch, energy)
    assert (fit.rule, fit.objective) == ("slope", "slope")
    assert constants(fit) == pytest.approx((0.4, 1.5), rel=0.01)
    assert fit.r_squared > 0.999
    above = stretch[1:] > 1.0
    assert fit.points_used == above.sum()
    assert fit.points_dropped == (~above).sum()


def test_the_slope_fit_is_least_squares_of_the_finite_differences():
    stretch = np.linspace(1.0, 1.5, 21) ** 1.1
    energy = 1.0 + strain_energy(0.2, 2.0, stretch) + 0.02 * np.sin(40.0 * stretch)
    fit = fitted(stretch, energy, slope_fit_below_r_squared=2.0)
    slope = energy_slope(stretch, energy)[1:]

    def residual(c):
        return 2 * c[0] * stretch[1:] * (stretch[1:] ** 2 - 1) * np.exp(c[1] * (stretch[1:] ** 2 - 1) ** 2) - slope

    best = least_squares(residual, [0.2, 2.0], bounds=([0, 0], [np.inf, 50]), xtol=1e-15, ftol=1e-15, gtol=1e-15)
    assert constants(fit) == pytest.approx(tuple(best.x), rel=1e-6)
    assert fit.r_squared == pytest.approx(1 - 2 * best.cost / np.sum((slope - slope.mean()) ** 2))


def test_the_slope_rule_is_for_single_deformations_and_poor_fits_only():
    stretch, energy = dipping_curve()
    assert fitted([stretch, stretch], [energy, energy]).rule == "energy"
    assert fitted(stretch, energy, slope_fit_below_r_squared=-100.0).rule == "energy"


def test_points_without_energy_or_at_most_one_are_dropped_and_change_nothing():
    stretch, energy = noisy(7)
    stretch[0, :6], energy[1, 20] = 1.0 - 0.01 * np.arange(6), np.nan
    fit = fitted(stretch, energy)
    assert (fit.points_used, fit.points_dropped) == (94, 6)
    energy[0, 1:6] = 1e9
    assert fitted(stretch, energy) == fit
