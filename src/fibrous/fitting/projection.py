"""Least squares of a · φ(s) to data: an amplitude a ≥ 0, which enters linearly, and one exponent 0 ≤ s ≤ end.

For each s the best amplitude is a projection, so the search runs over s alone (variable projection).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import stdtrit

Array = NDArray[np.float64]
# φ(s) and e^-s d(e^s φ)/ds, shape (..., data), for s of shape (..., 1) or a single number.
Shape = Callable[[Array], tuple[Array, Array]]

CONFIDENCE = 0.95
GRID_RATIO = 1.1  # φ changes over factors of s, hence a geometric grid finer than any of its features
SMALLEST_EXPONENT = 1e-3  # below it φ is that of s = 0 to 0.1 %, and one interval is enough


class Minimum(NamedTuple):
    """The least sum of squares, and 95 % half-widths of s and of the linear constant a e^-s."""

    s: float
    amplitude: float
    squares: float
    amplitude_half_width: float  # times e^-s that of a e^-s; NaN where a = 0 or there are too few data
    s_half_width: float  # NaN where s is at a bound, and the other half-width then holds for that s
    determined: bool  # neither a nor s is at a bound, and the data tell the two apart


def least_squares(shape: Shape, data: Array, end: float, separable: bool) -> Minimum:
    """Fit a · φ(s) to `data`, shape (data,), whose largest magnitude should be near one.

    Where s changes φ by a factor alone (not `separable`), s is 0. The smaller s is taken where rounding cannot tell.
    """
    s = _search(shape, data, end) if separable else 0.0
    at = _project(shape, data, s)
    squares = float(at.residual @ at.residual)
    widths = _half_widths(at.phi, at.derivative, at.amplitude, squares, inside=0.0 < s < end)
    return Minimum(s, at.amplitude, squares, *widths)


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
    amplitude: float
    exponent: float
    determined: bool


def _half_widths(phi: Array, derivative: Array, amplitude: float, squares: float, inside: bool) -> _HalfWidths:
    """Half-widths t √(σ² (JᵀJ)⁻¹) with J = (φ, a φ'), the derivatives with respect to a e^-s and s up to scale.

    With s at a bound, J is φ alone. `determined`: neither constant is at a bound and J has full rank.
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
    width = stdtrit(freedom, 0.5 + CONFIDENCE / 2.0) * np.sqrt(squares / freedom) * spread
    return _HalfWidths(float(width[0]), float(width[1]) if inside else np.nan, inside)
