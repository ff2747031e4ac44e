"""Rule `sensitivity_trial`: Eq. 2 fitted to networks of a study with one number changed, and its error in stress."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from fibrous.errors import naming
from fibrous.networks.generation import delaunay, network_seed
from fibrous.networks.guard import Limits
from fibrous_study import datasets
from fibrous_study.loading import Member, fiber_of, protocol_loads
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
    datasets.write_table(pd.DataFrame(rows), outputs["trials"], params, "sensitivity_trials")


def _rows(entry: Mapping[str, Any], number: int, config: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """The rows of one network, a load set each."""
    cube, stretch_limit, limits = config["cube"], config["principal_stretch_limit"], Limits(**config["equilibrium"])
    size = cube["volume_fraction"], cube["edge_length_um"]
    seed = network_seed(config["seed"], REPLICATES, number)
    H = entry["H11"], entry["H22"], 1.0 - entry["H11"] - entry["H22"]
    with naming(f"{entry['name']}, replicate {number}"):
        network = delaunay(H, fiber_of(config), *size, seed, cube["alignment_tolerance"])
    member = Member(number, entry["name"], network)
    curves, judged = (
        member.answers(protocol_loads(protocol), protocol["steps"], stretch_limit, limits)
        for protocol in (config["protocol"], config["path"])
    )
    for answers in (curves, judged):
        for _, load, step in np.argwhere(~answers.converged):
            print(
                f"{entry['name']}, replicate {number}, {answers.loads[load]}, step {step}: no equilibrium was found",
                file=sys.stderr,
            )
    for load_set in config["load_sets"]:
        chosen = curves.under(load_set["loads"])
        yield {
            "factor": config["factor"],
            "value": np.nan if config["value"] is None else config["value"],  # the base has none
            "unit": config["unit"],
            "network": entry["name"],
            "replicate": number,
            "seed": seed,
            "load_set": load_set["name"],
            **trial(chosen, judged, **config["fit"]),
            "loads_limited": int(chosen.amplitude_limited.sum()),
            "fibers": len(network.fiber_nodes),
        }
