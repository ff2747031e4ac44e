"""The DAG as a user meets it: from an empty folder, again, changed, broken, killed."""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
import pandas as pd
import psutil
import pytest
import xarray as xr
import yaml
from snakemake.api import SnakemakeApi
from snakemake.settings.types import ConfigSettings, DAGSettings, OutputSettings, Quietness, ResourceSettings

from fibrous import provenance
from fibrous.check import check
from fibrous.documentation import TABLES
from fibrous.study.configuration import DEFAULT, PROJECT, loaded, validated
from fibrous.study.stages import STAGES, expected_files, stage_params

QUICK = PROJECT / "config" / "quick.yaml"
# The smallest ensemble for which Eq. 11 can be cross-validated, cut into more batches than the quick one.
SMALL = {"delaunay": {"networks": 12, "batches": 3}, "surface": {"cross_validation_folds": 6}}


def command_line(*arguments: str, configs: tuple[Path, ...] = (QUICK,)) -> list[str]:
    options = [argument for argument in arguments if argument.startswith("-")]
    targets = [argument for argument in arguments if not argument.startswith("-")]
    line = [sys.executable, "-m", "snakemake", "-s", str(PROJECT / "Snakefile"), *options]
    return [*line, "--configfile", *map(str, configs), "--", *targets]


def snakemake(folder: Path, *arguments: str, configs: tuple[Path, ...] = (QUICK,)) -> subprocess.CompletedProcess:
    line = command_line(*arguments, configs=configs)
    return subprocess.run(line, cwd=folder, capture_output=True, text=True, timeout=600)


def written(folder: Path, change: dict, name: str = "own.yaml") -> Path:
    path = folder / name
    path.write_text(yaml.safe_dump(change))
    return path


@pytest.fixture(scope="session")
def quick(tmp_path_factory) -> tuple[Path, str]:
    """The quick study run from an empty folder, with what it said."""
    folder = tmp_path_factory.mktemp("quick")
    done = snakemake(folder, "-j2")
    assert done.returncode == 0, done.stderr
    return folder, done.stdout + done.stderr


def would_run(folder: Path, change: dict, *targets: str) -> set[str]:
    """The files that a dry run in `folder` with `change` laid over the quick config would make."""
    files: list[str] = []
    settings = ConfigSettings(config=change, configfiles=[QUICK])
    with SnakemakeApi(OutputSettings(quiet={Quietness.ALL})) as api:
        workflow = api.workflow(ResourceSettings(cores=2), settings, snakefile=PROJECT / "Snakefile", workdir=folder)
        dag = workflow.dag(DAGSettings(targets=frozenset(targets)))
        dag.execute_workflow(executor="dryrun", updated_files=files)
    return set(files)


def files_of(config: dict, *stages: str, **wanted: str) -> set[str]:
    return {
        path
        for path, stage, wildcards in expected_files(config)
        if stage in stages and all(wildcards.get(name, value) == value for name, value in wanted.items())
    }


def quick_config() -> dict:
    return loaded(QUICK)


def test_the_quick_study_makes_every_file_and_check_agrees(quick):
    folder, _ = quick
    expected = {path for path, _, _ in expected_files(quick_config())}
    found = {str(path.relative_to(folder)) for path in (folder / "results").rglob("*") if path.is_file()}
    assert {path for path in found if not path.endswith(".json")} == expected
    assert check(quick_config(), folder) == ([], len(expected))


@pytest.mark.parametrize("place", TABLES)
def test_the_tables_have_the_columns_that_the_page_of_files_lists(quick, place):
    folder, _ = quick
    paths = [path for path in (folder / "results").rglob("*.csv") if fnmatch(str(path), f"*/results/{_as_glob(place)}")]
    assert paths
    for path in paths:
        assert pd.read_csv(path, nrows=0).columns.tolist() == list(TABLES[place])


def _as_glob(place: str) -> str:
    return re.sub(r"\{\w+\}", "*", place)


def test_the_run_ends_with_the_convergence_of_its_states(quick):
    folder, said = quick
    table = pd.read_csv(folder / "results/tables/convergence.csv")
    curves = [xr.load_dataset(path, engine="h5netcdf") for path in (folder / "results/curves").rglob("*.nc")]
    assert len(table) == sum(int((~one["converged"]).sum()) for one in curves)
    assert said.count("not converged: ") == len(table)
    assert ("every state of" in said) == table.empty
    limited = sum(int(one["amplitude_limited"].sum()) for one in curves)
    assert f"\n{limited} loads were cut at principal_stretch_limit\n" in said


