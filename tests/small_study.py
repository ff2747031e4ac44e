"""A study of twelve elements whose stages run one by one in a folder, and fits made up for its networks."""

from __future__ import annotations

import copy
import importlib
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from workflow_runs import job_of

from fibrous.networks.network import Network, unpacked
from fibrous.specimen import FiberField, RigidMotion, Slab, Specimen
from fibrous_study import datasets, plan
from fibrous_study.config import loaded
from fibrous_study.schema import TABLES

ELEMENTS = 12
SPECIMEN_FILE = "results/tissue/specimen.nc"
NETWORK_FILES = tuple(f"results/networks/tissue/{batch:02d}.nc" for batch in (0, 1))
FITS_FILE = "results/fits/tissue/section_2_6.csv"
SURFACE_FILE = "results/tables/surface.nc"
HGO = {"name": "hgo", "law": "families", "constants": "fit", "energy": "structure_tensor", "objective": "energy"}
NO_PARAMS = {"stage": "test", "config": {}, "code_hash": ""}
TENSOR = {"H11": (0, 0), "H22": (1, 1), "H33": (2, 2), "H12": (0, 1), "H13": (0, 2), "H23": (1, 2)}


def small_config(**changes: Any) -> dict[str, Any]:
    """The default study with a small specimen; mappings in `changes` are laid over those of the config."""
    config = copy.deepcopy(loaded())
    small = {
        "cube": {"edge_length_um": 8.0, "alignment_tolerance": 0.01},
        "synthetic_specimen": {"elements": [3, 4, 1], "load_steps": 3, "H11": [0.55, 0.7]},
        "tissue": {"batches": 2},
        "microstructure": {"elements": [5]},
    }
    for part in (small, changes):
        for key, value in part.items():
            config[key] = config[key] | value if isinstance(value, dict) else value
    config["microstructure"]["runs"] = [model["name"] for model in config["tissue"]["models"][:1]]
    return config


def small_specimen() -> Specimen:
    """The specimen of `small_config`, from its numbers."""
    config = small_config()
    numbers = config["synthetic_specimen"]
    lengths = (numbers[f"{of}_mm"] for of in ("length", "height", "thickness", "radius"))
    slab = Slab(tuple(numbers["elements"]), *lengths)
    angles = (numbers[f"{of}_degrees"] for of in ("lowest_row", "deviation", "tilt"))
    rest = (numbers[name] for name in ("H11", "in_plane_share", "correlation_length_mm"))
    motion = RigidMotion(numbers["gap_mm"], numbers["slide_mm"], numbers["rotation_degrees"])
    return slab.specimen(numbers["load_steps"], FiberField(config["seed"], *angles, *rest), motion)


def other_tensors() -> np.ndarray:
    """H of the networks, which the elements' are not quite."""
    turned = small_specimen().structure_tensor + 0.01 * np.diag([-1.0, 0.5, 0.5])
    turned[:, 0, 2] = turned[:, 2, 0] = 0.02
    return turned


class Study:
    """Files of a study, where its rules would read and write them."""

    def __init__(self, folder: Path, **changes: Any) -> None:
        self.folder, self.config = folder, small_config(**changes)

    def run(self, rule: str, changes: Mapping[str, Any] | None = None, **wildcards: str) -> dict[str, Path]:
        """Run one job of a rule on the files that it names, with `changes` of its part of the config; its outputs."""
        job = job_of(self.config, rule, **wildcards)
        files = {name: [self.folder / path for path in paths] for name, paths in job.content["inputs"].items()}
        outputs = {name: self.folder / path for name, path in job.content["outputs"].items()}
        params = {**job.params, "config": {**job.params["config"], **(changes or {})}}
        importlib.import_module(params["stage"]).run(files, outputs, params)
        return outputs

    def prepare(self) -> Study:
        """Make specimen and networks, made-up fits, the surface, and runs with initial and refitted constants."""
        self.run("specimen")
        for batch in plan.batches(self.config, "tissue"):
            self.run("network_ensemble", ensemble="tissue", batch=batch)
        self.write_fits("section_2_6", made_up_fits("section_3_1", "all"))
        self.write_fits("refit_hgo", made_up_fits("single", "tissue", factor=1.5))
        datasets.place((resources.files("fibrous_study") / "data/surface.nc").read_bytes(), self.folder / SURFACE_FILE)
        for run in ("matrix", "hgo", "hgo_refit"):
            self.run("tissue_run", run=run)
        return self

    def with_files(self, folder: Path, *paths: str, **changes: Any) -> Study:
        """Another study, with some of the files of this one."""
        for path in paths:
            datasets.place((self.folder / path).read_bytes(), folder / path)
        return Study(folder, **changes)

    def specimen(self) -> xr.Dataset:
        return datasets.read(self.folder / SPECIMEN_FILE, "specimen")

    def tissue(self, run: str) -> xr.Dataset:
        return datasets.read(self.folder / f"results/tissue/{run}.nc", "tissue")

    def networks(self) -> list[Network]:
        """Those of the elements, in their order."""
        read = (datasets.read(self.folder / path, "networks") for path in NETWORK_FILES)
        return [network for dataset in read for network in unpacked(dataset)]

    def write_fits(self, protocol: str, table: pd.DataFrame) -> None:
        """Fits with all columns of the schema; those that the table lacks hold nothing."""
        columns = {name: "" if column.dtype == "U" else np.nan for name, column in TABLES["fits"].columns.items()}
        whole = table.assign(
            **{name: value for name, value in columns.items() if name not in table and name not in TENSOR}
        )
        datasets.write_table(whole, self.folder / f"results/fits/tissue/{protocol}.csv", NO_PARAMS)


def constants(energy: str, objective: str) -> tuple[np.ndarray, np.ndarray]:
    """Made-up C2 (MPa) and C3 of the networks; those of another form are others."""
    number = np.arange(ELEMENTS)
    form = 2.0 * (energy == "families") + (objective == "stress")
    return 0.1 + 0.01 * number + 0.003 * form, 0.5 + 0.1 * (number[::-1] % 5) + 0.2 * form


def made_up_fits(load_set: str, deformation: str, factor: float = 1.0) -> pd.DataFrame:
    """Rows with C2 `factor` times that of `constants`, among rows that nobody should read, networks in disorder."""
    tensors, rows = other_tensors(), []
    for energy in ("structure_tensor", "families"):
        for objective in ("energy", "stress"):
            C2, C3 = constants(energy, objective)
            # Section 2.5's rule for a single deformation.
            slope = (energy, objective, deformation) == ("structure_tensor", "energy", "tissue")
            fitted = "slope" if slope else objective
            for number in np.random.default_rng(3).permutation(ELEMENTS):
                tensor = {column: tensors[number][index] for column, index in TENSOR.items()}
                row = {"network": number, "energy": energy, "objective": fitted, **tensor}
                wanted = {"load_set": load_set, "deformation": deformation, "C2_MPa": factor * C2[number]}
                rows.append({**row, **wanted, "C3": C3[number]})
                if load_set != "single":
                    for other in (("section_2_3", "all"), ("single", "x_uniaxial"), ("single", "xy_shear")):
                        rows.append({**row, "load_set": other[0], "deformation": other[1], "C2_MPa": 9.0, "C3": 9.0})
    return pd.DataFrame(rows)
