"""Trials of many networks summed up: medians and ranges over seeds, at every value of every factor.

Trials are rows of the table `sensitivity_trials` of the schema; `network` is an alignment's name. Trials of the base,
at the study's own values, have the factor BASE and no value.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

BASE, SHEAR, SEEDS = "base", "shear_directions", "seeds"
CASE = ["network", "load_set"]
NAMES_AND_UNITS = (("C2", "_MPa"), ("C3", ""), ("r_squared", ""), ("stress_error", ""))
QUANTITIES = tuple(f"{name}{unit}" for name, unit in NAMES_AND_UNITS)
FAILED = ("states_failed", "judged_states_failed")


def completed(tables: Sequence[pd.DataFrame], own_values: Mapping[str, float]) -> pd.DataFrame:
    """The trials of every factor with those of the base at its own value, by factor as in `own_values`, then value.

    `own_values` holds the study's own value of each factor. A column `is_base` tells the base's trials.
    """
    trials = pd.concat(tables, ignore_index=True)
    base = trials[trials["factor"] == BASE]
    tables = [
        pd.concat(
            [
                base.assign(factor=factor, value=own, is_base=True),
                trials[trials["factor"] == factor].assign(is_base=False),
            ]
        ).sort_values("value", kind="stable")
        for factor, own in own_values.items()
    ]
    return pd.concat(tables, ignore_index=True)


def summary(trials: pd.DataFrame) -> pd.DataFrame:
    """One row for each factor, value, network and load set of `completed` trials, in their order.

    Of each quantity the median, the least and the largest over replicates, and the ratio of the median to the base's,
    NaN where that is 0. States that failed are summed up.
    """
    groups = trials.groupby(["factor", "value", *CASE], sort=False)
    columns = {"is_base": groups["is_base"].first(), "replicates": groups["replicate"].nunique()}
    for name, unit in NAMES_AND_UNITS:
        values = groups[f"{name}{unit}"]
        for of, reduced in {"median": values.median(), "least": values.min(), "largest": values.max()}.items():
            columns[f"{name}_{of}{unit}"] = reduced
    table = pd.DataFrame(columns).reset_index()
    bases = table[table["is_base"]].set_index(["factor", *CASE])
    keys = pd.MultiIndex.from_frame(table[["factor", *CASE]])
    for name, unit in NAMES_AND_UNITS:
        median = f"{name}_median{unit}"
        of_base = bases[median].reindex(keys).to_numpy()
        table[f"{name}_over_base"] = table[median] / np.where(of_base == 0.0, np.nan, of_base)
    for count in (*FAILED, "loads_limited"):
        table[count] = groups[count].sum().to_numpy()
    return table


def moves(table: pd.DataFrame) -> pd.DataFrame:
    """How far the medians of a `summary` move with each factor and, of the base, with the load set, and by seeds alone.

    A row for each of these and each quantity. A case is a network under a load set, or a network where load sets are
    compared. It moves by its largest less its least median, beyond seeds where that is more than the base's networks
    are apart. A row names the case that moves most among those beyond seeds, or among all; where none moves, the one
    whose seeds are farthest apart. The columns are those of documentation.TABLES without `sentence`.
    """
    base = table[table["is_base"] & (table["factor"] == table["factor"].iloc[0])]
    parts = [(str(factor), part.assign(at=part["value"])) for factor, part in table.groupby("factor", sort=False)]
    parts += [(SHEAR, base.assign(at=base["load_set"], load_set="")), (SEEDS, base.assign(at=""))]
    return pd.DataFrame({"factor": factor, **_move(part, *of)} for factor, part in parts for of in NAMES_AND_UNITS)


def _move(table: pd.DataFrame, name: str, unit: str) -> dict[str, Any]:
    """How the medians of one quantity move with the column `at`."""
    median, least, largest = (f"{name}_{of}{unit}" for of in ("median", "least", "largest"))
    medians = table.set_index([*CASE, "at"])[median].unstack("at")
    # Where load sets are compared, seeds count under the one in which they are farthest apart.
    seeds = table[table["is_base"]].assign(spread=table[largest] - table[least])
    seeds = seeds.sort_values("spread", ascending=False, kind="stable").drop_duplicates(CASE).set_index(CASE)
    size, spread = medians.max(axis=1) - medians.min(axis=1), seeds["spread"].reindex(medians.index)
    beyond = size > spread
    among = size[beyond] if beyond.any() else size if size.max() > 0.0 else spread
    network, load_set = among.index[int(np.argmax(among.fillna(0.0)))]
    of_case, of_seeds = medians.loc[(network, load_set)], seeds.loc[(network, load_set)]
    return {
        "quantity": f"{name}{unit}",
        "cases": len(size),
        "beyond_seeds": int(beyond.sum()),
        "network": network,
        "load_set": load_set,
        "least": of_case.min(),
        "least_at": of_case.fillna(np.inf).idxmin(),
        "largest": of_case.max(),
        "largest_at": of_case.fillna(-np.inf).idxmax(),
        "seeds_least": of_seeds[least],
        "seeds_largest": of_seeds[largest],
        "states_failed": int(table[list(FAILED)].to_numpy().sum()),
    }
