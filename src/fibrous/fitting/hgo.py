"""The constants (C2, C3) of HGO laws, fitted to curves of networks: energy or stress, Eq. 2 or Eq. 10C.

Both laws are sums of one exponential,

    W = Σ_p w_p C2/(2 C3) (exp(C3 x_p²) − 1),        x_p = M_p : C − 1,
    σ = Σ_p w_p 2 C2 x_p exp(C3 x_p²) F M_p Fᵀ / J,

Eq. 2 of the single M = H, with x = λ_f² − 1, and Eq. 10C of three families M_p = N_p ⊗ N_p along the eigenvectors of H,
weighted by its eigenvalues. C2 enters linearly, so it is found by projection and the search runs over C3 alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import exprel

from fibrous.curves import Curves
from fibrous.deformation import averaged_stretch
from fibrous.errors import FitError
from fibrous.fitting.projection import Shape, least_squares
from fibrous.fitting.shapes import energy_shape, slope_shape, stress_shape
from fibrous.materials.hgo import RESTING, ROUNDING, HGOFamilies

Array = NDArray[np.float64]
Energy = Literal["structure_tensor", "families"]
Objective = Literal["energy", "stress"]
Fitted = Literal["energy", "slope", "stress"]
Rule = Literal["energy", "slope", "stress", "zero", "none"]

# C3 x_max² stays below this: e^600 times an energy density is still a number, and so is the C2 that belongs to it.
LARGEST_EXPONENT = 600.0
# Kelvin's notation of a symmetric tensor: its six numbers have the tensor's norm, so no component counts twice or half.
KELVIN = ((0, 1, 2, 1, 0, 0), (0, 1, 2, 2, 2, 1))
KELVIN_FACTORS = np.array([1.0, 1.0, 1.0, *3 * (np.sqrt(2.0),)])


@dataclass(frozen=True)
class HGOFit:
    """Constants of a law and how far they can be trusted.

    `C2` and its half-width have the unit of the energy density (MPa in the study); C3 has none.
    """

    C2: float
    C3: float
    C2_half_width: float  # 95 %, from the Jacobian; NaN where C2 is at its bound or there are too few points
    C3_half_width: float  # 95 %; NaN where C3 is at a bound, and C2's half-width then holds for that C3
    r_squared: float  # of the objective, about the mean of the points fitted, in stress that of each component
    rule: Rule  # what was fitted, or why nothing: see fit_constants
    objective: Fitted
    identifiable: bool  # False where a constant is at a bound, or the points cannot tell the two apart
    points_used: int
    points_dropped: int  # not stretched, or without the quantity fitted; the state of rest is not counted
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


def fit_constants(
    curves: Curves,
    energy: Energy,
    objective: Objective,
    *,
    tension_only: bool,
    largest_C3: float,
    slope_fit_below_r_squared: float,
) -> HGOFit:
    """Fit a law to the curves of one network by unweighted least squares, C2 ≥ 0 and 0 ≤ C3 ≤ largest_C3.

    `energy` is the law: `structure_tensor` (Eq. 2) or `families` (Eq. 10C). `objective` is the quantity: W, or all
    components of the Cauchy stress. All states that stretch the law's fibres are pooled: for Eq. 2 those with
    λ_f > 1, whatever `tension_only` is; for families those where one is stretched or, with `tension_only` False, one
    has changed its length. A family whose weight passes for rounding (ROUNDING) carries nothing and counts for nothing.

    Rules: where no state stretches fibres, C2 = 0 (`zero`, section 2.5); where none of those that do has a value, the
    constants are NaN (`none`). For Eq. 2, energy and one deformation, where R² of the fit is below
    `slope_fit_below_r_squared`, dW/dλ_f (see energy_slope) is fitted instead (`slope`, section 2.5). Otherwise the
    rule is the objective.
    Raises FitError for an unknown law or objective, or curves of several networks, MaterialError where families are
    asked of an H that has none.
    """
    if len(curves.names) != 1:
        raise FitError(f"curves of {len(curves.names)} networks, and constants are fitted to those of one: choose it")
    stretch = curves.averaged_stretch[0]
    law = _law(curves, energy, stretch, tension_only)
    data = _data(curves, objective)
    stretched = law.stretched.copy()
    stretched[:, 0] = False  # the state of rest says nothing
    used = stretched & np.isfinite(data).all(axis=0)
    if not used.any():
        return _without_points(stretch[:, 1:], bool(stretched.any()), objective)

    fit = _fit(_problem(curves, law, objective, data, stretch, used), largest_C3)
    single = energy == "structure_tensor" and objective == "energy" and len(stretch) == 1
    if single and fit.r_squared < slope_fit_below_r_squared:
        rising, slope = _rising_slope(stretch[0], curves.strain_energy_density[0, 0])
        if rising.size:
            return _fit(_slope_problem(rising, slope, stretch.size - 1), largest_C3)
    return fit


class _Law(NamedTuple):
    """A law along the curves: its terms p, and the states that stretch its fibres."""

    weights: Array  # w_p, shape (terms,)
    structures: Array  # M_p, shape (terms, 3, 3)
    excess: Array  # x_p, zero where it carries nothing, shape (terms, deformations, steps + 1)
    stretched: NDArray[np.bool_]  # shape (deformations, steps + 1)


def _law(curves: Curves, energy: Energy, stretch: Array, tension_only: bool) -> _Law:
    if energy == "structure_tensor":
        return _Law(np.ones(1), curves.structure_tensor, _excess(stretch)[None], stretch > 1.0)
    if energy != "families":
        raise FitError(f"energy '{energy}' is no law: take structure_tensor (Eq. 2) or families (Eq. 10C)")
    families = HGOFamilies.of_structure_tensor(curves.structure_tensor[0], 0.0, 0.0, tension_only)
    carrying = families.weights > ROUNDING
    directions = families.directions[carrying]
    structures = directions[:, :, None] * directions[:, None, :]
    excess = np.array([_excess(averaged_stretch(curves.deformation_gradient[0], one)) for one in structures])
    if tension_only:
        excess = np.maximum(excess, 0.0)
    return _Law(families.weights[carrying], structures, excess, (np.abs(excess) > RESTING).any(axis=0))


def _data(curves: Curves, objective: Objective) -> Array:
    """What is fitted, shape (components, deformations, steps + 1): W, or the stress in Kelvin's notation."""
    if objective == "energy":
        return curves.strain_energy_density
    if objective != "stress":
        raise FitError(f"objective '{objective}' is unknown: fit energy or stress")
    return _kelvin(curves.cauchy_stress[0])


