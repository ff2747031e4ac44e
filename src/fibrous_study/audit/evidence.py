"""What statements are judged by beside curves: constants fitted to them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Constants:
    """(C2, C3) of Eq. 2 fitted to the energies of one group of loads; all arrays of shape (networks,).

    names : of a name the paper's network stands first, then its replicates, as in the curves
    H11, H22, H33 : alignment; amplitude : largest λ_f fitted
    C2 in MPa; C3; r_squared of the fit
    """

    names: NDArray[np.str_]
    H11: Array
    H22: Array
    H33: Array
    C2: Array
    C3: Array
    r_squared: Array
    amplitude: Array

    def called(self, name: str) -> Self:
        """The networks of that name."""
        return self.of(self.names == name)

    def along_x(self) -> Self:
        """The networks aligned with x, the direction loaded, more than with y or z."""
        return self.of((self.H11 >= self.H22) & (self.H11 >= self.H33))

    def of(self, kept: NDArray[np.bool_]) -> Self:
        """The networks where `kept` is true."""
        return replace(self, **{field: value[kept] for field, value in vars(self).items()})

    @property
    def known(self) -> NDArray[np.bool_]:
        """Which networks have constants and the quality of their fit, shape (networks,)."""
        return np.asarray(np.isfinite([self.C2, self.C3, self.r_squared]).all(axis=0))


@dataclass(frozen=True)
class Fits:
    """Constants by one rule of how far each network is followed: an ensemble's, and those of networks 1 and 5.

    first, fifth : each with its replicates, the paper's network first
    """

    ensemble: Constants
    first: Constants
    fifth: Constants
