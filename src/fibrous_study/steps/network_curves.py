"""Rule `deform_networks`: the W-λ curves of one batch of networks under every load of a protocol."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from fibrous.curves import Curves
from fibrous.errors import naming
from fibrous_study.curve_datasets import write_curves
from fibrous_study.loading import LoadedNetwork, loaded_networks, protocol_paths


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Load every network of ``inputs["networks"]`` and write ``outputs["curves"]``."""
    config = params["config"]
    networks = loaded_networks(inputs["networks"][0], config["equilibrium"], protocol_paths(config))
    write_curves(curves_of(networks), outputs["curves"], params)


def curves_of(networks: Iterable[LoadedNetwork]) -> Curves:
    """What the networks answer along their paths, of which each has as many, of the same names and lengths."""
    parts = []
    for network in networks:
        with naming(str(network)):
            part = network.answers()
        print(f"{network}: {part.converged.sum()} of {part.converged.size} states converged", file=sys.stderr)
        parts.append(part)
    return Curves.joined(parts)
