"""What a material is: ``P, A, state = material(F, state, near)`` over arbitrary leading axes, and sums of materials.

F[..., i, J] is the deformation gradient ∂x_i/∂X_J, P[..., i, J] the first Piola–Kirchhoff stress ∂W/∂F_iJ and
A[..., i, J, k, L] the tangent ∂P_iJ/∂F_kL, both in MPa. Parameters broadcast against the leading axes of F: in finite
elements F has shape (elements, Gauss points, 3, 3), so a parameter of each element has shape (elements, 1).

Inside a material arrays run components first, points last, so that NumPy's inner loops are long; what a material
returns are views of such arrays with the components moved to the end.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fibrous.deformation import cauchy_stress
from fibrous.errors import FibrousError

Array = NDArray[np.float64]
# None for a hyperelastic law; else an array, or a tuple of states (named or not), whose leading axes are those of F.
State = Any


class MaterialError(FibrousError):
    """A material constant is out of its range."""


class Material:
    """Base of all laws of stress; see the module's text for shapes and units.

    A law of one's own defines `__call__`, `energy` and `of_elements`, the last by way of PerElement where its constants
    may differ between elements. ``law + law`` is their sum.
    """

    def __call__(self, gradient: Array, state: State = None, near: State = None) -> tuple[Array, Array, State]:
        """P (..., 3, 3), A (..., 3, 3, 3, 3) and the new state, for F of shape (..., 3, 3).

        `state` is that of the last equilibrium, and the only memory of a law that has one. `near` is what the law
        returned for a trial of the same increment, or None for the first: a law that is solved for may start there.

        All three are new arrays: the caller may write into P and A, and both states are left as they were. Where F
        has no stress (a determinant that is not positive) P and A of a solid are not finite; fibres alone may have
        some. Raises ConvergenceError where a law that is solved for, not evaluated, finds no solution.
        """
        raise NotImplementedError

    def energy(self, gradient: Array) -> Array:
        """W, shape (...), MPa, for F of shape (..., 3, 3)."""
        raise NotImplementedError

    def of_elements(self, elements: slice) -> Self:
        """The same law for a range of elements, the first of the leading axes."""
        raise NotImplementedError

    def stress(self, gradient: Array) -> Array:
        """Cauchy stress σ = P Fᵀ/J from rest to F, shape (..., 3, 3), MPa."""
        return cauchy_stress(self.piola(gradient), gradient)

    def piola(self, gradient: Array) -> Array:
        """First Piola–Kirchhoff stress P from rest to F, shape (..., 3, 3), MPa."""
        return self(gradient)[0]

    def tangent(self, gradient: Array) -> Array:
        """∂P_iJ/∂F_kL from rest to F, shape (..., 3, 3, 3, 3), MPa."""
        return self(gradient)[1]

    def __add__(self, other: Material) -> Mixture:
        return Mixture((*_parts(self), *_parts(other)))


@dataclass(frozen=True, repr=False)
class Mixture(Material):
    """The sum of materials under one deformation gradient: energies and stresses add (Eq. 10A).

    parts : one material at the least. The state is a tuple with one state per part, or None where no part has one.
    """

    parts: tuple[Material, ...]

    def __call__(self, gradient: Array, state: State = None, near: State = None) -> tuple[Array, Array, State]:
        """Sums of P and A over the parts, and the tuple of their states."""
        without = (None,) * len(self.parts)
        states, nears = (without if given is None else given for given in (state, near))
        stress, tangent, first = self.parts[0](gradient, states[0], nears[0])
        new = [first]
        for part, before, start in zip(self.parts[1:], states[1:], nears[1:], strict=True):
            more_stress, more_tangent, after = part(gradient, before, start)
            stress = _sum(stress, more_stress)
            tangent = _sum(tangent, more_tangent)
            new.append(after)
        return stress, tangent, None if all(after is None for after in new) else tuple(new)

    def energy(self, gradient: Array) -> Array:
        """Sum of W over the parts, shape (...), MPa."""
        return np.asarray(sum(part.energy(gradient) for part in self.parts))

    def of_elements(self, elements: slice) -> Self:
        """The same sum for a range of elements."""
        return type(self)(tuple(part.of_elements(elements) for part in self.parts))

    def __repr__(self) -> str:
        return " + ".join(map(repr, self.parts))


def _parts(material: Material) -> tuple[Material, ...]:
    return material.parts if isinstance(material, Mixture) else (material,)


def _sum(total: Array, more: Array) -> Array:
    """The sum, in the memory of `total` unless `more` has parameters at more points than `total` had."""
    fits = np.broadcast_shapes(total.shape, more.shape) == total.shape
    return np.add(total, more, out=total if fits else None)


class PerElement(Material):
    """Base of materials, frozen dataclasses, whose fields may differ from element to element.

    `component_axes` tells how many trailing axes of a field are components (2 for a tensor); a field not named there
    has none, and one that is no array is the same everywhere.
    """

    component_axes: ClassVar[dict[str, int]] = {}

    def of_elements(self, elements: slice) -> Self:
        """The same law for a range of elements, the first of the leading axes."""
        parts = {}
        for field in fields(self):  # type: ignore[arg-type]
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray):
                leading = value.ndim - self.component_axes.get(field.name, 0)
                # With one leading axis or none a parameter belongs to Gauss points or to all.
                parts[field.name] = value[elements] if leading > 1 and len(value) > 1 else value
        return _replaced(self, parts)

    def __repr__(self) -> str:
        values = ", ".join(f"{field.name}={_brief(getattr(self, field.name))}" for field in fields(self))  # type: ignore[arg-type]
        return f"{type(self).__name__}({values})"

    def _check(self, name: str, allowed: Callable[[Array], NDArray[np.bool_]], range_: str) -> None:
        """Make the field `name` an array of floats; raise MaterialError naming the first element outside `range_`."""
        value = np.asarray(getattr(self, name), dtype=float)
        object.__setattr__(self, name, value)
        with np.errstate(invalid="ignore"):
            good = np.isfinite(value) & allowed(value)
        refuse(good, value, name, range_)


def refuse(good: ArrayLike, value: Array, name: str, range_: str) -> None:
    """Raise MaterialError for the first place where `good` is false, naming the element and the value there.

    `good` has shape (elements, 1, ...) where the constant differs between elements, else fewer than two axes; it may
    have fewer axes than `value`, whose further axes are components.
    """
    good = np.asarray(good)
    bad = np.argwhere(~good)
    if len(bad):
        where = f"element {bad[0][0]}: " if good.ndim > 1 else ""
        raise MaterialError(f"{where}{name} is {value[tuple(bad[0])].tolist()}; it must be {range_}")


def _brief(value: Any) -> str:
    """A constant in a few characters: of an array its shape and range."""
    if not isinstance(value, np.ndarray):
        return repr(value)
    if value.ndim == 0:
        return f"{value:g}"
    return f"<{' x '.join(map(str, value.shape))}, {value.min():.3g} to {value.max():.3g}>"


def _replaced(material: Any, parts: dict[str, Array]) -> Any:
    # The constants were checked when the whole was made, and checking is not free.
    copy = object.__new__(type(material))
    for field in fields(material):
        object.__setattr__(copy, field.name, parts.get(field.name, getattr(material, field.name)))
    return copy


def components_first(*arrays: tuple[ArrayLike, int]) -> list[Array]:
    """Views with the component axes moved to the front, so that their leading axes broadcast against each other.

    Each array comes with its number of trailing axes that are components. The first, the deformation gradient, is
    broadcast to the leading axes of all.
    """
    leading = max(np.ndim(values) - axes for values, axes in arrays)
    views = []
    for values, axes in arrays:
        values = np.asarray(values, dtype=float)
        padded = values.reshape((1,) * (leading + axes - values.ndim) + values.shape)
        views.append(np.moveaxis(padded, range(-axes, 0), range(axes)))
    points = np.broadcast_shapes(*(view.shape[axes:] for view, (_, axes) in zip(views, arrays, strict=True)))
    views[0] = np.broadcast_to(views[0], views[0].shape[: arrays[0][1]] + points)
    return views


def components_last(values: Array, axes: int) -> Array:
    """A view with the first `axes` axes moved to the end."""
    return np.moveaxis(values, range(axes), range(-axes, 0))


def select(state: State, elements: slice) -> State:
    """The state of a range of elements."""
    if state is None:
        return None
    if isinstance(state, tuple):
        return _alike(state, [select(part, elements) for part in state])
    return state[elements]


def join(states: Sequence[State]) -> State:
    """The state of all elements from those of consecutive ranges; the inverse of `select`."""
    first = states[0]
    if first is None:
        return None
    if len(states) == 1:
        return first
    if isinstance(first, tuple):
        return _alike(first, [join(parts) for parts in zip(*states, strict=True)])
    return np.concatenate(states)


def arrays_of(state: State) -> list[NDArray[Any]]:
    """All arrays of a state in a fixed order, the very ones, not copies."""
    if state is None:
        return []
    if isinstance(state, tuple):
        return [array for part in state for array in arrays_of(part)]
    return [state]


def _alike(state: tuple[State, ...], parts: list[State]) -> State:
    """A tuple of `parts`, with names where `state` has them."""
    return type(state)(*parts) if hasattr(state, "_fields") else tuple(parts)
