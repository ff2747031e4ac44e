"""A tissue of a user's own, and tissues that cannot be."""

from pathlib import Path

import meshio
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from workflow_runs import QUICK, snakemake, written

from fibrous.fe.mesh import box
from fibrous.study.configuration import loaded
from fibrous.study.stages import expected_files, stage_params

OWN_TISSUE = {
    "specimen": "file",
    "specimen_files": {"mesh": "mesh.vtu", "motion": "motion.csv", "fibers": "fibers.csv"},
}


def own_tissue(folder: Path, stretch: float = 0.2, cell: str = "hexahedron") -> None:
    """Files of a tissue of a user's: four hexahedra whose end x = 2 is pulled in two steps."""
    mesh = box((2, 2, 1), (2.0, 2.0, 1.0))
    cells = mesh.element_nodes if cell == "hexahedron" else mesh.element_nodes[:, [0, 1, 3, 4]]
    meshio.Mesh(mesh.node_position, [(cell, cells)]).write(folder / "mesh.vtu")
    x = mesh.node_position[:, 0]
    rows = [
        (node, 1 if x[node] == 0.0 else 2, step, 0.0 if x[node] == 0.0 else step * stretch, 0.0, 0.0)
        for step in (1, 2)
        for node in np.flatnonzero((x == 0.0) | (x == 2.0))
    ]
    columns = ["node", "enthesis", "step", "ux_mm", "uy_mm", "uz_mm"]
    pd.DataFrame(rows, columns=columns).to_csv(folder / "motion.csv", index=False)
    fibers = {"element": range(4), "direction_x": 1.0, "direction_y": 0.1, "direction_z": 0.0}
    alignment = {"H11": 0.6, "H22": 0.2, "H33": 0.2}
    pd.DataFrame({**fibers, **alignment}).to_csv(folder / "fibers.csv", index=False)


def test_a_tissue_of_ones_own_runs_from_five_lines(tmp_path, monkeypatch):
    own_tissue(tmp_path)
    own = written(tmp_path, OWN_TISSUE)
    assert len(own.read_text().splitlines()) == 5
    wanted = ["results/tissue/hgo.nc", "results/tissue/hgo.feb"]
    done = snakemake(tmp_path, "-j2", *wanted, configs=(QUICK, own))
    assert done.returncode == 0, done.stderr
    tissue = xr.load_dataset(tmp_path / wanted[0], engine="netcdf4")
    assert tissue.attrs["origin"] == "mesh of mesh.vtu"
    assert tissue["converged"].all()
    moved = tissue["displacement"].values[-1, :, 0]
    assert moved.max() == 0.4
    fixed, pulled = tissue["reaction_force"].values[-1, :, 0]
    assert fixed == pytest.approx(-pulled, rel=1e-6)
    assert pulled > 0.0
    # Another content of the same file makes its results old.
    monkeypatch.chdir(tmp_path)
    before = loaded(own)
    made = {path: stage_params(stage, before, wildcards) for path, stage, wildcards in expected_files(before)}
    own_tissue(tmp_path, stretch=0.25)
    assert made["results/tissue/hgo.nc"] != stage_params("tissue", before, {"run": "hgo"})


def test_a_tissue_that_cannot_be_is_one_line(tmp_path):
    own_tissue(tmp_path, cell="tetra")
    own = written(tmp_path, OWN_TISSUE)
    done = snakemake(tmp_path, "-j2", "specimen", configs=(QUICK, own))
    assert done.returncode == 1
    assert [
        line for line in done.stderr.splitlines() if line.startswith("mesh.vtu: has 4 tetra elements; only hexahedra")
    ]
    assert not (tmp_path / "results/tissue").exists()


def test_a_motion_too_large_keeps_what_converged(tmp_path):
    own_tissue(tmp_path, stretch=-1.5)
    own = written(tmp_path, OWN_TISSUE)
    done = snakemake(tmp_path, "-j2", "results/tissue/matrix.nc", configs=(QUICK, own))
    assert done.returncode == 1
    lines = [line for line in done.stderr.splitlines() if line.startswith("model matrix: step ")]
    assert len(lines) == 1
    assert "results/tissue/matrix.failed.nc" in lines[0]
    assert "Traceback" not in done.stderr
    kept = xr.load_dataset(tmp_path / "results/tissue/matrix.failed.nc", engine="netcdf4")
    assert not kept["converged"].values[-1]
    assert not (tmp_path / "results/tissue/matrix.nc").exists()
