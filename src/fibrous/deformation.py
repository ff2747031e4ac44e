"""Deformation gradients of loads, and the stretches that follow from them (sections 2.1, 2.3, 2.6).

Axis indices are 0, 1, 2 for x, y, z; F maps reference to deformed, ``F[i, J] = ∂x_i/∂X_J``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
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
        load = cls._called(name)
        if load is None:
            raise LoadError(
                f"load '{name}' is unknown: write x_uniaxial, xy_biaxial or xy_shear, with the axes you need"
            )
        return load

    @classmethod
    def kind_of(cls, name: str) -> Kind | None:
        """Kind of the load of that name; None of any other name, whose load comes with its deformation gradient.

        >>> Load.kind_of("yz_shear"), Load.kind_of("eq9")
        ('shear', None)
        """
        load = cls._called(name)
        return None if load is None else load.kind

    @classmethod
    def _called(cls, name: str) -> Load | None:
        letters, _, kind = name.partition("_")
        wanted = {"uniaxial": 1, "biaxial": 2, "shear": 2}.get(kind)
        axes = tuple("xyz".find(letter) for letter in letters)
        if wanted is None or len(axes) != wanted or -1 in axes or len(set(axes)) != len(axes):
            return None
        return cls(cast(Kind, kind), axes)

    @property
    def name(self) -> str:
        """The name that `parse` reads."""
        return "".join("xyz"[axis] for axis in self.axes) + f"_{self.kind}"

    @property
    def rest(self) -> float:
        """Magnitude at which F is the identity."""
        return {"uniaxial": 1.0, "biaxial": 1.0, "shear": 0.0}[self.kind]

    def deformation_gradient(self, magnitude: ArrayLike) -> Array:
        """F, shape (..., 3, 3), for magnitudes of shape (...)."""
        magnitude = np.asarray(magnitude, dtype=float)
        gradient = np.zeros((*magnitude.shape, 3, 3))
        diagonal = np.einsum("...ii->...i", gradient)
        if self.kind == "shear":
            diagonal[...] = 1.0
            gradient[..., self.axes[1], self.axes[0]] = magnitude
            return gradient
        transverse = {"uniaxial": -0.5, "biaxial": -2.0}[self.kind]
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


def green_lagrange_strain(gradient: Array) -> Array:
    """E = (FᵀF − I)/2, shape (..., 3, 3), for F of shape (..., 3, 3)."""
    return 0.5 * (right_cauchy_green(gradient) - np.eye(3))


def cauchy_stress(piola: Array, gradient: Array) -> Array:
    """σ = P Fᵀ/J, shape (..., 3, 3), MPa, from the first Piola–Kirchhoff stress P and F, shapes (..., 3, 3)."""
    return piola @ np.swapaxes(gradient, -1, -2) / np.linalg.det(gradient)[..., None, None]


def maximum_shear(tensor: Array) -> Array:
    """Half the difference of the largest and the smallest principal value, shape (...), of symmetric (..., 3, 3)."""
    principal = np.linalg.eigvalsh(tensor)
    return 0.5 * (principal[..., 2] - principal[..., 0])


def element_shear(tensor: Array) -> Array:
    """Mean over Gauss points of the maximum shear, (..., elements), of tensors (..., elements, Gauss points, 3, 3)."""
    return maximum_shear(tensor).mean(axis=-1)


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


def straight_path(end: Array, steps: int) -> tuple[Array, Array]:
    """Magnitudes m from 0 to 1, shape (steps + 1,), and I + m (F − I), shape (steps + 1, 3, 3), for F at the end."""
    magnitudes = np.linspace(0.0, 1.0, steps + 1)
    return magnitudes, np.eye(3) + magnitudes[:, None, None] * (np.asarray(end, dtype=float) - np.eye(3))


@dataclass(frozen=True)
class LoadCase:
    """A load and where it ends.

    Parameters
    ----------
    name : of a load that `Load.parse` reads, or any other with a `gradient`
    magnitude : at the end; None to end at the averaged stretch that the first load case reaches
    gradient : F at the end, shape (3, 3), which grows linearly from rest, or F at every step, shape (steps + 1, 3, 3)

    Raises LoadError for a name that is unknown and has no gradient, a magnitude below 0, and a gradient that is not
    finite or whose determinant is not positive.
    """

    name: str
    magnitude: float | None = None
    gradient: Array | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        if self.gradient is None:
            Load.parse(self.name)
            if self.magnitude is not None and not 0.0 <= self.magnitude < np.inf:
                raise LoadError(f"load '{self.name}' has the magnitude {self.magnitude}; it must be at least 0")
            return
        gradient = np.asarray(self.gradient, dtype=float)
        object.__setattr__(self, "gradient", gradient)
        if gradient.ndim not in (2, 3) or gradient.shape[-2:] != (3, 3):
            raise LoadError(f"load '{self.name}': F has shape {gradient.shape}; it must be (3, 3) or (steps + 1, 3, 3)")

    def path(self, structure_tensor: Array, steps: int, target: float | None, largest_stretch: float) -> LoadPath:
        """The way to its end, where that follows from a structure tensor and the averaged stretch `target`."""
        if self.gradient is not None:
            if self.gradient.ndim == 2:
                return LoadPath(self.name, *straight_path(self.gradient, steps), amplitude_limited=False)
            if len(self.gradient) != steps + 1:
                raise LoadError(f"load '{self.name}' gives F at {len(self.gradient)} steps, not at {steps + 1}")
            return LoadPath(self.name, np.linspace(0.0, 1.0, steps + 1), self.gradient, amplitude_limited=False)
        load, end, limited = Load.parse(self.name), self.magnitude, False
        if end is None:
            if target is None:
                raise LoadError(f"load '{self.name}' comes first, so it needs a magnitude for the others to match")
            end, limited = matching_magnitude(load, structure_tensor, target, largest_stretch)
        return LoadPath(self.name, *load_path(load, end, steps), limited)


def loads(ends: Mapping[str, float | ArrayLike | None]) -> tuple[LoadCase, ...]:
    """Load cases by their names, each with its magnitude, its F (see `LoadCase`), or None to match the first.

    Raises LoadError as `LoadCase` does.

    >>> loads({"x_uniaxial": 1.3, "xy_shear": None})
    (LoadCase(name='x_uniaxial', magnitude=1.3), LoadCase(name='xy_shear', magnitude=None))
    """
    return tuple(
        LoadCase(name, end) if end is None or isinstance(end, int | float) else LoadCase(name, gradient=np.asarray(end))
        for name, end in ends.items()
    )


@dataclass(frozen=True)
class LoadPath:
    """A load case made definite for one network.

    magnitudes : shape (steps + 1,); gradients : F, shape (steps + 1, 3, 3)
    amplitude_limited : whether the load ends at the limit of the principal stretch
    """

    name: str
    magnitudes: Array
    gradients: Array
    amplitude_limited: bool


def load_paths(
    cases: Sequence[LoadCase], structure_tensor: Array, steps: int, largest_stretch: float
) -> list[LoadPath]:
    """The load cases for a network of structure tensor H, shape (3, 3) (sections 2.3 and 2.6).

    Magnitudes grow linearly over the steps. A load whose end follows from the first one's is cut where F stretches a
    line by `largest_stretch`. Raises LoadError for one that cannot reach the averaged stretch.
    """
    paths: list[LoadPath] = []
    target = None
    for case in cases:
        paths.append(case.path(structure_tensor, steps, target, largest_stretch))
        if target is None:
            target = float(averaged_stretch(paths[0].gradients[-1], structure_tensor))
    return paths
