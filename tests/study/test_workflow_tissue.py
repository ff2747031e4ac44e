"""A tissue of a user's own, and tissues that cannot be."""

import re
from pathlib import Path

import meshio
import numpy as np
import pandas as pd
import pytest
import xarray as xr
import yaml
from workflow_runs import QUICK, snakemake, would_run, written

from fibrous.fe.mesh import box
from fibrous_study.check import check

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


def test_a_tissue_of_ones_own_runs_from_five_lines(tmp_path):
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
    own_tissue(tmp_path, stretch=0.25)
    whole = written(tmp_path, yaml.safe_load(QUICK.read_text()) | OWN_TISSUE, "whole.yaml")
    old = [line for line in check(whole, tmp_path)[0] if "another content of motion.csv" in line]
    assert old == ["results/tissue/specimen.nc: stale, made from another content of motion.csv"]


FIT = {"constants": "fit", "energy": "structure_tensor", "objective": "energy"}
FEW = [
    {"name": "affine", "law": "affine"},
    {"name": "hgo", "law": "families", **FIT, "refit": True},
    {"name": "multiscale", "law": "network"},
]
FROM_SURFACE = {"name": "hgo_surface", "law": "families", "constants": "surface"}


def few_models(*models: dict) -> dict:
    return {**OWN_TISSUE, "tissue": {"models": [*FEW, *models]}, "microstructure": {"runs": ["multiscale"]}}


def ensembles(paths: set[str]) -> set[str]:
    """Whose networks are among the files."""
    return {Path(path).parts[2] for path in paths if path.startswith("results/networks/")}


def test_a_tissue_of_ones_own_makes_no_other_networks(tmp_path):
    own_tissue(tmp_path)
    for targets in ((), ("tissue",), ("curves",), ("report",)):
        found = would_run(tmp_path, few_models(), *targets)
        assert ensembles(found) == {"tissue"}
        assert not any(f"/{name}" in path for path in found for name in ("delaunay", "named", "replicates", "surface"))
    found = would_run(tmp_path, few_models())
    made = ("tables/comparison.csv", "tables/table_2.csv", "report.html", "report/comparison.html")
    drawn = (f"figures/{name}.png" for name in ("specimen", "figure_9", "comparison", "figure_4"))
    assert {f"results/{path}" for path in (*made, *drawn)} <= found
    assert "results/claims.csv" not in found


def test_a_model_with_constants_of_the_surface_makes_its_networks_and_no_others(tmp_path):
    own_tissue(tmp_path)
    found = would_run(tmp_path, few_models(FROM_SURFACE))
    assert ensembles(found) == {"tissue", "delaunay"}
    assert {"results/tables/surface.nc", "results/tissue/hgo_surface.nc"} <= found
    assert "results/claims.csv" not in found


@pytest.mark.parametrize(
    ("target", "wanted"),
    [
        ("figure_5", {"named"}),
        ("table_1", {"delaunay"}),
        ("claims", {"delaunay", "named", "replicates", "tissue"}),
    ],
)
def test_what_tells_of_the_papers_networks_is_made_where_it_is_named(tmp_path, target, wanted):
    own_tissue(tmp_path)
    assert ensembles(would_run(tmp_path, few_models(), target)) == wanted


def test_the_study_of_a_tissue_of_ones_own_tells_what_it_made(tmp_path):
    own_tissue(tmp_path)
    own = written(tmp_path, few_models())
    done = snakemake(tmp_path, "-j2", configs=(QUICK, own))
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "results/report.html").read_text()
    figures = set(re.findall(r'<figure id="(\w+)">', page))
    assert figures == {"figure_4", "figure_specimen", "figure_9", "figure_comparison"}
    sections = page.split("<section>")[1:]
    assert len(sections) == 4
    assert all("<figure" in one or "<table" in one for one in sections)


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
