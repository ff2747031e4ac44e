"""Rule `record_states`: node positions and fibre stretches of one network at every step, for figures."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fibrous.errors import naming
from fibrous.networks.guard import Limits
from fibrous_study import datasets
from fibrous_study.loading import member_called, protocol_loads


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Load the network called ``config["network"]`` and write ``outputs["states"]``.

    Raises DatasetError if it is absent.
    """
    config = params["config"]
    protocol, limits = config["protocol"], Limits(**config["equilibrium"])
    member = member_called(inputs["networks"][0], config["network"])
    with naming(str(member)):
        states = member.network.load(
            protocol_loads(protocol), protocol["steps"], config["principal_stretch_limit"], limits, geometry=True
        )
    datasets.write(states, outputs["states"], "states", params)
