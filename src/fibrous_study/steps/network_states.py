"""Rule `record_states`: node positions and fibre stretches of one network at every step, for figures."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fibrous.deformation import averaged_stretch
from fibrous.errors import DatasetError, naming
from fibrous.networks.path import follow
from fibrous_study import datasets
from fibrous_study.loading import loaded_networks, protocol_paths


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Load the network called ``config["network"]`` and write ``outputs["states"]``.

    Raises DatasetError if it is absent.
    """
    path, config, wanted = inputs["networks"][0], params["config"], params["config"]["network"]
    loaded = loaded_networks(path, config["equilibrium"], protocol_paths(config))
    network = next((one for one in loaded if one.name == wanted), None)
    if network is None:
        raise DatasetError(f"{path}: holds no network called '{wanted}'; add it to `named` in the config")
    gradients = np.array([load.gradients for load in network.paths])
    with naming(str(network)):
        response = follow(network.engine, gradients, network.stress_scale_MPa, geometry=True)
    arrays = {
        **{name: getattr(response, name) for name in ("node_position", "fiber_stretch")},
        "fiber_nodes": network.engine.network.fiber_nodes,
        "averaged_stretch": averaged_stretch(gradients, network.structure_tensor),
        "deformation_gradient": gradients,
    }
    loads = np.array([load.name for load in network.paths], dtype=object)
    coords = {"deformation": loads, "step": np.arange(gradients.shape[1])}
    datasets.write(datasets.packed(arrays, "states", coords), outputs["states"], "states", params)
