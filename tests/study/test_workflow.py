"""The DAG as a user meets it: from an empty folder, again, broken, killed."""

import os
import re
import signal
import subprocess
import time
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
import pandas as pd
import psutil
import pytest
import xarray as xr
from workflow_runs import QUICK, SMALL, all_files, command_line, files_of, quick_config, snakemake, would_run, written

from fibrous_study.check import check
from fibrous_study.provenance import record_of
from fibrous_study.schema import TABLES


def test_the_quick_study_makes_every_file_and_check_agrees(quick):
    folder, _ = quick
    expected = all_files(quick_config())
    found = {str(path.relative_to(folder)) for path in (folder / "results").rglob("*") if path.is_file()}
    assert {path for path in found if not path.endswith(".json")} == expected
    assert all((folder / record_of(Path(path))).is_file() for path in expected)
    assert check(QUICK, folder) == ([], len(expected))


@pytest.mark.parametrize("name", TABLES)
def test_the_tables_have_the_columns_that_the_page_of_files_lists(quick, quick_sensitivity, name):
    tables = [path for folder in (quick[0], quick_sensitivity) for path in (folder / "results").rglob("*.csv")]
    paths = [path for path in tables if fnmatch(str(path), f"*/{_as_glob(TABLES[name].path)}")]
    assert paths
    for path in paths:
        assert pd.read_csv(path, nrows=0).columns.tolist() == list(TABLES[name].columns)


def _as_glob(place: str) -> str:
    return re.sub(r"\{\w+\}", "*", place)


def test_the_run_ends_with_the_convergence_of_its_states(quick):
    folder, said = quick
    table = pd.read_csv(folder / "results/tables/convergence.csv")
    curves = [xr.load_dataset(path, engine="netcdf4") for path in (folder / "results/curves").rglob("*.nc")]
    assert len(table) == sum(int((~one["converged"]).sum()) for one in curves)
    assert said.count("not converged: ") == len(table)
    assert ("every state of" in said) == table.empty
    limited = sum(int(one["amplitude_limited"].sum()) for one in curves)
    assert f"\n{limited} loads were cut at principal_stretch_limit\n" in said


def test_a_second_run_does_nothing(quick):
    folder, _ = quick
    before = {path: path.stat().st_mtime_ns for path in (folder / "results").rglob("*")}
    done = snakemake(folder, "-j2")
    assert done.returncode == 0
    assert "Nothing to be done" in done.stderr
    assert before == {path: path.stat().st_mtime_ns for path in (folder / "results").rglob("*")}


def test_a_named_target_makes_its_own_files_and_no_others(tmp_path):
    config = quick_config()
    rules = ["figure_2", "figure_3", "figure_5", "figure_6", "figure_7", "table_1", "case_study", "figure_8"]
    for target in [*rules, "specimen", "comparison", "figure_9", "claims", "report"]:
        found = would_run(tmp_path, {}, target)
        assert files_of(config, target) <= found, target
        if target in ("figure_2", "figure_3", "figure_5"):
            assert not any("delaunay" in path for path in found)
        if target in rules:
            assert not any("tissue" in path for path in found)
        if target in ("specimen", "figure_7"):
            assert found == files_of(config, target)


@pytest.mark.parametrize(
    ("target", "rules", "needed"),
    [
        ("networks", ["network_ensemble"], ["specimen"]),
        ("curves", ["network_curves", "refit_curves", "convergence"], None),
        ("fits", ["hgo_fits", "convergence"], None),
        ("tissue", ["specimen", "tissue_run", "tissue_coupled", "febio", "tissue_table", "convergence"], None),
    ],
)
def test_a_gathering_target_makes_the_files_of_its_rules(tmp_path, target, rules, needed):
    found, own = would_run(tmp_path, {}, target), files_of(quick_config(), *rules)
    assert own <= found
    if needed is not None:
        assert found == own | files_of(quick_config(), *needed)


