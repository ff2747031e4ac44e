"""Hexahedral meshes drawn in space: their outer faces in the colours of elements, farthest first, and their outline."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from numpy.typing import NDArray

from fibrous_study.figures.projection import Camera
from fibrous_study.figures.style import INK

Array = NDArray[np.float64]
Index = NDArray[np.int64]

# The faces of a hexahedron by the numbers of its corners, counter-clockwise seen from outside.
_FACES = np.array([[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]])
# Faces that meet at more than this angle meet in an edge of the body.
_SHARP_DEGREES = 45.0
# Length of a direction's line over the root of its face's area, and the most of it that may point out of the face.
_LINE_LENGTH, _LINE_OUT_OF_FACE = 0.7, 0.5


@dataclass(frozen=True)
class Surface:
    """The outer faces of a mesh, those of one element alone.

    face_nodes : shape (faces, 4), counter-clockwise seen from outside; face_element : shape (faces,)
    """

    face_nodes: Index
    face_element: Index

    @classmethod
    def of(cls, element_nodes: Index) -> Self:
        """The surface of hexahedra, shape (elements, 8), corners in the order of VTK."""
        faces = element_nodes[:, _FACES].reshape(-1, 4)
        _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
        outer = np.sort(first[count == 1])
        return cls(faces[outer], outer // len(_FACES))

    def normals(self, position: Array) -> Array:
        """Outward normals as long as the faces' areas, shape (faces, 3), for nodes at `position`, shape (nodes, 3)."""
        a, b, c, d = position[self.face_nodes].swapaxes(0, 1)
        return 0.5 * np.cross(c - a, d - b)

    def sharp_edges(self, position: Array) -> Index:
        """Nodes at the ends of the edges in which the surface bends sharply, shape (edges, 2)."""
        normals = self.normals(position)
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        ends = np.sort(np.stack([self.face_nodes, np.roll(self.face_nodes, -1, axis=1)], axis=-1), axis=-1)
        edges, edge_of, count = np.unique(ends.reshape(-1, 2), axis=0, return_inverse=True, return_counts=True)
        total = np.zeros((len(edges), 3))
        np.add.at(total, edge_of, np.repeat(normals, 4, axis=0))
        # Two unit normals at an angle a add up to the length 2 cos(a/2); where more than two faces meet, always sharp.
        smooth = np.linalg.norm(total, axis=1) > 2.0 * np.cos(np.radians(0.5 * _SHARP_DEGREES))
        return edges[~(smooth & (count == 2))]


def draw_surface(
    axes: Axes,
    camera: Camera,
    surface: Surface,
    position: Array,
    values: Array,
    colors: ScalarMappable,
    mesh_width: float = 0.0,
) -> PolyCollection:
    """Draw the faces that look at the reader, the farthest first, rasterised inside vector files.

    `position` has shape (nodes, 3), `values` (elements,); `colors` turns values into colours. With a `mesh_width` in
    points the edges of the elements are drawn, too.
    """
    points, depth = camera.project(position[surface.face_nodes])
    seen = np.flatnonzero(surface.normals(position) @ camera.frame[2] > 0.0)
    order = seen[np.argsort(depth[seen].mean(axis=1), kind="stable")]
    shades = colors.to_rgba(values[surface.face_element[order]])
    faces = PolyCollection(
        list(points[order]),
        facecolors=shades,
        # In its own colour an edge closes the seam to the next face.
        edgecolors=INK if mesh_width else shades,
        linewidths=mesh_width or 0.2,
        rasterized=True,
        zorder=2,
    )
    axes.add_collection(faces, autolim=False)
    return faces


def draw_directions(
    axes: Axes, camera: Camera, surface: Surface, position: Array, directions: Array, width: float
) -> LineCollection:
    """Draw elements' directions, unit vectors of shape (elements, 3), on the faces that look at the reader.

    A face that its element's direction leaves steeply has no line.
    """
    normals = surface.normals(position)
    area = np.linalg.norm(normals, axis=1)
    of_face = directions[surface.face_element]
    within = np.abs((of_face * normals).sum(axis=1)) < _LINE_OUT_OF_FACE * area
    drawn = within & (normals @ camera.frame[2] > 0.0)
    half = 0.5 * _LINE_LENGTH * np.sqrt(area[drawn])[:, None] * of_face[drawn]
    middle = position[surface.face_nodes[drawn]].mean(axis=1)
    points, _ = camera.project(np.stack([middle - half, middle + half], axis=1))
    lines = LineCollection(list(points), colors=INK, linewidths=width, capstyle="round", zorder=3)
    axes.add_collection(lines, autolim=False)
    return lines


def draw_edges(
    axes: Axes, camera: Camera, position: Array, edges: Index, color: str, width: float, order: float
) -> LineCollection:
    """Draw edges, shape (edges, 2), between nodes at `position`, shape (nodes, 3)."""
    points, _ = camera.project(position[edges])
    lines = LineCollection(list(points), colors=color, linewidths=width, capstyle="round", zorder=order)
    axes.add_collection(lines, autolim=False)
    return lines
