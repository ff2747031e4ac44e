"""Rule `hgo_fits`: (C2, C3) of every network of an ensemble.

Under one protocol, for each load set and each load alone.

A form is a law and what of it is fitted, `{"energy": …, "objective": …}` (see fibrous.fitting.hgo.fit_hgo).
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from fibrous.curves import Curves
from fibrous.errors import ConfigError, DatasetError
from fibrous.fitting.hgo import HGOFit, fit_hgo
from fibrous.materials.registry import law_called
from fibrous_study import datasets
from fibrous_study.curve_datasets import read_curves
from fibrous_study.fit_tables import ALL, SINGLE, TENSOR_COLUMNS


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Read `curves` (all batches), write `fits`.

    The config holds `forms`, `tension_only`, `fit`, `load_sets` and the name of the `protocol`. One row a network, form
    and load set (deformation `all`) or load (load set `single`), sorted by network, then as in the config. States
    without an equilibrium are left out and named on stderr. CPU seconds of the fits of each form and load set stand
    beside the table as `cpu_seconds_of_fits`.
    Raises DatasetError where the batches do not belong together, ConfigError where a load set asks for a load that
    the protocol did not run.
    """
    config = params["config"]
    curves = read_curves(inputs["curves"])
    groups = _groups(config["load_sets"], curves.loads, config["protocol"])
    options = {"tension_only": config["tension_only"], **config["fit"]}
    seconds: dict[str, float] = {}
    rows = [
        row
        for index in range(len(curves.names))
        for row in _rows(curves.network(index), config["forms"], groups, options, seconds)
    ]
    table = pd.DataFrame(rows).sort_values("network", kind="stable", ignore_index=True)
    _refuse_duplicates(table, inputs["curves"])
    measured = {"cpu_seconds_of_fits": json.dumps(seconds)}
    datasets.write_table(table, outputs["fits"], {**params, "measured": measured}, "fits")


def fits_key(form: Mapping[str, Any], load_set: str) -> str:
    """What the CPU seconds of the fits of a form to a load set are called."""
    return f"{form['energy']} to {form['objective']}, {load_set}"


def _groups(load_sets: list[dict[str, Any]], loads: tuple[str, ...], protocol: str) -> list[tuple[str, str, list[str]]]:
    """(load_set, deformation, loads) of every fit, in the order of the table."""
    groups = []
    for load_set in load_sets:
        for load in load_set["loads"]:
            if load not in loads:
                raise ConfigError(
                    f"load_sets: '{load_set['name']}' asks for {load}, which protocol '{protocol}' does not run: "
                    "add it to the protocol's loads"
                )
        groups.append((load_set["name"], ALL, load_set["loads"]))
    return groups + [(SINGLE, load, [load]) for load in loads]


def _rows(
    network: Curves,
    forms: list[dict[str, Any]],
    groups: list[tuple[str, str, list[str]]],
    options: Mapping[str, Any],
    seconds: dict[str, float],
) -> list[dict[str, Any]]:
    """The table's rows of one network; adds to the CPU `seconds` of each form and load set."""
    number, name = int(network.numbers[0]), str(network.names[0])
    for _, load, step in np.argwhere(~network.converged):
        state = f"network {number}{f' ({name})' if name else ''}, {network.loads[load]}, step {step}"
        print(f"{state}: no equilibrium was found; the state is left out of the fits", file=sys.stderr)
    curves = [network.under(loads) for _, _, loads in groups]
    alignment = {column: float(network.structure_tensor[0][index]) for column, index in TENSOR_COLUMNS.items()}
    rows = []
    for form in forms:
        law = law_called(form["energy"]).material
        for (load_set, deformation, _), curve in zip(groups, curves, strict=True):
            start = time.process_time()
            fit = fit_hgo(curve, law, form["objective"], **options)
            key = fits_key(form, load_set)
            seconds[key] = seconds.get(key, 0.0) + time.process_time() - start
            about = {"network": number, "load_set": load_set, "deformation": deformation, "energy": form["energy"]}
            rows.append({**about, **_columns(fit, alignment), "name": name})
    return rows


def _columns(fit: HGOFit, alignment: Mapping[str, float]) -> dict[str, Any]:
    return {
        "objective": fit.objective,
        **alignment,
        "lambda_f_max": fit.largest_stretch,
        "C2_MPa": fit.C2,
        "C3": fit.C3,
        "C2_half_width_MPa": fit.C2_half_width,
        "C3_half_width": fit.C3_half_width,
        "r_squared": fit.r_squared,
        "rule": fit.rule,
        "identifiable": fit.identifiable,
        "points_used": fit.points_used,
        "points_dropped": fit.points_dropped,
    }


def _refuse_duplicates(table: pd.DataFrame, paths: list[Path]) -> None:
    repeated = table["network"][table.duplicated(["network", "energy", "objective", "load_set", "deformation"])]
    if len(repeated):
        folder = paths[0].parent
        raise DatasetError(f"{folder}: two batches hold network {repeated.iloc[0]}; delete the curves and run again")
