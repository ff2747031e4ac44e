"""Rule `deform_networks`: the W-λ curves of one batch of networks under every load of a protocol."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from fibrous import datasets
from fibrous.deformation import averaged_stretch
from fibrous.errors import naming
from fibrous.networks.path import follow
from fibrous.study.loading import LoadedNetwork, loaded_networks, protocol_paths

# Variables of the file that come from the network.
ANSWERS = (
    "strain_energy_density",
    "first_piola_kirchhoff_stress",
    "cauchy_stress",
    "largest_orientation_eigenvalue",
    "newton_iterations",
    "cuts",
    "converged",
)


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Load every network of ``inputs["networks"]`` and write ``outputs["curves"]``."""
    config = params["config"]
    networks = loaded_networks(inputs["networks"][0], config["equilibrium"], protocol_paths(config))
    datasets.write(curves_of(networks), outputs["curves"], "curves", params)


def curves_of(networks: Iterable[LoadedNetwork]) -> xr.Dataset:
    """What the networks answer along their paths, of which each has as many, of the same names and lengths."""
    rows: list[dict[str, np.ndarray]] = []
    numbers: list[int] = []
    loads: list[str] = []
    for network in networks:
        gradients = np.array([path.gradients for path in network.paths])
        with naming(str(network)):
            response = follow(network.engine, gradients, network.stress_scale_MPa)
        row = {name: getattr(response, name) for name in ANSWERS}
        row["deformation_gradient"] = gradients
        row["magnitude"] = np.array([path.magnitudes for path in network.paths])
        row["averaged_stretch"] = averaged_stretch(gradients, network.structure_tensor)
        row["amplitude_limited"] = np.array([path.amplitude_limited for path in network.paths])
        row["structure_tensor"] = network.structure_tensor
        row["name"] = np.array(network.name, dtype=object)
        rows.append(row)
        numbers.append(network.number)
        loads = [path.name for path in network.paths]
        print(f"{network}: {row['converged'].sum()} of {row['converged'].size} states converged", file=sys.stderr)
    arrays = {name: np.stack([row[name] for row in rows]) for name in datasets.CURVES}
    steps = np.arange(arrays["magnitude"].shape[-1])
    coords = {"network": np.array(numbers), "deformation": np.array(loads, dtype=object), "step": steps}
    return datasets.packed(arrays, datasets.CURVES, coords)
