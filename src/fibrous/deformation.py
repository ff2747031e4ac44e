"""Deformation gradients of the study's loads, and the stretches that follow from them (sections 2.1, 2.3, 2.6).

Axis indices are 0, 1, 2 for x, y, z; F maps reference to deformed, ``F[i, J] = ∂x_i/∂X_J``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from fibrous.errors import LoadError

Array = NDArray[np.float64]
Kind = Literal["uniaxial", "biaxial", "shear"]


@dataclass(frozen=True)
class Load:
    """One family of isochoric deformation gradients with a scalar magnitude.

    ========== =================================== ====================== =======
    kind       F, for the axes x, xy, xy           magnitude              at rest
    ========== =================================== ====================== =======
    uniaxial   diag(λ, λ^-1/2, λ^-1/2)             stretch λ              1
    biaxial    diag(m, m, m^-2)                    stretch m              1
    shear      I + γ e_y ⊗ e_x                     amount of shear γ ≥ 0  0
    ========== =================================== ====================== =======

    >>> Load.parse("xy_shear").deformation_gradient(0.5)[1, 0]
    np.float64(0.5)
    """

    kind: Kind
    axes: tuple[int, ...]

    @classmethod
    def parse(cls, name: str) -> Load:
        """The load called ``{axes}_{kind}``, such as ``x_uniaxial`` or ``yz_shear``.

        Raises LoadError for any other name.
        """
        letters, _, kind = name.partition("_")
        wanted = {"uniaxial": 1, "biaxial": 2, "shear": 2}.get(kind)
        axes = tuple("xyz".find(letter) for letter in letters)
        if wanted is None or len(axes) != wanted or -1 in axes or len(set(axes)) != len(axes):
            raise LoadError(
                f"load '{name}' is unknown: write x_uniaxial, xy_biaxial or xy_shear, with the axes you need"
            )
        return cls(cast(Kind, kind), axes)

    @property
    def name(self) -> str:
        """The name that `parse` reads."""
        return "".join("xyz"[axis] for axis in self.axes) + f"_{self.kind}"

    @property
    def rest(self) -> float:
        """Magnitude at which F is the identity."""
        return 0.0 if self.kind == "shear" else 1.0

    def deformation_gradient(self, magnitude: ArrayLike) -> Array:
        """F, shape (..., 3, 3), for magnitudes of shape (...)."""
        magnitude = np.asarray(magnitude, dtype=float)
        gradient = np.zeros((*magnitude.shape, 3, 3))
        diagonal = np.einsum("...ii->...i", gradient)
        if self.kind == "shear":
            diagonal[...] = 1.0
            gradient[..., self.axes[1], self.axes[0]] = magnitude
            return gradient
        transverse = -0.5 if self.kind == "uniaxial" else -2.0
        diagonal[...] = (magnitude**transverse)[..., None]
        for axis in self.axes:
            diagonal[..., axis] = magnitude
        return gradient

    def magnitude_at_principal_stretch(self, stretch: float) -> float:
        """Magnitude at which the largest principal stretch of F is `stretch` (> 1)."""
        return stretch - 1.0 / stretch if self.kind == "shear" else stretch


def right_cauchy_green(gradient: Array) -> Array:
    """C = Fᵀ F, shape (..., 3, 3)."""
    return np.swapaxes(gradient, -1, -2) @ gradient


def averaged_stretch(gradient: Array, structure_tensor: Array) -> Array:
    """λ_f = √(H : C), shape (...), for F of shape (..., 3, 3) and H of shape (3, 3) (section 2.2)."""
    return np.sqrt(np.einsum("...IJ,IJ->...", right_cauchy_green(gradient), structure_tensor))


def largest_principal_stretch(gradient: Array) -> Array:
    """Square root of the largest eigenvalue of C, shape (...)."""
    return np.sqrt(np.linalg.eigvalsh(right_cauchy_green(gradient))[..., -1])


def matching_magnitude(load: Load, structure_tensor: Array, target: float, limit: float) -> tuple[float, bool]:
    """Magnitude at which `load` brings a network of structure tensor H (3, 3) to the averaged stretch `target`.

    Returns the magnitude and whether it was cut at the principal stretch `limit`.
    Raises LoadError where no magnitude reaches the target although the limit is not in the way.
    """

    def excess(magnitude: float) -> float:
        return float(averaged_stretch(load.deformation_gradient(magnitude), structure_tensor)) - target

    end = load.magnitude_at_principal_stretch(limit)
    trial = np.linspace(load.rest, end, 65)
    values = averaged_stretch(load.deformation_gradient(trial), structure_tensor) - target
    # λ_f may first fall (a biaxial load of a network aligned with the third axis), so the last crossing counts.
    below = np.flatnonzero(values < 0.0)
    if below.size == 0:
        raise LoadError(
            f"load {load.name} never has the averaged stretch {target:.6g}: "
            "let the first load of the protocol stretch the network (a magnitude above 1, or above 0 for shear)"
        )
    if below[-1] == trial.size - 1:
        return end, True
    return float(brentq(excess, trial[below[-1]], trial[below[-1] + 1], xtol=1e-14, rtol=1e-14)), False


def load_path(load: Load, end: float, steps: int) -> tuple[Array, Array]:
    """Magnitudes, shape (steps + 1,), growing linearly from rest to `end`, and F, shape (steps + 1, 3, 3)."""
    magnitudes = np.linspace(load.rest, end, steps + 1)
    return magnitudes, load.deformation_gradient(magnitudes)


@dataclass(frozen=True)
class LoadPath:
    """A load made definite for one network.

    magnitudes : shape (steps + 1,); gradients : F, shape (steps + 1, 3, 3)
    amplitude_limited : whether the load ends at the limit of the principal stretch
    """

    name: str
    magnitudes: Array
    gradients: Array
    amplitude_limited: bool


def load_paths(
    loads: list[tuple[str, float | None]], structure_tensor: Array, steps: int, limit: float
) -> list[LoadPath]:
    """The loads of a protocol for a network of structure tensor H, shape (3, 3) (section 2.3).

    `loads` are names with end magnitudes; where the magnitude is None the load ends at the averaged stretch that the
    first load, which has one, reaches, or where F stretches a line by `limit`. Magnitudes grow linearly over the steps.
    Raises LoadError for an unknown load or one that cannot reach the averaged stretch.
    """
    first = Load.parse(loads[0][0])
    if loads[0][1] is None:
        raise LoadError(f"load '{loads[0][0]}' comes first, so it needs a magnitude for the others to match")
    target = float(averaged_stretch(first.deformation_gradient(loads[0][1]), structure_tensor))
    paths = []
    for name, magnitude in loads:
        load = Load.parse(name)
        end, limited = (
            matching_magnitude(load, structure_tensor, target, limit) if magnitude is None else (magnitude, False)
        )
        paths.append(LoadPath(name, *load_path(load, end, steps), limited))
    return paths
