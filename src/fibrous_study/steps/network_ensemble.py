"""Rule `network_ensemble`: the networks of one batch of an ensemble, generated or read from the user's files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from fibrous.errors import naming
from fibrous.io.networks import read_network
from fibrous.networks import generator
from fibrous.networks.generation import alignment_targets, network_seed
from fibrous.networks.network import Network, packed
from fibrous_study import datasets
from fibrous_study.batches import share
from fibrous_study.loading import fiber_of


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Write the batch's networks to ``outputs["networks"]``; raises NetworkError where one cannot be had."""
    config = params["config"]
    cube, fiber = config["cube"], fiber_of(config)
    if config["ensemble"] == "file":
        numbers = np.array(config["numbers"])
        networks = [_read(entry, fiber=fiber, edge_um=cube["edge_length_um"]) for entry in config["network_files"]]
        targets, seeds = [network.structure_tensor for network in networks], [-1] * len(networks)
    else:
        numbers, targets = _asked(inputs, config)
        seeds = [network_seed(config["seed"], config["ensemble"], int(number)) for number in numbers]
        generate = generator(config["network"])
        size = cube["volume_fraction"], cube["edge_length_um"]
        networks = []
        for number, target, seed in zip(numbers, targets, seeds, strict=True):
            with naming(f"network {number} of {config['ensemble']}"):
                networks.append(generate(target, fiber, *size, seed, cube["alignment_tolerance"]))
    dataset = _dataset(networks, numbers, np.array(targets), np.array(seeds), _names(config, numbers))
    datasets.write(dataset, outputs["networks"], "networks", params)


def _read(entry: Mapping[str, str], **fibers: Any) -> Network:
    """The network of an entry of `network_files`."""
    paths = (entry["file"],) if "file" in entry else (entry["nodes"], entry["fibers"])
    return read_network(*paths, **fibers)


def _asked(inputs: Mapping[str, list[Path]], config: Mapping[str, Any]) -> tuple[np.ndarray, list[np.ndarray]]:
    """Numbers of the batch's networks and the structure tensors asked of them."""
    if config["ensemble"] == "tissue":
        specimen = datasets.read(inputs["files"][0], "specimen")
        network, batches = specimen["element_network"].values, config["batches"]
        elements = share(len(network), batches, config["batch"])
        return network[elements], list(specimen["structure_tensor"].values[elements])
    numbers = np.array(config["numbers"])
    entries = _entries(config, numbers)
    if entries:
        tensors = [np.diag([entry["H11"], entry["H22"], 1.0 - entry["H11"] - entry["H22"]]) for entry in entries]
        return numbers, tensors
    least, most = config["delaunay"]["H11"]
    targets = alignment_targets(numbers, config["seed"], (least, most), config["delaunay"]["smallest_H"])
    return numbers, list(targets)


def _names(config: Mapping[str, Any], numbers: np.ndarray) -> list[str]:
    if config["ensemble"] == "file":
        return [entry["name"] for entry in config["network_files"]]
    return [entry["name"] for entry in _entries(config, numbers)] or [""] * len(numbers)


def _entries(config: Mapping[str, Any], numbers: np.ndarray) -> list[Mapping[str, Any]]:
    """What the config says of named networks, or of those that are replicated; nothing in other ensembles."""
    if config["ensemble"] == "replicates":
        return list(config["replicated"])
    return [config["named"][number] for number in numbers] if config["ensemble"] == "named" else []


def _dataset(
    networks: list[Network], numbers: np.ndarray, targets: np.ndarray, seeds: np.ndarray, names: list[str]
) -> xr.Dataset:
    arrays = {
        "structure_tensor": np.array([network.structure_tensor for network in networks]),
        "target_structure_tensor": targets,
        "volume_fraction": np.array([network.volume_fraction for network in networks]),
        "shortest_fiber": np.array([network.fiber_lengths.min() for network in networks]),
        "seed": seeds,
        "name": np.array(names, dtype=object),
    }
    return packed(networks).assign(datasets.packed(arrays, "networks", {"network": numbers}))
