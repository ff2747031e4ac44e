"""Trials of many networks summed up: medians and ranges over seeds, at every value of every factor.

Trials are rows of the table `sensitivity_trials` of the schema; `network` is an alignment's name. Trials of the base,
at the study's own values, have the factor BASE and no value.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

BASE = "base"
QUANTITIES = ("C2_MPa", "C3", "r_squared", "stress_error")
CASE = ["network", "load_set"]
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
    keys = ["factor", "value", *CASE]
    groups = trials.groupby(keys, sort=False)
    columns = {"is_base": groups["is_base"].first(), "replicates": groups["replicate"].nunique()}
    for quantity in QUANTITIES:
        name, unit = _name_and_unit(quantity)
        values = groups[quantity]
        columns |= {
            f"{name}_median{unit}": values.median(),
            f"{name}_least{unit}": values.min(),
            f"{name}_largest{unit}": values.max(),
        }
    table = pd.DataFrame(columns).reset_index()
    for quantity in QUANTITIES:
        name, unit = _name_and_unit(quantity)
        median = f"{name}_median{unit}"
        own = table[table["is_base"]].set_index(["factor", *CASE])[median]
        of_base = own.reindex(pd.MultiIndex.from_frame(table[["factor", *CASE]])).to_numpy()
        table[f"{name}_over_base"] = table[median] / np.where(of_base == 0.0, np.nan, of_base)
    for count in (*FAILED, "loads_limited"):
        table[count] = groups[count].sum().to_numpy()
    return table


def _name_and_unit(quantity: str) -> tuple[str, str]:
    """A quantity's name without its unit, and the ending that says the unit."""
    name = quantity.removesuffix("_MPa")
    return name, quantity.removeprefix(name)
