"""`python -m fibrous_study check`: results against the present config and code, by what they carry themselves."""

import copy
import hashlib
import json
import shutil
from pathlib import Path
from xml.sax.saxutils import escape

import pytest
import xarray as xr
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from fibrous_study import provenance
from fibrous_study.__main__ import main
from fibrous_study.check import check
from fibrous_study.config import loaded
from fibrous_study.stages import expected_files, stage_params

COMPANIONS = (".csv", ".vtu", ".feb", ".html")


@pytest.fixture(scope="module")
def config() -> dict:
    small = loaded()
    small["delaunay"] |= {"networks": 20, "batches": 2}
    return small


@pytest.fixture(scope="module")
def made(config, tmp_path_factory):
    """A results folder in which every file carries the right attributes and nothing else."""
    folder = tmp_path_factory.mktemp("made")
    for name, stage, wildcards in expected_files(config):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        attributes = provenance.attributes(stage_params(stage, config, wildcards))
        match path.suffix:
            case ".nc":
                xr.Dataset(attrs=attributes).to_netcdf(path, engine="netcdf4")
            case ".csv" | ".vtu" | ".feb" | ".html":
                path.write_text("a\n")
                attributes["sha256"] = hashlib.sha256(b"a\n").hexdigest()
                (folder / f"{name}.json").write_text(json.dumps(attributes))
            case ".png":
                text = PngInfo()
                text.add_text("fibrous", json.dumps(attributes))
                Image.new("L", (8, 8)).save(path, pnginfo=text)
            case ".svg":
                text = (
                    f"<svg xmlns:d='http://purl.org/dc/elements/1.1/'><d:description>{escape(json.dumps(attributes))}"
                )
                path.write_text(f"{text}</d:description></svg>")
    return folder


@pytest.fixture
def folder(made, tmp_path):
    return shutil.copytree(made, tmp_path / "study")


def faults(config: dict, folder) -> dict[str, str]:
    lines, _ = check(config, folder)
    return dict(line.split(": ", 1) for line in lines)


def test_what_belongs_is_not_mentioned(config, made):
    assert check(config, made) == ([], len(list(expected_files(config))))


def test_another_config_makes_its_stage_and_what_follows_stale(config, made):
    other = copy.deepcopy(config)
    other["fit"]["largest_C3"] = 20.0
    found = faults(other, made)
    assert found["results/fits/named/large.csv"] == (
        "stale, made with fit.largest_C3 = 50.0 where the config now says 20.0"
    )
    later = "stale, made from inputs that the present config or code would make differently"
    assert found["results/tables/surface.nc"] == found["results/figures/figure_5.svg"] == later
    assert_follow_fits(found)
    assert not any("figure_3" in name or "figure_7" in name for name in found)


def assert_follow_fits(found) -> None:
    """What fits are behind is found, and nothing else: neither networks nor runs without fitted constants."""
    assert {name.split("/")[1] for name in found} == {
        "fits",
        "tables",
        "figures",
        "curves",
        "tissue",
        "claims.csv",
        "report",
        "report.html",
    }
    assert {name.split("/")[3].partition("_")[0] for name in found if "/curves/" in name} == {"refit"}
    tissue = {Path(name).name for name in found if "/tissue/" in name and name.endswith((".nc", ".vtu", ".feb"))}
    assert {"hgo.nc", "hgo.vtu", "hgo.feb", "hgo_refit.nc", "hgo_surface.nc", "structure_tensor.nc"} <= tissue
    assert not {"specimen.nc", "matrix.nc", "matrix.vtu", "affine.nc", "affine.vtu"} & tissue


def test_the_matrix_is_behind_every_run_and_model_of_the_tissue(config, made):
    other = copy.deepcopy(config)
    other["matrix"]["C1_MPa"] = 0.05
    found = faults(other, made)
    for ending in (".nc", ".vtu", ".feb"):
        assert found[f"results/tissue/families{ending}"] == (
            "stale, made with matrix.C1_MPa = 0.025 where the config now says 0.05"
        )
    assert not any(name.startswith(("results/networks", "results/tissue/specimen")) for name in found)


def test_results_made_anew_from_older_inputs_are_seen(config, folder):
    """Only the networks are made with the new seed: whatever the files' times say, the curves are old."""
    other = copy.deepcopy(config)
    other["seed"] += 1
    for name, stage, wildcards in expected_files(other):
        if stage == "networks":
            attributes = provenance.attributes(stage_params(stage, other, wildcards))
            xr.Dataset(attrs=attributes).to_netcdf(folder / name, engine="netcdf4")
    found = faults(other, folder)
    assert not any(name.startswith("results/networks") for name in found)
    assert found["results/curves/named/large/00.nc"].startswith("stale, made from inputs that")


