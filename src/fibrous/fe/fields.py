"""What is read off a solution at Gauss points: stress and strain in the deformed body, and their maximum shear."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fibrous.deformation import right_cauchy_green

Array = NDArray[np.float64]


def cauchy_stress(stress: Array, gradient: Array) -> Array:
    """σ = P Fᵀ/J, shape (..., 3, 3), MPa, from the first Piola–Kirchhoff stress P and F, shapes (..., 3, 3)."""
    return stress @ np.swapaxes(gradient, -1, -2) / np.linalg.det(gradient)[..., None, None]


def green_lagrange_strain(gradient: Array) -> Array:
    """E = (FᵀF − I)/2, shape (..., 3, 3), for F of shape (..., 3, 3)."""
    return 0.5 * (right_cauchy_green(gradient) - np.eye(3))


def maximum_shear(tensor: Array) -> Array:
    """Half the difference of the largest and the smallest principal value, shape (...), of symmetric (..., 3, 3)."""
    principal = np.linalg.eigvalsh(tensor)
    return 0.5 * (principal[..., 2] - principal[..., 0])
