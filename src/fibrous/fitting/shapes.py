"""How energy, its slope and stress depend on C3: the φ(s) of fitting.projection for sums of HGO exponentials.

A law is W = Σ_p w_p C2/(2 C3) (exp(C3 x_p²) − 1). Exponentials are scaled by that of the largest |x|: with
q_p = x_p²/x_max² ≤ 1 and s = C3 x_max², everything reads a · φ(s) with the amplitude a = C2 x_max² e^s, and neither φ
nor its derivative exceeds one by much, whatever s is. Arrays run terms p first, points last.
"""

from __future__ import annotations

from math import factorial

import numpy as np
from scipy.special import exprel

from fibrous.fitting.projection import Array, Shape

SERIES_BELOW = 0.1  # ψ(z) loses digits to cancellation below
SERIES = tuple((-1.0) ** k / factorial(k + 2) for k in range(10, -1, -1))  # of ψ, highest power first


def energy_shape(weights: Array, q: Array) -> Shape:
    """W = a φ: φ = Σ_p w_p ½ q_p e^{s (q_p − 1)} exprel(−s q_p), for w of shape (terms,), q (terms, points)."""

    def shape(s: Array) -> tuple[Array, Array]:
        s = s[..., None]
        scale, z = 0.5 * q * np.exp(s * (q - 1.0)), s * q
        return weights @ (scale * exprel(-z)), weights @ (scale * q * _psi(z))

    return shape


def slope_shape(q: Array, stretch: Array, largest_excess: float) -> Shape:
    """dW/dλ_f = 2 C2 λ_f x exp(C3 x²) = a φ of a single term in λ_f, q and λ_f of shape (points,)."""

    def shape(s: Array) -> tuple[Array, Array]:
        phi = 2.0 * stretch * np.sqrt(q) / largest_excess * np.exp(s * (q - 1.0))
        return phi, q * phi

    return shape


def stress_shape(basis: Array, q: Array) -> Shape:
    """σ = a φ: φ = Σ_p B_p e^{s (q_p − 1)}, for B of shape (terms, components, points), q of shape (terms, points).

    φ has shape (..., components × points), the points of the first component first.
    """

    def shape(s: Array) -> tuple[Array, Array]:
        growth = np.exp(s[..., None] * (q - 1.0))
        return _contracted(growth, basis), _contracted(q * growth, basis)

    return shape


def _contracted(growth: Array, basis: Array) -> Array:
    """Σ_p growth_p B_p, shape (..., components × points), for growth of shape (..., terms, points)."""
    total = sum(growth[..., p, None, :] * basis[p] for p in range(len(basis)))
    return np.asarray(total).reshape(*growth.shape[:-2], -1)


def _psi(z: Array) -> Array:
    """(z − 1 + e^-z)/z² = e^-z d(exprel)/dz for z ≥ 0; ½ at z = 0."""
    near = z < SERIES_BELOW
    safe = np.where(near, 1.0, z)
    return np.where(near, np.polyval(SERIES, np.where(near, z, 0.0)), (safe + np.expm1(-safe)) / safe**2)
