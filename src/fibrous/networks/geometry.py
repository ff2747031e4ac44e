"""Nodes and fibres in the unit cube, and what their reference geometry says (Eq. 3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fibrous.errors import NetworkError

Array = NDArray[np.float64]


#: How far outside the cube rounding may put a node, edges.
ON_FACE = 1e-9


@dataclass(frozen=True, eq=False)
class Geometry:
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
    def structure_tensor(self) -> Array:
        """H (Eq. 3), shape (3, 3), trace 1."""
        return structure_tensor(self.fiber_vectors)

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


def connected_to_boundary(geometry: Geometry) -> NDArray[np.bool_]:
    """Whether each node hangs, through fibres, on a boundary node; shape (nodes,)."""
    count = len(geometry.node_position)
    first, second = geometry.fiber_nodes.T
    graph = coo_array((np.ones(len(first)), (first, second)), shape=(count, count))
    component = connected_components(graph, directed=False)[1]
    return np.isin(component, component[geometry.node_is_boundary])


def check(geometry: Geometry) -> None:
    """Raise NetworkError, naming the first node or fibre at fault, for a network that cannot be loaded.

    Faults are arrays of other shapes, positions that are not finite or outside the unit cube, indices that dangle,
    fibres of zero length, duplicated fibres, parts (single nodes, too) that float free of the boundary, and networks
    without boundary nodes.
    """
    position, boundary, fibers = geometry.node_position, geometry.node_is_boundary, geometry.fiber_nodes
    shapes = {
        "node_position": (len(position), 3),
        "node_is_boundary": (len(position),),
        "fiber_nodes": (len(fibers), 2),
    }
    for name, shape in shapes.items():
        if np.shape(getattr(geometry, name)) != shape:
            raise NetworkError(f"{name} has shape {np.shape(getattr(geometry, name))}; it must be {shape}")
    if len(fibers) == 0:
        raise NetworkError("has no fibers")
    bad = np.flatnonzero(~np.isfinite(position).all(axis=1))
    if bad.size:
        raise NetworkError(f"node {bad[0]} has a position that is not a finite number")
    bad = np.flatnonzero((np.abs(position) > 0.5 + ON_FACE).any(axis=1))
    if bad.size:
        raise NetworkError(
            f"node {bad[0]} lies outside the unit cube centred on the origin; give positions in edges of the cube"
        )
    bad = np.flatnonzero((fibers < 0).any(axis=1) | (fibers >= len(position)).any(axis=1))
    if bad.size:
        raise NetworkError(
            f"fiber {bad[0]} joins nodes {fibers[bad[0], 0]} and {fibers[bad[0], 1]}, "
            f"but nodes are numbered from 0 to {len(position) - 1}"
        )
    bad = np.flatnonzero(geometry.fiber_lengths == 0.0)
    if bad.size:
        raise NetworkError(f"fiber {bad[0]} has zero length; remove it or move one of its nodes")
    pairs = np.minimum(*fibers.T) * len(position) + np.maximum(*fibers.T)
    _, first = np.unique(pairs, return_index=True)
    if len(first) < len(fibers):
        again = np.setdiff1d(np.arange(len(fibers)), first)[0]
        low, high = np.sort(fibers[again])
        raise NetworkError(f"fiber {again} repeats another between nodes {low}, {high}")
    if not boundary.any():
        raise NetworkError("no node lies on a face of the cube, so no load can act on it")
    bad = np.flatnonzero(~connected_to_boundary(geometry))
    if bad.size:
        raise NetworkError(f"node {bad[0]} hangs on no fiber that reaches a face; remove its part")
