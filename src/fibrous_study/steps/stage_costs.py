"""Rule `stage_costs`: what every stage of the study cost, and what every target costs from an empty folder."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from fibrous.errors import DatasetError
from fibrous_study import datasets
from fibrous_study.provenance import recorded

PICTURES = (".png", ".svg")  # say nothing of their cost: equal inputs give equal bytes


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Sum up what the jobs counted of themselves that wrote `files`; write `stages` and `targets`.

    The records of the files tell which of them one job wrote, and which files it read. The config holds per target the
    stages whose files it makes (`targets`). Raises DatasetError for a file without a record, or one that says nothing
    of its cost.
    """
    jobs = _jobs(inputs["files"])
    datasets.write_table(_stages(jobs), outputs["stages"], params, "stages")
    datasets.write_table(_targets(jobs, params["config"]["targets"]), outputs["targets"], params, "targets")


def _jobs(files: Iterable[Path]) -> pd.DataFrame:
    """One row per job in the order of the files: its stage and cost, and the rows of the jobs that it `reads`."""
    row_of_job: dict[str, int] = {}
    row_of_file: dict[str, int] = {}
    rows: list[dict[str, Any]] = []
    for path in files:
        made = recorded(path)
        if made is None:
            raise DatasetError(f"{path}: nothing records how it was made; delete it and run again")
        if made["job"] not in row_of_job:
            row_of_job[made["job"]] = len(rows)
            rows.append({"stage": made["stage"].rpartition(".")[2], "inputs": made["inputs"]})
        number = row_of_file[made["file"]] = row_of_job[made["job"]]
        if path.suffix not in PICTURES and "cpu_seconds" not in rows[number]:
            found = datasets.provenance_of(path)
            rows[number] |= {key: float(found[key]) for key in ("cpu_seconds", "peak_memory_MB")}
            rows[number] |= {key: str(found[key]) for key in ("machine", "versions")}
    for row in rows:
        row["reads"] = sorted({row_of_file[path] for path in row.pop("inputs") if path in row_of_file})
    return pd.DataFrame(rows)


def _stages(jobs: pd.DataFrame) -> pd.DataFrame:
    rows = []
    for stage, own in jobs.groupby("stage", sort=False):
        waited_for = jobs["stage"].iloc[sorted({other for reads in own["reads"] for other in reads})]
        rows.append(
            {
                "stage": stage,
                "reads": ", ".join(waited_for.unique()),
                "jobs": len(own),
                "cpu_seconds": own["cpu_seconds"].sum(),
                "largest_peak_memory_MB": own["peak_memory_MB"].max(),
                "machine": "; ".join(sorted(own["machine"].unique())),
                "versions": "; ".join(sorted(own["versions"].unique())),
            }
        )
    return pd.DataFrame(rows)


def _targets(jobs: pd.DataFrame, targets: Mapping[str, Sequence[str]]) -> pd.DataFrame:
    rows = []
    for target, stages in targets.items():
        own = jobs.index[jobs["stage"].isin(stages)].tolist()
        if own:
            needed = sorted(waited_for(own, jobs["reads"].tolist()))
            rows.append({"target": target, "jobs": len(needed), "cpu_seconds": jobs["cpu_seconds"].iloc[needed].sum()})
    everything = {"target": "all", "jobs": len(jobs), "cpu_seconds": jobs["cpu_seconds"].sum()}
    return pd.DataFrame([*rows, everything])


def waited_for(jobs: Sequence[int], reads: Sequence[Sequence[int]]) -> set[int]:
    """These jobs and all that they wait for.

    >>> sorted(waited_for([3], [[], [0], [], [1]]))
    [0, 1, 3]
    """
    found: set[int] = set()
    waiting = list(jobs)
    while waiting:
        job = waiting.pop()
        if job not in found:
            found.add(job)
            waiting += reads[job]
    return found
