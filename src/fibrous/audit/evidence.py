"""What statements are judged by: curves of networks, constants fitted to them, fields of the tissue."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Curves:
    """Networks under the loads of one protocol; of a name, the paper's network stands first, then its replicates.

    names, shape (networks,); loads, shape (loads,)
    structure_tensor : H, shape (networks, 3, 3)
    deformation_gradient : F, shape (networks, loads, steps + 1, 3, 3)
    magnitude, averaged_stretch, newton_iterations, orientation : shape (networks, loads, steps + 1); orientation is the
        largest eigenvalue of h
    strain_energy_density : the same shape, MPa, NaN in a state without an equilibrium
    cauchy_stress : shape (networks, loads, steps + 1, 3, 3), MPa, likewise
    """

    names: NDArray[np.str_]
    loads: tuple[str, ...]
    structure_tensor: Array
    deformation_gradient: Array
    magnitude: Array
    averaged_stretch: Array
    strain_energy_density: Array
    cauchy_stress: Array
    orientation: Array
    newton_iterations: Array

    def called(self, name: str) -> Self:
        """The networks of that name."""
        return self._of(np.flatnonzero(self.names == name))

    def network(self, index: int) -> Self:
        """One network."""
        return self._of(np.array([index]))

    def _of(self, kept: NDArray[np.int64]) -> Self:
        return replace(self, **{name: value[kept] for name, value in vars(self).items() if name != "loads"})

    def under(self, loads: tuple[str, ...]) -> Self:
        """The same networks under some of the loads, in the order asked for."""
        columns = [self.loads.index(load) for load in loads]
        fixed = ("names", "loads", "structure_tensor")
        arrays = {name: value[:, columns] for name, value in vars(self).items() if name not in fixed}
        return replace(self, loads=loads, **arrays)

    def energies_at_common_stretch(self) -> Array:
        """W of every load at the largest averaged stretch that all loads of the network reach, (networks, loads), MPa.

        Where a load does not end there W is interpolated over λ_f, from where λ_f is least on: a load of a network
        aligned across it shortens the mean fibre first.
        """
        common = self.averaged_stretch[..., -1].min(axis=1)
        found = np.empty(self.averaged_stretch.shape[:2])
        for i, j in np.ndindex(*found.shape):
            stretch = self.averaged_stretch[i, j]
            rising = slice(int(np.argmin(stretch)), None)
            found[i, j] = np.interp(common[i], stretch[rising], self.strain_energy_density[i, j, rising])
        return found

    def dissimilarity(self) -> Array:
        """Largest over least W among the loads at their common averaged stretch, shape (networks,)."""
        energy = self.energies_at_common_stretch()
        return np.asarray(energy.max(axis=1) / energy.min(axis=1))


@dataclass(frozen=True)
class Constants:
    """(C2, C3) of Eq. 2 fitted to the energies of one group of loads; all arrays of shape (networks,).

    names : as in `Curves`; H11, H22, H33 : alignment; amplitude : largest λ_f fitted
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

    def called(self, *names: str) -> Self:
        """The networks of these names, in the order in which they stand."""
        kept = np.isin(self.names, names)
        return replace(self, **{field: value[kept] for field, value in vars(self).items()})