def test_a_second_run_does_nothing(quick):
    folder, _ = quick
    assert would_run(folder, {}) == set()
    before = {path: path.stat().st_mtime_ns for path in (folder / "results").rglob("*")}
    done = snakemake(folder, "-j2")
    assert done.returncode == 0
    assert "Nothing to be done" in done.stderr
    assert before == {path: path.stat().st_mtime_ns for path in (folder / "results").rglob("*")}


def downstream(config: dict, first: set[str]) -> set[str]:
    """The files, and all that are made from them."""
    found, jobs = set(first), {}
    for path, stage, wildcards in expected_files(config):
        jobs.setdefault((stage, *sorted(wildcards.items())), (stage, wildcards, []))[2].append(path)
    while True:
        before = len(found)
        for stage, wildcards, outputs in jobs.values():
            read = {path for paths in STAGES[stage].inputs(config, wildcards).values() for path in paths}
            if read & found:
                found |= set(outputs)
        if len(found) == before:
            return found


def first_hit(*stages: str, **wanted: str):
    """The files of these stages with these wildcards, and all that are made from them."""
    return lambda: downstream(quick_config(), files_of(quick_config(), *stages, **wanted))


def of_runs(*names: str):
    return lambda: downstream(
        quick_config(), {path for name in names for path in files_of(quick_config(), "tissue", run=name)}
    )


def together(*parts):
    return lambda: set().union(*(part() for part in parts))


def _with(key: str, index: int, **change) -> list[dict]:
    entries = quick_config()[key]
    entries[index] |= change
    return entries


the_networks = together(first_hit("networks"), first_hit("specimen"))
the_curves = together(first_hit("curves"), first_hit("states"), first_hit("refit_curves"))
SYNTHETIC = {
    "elements": [3, 4, 2], "length_mm": 11.0, "height_mm": 15.0, "thickness_mm": 1.9, "radius_mm": 16.0,
    "lowest_row_degrees": 19.0, "deviation_degrees": 3.0, "tilt_degrees": 1.0, "H11": [0.55, 0.69],
    "in_plane_share": [0.51, 0.7], "correlation_length_mm": 5.0, "gap_mm": 0.9, "slide_mm": 2.0,
    "rotation_degrees": 5.0, "load_steps": 5,
}  # fmt: skip
HGO_LAWS = ("hgo", "structure_tensor", "families", "stress", "hgo_surface")
as_printed = together(
    *(
        first_hit("fits", ensemble=ensemble, protocol=protocol)
        for ensemble, protocol in (("tissue", "section_2_6"), ("named", "section_2_6"), ("named", "eq9"))
    ),
    of_runs(*HGO_LAWS),
)
# Every key of the config, a change of it, and what depends on it.
CHANGES = {
    "seed": (5, the_networks),
    **{
        f"fiber.{key}": (value, first_hit("networks"))
        for key, value in {
            "modulus_MPa": 11.0,
            "nonlinearity": 2.0,
            "radius_um": 0.09,
            "linear_beyond_stretch": 3.0,
        }.items()
    },
    **{
        f"cube.{key}": (value, first_hit("networks"))
        for key, value in {
            "edge_length_um": 11.0,
            "volume_fraction": 0.05,
            "alignment_tolerance": 0.009,
        }.items()
    },
    "delaunay.H11": ([0.34, 0.8], first_hit("networks", ensemble="delaunay")),
    "delaunay.smallest_H": (0.06, first_hit("networks", ensemble="delaunay")),
    "named": (lambda: _with("named", 5, H22=0.15), first_hit("networks", ensemble="named")),
    "protocols": (lambda: _with("protocols", 1, steps=10), first_hit("curves", "states", protocol="small")),
    "principal_stretch_limit": (3.4, first_hit("curves", "states")),
    "equilibrium.residual_tolerance": (1e-8, the_curves),
    "equilibrium.largest_number_of_iterations": (50, the_curves),
    "equilibrium.largest_number_of_cuts": (5, the_curves),
    # Figures 5 and 6 draw load sets; the tissue takes its constants from one that did not change.
    "load_sets": (
        lambda: _with("load_sets", 1, loads=["x_uniaxial", "yz_shear"]),
        together(first_hit("fits", protocol="large"), first_hit("fits", protocol="small")),
    ),
    "fit.largest_C3": (40.0, first_hit("fits", "refits")),
    "fit.slope_fit_below_r_squared": (0.4, first_hit("fits", "refits")),
    "surface.cross_validation_folds": (5, first_hit("surface")),
    **{f"synthetic_specimen.{key}": (value, first_hit("specimen")) for key, value in SYNTHETIC.items()},
    "matrix.C1_MPa": (0.03, first_hit("tissue")),
    "matrix.lame_lambda_MPa": (0.4, first_hit("tissue")),
    "tissue.surface_protocol": ("small", of_runs("hgo_surface")),
    # With the law as printed there is no problem that FEBio could be given.
    "tissue.tension_only": (False, lambda: as_printed() - files_of(quick_config(), "febio")),
    "tissue.linear_solver": ("direct", first_hit("tissue")),
}
# Which networks, protocols and models there are, and whose, is the subject of tests of their own.
OF_THEIR_OWN = {
    "network", "network_files", "delaunay.networks", "delaunay.batches", "specimen", "specimen_files", "tissue.batches",
    "tissue.protocol", "tissue.load_set", "tissue.update", "tissue.refit_rounds", "tissue.models",
}  # fmt: skip


