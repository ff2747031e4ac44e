"""A network from files of the user: its nodes and fibres from CSV or NetCDF.

Positions are in edges of the unit cube centred on the origin. CSV: one file with columns x, y, z and, if wanted,
boundary (0 or 1), one with columns tail, head (node numbers from 0). NetCDF (NetCDF-3 or NetCDF-4): variables
node_position(node, axis), fiber_nodes(fiber, end) and, if wanted, node_is_boundary(node). Without the last, nodes on a
face are the boundary. Files of `Network.save` say what the fibres are, too.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr

from fibrous.errors import DatasetError, NetworkError, naming
from fibrous.io.netcdf import opened
from fibrous.io.tables import columns, read_csv
from fibrous.networks.fiber_law import FiberLaw
from fibrous.networks.geometry import ON_FACE
from fibrous.networks.network import LAW, Network, unpacked


def read_network(
    path: str | Path, fibers: str | Path | None = None, *, fiber: FiberLaw | None = None, edge_um: float | None = None
) -> Network:
    """A network from one NetCDF file, or from two CSV files, of its nodes and of its fibres.

    Parameters
    ----------
    path : the NetCDF file, or the CSV file of nodes; fibers : the CSV file of fibres
    fiber, edge_um : as of `Network`; needed where the file is none of `Network.save`

    Raises NetworkError, naming the file and the row at fault, where it holds no network.

    >>> import tempfile
    >>> from fibrous import Fiber, delaunay
    >>> fiber = Fiber(modulus_MPa=10.0, nonlinearity=2.5, radius_um=0.1)
    >>> network = delaunay((0.6, 0.25, 0.15), fiber, volume_fraction=0.04, edge_um=8.0, seed=1, tolerance=0.02)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     network.save(f"{folder}/mine.nc")
    ...     print(read_network(f"{folder}/mine.nc"))
    <Network: 250 fibres, 17 interior nodes, H = (0.60, 0.25, 0.15), φ = 0.040>
    """
    where = f"{path}" if fibers is None else f"{path} and {fibers}"
    if fibers is None:
        dataset = _netcdf(Path(path))
        if LAW in dataset.attrs and fiber is None and edge_um is None:
            with naming(where):
                return _only(unpacked(dataset))
        position, ends, boundary = _arrays(dataset, Path(path))
    else:
        position, boundary = _read_nodes(Path(path))
        ends = columns(Path(fibers), read_csv(Path(fibers), NetworkError), ["tail", "head"], NetworkError)
    with naming(where):
        if fiber is None or edge_um is None:
            raise NetworkError("does not say what its fibers are and how large its cube is; give fiber and edge_um")
        whole = np.isfinite(ends) & (ends == np.round(ends)) & (np.abs(ends) < 2.0**53)
        if not whole.all():
            row = np.flatnonzero(~whole.all(axis=1))[0]
            raise NetworkError(f"fiber {row} has a node number that is not a whole number")
        if boundary is None:
            boundary = (np.abs(position) >= 0.5 - ON_FACE).any(axis=1)
        return Network(position, boundary, ends.astype(np.int64), fiber=fiber, edge_um=edge_um)


def _only(networks: list[Network]) -> Network:
    if len(networks) != 1:
        raise NetworkError(f"holds {len(networks)} networks; give one file per network")
    return networks[0]


def _read_nodes(path: Path) -> tuple[np.ndarray, np.ndarray | None]:
    table = read_csv(path, NetworkError)
    position = columns(path, table, ["x", "y", "z"], NetworkError)
    if "boundary" not in table:
        return position, None
    return position, _flags(columns(path, table, ["boundary"], NetworkError)[:, 0], path)


def _netcdf(path: Path) -> xr.Dataset:
    try:
        with opened(path, "name a file that exists", "save it anew as NetCDF-3 or NetCDF-4") as dataset:
            return dataset.load()
    except DatasetError as error:
        raise NetworkError(str(error)) from None


def _arrays(dataset: xr.Dataset, path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Positions, fibres and, if the file says so, which nodes are the boundary."""
    for name, width in (("node_position", 3), ("fiber_nodes", 2)):
        if name not in dataset:
            raise NetworkError(f"{path}: lacks the variable '{name}'")
        if dataset[name].ndim != 2 or dataset[name].shape[1] != width or dataset[name].dtype.kind not in "iuf":
            found = f"{dataset[name].dtype} of {dataset[name].shape}"
            raise NetworkError(f"{path}: '{name}' needs numbers of shape (…, {width}), not {found}")
    if dataset.sizes.get("network", 1) != 1:
        raise NetworkError(f"{path}: holds {dataset.sizes['network']} networks; give one file per network")
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
