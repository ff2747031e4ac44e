"""Rule `try_variant`: Eq. 2 fitted to networks of a study in which one number is another, and its error in stress."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from fibrous.errors import naming
from fibrous.networks.engine import Engine
from fibrous.networks.fiber_law import ExponentialFiber
from fibrous.networks.generation import delaunay_network, network_seed
from fibrous.networks.network import structure_tensor, total_length
from fibrous.networks.path import stress_scale
from fibrous_study import datasets
from fibrous_study.loading import LoadedNetwork, protocol_paths
from fibrous_study.sensitivity.trial import trial

REPLICATES = "replicates"  # the ensemble whose seeds the networks share


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Write outputs["trials"], a row for each network and load set; nothing is read.

    The config is the variant's: `factor`, `value` and `unit` name it, `networks` holds alignments with the `numbers` of
    their replicates, `protocol` the loads that are fitted, and `path` the one along which the law is judged. States
    without an equilibrium are left out, counted, and named on stderr.
    Raises NetworkError where a network cannot be had.
    """
    config = params["config"]
    rows = [row for entry in config["networks"] for number in entry["numbers"] for row in _rows(entry, number, config)]
    datasets.write_table(pd.DataFrame(rows), outputs["trials"], params)


def _rows(entry: Mapping[str, Any], number: int, config: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """The rows of one network, a load set each."""
    cube, fiber = config["cube"], config["fiber"]
    length = total_length(cube["volume_fraction"], cube["edge_length_um"], fiber["radius_um"])
    scale = stress_scale(fiber["modulus_MPa"], fiber["radius_um"], cube["edge_length_um"])
    law = ExponentialFiber(fiber["nonlinearity"], fiber["linear_beyond_stretch"] or np.inf)
    seed = network_seed(config["seed"], REPLICATES, number)
    asked = np.diag([entry["H11"], entry["H22"], 1.0 - entry["H11"] - entry["H22"]])
    with naming(f"{entry['name']}, replicate {number}"):
        network = delaunay_network(asked, length, seed, cube["alignment_tolerance"])
        tensor = structure_tensor(network.fiber_vectors)
        paths = [protocol_paths({**config, "protocol": config[key]})(number, tensor) for key in ("protocol", "path")]
        engine = Engine.of(network, law, **config["equilibrium"])
        curves, judged = (LoadedNetwork(number, entry["name"], tensor, engine, scale, part).answers() for part in paths)
    for answers in (curves, judged):
        for _, load, step in np.argwhere(~answers.converged):
            print(
                f"{entry['name']}, replicate {number}, {answers.loads[load]}, step {step}: no equilibrium was found",
                file=sys.stderr,
            )
    for load_set in config["load_sets"]:
        chosen = curves.under(load_set["loads"])
        yield {
            **{key: config[key] for key in ("factor", "value", "unit")},
            "network": entry["name"],
            "replicate": number,
            "seed": seed,
            "load_set": load_set["name"],
            **trial(chosen, judged, **config["fit"]),
            "loads_limited": int(chosen.amplitude_limited.sum()),
            "fibers": len(network.fiber_nodes),
        }
