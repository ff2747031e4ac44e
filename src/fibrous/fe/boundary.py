"""Prescribed displacements, and the forces that hold them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fibrous.fe.mesh import Mesh, MeshError

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class PrescribedDisplacement:
    """Components of nodal displacements that are given at every load step; all others are free.

    Parameters
    ----------
    nodes, axes : integer arrays (prescribed,): node and axis (0, 1, 2 for x, y, z) of each component, none twice
    values : array (steps, prescribed), mm

    Raises MeshError for values that are not finite, shapes that disagree, unknown axes, and components given twice.
    """

    nodes: Index
    axes: Index
    values: Array

    def __post_init__(self) -> None:
        nodes, axes = np.asarray(self.nodes, dtype=np.int64), np.asarray(self.axes, dtype=np.int64)
        values = np.asarray(self.values, dtype=float)
        if nodes.ndim != 1 or axes.shape != nodes.shape or values.ndim != 2 or values.shape[1:] != nodes.shape:
            raise MeshError(
                f"prescribed displacements have {nodes.shape} nodes, {axes.shape} axes and {values.shape} values; "
                "they need the shapes (prescribed,), (prescribed,) and (steps, prescribed)"
            )
        if ((axes < 0) | (axes > 2)).any():
            raise MeshError("prescribed displacements have axes 0, 1 and 2 for x, y and z")
        bad = np.argwhere(~np.isfinite(values))
        if bad.size:
            step, at = bad[0]
            raise MeshError(f"node {nodes[at]} has a prescribed displacement at step {step} that is not a number")
        _, first = np.unique(3 * nodes + axes, return_index=True)
        if len(first) < len(nodes):
            again = np.setdiff1d(np.arange(len(nodes)), first)[0]
            raise MeshError(f"node {nodes[again]} has its displacement along {'xyz'[axes[again]]} prescribed twice")
        for name, value in (("nodes", nodes), ("axes", axes), ("values", values)):
            object.__setattr__(self, name, value)

    @classmethod
    def at(cls, nodes: ArrayLike, values: ArrayLike, axes: Sequence[int] = (0, 1, 2), steps: int = 1) -> Self:
        """The same axes at all `nodes`, with `values` that broadcast to (steps, nodes, axes), mm."""
        nodes = np.asarray(nodes, dtype=np.int64)
        full = np.broadcast_to(values, (steps, len(nodes), len(axes)))
        return cls(np.repeat(nodes, len(axes)), np.tile(axes, len(nodes)), full.reshape(steps, -1))

    @classmethod
    def joined(cls, *parts: PrescribedDisplacement) -> Self:
        """Several at once, all with the same number of steps."""
        nodes, axes = (np.concatenate([getattr(part, name) for part in parts]) for name in ("nodes", "axes"))
        return cls(nodes, axes, np.concatenate([part.values for part in parts], axis=1))

    def unknowns(self, mesh: Mesh) -> Index:
        """Numbers 3 node + axis of the components in a mesh, shape (prescribed,); MeshError for a node it lacks."""
        bad = np.flatnonzero((self.nodes < 0) | (self.nodes >= len(mesh.node_position)))
        if bad.size:
            raise MeshError(
                f"a displacement is prescribed at node {self.nodes[bad[0]]}, "
                f"but nodes are numbered from 0 to {len(mesh.node_position) - 1}"
            )
        return 3 * self.nodes + self.axes


def reaction_force(internal_force: Array, nodes: Index) -> Array:
    """Force that the support of `nodes` exerts on the body, shape (..., 3), N.

    `internal_force` are nodal internal forces, shape (..., all nodes, 3), N, in equilibrium.
    """
    return internal_force[..., nodes, :].sum(axis=-2)
