"""`python -m fibrous_study check`: results against the present config and code, and against what their jobs wrote."""

import json
import shutil
from pathlib import Path

import pytest
import yaml
from workflow_runs import QUICK, all_files, jobs_of, quick_config, written

from fibrous_study import provenance
from fibrous_study.__main__ import main
from fibrous_study.check import check


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A results folder in which every file says its name, and has the record of its job."""
    folder = tmp_path_factory.mktemp("made")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        jobs = jobs_of(quick_config())
        for path in all_files(quick_config()):
            Path(path).parent.mkdir(parents=True, exist_ok=True)
            Path(path).write_text(path)
        for number, job in enumerate(jobs):
            inputs = {path: provenance.digest(Path(path)) for path in job.inputs}
            for path in job.outputs:
                provenance.record(Path(path), job.params, inputs, str(number))
    return folder


@pytest.fixture
def folder(made, tmp_path):
    return shutil.copytree(made, tmp_path / "study")


def faults(folder: Path, **change) -> dict[str, str]:
    other = written(folder, yaml.safe_load(QUICK.read_text()) | change)
    return dict(line.split(": ", 1) for line in check(other, folder)[0])


def test_what_belongs_is_not_mentioned(made):
    assert check(QUICK, made) == ([], len(all_files(quick_config())))


def test_another_config_makes_its_stages_files_stale(made):
    found = faults(made, matrix={"C1_MPa": 0.05})
    for ending in (".nc", ".vtu", ".feb"):
        assert found[f"results/tissue/families{ending}"] == (
            "stale, made with matrix.C1_MPa = 0.025 where the config now says 0.05"
        )
    assert not any(name.startswith(("results/networks", "results/tissue/specimen")) for name in found)


def test_other_code_makes_stale_what_imports_its_room(folder):
    for path in ("results/fits/named/large.csv", "results/fits/tissue/section_2_6.csv"):
        record = provenance.record_of(folder / path)
        record.write_text(json.dumps({**json.loads(record.read_text()), "code_hash": "other"}))
    changed = "stale, the sources of fibrous_study.steps.hgo_fits have changed"
    assert faults(folder) == dict.fromkeys(
        ("results/fits/named/large.csv", "results/fits/tissue/section_2_6.csv"), changed
    )


def test_files_changed_by_hand_are_named_with_what_was_made_before_the_change(folder):
    changed = {
        "results/networks/named/00.nc",
        "results/tables/table_1.csv",
        "results/figures/figure_3.png",
        "results/figures/figure_3.svg",
        "results/tissue/hgo.vtu",
        "results/report.html",
    }
    for path in changed:
        (folder / path).write_text("another content")
    found = faults(folder)
    assert {path for path, fault in found.items() if fault.startswith("changed by hand")} == changed
    readers = {path for job in jobs_of(quick_config()) if changed & job.inputs for path in job.outputs}
    assert set(found) == changed | readers
    assert found["results/curves/named/large/00.nc"] == (
        "stale, made from another content of results/networks/named/00.nc"
    )


def test_missing_and_foreign_files_and_those_without_a_record_are_named(folder):
    (folder / "results/report.html").unlink()
    shutil.copy(folder / "results/networks/delaunay/00.nc", folder / "results/networks/delaunay/02.nc")
    shutil.copy(folder / "results/tissue/hgo.nc", folder / "results/tissue/hgo.failed.nc")
    provenance.record_of(folder / "results/claims.csv").unlink()
    provenance.record_of(folder / "results/tables/stages.csv").write_text("{")
    assert faults(folder) == {
        "results/report.html": "missing",
        "results/networks/delaunay/02.nc": "foreign, no rule of this study writes it",
        "results/tissue/hgo.failed.nc": "the converged part of a run that failed",
        "results/claims.csv": "unknown, nothing at results/provenance/claims.csv.json says how it was made",
        "results/tables/stages.csv": (
            "unknown, nothing at results/provenance/tables/stages.csv.json says how it was made"
        ),
    }


def test_the_command_prints_a_last_line_and_its_exit_code_tells(folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    assert main(["check", "--config", str(QUICK)]) == 0
    assert capsys.readouterr().out.startswith(f"all {len(all_files(quick_config()))} files of the study belong")
    own = written(folder, yaml.safe_load(QUICK.read_text()) | {"surface": {"cross_validation_folds": 4}})
    assert main(["check", "--config", str(own)]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert "made with surface.cross_validation_folds = 10 where the config now says 4" in lines[0]
    assert lines[-1].startswith(f"{len(lines) - 1} findings")
    own.write_text("sede: 1\n")
    assert main(["check", "--config", str(own)]) == 1
    assert capsys.readouterr().err == "config: sede is unknown, did you mean seed?\n"
