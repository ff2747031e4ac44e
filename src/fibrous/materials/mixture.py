"""Several laws in parallel: energies and stresses add (Eq. 10A)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from fibrous.materials.contract import Material, State

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Mixture:
    """The sum of materials under one deformation gradient.

    parts : one material at the least. The state is a tuple with one state a part, or None where no part has one.
    """

    parts: tuple[Material, ...]

    def __call__(self, gradient: Array, state: State = None, near: State = None) -> tuple[Array, Array, State]:
        """Sums of P and A over the parts, and the tuple of their states."""
        none = (None,) * len(self.parts)
        states, nears = (one if one is not None else none for one in (state, near))
        stress, tangent, first = self.parts[0](gradient, states[0], nears[0])
        new = [first]
        for part, own, start in zip(self.parts[1:], states[1:], nears[1:], strict=True):
            more_stress, more_tangent, next_ = part(gradient, own, start)
            stress = _sum(stress, more_stress)
            tangent = _sum(tangent, more_tangent)
            new.append(next_)
        return stress, tangent, None if all(one is None for one in new) else tuple(new)

    def energy(self, gradient: Array) -> Array:
        """Sum of W over the parts, shape (...), MPa."""
        return np.asarray(sum(part.energy(gradient) for part in self.parts))

    def of_elements(self, elements: slice) -> Self:
        """The same sum for a range of elements."""
        return type(self)(tuple(part.of_elements(elements) for part in self.parts))


def _sum(total: Array, more: Array) -> Array:
    """The sum, in the memory of `total` unless `more` has parameters at more points than `total` had."""
    fits = np.broadcast_shapes(total.shape, more.shape) == total.shape
    return np.add(total, more, out=total if fits else None)