@pytest.mark.parametrize("key", CHANGES)
def test_a_change_of_one_parameter_reruns_exactly_what_depends_on_it(quick, key):
    value, dependent = CHANGES[key]
    value = value() if callable(value) else value
    for part in reversed(key.split(".")):
        value = {part: value}
    assert would_run(quick[0], value) == dependent()


def test_more_networks_leave_the_named_ones_alone(quick):
    """Batch 00 gets one network more, so that it and the new shares of the others are made again."""
    found = would_run(quick[0], {"delaunay": {"networks": 31, "batches": 3}})
    assert not any("named" in path or "figure_3" in path or "figure_5" in path for path in found)
    assert {f"results/networks/delaunay/0{batch}.nc" for batch in range(3)} <= found


def test_the_changes_speak_of_every_key():
    keys = set()
    for key, value in yaml.safe_load(DEFAULT.read_text(encoding="utf-8")).items():
        keys |= {f"{key}.{inner}" for inner in value} if isinstance(value, dict) else {key}
    assert keys - OF_THEIR_OWN == set(CHANGES)


def outdated(before: dict, after: dict) -> set[str]:
    """Files of the study of `after` that one of `before` lacks or made with other params."""
    made = {path: stage_params(stage, before, wildcards) for path, stage, wildcards in expected_files(before)}
    return {
        path
        for path, stage, wildcards in expected_files(after)
        if made.get(path) != stage_params(stage, after, wildcards)
    }


def changed(config: dict, **tissue) -> dict:
    return validated({**config, "tissue": {**config["tissue"], **tissue}})


def initial_fits(config: dict) -> set[str]:
    fitted = {model["name"] for model in config["tissue"]["models"] if model.get("constants") == "fit"}
    return {path for name in fitted for path in files_of(config, "tissue", run=name)}


def test_constants_from_another_load_set_or_protocol_rerun_the_initial_runs_and_what_follows():
    before = quick_config()
    before["load_sets"].append({"name": "tension", "loads": ["x_uniaxial", "xy_biaxial"]})
    before["protocols"].append({**before["protocols"][2], "name": "again", "ensembles": ["tissue"]})
    initial = initial_fits(before)
    assert len(initial) == 8
    found = outdated(before, changed(before, load_set="tension"))
    of_surface = files_of(before, "tissue", run="hgo_surface")
    assert found == downstream(before, initial | of_surface | files_of(before, "case_study"))
    assert outdated(before, changed(before, protocol="again")) == downstream(before, initial)


def test_another_model_leaves_the_others_alone():
    before = quick_config()
    models = [dict(model) for model in before["tissue"]["models"]]
    models[3] |= {"name": "own"}
    found = outdated(before, changed(before, models=models))
    runs = {path for path in found if path.startswith("results/tissue/")}
    assert runs == {f"results/tissue/own{refit}.{ending}" for refit in ("", "_refit") for ending in ("nc", "vtu")}
    assert not any("networks" in path or "fits/tissue/section_2_6" in path for path in found)


def test_more_rounds_add_runs_and_change_none():
    before = quick_config()
    found = outdated(before, changed(before, refit_rounds=2))
    assert {path for path in found if path.endswith(".nc") and "/tissue/" in path and "curves" not in path} == {
        f"results/tissue/{name}_refit_2.nc" for name in ("hgo", "structure_tensor", "families", "stress")
    }
    assert "results/fits/tissue/refit_hgo_refit.csv" in found
    assert "results/fits/tissue/refit_hgo.csv" not in found


def test_more_batches_of_element_networks_give_the_same_bits(quick, tmp_path):
    change = {"tissue": {"batches": 3}}
    wanted = [f"results/networks/tissue/0{batch}.nc" for batch in range(3)]
    done = snakemake(tmp_path, "-j2", *wanted, configs=(QUICK, written(tmp_path, change)))
    assert done.returncode == 0, done.stderr
    whole = xr.concat(
        [
            xr.load_dataset(quick[0] / f"results/networks/tissue/0{batch}.nc", engine="h5netcdf")["structure_tensor"]
            for batch in range(2)
        ],
        "network",
    )
    parts = xr.concat(
        [xr.load_dataset(tmp_path / path, engine="h5netcdf")["structure_tensor"] for path in wanted], "network"
    )
    assert parts.values.tobytes() == whole.values.tobytes()


