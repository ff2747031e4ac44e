"""What statements are judged by: curves of networks, and constants fitted to them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

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
    cut : whether the limit of the principal stretch ends the load early, shape (networks, loads)
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
    cut: NDArray[np.bool_]

    def called(self, name: str) -> Self:
        """The networks of that name."""
        return self.of(self.names == name)

    def network(self, index: int) -> Self:
        """One network."""
        return self.of(np.array([index]))

    def along_x(self) -> Self:
        """The networks aligned with x, the direction loaded, more than with y or z."""
        diagonal = np.einsum("nii->ni", self.structure_tensor)
        return self.of(diagonal[:, 0] >= diagonal.max(axis=1))

    def of(self, kept: NDArray[np.int64] | NDArray[np.bool_]) -> Self:
        """Some of the networks, by their indices or where `kept` is true."""
        return replace(self, **{name: value[kept] for name, value in vars(self).items() if name != "loads"})

    def under(self, loads: tuple[str, ...]) -> Self:
        """The same networks under some of the loads, in the order asked for."""
        columns = [self.loads.index(load) for load in loads]
        fixed = ("names", "loads", "structure_tensor")
        arrays = {name: value[:, columns] for name, value in vars(self).items() if name not in fixed}
        return replace(self, loads=loads, **arrays)

    @property
    def known(self) -> NDArray[np.bool_]:
        """Which networks are in equilibrium in every state, shape (networks,)."""
        return np.asarray(np.isfinite(self.strain_energy_density).all(axis=(1, 2)))

    @property
    def H11(self) -> Array:
        """Alignment with x, shape (networks,)."""
        return np.asarray(self.structure_tensor[:, 0, 0])

    @property
    def reach(self) -> Array:
        """Largest averaged stretch that all loads of a network reach that `stretch` it, shape (networks,)."""
        return np.asarray(np.where(self.stretch, self.averaged_stretch[..., -1], np.inf).min(axis=1))

    @property
    def stretch(self) -> NDArray[np.bool_]:
        """Which loads end with the mean fibre longer than at rest, shape (networks, loads)."""
        return np.asarray(self.averaged_stretch[..., -1] > 1.0)

    def energies_at(self, stretch: ArrayLike) -> Array:
        """W of every load at averaged stretches within `reach`, one for all or one a network; (networks, loads), MPa.

        Between states W is interpolated over λ_f, from where λ_f is least on: a load of a network aligned across it
        shortens the mean fibre first. NaN of a load that ends with the mean fibre shortened.
        """
        wanted = np.broadcast_to(np.asarray(stretch, dtype=float), len(self.names))
        found = np.full(self.averaged_stretch.shape[:2], np.nan)
        for i, j in np.argwhere(self.stretch):
            own = self.averaged_stretch[i, j]
            rising = slice(int(np.argmin(own)), None)
            found[i, j] = np.interp(wanted[i], own[rising], self.strain_energy_density[i, j, rising])
        return found

    def dissimilarity(self, stretch: ArrayLike | None = None) -> Array:
        """Largest over least W among the loads that `stretch` the mean fibre, shape (networks,).

        At λ_f as of `energies_at`, by default `reach`.
        """
        energy = self.energies_at(self.reach if stretch is None else stretch)
        return np.asarray(np.nanmax(energy, axis=1) / np.nanmin(energy, axis=1))


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
