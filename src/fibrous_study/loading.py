"""What the rules that load networks share: networks from their files, and the loads and limits of the config."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fibrous.curves import Curves
from fibrous.deformation import LoadCase, loads
from fibrous.errors import DatasetError, naming
from fibrous.networks.fiber_law import Fiber
from fibrous.networks.guard import Limits
from fibrous.networks.network import Network, unpacked
from fibrous_study import datasets


@dataclass(frozen=True)
class Member:
    """A network with its number and name in an ensemble."""

    number: int
    name: str
    network: Network

    def __str__(self) -> str:
        return f"network {self.number} {self.name}".rstrip()

    def answers(self, cases: Sequence[LoadCase], steps: int, largest_stretch: float, limits: Limits) -> Curves:
        """What it answers to load cases, under its number and name. Raises LoadError or NetworkError, naming it."""
        with naming(str(self)):
            curves = Curves.from_dataset(self.network.load(cases, steps, largest_stretch, limits))
        return replace(curves, numbers=np.array([self.number]), names=np.array([self.name]))


def members_of(paths: Sequence[Path]) -> Iterator[Member]:
    """The networks of files, one after the other. Raises DatasetError or NetworkError, naming the file."""
    for path in paths:
        dataset = datasets.read(path, "networks")
        with naming(str(path)):
            networks = unpacked(dataset)
        for number, name, network in zip(dataset["network"].values, dataset["name"].values, networks, strict=True):
            yield Member(int(number), str(name), network)


def member_called(path: Path, name: str) -> Member:
    """The one network of that name in a file. Raises DatasetError where none or several have it."""
    found = [member for member in members_of([path]) if member.name == name]
    if len(found) != 1:
        raise DatasetError(f"{path}: holds {len(found)} networks named '{name}', not one; see `named` in the config")
    return found[0]


def networks_of(paths: Sequence[Path], numbers: Sequence[int]) -> list[Network]:
    """The networks of these numbers, in their order. Raises DatasetError where one is missing."""
    networks = {member.number: member.network for member in members_of(paths)}
    missing = [number for number in numbers if number not in networks]
    if missing:
        raise DatasetError(f"{paths[0].parent}: lacks network {missing[0]}; delete the folder and run again")
    return [networks[number] for number in numbers]


def protocol_loads(protocol: Mapping[str, Any]) -> tuple[LoadCase, ...]:
    """The load cases of a protocol of the config."""
    return loads(
        {entry["load"]: entry.get("deformation_gradient", entry.get("magnitude")) for entry in protocol["loads"]}
    )


def fiber_of(config: Mapping[str, Any]) -> Fiber:
    """The fibres of the config."""
    numbers = {key: np.inf if value is None else value for key, value in config["fiber"].items()}
    return Fiber(**numbers)
