"""The constants (C2, C3) of the strain energy of Eq. 2, fitted to curves of energy against averaged stretch.

With x = ⟨I4⟩ − 1 = λ_f² − 1 the law and its slope are

    W = C2 / (2 C3) (exp(C3 x²) − 1),        dW/dλ_f = 2 C2 λ_f x exp(C3 x²).

C2 enters linearly, so for each C3 it is found by projection and the search runs over C3 alone. Exponentials are
scaled by that of the largest x: with q = x²/x_max² ≤ 1 and s = C3 x_max², both read a · φ(s, q) with the amplitude
a = C2 x_max² e^s, and neither φ nor its derivative exceeds one by much, whatever s is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import factorial
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq
from scipy.special import exprel
from scipy.stats import t as student

from fibrous.errors import FitError

Array = NDArray[np.float64]
Rule = Literal["energy", "slope", "zero", "none"]
Objective = Literal["energy", "slope"]
# φ(s) and e^-s d(e^s φ)/ds at the points, for s of shape (..., 1).
Shape = Callable[[Array], tuple[Array, Array]]

CONFIDENCE = 0.95
# C3 x_max² stays below this: e^600 times an energy density is still a number, and so is the C2 that belongs to it.
LARGEST_EXPONENT = 600.0
GRID_RATIO = 1.1  # φ changes over factors of s, hence a geometric grid finer than any of its features
SMALLEST_EXPONENT = 1e-3  # below it φ is x² to 0.1 %, and one interval is enough
SERIES_BELOW = 0.1  # ψ(z) loses digits to cancellation below
SERIES = tuple((-1.0) ** k / factorial(k + 2) for k in range(10, -1, -1))  # of ψ, highest power first


@dataclass(frozen=True)
class HGOFit:
    """Constants of Eq. 2 and how far they can be trusted.

    `C2` and its half-width have the unit of the energy density (MPa in the study); C3 has none.
    """

    C2: float
    C3: float
    C2_half_width: float  # 95 %, from the Jacobian; NaN where C2 is at its bound or there are too few points
    C3_half_width: float  # 95 %; NaN where C3 is at a bound, and C2's half-width then holds for that C3
    r_squared: float  # of the objective, about the mean of the points fitted
    rule: Rule  # section 2.5; `none`: the curves pass λ_f = 1 but no state above it converged
    objective: Objective
    identifiable: bool  # False where a constant is at a bound, or the points cannot tell the two apart
    points_used: int
    points_dropped: int  # λ_f ≤ 1, or without an energy; the state of rest is not counted
    largest_stretch: float  # amplitude: largest λ_f fitted; with nothing to fit, largest λ_f of the curves


def strain_energy(C2: float, C3: float, stretch: ArrayLike) -> Array:
    """W of Eq. 2 at averaged stretches λ_f, any shape, in the unit of C2; C3 = 0 gives the limit C2 x²/2.

    Infinite where exp(C3 x²) exceeds the largest floating-point number.

    >>> float(strain_energy(2.0, 0.0, 2.0))
    9.0
    """
    square = _excess(np.asarray(stretch, dtype=float)) ** 2
    with np.errstate(over="ignore"):
        return 0.5 * C2 * square * exprel(C3 * square)


def strain_energy_slope(C2: float, C3: float, stretch: ArrayLike) -> Array:
    """dW/dλ_f of Eq. 2 at averaged stretches λ_f, any shape, in the unit of C2.

    Infinite where exp(C3 x²) exceeds the largest floating-point number.
    """
    stretch = np.asarray(stretch, dtype=float)
    excess = _excess(stretch)
    with np.errstate(over="ignore"):
        return 2.0 * C2 * stretch * excess * np.exp(C3 * excess**2)


def energy_slope(stretch: Array, energy: Array) -> Array:
    """dW/dλ_f of a sampled curve, shape (points,), for strictly rising λ_f of shape (points,), three at least.

    Derivative of the parabola through a point and its neighbours: with steps a before and b after it,
    (a² W₊ − b² W₋ + (b² − a²) W) / (a b (a + b)), and at the ends that of the parabola through the last three
    points; exact for parabolas, of second order for unequal steps.
    """
    return np.asarray(np.gradient(energy, stretch, edge_order=2))


def fit_curves(stretch: Array, energy: Array, *, largest_C3: float, slope_fit_below_r_squared: float) -> HGOFit:
    """Fit Eq. 2 to the curves of one network by unweighted least squares, with the rules of section 2.5.

    `stretch` (λ_f) and `energy` (W) have shape (deformations, steps + 1), step 0 the state of rest; a state without
    an equilibrium holds NaN. All points with λ_f > 1 are pooled, C2 ≥ 0 and 0 ≤ C3 ≤ largest_C3.

    Where λ_f never exceeds 1, C2 = 0 (rule `zero`). Where there is one deformation and R² of its energy fit is below
    `slope_fit_below_r_squared`, dW/dλ_f (see energy_slope) is fitted instead (rule `slope`). Otherwise rule `energy`.
    Raises FitError where the arrays do not have one shape (deformations, steps + 1).
    """
    stretch, energy = np.asarray(stretch, dtype=float), np.asarray(energy, dtype=float)
    if stretch.ndim != 2 or stretch.shape != energy.shape or stretch.shape[1] < 2:
        raise FitError(
            f"curves need λ_f and W of one shape (deformations, steps + 1), not {stretch.shape} and {energy.shape}"
        )
    moved, known = stretch[:, 1:], np.isfinite(energy[:, 1:]) & np.isfinite(stretch[:, 1:])
    used = known & (moved > 1.0)
    dropped = int(used.size - used.sum())
    if not used.any():
        return _without_points(moved, dropped)

    fit = _fit(moved[used], energy[:, 1:][used], "energy", largest_C3, dropped)
    if len(stretch) == 1 and fit.r_squared < slope_fit_below_r_squared:
        rising, slope = _rising_slope(stretch[0], energy[0])
        if rising.size:
            return _fit(rising, slope, "slope", largest_C3, moved.size - rising.size)
    return fit


def _without_points(stretch: Array, dropped: int) -> HGOFit:
    largest = float(np.nanmax(stretch)) if np.isfinite(stretch).any() else np.nan
    value = 0.0 if largest <= 1.0 else np.nan
    rule: Rule = "zero" if largest <= 1.0 else "none"
    return HGOFit(value, value, np.nan, np.nan, np.nan, rule, "energy", False, 0, dropped, largest)


def _rising_slope(stretch: Array, energy: Array) -> tuple[Array, Array]:
    """λ_f and dW/dλ_f of the curve's points with λ_f > 1; empty where three points do not rise.

    A load across the fibres lowers λ_f before it raises it: W is a function of λ_f only after the turn.
    """
    known = np.isfinite(stretch) & np.isfinite(energy)
    stretch, energy = stretch[known], energy[known]
    turn = stretch.size - 1 - int(np.argmin(stretch[::-1]))
    stretch, energy = stretch[turn:], energy[turn:]
    if stretch.size < 3 or np.any(np.diff(stretch) <= 0.0):
        return np.empty(0), np.empty(0)
    slope, tensile = energy_slope(stretch, energy), stretch > 1.0
    return stretch[tensile], slope[tensile]


def _excess(stretch: Array) -> Array:
    """λ_f² − 1 without cancellation near 1."""
    return (stretch - 1.0) * (stretch + 1.0)


def _psi(z: Array) -> Array:
    """(z − 1 + e^-z)/z² = e^-z d(exprel)/dz for z ≥ 0; ½ at z = 0."""
    near = z < SERIES_BELOW
    safe = np.where(near, 1.0, z)
    return np.where(near, np.polyval(SERIES, np.where(near, z, 0.0)), (safe + np.expm1(-safe)) / safe**2)


def _energy_shape(q: Array) -> Shape:
    def shape(s: Array) -> tuple[Array, Array]:
        scale, z = 0.5 * q * np.exp(s * (q - 1.0)), s * q
        return scale * exprel(-z), scale * q * _psi(z)

    return shape


def _slope_shape(q: Array, stretch: Array, largest_excess: float) -> Shape:
    def shape(s: Array) -> tuple[Array, Array]:
        phi = 2.0 * stretch * np.sqrt(q) / largest_excess * np.exp(s * (q - 1.0))
        return phi, q * phi

    return shape


def _fit(stretch: Array, data: Array, objective: Objective, largest_C3: float, dropped: int) -> HGOFit:
    """Fit W or dW/dλ_f (`data`) at points with λ_f > 1, both of shape (points,)."""
    excess = _excess(stretch)
    largest = float(excess.max())
    q = (excess / largest) ** 2
    shape = _energy_shape(q) if objective == "energy" else _slope_shape(q, stretch, largest)
    end = min(largest_C3 * largest**2, LARGEST_EXPONENT)

    unit = float(np.abs(data).max()) or 1.0
    scaled = data / unit
    s = _search(shape, scaled, end) if np.unique(q).size > 1 else 0.0
    amplitude, residual, phi, derivative = _project(shape, scaled, s)
    C2 = amplitude * unit * np.exp(-s) / largest**2
    squares, about_mean = float(residual @ residual), float(np.sum((scaled - scaled.mean()) ** 2))

    widths = _half_widths(phi, derivative, amplitude, squares, inside=0.0 < s < end)
    return HGOFit(
        C2=float(C2),
        C3=largest_C3 if s == end < LARGEST_EXPONENT else s / largest**2,
        C2_half_width=float(widths.amplitude * unit * np.exp(-s) / largest**2),
        C3_half_width=float(widths.exponent / largest**2),
        r_squared=1.0 - squares / about_mean if about_mean > 0.0 else np.nan,
        rule=objective,
        objective=objective,
        identifiable=widths.determined,
        points_used=stretch.size,
        points_dropped=dropped,
        largest_stretch=float(stretch.max()),
    )


class _Projection(NamedTuple):
    amplitude: float
    residual: Array
    phi: Array
    derivative: Array


def _project(shape: Shape, data: Array, s: float) -> _Projection:
    """Best non-negative amplitude for one s, with residual, φ and its derivative at the points."""
    phi, derivative = shape(np.array(s))
    amplitude = max(0.0, float(phi @ data) / float(phi @ phi))
    return _Projection(amplitude, data - amplitude * phi, phi, derivative)


def _search(shape: Shape, data: Array, end: float) -> float:
    """The s in [0, end] with the least sum of squares after projection; the smaller one where rounding cannot tell.

    Every change of sign of the derivative −2 a r·φ' from − to + on a geometric grid is a minimum and is refined by
    bracketing; the ends compete with them.
    """
    start = min(SMALLEST_EXPONENT, SMALLEST_EXPONENT * end)
    count = 2 + int(np.ceil(np.log(end / start) / np.log(GRID_RATIO)))
    grid = np.append(0.0, np.geomspace(start, end, count))
    grid[-1] = end

    phi, derivative = shape(grid[:, None])
    amplitude = np.maximum(0.0, (phi @ data) / np.sum(phi**2, axis=1))
    residual = data - amplitude[:, None] * phi
    gradient = -amplitude * np.sum(residual * derivative, axis=1)

    def gradient_at(s: float) -> float:
        at = _project(shape, data, s)
        return -at.amplitude * float(at.residual @ at.derivative)

    minima = [0.0]
    for i in np.flatnonzero((gradient[:-1] < 0.0) & (gradient[1:] >= 0.0)):
        if gradient_at(grid[i]) < 0.0 < gradient_at(grid[i + 1]):
            minima.append(float(brentq(gradient_at, grid[i], grid[i + 1], xtol=1e-15 * grid[i + 1], rtol=1e-15)))
        else:  # zero to rounding: the grid point is the minimum
            minima.append(float(grid[i + 1]))
    minima.append(float(end))

    epsilon = float(np.finfo(float).eps)
    best, least = 0.0, np.inf
    for s in minima:
        at = _project(shape, data, s)
        squares = float(at.residual @ at.residual)
        if squares < least * (1.0 - 4.0 * epsilon) - 16.0 * data.size * epsilon**2 or np.isinf(least):
            best, least = s, squares
    return best


class _HalfWidths(NamedTuple):
    amplitude: float  # of C2 x_max² e^s at the fitted s, in units of the scaled data
    exponent: float  # of s
    determined: bool


def _half_widths(phi: Array, derivative: Array, amplitude: float, squares: float, inside: bool) -> _HalfWidths:
    """Half-widths t √(σ² (JᵀJ)⁻¹) with J = (φ, a φ'), the derivatives with respect to C2 and C3 up to scale.

    With C3 at a bound, J is φ alone. `determined`: neither constant is at a bound and J has full rank.
    """
    if amplitude == 0.0:
        return _HalfWidths(np.nan, np.nan, False)
    jacobian = np.column_stack([phi, amplitude * derivative] if inside else [phi])
    norms = np.sqrt(np.sum(jacobian**2, axis=0))
    if norms.min() == 0.0 or np.linalg.matrix_rank(jacobian / norms) < norms.size:
        return _HalfWidths(np.nan, np.nan, False)
    freedom = phi.size - norms.size
    if freedom == 0:
        return _HalfWidths(np.nan, np.nan, inside)
    triangular = np.linalg.qr(jacobian / norms, mode="r")
    spread = np.sqrt(np.sum(np.linalg.inv(triangular) ** 2, axis=1)) / norms
    width = student.ppf(0.5 + CONFIDENCE / 2.0, freedom) * np.sqrt(squares / freedom) * spread
    return _HalfWidths(float(width[0]), float(width[1]) if inside else np.nan, inside)
