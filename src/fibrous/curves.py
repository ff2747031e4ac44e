"""Curves of networks: what many networks, or one, answered to loads; the one form in which the library holds them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from fibrous.deformation import averaged_stretch
from fibrous.errors import FitError

Array = NDArray[np.float64]
STATES = ("network", "deformation", "step")
TENSORS = (*STATES, "axis", "axis_b")
#: Dimensions and unit of what curves hold, as in their datasets.
VARIABLES: dict[str, tuple[tuple[str, ...], str]] = {
    "deformation_gradient": (TENSORS, "1"),
    "magnitude": (STATES, "1"),
    "averaged_stretch": (STATES, "1"),
    "strain_energy_density": (STATES, "MPa"),
    "cauchy_stress": (TENSORS, "MPa"),
    "first_piola_kirchhoff_stress": (TENSORS, "MPa"),
    "largest_orientation_eigenvalue": (STATES, "1"),
    "newton_iterations": (STATES, "1"),
    "cuts": (STATES, "1"),
    "converged": (STATES, "1"),
    "amplitude_limited": (STATES[:2], "1"),
    "structure_tensor": (("network", "axis", "axis_b"), "1"),
    "name": (("network",), "1"),
}
#: Variables that are NaN where `converged` is not set, whatever a dataset holds there.
OF_EQUILIBRIA = (
    "strain_energy_density", "cauchy_stress", "first_piola_kirchhoff_stress", "largest_orientation_eigenvalue",
)  # fmt: skip


@dataclass(frozen=True, repr=False)
class Curves:
    """Networks under the loads of one protocol; step 0 is rest, and a state without an equilibrium holds NaN.

    numbers, names : of the networks in their ensemble, shape (networks,); loads : names
    structure_tensor : H, shape (networks, 3, 3), symmetric, positive semidefinite, trace 1
    deformation_gradient : F, shape (networks, loads, steps + 1, 3, 3), finite, of positive determinant
    magnitude : stretch, amount of shear, or part of the way, shape (networks, loads, steps + 1)
    strain_energy_density : W, MPa, the same shape
    cauchy_stress, first_piola_kirchhoff_stress : MPa, shape (networks, loads, steps + 1, 3, 3)
    largest_orientation_eigenvalue : of h, shape (networks, loads, steps + 1)
    newton_iterations, cuts : spent on the way from the step before, the same shape
    amplitude_limited : whether the limit of the principal stretch ends the load early, shape (networks, loads)

    Raises FitError for other shapes, and for F that is not finite or whose determinant is not positive.
    """

    numbers: NDArray[np.int64]
    names: NDArray[np.str_]
    loads: tuple[str, ...]
    structure_tensor: Array
    deformation_gradient: Array
    magnitude: Array
    strain_energy_density: Array
    cauchy_stress: Array
    first_piola_kirchhoff_stress: Array
    largest_orientation_eigenvalue: Array
    newton_iterations: NDArray[np.int64]
    cuts: NDArray[np.int64]
    amplitude_limited: NDArray[np.bool_]

    def __post_init__(self) -> None:
        sizes = dict(zip(STATES, (len(self.names), len(self.loads), self.strain_energy_density.shape[-1]), strict=True))
        for name, array in _arrays(self).items():
            dims = VARIABLES[name][0] if name in VARIABLES else ("network",)
            shape = tuple(sizes.get(dim, 3) for dim in dims)
            if array.shape != shape or sizes["deformation"] < 1 or sizes["step"] < 2:
                raise FitError(
                    f"curves of {sizes['network']} networks, {sizes['deformation']} loads (one at least) and "
                    f"{sizes['step']} states (two at least) need {name} of shape {shape}, not {array.shape}"
                )
        finite = np.asarray(np.isfinite(self.deformation_gradient).all(axis=(-1, -2)))
        determinants = np.linalg.det(np.where(finite[..., None, None], self.deformation_gradient, 0.0))
        for i, j, k in np.argwhere(determinants <= 0.0):
            raise FitError(
                f"curves: F of network {self.numbers[i]}, deformation {j}, step {k} is not finite or has no positive "
                "determinant: mend that deformation gradient"
            )

    @classmethod
    def of_network(cls, gradient: ArrayLike, structure_tensor: ArrayLike, energy: ArrayLike, stress: ArrayLike) -> Self:
        """One network without a name, by F, H, W and σ alone, the shapes without the axis of networks.

        Nothing was spent, loads are called by their numbers, and all else that could be known of them is NaN.
        """
        F, H, W, sigma = (np.asarray(one, dtype=float)[None] for one in (gradient, structure_tensor, energy, stress))
        none, unknown = np.zeros(W.shape, dtype=int), np.full(W.shape, np.nan)
        return cls(
            numbers=np.zeros(1, dtype=int),
            names=np.array([""]),
            loads=tuple(str(load) for load in range(W.shape[1] if W.ndim > 1 else 0)),
            structure_tensor=H,
            deformation_gradient=F,
            magnitude=unknown,
            strain_energy_density=W,
            cauchy_stress=sigma,
            first_piola_kirchhoff_stress=np.full(F.shape, np.nan),
            largest_orientation_eigenvalue=unknown,
            newton_iterations=none,
            cuts=none,
            amplitude_limited=np.zeros(W.shape[:2], dtype=bool),
        )

    @classmethod
    def from_dataset(cls, dataset: xr.Dataset) -> Self:
        """What `Network.load` returned, or several of that along the dimension `network`.

        Raises FitError where that is no curve.
        """
        if "network" not in dataset.dims:
            dataset = dataset.expand_dims(network=[0]).assign(name=("network", [""]))
        try:
            arrays = {name: dataset[name] for name in cls.__dataclass_fields__ if name in VARIABLES}
            arrays |= {name: arrays[name].where(dataset["converged"]) for name in OF_EQUILIBRIA}
        except KeyError as error:
            raise FitError(f"the dataset holds no curves: it lacks the variable {error}") from None
        return cls(
            dataset["network"].values,
            dataset["name"].values.astype(str),
            tuple(str(load) for load in dataset["deformation"].values),
            **{name: array.values for name, array in arrays.items()},
        )

    @property
    def dataset(self) -> xr.Dataset:
        """All of it with dimensions and units, the averaged stretch and the states that are equilibria among it."""
        arrays = {name: getattr(self, name) for name in VARIABLES if name != "name"}
        arrays["name"] = self.names.astype(object)
        steps = np.arange(self.magnitude.shape[-1])
        coords = {"network": self.numbers, "deformation": np.array(self.loads, dtype=object), "step": steps}
        variables = {name: (VARIABLES[name][0], array, {"units": VARIABLES[name][1]}) for name, array in arrays.items()}
        return xr.Dataset(variables, coords)

    def __repr__(self) -> str:
        """How much it holds, in a line."""
        networks, loads, states = self.magnitude.shape
        failed = int((~self.converged).sum())
        return f"<Curves: {networks} networks, {loads} loads, {states} states, {failed} without an equilibrium>"

    @classmethod
    def joined(cls, parts: Sequence[Curves]) -> Self:
        """All networks of curves under the same loads, one after the other."""
        arrays = {name: np.concatenate([getattr(part, name) for part in parts]) for name in _arrays(parts[0])}
        return cls(loads=parts[0].loads, **arrays)

    def called(self, name: str) -> Self:
        """The networks of that name."""
        return self.of(np.asarray(self.names == name))

    def network(self, index: int) -> Self:
        """One network."""
        return self.of(np.array([index]))

    def along_x(self) -> Self:
        """The networks aligned with x, the direction loaded, more than with y or z."""
        diagonal = np.einsum("nii->ni", self.structure_tensor)
        return self.of(diagonal[:, 0] >= diagonal.max(axis=1))

    def of(self, kept: NDArray[np.int64] | NDArray[np.bool_]) -> Self:
        """Some of the networks, by their indices or where `kept` is true."""
        return replace(self, **{name: array[kept] for name, array in _arrays(self).items()})

    def under(self, loads: Sequence[str]) -> Self:
        """The same networks under some of the loads, in the order asked for."""
        columns = [self.loads.index(load) for load in loads]
        arrays = {
            name: getattr(self, name)[:, columns]
            for name, (dims, _) in VARIABLES.items()
            if "deformation" in dims and name in _arrays(self)
        }
        return replace(self, loads=tuple(loads), **arrays)

    @property
    def averaged_stretch(self) -> Array:
        """λ_f, shape (networks, loads, steps + 1)."""
        pairs = zip(self.deformation_gradient, self.structure_tensor, strict=True)
        return np.array([averaged_stretch(F, H) for F, H in pairs]).reshape(self.strain_energy_density.shape)

    @property
    def converged(self) -> NDArray[np.bool_]:
        """Whether the state is a stable equilibrium, shape (networks, loads, steps + 1)."""
        return np.asarray(np.isfinite(self.strain_energy_density))

    @property
    def known(self) -> NDArray[np.bool_]:
        """Which networks are in equilibrium in every state, shape (networks,)."""
        return np.asarray(self.converged.all(axis=(1, 2)))

    @property
    def H11(self) -> Array:
        """Alignment with x, shape (networks,)."""
        return np.asarray(self.structure_tensor[:, 0, 0])

    @property
    def reach(self) -> Array:
        """Largest λ_f that all loads reach that end with the mean fibre longer than at rest, shape (networks,)."""
        ends = self.averaged_stretch[..., -1]
        return np.asarray(np.where(ends > 1.0, ends, np.inf).min(axis=1))

    def energies_at(self, stretch: ArrayLike) -> Array:
        """W of every load at averaged stretches within `reach`, one for all or one per network; (networks, loads), MPa.

        Between states W is interpolated over λ_f, from where λ_f is least on: a load of a network aligned across it
        shortens the mean fibre first. NaN of a load that ends with the mean fibre shortened.
        """
        wanted = np.broadcast_to(np.asarray(stretch, dtype=float), len(self.names))
        reached = self.averaged_stretch
        energy = np.full(reached.shape[:2], np.nan)
        for i, j in np.argwhere(reached[..., -1] > 1.0):
            rising = slice(int(np.argmin(reached[i, j])), None)
            energy[i, j] = np.interp(wanted[i], reached[i, j, rising], self.strain_energy_density[i, j, rising])
        return energy

    def dissimilarity(self, stretch: ArrayLike | None = None) -> Array:
        """Largest over least W among the loads that end with the mean fibre longer than at rest, shape (networks,).

        At λ_f as of `energies_at`, by default `reach`.
        """
        energy = self.energies_at(self.reach if stretch is None else stretch)
        return np.asarray(np.nanmax(energy, axis=1) / np.nanmin(energy, axis=1))


def _arrays(curves: Curves) -> dict[str, Any]:
    """Everything but the names of the loads, by its name; networks come first."""
    return {name: value for name, value in vars(curves).items() if name != "loads"}