def test_networks_and_curves_do_not_depend_on_batches_or_jobs(quick, tmp_path):
    """Three batches one after the other in the place of two at once, and fewer networks in all."""
    wanted = [f"results/curves/delaunay/small/0{batch}.nc" for batch in range(3)] + ["results/curves/named/small/00.nc"]
    done = snakemake(tmp_path, "-j1", *wanted, configs=(QUICK, written(tmp_path, SMALL)))
    assert done.returncode == 0, done.stderr
    for path in [*wanted, *(path.replace("curves", "networks").replace("/small", "") for path in wanted)]:
        here = xr.load_dataset(tmp_path / path, engine="netcdf4")
        there = xr.load_dataset((quick[0] / path).with_name("00.nc"), engine="netcdf4")
        assert here.sizes["network"] >= 4
        assert same_bits(here, there), path


def same_bits(part: xr.Dataset, whole: xr.Dataset) -> bool:
    """Whether every variable of the networks of `part` is bit for bit what `whole` holds for these networks."""
    ragged = {"node": "node_count", "fiber": "fiber_count"}
    for position, number in enumerate(part["network"].values):
        other = int(np.flatnonzero(whole["network"].values == number)[0])
        for name in part.data_vars:
            dimension = part[name].dims[0]
            if dimension == "network":
                ours, theirs = part[name].values[position], whole[name].values[other]
            else:
                ours, theirs = (
                    rows(data, name, ragged[dimension], at) for data, at in ((part, position), (whole, other))
                )
            if ours.tobytes() != theirs.tobytes() and str(ours) != str(theirs):
                return False
    return True


def rows(data: xr.Dataset, name: str, count: str, network: int) -> np.ndarray:
    ends = np.cumsum(data[count].values)
    return data[name].values[ends[network] - data[count].values[network] : ends[network]]


