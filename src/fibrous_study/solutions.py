"""What the rules that run finite elements share: the specimen from its file, fibre laws, and what they write."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from fibrous.clock import Clock
from fibrous.errors import ConvergenceError, DatasetError
from fibrous.fe.mesh import Mesh
from fibrous.fe.solver import Attempt, LoadStepError
from fibrous.materials.contract import Material
from fibrous.materials.neo_hookean import NeoHookean
from fibrous.materials.registry import law_called
from fibrous.materials.timed import Timed
from fibrous.specimen import FIXED, MOVED, Specimen
from fibrous.tissue import Solution
from fibrous_study import datasets
from fibrous_study.fit_tables import ALL, LOAD, SINGLE, fits_of, structure_tensors

NETWORK_COUNTS = ("network_iterations", "network_cuts", "indefinite_hessians")
LAW = "fibre law"  # part of the CPU time of a run: stress and tangent of its fibres


@dataclass(frozen=True)
class Constants:
    """Of each element: C2, MPa, and C3, shape (elements,), NaN in laws without them, and H, shape (elements, 3, 3)."""

    C2: np.ndarray
    C3: np.ndarray
    structure_tensor: np.ndarray


def read_specimen(path: Path) -> tuple[Specimen, np.ndarray]:
    """The specimen of a file, and the number of each element's network. Raises DatasetError or MeshError."""
    dataset = datasets.read(path, "specimen")
    specimen = Specimen(
        Mesh(dataset["node_position"].values, dataset["element_nodes"].values),
        dataset["fiber_direction"].values,
        dataset["structure_tensor"].values,
        dataset["enthesis"].values,
        dataset["prescribed_displacement"].values,
        str(dataset.attrs.get("origin", "")),
    )
    return specimen, dataset["element_network"].values


def fitted_constants(path: Path, networks: np.ndarray, model: Mapping[str, Any], load_set: str | None) -> Constants:
    """Constants of the elements' networks from a table of fits: of a load set, or of the only load where it is None.

    Raises DatasetError where a network has none.
    """
    table = datasets.read_table(path, "fits")
    group = (SINGLE, LOAD) if load_set is None else (load_set, ALL)
    table = fits_of(table, model["energy"], model["objective"], *group).set_index("network")
    missing = np.setdiff1d(networks, table.index[table[["C2_MPa", "C3"]].notna().all(axis=1)])
    if missing.size or not table.index.is_unique:
        number = missing[0] if missing.size else table.index[table.index.duplicated()][0]
        how_many = "no" if missing.size else "more than one"
        raise DatasetError(
            f"{path}: has {how_many} fit of {model['energy']} to {model['objective']} for network {number}; "
            "see results/tables/convergence.csv, or delete the table and run again"
        )
    table = table.loc[networks]
    return Constants(table["C2_MPa"].to_numpy(float), table["C3"].to_numpy(float), structure_tensors(table))


def tissue_material(
    config: Mapping[str, Any], constants: Constants, clock: Clock, fibers: Material | None = None
) -> Material:
    """The matrix of the config with its law's fibres (Eq. 10A), or with those given; `clock` counts these as LAW.

    Raises MaterialError for a law that is unknown, or for its constants.
    """
    law, matrix = config["model"]["law"], matrix_of(config)
    if law == "matrix":
        return matrix
    if fibers is None:
        fibers = fibers_of(law, constants, config["tension_only"])
    return matrix + Timed(fibers, clock, LAW)


def matrix_of(config: Mapping[str, Any]) -> NeoHookean:
    """The matrix of the config."""
    return NeoHookean(config["matrix"]["C1_MPa"], config["matrix"]["lame_lambda_MPa"])


def fibers_of(law: str, constants: Constants, tension_only: bool) -> Material:
    """The law of that name with one value per element, the same at its Gauss points."""
    C2, C3, tensor = constants.C2[:, None], constants.C3[:, None], constants.structure_tensor[:, None]
    return law_called(law).material.of_structure_tensor(tensor, C2, C3, tension_only)


def tissue_dataset(
    solution: Solution,
    C2: np.ndarray,
    C3: np.ndarray,
    tensor: np.ndarray,
    matrix: Mapping[str, float],
    clock: Clock,
    network_counts: Mapping[str, np.ndarray] | None = None,
) -> xr.Dataset:
    """A dataset of the kind `tissue`; C2 and C3 have shape (steps, elements), H shape (elements, 3, 3).

    `clock` holds what the parts of the run cost; `network_counts` are what networks spent at each step, by the names of
    the variables, shape (steps,).
    """
    arrays = {
        "displacement": solution.displacement,
        "deformation_gradient": solution.deformation_gradient,
        "cauchy_stress": solution.cauchy,
        "reaction_force": solution.reaction,
        "newton_iterations": solution.newton_iterations,
        "cuts": solution.cuts,
        "converged": solution.converged,
        **(network_counts or dict.fromkeys(NETWORK_COUNTS, np.zeros(len(solution.converged), dtype=np.int64))),
        "structure_tensor": tensor,
        "C2": C2,
        "C3": C3,
    }
    coords = {"step": np.arange(1, len(solution.converged) + 1), "enthesis": np.array([FIXED, MOVED])}
    dataset = datasets.packed(arrays, "tissue", coords)
    dataset.attrs.update(
        origin=solution.specimen.origin,
        C1_MPa=matrix["C1_MPa"],
        lame_lambda_MPa=matrix["lame_lambda_MPa"],
        linear_solvers=json.dumps(dict(solution.linear_solvers)),
        cpu_seconds_of_parts=json.dumps(dict(sorted(clock.seconds.items()))),
    )
    return dataset


def write_tissue(
    solution: Solution,
    dataset: xr.Dataset,
    failure: LoadStepError | None,
    outputs: Mapping[str, Path],
    params: Mapping[str, Any],
) -> None:
    """Write the solution as `tissue`, and its last state for ParaView as `vtu`; what a failed run left is removed.

    After a `failure` the dataset is kept beside `tissue` with the ending .failed.nc, and ConvergenceError raised.
    """
    kept = outputs["tissue"].with_suffix(".failed.nc")
    if failure is not None:
        datasets.write(dataset, kept, "tissue", params)
        raise ConvergenceError(f"model {params['config']['run']}: {failure} (the converged part is in {kept})")
    last = dataset.isel(step=-1)
    constants = {"C2_MPa": last["C2"].values, "C3": last["C3"].values}
    has_constants = not np.isnan(constants["C2_MPa"]).all()
    datasets.write_bytes(solution.vtu(cells=constants if has_constants else None), outputs["vtu"], params)
    datasets.write(dataset, outputs["tissue"], "tissue", params)
    kept.unlink(missing_ok=True)


def say(attempts: tuple[Attempt, ...]) -> None:
    """The residuals of every increment on stderr, for the log."""
    for attempt in attempts:
        whole = (attempt.start, attempt.end) == (0.0, 1.0)
        part = "" if whole else f", {100 * attempt.start:g} to {100 * attempt.end:g} %"
        residuals = " ".join(f"{residual:.1e}" for residual in attempt.residuals)
        failure = f" - given up: {attempt.failure}" if attempt.failure else ""
        print(f"step {attempt.step + 1}{part}: residuals {residuals}{failure}", file=sys.stderr)
