"""Rule `comparison`: how far every run of the tissue is from the coupled multiscale simulation (section 3.4)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pandas as pd
import xarray as xr

from fibrous.comparison import Comparison
from fibrous_study import datasets
from fibrous_study.tissue_runs import fields_of, read_run


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Read `tissue`, the files of the config's `runs` in their order, and write `comparison` and `steps`.

    Errors are those from the run that the config calls `reference`, which has no row. A run with another number of
    load steps meets it at the last one alone. Raises DatasetError where a run is not one of the reference's mesh.
    """
    config = params["config"]
    entries = {entry["name"]: (entry, path) for entry, path in zip(config["runs"], inputs["tissue"], strict=True)}
    reference = datasets.read(entries.pop(config["reference"])[1], "tissue")
    last, grown = [], []
    for entry, path in entries.values():
        state = read_run(path, reference, "reference")
        rows = [{"step": step, **_errors(comparison)} for step, comparison in _comparisons(state, reference)]
        about = {"run": entry["name"], "specimen": state.attrs["origin"]}
        grown += [
            {**about, **{name: row[name] for name in row if name == "step" or "relative" in name}} for row in rows
        ]
        end = {name: value for name, value in rows[-1].items() if name != "step"}
        last.append({**_about(entry, state), **end, "cpu_seconds": state.attrs["cpu_seconds"]})
    datasets.write_table(pd.DataFrame(last), outputs["comparison"], params)
    datasets.write_table(pd.DataFrame(grown), outputs["steps"], params)


def _comparisons(state: xr.Dataset, reference: xr.Dataset) -> Iterator[tuple[int, Comparison]]:
    """The reference's step and the comparison there, at the last step or at every one."""
    same = state.sizes["step"] == reference.sizes["step"]
    for index in range(reference.sizes["step"]) if same else [-1]:
        step = int(reference["step"].values[index])
        yield step, Comparison.of(*(fields_of(one.isel(step=index)) for one in (state, reference)))


def _about(entry: Mapping[str, Any], state: xr.Dataset) -> dict[str, Any]:
    model = entry["model"]
    return {
        "run": entry["name"],
        "specimen": state.attrs["origin"],
        "model": model["name"],
        "law": model["law"],
        "constants": model.get("constants", ""),
        "energy": model.get("energy", ""),
        "objective": model.get("objective", ""),
        "refits": entry["refits"],
        "load_steps": state.sizes["step"],
    }


def _errors(comparison: Comparison) -> dict[str, float]:
    found: dict[str, float] = {}
    for name, unit in (("shear_stress", "_MPa"), ("shear_strain", "")):
        deviation = getattr(comparison, name)
        found |= {
            f"{name}_rms_error{unit}": deviation.rms_error,
            f"{name}_relative_rms_error": deviation.relative_rms_error,
            f"{name}_largest_error{unit}": deviation.largest_error,
        }
    return {
        **found,
        "cauchy_stress_rms_error_MPa": comparison.cauchy_stress.rms_error,
        "cauchy_stress_relative_rms_error": comparison.cauchy_stress.relative_rms_error,
        "displacement_rms_error_mm": comparison.displacement.rms_error,
        "reaction_error_N": comparison.reaction.rms_error,
        "reaction_relative_error": comparison.reaction.relative_rms_error,
        "shear_stress_peak_overlap": comparison.shear_stress_overlap,
        "shear_strain_peak_overlap": comparison.shear_strain_overlap,
    }
