"""The constants (C2, C3) of HGO laws, fitted to curves of networks: energy or stress, Eq. 2, Eq. 10C or their like.

Each law is a sum of one exponential over its `terms` w_p and M_p,

    W = Σ_p w_p C2/(2 C3) (exp(C3 x_p²) − 1),        x_p = M_p : C − 1,
    σ = Σ_p w_p 2 C2 x_p exp(C3 x_p²) F M_p Fᵀ / J,

Eq. 2 of the single M = H, with x = λ_f² − 1, and Eq. 10C of three families M_p = N_p ⊗ N_p along the eigenvectors of H,
weighted by its eigenvalues. C2 enters linearly, so it is found by projection and the search runs over C3 alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from fibrous.curves import Curves
from fibrous.deformation import averaged_stretch
from fibrous.errors import FitError
from fibrous.fitting.projection import Shape, least_squares
from fibrous.fitting.shapes import energy_shape, slope_shape, stress_shape
from fibrous.materials.hgo import HGO, RESTING, ROUNDING, HGOStructureTensor, exponential_energy

Array = NDArray[np.float64]
Objective = Literal["energy", "stress"]
Fitted = Literal["energy", "slope", "stress"]
Rule = Literal["energy", "slope", "stress", "zero", "none"]

# C3 x_max² stays below this: e^600 times an energy density is still a number, and so is the C2 that belongs to it.
LARGEST_EXPONENT = 600.0
# Kelvin's notation of a symmetric tensor: its six numbers have the tensor's norm, so no component counts twice or half.
KELVIN = ((0, 1, 2, 1, 0, 0), (0, 1, 2, 2, 2, 1))
KELVIN_FACTORS = np.array([1.0, 1.0, 1.0, *3 * (np.sqrt(2.0),)])


@dataclass(frozen=True, repr=False)
class HGOFit:
    """Constants of a law and how far they can be trusted.

    `C2` and its half-width have the unit of the energy density, MPa; C3 has none.
    """

    C2: float
    C3: float
    C2_half_width: float  # 95 %, from the Jacobian; NaN where C2 is at its bound or there are too few points
    C3_half_width: float  # 95 %; NaN where C3 is at a bound, and C2's half-width then holds for that C3
    r_squared: float  # of the objective, about the mean of the points fitted, in stress that of each component
    rule: Rule  # what was fitted, or why nothing: see fit_hgo
    objective: Fitted
    identifiable: bool  # False where a constant is at a bound, or the points cannot tell the two apart
    points_used: int
    points_dropped: int  # not stretched, or without the quantity fitted; the state of rest is not counted
    largest_stretch: float  # amplitude: largest λ_f fitted; with nothing to fit, largest λ_f of the curves
    fitted_law: type[HGO]
    structure_tensor: Array = field(compare=False)  # H, shape (3, 3)
    tension_only: bool

    @property
    def law(self) -> HGO:
        """The material with these constants; raises MaterialError where none could be fitted."""
        return self.fitted_law.of_structure_tensor(self.structure_tensor, self.C2, self.C3, self.tension_only)

    def __repr__(self) -> str:
        constants = f"C2 = {self.C2:.4g} MPa, C3 = {self.C3:.4g}, R² = {self.r_squared:.4f}"
        return f"<{self.fitted_law.__name__} fitted to {self.objective}: {constants}, {self.points_used} points>"


def strain_energy(C2: float, C3: float, stretch: ArrayLike) -> Array:
    """W of Eq. 2 at averaged stretches λ_f, any shape, in the unit of C2; C3 = 0 gives the limit C2 x²/2.

    Infinite where exp(C3 x²) exceeds the largest floating-point number.

    >>> float(strain_energy(2.0, 0.0, 2.0))
    9.0
    """
    return exponential_energy(C2, C3, _excess(np.asarray(stretch, dtype=float)), tension_only=False)


def energy_slope(stretch: Array, energy: Array) -> Array:
    """dW/dλ_f of a sampled curve, shape (points,), for strictly rising λ_f of shape (points,), three at least.

    Derivative of the parabola through a point and its neighbours: with steps a before and b after it,
    (a² W₊ − b² W₋ + (b² − a²) W) / (a b (a + b)), and at the ends that of the parabola through the last three
    points; exact for parabolas, of second order for unequal steps.
    """
    return np.asarray(np.gradient(energy, stretch, edge_order=2))


def fit_hgo(
    curves: Curves | xr.Dataset,
    law: type[HGO] = HGOStructureTensor,
    objective: Objective = "energy",
    *,
    tension_only: bool = True,
    largest_C3: float = np.inf,
    slope_fit_below_r_squared: float = -np.inf,
) -> HGOFit:
    """Fit a law to the curves of one network by unweighted least squares, C2 ≥ 0 and 0 ≤ C3 ≤ largest_C3.

    `curves` may be what `Network.load` returned. `objective` is the quantity: W, or all components of the Cauchy
    stress. All states that stretch the law's fibres are pooled: for a law of one term, such as Eq. 2, those with M : C
    > 1 (λ_f > 1), whatever `tension_only` is; for several, such as families, those where one is stretched or, with
    `tension_only` False, one has changed its length. A term whose weight passes for rounding (ROUNDING) carries nothing
    and counts for nothing.

    Rules: where no state stretches fibres, C2 = 0 (`zero`, section 2.5); where none of those that does has a value, the
    constants are NaN (`none`). For Eq. 2, energy and one deformation, where R² of the fit is below
    `slope_fit_below_r_squared`, dW/dλ_f (see energy_slope) is fitted instead (`slope`, section 2.5). Otherwise the
    rule is the objective.
    Raises FitError for an unknown objective, or curves of several networks, MaterialError for an H that is none.

    >>> stretch = np.linspace(1.0, 1.3, 7)
    >>> F = np.zeros((1, 7, 3, 3)) + np.eye(3)
    >>> F[0, :, 0, 0], F[0, :, 1, 1], F[0, :, 2, 2] = stretch, stretch**-0.5, stretch**-0.5
    >>> law = HGOStructureTensor(0.1, 0.4, np.diag([0.6, 0.3, 0.1]))
    >>> fit_hgo(Curves.of_network(F, law.structure_tensor, law.energy(F), law.stress(F)))
    <HGOStructureTensor fitted to energy: C2 = 0.1 MPa, C3 = 0.4, R² = 1.0000, 6 points>
    """
    if isinstance(curves, xr.Dataset):
        curves = Curves.from_dataset(curves)
    if len(curves.names) != 1:
        raise FitError(f"curves of {len(curves.names)} networks, and constants are fitted to those of one: choose it")
    stretch = curves.averaged_stretch[0]
    terms = _terms(curves, law, tension_only)
    data = _data(curves, objective)
    stretched = terms.stretched.copy()
    stretched[:, 0] = False  # the state of rest says nothing
    used = stretched & np.isfinite(data).all(axis=0)
    about = {"fitted_law": law, "structure_tensor": curves.structure_tensor[0], "tension_only": tension_only}
    if not used.any():
        return _without_points(stretch[:, 1:], bool(stretched.any()), objective, about)

    fit = _fit(_problem(curves, terms, objective, data, stretch, used), largest_C3, about)
    single = law is HGOStructureTensor and objective == "energy" and len(stretch) == 1
    if single and fit.r_squared < slope_fit_below_r_squared:
        rising, slope = _rising_slope(stretch[0], curves.strain_energy_density[0, 0])
        if rising.size:
            return _fit(_slope_problem(rising, slope, stretch.size - 1), largest_C3, about)
    return fit


class _Terms(NamedTuple):
    """The terms p of a law along the curves, and the states that stretch its fibres."""

    weights: Array  # w_p, shape (terms,)
    structures: Array  # M_p, shape (terms, 3, 3)
    excess: Array  # x_p, zero where it carries nothing, shape (terms, deformations, steps + 1)
    stretched: NDArray[np.bool_]  # shape (deformations, steps + 1)


def _terms(curves: Curves, law: type[HGO], tension_only: bool) -> _Terms:
    weights, structures = law.of_structure_tensor(curves.structure_tensor[0], 0.0, 0.0, tension_only).terms
    carrying = weights > ROUNDING
    excess = np.array([_excess(averaged_stretch(curves.deformation_gradient[0], M)) for M in structures[carrying]])
    if len(weights) == 1:
        return _Terms(weights, structures, excess, excess[0] > 0.0)
    if tension_only:
        excess = np.maximum(excess, 0.0)
    return _Terms(weights[carrying], structures[carrying], excess, (np.abs(excess) > RESTING).any(axis=0))


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
    curves: Curves, terms: _Terms, objective: Objective, data: Array, stretch: Array, used: NDArray[np.bool_]
) -> _Problem:
    """The fit of energy or stress to the states where `used`, shape (deformations, steps + 1)."""
    excess = terms.excess[:, used]
    largest = float(np.abs(excess).max())
    q = (excess / largest) ** 2
    if objective == "energy":
        shape, separable = energy_shape(terms.weights, q), bool(np.any(q != q[:, :1]))
    else:
        gradient = curves.deformation_gradient[0, used]
        pushed = gradient @ terms.structures[:, None] @ np.swapaxes(gradient, -1, -2)
        factor = 2.0 * terms.weights[:, None] * excess / largest**2 / np.linalg.det(gradient)
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


def _without_points(stretch: Array, stretched: bool, objective: Objective, about: dict[str, Any]) -> HGOFit:
    value = np.nan if stretched else 0.0
    rule: Rule = "none" if stretched else "zero"
    largest = float(stretch.max())
    return HGOFit(value, value, np.nan, np.nan, np.nan, rule, objective, False, 0, stretch.size, largest, **about)


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


def _fit(problem: _Problem, largest_C3: float, about: dict[str, Any]) -> HGOFit:
    data, x_max = problem.data, problem.largest_excess
    end = min(largest_C3 * x_max**2, LARGEST_EXPONENT)
    unit = float(np.abs(data).max()) or 1.0
    scaled = data / unit
    minimum = least_squares(problem.shape, scaled.ravel(), end, problem.separable)
    about_mean = float(np.sum((scaled - scaled.mean(axis=1, keepdims=True)) ** 2))
    return HGOFit(
        C2=float(minimum.amplitude * unit * np.exp(-minimum.s) / x_max**2),
        C3=largest_C3 if minimum.s == end < LARGEST_EXPONENT else minimum.s / x_max**2,
        C2_half_width=float(minimum.amplitude_half_width * unit * np.exp(-minimum.s) / x_max**2),
        C3_half_width=float(minimum.s_half_width / x_max**2),
        r_squared=1.0 - minimum.squares / about_mean if about_mean > 0.0 else np.nan,
        rule=problem.objective,
        objective=problem.objective,
        identifiable=minimum.determined,
        points_used=problem.stretch.size,
        points_dropped=problem.states - problem.stretch.size,
        largest_stretch=float(problem.stretch.max()),
        **about,
    )
