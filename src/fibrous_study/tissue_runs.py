"""Finite element runs of the tissue as tables, audit and figures read them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import xarray as xr

from fibrous.comparison import Fields
from fibrous.errors import DatasetError
from fibrous.specimen import MOVED
from fibrous_study import datasets


def read_run(path: Path, other: xr.Dataset, other_name: str) -> xr.Dataset:
    """A run on the mesh of `other`, which is called `other_name`. Raises DatasetError where the mesh is another one."""
    run = datasets.read(path, "tissue")
    for name in ("node", "element"):
        if run.sizes[name] != other.sizes[name]:
            raise DatasetError(
                f"{path}: has {run.sizes[name]} {name}s where the {other_name} has {other.sizes[name]}; "
                "delete both and run again"
            )
    return run


def law_columns(entry: Mapping[str, Any]) -> dict[str, Any]:
    """What tables say of the law of a run, by its entry in the config."""
    model = entry["model"]
    return {
        "law": model["law"],
        **{name: model.get(name, "") for name in ("constants", "energy", "objective")},
        "refits": entry["refits"],
    }


def fields_of(state: xr.Dataset) -> Fields:
    """The fields of a run at one of its load steps."""
    reaction = state["reaction_force"].sel(enthesis=MOVED).values
    return Fields.of(
        state["deformation_gradient"].values, state["cauchy_stress"].values, state["displacement"].values, reaction
    )