def test_lagged_constants_need_no_curves_of_refits(quick):
    found = would_run(quick[0], {"tissue": {"update": "lagged"}})
    assert not any("refit_" in path and path.startswith("results/curves") for path in found)
    assert {f"results/tissue/{name}_refit.nc" for name in ("hgo", "structure_tensor", "families", "stress")} <= found
    assert "results/tissue/hgo.nc" not in found


@pytest.mark.parametrize(
    ("source", "first", "spared"),
    [
        ("networks/generation.py", {"networks"}, {"specimen", "figure_7"}),
        ("networks/equilibrium.py", {"curves", "states"}, {"networks", "specimen", "figure_7"}),
        ("fitting/hgo.py", {"fits"}, {"networks", "curves", "states", "specimen", "figure_7"}),
        ("fitting/surface.py", {"surface"}, {"networks", "curves", "states", "fits", "figure_3", "figure_7"}),
        ("fe/assembly.py", {"tissue"}, {"networks", "curves", "fits", "specimen", "surface", "case_study"}),
        ("specimen.py", {"specimen"}, {"surface", "case_study", "figure_7"}),
        ("hybrid.py", set(), set(STAGES)),
        ("study/convergence.py", {"convergence"}, set(STAGES) - {"convergence"}),
        ("figures/figure_3.py", {"figure_3"}, set(STAGES) - {"figure_3"}),
        ("networks/three_fibers.py", {"figure_7"}, set(STAGES) - {"figure_7"}),
        ("datasets.py", set(STAGES), set()),
    ],
)
def test_a_change_of_a_source_reruns_what_uses_it(quick, tmp_path, monkeypatch, source, first, spared):
    sources = shutil.copytree(provenance.ROOT, tmp_path / "fibrous")
    with open(sources / source, "a") as stream:
        stream.write("# changed\n")
    provenance.code_hash.cache_clear()
    monkeypatch.setattr(provenance, "ROOT", sources)
    found = would_run(quick[0], {})
    provenance.code_hash.cache_clear()
    assert files_of(quick_config(), *first) <= found
    assert not files_of(quick_config(), *spared) & found


@pytest.mark.parametrize(
    "target",
    [
        "figure_3",
        "figure_5",
        "figure_6",
        "figure_7",
        "figure_8",
        "figure_specimen",
        "table_1",
        "networks",
        "curves",
        "fits",
        "specimen",
        "tissue",
        "case_study",
    ],
)
def test_a_named_target_makes_its_own_files(tmp_path, target):
    found = would_run(tmp_path, {}, target)
    own = {"table_1": "surface"}.get(target, target)
    assert files_of(quick_config(), own) <= found
    if target in ("figure_3", "figure_5"):
        assert not any("delaunay" in path for path in found)
    if target in ("networks", "figure_7"):
        # The tissue's networks are those of its elements.
        assert found - files_of(quick_config(), "specimen") == files_of(quick_config(), target)
    if target in ("figure_3", "figure_5", "figure_6", "table_1", "case_study", "figure_8"):
        assert not any("tissue" in path for path in found)


def test_networks_and_curves_do_not_depend_on_batches_or_jobs(quick, tmp_path):
    """Three batches one after the other in the place of two at once, and fewer networks in all."""
    wanted = [f"results/curves/delaunay/small/0{batch}.nc" for batch in range(3)] + ["results/curves/named/small/00.nc"]
    done = snakemake(tmp_path, "-j1", *wanted, configs=(QUICK, written(tmp_path, SMALL)))
    assert done.returncode == 0, done.stderr
    for path in [*wanted, *(path.replace("curves", "networks").replace("/small", "") for path in wanted)]:
        here = xr.load_dataset(tmp_path / path, engine="h5netcdf")
        there = xr.load_dataset((quick[0] / path).with_name("00.nc"), engine="h5netcdf")
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
        lambda: [child for child in psutil.Process(run.pid).children() if "fibrous.study.job" in line_of(child)]
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


def test_a_users_network_gets_its_curves_and_fits(tmp_path, monkeypatch):
    own = written(tmp_path, own_network(tmp_path))
    done = snakemake(tmp_path, "-j2", configs=(own,))
    assert done.returncode == 0, done.stderr
    monkeypatch.chdir(tmp_path)
    assert check(loaded(own), Path())[0] == []
    with open("nodes.csv", "a") as stream:
        stream.write("0.5,0.5,0.0\n")
    assert len(check(loaded(own), Path())[0]) == len(list(expected_files(loaded(own))))
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
    assert (tmp_path / "logs/networks/file/00.log").read_text() == f"{lines[0]}\n"
    assert not list((tmp_path / "results").rglob("*.nc"))
