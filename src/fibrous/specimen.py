"""The tissue that finite elements compute: mesh, fibres, entheses and their motion; and the synthetic specimen.

The synthetic specimen stands in for a facet capsular ligament whose mesh and kinematics are not public: a curved slab
between two bones, fibres that run from bone to bone, and flexion as a rigid motion of one of the bones. x runs from
bone to bone, y along the joint, z through the thickness; lengths are in mm.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial.transform import Rotation
from scipy.special import ndtr

from fibrous.fe.boundary import PrescribedDisplacement
from fibrous.fe.mesh import Mesh, MeshError, box

Array = NDArray[np.float64]
Index = NDArray[np.int64]

#: What `enthesis` says of a node: it belongs to none, to the one held fixed, or to the one moved.
NO_ENTHESIS, FIXED, MOVED = 0, 1, 2
SYNTHETIC = "synthetic specimen"
# Waves whose sum makes a random field; with so many its values are normal for all practical purposes.
WAVES = 128


@dataclass(frozen=True, repr=False)
class Specimen:
    """A piece of tissue and what is done to it.

    Parameters
    ----------
    mesh : lengths in mm
    fiber_direction : mean direction of each element's fibres, unit vectors, shape (elements, 3)
    structure_tensor : H of each element's fibres in the axes of the mesh, shape (elements, 3, 3)
    enthesis : 0 for a node of none, 1 for one of the fixed and 2 for one of the moved enthesis, shape (nodes,)
    prescribed_displacement : at the end of each load step, shape (steps, nodes, 3), mm; zero at the fixed enthesis,
        NaN at nodes of none
    origin : where it comes from, in a few words; ``synthetic specimen`` for one that was never measured

    Raises MeshError, naming the first node at fault, where an enthesis has no node or moves when it is fixed, and for
    displacements that are not finite.
    """

    mesh: Mesh
    fiber_direction: Array
    structure_tensor: Array
    enthesis: Index
    prescribed_displacement: Array
    origin: str

    def __post_init__(self) -> None:
        for number, what in ((FIXED, "held fixed"), (MOVED, "moved")):
            if not (self.enthesis == number).any():
                raise MeshError(f"no node belongs to enthesis {number}, the one {what}; without it there is no load")
        pieces = _pieces(self.mesh)
        loose = np.setdiff1d(pieces, pieces[self.enthesis != NO_ENTHESIS])
        if loose.size:
            node = int(np.flatnonzero(pieces == loose[0])[0])
            raise MeshError(f"node {node} belongs to a piece of the mesh that no enthesis holds; join it or remove it")
        held = np.flatnonzero(self.enthesis)
        bad = np.argwhere(~np.isfinite(self.prescribed_displacement[:, held]).all(axis=-1))
        if bad.size:
            raise MeshError(f"node {held[bad[0, 1]]} has no finite displacement at step {bad[0, 0] + 1}")
        fixed = np.flatnonzero(self.enthesis == FIXED)
        bad = np.argwhere((self.prescribed_displacement[:, fixed] != 0.0).any(axis=-1))
        if bad.size:
            raise MeshError(
                f"node {fixed[bad[0, 1]]} of the fixed enthesis 1 moves at step {bad[0, 0] + 1}; "
                "give motions relative to that bone"
            )

    def __repr__(self) -> str:
        counts = {"elements": self.mesh.element_nodes, "nodes": self.mesh.node_position}
        counts["load steps"] = self.prescribed_displacement
        return f"<Specimen: {', '.join(f'{len(rows)} {name}' for name, rows in counts.items())}, {self.origin}>"

    @property
    def caption(self) -> str:
        """Origin and units for a comment in a file; no two hyphens in a row, which XML does not allow there."""
        return f"{re.sub('-+', '-', self.origin)}; mm, N, MPa"

    @property
    def prescribed(self) -> PrescribedDisplacement:
        """All three components at the nodes of both entheses, as the finite elements take them."""
        held = np.flatnonzero(self.enthesis)
        values = self.prescribed_displacement[:, held]
        return PrescribedDisplacement.at(held, values, steps=len(values))


def _pieces(mesh: Mesh) -> Index:
    """Which piece of connected elements every node belongs to, shape (nodes,)."""
    nodes = mesh.element_nodes
    links = np.ones(7 * len(nodes)), (np.repeat(nodes[:, 0], 7), nodes[:, 1:].ravel())
    return connected_components(coo_array(links, shape=2 * (len(mesh.node_position),)), directed=False)[1]


@dataclass(frozen=True)
class Slab:
    """A slab bent to a part of a cylinder whose axis is parallel to y.

    Parameters
    ----------
    elements : numbers of them along x, y and z
    length_mm : from bone to bone, along the arc of the middle surface
    height_mm, thickness_mm : along y, and through the thickness
    radius_mm : of the middle surface

    Raises MeshError where the slab would close on itself.

    >>> Slab(elements=(15, 20, 3)).specimen(steps=20)
    <Specimen: 900 elements, 1344 nodes, 20 load steps, synthetic specimen>
    """

    elements: tuple[int, int, int] = (15, 20, 3)
    length_mm: float = 10.0
    height_mm: float = 16.0
    thickness_mm: float = 2.0
    radius_mm: float = 15.0

    def __post_init__(self) -> None:
        if not self.length_mm < np.pi * self.radius_mm:
            raise MeshError(
                f"a slab of length {self.length_mm:g} mm bent to the radius {self.radius_mm:g} mm makes more than half "
                "a turn; enlarge radius_mm"
            )

    @property
    def mesh(self) -> Mesh:
        """The slab's hexahedra; element and node numbers rise along z first, then y, then x."""
        flat = self._flat
        return Mesh(self._bent(flat.node_position), flat.element_nodes)

    @property
    def enthesis(self) -> Index:
        """Which nodes lie on the bones: the fixed one where x is least, the moved one where it is largest."""
        along = self._flat.node_position[:, 0]
        return np.select([along == along.min(), along == along.max()], [FIXED, MOVED], NO_ENTHESIS)

    @property
    def element_centers(self) -> Array:
        """Centres of the elements in the flat slab: along the arc, y, and the thickness, shape (elements, 3), mm."""
        return self._flat.node_position[self._flat.element_nodes].mean(axis=1)

    def frames(self, flat: Array) -> Array:
        """Unit vectors along the arc, y, and the thickness as columns, shape (..., 3, 3), at flat points (..., 3)."""
        turn = flat[..., 0] / self.radius_mm
        along = np.stack([np.cos(turn), 0.0 * turn, -np.sin(turn)], axis=-1)
        outward = np.stack([np.sin(turn), 0.0 * turn, np.cos(turn)], axis=-1)
        return np.stack([along, np.broadcast_to([0.0, 1.0, 0.0], along.shape), outward], axis=-1)

    def specimen(self, steps: int, fibers: FiberField | None = None, motion: RigidMotion | None = None) -> Specimen:
        """The synthetic specimen: this slab with fibres, one enthesis of which is moved in `steps` load steps."""
        mesh, enthesis, centers = self.mesh, self.enthesis, self.element_centers
        axes, eigenvalues = (fibers or FiberField()).local(centers, self.height_mm)
        axes = self.frames(centers) @ axes
        moved = enthesis == MOVED
        displacement = np.full((steps, *mesh.node_position.shape), np.nan)
        displacement[:, enthesis == FIXED] = 0.0
        displacement[:, moved] = (motion or RigidMotion()).displacement(mesh.node_position[moved], steps)
        return Specimen(mesh, axes[..., 0], structure_tensor_of(axes, eigenvalues), enthesis, displacement, SYNTHETIC)

    @property
    def _flat(self) -> Mesh:
        lengths = np.array([self.length_mm, self.height_mm, self.thickness_mm])
        mesh = box(self.elements, lengths)
        return Mesh(mesh.node_position - 0.5 * lengths, mesh.element_nodes)

    def _bent(self, flat: Array) -> Array:
        turn, radius = flat[:, 0] / self.radius_mm, self.radius_mm + flat[:, 2]
        return np.stack([radius * np.sin(turn), flat[:, 1], radius * np.cos(turn) - self.radius_mm], axis=1)


