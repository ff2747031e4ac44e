"""A law whose CPU time is counted, wherever it is evaluated."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from fibrous.clock import Clock
from fibrous.materials.contract import Material, State

Array = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class Timed(Material):
    """The same law; `clock` counts what its stress and tangent cost as `part`."""

    law: Material
    clock: Clock
    part: str

    def __call__(self, gradient: Array, state: State = None, near: State = None) -> tuple[Array, Array, State]:
        """P, A and the state of the law."""
        with self.clock.of(self.part):
            return self.law(gradient, state, near)

    def energy(self, gradient: Array) -> Array:
        """W of the law, shape (...), MPa."""
        return self.law.energy(gradient)

    def __repr__(self) -> str:
        return repr(self.law)

    def of_elements(self, elements: slice) -> Self:
        """The same law for a range of elements, with the same clock."""
        return replace(self, law=self.law.of_elements(elements))
