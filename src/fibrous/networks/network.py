"""A discrete fibre network in the unit cube, and what its reference geometry says (Eqs. 3 and 5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fibrous.errors import NetworkError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Network:
    """Nodes joined by straight, pin-jointed fibres; boundary nodes move with the deformation gradient.

    Parameters
    ----------
    node_position : array (nodes, 3), edges of the unit cube centred on the origin
    node_is_boundary : boolean array (nodes,)
    fiber_nodes : integer array (fibers, 2), the nodes at each fibre's ends
    """

    node_position: Array
    node_is_boundary: NDArray[np.bool_]
    fiber_nodes: NDArray[np.int64]

    @property
    def fiber_vectors(self) -> Array:
        """End-to-end vectors D of the fibres at rest, shape (fibers, 3), edges."""
        return self.node_position[self.fiber_nodes[:, 1]] - self.node_position[self.fiber_nodes[:, 0]]

    @property
    def fiber_lengths(self) -> Array:
        """Reference lengths of the fibres, shape (fibers,), edges."""
        return np.linalg.norm(self.fiber_vectors, axis=1)

    @property
    def interior_coordination(self) -> float:
        """Mean number of fibres that meet at an interior node; NaN without interior nodes."""
        ends = np.bincount(self.fiber_nodes.ravel(), minlength=len(self.node_position))
        interior = ends[~self.node_is_boundary]
        return float(interior.mean()) if interior.size else np.nan


def structure_tensor(vectors: Array) -> Array:
    """Generalized structure tensor H of fibres of one radius (Eq. 3), shape (3, 3), trace 1.

    `vectors` are the fibres' end-to-end vectors, shape (fibers, 3); with deformed vectors the result is the
    orientation tensor h = Σ l n⊗n / Σ l.
    """
    lengths = np.linalg.norm(vectors, axis=1)
    return (vectors / lengths[:, None]).T @ vectors / lengths.sum()


def volume_fraction(network: Network, edge_length_um: float, fiber_radius_um: float) -> float:
    """Fibre volume fraction φ = π R² L* / χ² of a unit-cube network, with L* its total fibre length (Eq. 5)."""
    return float(np.pi * fiber_radius_um**2 * network.fiber_lengths.sum() / edge_length_um**2)


def total_length(volume_fraction: float, edge_length_um: float, fiber_radius_um: float) -> float:
    """Total fibre length, in edges, of a unit-cube network of the given volume fraction (Eq. 5 inverted)."""
    return volume_fraction * edge_length_um**2 / (np.pi * fiber_radius_um**2)


def connected_to_boundary(network: Network) -> NDArray[np.bool_]:
    """Whether each node hangs, through fibres, on a boundary node; shape (nodes,)."""
    count = len(network.node_position)
    first, second = network.fiber_nodes.T
    graph = coo_array((np.ones(len(first)), (first, second)), shape=(count, count))
    component = connected_components(graph, directed=False)[1]
    return np.isin(component, component[network.node_is_boundary])


def checked(network: Network, where: str) -> Network:
    """The network itself, if it is one the solver can load.

    Raises NetworkError, naming `where` and the first node or fibre at fault, for positions that are not finite,
    indices that dangle, fibres of zero length, duplicated fibres, parts (single nodes, too) that float free of the
    boundary, and networks without boundary nodes.
    """
    position, fibers = network.node_position, network.fiber_nodes
    if len(fibers) == 0:
        raise NetworkError(f"{where}: has no fibers")
    bad = np.flatnonzero(~np.isfinite(position).all(axis=1))
    if bad.size:
        raise NetworkError(f"{where}: node {bad[0]} has a position that is not a finite number")
    bad = np.flatnonzero((fibers < 0).any(axis=1) | (fibers >= len(position)).any(axis=1))
    if bad.size:
        raise NetworkError(
            f"{where}: fiber {bad[0]} joins nodes {fibers[bad[0], 0]} and {fibers[bad[0], 1]}, "
            f"but nodes are numbered from 0 to {len(position) - 1}"
        )
    bad = np.flatnonzero(network.fiber_lengths == 0.0)
    if bad.size:
        raise NetworkError(f"{where}: fiber {bad[0]} has zero length; remove it or move one of its nodes")
    ordered = np.sort(fibers, axis=1)
    _, first = np.unique(ordered, axis=0, return_index=True)
    if len(first) < len(fibers):
        again = np.setdiff1d(np.arange(len(fibers)), first)[0]
        raise NetworkError(
            f"{where}: fiber {again} repeats another between nodes {ordered[again, 0]}, {ordered[again, 1]}"
        )
    if not network.node_is_boundary.any():
        raise NetworkError(f"{where}: no node lies on a face of the cube, so no load can act on it")
    bad = np.flatnonzero(~connected_to_boundary(network))
    if bad.size:
        raise NetworkError(f"{where}: node {bad[0]} hangs on no fiber that reaches a face; remove its part")
    return network