@dataclass(frozen=True)
class FiberField:
    """Directions and alignments of fibres that vary smoothly at random: functions of the place, not of the mesh.

    Parameters
    ----------
    seed : of all random fields
    lowest_row_degrees : mean angle between the fibres and the way from bone to bone where y is least, in the plane of
        the slab; it falls to zero where y is largest
    deviation_degrees : standard deviation of the angle in the plane about that mean
    tilt_degrees : standard deviation of the angle out of the plane
    H11 : least and largest eigenvalue of H along the fibres
    in_plane_share : least and largest share of the rest that lies in the plane, across the fibres
    correlation_length_mm : distance over which the random fields change
    """

    seed: int = 2022
    lowest_row_degrees: float = 20.0
    deviation_degrees: float = 4.0
    tilt_degrees: float = 2.0
    H11: tuple[float, float] = (0.55, 0.80)
    in_plane_share: tuple[float, float] = (0.5, 0.7)
    correlation_length_mm: float = 6.0

    def local(self, flat: Array, height_mm: float) -> tuple[Array, Array]:
        """Fibre axes and eigenvalues of H at points of a flat slab, shape (points, 3), mm, centred on the origin.

        Returns unit vectors as columns, shape (points, 3, 3), the first of them the fibres' mean direction, the second
        in the plane of the slab, and the eigenvalues of H along them, shape (points, 3).
        """
        deviation, tilt, alignment, share = (
            smooth_field(flat, self.correlation_length_mm, [self.seed, number]) for number in range(4)
        )
        depth = 0.5 - flat[:, 1] / height_mm
        mean = self.lowest_row_degrees * depth**2 * (3.0 - 2.0 * depth)
        angles = np.stack([mean + self.deviation_degrees * deviation, -self.tilt_degrees * tilt], axis=1)
        axes = Rotation.from_euler("ZY", angles, degrees=True).as_matrix()
        first = _between(self.H11, ndtr(alignment))
        second = (1.0 - first) * _between(self.in_plane_share, ndtr(share))
        return axes, np.stack([first, second, 1.0 - first - second], axis=1)


