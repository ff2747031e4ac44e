"""Rule `make_networks`: the networks of one batch of an ensemble, generated or read from the user's files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from fibrous.errors import naming
from fibrous.io.networks import read_network
from fibrous.networks.generation import alignment_targets, delaunay_network, network_seed
from fibrous.networks.network import Network, structure_tensor, total_length, volume_fraction
from fibrous_study import datasets
from fibrous_study.batches import share


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Write the batch's networks to ``outputs["networks"]``; raises NetworkError where one cannot be had."""
    config = params["config"]
    if config["ensemble"] == "file":
        numbers = np.array(config["numbers"])
        networks = [read_network(entry) for entry in config["network_files"]]
        targets, seeds = [structure_tensor(network.fiber_vectors) for network in networks], [-1] * len(networks)
    else:
        numbers, targets = _asked(inputs, config)
        seeds = [network_seed(config["seed"], config["ensemble"], int(number)) for number in numbers]
        length = total_length(
            config["cube"]["volume_fraction"], config["cube"]["edge_length_um"], config["fiber"]["radius_um"]
        )
        tolerance = config["cube"]["alignment_tolerance"]
        networks = []
        for number, target, seed in zip(numbers, targets, seeds, strict=True):
            with naming(f"network {number} of {config['ensemble']}"):
                networks.append(delaunay_network(target, length, seed, tolerance))
    dataset = _packed(networks, numbers, np.array(targets), np.array(seeds), _names(config, numbers), config)
    datasets.write(dataset, outputs["networks"], "networks", params)


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


def _packed(
    networks: list[Network],
    numbers: np.ndarray,
    targets: np.ndarray,
    seeds: np.ndarray,
    names: list[str],
    config: Mapping[str, Any],
) -> xr.Dataset:
    cube, fiber = config["cube"], config["fiber"]
    arrays = {
        "node_count": np.array([len(network.node_position) for network in networks]),
        "fiber_count": np.array([len(network.fiber_nodes) for network in networks]),
        "node_position": np.concatenate([network.node_position for network in networks]),
        "node_is_boundary": np.concatenate([network.node_is_boundary for network in networks]),
        "fiber_nodes": np.concatenate([network.fiber_nodes for network in networks]),
        "structure_tensor": np.array([structure_tensor(network.fiber_vectors) for network in networks]),
        "target_structure_tensor": targets,
        "volume_fraction": np.array(
            [volume_fraction(network, cube["edge_length_um"], fiber["radius_um"]) for network in networks]
        ),
        "shortest_fiber": np.array([network.fiber_lengths.min() for network in networks]),
        "seed": seeds,
        "name": np.array(names, dtype=object),
    }
    dataset = datasets.packed(arrays, "networks", {"network": numbers})
    dataset.attrs.update(
        edge_length_um=cube["edge_length_um"],
        fiber_radius_um=fiber["radius_um"],
        fiber_modulus_MPa=fiber["modulus_MPa"],
        fiber_nonlinearity=fiber["nonlinearity"],
        # NetCDF has no null: NaN says that the law is exponential throughout.
        fiber_linear_beyond_stretch=np.nan
        if fiber["linear_beyond_stretch"] is None
        else fiber["linear_beyond_stretch"],
    )
    return dataset
