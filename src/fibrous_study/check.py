"""Whether the results on disk are those that the present config and code would make, and as their jobs left them.

Snakemake says which files the study has and which job makes each; the record beside the results says what made them.
No past runs are asked, so this works on a copied folder too.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from fibrous.errors import ConfigError
from fibrous_study.config import PROJECT
from fibrous_study.job import FOLDER
from fibrous_study.provenance import digest, record_of, recorded

REPORT = "results/report.html"  # of every study but of one of a user's own networks, which makes nothing on demand
ON_DEMAND = ("paper", "microstructure", "sensitivity")
COMPANIONS = (".csv", ".vtu", ".feb", ".html")  # have what NetCDF holds of its making beside them, as {file}.json
LEFT = {
    ".failed.nc": "the converged part of a run that failed",
    ".checkpoint": "of a run that was stopped, which the next one goes on from",
}
JOB = re.compile(rf"{re.escape(str(FOLDER))}/\w+\.json")


def check(override: Path | None, folder: Path) -> tuple[list[str], int]:
    """One line for every file under `folder`/results that is stale, changed by hand, missing or of no rule.

    Also returns the number of files that the study has. `override` is a config file laid over the default one. Raises
    ConfigError where Snakemake cannot say what the study is.
    """
    made_by = _outputs(jobs(override, folder, "all"))
    if REPORT in made_by and any(_foreign(folder, made_by)):
        on_demand = _outputs(jobs(override, folder, *ON_DEMAND))
        made_by = {path: job for path, job in on_demand.items() if (folder / path).is_file()} | made_by
    digests = Digests(folder)
    faults = {path: _fault(folder, path, job, digests) for path, job in made_by.items()}
    lines = [f"{path}: {fault}" for path, fault in faults.items() if fault]
    return [*lines, *_foreign(folder, made_by)], len(made_by)


def jobs(override: Path | None, folder: Path, *targets: str) -> list[dict[str, Any]]:
    """What each job of the study is handed, with its `inputs` and `outputs` by name, as a dry run tells them."""
    line = [sys.executable, "-m", "snakemake", "-s", str(PROJECT / "Snakefile"), "--directory", str(folder)]
    line += ["--dry-run", "--forceall", "--printshellcmds", "--cores", "1"]
    line += ["--configfile", str(override.resolve())] if override else []
    done = subprocess.run([*line, "--", *targets], capture_output=True, text=True)
    if done.returncode:
        raise ConfigError((done.stderr.strip() or done.stdout.strip()).splitlines()[-1].strip())
    paths = dict.fromkeys(JOB.findall(done.stdout + done.stderr))
    return [json.loads((folder / path).read_text(encoding="utf-8")) for path in paths]


def _outputs(jobs: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    return {path: job for job in jobs for path in job["outputs"].values()}


class Digests(dict[str, str]):
    """SHA-256 of the files of a folder by their paths, each worked out once; empty for a file that is not there."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __missing__(self, path: str) -> str:
        place = self.folder / path
        self[path] = digest(place) if place.is_file() else ""
        return self[path]


def _fault(folder: Path, path: str, job: Mapping[str, Any], digests: Digests) -> str:
    """What is wrong with the file, in words; nothing where it is as its job would make it."""
    if not digests[path]:
        return "missing"
    made = recorded(folder / path)
    if made is None:
        return f"unknown, nothing at {record_of(Path(path))} says how it was made"
    if made["stage"] != job["stage"]:
        return f"foreign, written by {made['stage']}"
    if made["sha256"] != digests[path]:
        return "changed by hand, not the content that its job wrote"
    reasons = []
    if made["config"] != job["config"]:
        reasons.append(_difference(made["config"], job["config"], ""))
    if made["code_hash"] != job["code_hash"]:
        reasons.append(f"the sources of {job['stage']} have changed")
    inputs = [source for paths in job["inputs"].values() for source in paths]
    other = next((source for source in inputs if made["inputs"].get(source) != digests[source]), "")
    if other:
        reasons.append(f"made from another content of {other}")
    return f"stale, {' and '.join(reasons)}" if reasons else ""


def _foreign(folder: Path, made_by: Mapping[str, Any]) -> Iterator[str]:
    """A line for every file under results that no job of the study writes."""
    known = {*made_by, *(str(record_of(Path(path))) for path in made_by)}
    known |= {f"{path}.json" for path in made_by if path.endswith(COMPANIONS)}
    for place in sorted((folder / "results").rglob("*")):
        path = str(place.relative_to(folder))
        if place.is_file() and path not in known:
            words = (meaning for ending, meaning in LEFT.items() if path.endswith(ending))
            yield f"{path}: {next(words, 'foreign, no rule of this study writes it')}"


def _difference(before: Any, now: Any, path: str) -> str:
    """The first place where two configs differ, in words."""
    if isinstance(before, dict) and isinstance(now, dict):
        for key in [*now, *before]:
            if before.get(key) != now.get(key) or (key in before) != (key in now):
                return _difference(before.get(key), now.get(key), f"{path}.{key}".lstrip("."))
    if isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        for i, (old, new) in enumerate(zip(before, now, strict=True)):
            if old != new:
                return _difference(old, new, f"{path}[{i}]")
    return f"made with {path} = {_short(before)} where the config now says {_short(now)}"


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
