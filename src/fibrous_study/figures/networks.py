"""Networks as figures draw them, out of the ragged arrays of their files."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from fibrous.errors import DatasetError


def index_of(networks: xr.Dataset, name: str) -> int:
    """Where the network of that name stands. Raises DatasetError where none or several have it."""
    found = np.flatnonzero(networks["name"].values == name)
    if found.size != 1:
        raise DatasetError(f"the networks hold {found.size} named '{name}' where the figure draws one")
    return int(found[0])


def fibers_of(networks: xr.Dataset, index: int) -> NDArray[np.float64]:
    """Ends of the fibres of the network that stands there, shape (fibers, 2, 3), edges."""
    rows = {}
    for dim in ("node", "fiber"):
        counts = networks[f"{dim}_count"].values
        rows[dim] = slice(int(counts[:index].sum()), int(counts[: index + 1].sum()))
    nodes = networks["node_position"].values[rows["node"]]
    return np.asarray(nodes[networks["fiber_nodes"].values[rows["fiber"]]])
