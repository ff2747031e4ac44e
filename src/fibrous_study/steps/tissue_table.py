"""Rule `tissue_table`: every finite element run of the tissue in a row, and how far a refit moved it (section 2.5)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from fibrous.deformation import largest_principal_stretch
from fibrous_study import datasets
from fibrous_study.tissue_runs import fields_of, law_columns


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Read `tissue`, the files of the config's `runs` in their order; write `table`.

    Changes are those of the last step from the run whose deformation the constants were fitted to. Raises DatasetError.
    """
    runs = params["config"]["runs"]
    states = {entry["name"]: datasets.read(path, "tissue") for entry, path in zip(runs, inputs["tissue"], strict=True)}
    rows = [
        {**_row(entry, states[entry["name"]]), **_change(states[entry["name"]], states.get(entry["source"]))}
        for entry in runs
    ]
    datasets.write_table(pd.DataFrame(rows), outputs["table"], params, "tissue")


def _row(entry: Mapping[str, Any], state: xr.Dataset) -> dict[str, Any]:
    last = state.isel(step=-1)
    fields, determinant = fields_of(last), np.linalg.det(state["deformation_gradient"].values)
    stretch = largest_principal_stretch(last["deformation_gradient"].values).mean(axis=-1)
    return {
        "run": entry["name"],
        "specimen": state.attrs["origin"],
        **law_columns(entry),
        "elements": state.sizes["element"],
        "load_steps": state.sizes["step"],
        "newton_iterations": int(state["newton_iterations"].sum()),
        "cuts": int(state["cuts"].sum()),
        "elements_of_C2_zero": int((last["C2"].values == 0.0).sum()),
        "C2_mean_MPa": float(last["C2"].mean()),
        "C3_mean": float(last["C3"].mean()),
        "stretch_percentile_99": float(np.percentile(stretch, 99)),
        "stretch_largest": float(stretch.max()),
        "J_least": float(determinant.min()),
        "J_largest": float(determinant.max()),
        "maximum_shear_stress_rms_MPa": _rms(fields.shear_stress),
        **{f"reaction_{axis}_N": float(force) for axis, force in zip("xyz", fields.reaction, strict=True)},
    }


def _change(state: xr.Dataset, before: xr.Dataset | None) -> dict[str, float]:
    """Root mean squares and largest values over elements, or nodes, of what a refit changed; NaN where none did."""
    names = ("C2{}_MPa", "C3{}", "displacement{}_mm", "maximum_shear_stress{}_MPa")
    changes: list[np.ndarray] = [np.array([np.nan])] * len(names)
    if before is not None:
        last, first = state.isel(step=-1), before.isel(step=-1)
        moved, start = fields_of(last), fields_of(first)
        changes = [last[name].values - first[name].values for name in ("C2", "C3")]
        changes += [np.linalg.norm(moved.displacement - start.displacement, axis=-1)]
        changes += [moved.shear_stress - start.shear_stress]
    return {
        name.format(f"_change_{of}"): value
        for name, change in zip(names, changes, strict=True)
        for of, value in (("rms", _rms(change)), ("largest", float(np.abs(change).max())))
    }


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
