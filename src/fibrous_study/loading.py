"""What the rules that load networks share: networks from their file, with engine, scale and load paths."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from fibrous.curves import Curves
from fibrous.deformation import LoadEnd, LoadPath, load_paths
from fibrous.errors import DatasetError, naming
from fibrous.networks.engine import Engine
from fibrous.networks.fiber_law import ExponentialFiber
from fibrous.networks.network import Network
from fibrous.networks.path import follow, stress_scale
from fibrous_study import datasets

# Fields of curves that come from the engine.
ANSWERED = (
    "strain_energy_density", "cauchy_stress", "first_piola_kirchhoff_stress", "largest_orientation_eigenvalue",
    "newton_iterations", "cuts",
)  # fmt: skip


@dataclass(frozen=True)
class LoadedNetwork:
    """One network of a file, ready to be loaded along the paths of a protocol."""

    number: int
    name: str
    structure_tensor: np.ndarray
    engine: Engine
    stress_scale_MPa: float
    paths: list[LoadPath]

    def __str__(self) -> str:
        return f"network {self.number} {self.name}".rstrip()

    def answers(self) -> Curves:
        """What it answers along its paths, all of one length. Raises NetworkError for a mechanism at rest."""
        gradients = np.array([path.gradients for path in self.paths])
        response = follow(self.engine, gradients, self.stress_scale_MPa)
        return Curves(
            numbers=np.array([self.number]),
            names=np.array([self.name]),
            loads=tuple(path.name for path in self.paths),
            structure_tensor=self.structure_tensor[None],
            deformation_gradient=gradients[None],
            magnitude=np.array([[path.magnitudes for path in self.paths]]),
            amplitude_limited=np.array([[path.amplitude_limited for path in self.paths]]),
            **{name: getattr(response, name)[None] for name in ANSWERED},
        )


# Paths of a network, by its number and its structure tensor, shape (3, 3).
PathsOf = Callable[[int, np.ndarray], list[LoadPath]]


def protocol_paths(config: Mapping[str, Any]) -> PathsOf:
    """The loads of ``config["protocol"]``, ended for each network."""
    protocol = config["protocol"]
    loads = [
        LoadEnd(entry["load"], entry.get("magnitude"), _gradient(entry.get("deformation_gradient")))
        for entry in protocol["loads"]
    ]
    return lambda _, tensor: load_paths(loads, tensor, protocol["steps"], config["principal_stretch_limit"])


def _gradient(rows: list[list[float]] | None) -> np.ndarray | None:
    return None if rows is None else np.array(rows)


def loaded_networks(path: Path, limits: Mapping[str, Any], paths_of: PathsOf) -> Iterator[LoadedNetwork]:
    """The networks of a file one after the other, with paths and the `limits` of the engine.

    Raises DatasetError, NetworkError or LoadError.
    """
    dataset = datasets.read(path, "networks")
    law, scale = fiber_law(dataset), scale_of(dataset)
    with naming(str(path)):
        networks = unpacked(dataset)
    for index, network in enumerate(networks):
        number, name = int(dataset["network"].values[index]), str(dataset["name"].values[index])
        tensor = dataset["structure_tensor"].values[index]
        with naming(f"network {number} {name}".rstrip()):
            paths = paths_of(number, tensor)
        yield LoadedNetwork(number, name, tensor, Engine.of(network, law, **limits), scale, paths)


def fiber_law(dataset: xr.Dataset) -> ExponentialFiber:
    """The law of the fibres of a dataset of the kind `networks`."""
    beyond = float(dataset.attrs["fiber_linear_beyond_stretch"])
    return ExponentialFiber(float(dataset.attrs["fiber_nonlinearity"]), np.inf if np.isnan(beyond) else beyond)


def scale_of(dataset: xr.Dataset) -> float:
    """What its forces in kA are as stresses, MPa."""
    names = ("fiber_modulus_MPa", "fiber_radius_um", "edge_length_um")
    return stress_scale(*(float(dataset.attrs[name]) for name in names))


def index_of(names: np.ndarray, name: str) -> int:
    """Where the network of that name stands among these. Raises DatasetError where none or several have it."""
    there = np.flatnonzero(names == name)
    if there.size != 1:
        raise DatasetError(f"holds {there.size} networks named '{name}' where one is needed")
    return int(there[0])


def unpacked(dataset: xr.Dataset) -> list[Network]:
    """The networks of a dataset of the kind `networks`, in its order.

    Raises DatasetError where its counts do not add up.
    """
    for count, rows in (("node_count", "node"), ("fiber_count", "fiber")):
        if int(dataset[count].sum()) != dataset.sizes[rows]:
            raise DatasetError(
                f"'{count}' adds up to {int(dataset[count].sum())} where there are {dataset.sizes[rows]} rows"
            )
    nodes = np.cumsum(dataset["node_count"].values)[:-1]
    fibers = np.cumsum(dataset["fiber_count"].values)[:-1]
    parts = zip(
        np.split(dataset["node_position"].values, nodes),
        np.split(dataset["node_is_boundary"].values, nodes),
        np.split(dataset["fiber_nodes"].values, fibers),
        strict=True,
    )
    return [Network(*part) for part in parts]


def network_named(dataset: xr.Dataset, name: str) -> Network:
    """The only network of that name in a dataset of the kind `networks`. Raises DatasetError."""
    return unpacked(dataset)[index_of(dataset["name"].values, name)]
