"""One job as its rule starts it: a user's mistake or a full disk is one line, and nothing half-written stays."""

import json
import os
import resource
import subprocess
import sys
import types
from pathlib import Path

import pytest
from workflow_runs import job_line, job_of, snakemake

from fibrous.errors import NetworkError
from fibrous_study import job
from fibrous_study.config import loaded
from fibrous_study.provenance import digest, recorded


@pytest.fixture(scope="module")
def config() -> dict:
    config = loaded()
    config["cube"] |= {"edge_length_um": 10.0, "alignment_tolerance": 0.01}
    config["delaunay"] |= {"networks": 30, "batches": 15}
    config["sensitivity"] |= {"edge_length_um": [10.0], "volume_fraction": [0.04]}
    return config


@pytest.fixture
def run(config, tmp_path_factory):
    """Runs one job on files of a test's own, told by files in another folder."""
    folder = tmp_path_factory.mktemp("told")

    def started(rule: str, wildcards: dict, inputs: dict, outputs: dict, **options) -> subprocess.CompletedProcess:
        content = {**job_of(config, rule, **wildcards).params, "inputs": inputs, "outputs": outputs}
        line = job_line(folder, content)
        return subprocess.run(line, capture_output=True, text=True, timeout=120, **options)

    return started


@pytest.fixture
def networks(run):
    wildcards = {"ensemble": "delaunay", "batch": "00"}
    return lambda path, **options: run("network_ensemble", wildcards, {"files": []}, {"networks": str(path)}, **options)


@pytest.fixture
def curves(run):
    wildcards = {"ensemble": "delaunay", "batch": "00", "protocol": "small"}
    return lambda source, path: run("network_curves", wildcards, {"networks": [str(source)]}, {"curves": str(path)})


def one_line(done: subprocess.CompletedProcess) -> str:
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1, done.stderr
    return done.stderr


def test_a_full_disk_is_one_line_and_leaves_nothing(networks, tmp_path):
    path = tmp_path / "networks.nc"

    def nearly_full() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))

    line = one_line(networks(path, preexec_fn=nearly_full))
    assert line.startswith(f"{path}: cannot be written (File too large)")
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_loses_nothing_that_stood_there(networks, tmp_path):
    path = tmp_path / "networks.nc"
    path.write_bytes(b"older")

    def nearly_full() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))

    one_line(networks(path, preexec_fn=nearly_full))
    assert path.read_bytes() == b"older"


def test_a_place_that_cannot_be_written_is_one_line(networks, tmp_path):
    (tmp_path / "results").write_text("a file where a folder should be")
    line = one_line(networks(tmp_path / "results" / "networks.nc"))
    assert line.startswith(f"{tmp_path}/results/networks.nc: cannot be written")


def test_broken_inputs_are_one_line_with_the_file(networks, curves, tmp_path):
    whole = tmp_path / "networks.nc"
    assert networks(whole).returncode == 0
    content = whole.read_bytes()
    broken = {
        "truncated.nc": content[: len(content) // 2],
        "text.nc": b"x,y\n1,2\n",
        "empty.nc": b"",
    }
    for name, bytes_ in broken.items():
        (tmp_path / name).write_bytes(bytes_)
        line = one_line(curves(tmp_path / name, tmp_path / "curves.nc"))
        assert line.startswith(f"{tmp_path / name}: not a readable NetCDF file")
    assert one_line(curves(tmp_path / "none.nc", tmp_path / "curves.nc")).startswith(
        f"{tmp_path}/none.nc: no such file"
    )
    assert not (tmp_path / "curves.nc").exists()


def test_a_file_is_recorded_with_what_it_was_made_of(networks, curves, config, tmp_path):
    source, path = tmp_path / "results/networks.nc", tmp_path / "results/curves.nc"
    assert networks(source).returncode == curves(source, path).returncode == 0
    made = recorded(path)
    params = job_of(config, "network_curves", ensemble="delaunay", batch="00", protocol="small").params
    assert {key: made[key] for key in params} == params
    assert made["sha256"] == digest(path)
    assert made["inputs"] == {str(source): digest(source)}


@pytest.fixture
def failing(monkeypatch, tmp_path) -> list[str]:
    """Arguments of a job of a stage that a test makes up."""
    monkeypatch.setattr(job, "end_with_run", lambda: None)
    monkeypatch.setattr(os, "environ", dict(os.environ))  # what a job sets is its own process's, not that of the tests
    return job_line(tmp_path, {"stage": "fibrous_study.failing", "inputs": {}, "outputs": {}})[3:]


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (NetworkError("node 3\nis nowhere"), "node 3 is nowhere"),
        (MemoryError(), "out of memory: run fewer jobs at once"),
        (OSError(28, "No space left on device", "here.nc"), "here.nc: No space left on device; free space"),
    ],
)
def test_what_a_user_can_mend_is_one_line(monkeypatch, capsys, failing, error, said):
    def fails(*_) -> None:
        raise error

    monkeypatch.setitem(sys.modules, "fibrous_study.failing", types.SimpleNamespace(run=fails))
    assert job.main(failing) == 1
    printed = capsys.readouterr().err
    assert printed.startswith(said)
    assert printed.count("\n") == 1


def test_a_fault_of_the_library_keeps_its_traceback(monkeypatch, failing):
    def fails(*_) -> None:
        raise ZeroDivisionError

    monkeypatch.setitem(sys.modules, "fibrous_study.failing", types.SimpleNamespace(run=fails))
    with pytest.raises(ZeroDivisionError):
        job.main(failing)


def test_a_job_without_its_file_is_one_line(run, tmp_path):
    line = [sys.executable, "-m", "fibrous_study.job", "none.json", "--config", "none.json"]
    done = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert one_line(done).startswith("none.json: No such file")


def test_a_place_for_the_files_of_jobs_that_cannot_be_written_is_one_line(tmp_path):
    (tmp_path / ".snakemake").mkdir()
    (tmp_path / ".snakemake" / "fibrous").write_text("a file where a folder should be")
    done = snakemake(tmp_path, "-n", "figure_7")
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith(".snakemake/fibrous/")
    assert "cannot be written (" in done.stderr.splitlines()[-1]
    assert "Traceback" not in done.stderr


def test_the_file_of_a_job_is_named_by_its_content(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    content = {"stage": "s", "config": {"a": 1, "b": 2}}
    path = job.hand_over(content)
    assert job.hand_over({"config": {"b": 2, "a": 1}, "stage": "s"}) == path
    others = [{**content, "config": {"a": 2, "b": 1}}, {**content, "inputs": {"x": ["y"]}}]
    assert len({path, *map(job.hand_over, others)}) == 3
    assert json.loads(Path(path).read_text()) == content
    # What a full disk left of it is written again.
    Path(path).write_text("")
    assert job.hand_over(content) == path
    assert json.loads(Path(path).read_text()) == content
    assert len(os.listdir(Path(path).parent)) == 3