@pytest.mark.parametrize(
    "blow",
    [
        lambda run: os.kill(run.pid, signal.SIGKILL),  # out of memory, a closed terminal
        lambda run: os.killpg(run.pid, signal.SIGINT),  # Ctrl-C reaches the jobs too
    ],
    ids=["SIGKILL", "Ctrl-C"],
)
def test_a_killed_run_continues_with_the_same_command(tmp_path, blow):
    configs = (QUICK, written(tmp_path, SMALL))
    targets = [*(f"results/networks/delaunay/0{batch}.nc" for batch in range(3)), "results/networks/named/00.nc"]
    run = subprocess.Popen(
        command_line("-j2", *targets, configs=configs),
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    jobs = wait_for(
        lambda: [child for child in psutil.Process(run.pid).children() if "fibrous_study.job" in line_of(child)]
    )
    wait_for(lambda: all(child.cpu_times().user > 0.3 for child in jobs))  # well under way
    assert (tmp_path / ".snakemake/locks/0.output.lock").exists()
    blow(run)
    said, _ = run.communicate(timeout=60)
    assert "Traceback" not in said
    wait_for(lambda: not any(child.is_running() and child.status() != psutil.STATUS_ZOMBIE for child in jobs))
    assert not list((tmp_path / "results").rglob("*.nc"))  # none of them lived to write its file
    done = snakemake(tmp_path, "-j2", *targets, configs=configs)
    assert done.returncode == 0, done.stderr
    assert len(list((tmp_path / "results/networks").rglob("*.nc"))) == 4
    assert not [path for path in (tmp_path / "results").rglob(".*") if path.is_file()]


def line_of(process: psutil.Process) -> str:
    try:
        return " ".join(process.cmdline())
    except psutil.Error:
        return ""


def wait_for(condition, seconds: float = 60.0):
    """What `condition` returns once it is true."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        found = condition()
        if found:
            return found
        time.sleep(0.02)
    raise AssertionError(f"waited {seconds} s in vain")


def test_a_living_run_keeps_its_locks(tmp_path):
    """A dry run beside it must not take them for those of a killed one."""
    configs = (QUICK, written(tmp_path, SMALL))
    run = subprocess.Popen(
        command_line("-j1", "networks", configs=configs), cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    lock = tmp_path / ".snakemake/locks/0.output.lock"
    wait_for(lock.exists)
    assert snakemake(tmp_path, "-n", "networks", configs=configs).returncode == 0
    assert lock.exists()
    second = snakemake(tmp_path, "-j1", "networks", configs=configs)
    assert second.returncode != 0
    assert "LockException" in second.stderr
    run.communicate(timeout=120)
    assert run.returncode == 0


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"fiber": {"radius_um": -1}}, "config: fiber.radius_um is -1, must be greater than 0 µm"),
        ({"sede": 1}, "config: sede is unknown, did you mean seed?"),
        ({"delaunay": {"batches": 31}}, "config: delaunay.batches is 31, must be at most delaunay.networks = 30"),
    ],
)
def test_a_wrong_config_stops_the_run_with_one_line(tmp_path, change, line):
    done = snakemake(tmp_path, "-j2", configs=(QUICK, written(tmp_path, change)))
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == line
    assert "Traceback" not in done.stderr + done.stdout
    assert not (tmp_path / "results").exists()


def own_network(folder: Path) -> dict:
    """A config for one network of a user's: a cube's corners bound to two nodes inside."""
    corners = [(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]
    nodes = pd.DataFrame([*corners, (0.05, 0.1, 0.0), (-0.1, 0.0, 0.05)], columns=["x", "y", "z"])
    fibers = pd.DataFrame([(i, j) for i in range(8) for j in (8, 9)] + [(8, 9)], columns=["tail", "head"])
    nodes.to_csv(folder / "nodes.csv", index=False)
    fibers.to_csv(folder / "fibers.csv", index=False)
    entry = {"name": "own", "nodes": "nodes.csv", "fibers": "fibers.csv"}
    return {"network": "file", "network_files": [entry]}


def test_a_users_network_gets_its_curves_and_fits(tmp_path):
    own = written(tmp_path, own_network(tmp_path))
    done = snakemake(tmp_path, "-j2", configs=(own,))
    assert done.returncode == 0, done.stderr
    assert check(own, tmp_path)[0] == []
    with open(tmp_path / "nodes.csv", "a") as stream:
        stream.write("0.5,0.5,0.0\n")
    assert check(own, tmp_path)[0] == ["results/networks/file/00.nc: stale, made from another content of nodes.csv"]
    fits = pd.read_csv(tmp_path / "results/fits/file/large.csv")
    assert set(fits["name"]) == {"own"}
    assert set(fits["load_set"]) == {"section_3_1", "section_2_3", "single"}


def test_a_failed_job_says_why_on_the_terminal(tmp_path):
    own = written(tmp_path, own_network(tmp_path))
    fibers = pd.read_csv(tmp_path / "fibers.csv")
    fibers.loc[3, "head"] = 10
    fibers.to_csv(tmp_path / "fibers.csv", index=False)
    done = snakemake(tmp_path, "-j2", configs=(own,))
    assert done.returncode == 1
    lines = [line for line in done.stderr.splitlines() if line.startswith("nodes.csv and fibers.csv: ")]
    assert len(lines) == 1
    assert (tmp_path / "logs/network_ensemble/file/00.log").read_text() == f"{lines[0]}\n"
    assert not list((tmp_path / "results").rglob("*.nc"))


def many_batches(count: int) -> dict:
    """A study of so many batches of the 750 and of the tissue's networks, each of one network."""
    return {
        "delaunay": {"networks": count, "batches": count},
        "tissue": {"batches": count},
        "synthetic_specimen": {"elements": [count, 1, 1]},
        "microstructure": {"elements": [5]},
    }


def test_a_command_does_not_grow_with_the_number_of_batches(tmp_path):
    """Linux takes 128 KiB; the schema allows 1,000 batches."""
    models = [
        {
            "name": "hgo",
            "law": "families",
            "constants": "fit",
            "energy": "families",
            "objective": "energy",
            "refit": True,
        },
        {"name": "multiscale", "law": "network"},
    ]
    study = many_batches(1000)
    study["tissue"] |= {"models": models}
    done = snakemake(tmp_path, "-n", "-p", configs=(written(tmp_path, study),))
    assert done.returncode == 0, done.stderr
    commands = [line for line in (done.stdout + done.stderr).splitlines() if "fibrous_study.job" in line]
    assert len(commands) > 5000
    assert max(map(len, commands)) < 1000
