"""Rule `table_2`: CPU-hours of the hybrid method and of the multiscale run, beside Table 2."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from fibrous_study import datasets
from fibrous_study.fit_tables import SINGLE
from fibrous_study.steps.hgo_fits import fits_key

TASKS = {
    "initial": "initial simulation of the elements' networks under the loads of one load set, and fit of one law",
    "refit": "simulation of the networks along their elements' deformation, and fit of one law",
    "hybrid": "finite elements, initial and refit",
}
BEYOND = "fits of other laws and to single loads (beyond the method)"
MAKING = "making the elements' networks (not in the paper's table)"
MULTISCALE = "finite elements with networks"
FITS = "cpu_seconds_of_fits"
IN_THE_RUN = " (inside the finite element run)"
REST = "the rest"


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Sum up what the processes that wrote the inputs counted of themselves; write `table_2` and `parts`.

    The inputs are `networks`, `initial`, `refit`, `hybrid` and `multiscale`. The config names the `reference` run, the
    `model` whose fits count with its `load_set`, and the `loads_used`, the fraction of the initial loads that belong to
    that set; `paper` is Table 2 as printed. The job that drives the networks as all refitted runs went counts whole: in
    lanes of its own each, the one run that the method needs costs as much. Raises DatasetError for an unreadable file.
    """
    config = params["config"]
    printed = config["paper"]
    found = {name: [datasets.provenance_of(path) for path in paths] for name, paths in inputs.items()}
    hours = {name: sum(float(one["cpu_seconds"]) for one in files) / 3600.0 for name, files in found.items()}
    wanted = {name: fits_key(config["model"], group) for name, group in _groups(config).items()}
    curves = sum(float(one["cpu_seconds"]) for one in found["initial"] if FITS not in one)
    beyond = {
        "initial": (1.0 - config["loads_used"]) * curves
        + sum(_others(one, wanted["initial"]) for one in found["initial"]),
        "refit": sum(_others(one, wanted["refit"]) for one in found["refit"]),
    }
    for name, seconds in beyond.items():
        hours[name] -= seconds / 3600.0
    specimen, runs = found["hybrid"][0]["origin"], ", ".join(path.stem for path in inputs["hybrid"])
    hybrid = sum(hours[name] for name in TASKS)
    rows = [_row("both", "", MAKING, np.nan, hours["networks"], found["networks"])]
    for name, task in TASKS.items():
        # With lagged constants there are no files of refits: the run has fitted by itself.
        task, spent = (task, hours[name]) if found[name] else (f"{task}{IN_THE_RUN}", np.nan)
        rows.append(_row("hybrid", runs, task, printed[name] if found["refit"] else np.nan, spent, found[name]))
    every = [one for name in TASKS for one in found[name]]
    rows.append(_row("hybrid", runs, "total", printed["hybrid_total"], hybrid, every))
    rows.append(_row("beyond", runs, BEYOND, np.nan, sum(beyond.values()) / 3600.0, found["initial"] + found["refit"]))
    for path, one in zip(inputs["multiscale"], found["multiscale"], strict=True):
        # What the paper ran, all load steps, is the reference alone.
        paper = printed["multiscale"] if path.stem == config["reference"] else np.nan
        spent = one["cpu_seconds"] / 3600.0
        row = _row("multiscale", path.stem, MULTISCALE, paper, spent, [one])
        rows.append({**row, "times_hybrid": spent / hybrid, "times_hybrid_paper": paper / printed["hybrid_total"]})
    table = pd.DataFrame(rows)
    table.insert(0, "specimen", specimen)
    parts = pd.DataFrame(_parts(inputs["multiscale"], found["multiscale"]))
    parts.insert(0, "specimen", specimen)
    datasets.write_table(table, outputs["table_2"], params, "table_2")
    datasets.write_table(parts, outputs["parts"], params, "table_2_parts")


def _groups(config: Mapping[str, Any]) -> dict[str, str]:
    """Load sets of the fits that count."""
    return {"initial": config["load_set"], "refit": SINGLE}


def _others(one: Mapping[str, Any], wanted: str) -> float:
    """CPU seconds of the fits of a table that are not the ones `wanted`."""
    return sum(seconds for key, seconds in json.loads(one.get(FITS, "{}")).items() if key != wanted)


def _row(method: str, runs: str, task: str, paper: float, hours: float, files: list[dict[str, Any]]) -> dict[str, Any]:
    versions = {json.dumps(json.loads(one["versions"])) for one in files}
    return {
        "method": method,
        "runs": runs,
        "task": task,
        "paper_cpu_hours": paper,
        "cpu_hours": hours,
        "paper_over_ours": paper / hours,
        "times_hybrid": np.nan,
        "times_hybrid_paper": np.nan,
        "processes": len(files),
        "largest_peak_memory_MB": max((one["peak_memory_MB"] for one in files), default=np.nan),
        "machine": "; ".join(sorted({str(one["machine"]) for one in files})),
        "versions": "; ".join(sorted(versions)),
    }


def _parts(paths: list[Path], files: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Where the time of each multiscale run goes."""
    rows = []
    for path, one in zip(paths, files, strict=True):
        parts = json.loads(one["cpu_seconds_of_parts"])
        parts[REST] = one["cpu_seconds"] - sum(parts.values())
        rows += [
            {"run": path.stem, "part": part, "cpu_seconds": seconds, "share": seconds / one["cpu_seconds"]}
            for part, seconds in parts.items()
        ]
    return rows
