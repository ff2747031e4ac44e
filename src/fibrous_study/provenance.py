"""Where a result comes from: the config and the sources that made it, and what it cost."""

from __future__ import annotations

import ast
import hashlib
import json
import os
import platform
import re
import resource
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

SOURCES = Path(__file__).parents[1]
PACKAGES = ("fibrous", "fibrous_study")
SIDE_BY_SIDE = ("fibrous_study/steps", "fibrous_study/figures")  # each module a room of its own
LATER = re.compile(r'"([\w.]+):\w+"')  # what is imported when it is asked for, as "fibrous.materials.hgo:HGOFamilies"
WORDS = ("fibrous_study.schema",)  # what files are said to hold: results depend on it only where a step uses it
# Of the checkout; any other commit would make the report again and change nothing in it.
RESULTS_OF = ("Snakefile", "config", "src", "workflow")
RECORDED = ("numpy", "scipy", "xarray", "numba", "matplotlib", "snakemake")


def config_hash(config: Mapping[str, Any]) -> str:
    """SHA-256 of the config as sorted JSON, 16 hexadecimal digits."""
    return hashlib.sha256(json.dumps(config, sort_keys=True).encode()).hexdigest()[:16]


@cache
def code_hash(module: str) -> str:
    """SHA-256 over the rooms that `module` and what it imports live in, with their templates and data, 16 digits."""
    digest = hashlib.sha256()
    for path in sorted({path for name in imported(module) for path in room(name)}):
        digest.update(f"{path.relative_to(SOURCES)}\0".encode() + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def room(module: str) -> list[Path]:
    """Files that change together with a module: those of its package, or its file where modules stand side by side."""
    path = _path(module)
    alone = path.parent in [SOURCES / name for name in (*PACKAGES, *SIDE_BY_SIDE)]
    return [path] if alone else [one for one in path.parent.iterdir() if one.is_file()]


def imported(module: str) -> set[str]:
    """`module` and all modules of these packages that its module-level imports, or names like `module:class`, reach."""
    reached: set[str] = set()
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name in reached:
            continue
        reached.add(name)
        text = _path(name).read_text(encoding="utf-8")
        waiting += filter(_is_module, LATER.findall(text))
        for node in ast.parse(text).body:
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.module:
                inner = [f"{node.module}.{alias.name}" for alias in node.names]
                names = [one if _is_module(one) else node.module for one in inner]
            else:
                continue
            waiting += [one for one in names if _is_module(one) and (name == module or one not in WORDS)]
    return reached


def _path(module: str) -> Path:
    path = SOURCES.joinpath(*module.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def _is_module(name: str) -> bool:
    return name.split(".")[0] in PACKAGES and _path(name).is_file()


def attributes(params: Mapping[str, Any]) -> dict[str, Any]:
    """Stage, config and its hash, code hash, seed, versions, machine, CPU seconds, peak memory in MB of a result.

    `params` holds `stage` (the module of a step or figure), its part of the config as `config`, `code_hash`, in a run
    of the workflow the whole config as `study_config`, which is recorded but not hashed, and as `cpu_seconds_before`
    what a process spent that this one goes on from. What a stage has `measured` stands beside all of that.
    """
    config, study = params["config"], json.loads(params.get("study_config", "{}"))
    own, children = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    kibibytes = 1 if sys.platform != "darwin" else 1024
    return {
        "stage": params["stage"],
        "config": json.dumps(config, sort_keys=True),
        "config_hash": config_hash(config),
        **({"study_config": params["study_config"]} if study else {}),
        "code_hash": params["code_hash"],
        "seed": config.get("seed", study.get("seed", -1)),
        "versions": json.dumps(versions()),
        "machine": machine(),
        "cpu_seconds": cpu_seconds() + params.get("cpu_seconds_before", 0.0),
        **params.get("measured", {}),
        "peak_memory_MB": max(own.ru_maxrss, children.ru_maxrss) / kibibytes / 1024,
    }


def commit(checkout: Path) -> str:
    """The last commit of `checkout` that touched what results are made of, and whether that has changed since.

    Says so where it is no git checkout, as in an archive of the sources.
    """

    def git(*words: str) -> str:
        line = ["git", "-C", str(checkout), *words, "--", *RESULTS_OF]
        return subprocess.run(line, capture_output=True, text=True, check=True).stdout.strip()

    try:
        last, changed = git("log", "-1", "--format=%H"), git("status", "--porcelain", "-uno")
    except (OSError, subprocess.CalledProcessError):
        last, changed = "", ""
    return (last or "not a git checkout") + (" with changes since" if changed else "")


def digest(path: Path) -> str:
    """SHA-256 of a file's content."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def record(path: Path, params: Mapping[str, Any], inputs: Mapping[str, str], job: str) -> None:
    """Write what made a file: its stage, config and code, its SHA-256, that of each input as read, and its job's name.

    All files of one job name the same job.
    """
    content = {
        "file": str(path),
        "sha256": digest(path),
        "job": job,
        **{key: params[key] for key in ("stage", "config", "code_hash")},
        "inputs": dict(inputs),
    }
    place = record_of(path)
    place.parent.mkdir(parents=True, exist_ok=True)
    beside = place.with_suffix(f".{os.getpid()}")
    beside.write_text(json.dumps(content, indent=1), encoding="utf-8")
    beside.replace(place)


def recorded(path: Path) -> dict[str, Any] | None:
    """The record of a file as `record` wrote it; nothing where there is none that can be read."""
    with suppress(OSError, ValueError):
        found = json.loads(record_of(path).read_text(encoding="utf-8"))
        if isinstance(found, dict) and {"file", "sha256", "job", "stage", "config", "code_hash", "inputs"} <= set(
            found
        ):
            return found
    return None


def record_of(path: Path) -> Path:
    """Where the record of a file is.

    >>> str(record_of(Path("results/tissue/hgo.nc")))
    'results/provenance/tissue/hgo.nc.json'
    """
    root = next((parent for parent in path.parents if parent.name == "results"), path.parent)
    return root / "provenance" / f"{path.relative_to(root)}.json"


@cache
def machine() -> str:
    """Model of the processor and how many of its cores this process may use."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return f"{line.partition(':')[2].strip()}, {cores} cores"
    return f"{platform.processor() or platform.machine()}, {cores} cores"


def cpu_seconds() -> float:
    """CPU seconds that this process and its children have spent."""
    usages = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def versions() -> dict[str, str]:
    """Versions of Python and the libraries on which numbers depend."""
    return {"python": platform.python_version(), **{name: _version(name) for name in RECORDED}}


@cache
def _version(name: str) -> str:
    try:
        return version(name)
    except ModuleNotFoundError:
        return "absent"