def test_other_code_makes_stale_what_imports_it(config, made, tmp_path, monkeypatch):
    sources = shutil.copytree(provenance.SOURCES, tmp_path / "src")
    with open(sources / "fibrous_study" / "steps" / "hgo_fits.py", "a") as stream:
        stream.write("# changed\n")
    provenance.code_hash.cache_clear()
    monkeypatch.setattr(provenance, "SOURCES", sources)
    found = faults(config, made)
    provenance.code_hash.cache_clear()
    assert found["results/fits/named/large.csv"] == "stale, the sources of fibrous_study.steps.hgo_fits have changed"
    assert found["results/tables/table_1.csv"].startswith("stale, made from inputs that")
    assert_follow_fits(found)


def test_truncated_files_are_unreadable(config, folder):
    endings = [".nc", ".png", ".svg", *COMPANIONS, *(f"{one}.json" for one in COMPANIONS)]
    # The last of a kind, so that a file and a companion are not the same result's.
    paths = [sorted((folder / "results").rglob(f"*{ending}"))[-1 if "json" in ending else 0] for ending in endings]
    for path in paths:
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    found = faults(config, folder)
    assert set(found) == {str(path.relative_to(folder)).removesuffix(".json") for path in paths}
    assert len(found) == len(endings)
    assert all(fault.startswith("unreadable (") for fault in found.values())


def test_missing_and_foreign_files_are_named(config, folder):
    (folder / "results/networks/named/00.nc").unlink()
    shutil.copy(folder / "results/networks/delaunay/00.nc", folder / "results/networks/delaunay/02.nc")
    shutil.copy(folder / "results/networks/delaunay/00.nc", folder / "results/tables/surface.nc")
    assert faults(config, folder) == {
        "results/networks/named/00.nc": "missing",
        "results/networks/delaunay/02.nc": "foreign, no stage of this study writes it",
        "results/tables/surface.nc": "foreign, written by fibrous_study.steps.network_ensemble",
    }


def test_a_file_must_be_the_one_that_its_companion_tells_of(config, folder):
    expected = {}
    for ending in COMPANIONS:
        changed, alone, missing = sorted((folder / "results").rglob(f"*{ending}"))[:3]
        changed.write_text("b\n")
        Path(f"{alone}.json").unlink()
        missing.unlink()
        expected |= {changed: "unreadable (not the content", alone: "unreadable (", missing: "missing"}
    found = faults(config, folder)
    assert set(found) == {str(path.relative_to(folder)) for path in expected}
    for path, start in expected.items():
        assert found[str(path.relative_to(folder))].startswith(start)


def test_what_a_failed_run_left_is_named(config, folder):
    shutil.copy(folder / "results/tissue/hgo.nc", folder / "results/tissue/hgo.failed.nc")
    shutil.copy(folder / "results/tissue/hgo.vtu", folder / "results/tissue/odd.vtu")
    assert faults(config, folder) == {
        "results/tissue/hgo.failed.nc": "the converged part of a run that failed",
        "results/tissue/odd.vtu": "foreign, no stage of this study writes it",
    }


def test_a_file_without_attributes_is_unreadable(config, folder):
    xr.Dataset().to_netcdf(folder / "results/tables/surface.nc", engine="netcdf4")
    Image.new("L", (8, 8)).save(folder / "results/figures/figure_3.png")
    found = faults(config, folder)
    assert {name: line.split(" (")[0] for name, line in found.items()} == {
        "results/tables/surface.nc": "unreadable",
        "results/figures/figure_3.png": "unreadable",
    }


def test_the_command_prints_a_last_line_and_its_exit_code_tells(folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    own = folder / "own.yaml"
    own.write_text("delaunay: {networks: 20, batches: 2}\n")
    assert main(["check", "--config", str(own)]) == 0
    files = sum(path.is_file() and path.suffix != ".json" for path in (folder / "results").rglob("*"))
    assert capsys.readouterr().out.startswith(f"all {files} files of the study belong")
    own.write_text("delaunay: {networks: 20, batches: 2}\nsurface: {cross_validation_folds: 4}\n")
    assert main(["check", "--config", str(own)]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert "made with surface.cross_validation_folds = 10 where the config now says 4" in lines[0]
    assert lines[-1].startswith(f"{len(lines) - 1} findings")
    own.write_text("sede: 1\n")
    assert main(["check", "--config", str(own)]) == 1
    assert capsys.readouterr().err == "config: sede is unknown, did you mean seed?\n"
