"""The files of the study as what its statements are judged by."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from fibrous.errors import DatasetError
from fibrous_study import datasets
from fibrous_study.audit.evidence import Constants, Costs, Evidence, Tissue
from fibrous_study.audit.verdict import ENSEMBLE, NAMED
from fibrous_study.curve_datasets import read_curves
from fibrous_study.fit_tables import ALL, SINGLE, fits_of
from fibrous_study.solutions import LAW
from fibrous_study.steps.table_2 import MULTISCALE, TASKS
from fibrous_study.tissue_runs import fields_of

SURFACES = {"C2": "C2", "C3": "C3_eight"}  # the terms that the paper prints
NETWORK_PARTS = ("equilibrium", "condensation")


def gathered(inputs: Mapping[str, list[Path]], config: Mapping[str, Any]) -> Evidence:
    """What `inputs` hold for the audit. Raises DatasetError where a file does not hold what is needed."""
    sets = [entry["name"] for entry in config["load_sets"]]
    curves = {name: read_curves(inputs[name]) for name in ("small", "large", "ensemble")}
    fits = {
        f"{group}{strain}_fits": {one: _fits(inputs[f"{group}fits_{strain}"], one, ALL) for one in sets}
        for group in ("", "ensemble_")
        for strain in ("small", "large")
    }
    known = {
        group: np.all(
            [
                *(one.known for name, one in curves.items() if _group(name) == group),
                *(one.known for name, by_set in fits.items() if _group(name) == group for one in by_set.values()),
            ],
            axis=0,
        )
        for group in (NAMED, ENSEMBLE)
    }
    networks = [datasets.read(path, "networks") for path in inputs["networks"]]
    of_case = [one.isel(network=one["name"].values == config["case"]) for one in networks]
    path = read_curves(inputs["path"])
    surface = datasets.read(inputs["surface"][0], "surface").sel(protocol=config["large"])
    return Evidence(
        config,
        tensors=np.concatenate([one["structure_tensor"].values for one in of_case]),
        fractions=np.concatenate([one["volume_fraction"].values for one in of_case]),
        path=path,
        **{name: one.of(known[_group(name)]) for name, one in curves.items()},
        **{name: {key: one.of(known[_group(name)]) for key, one in by_set.items()} for name, by_set in fits.items()},
        initial=_fits(inputs["fits_initial"], config["load_set"], ALL).called(config["case"]),
        refit=_fits(inputs["fits_refit"], SINGLE, path.loads[0]).called(config["case"]),
        surface_r_squared={
            name: {
                key: float(surface["r_squared"].sel(load_set=name, constant=which)) for key, which in SURFACES.items()
            }
            for name in sets
        },
        surface_coefficients={
            key: {name: surface["coefficient"].sel(load_set=name, constant=which).values for name in sets}
            for key, which in SURFACES.items()
        },
        tissue=_tissue(inputs["tissue"]),
        costs=_costs(inputs, config),
        left_out={group: int((~mask).sum()) for group, mask in known.items()},
    )


def _group(name: str) -> str:
    return ENSEMBLE if name.startswith("ensemble") else NAMED


def _fits(paths: list[Path], load_set: str, deformation: str) -> Constants:
    """Fits of Eq. 2 to the energies of one group of loads, table after table."""
    tables = [
        fits_of(datasets.read_table(path, "fits"), "structure_tensor", "energy", load_set, deformation)
        for path in paths
    ]
    table = pd.concat([one.sort_values("network", kind="stable") for one in tables])
    if table.empty:
        raise DatasetError(f"{paths[0]}: holds no fit to '{deformation}' of '{load_set}'; delete it and run again")
    return Constants(
        names=table["name"].to_numpy(str),
        C2=table["C2_MPa"].to_numpy(float),
        amplitude=table["lambda_f_max"].to_numpy(float),
        **{field: table[field].to_numpy(float) for field in ("H11", "H22", "H33", "C3", "r_squared")},
    )


def _tissue(paths: list[Path]) -> Tissue:
    """The runs of Fig. 9: multiscale, initial, refit."""
    states = [datasets.read(path, "tissue") for path in paths]
    multiscale, initial, refit = (fields_of(state.isel(step=-1)) for state in states)
    gradient = states[0]["deformation_gradient"].values[-1]
    return Tissue(states[0].attrs["origin"], multiscale, initial, refit, gradient)


def _costs(inputs: Mapping[str, list[Path]], config: Mapping[str, Any]) -> Costs:
    reference = inputs["tissue"][0].stem
    table = datasets.read_table(inputs["table_2"][0], "table_2")
    table = table[(table["method"] == "hybrid") | (table["runs"] == reference)].set_index(["method", "task"])
    hours = table["cpu_hours"]
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
        runs=int(table["processes"]["hybrid", TASKS["hybrid"]]),
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