@dataclass(frozen=True)
class RigidMotion:
    """Motion of a bone: a translation, and a turn about the axis parallel to x through the middle of its enthesis.

    gap_mm, slide_mm : translation along x, away from the other bone, and along y
    rotation_degrees : turn about x, from y to z
    """

    gap_mm: float = 0.92
    slide_mm: float = 2.03
    rotation_degrees: float = 5.1

    def displacement(self, position: Array, steps: int) -> Array:
        """Displacements at the end of each of equal parts of the motion, shape (steps, nodes, 3), mm.

        `position` are the nodes of the enthesis, shape (nodes, 3), mm. Every part is a rigid motion itself.
        """
        parts = np.arange(1, steps + 1) / steps
        turns = Rotation.from_euler("x", self.rotation_degrees * parts[:, None], degrees=True).as_matrix()
        arms = position - position.mean(axis=0)
        translation = parts[:, None] * [self.gap_mm, self.slide_mm, 0.0]
        return arms @ (turns - np.eye(3)).swapaxes(1, 2) + translation[:, None]


def structure_tensor_of(axes: Array, eigenvalues: Array) -> Array:
    """H = Σ h_p N_p ⊗ N_p, shape (..., 3, 3), of unit vectors N_p as columns and eigenvalues h_p, shape (..., 3)."""
    tensor = (axes * eigenvalues[..., None, :]) @ np.swapaxes(axes, -1, -2)
    return 0.5 * (tensor + np.swapaxes(tensor, -1, -2))


def smooth_field(position: Array, correlation_length: float, seed: int | list[int]) -> Array:
    """A random function of mean 0 and variance 1 at points, shape (points, 3); it returns shape (points,).

    Its correlation between two points a distance r apart is exp(−r²/2 l²) with l the correlation length: a sum of
    waves √(2/n) cos(k · x + φ) whose wave vectors k are normal with the standard deviation 1/l.
    """
    generator = np.random.default_rng(seed)
    wave_vectors = generator.normal(scale=1.0 / correlation_length, size=(3, WAVES))
    phases = generator.uniform(0.0, 2.0 * np.pi, WAVES)
    return np.sqrt(2.0 / WAVES) * np.cos(position @ wave_vectors + phases).sum(axis=1)


def _between(bounds: tuple[float, float], part: Array) -> Array:
    return bounds[0] + (bounds[1] - bounds[0]) * part
