"""Rule `deform_networks`: the W-λ curves of one batch of networks under every load of a protocol."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fibrous.curves import Curves
from fibrous.networks.guard import Limits
from fibrous_study.curve_datasets import write_curves
from fibrous_study.loading import members_of, protocol_loads


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Load every network of ``inputs["networks"]`` and write ``outputs["curves"]``."""
    config = params["config"]
    protocol, limits = config["protocol"], Limits(**config["equilibrium"])
    cases, parts = protocol_loads(protocol), []
    for member in members_of(inputs["networks"]):
        parts.append(member.answers(cases, protocol["steps"], config["principal_stretch_limit"], limits))
        converged = parts[-1].converged
        print(f"{member}: {converged.sum()} of {converged.size} states converged", file=sys.stderr)
    write_curves(Curves.joined(parts), outputs["curves"], params)
