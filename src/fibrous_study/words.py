"""What figures and pages call things that the config calls otherwise."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

FORMS = {"structure_tensor": "Eq. 2", "families": "Eq. 10C"}
# What was fitted: section 2.5 may fit a slope in place of an energy.
FITTED = {"energy": "fitted", "slope": "fitted", "stress": "fitted to stress"}
WITHOUT_CONSTANTS = {
    "matrix": "matrix alone",
    "affine": "affine fibres, nothing fitted",
    "network": "a network at every Gauss point",
}


def law_label(model: Mapping[Any, Any]) -> str:
    """What a law is and where its constants come from, by `law`, `constants`, `energy` and `objective` of its table.

    >>> law_label({"law": "families", "constants": "fit", "energy": "structure_tensor", "objective": "energy"})
    'Eq. 2 fitted, Eq. 10C run'
    """
    if model["law"] in WITHOUT_CONSTANTS:
        return WITHOUT_CONSTANTS[model["law"]]
    if model["constants"] == "surface":
        return f"surface of Eq. 11, {FORMS[model['law']]} run"
    fitted = f"{FORMS[model['energy']]} {FITTED[model['objective']]}"
    if model["law"] != model["energy"]:
        return f"{fitted}, {FORMS[model['law']]} run"
    return fitted if model["objective"] == "stress" else f"{fitted} and run"
