"""Rule `tissue_table`: every finite element run of the tissue in a row, and how far a refit moved it (section 2.5)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from fibrous.deformation import element_shear, largest_principal_stretch
from fibrous.specimen import MOVED
from fibrous_study import datasets


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
    datasets.write_table(pd.DataFrame(rows), outputs["table"], params)


def _row(entry: Mapping[str, Any], state: xr.Dataset) -> dict[str, Any]:
    model = entry["model"]
    gradient, last = state["deformation_gradient"].values, state.isel(step=-1)
    determinant = np.linalg.det(gradient)
    reaction = last["reaction_force"].sel(enthesis=MOVED).values
    return {
        "run": entry["name"],
        "specimen": state.attrs["origin"],
        "law": model["law"],
        "constants": model.get("constants", ""),
        "energy": model.get("energy", ""),
        "objective": model.get("objective", ""),
        "refits": entry["refits"],
        "elements": state.sizes["element"],
        "load_steps": state.sizes["step"],
        "newton_iterations": int(state["newton_iterations"].sum()),
        "cuts": int(state["cuts"].sum()),
        "elements_of_C2_zero": int((last["C2"].values == 0.0).sum()),
        "C2_mean_MPa": float(last["C2"].mean()),
        "C3_mean": float(last["C3"].mean()),
        "stretch_percentile_99": float(np.percentile(_stretch(gradient[-1]), 99)),
        "stretch_largest": float(_stretch(gradient[-1]).max()),
        "J_least": float(determinant.min()),
        "J_largest": float(determinant.max()),
        "maximum_shear_stress_rms_MPa": _rms(_shear(state)),
        **{f"reaction_{axis}_N": float(value) for axis, value in zip("xyz", reaction, strict=True)},
    }


def _change(state: xr.Dataset, before: xr.Dataset | None) -> dict[str, float]:
    """Root mean squares and largest values over elements, or nodes, of what a refit changed."""
    names = ("C2", "C3", "displacement", "maximum_shear_stress")
    units = ("_MPa", "", "_mm", "_MPa")
    changes: list[np.ndarray] = [np.array([np.nan])] * len(names)
    if before is not None:
        last, first = state.isel(step=-1), before.isel(step=-1)
        changes = [last[name].values - first[name].values for name in ("C2", "C3")]
        moved = np.linalg.norm(last["displacement"].values - first["displacement"].values, axis=-1)
        changes += [moved, _shear(state) - _shear(before)]
    return {
        f"{name}_change_{what}{unit}": value
        for name, unit, change in zip(names, units, changes, strict=True)
        for what, value in (("rms", _rms(change)), ("largest", float(np.abs(change).max())))
    }


def _stretch(gradient: np.ndarray) -> np.ndarray:
    """Largest principal stretch, mean over the Gauss points of each element."""
    return largest_principal_stretch(gradient).mean(axis=-1)


def _shear(state: xr.Dataset) -> np.ndarray:
    """Maximum shear stress at the last step, mean over the Gauss points of each element."""
    return element_shear(state["cauchy_stress"].values[-1])


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
