"""Columns of numbers from a user's CSV files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from fibrous.errors import FibrousError


def read_csv(path: Path, error: type[FibrousError]) -> pd.DataFrame:
    """The table of a file, with a name for every column. Raises `error` where it cannot be read."""
    try:
        table = pd.read_csv(path, skipinitialspace=True)
    except (OSError, ValueError) as fault:
        raise error(f"{path}: not a readable CSV file ({' '.join(str(fault).split())[:120]})") from None
    if not isinstance(table.index, pd.RangeIndex):
        raise error(f"{path}: has more values in a row than names in its header; name every column")
    return table.rename(columns=lambda name: str(name).strip())


def columns(path: Path, table: pd.DataFrame, names: list[str], error: type[FibrousError]) -> NDArray[np.float64]:
    """Finite numbers of some columns, shape (rows, names). Raises `error`, naming the row at fault."""
    missing = [name for name in names if name not in table]
    if missing:
        raise error(f"{path}: lacks the column '{missing[0]}'; it needs {', '.join(names)}")
    numbers = table[names].apply(pd.to_numeric, errors="coerce").to_numpy(dtype=float)
    bad = np.argwhere(~np.isfinite(numbers))
    if bad.size:
        raise error(f"{path}: row {bad[0, 0]} has no finite number in the column '{names[bad[0, 1]]}'")
    return numbers
