"""The trilinear hexahedron with 2 × 2 × 2 Gauss points (full integration)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Corners in local coordinates ξ, η, ζ, shape (8, 3), in the order of VTK and FEBio.
CORNERS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], dtype=float
)
#: Gauss points in local coordinates, shape (8, 3), each with weight 1; point a is the one nearest to corner a.
GAUSS_POINTS = CORNERS / np.sqrt(3.0)


def shape_functions(local: Array) -> Array:
    """N_a = (1 + ξ ξ_a)(1 + η η_a)(1 + ζ ζ_a)/8 at local points (..., 3), shape (..., 8)."""
    return np.prod(1.0 + local[..., None, :] * CORNERS, axis=-1) / 8.0


def shape_gradients(local: Array) -> Array:
    """∂N_a/∂ξ_j at local points (..., 3), shape (..., 8, 3)."""
    factors = 1.0 + local[..., None, :] * CORNERS
    others = np.stack([factors[..., (j + 1) % 3] * factors[..., (j + 2) % 3] for j in range(3)], axis=-1)
    return CORNERS * others / 8.0


def integration(corners: Array) -> tuple[Array, Array]:
    """Gradients of the shape functions in X and volumes at the Gauss points of elements.

    Returns ∂N_a/∂X_J, shape (elements, 8, 8, 3) as (element, Gauss point, corner, axis), 1/mm, and det(∂X/∂ξ), shape
    (elements, 8), mm³, for corner positions X, shape (elements, 8, 3), mm. Where a volume is zero gradients are not
    finite.
    """
    local = shape_gradients(GAUSS_POINTS)
    jacobian = np.einsum("eaI,qaj->eqIj", corners, local)
    volumes = np.linalg.det(jacobian)
    with np.errstate(divide="ignore", invalid="ignore"):
        cofactors = np.stack(
            [np.cross(jacobian[..., (j + 1) % 3], jacobian[..., (j + 2) % 3]) for j in range(3)], axis=-2
        )
        inverse = cofactors / volumes[..., None, None]
    return np.einsum("qaj,eqjI->eqaI", local, inverse), volumes
