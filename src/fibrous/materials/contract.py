"""What a material is: ``P, A, state = material(F, state, near)`` over arbitrary leading axes.

F[..., i, J] is the deformation gradient ∂x_i/∂X_J, P[..., i, J] the first Piola–Kirchhoff stress ∂W/∂F_iJ and
A[..., i, J, k, L] the tangent ∂P_iJ/∂F_kL, both in MPa. Parameters broadcast against the leading axes of F: in finite
elements F has shape (elements, Gauss points, 3, 3), so a parameter of each element has shape (elements, 1).

Inside a material arrays run components first, points last, so that NumPy's inner loops are long; what a material
returns are views of such arrays with the components moved to the end.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields
from typing import Any, ClassVar, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fibrous.errors import FibrousError

Array = NDArray[np.float64]
# None for a hyperelastic law; else an array, or a tuple of states (named or not), whose leading axes are those of F.
State = Any


class MaterialError(FibrousError):
    """A material constant is out of its range."""


class Material(Protocol):
    """A law of stress; see the module's text for shapes and units."""

    def __call__(self, gradient: Array, state: State = None, near: State = None) -> tuple[Array, Array, State]:
        """P (..., 3, 3), A (..., 3, 3, 3, 3) and the new state, for F of shape (..., 3, 3).

        `state` is that of the last equilibrium, and the only memory of a law that has one. `near` is what the law
        returned for a trial of the same increment, or None for the first: a law that is solved for may start there.

        All three are new arrays: the caller may write into P and A, and both states are left as they were. Where F
        has no stress (a determinant that is not positive) P and A of a solid are not finite; fibres alone may have
        some. Raises ConvergenceError where a law that is solved for, not evaluated, finds no solution.
        """

    def energy(self, gradient: Array) -> Array:
        """W, shape (...), MPa, for F of shape (..., 3, 3)."""

    def of_elements(self, elements: slice) -> Self:
        """The same law for a range of elements, the first of the leading axes."""


class PerElement:
    """Base of materials whose fields may differ from element to element.

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
        found = value[tuple(bad[0])].tolist()
        raise MaterialError(f"{where}{name} is {found}; it must be {range_}")


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
