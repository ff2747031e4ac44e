"""What figures and pages call a law and where its constants come from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fibrous.materials.registry import LAWS

# What was fitted: section 2.5 may fit a slope in place of an energy.
FITTED = {"energy": "fitted", "slope": "fitted", "stress": "fitted to stress"}


def law_label(model: Mapping[Any, Any]) -> str:
    """What a law is and where its constants come from, by `law`, `constants`, `energy` and `objective` of its table.

    >>> law_label({"law": "families", "constants": "fit", "energy": "structure_tensor", "objective": "energy"})
    'Eq. 2 fitted, Eq. 10C run'
    """
    law = LAWS[model["law"]]
    if not law.has_constants:
        return law.label
    if model["constants"] == "surface":
        return f"surface of Eq. 11, {law.label} run"
    fitted = f"{LAWS[model['energy']].label} {FITTED[model['objective']]}"
    if model["law"] != model["energy"]:
        return f"{fitted}, {law.label} run"
    return fitted if model["objective"] == "stress" else f"{fitted} and run"
