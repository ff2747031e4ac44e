"""What figures and pages call the laws that the config names."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

LAWS = {
    "structure_tensor": "Eq. 2",
    "families": "Eq. 10C",
    "matrix": "matrix alone",
    "affine": "affine fibres, nothing fitted",
    "network": "a network at every Gauss point",
}


def law_label(model: Mapping[Any, Any]) -> str:
    """What a law is and where its constants come from, by `law`, `constants`, `energy` and `objective` of its table.

    >>> law_label({"law": "families", "constants": "fit", "energy": "structure_tensor", "objective": "energy"})
    'Eq. 2 fitted, Eq. 10C run'
    """
    law, fitted = LAWS[model["law"]], "fitted"
    if not model["constants"]:
        return law
    if model["constants"] == "surface":
        return f"surface of Eq. 11, {law} run"
    if model["objective"] == "stress":
        fitted += " to stress"
    if model["law"] != model["energy"]:
        return f"{LAWS[model['energy']]} {fitted}, {law} run"
    return f"{law} {fitted}" if model["objective"] == "stress" else f"{law} {fitted} and run"
