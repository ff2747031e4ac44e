"""A user's own network: nodes and fibres from CSV or NetCDF files, checked before anything is made of them.

Positions are in edges of the unit cube centred on the origin. CSV: one file with columns x, y, z and, if wanted,
boundary (0 or 1), one with columns tail, head (node numbers from 0). NetCDF (NetCDF-3 or NetCDF-4): variables
node_position(node, axis), fiber_nodes(fiber, end) and, if wanted, node_is_boundary(node). Without the last, nodes on a
face are the boundary.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from fibrous.errors import DatasetError, NetworkError
from fibrous.io.netcdf import opened
from fibrous.networks.network import Network, checked

ON_FACE = 1e-9


def read_network(entry: Mapping[str, str]) -> Network:
    """The network of an entry of the config's `network_files`.

    Raises NetworkError, naming the file and the row at fault, where it is none.
    """
    if "file" in entry:
        position, fibers, boundary = _read_netcdf(Path(entry["file"]))
        where = entry["file"]
    else:
        position, boundary = _read_nodes(Path(entry["nodes"]))
        fibers = _columns(Path(entry["fibers"]), ["tail", "head"])
        where = f"{entry['nodes']} and {entry['fibers']}"
    whole = np.isfinite(fibers) & (fibers == np.round(fibers)) & (np.abs(fibers) < 2.0**53)
    if not whole.all():
        row = np.flatnonzero(~whole.all(axis=1))[0]
        raise NetworkError(f"{where}: fiber {row} has a node number that is not a whole number")
    outside = np.flatnonzero((np.abs(position) > 0.5 + ON_FACE).any(axis=1))
    if outside.size:
        raise NetworkError(
            f"{where}: node {outside[0]} lies outside the unit cube centred on the origin; "
            "give positions in edges of the cube (cube.edge_length_um says how long an edge is)"
        )
    if boundary is None:
        boundary = (np.abs(position) >= 0.5 - ON_FACE).any(axis=1)
    return checked(Network(position, boundary, fibers.astype(np.int64)), where)


def _read_nodes(path: Path) -> tuple[np.ndarray, np.ndarray | None]:
    position = _columns(path, ["x", "y", "z"])
    if "boundary" not in _table(path):
        return position, None
    return position, _flags(_columns(path, ["boundary"])[:, 0], path)


def _columns(path: Path, names: list[str]) -> np.ndarray:
    table = _table(path)
    missing = [name for name in names if name not in table]
    if missing:
        raise NetworkError(f"{path}: lacks the column '{missing[0]}'; it needs {', '.join(names)}")
    numbers = table[names].apply(pd.to_numeric, errors="coerce").to_numpy(dtype=float)
    bad = np.argwhere(~np.isfinite(numbers))
    if bad.size:
        raise NetworkError(f"{path}: row {bad[0, 0]} has no finite number in the column '{names[bad[0, 1]]}'")
    return numbers


def _table(path: Path) -> pd.DataFrame:
    try:
        table = pd.read_csv(path, skipinitialspace=True)
    except (OSError, ValueError) as error:
        raise NetworkError(f"{path}: not a readable CSV file ({' '.join(str(error).split())[:120]})") from None
    if not isinstance(table.index, pd.RangeIndex):
        raise NetworkError(f"{path}: has more values in a row than names in its header; name every column")
    return table.rename(columns=lambda name: str(name).strip())


def _read_netcdf(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    try:
        with opened(path, "network_files in the config names it", "save it anew as NetCDF-3 or NetCDF-4") as dataset:
            dataset.load()
    except DatasetError as error:
        raise NetworkError(str(error)) from None
    for name, columns in (("node_position", 3), ("fiber_nodes", 2)):
        if name not in dataset:
            raise NetworkError(f"{path}: lacks the variable '{name}'")
        if dataset[name].ndim != 2 or dataset[name].shape[1] != columns or dataset[name].dtype.kind not in "iuf":
            found = f"{dataset[name].dtype} of {dataset[name].shape}"
            raise NetworkError(f"{path}: '{name}' needs numbers of shape (…, {columns}), not {found}")
    if dataset.sizes.get("network", 1) != 1:
        raise NetworkError(f"{path}: holds {dataset.sizes['network']} networks; give one file a network")
    position = dataset["node_position"].to_numpy().astype(float)
    if "node_is_boundary" not in dataset:
        return position, dataset["fiber_nodes"].to_numpy(), None
    flags = dataset["node_is_boundary"].to_numpy()
    if flags.shape != (len(position),):
        raise NetworkError(f"{path}: 'node_is_boundary' has shape {flags.shape}, not ({len(position)},)")
    return position, dataset["fiber_nodes"].to_numpy(), _flags(flags, path)


def _flags(values: np.ndarray, path: Path) -> np.ndarray:
    bad = np.flatnonzero(~np.isin(values, (0, 1)))
    if bad.size:
        raise NetworkError(f"{path}: node {bad[0]} has the boundary flag {values[bad[0]]}; it must be 0 or 1")
    return values.astype(bool)
