"""Where a result comes from: the config and the sources that made it, and what it cost."""

from __future__ import annotations

import ast
import hashlib
import json
import os
import platform
import resource
import sys
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

SOURCES = Path(__file__).parents[1]
PACKAGES = ("fibrous", "fibrous_study")
RECORDED = ("numpy", "scipy", "xarray", "numba", "matplotlib", "snakemake")


def config_hash(config: Mapping[str, Any]) -> str:
    """SHA-256 of the config as sorted JSON, 16 hexadecimal digits."""
    return hashlib.sha256(json.dumps(config, sort_keys=True).encode()).hexdigest()[:16]


@cache
def code_hash(module: str) -> str:
    """SHA-256 over the sources of `module` and of every module of these packages that it imports, 16 digits."""
    digest = hashlib.sha256()
    for name in sorted(imported(module)):
        digest.update(name.encode() + b"\0" + _path(name).read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def imported(module: str) -> set[str]:
    """`module` and all modules of these packages that its module-level imports reach."""
    reached: set[str] = set()
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name in reached:
            continue
        reached.add(name)
        waiting.append(name.rpartition(".")[0] or name)
        for node in ast.parse(_path(name).read_text(encoding="utf-8")).body:
            if isinstance(node, ast.Import):
                waiting += [alias.name for alias in node.names if _is_module(alias.name)]
            elif isinstance(node, ast.ImportFrom) and node.module and _is_module(node.module):
                inner = [f"{node.module}.{alias.name}" for alias in node.names]
                waiting += [node.module, *(name for name in inner if _is_module(name))]
    return reached


def _path(module: str) -> Path:
    path = SOURCES.joinpath(*module.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def _is_module(name: str) -> bool:
    return name.split(".")[0] in PACKAGES and _path(name).is_file()


def attributes(params: Mapping[str, Any]) -> dict[str, Any]:
    """Stage, config and its hash, code hash, seed, versions, machine, CPU seconds, peak memory in MB of a result.

    `params` holds `stage` (a module of fibrous_study or fibrous_study.figures), its part of the config as `config`,
    `code_hash`, in a run of the workflow the whole config as `study_config`, which is recorded but not hashed, and as
    `cpu_seconds_before` what a process spent that this one goes on from. What a stage has `measured` stands beside all
    of that.
    """
    config = params["config"]
    own, children = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    kibibytes = 1 if sys.platform != "darwin" else 1024
    return {
        "stage": params["stage"],
        "config": json.dumps(config, sort_keys=True),
        "config_hash": config_hash(config),
        **({"study_config": params["study_config"]} if "study_config" in params else {}),
        "code_hash": params["code_hash"],
        "seed": config.get("seed", -1),
        "versions": json.dumps(versions()),
        "machine": machine(),
        "cpu_seconds": cpu_seconds() + params.get("cpu_seconds_before", 0.0),
        **params.get("measured", {}),
        "peak_memory_MB": max(own.ru_maxrss, children.ru_maxrss) / kibibytes / 1024,
    }


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
