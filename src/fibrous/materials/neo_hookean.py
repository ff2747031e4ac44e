"""The matrix: compressible neo-Hookean solid (Eq. 10B)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fibrous.materials.contract import PerElement, State, components_first, components_last, refuse

Array = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class NeoHookean(PerElement):
    """W = C1 (I1 − 3) − 2 C1 ln J + (λ/2) (ln J)² (Eq. 10B).

    Parameters
    ----------
    C1 : half the second Lamé parameter, MPa, above 0; a number or an array that broadcasts against the points
    lame_lambda : first Lamé parameter λ, MPa, above −4 C1/3, below which the bulk modulus is not positive

    Raises MaterialError for constants outside these ranges.

    >>> stress, tangent, _ = NeoHookean(0.025, 0.417)(np.eye(3))
    >>> float(tangent[0, 0, 0, 0])  # λ + 2μ with μ = 2 C1
    0.517
    """

    C1: Array | float
    lame_lambda: Array | float

    def __post_init__(self) -> None:
        self._check("C1", lambda C1: C1 > 0.0, "a number above 0")
        self._check("lame_lambda", np.isfinite, "a number")
        C1, lame = np.broadcast_arrays(self.C1, self.lame_lambda)
        refuse(3.0 * lame + 4.0 * C1 > 0.0, lame, "lame_lambda", "above -4 C1/3, or the bulk modulus is not positive")

    def __call__(self, gradient: Array, state: State = None, near: State = None) -> tuple[Array, Array, State]:
        """P = 2 C1 F + s F⁻ᵀ, A = 2 C1 δ_ik δ_JL + λ F⁻ᵀ_iJ F⁻ᵀ_kL − s F⁻ᵀ_iL F⁻ᵀ_kJ with s = λ ln J − 2 C1, in MPa."""
        F, C1, lame = self._components(gradient)
        J, inverse_transposed = determinant_and_inverse_transposed(F)
        pressure = lame * _logarithm(J) - 2.0 * C1
        stress = pressure * inverse_transposed
        crossed = stress[:, :, None, None] * inverse_transposed
        stress += 2.0 * C1 * F
        tangent = (lame * inverse_transposed)[:, :, None, None] * inverse_transposed
        tangent -= crossed.swapaxes(1, 3)
        for i in range(3):
            for j in range(3):
                tangent[i, j, i, j] += 2.0 * C1
        return components_last(stress, 2), components_last(tangent, 4), state

    def energy(self, gradient: Array) -> Array:
        """W, shape (...), MPa."""
        F, C1, lame = self._components(gradient)
        J = _logarithm(determinant_and_inverse_transposed(F)[0])
        return C1 * ((F * F).sum(axis=(0, 1)) - 3.0 - 2.0 * J) + 0.5 * lame * J * J

    def _components(self, gradient: Array) -> list[Array]:
        return components_first((gradient, 2), (self.C1, 0), (self.lame_lambda, 0))


def determinant_and_inverse_transposed(F: Array) -> tuple[Array, Array]:
    """det F, shape (...), and F⁻ᵀ, shape (3, 3, ...), for F of shape (3, 3, ...), from cofactors."""
    inverse_transposed = np.empty_like(F)
    for i in range(3):
        for j in range(3):
            a, b, c, d = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
            inverse_transposed[i, j] = F[a, c] * F[b, d] - F[a, d] * F[b, c]
    J = np.asarray((F[0] * inverse_transposed[0]).sum(axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse_transposed /= J
    return J, inverse_transposed


def _logarithm(J: Array) -> Array:
    """ln J, NaN where matter is turned inside out."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.log(np.where(J > 0.0, J, np.nan))
