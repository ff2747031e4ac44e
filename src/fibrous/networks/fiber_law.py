"""The exponential fibre (Eq. 6): force, stiffness and energy of one fibre as functions of its stretch.

All functions work on the reduced law, force over kA; a fibre of reference length L then has the energy kA L w(λ).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import dawsn

from fibrous.errors import ConfigError

Array = NDArray[np.float64]

# |λ − 1| below which the closed form of the energy loses more digits to cancellation than the series drops terms.
SERIES_RANGE = 0.05
SERIES_TERMS = 30


@dataclass(frozen=True)
class FiberLaw:
    """Force f = (kA/B)(exp[B E] − 1) with E = (λ² − 1)/2 (Eq. 6), reduced by kA.

    Parameters
    ----------
    nonlinearity : B > 0
    linear_beyond : stretch above 1 beyond which the force continues along its tangent; infinity for Eq. 6 as printed

    Raises ConfigError for a nonlinearity or a stretch outside these ranges.

    >>> force, stiffness = FiberLaw(2.5).response(1.0)
    >>> float(force), float(stiffness)
    (0.0, 1.0)
    """

    nonlinearity: float
    linear_beyond: float = np.inf

    def __post_init__(self) -> None:
        if not (np.isfinite(self.nonlinearity) and self.nonlinearity > 0.0):
            raise ConfigError(f"fiber.nonlinearity is {self.nonlinearity}; it must be a number above 0")
        if not self.linear_beyond > 1.0:
            raise ConfigError(f"fiber.linear_beyond_stretch is {self.linear_beyond}; it must be above 1")

    def response(self, stretch: ArrayLike) -> tuple[Array, Array]:
        """f/kA and d(f/kA)/dλ for stretches λ of any shape."""
        stretch = np.asarray(stretch, dtype=float)
        cut = np.minimum(stretch, self.linear_beyond)
        growth = np.expm1(0.5 * self.nonlinearity * (cut * cut - 1.0))
        stiffness = cut * (1.0 + growth)
        force = growth / self.nonlinearity
        if np.isfinite(self.linear_beyond):
            force = force + stiffness * (stretch - cut)
        return force, stiffness

    def energy(self, stretch: ArrayLike) -> Array:
        """w(λ) = ∫ f/kA dλ from 1, for stretches λ of any shape.

        In closed form ∫ exp[B(λ² − 1)/2] dλ = √(2/B) exp[B(λ² − 1)/2] D(λ√(B/2)) with Dawson's integral D; near
        λ = 1, where that cancels, the Taylor series of the same integral.
        """
        stretch = np.asarray(stretch, dtype=float)
        cut = np.minimum(stretch, self.linear_beyond)
        elongation = cut - 1.0
        near = np.abs(elongation) < SERIES_RANGE
        root = np.sqrt(0.5 * self.nonlinearity)
        integral = (np.exp(root**2 * (cut * cut - 1.0)) * dawsn(root * cut) - dawsn(root)) / root
        closed = (integral - elongation) / self.nonlinearity
        series = np.polynomial.polynomial.polyval(np.where(near, elongation, 0.0), self._series())
        energy = np.where(near, series, closed)
        if np.isfinite(self.linear_beyond):
            force, stiffness = self.response(cut)
            beyond = stretch - cut
            energy = energy + beyond * (force + 0.5 * beyond * stiffness)
        return energy

    def _series(self) -> Array:
        """Taylor coefficients of w in e = λ − 1: exp[B(e + e²/2)] = Σ a_k e^k, (k + 1) a_{k+1} = B(a_k + a_{k−1})."""
        a = np.zeros(SERIES_TERMS)
        a[0], a[1] = 1.0, self.nonlinearity
        for k in range(1, SERIES_TERMS - 1):
            a[k + 1] = self.nonlinearity * (a[k] + a[k - 1]) / (k + 1)
        order = np.arange(1, SERIES_TERMS)
        return np.concatenate([[0.0, 0.0], a[1:] / (order + 1) / self.nonlinearity])
