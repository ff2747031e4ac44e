"""One job as its rule starts it: a user's mistake or a full disk is one line, and nothing half-written stays."""

import json
import resource
import subprocess
import sys
import types

import pytest

from fibrous.errors import NetworkError
from fibrous.study import job
from fibrous.study.configuration import loaded
from fibrous.study.stages import stage_params


@pytest.fixture(scope="module")
def config() -> dict:
    config = loaded()
    config["cube"] |= {"edge_length_um": 10.0, "alignment_tolerance": 0.01}
    config["delaunay"] |= {"networks": 30, "batches": 15}
    return config


def run(arguments: list[str], **options) -> subprocess.CompletedProcess:
    line = [sys.executable, "-m", "fibrous.study.job", *arguments]
    return subprocess.run(line, capture_output=True, text=True, timeout=120, **options)


def networks(config: dict, path, **options) -> subprocess.CompletedProcess:
    params = stage_params("networks", config, {"ensemble": "delaunay", "batch": "00"})
    arguments = ["--params", json.dumps(params), "--input", "files", "--output", "networks", str(path)]
    return run(arguments, **options)


def curves(config: dict, source, path) -> subprocess.CompletedProcess:
    params = stage_params("curves", config, {"ensemble": "delaunay", "batch": "00", "protocol": "small"})
    arguments = ["--params", json.dumps(params), "--input", "networks", str(source), "--output", "curves", str(path)]
    return run(arguments)


def one_line(done: subprocess.CompletedProcess) -> str:
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1, done.stderr
    return done.stderr


def test_a_full_disk_is_one_line_and_leaves_nothing(config, tmp_path):
    path = tmp_path / "networks.nc"

    def nearly_full() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))

    line = one_line(networks(config, path, preexec_fn=nearly_full))
    assert line.startswith(f"{path}: cannot be written (File too large)")
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_loses_nothing_that_stood_there(config, tmp_path):
    path = tmp_path / "networks.nc"
    path.write_bytes(b"older")

    def nearly_full() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))

    one_line(networks(config, path, preexec_fn=nearly_full))
    assert path.read_bytes() == b"older"


def test_a_place_that_cannot_be_written_is_one_line(config, tmp_path):
    (tmp_path / "results").write_text("a file where a folder should be")
    line = one_line(networks(config, tmp_path / "results" / "networks.nc"))
    assert line.startswith(f"{tmp_path}/results/networks.nc: cannot be written")


def test_broken_inputs_are_one_line_with_the_file(config, tmp_path):
    whole = tmp_path / "networks.nc"
    assert networks(config, whole).returncode == 0
    content = whole.read_bytes()
    broken = {
        "truncated.nc": content[: len(content) // 2],
        "text.nc": b"x,y\n1,2\n",
        "empty.nc": b"",
    }
    for name, bytes_ in broken.items():
        (tmp_path / name).write_bytes(bytes_)
        line = one_line(curves(config, tmp_path / name, tmp_path / "curves.nc"))
        assert line.startswith(f"{tmp_path / name}: not a readable NetCDF file")
    assert one_line(curves(config, tmp_path / "none.nc", tmp_path / "curves.nc")).startswith(
        f"{tmp_path}/none.nc: no such file"
    )
    assert not (tmp_path / "curves.nc").exists()


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (NetworkError("node 3\nis nowhere"), "node 3 is nowhere"),
        (MemoryError(), "out of memory: run fewer jobs at once"),
        (OSError(28, "No space left on device", "here.nc"), "here.nc: No space left on device; free space"),
    ],
)
def test_what_a_user_can_mend_is_one_line(monkeypatch, capsys, error, said):
    def fails(*_) -> None:
        raise error

    monkeypatch.setitem(sys.modules, "fibrous.study.failing", types.SimpleNamespace(run=fails))
    monkeypatch.setattr(job, "end_with_run", lambda: None)
    assert job.main(["--params", '{"stage": "fibrous.study.failing"}']) == 1
    printed = capsys.readouterr().err
    assert printed.startswith(said)
    assert printed.count("\n") == 1


def test_a_fault_of_the_library_keeps_its_traceback(monkeypatch):
    def fails(*_) -> None:
        raise ZeroDivisionError

    monkeypatch.setitem(sys.modules, "fibrous.study.failing", types.SimpleNamespace(run=fails))
    monkeypatch.setattr(job, "end_with_run", lambda: None)
    with pytest.raises(ZeroDivisionError):
        job.main(["--params", '{"stage": "fibrous.study.failing"}'])
