"""Rule `sum_up_costs`: what every stage of the study cost, and what every target costs from an empty folder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from fibrous_study import datasets


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Sum up what the processes counted of themselves that wrote `files`, one of each job; write `stages`, `targets`.

    The config holds per job its stage (`stages`) and the numbers of the jobs that it waits for (`reads`), and per
    target the stages whose files it makes (`targets`). Raises DatasetError for a file that says nothing of its cost.
    """
    config = params["config"]
    found = [datasets.provenance_of(path) for path in inputs["files"]]
    table = pd.DataFrame(
        {
            "stage": config["stages"],
            "cpu_seconds": [float(one["cpu_seconds"]) for one in found],
            "peak_memory_MB": [float(one["peak_memory_MB"]) for one in found],
            "machine": [str(one["machine"]) for one in found],
            "versions": [str(one["versions"]) for one in found],
        }
    )
    datasets.write_table(_stages(table, config["reads"]), outputs["stages"], params, "stages")
    datasets.write_table(_targets(table, config["reads"], config["targets"]), outputs["targets"], params, "targets")


def _stages(jobs: pd.DataFrame, reads: Sequence[Sequence[int]]) -> pd.DataFrame:
    rows = []
    for stage, own in jobs.groupby("stage", sort=False):
        waited_for = jobs["stage"].iloc[sorted({other for job in own.index for other in reads[job]})]
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


def _targets(jobs: pd.DataFrame, reads: Sequence[Sequence[int]], targets: Mapping[str, Sequence[str]]) -> pd.DataFrame:
    rows = []
    for target, stages in targets.items():
        needed = waited_for(jobs.index[jobs["stage"].isin(stages)].tolist(), reads)
        spent = jobs["cpu_seconds"].iloc[sorted(needed)].sum()
        rows.append({"target": target, "jobs": len(needed), "cpu_seconds": spent})
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
