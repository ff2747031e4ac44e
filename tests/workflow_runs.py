"""Runs of the workflow that its tests share."""

import json
import subprocess
import sys
from pathlib import Path

import yaml
from snakemake.api import SnakemakeApi
from snakemake.settings.types import ConfigSettings, DAGSettings, OutputSettings, Quietness, ResourceSettings

from fibrous_study.config import PROJECT, loaded
from fibrous_study.stages import expected_files

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


def files_of(config: dict, *stages: str, **wanted: str) -> set[str]:
    return {
        path
        for path, stage, wildcards in expected_files(config)
        if stage in stages and all(wildcards.get(name, value) == value for name, value in wanted.items())
    }


def quick_config() -> dict:
    return loaded(QUICK)
