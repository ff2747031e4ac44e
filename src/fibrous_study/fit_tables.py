"""How tables of fits are written and read: their groups, and their columns for H."""

from __future__ import annotations

import numpy as np
import pandas as pd

SINGLE = "single"  # load set of a fit to one load
ALL = "all"  # deformation of a fit to all loads of a load set
INITIAL, REFIT = "initial", "refit"  # constants fitted to the loads of a protocol, and to the deformation they met
LOAD = "tissue"  # the only load of networks that follow their elements
TENSOR_COLUMNS = {"H11": (0, 0), "H22": (1, 1), "H33": (2, 2), "H12": (0, 1), "H13": (0, 2), "H23": (1, 2)}
# What the column `objective` says of fits that were asked for so: section 2.5 may fit a slope in place of an energy.
OBJECTIVES = {"energy": ("energy", "slope"), "stress": ("stress",)}


def fits_of(table: pd.DataFrame, energy: str, objective: str, load_set: str, deformation: str) -> pd.DataFrame:
    """The rows of one form and one group of loads."""
    return table[
        (table["energy"] == energy)
        & table["objective"].isin(OBJECTIVES[objective])
        & (table["load_set"] == load_set)
        & (table["deformation"] == deformation)
    ]


def structure_tensors(table: pd.DataFrame) -> np.ndarray:
    """H of every row, shape (rows, 3, 3)."""
    tensors = np.empty((len(table), 3, 3))
    for column, (i, j) in TENSOR_COLUMNS.items():
        tensors[:, i, j] = tensors[:, j, i] = table[column]
    return tensors
