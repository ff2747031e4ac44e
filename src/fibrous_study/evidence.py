"""The files of the study as what its statements are judged by."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from fibrous.curves import Curves
from fibrous.errors import DatasetError
from fibrous_study import datasets
from fibrous_study.audit.costs import Costs
from fibrous_study.audit.evidence import Constants
from fibrous_study.audit.finding import Thresholds
from fibrous_study.audit.laws import INITIAL, REFIT
from fibrous_study.audit.statements import Evidence
from fibrous_study.audit.tissue import Tissue
from fibrous_study.curve_datasets import read_curves
from fibrous_study.fit_tables import ALL, SINGLE, fits_of
from fibrous_study.solutions import LAW
from fibrous_study.steps.comparison import fields_of
from fibrous_study.steps.table_2 import MULTISCALE, TASKS

FIT_COLUMNS = (
    "network", "name", "load_set", "deformation", "energy", "objective", "H11", "H22", "H33", "lambda_f_max", "C2_MPa",
    "C3", "r_squared",
)  # fmt: skip
SURFACES = {"C2": "C2", "C3": "C3_eight"}  # the terms that the paper prints
NETWORK_PARTS = ("equilibrium", "condensation")


def gathered(inputs: Mapping[str, list[Path]], config: Mapping[str, Any]) -> Evidence:
    """What `inputs` hold for the audit. Raises DatasetError where a file does not hold what is needed."""
    sets = {entry["name"]: spoken(entry["name"]) for entry in config["load_sets"]}
    networks = [datasets.read(path, "networks") for path in inputs["networks"]]
    of_case = [one.isel(network=one["name"].values == config["case"]) for one in networks]
    fits = {
        name: {words: _fits(inputs[name], load_set, ALL) for load_set, words in sets.items()}
        for name in ("fits_small", "fits_large", "ensemble_fits_small", "ensemble_fits_large")
    }
    curves = {name: read_curves(inputs[name]) for name in ("small", "large", "ensemble")}
    path = read_curves(inputs["path"])
    known = _nothing_missing(curves, fits)
    curves = {name: one.of(known[name]) for name, one in curves.items()}
    fits = {name: {words: one.of(known[name]) for words, one in by_set.items()} for name, by_set in fits.items()}
    surface = datasets.read(inputs["surface"][0], "surface").sel(protocol=config["large"])
    return Evidence(
        thresholds=Thresholds(**config["claims"]),
        load_sets={sets[entry["name"]]: tuple(entry["loads"]) for entry in config["load_sets"]},
        largest_C3=config["fit"]["largest_C3"],
        tension_only=config["tension_only"],
        case=config["case"],
        survey=tuple(config["survey"]),
        asked={entry["name"]: _tensor(entry) for entry in config["named"]},
        tensors=np.concatenate([one["structure_tensor"].values for one in of_case]),
        fractions=np.concatenate([one["volume_fraction"].values for one in of_case]),
        small=curves["small"],
        large=curves["large"],
        path=path,
        small_fits=fits["fits_small"],
        large_fits=fits["fits_large"],
        case_fits={
            INITIAL: _fits(inputs["fits_initial"], config["load_set"], ALL).called(config["case"]),
            REFIT: _fits(inputs["fits_refit"], SINGLE, path.loads[0]).called(config["case"]),
        },
        ensemble=curves["ensemble"],
        ensemble_small_fits=fits["ensemble_fits_small"],
        ensemble_large_fits=fits["ensemble_fits_large"],
        surface_r_squared={
            words: tuple(surface["r_squared"].sel(load_set=name, constant=[*SURFACES.values()]).values.tolist())
            for name, words in sets.items()
        },
        surface_coefficients={
            constant: {
                words: surface["coefficient"].sel(load_set=name, constant=which).values for name, words in sets.items()
            }
            for constant, which in SURFACES.items()
        },
        tissue=_tissue(inputs["tissue"]),
        costs=_costs(inputs, config),
        left_out={name: int((~one).sum()) for name, one in known.items()},
    )


def _nothing_missing(
    curves: Mapping[str, Curves], fits: Mapping[str, Mapping[str, Constants]]
) -> dict[str, np.ndarray[Any, np.dtype[np.bool_]]]:
    """Which networks lack nothing in any of the curves and fits, of the ensemble or of the others, by their names."""
    found = {name: [one.known] for name, one in curves.items()}
    found |= {name: [one.known for one in by_set.values()] for name, by_set in fits.items()}
    of_ensemble, of_others = (
        np.all([mask for name, masks in found.items() if name.startswith("ensemble") == kind for mask in masks], axis=0)
        for kind in (True, False)
    )
    return {name: of_ensemble if name.startswith("ensemble") else of_others for name in found}


def spoken(load_set: str) -> str:
    """The name of a load set as the audit's sentences say it.

    >>> spoken("section_3_1"), spoken("my_loads")
    ("section 3.1's loads", 'my loads')
    """
    words = load_set.split("_")
    return f"section {'.'.join(words[1:])}'s loads" if words[0] == "section" else " ".join(words)


def _fits(paths: list[Path], load_set: str, deformation: str) -> Constants:
    """Fits of Eq. 2 to the energies of one group of loads, table after table."""
    tables = [
        fits_of(datasets.read_table(path, FIT_COLUMNS), "structure_tensor", "energy", load_set, deformation)
        for path in paths
    ]
    table = pd.concat([one.sort_values("network", kind="stable") for one in tables])
    if table.empty:
        raise DatasetError(f"{paths[0]}: holds no fit to '{deformation}' of '{load_set}'; delete it and run again")
    return Constants(
        names=table["name"].astype(object).fillna("").to_numpy(str),
        C2=table["C2_MPa"].to_numpy(float),
        amplitude=table["lambda_f_max"].to_numpy(float),
        **{field: table[field].to_numpy(float) for field in ("H11", "H22", "H33", "C3", "r_squared")},
    )


def _tensor(entry: Mapping[str, Any]) -> np.ndarray:
    """H asked of a named network."""
    return np.diag([entry["H11"], entry["H22"], 1.0 - entry["H11"] - entry["H22"]])


def _tissue(paths: list[Path]) -> Tissue:
    """The runs of Fig. 9: multiscale, initial, refit."""
    states = [datasets.read(path, "tissue") for path in paths]
    multiscale, initial, refit = (fields_of(state.isel(step=-1)) for state in states)
    gradient = states[0]["deformation_gradient"].values[-1]
    return Tissue(states[0].attrs["origin"], multiscale, initial, refit, gradient)


def _costs(inputs: Mapping[str, list[Path]], config: Mapping[str, Any]) -> Costs:
    reference = inputs["tissue"][0].stem
    columns = ("method", "runs", "task", "cpu_hours", "processes")
    table = datasets.read_table(inputs["table_2"][0], columns)
    rows = list(zip(*(table[column] for column in columns), strict=True))
    hours = {(method, task): spent for method, runs, task, spent, _ in rows if method == "hybrid" or runs == reference}
    runs = next(int(processes) for *_, task, _, processes in rows if task == TASKS["hybrid"])
    multiscale, _, refit = (datasets.read(path, "tissue") for path in inputs["tissue"])
    networks = [datasets.read(path, "networks") for path in inputs["tissue_networks"]]
    of_networks, of_law = (json.loads(run.attrs["cpu_seconds_of_parts"]) for run in (multiscale, refit))
    return Costs(
        initial=hours["hybrid", TASKS["initial"]],
        refit=hours["hybrid", TASKS["refit"]],
        finite_elements=hours["hybrid", TASKS["hybrid"]],
        multiscale=hours["multiscale", MULTISCALE],
        networks=multiscale.sizes["element"],
        loads=next(len(entry["loads"]) for entry in config["load_sets"] if entry["name"] == config["load_set"]),
        steps=config["protocol"]["steps"],
        load_steps=multiscale.sizes["step"],
        runs=runs,
        fibers=float(np.median(np.concatenate([one["fiber_count"].values for one in networks]))),
        nodes=float(np.median(np.concatenate([_interior_nodes(one) for one in networks]))),
        evaluations=_evaluations(refit),
        network_evaluations=_evaluations(multiscale),
        law_seconds=of_law[LAW],
        networks_seconds=sum(of_networks[part] for part in NETWORK_PARTS),
        hybrid_seconds=refit.attrs["cpu_seconds"],
        multiscale_seconds=multiscale.attrs["cpu_seconds"],
        origin=multiscale.attrs["origin"],
    )


def _evaluations(run: xr.Dataset) -> int:
    """Gauss points times Newton iterations of all steps."""
    return run.sizes["element"] * run.sizes["gauss_point"] * int(run["newton_iterations"].sum())


def _interior_nodes(networks: xr.Dataset) -> np.ndarray:
    """Nodes of each network that no face moves, shape (networks,)."""
    ends = np.cumsum(networks["node_count"].values)
    inside = np.concatenate([[0], np.cumsum(~networks["node_is_boundary"].values)])
    return np.asarray(inside[ends] - inside[ends - networks["node_count"].values])
