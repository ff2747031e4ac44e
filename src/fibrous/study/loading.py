"""What the rules `curves` and `states` share: networks from their file, with solver, scale and load paths."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from fibrous import datasets
from fibrous.deformation import LoadPath, load_paths
from fibrous.errors import DatasetError, naming
from fibrous.networks.equilibrium import EquilibriumSolver
from fibrous.networks.fiber_law import FiberLaw
from fibrous.networks.homogenization import stress_scale
from fibrous.networks.network import Network


@dataclass(frozen=True)
class LoadedNetwork:
    """One network of a file, ready to be loaded along the paths of a protocol."""

    number: int
    name: str
    structure_tensor: np.ndarray
    solver: EquilibriumSolver
    stress_scale_MPa: float
    paths: list[LoadPath]

    def __str__(self) -> str:
        return f"network {self.number} {self.name}".rstrip()


def loaded_networks(path: Path, config: Mapping[str, Any]) -> Iterator[LoadedNetwork]:
    """The networks of a file one after the other. Raises DatasetError, NetworkError or LoadError."""
    dataset = datasets.read(path, "networks")
    limits = config["equilibrium"]
    protocol = config["protocol"]
    loads = [(entry["load"], entry.get("magnitude")) for entry in protocol["loads"]]
    constants = dataset.attrs
    beyond = float(constants["fiber_linear_beyond_stretch"])
    law = FiberLaw(float(constants["fiber_nonlinearity"]), np.inf if np.isnan(beyond) else beyond)
    scale = stress_scale(
        float(constants["fiber_modulus_MPa"]), float(constants["fiber_radius_um"]), float(constants["edge_length_um"])
    )
    with naming(str(path)):
        networks = unpacked(dataset)
    for index, network in enumerate(networks):
        number, name = int(dataset["network"].values[index]), str(dataset["name"].values[index])
        tensor = dataset["structure_tensor"].values[index]
        with naming(f"network {number} {name}".rstrip()):
            paths = load_paths(loads, tensor, protocol["steps"], config["principal_stretch_limit"])
        yield LoadedNetwork(number, name, tensor, EquilibriumSolver.of(network, law, **limits), scale, paths)


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
