"""Rule `convergence`: states without an equilibrium, and loads that ended at the limit of the principal stretch."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from fibrous_study.curve_datasets import read_curves
from fibrous_study.datasets import write_table

COLUMNS = (
    "ensemble", "protocol", "network", "name", "load", "step", "amplitude_limited", "newton_iterations",
)  # fmt: skip


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Write outputs["convergence"], one row for every unconverged state of inputs["curves"]."""
    states, _ = survey(inputs["curves"])
    write_table(states, outputs["convergence"], params, "convergence")


def survey(curves: Iterable[Path]) -> tuple[pd.DataFrame, int]:
    """The unconverged states of the files, one row each with the columns COLUMNS, and the number of limited loads.

    The files are results/curves/{ensemble}/{protocol}/{batch}.nc. Raises DatasetError where one cannot be read.
    """
    rows: list[tuple[Any, ...]] = []
    limited_loads = 0
    for path in curves:
        batch = read_curves([path])
        ensemble, protocol = path.parts[-3:-1]
        limited_loads += int(batch.amplitude_limited.sum())
        for i, j, k in np.argwhere(~batch.converged):
            state = (int(batch.numbers[i]), str(batch.names[i]), batch.loads[j], int(k))
            spent = (bool(batch.amplitude_limited[i, j]), int(batch.newton_iterations[i, j, k]))
            rows.append((ensemble, protocol, *state, *spent))
    return pd.DataFrame(rows, columns=list(COLUMNS)), limited_loads


def report(curves: list[Path]) -> list[str]:
    """Lines for the end of a run: one for every unconverged state, or that there is none, and the limited loads.

    No line where there are no curves. Raises DatasetError where a file cannot be read.
    """
    if not curves:
        return []
    states, limited_loads = survey(curves)
    lines = [
        f"not converged: network {row['network']} {row['name']}".rstrip()
        + f" of {row['ensemble']}, protocol {row['protocol']}, load {row['load']}, step {row['step']}"
        + f"{' (a load cut at principal_stretch_limit)' if row['amplitude_limited'] else ''}: left out of the fits"
        for row in states.to_dict("records")
    ]
    if not lines:
        lines = [f"every state of {len(curves)} files of curves converged"]
    return [*lines, f"{limited_loads} loads were cut at principal_stretch_limit"]
