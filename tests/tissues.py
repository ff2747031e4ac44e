"""Meshes and materials that tests of the finite elements share."""

import numpy as np

from fibrous.fe.boundary import PrescribedDisplacement
from fibrous.fe.mesh import Mesh, box
from fibrous.materials.contract import Material, Mixture
from fibrous.materials.hgo import HGOFamilies
from fibrous.materials.neo_hookean import NeoHookean


def distorted_box(count: int, amount: float = 0.15, lengths=(1.0, 1.0, 1.0)) -> Mesh:
    """A box whose inner nodes are moved by up to `amount` element edges."""
    mesh = box((count, count, count), lengths)
    inside = np.setdiff1d(np.arange(len(mesh.node_position)), surface(mesh))
    moves = np.random.default_rng(5).uniform(-amount, amount, (len(inside), 3)) * np.array(lengths) / count
    position = mesh.node_position.copy()
    position[inside] += moves
    return Mesh(position, mesh.element_nodes)


def surface(mesh: Mesh) -> np.ndarray:
    """Nodes on the faces of a box."""
    position = mesh.node_position
    return np.flatnonzero(((position == 0.0) | (position == position.max(axis=0))).any(axis=1))


def tissue(scale: float = 1.0, with_fibers: bool = True, tension_only: bool = False) -> Material:
    """Matrix of the study with three families along the axes, moduli times `scale`."""
    matrix = NeoHookean(scale * 0.025, scale * 0.417)
    if not with_fibers:
        return matrix
    return Mixture((matrix, HGOFamilies(scale * 0.05, 1.0, np.array([0.5, 0.3, 0.2]), np.eye(3), tension_only)))


def stretched_box(mesh: Mesh, displacements) -> PrescribedDisplacement:
    """x = 0 clamped, u_x prescribed at the opposite face, one value a step."""
    x = mesh.node_position[:, 0]
    steps = len(displacements)
    return PrescribedDisplacement.joined(
        PrescribedDisplacement.at(np.flatnonzero(x == 0.0), 0.0, steps=steps),
        PrescribedDisplacement.at(
            np.flatnonzero(x == x.max()), np.reshape(displacements, (-1, 1, 1)), axes=(0,), steps=steps
        ),
    )
