"""Runs of the workflow that its tests share."""

import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import yaml
from snakemake.api import SnakemakeApi
from snakemake.settings.types import ConfigSettings, DAGSettings, OutputSettings, Quietness, ResourceSettings

from fibrous_study.config import PROJECT, loaded

QUICK = PROJECT / "config" / "quick.yaml"
# The smallest ensemble for which Eq. 11 can be cross-validated, cut into more batches than the quick one.
SMALL = {"delaunay": {"networks": 12, "batches": 3}, "surface": {"cross_validation_folds": 6}}
ON_DEMAND = ("microstructure", "sensitivity")


def command_line(*arguments: str, configs: tuple[Path, ...] = (QUICK,)) -> list[str]:
    options = [argument for argument in arguments if argument.startswith("-")]
    targets = [argument for argument in arguments if not argument.startswith("-")]
    line = [sys.executable, "-m", "snakemake", "-s", str(PROJECT / "Snakefile"), *options]
    return [*line, "--configfile", *map(str, configs), "--", *targets]


def snakemake(folder: Path, *arguments: str, configs: tuple[Path, ...] = (QUICK,)) -> subprocess.CompletedProcess:
    line = command_line(*arguments, configs=configs)
    return subprocess.run(line, cwd=folder, capture_output=True, text=True, timeout=600)


def job_line(folder: Path, content: dict, *options: str) -> list[str]:
    """The command of one job, with files in `folder` that say what it has to do."""
    job, config = folder / "job.json", folder / "config.json"
    job.write_text(json.dumps(content))
    config.write_text("{}")
    return [sys.executable, "-m", "fibrous_study.job", str(job), "--config", str(config), *options]


def written(folder: Path, change: dict, name: str = "own.yaml") -> Path:
    path = folder / name
    path.write_text(yaml.safe_dump(change))
    return path


def would_run(folder: Path, change: dict, *targets: str) -> set[str]:
    """The files that a dry run in `folder` with `change` laid over the quick config would make."""
    files: list[str] = []
    settings = ConfigSettings(config=change, configfiles=[QUICK])
    with SnakemakeApi(OutputSettings(quiet={Quietness.ALL})) as api:
        workflow = api.workflow(ResourceSettings(cores=2), settings, snakefile=PROJECT / "Snakefile", workdir=folder)
        dag = workflow.dag(DAGSettings(targets=frozenset(targets)))
        dag.execute_workflow(executor="dryrun", updated_files=files)
    return set(files)


@dataclass(frozen=True)
class Job:
    """One job of a study: its rule and wildcards, and what it is handed."""

    rule: str
    wildcards: Mapping[str, str]
    content: Mapping[str, Any]

    @property
    def outputs(self) -> set[str]:
        return set(self.content["outputs"].values())

    @property
    def inputs(self) -> set[str]:
        return {path for paths in self.content["inputs"].values() for path in paths}

    @property
    def params(self) -> dict[str, Any]:
        return {key: self.content[key] for key in ("stage", "config", "code_hash")}


def jobs_of(config: dict, *targets: str, folder: Path | None = None) -> list[Job]:
    """Jobs of the whole study of a validated config, or of some targets, as Snakemake plans them in an empty folder.

    `folder` holds a user's own files.
    """
    return _jobs(json.dumps(config), targets, folder)


@cache
def _jobs(config: str, targets: tuple[str, ...], own: Path | None) -> list[Job]:
    with tempfile.TemporaryDirectory() as empty, SnakemakeApi(OutputSettings(quiet={Quietness.ALL})) as api:
        folder = own or Path(empty)
        (folder / "whole.yaml").write_text(config)  # JSON is YAML, too
        settings = ConfigSettings(configfiles=[folder / "whole.yaml"])
        workflow = api.workflow(ResourceSettings(cores=2), settings, snakefile=PROJECT / "Snakefile", workdir=folder)
        dag = workflow.dag(DAGSettings(targets=frozenset(targets), forceall=True))
        dag.execute_workflow(executor="dryrun")
        planned = [job for job in workflow._workflow.dag.jobs if job.params]
        return [
            Job(job.rule.name, dict(job.wildcards.items()), json.loads((folder / job.params.job).read_text()))
            for job in planned
        ]


def job_of(config: dict, rule: str, **wanted: str) -> Job:
    """The job of a rule with these wildcards, in the whole study or on demand."""
    for targets in ((), *((target,) for target in ON_DEMAND)):
        for job in jobs_of(config, *targets):
            if job.rule == rule and all(job.wildcards.get(name) == value for name, value in wanted.items()):
                return job
    raise LookupError(f"{rule} with {wanted}")


def files_of(config: dict, *rules: str, **wanted: str) -> set[str]:
    """Files that these rules write in the whole study, with these wildcards."""
    return {
        path
        for job in jobs_of(config)
        if job.rule in rules and all(job.wildcards.get(name, value) == value for name, value in wanted.items())
        for path in job.outputs
    }


def all_files(config: dict, folder: Path | None = None) -> set[str]:
    """Every file of the whole study."""
    return {path for job in jobs_of(config, folder=folder) for path in job.outputs}


def quick_config() -> dict:
    return loaded(QUICK)
