"""Nodal forces and stiffness of a mesh under a displacement, total Lagrangian, in blocks of elements.

Arrays of a block stay in the cache; a loop over blocks costs as little as one over the mesh. The pattern of the
stiffness never changes, so every entry of every element matrix knows its place in it, and one `bincount` adds them up.
Rows of prescribed components have no place: their equations are never solved.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from fibrous.fe.mesh import Mesh
from fibrous.materials.contract import Material, State, components_last, select

Array = NDArray[np.float64]
Index = NDArray[np.int64]
# States of the blocks, apart: a state may be large, and is joined for those outside alone.
States = tuple[State, ...]

# Elements worked on at a time: their tangents, 5 kB per element, fit the second-level cache of a core, and the arrays
# of states with networks are small enough for their memory to be used again.
BLOCK = 64
# Strain whose forces are as nothing: below it the residual is measured by the stiffness, no longer by the forces.
SMALLEST_STRAIN = 1e-4


@dataclass(frozen=True)
class Point:
    """A mesh at some displacement, in equilibrium or not. Components are numbered 3 node + axis.

    displacement : shape (nodes, 3), mm
    internal_force : sum of the elements' forces at the nodes, shape (nodes, 3), N
    force_scale : norm of the sum of their magnitudes, or that of a strain of 1e-4 where it is larger, N
    stiffness : derivative of the free components' forces in the free components, in rising order, N/mm
    coupling : their derivative in the prescribed components, in the order given, N/mm
    piola : first Piola–Kirchhoff stress at the Gauss points, shape (elements, 8, 3, 3), MPa
    states : of the material, one a block
    """

    displacement: Array
    internal_force: Array
    force_scale: float
    stiffness: csr_array
    coupling: csr_array
    piola: Array
    states: States


class Assembly:
    """A mesh of one material, with the pattern of its stiffness; every method is a function of its arguments.

    Parameters
    ----------
    mesh : the mesh
    material : with parameters that broadcast against (elements, Gauss points)
    prescribed : numbers 3 node + axis of the prescribed components, none twice

    Attributes
    ----------
    free : numbers of the free components, rising
    """

    def __init__(self, mesh: Mesh, material: Material, prescribed: Index) -> None:
        self.mesh, self.prescribed = mesh, prescribed
        components = 3 * len(mesh.node_position)
        self.free = np.setdiff1d(np.arange(components), prescribed)
        self._length = float(np.cbrt(mesh.integration[1].sum() / len(mesh.element_nodes)))
        gradients, self._volumes = mesh.integration
        count = len(mesh.element_nodes)
        self._gradients = np.ascontiguousarray(gradients.transpose(0, 2, 1, 3)).reshape(count, 8, 24)
        blocks = [slice(start, min(start + BLOCK, count)) for start in range(0, count, BLOCK)]
        self._blocks = [(block, material.of_elements(block)) for block in blocks]
        self._components = (3 * mesh.element_nodes[:, :, None] + np.arange(3)).ravel()
        self._pattern = _Pattern(mesh, self.free, prescribed)

    def split(self, state: State) -> States:
        """The states of the blocks from that of all elements."""
        return tuple(select(state, block) for block, _ in self._blocks)

    def evaluate(self, displacement: Array, states: States, near: States | None = None) -> Point:
        """Forces and stiffness at a displacement, shape (nodes, 3), mm, from the states of the last equilibrium.

        `near` are the states of the trial before, if there was one in this increment.
        """
        count = len(self.mesh.element_nodes)
        forces, stiffness, stresses = np.empty((count, 8, 3)), np.empty((count, 8, 72)), np.empty((count, 8, 3, 3))
        nears: States = (None,) * len(self._blocks) if near is None else near
        new = []
        for (block, material), before, start in zip(self._blocks, states, nears, strict=True):
            gradients = self._gradients[block]
            weighted = (gradients.reshape(-1, 8, 8, 3) * self._volumes[block, None, :, None]).reshape(-1, 8, 24)
            stress, tangent, after = material(self._deformation_gradient(displacement, block), before, start)
            # f_ai = Σ_q,J V ∂N_a/∂X_J P_iJ and K_aibk = Σ_q,J V ∂N_a/∂X_J (Σ_L A_iJkL ∂N_b/∂X_L)
            np.matmul(weighted, stress.swapaxes(-1, -2).reshape(-1, 24, 3), out=forces[block])
            ordered = tangent.transpose(0, 1, 3, 2, 4, 5).reshape(-1, 8, 27, 3)
            right = gradients.reshape(-1, 8, 8, 3).transpose(0, 2, 3, 1)
            np.matmul(weighted, (ordered @ right).reshape(-1, 24, 72), out=stiffness[block])
            stresses[block] = stress
            new.append(after)
        internal_force = self._at_nodes(forces)
        free_stiffness, coupling = self._pattern.matrices(stiffness)
        strained = SMALLEST_STRAIN * self._length * float(np.linalg.norm(free_stiffness.diagonal()))
        scale = max(float(np.linalg.norm(self._at_nodes(np.abs(forces)))), strained)
        return Point(displacement, internal_force, scale, free_stiffness, coupling, stresses, tuple(new))

    def deformation_gradient(self, displacement: Array) -> Array:
        """F at the Gauss points, shape (elements, 8, 3, 3), for a displacement of shape (nodes, 3), mm."""
        return self._deformation_gradient(displacement, slice(None))

    def what_is_not_finite(self, displacement: Array) -> str:
        """Why there are no forces at a displacement, shape (nodes, 3), mm, in words that name the first element."""
        determinants = np.linalg.det(self.deformation_gradient(displacement))
        bad = np.flatnonzero((determinants <= 0.0).any(axis=1))
        return f"element {bad[0]} turned inside out" if bad.size else "forces grew beyond the range of numbers"

    def _deformation_gradient(self, displacement: Array, elements: slice) -> Array:
        moved = displacement[self.mesh.element_nodes[elements]]
        gradient = moved.swapaxes(1, 2) @ self._gradients[elements]
        # In memory components come first and elements last, so that materials loop over elements innermost, along
        # which parameters lie, too.
        F = np.ascontiguousarray(gradient.reshape(-1, 3, 8, 3).transpose(1, 3, 2, 0))
        for i in range(3):
            F[i, i] += 1.0
        return components_last(F.swapaxes(2, 3), 2)

    def _at_nodes(self, forces: Array) -> Array:
        return np.asarray(np.bincount(self._components, forces.ravel()), dtype=float).reshape(-1, 3)


class _Pattern:
    """Where the entries of the element matrices stand in the stiffness of the free components and in its coupling."""

    def __init__(self, mesh: Mesh, free: Index, prescribed: Index) -> None:
        nodes, count = mesh.element_nodes, len(mesh.node_position)
        keys, pair = np.unique((nodes[:, :, None] * count + nodes[:, None, :]).ravel(), return_inverse=True)
        row_node, column_node = np.divmod(keys, count)
        # All components of one pair of nodes, as (i, k), then those of all pairs.
        rows = np.broadcast_to((3 * row_node[:, None] + np.arange(3))[:, :, None], (len(keys), 3, 3))
        columns = np.broadcast_to((3 * column_node[:, None] + np.arange(3))[:, None, :], (len(keys), 3, 3))
        # Sorted by row, then column, free columns before prescribed ones, and rows that have no place last.
        rank, is_free = np.empty(3 * count, dtype=np.int64), np.zeros(3 * count, dtype=bool)
        rank[free], rank[prescribed] = np.arange(len(free)), np.arange(len(prescribed))
        is_free[free] = True
        kind = np.where(is_free[rows], np.where(is_free[columns], 0, 1), 2).ravel()
        order = np.lexsort((rank[columns].ravel(), rank[rows].ravel(), kind))
        place = np.empty(len(order), dtype=np.int64)
        place[order] = np.arange(len(order))
        sizes = np.bincount(kind, minlength=3)
        self._size, self._ends = len(order), np.cumsum(sizes)[:2]
        place_of_pairs = place.reshape(-1, 3, 3)[pair].reshape(-1, 8, 8, 3, 3)
        self._places = np.ascontiguousarray(place_of_pairs.transpose(0, 1, 3, 4, 2)).ravel()
        self._structures = []
        for which, columns_of in enumerate((free, prescribed)):
            entries = order[kind[order] == which]
            starts = np.concatenate([[0], np.cumsum(np.bincount(rank[rows].ravel()[entries], minlength=len(free)))])
            indices = rank[columns].ravel()[entries]
            self._structures.append((indices.astype(np.int32), starts.astype(np.int32), (len(free), len(columns_of))))

    def matrices(self, entries: Array) -> tuple[csr_array, csr_array]:
        """Stiffness and coupling from element matrices (elements, 8 × 3 × 3 × 8), entries as a, i, k, b."""
        data = np.bincount(self._places, entries.ravel(), minlength=self._size)
        parts = np.split(data, self._ends)[:2]
        stiffness, coupling = (
            csr_array((part, indices, starts), shape=shape)
            for part, (indices, starts, shape) in zip(parts, self._structures, strict=True)
        )
        return stiffness, coupling
