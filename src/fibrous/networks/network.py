"""A network with its fibres and the size of its cube: from F to energies and stresses in MPa (Eqs. 4.1, 5 and 7)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import MISSING, dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from fibrous.clock import Clock
from fibrous.curves import Curves
from fibrous.deformation import LoadCase, load_paths
from fibrous.errors import ConfigError, ConvergenceError, DatasetError, NetworkError
from fibrous.io.netcdf import save
from fibrous.networks.engine import Engine
from fibrous.networks.fiber_law import FIBER_LAWS, FiberLaw
from fibrous.networks.geometry import Geometry, check
from fibrous.networks.guard import LIMITS, Limits
from fibrous.networks.path import Response, follow

Array = NDArray[np.float64]

#: Attributes of a dataset of networks.
EDGE, LAW = "edge_length_um", "fiber_law"
#: Variables of a dataset of networks, with their dimensions.
RAGGED = {"node_position": ("node", "axis"), "node_is_boundary": ("node",), "fiber_nodes": ("fiber", "end")}
# Fields of curves that come from the engine.
ANSWERED = (
    "strain_energy_density", "cauchy_stress", "first_piola_kirchhoff_stress", "largest_orientation_eigenvalue",
    "newton_iterations", "cuts",
)  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class Network(Geometry):
    """Pin-jointed fibres in a cube whose faces move with the deformation gradient.

    Parameters
    ----------
    node_position : shape (nodes, 3), edges of the cube, which is centred on the origin
    node_is_boundary : whether a node moves with F, shape (nodes,)
    fiber_nodes : nodes at the ends of each fibre, shape (fibers, 2)
    fiber : law, modulus and radius of the fibres, the same for all or with numbers per fibre
    edge_um : edge χ of the cube

    Arrays are copied, and cannot be written to. Raises NetworkError, naming the first node or fibre at fault, where
    there is no network to be loaded (see `geometry.check`), ConfigError where the fibre law has numbers for another
    number of fibres.

    >>> import numpy as np
    >>> from fibrous import Fiber, delaunay
    >>> fiber = Fiber(modulus_MPa=10.0, nonlinearity=2.5, radius_um=0.1)
    >>> network = delaunay((0.6, 0.25, 0.15), fiber, volume_fraction=0.04, edge_um=10.0, seed=1)
    >>> network
    <Network: 453 fibres, 35 interior nodes, H = (0.60, 0.25, 0.15), φ = 0.040>
    >>> network.stress(np.diag([1.3, 0.88, 0.88])).shape
    (3, 3)
    """

    fiber: FiberLaw = field(kw_only=True)
    edge_um: float = field(kw_only=True)

    def __post_init__(self) -> None:
        if not 0.0 < self.edge_um < np.inf:
            raise NetworkError(f"edge_um is {self.edge_um}; it must be a number above 0")
        for name, kind in (("node_position", float), ("node_is_boundary", bool), ("fiber_nodes", np.int64)):
            array = np.array(getattr(self, name), dtype=kind)
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        check(self)
        self.fiber.fibers(self.fiber_lengths)

    def __repr__(self) -> str:
        """How many fibres and nodes, H and the volume fraction, in a line."""
        diagonal = ", ".join(f"{value:.2f}" for value in np.diag(self.structure_tensor))
        return (
            f"<Network: {len(self.fiber_nodes)} fibres, {int((~self.node_is_boundary).sum())} interior nodes, "
            f"H = ({diagonal}), φ = {self.volume_fraction:.3f}>"
        )

    def __getstate__(self) -> dict[str, Any]:
        return {entry.name: getattr(self, entry.name) for entry in fields(self)}

    @property
    def volume_fraction(self) -> float:
        """φ = Σ A L / χ³ (Eq. 5)."""
        lengths = (self.fiber.section * self.fiber_lengths).sum()
        return float(np.pi * self.fiber.radius_um**2 * lengths / self.edge_um**2)

    @property
    def stress_unit_MPa(self) -> float:
        """k A/χ²: what forces in kA over areas in edges² are as stresses."""
        return float(self.fiber.modulus_MPa * np.pi * self.fiber.radius_um**2 / self.edge_um**2)

    def engine(self, limits: Limits = LIMITS, clock: Clock | None = None) -> Engine:
        """What solves for its equilibria, in edges and kA; `clock` counts the CPU seconds of its parts."""
        return Engine.of(self, self.fiber, limits, clock)

    def energy(self, gradient: ArrayLike) -> Array:
        """W, shape (...), MPa, for F of shape (..., 3, 3); see `stress`."""
        return self._reached(gradient, "strain_energy_density")

    def piola(self, gradient: ArrayLike) -> Array:
        """First Piola–Kirchhoff stress P = ∂W/∂F, shape (..., 3, 3), MPa; see `stress`."""
        return self._reached(gradient, "first_piola_kirchhoff_stress")

    def stress(self, gradient: ArrayLike) -> Array:
        """Cauchy stress σ = P Fᵀ/J (Eq. 7), shape (..., 3, 3), MPa, for F of shape (..., 3, 3).

        Every F is reached from rest, in as many parts as it takes. Raises ConvergenceError where the network finds no
        stable equilibrium (`load` goes on without that state), NetworkError where it is a mechanism at rest.
        """
        return self._reached(gradient, "cauchy_stress")

    def tangent(self, gradient: ArrayLike) -> Array:
        """∂P_iJ/∂F_kL along equilibria, shape (..., 3, 3, 3, 3), MPa; see `stress`."""
        return self._reached(gradient, "tangent")

    def load(
        self,
        cases: Sequence[LoadCase],
        steps: int = 20,
        largest_stretch: float = 4.0,
        limits: Limits = LIMITS,
        geometry: bool = False,
        tangent: bool = False,
    ) -> xr.Dataset:
        """What the network answers to loads, step by step from rest; a state is an equilibrium where it is `converged`.

        Parameters
        ----------
        cases : of `fibrous.loads`
        steps : after rest
        largest_stretch : principal stretch of F at which a load that matches the first one ends at the latest
        limits : of the search for equilibria
        geometry : whether to give positions of nodes (edges), stretches of fibres and the orientation tensor, too
        tangent : whether to give ∂P_iJ/∂F_kL, MPa, too

        Returns a dataset with the dimensions deformation, step, axis and axis_b and the variables of
        `fibrous.curves.VARIABLES` that do not tell networks apart. A state that did not converge, and all that follow
        under its load, are NaN. Raises LoadError for a load that cannot be made, NetworkError for a mechanism at rest.

        >>> from fibrous import Fiber, delaunay, loads
        >>> fiber = Fiber(modulus_MPa=10.0, nonlinearity=2.5, radius_um=0.1)
        >>> network = delaunay((0.6, 0.25, 0.15), fiber, volume_fraction=0.04, edge_um=10.0, seed=1)
        >>> curves = network.load(loads({"x_uniaxial": 1.3, "xy_shear": None}), steps=4)
        >>> curves["cauchy_stress"].dims
        ('deformation', 'step', 'axis', 'axis_b')
        >>> curves["averaged_stretch"][:, -1].values.round(3).tolist()
        [1.152, 1.152]
        """
        tensor = self.structure_tensor
        paths = load_paths(cases, tensor, steps, largest_stretch)
        if not paths:
            raise ConfigError("there is no load; name one at least")
        gradients = np.array([path.gradients for path in paths])
        engine = self._engine if limits == LIMITS else self.engine(limits)
        response = follow(engine, gradients, self.stress_unit_MPa, tangent=tangent, geometry=geometry)
        curves = Curves(
            numbers=np.zeros(1, dtype=int),
            names=np.array([""]),
            loads=tuple(path.name for path in paths),
            structure_tensor=tensor[None],
            deformation_gradient=gradients[None],
            magnitude=np.array([[path.magnitudes for path in paths]]),
            amplitude_limited=np.array([[path.amplitude_limited for path in paths]]),
            **{name: getattr(response, name)[None] for name in ANSWERED},
        )
        more = self._geometry(response) if geometry else {}
        if tangent:
            more["tangent"] = (("deformation", "step", "axis", "axis_b", "axis_c", "axis_d"), response.tangent)
        return curves.dataset.isel(network=0).drop_vars(["network", "name"]).assign(more)

    def save(self, path: str | Path) -> None:
        """Write a NetCDF-4 file that `fibrous.read_network` reads. Raises DatasetError where it cannot be written."""
        try:
            save(packed([self]), Path(path), {})
        except OSError as error:
            raise DatasetError(f"{path}: cannot be written ({error})") from None

    @cached_property
    def _engine(self) -> Engine:
        return self.engine()

    def _reached(self, gradient: ArrayLike, name: str) -> Array:
        """A field of the response at F, shape (..., 3, 3), each reached from rest."""
        gradient = np.asarray(gradient, dtype=float)
        if gradient.shape[-2:] != (3, 3):
            raise ConfigError(f"deformation gradients have the shape {gradient.shape}; it must be (..., 3, 3)")
        paths = gradient.reshape(-1, 1, 3, 3)
        response = follow(self._engine, paths, self.stress_unit_MPa, tangent=name == "tangent")
        lost = np.flatnonzero(~response.converged[:, 0])
        if lost.size:
            raise ConvergenceError(
                f"no stable equilibrium was found at F = {paths[lost[0], 0].tolist()}; go there in steps (load)"
            )
        values: Array = getattr(response, name)
        return values.reshape((*gradient.shape[:-2], *values.shape[2:]))

    def _geometry(self, response: Response) -> dict[str, Any]:
        """Where nodes and fibres are in every state, as variables of a dataset."""
        states = ("deformation", "step")
        return {
            "node_position": ((*states, "node", "axis"), response.node_position, {"units": "edge"}),
            "fiber_stretch": ((*states, "fiber"), response.fiber_stretch, {"units": "1"}),
            "orientation_tensor": ((*states, "axis", "axis_b"), response.orientation_tensor, {"units": "1"}),
            "fiber_nodes": (("fiber", "end"), self.fiber_nodes, {"units": "1"}),
        }


def packed(networks: Sequence[Network]) -> xr.Dataset:
    """Networks of one edge and one fibre law as a dataset: the nodes and fibres of one network after the other.

    Numbers of the law that differ from fibre to fibre are variables, others attributes. Raises ConfigError for networks
    of several edges or laws.
    """
    first = networks[0]
    arrays: dict[str, Any] = {
        "node_count": (("network",), np.array([len(network.node_position) for network in networks])),
        "fiber_count": (("network",), np.array([len(network.fiber_nodes) for network in networks])),
    }
    for name, dims in RAGGED.items():
        arrays[name] = (dims, np.concatenate([getattr(network, name) for network in networks]))
    law = {kind: name for name, kind in FIBER_LAWS.items()}[type(first.fiber)]
    attributes: dict[str, Any] = {EDGE: first.edge_um, LAW: law}
    for entry in fields(first.fiber):
        values = [getattr(network.fiber, entry.name) for network in networks]
        if any(np.ndim(value) for value in values):
            per_fiber = [np.full(n, value) for n, value in zip(arrays["fiber_count"][1], values, strict=True)]
            arrays[f"fiber_{entry.name}"] = (("fiber",), np.concatenate(per_fiber))
        elif len(set(values)) == 1:
            attributes[f"fiber_{entry.name}"] = values[0]
        else:
            raise ConfigError(f"networks of several fiber.{entry.name} cannot share a file")
    if any(network.edge_um != first.edge_um or type(network.fiber) is not type(first.fiber) for network in networks):
        raise ConfigError("networks of several edges or fibre laws cannot share a file")
    return xr.Dataset(arrays, attrs=attributes)


def unpacked(dataset: xr.Dataset) -> list[Network]:
    """The networks of a dataset that `packed` made, in its order.

    Raises DatasetError where its counts do not add up, or it lacks what makes up the fibres; NetworkError and
    ConfigError as `Network` does.
    """
    for dim in ("node", "fiber"):
        total = int(dataset[f"{dim}_count"].sum())
        if total != dataset.sizes[dim]:
            raise DatasetError(f"'{dim}_count' adds up to {total} where there are {dataset.sizes[dim]} rows")
    law = FIBER_LAWS.get(str(dataset.attrs.get(LAW)))
    if law is None or EDGE not in dataset.attrs:
        raise DatasetError(f"lacks the attributes {EDGE} and {LAW} (one of {', '.join(FIBER_LAWS)})")
    ends = {dim: np.cumsum(dataset[f"{dim}_count"].values)[:-1] for dim in ("node", "fiber")}
    parts = [np.split(dataset[name].values, ends[dims[0]]) for name, dims in RAGGED.items()]
    names = {entry.name: f"fiber_{entry.name}" for entry in fields(law)}
    missing = [
        names[entry.name]
        for entry in fields(law)
        if entry.default is MISSING and names[entry.name] not in {*dataset.attrs, *dataset}
    ]
    if missing:
        raise DatasetError(f"lacks the attribute {missing[0]} of a fiber whose law is {dataset.attrs[LAW]}")
    numbers: dict[str, Any] = {name: float(dataset.attrs[key]) for name, key in names.items() if key in dataset.attrs}
    rows: dict[str, Any] = {
        name: np.split(dataset[key].values, ends["fiber"]) for name, key in names.items() if key in dataset
    }
    edge = float(dataset.attrs[EDGE])
    networks = []
    for k, arrays in enumerate(zip(*parts, strict=True)):
        fiber = law(**numbers, **{name: values[k] for name, values in rows.items()})
        networks.append(Network(*arrays, fiber=fiber, edge_um=edge))
    return networks
