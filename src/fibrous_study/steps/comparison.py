"""Rule `comparison`: how far every run of the tissue is from the coupled multiscale simulation (section 3.4)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pandas as pd
import xarray as xr

from fibrous.comparison import Comparison
from fibrous_study import datasets
from fibrous_study.tissue_runs import fields_of, law_columns, read_run


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Read `tissue`, the files of the config's `runs` in their order, and write `comparison` and `steps`.

    Errors are those from the run that the config calls `reference`, which has no row. A run with another number of
    load steps meets it at the last one alone. Raises DatasetError where a run is not one of the reference's mesh.
    """
    config = params["config"]
    entries = {entry["name"]: (entry, path) for entry, path in zip(config["runs"], inputs["tissue"], strict=True)}
    reference = datasets.read(entries.pop(config["reference"])[1], "tissue")
    last, steps = [], []
    for entry, path in entries.values():
        run = read_run(path, reference, "reference")
        about = {"run": entry["name"], "specimen": run.attrs["origin"]}
        for step, errors in _errors_of_steps(run, reference):
            relative = {name: error for name, error in errors.items() if "relative" in name}
            steps.append({**about, "step": step, **relative})
        law = {"model": entry["model"]["name"], **law_columns(entry), "load_steps": run.sizes["step"]}
        last.append({**about, **law, **errors, "cpu_seconds": run.attrs["cpu_seconds"]})
    datasets.write_table(pd.DataFrame(last), outputs["comparison"], params, "comparison")
    datasets.write_table(pd.DataFrame(steps), outputs["steps"], params, "comparison_steps")


def _errors_of_steps(run: xr.Dataset, reference: xr.Dataset) -> Iterator[tuple[int, dict[str, float]]]:
    """The reference's step and the errors there, at the last step or at every one."""
    same = run.sizes["step"] == reference.sizes["step"]
    for index in range(reference.sizes["step"]) if same else [-1]:
        fields, of_reference = (fields_of(state.isel(step=index)) for state in (run, reference))
        yield int(reference["step"].values[index]), _errors(Comparison.of(fields, of_reference))


def _errors(comparison: Comparison) -> dict[str, float]:
    """Columns of both tables."""
    shear = {
        f"{name}_{error}{'' if error.startswith('relative') else unit}": getattr(getattr(comparison, name), error)
        for name, unit in (("shear_stress", "_MPa"), ("shear_strain", ""))
        for error in ("rms_error", "relative_rms_error", "largest_error")
    }
    return {
        **shear,
        "cauchy_stress_rms_error_MPa": comparison.cauchy_stress.rms_error,
        "cauchy_stress_relative_rms_error": comparison.cauchy_stress.relative_rms_error,
        "displacement_rms_error_mm": comparison.displacement.rms_error,
        "reaction_error_N": comparison.reaction.rms_error,
        "reaction_relative_error": comparison.reaction.relative_rms_error,
        "shear_stress_peak_overlap": comparison.shear_stress_overlap,
        "shear_strain_peak_overlap": comparison.shear_strain_overlap,
    }
