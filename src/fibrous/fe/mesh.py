"""Meshes of eight-node hexahedra: what they are, what is wrong with one, and a box of them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fibrous.errors import FibrousError
from fibrous.fe import hex8

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class MeshError(FibrousError):
    """A mesh, or what is prescribed on it, is none that can be computed with."""


@dataclass(frozen=True)
class Mesh:
    """Hexahedra with straight edges.

    Parameters
    ----------
    node_position : array (nodes, 3), mm
    element_nodes : integer array (elements, 8): four corners counter-clockwise seen from the opposite face, then the
        four behind them in the same order, as in VTK and FEBio

    Raises MeshError, naming the first node or element at fault, for positions that are not finite, node numbers that
    do not exist or repeat in an element, nodes of no element, elements that are inverted or numbered inside out, and
    elements that are there twice.
    """

    node_position: Array
    element_nodes: Index

    def __post_init__(self) -> None:
        object.__setattr__(self, "node_position", np.asarray(self.node_position, dtype=float))
        object.__setattr__(self, "element_nodes", np.asarray(self.element_nodes, dtype=np.int64))
        self._refuse_numbers()
        self._refuse_shapes()
        self._refuse_repetition()

    @cached_property
    def integration(self) -> tuple[Array, Array]:
        """∂N_a/∂X_J, shape (elements, Gauss points, 8, 3), 1/mm, and volumes, shape (elements, Gauss points), mm³."""
        return hex8.integration(self.node_position[self.element_nodes])

    def _refuse_numbers(self) -> None:
        position, nodes = self.node_position, self.element_nodes
        if position.ndim != 2 or position.shape[1] != 3 or nodes.ndim != 2 or nodes.shape[1] != 8 or not len(nodes):
            raise MeshError(
                f"a mesh needs positions of shape (nodes, 3) and corners of shape (elements, 8), "
                f"not {position.shape} and {nodes.shape}"
            )
        bad = np.flatnonzero(~np.isfinite(position).all(axis=1))
        if bad.size:
            raise MeshError(f"node {bad[0]} has a position that is not a finite number")
        bad = np.flatnonzero((nodes < 0).any(axis=1) | (nodes >= len(position)).any(axis=1))
        if bad.size:
            raise MeshError(
                f"element {bad[0]} has corners {nodes[bad[0]].tolist()}, "
                f"but nodes are numbered from 0 to {len(position) - 1}"
            )
        bad = np.flatnonzero((np.diff(np.sort(nodes, axis=1)) == 0).any(axis=1))
        if bad.size:
            raise MeshError(f"element {bad[0]} has a corner twice: {nodes[bad[0]].tolist()}; it needs eight of its own")
        used = np.bincount(nodes.ravel(), minlength=len(position))
        if not used.all():
            raise MeshError(f"node {np.argmin(used)} belongs to no element; remove it")

    def _refuse_repetition(self) -> None:
        nodes = self.element_nodes
        _, first = np.unique(np.sort(nodes, axis=1), axis=0, return_index=True)
        if len(first) < len(nodes):
            again = np.setdiff1d(np.arange(len(nodes)), first)[0]
            raise MeshError(f"element {again} has the corners of an element before it; remove one of the two")

    def _refuse_shapes(self) -> None:
        volumes = self.integration[1]
        bad = np.flatnonzero((volumes <= 0.0).any(axis=1))
        if bad.size:
            first = int(bad[0])
            inside_out = (volumes[first] < 0.0).all()
            raise MeshError(
                f"element {first} is numbered inside out: swap its first four corners with its last four"
                if inside_out
                else f"element {first} is inverted or flat at a Gauss point: move its nodes, or put its corners in "
                "order around each face"
            )


def box(counts: tuple[int, int, int], lengths: ArrayLike = (1.0, 1.0, 1.0)) -> Mesh:
    """A box from the origin, of `counts` equal elements and of edge `lengths`, shape (3,), mm, along x, y and z.

    >>> box((2, 1, 1)).element_nodes[1].tolist()
    [4, 8, 10, 6, 5, 9, 11, 7]
    """
    points = np.indices(tuple(count + 1 for count in counts))
    position = np.moveaxis(points, 0, -1).reshape(-1, 3) / counts * np.asarray(lengths, dtype=float)
    number = np.arange(len(position)).reshape(points.shape[1:])
    corners = [
        number[tuple(slice(offset, offset + count) for offset, count in zip(corner, counts, strict=True))].ravel()
        for corner in ((hex8.CORNERS + 1) // 2).astype(int)
    ]
    return Mesh(position, np.stack(corners, axis=1))