def _kelvin(tensor: Array) -> Array:
    """The symmetric part of tensors, shape (..., 3, 3), as six numbers of the same norm, shape (6, ...)."""
    rows, columns = KELVIN
    symmetric = 0.5 * (tensor[..., rows, columns] + tensor[..., columns, rows])
    return np.moveaxis(KELVIN_FACTORS * symmetric, -1, 0)


class _Problem(NamedTuple):
    """What `_fit` fits; shapes of φ and the meaning of x_max in fitting.shapes."""

    objective: Fitted
    shape: Shape
    separable: bool  # whether C3 changes more than a factor that C2 can take over
    data: Array  # shape (components, points)
    stretch: Array  # λ_f, shape (points,)
    largest_excess: float  # x_max
    states: int  # of the curves, without rest


def _problem(
    curves: Curves, law: _Law, objective: Objective, data: Array, stretch: Array, used: NDArray[np.bool_]
) -> _Problem:
    """The fit of energy or stress to the states where `used`, shape (deformations, steps + 1)."""
    excess = law.excess[:, used]
    largest = float(np.abs(excess).max())
    q = (excess / largest) ** 2
    if objective == "energy":
        shape, separable = energy_shape(law.weights, q), bool(np.any(q != q[:, :1]))
    else:
        gradient = curves.deformation_gradient[0, used]
        pushed = gradient @ law.structures[:, None] @ np.swapaxes(gradient, -1, -2)
        factor = 2.0 * law.weights[:, None] * excess / largest**2 / np.linalg.det(gradient)
        basis = np.swapaxes(_kelvin(factor[..., None, None] * pushed), 0, 1)
        shape, separable = stress_shape(basis, q), bool(np.ptp(q[q > 0.0]) > 0.0)
    return _Problem(objective, shape, separable, data[:, used], stretch[used], largest, used.size - len(used))


def _slope_problem(stretch: Array, slope: Array, states: int) -> _Problem:
    """The fit of dW/dλ_f, both arrays of shape (points,)."""
    excess = _excess(stretch)
    largest = float(excess.max())
    q = (excess / largest) ** 2
    separable = bool(np.any(q != q[0]))
    return _Problem("slope", slope_shape(q, stretch, largest), separable, slope[None], stretch, largest, states)


def _without_points(stretch: Array, stretched: bool, objective: Objective) -> HGOFit:
    value = np.nan if stretched else 0.0
    rule: Rule = "none" if stretched else "zero"
    largest = float(stretch.max())
    return HGOFit(value, value, np.nan, np.nan, np.nan, rule, objective, False, 0, stretch.size, largest)


def _rising_slope(stretch: Array, energy: Array) -> tuple[Array, Array]:
    """λ_f and dW/dλ_f of the curve's points with λ_f > 1; empty where three points do not rise.

    A load across the fibres lowers λ_f before it raises it: W is a function of λ_f only after the turn.
    """
    known = np.isfinite(energy)
    stretch, energy = stretch[known], energy[known]
    turn = stretch.size - 1 - int(np.argmin(stretch[::-1]))
    stretch, energy = stretch[turn:], energy[turn:]
    if stretch.size < 3 or np.any(np.diff(stretch) <= 0.0):
        return np.empty(0), np.empty(0)
    slope, tensile = energy_slope(stretch, energy), stretch > 1.0
    return stretch[tensile], slope[tensile]


def _excess(stretch: Array) -> Array:
    """λ² − 1 without cancellation near 1."""
    return (stretch - 1.0) * (stretch + 1.0)


def _fit(problem: _Problem, largest_C3: float) -> HGOFit:
    data, x_max = problem.data, problem.largest_excess
    end = min(largest_C3 * x_max**2, LARGEST_EXPONENT)
    unit = float(np.abs(data).max()) or 1.0
    scaled = data / unit
    found = least_squares(problem.shape, scaled.ravel(), end, problem.separable)
    about_mean = float(np.sum((scaled - scaled.mean(axis=1, keepdims=True)) ** 2))
    return HGOFit(
        C2=float(found.amplitude * unit * np.exp(-found.s) / x_max**2),
        C3=largest_C3 if found.s == end < LARGEST_EXPONENT else found.s / x_max**2,
        C2_half_width=float(found.amplitude_half_width * unit * np.exp(-found.s) / x_max**2),
        C3_half_width=float(found.s_half_width / x_max**2),
        r_squared=1.0 - found.squares / about_mean if about_mean > 0.0 else np.nan,
        rule=problem.objective,
        objective=problem.objective,
        identifiable=found.determined,
        points_used=problem.stretch.size,
        points_dropped=problem.states - problem.stretch.size,
        largest_stretch=float(problem.stretch.max()),
    )
