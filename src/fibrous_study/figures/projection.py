"""Networks out of their files and drawn in space: one camera, fibres sorted by depth, the outline of their cube."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from numpy.typing import ArrayLike, NDArray

from fibrous.errors import DatasetError
from fibrous_study.figures.style import FAINT, INK, arrow, stretch_colors

Array = NDArray[np.float64]

# Corners of the unit cube at (±½, ±½, ±½), and its twelve edges: the pairs of corners one step apart.
_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_EDGES = [(a, b) for a in range(8) for b in range(a + 1, 8) if np.abs(_CORNERS[a] - _CORNERS[b]).sum() == 1.0]
_FACES = [(axis, sign) for axis in range(3) for sign in (-0.5, 0.5)]


@dataclass(frozen=True)
class Camera:
    """An orthographic view: rows of `frame` are the directions to the right, up, and towards the reader."""

    frame: Array

    @classmethod
    def looking_from(cls, azimuth_deg: float, elevation_deg: float) -> Camera:
        """The view from that azimuth about z, counted from x towards y, and that elevation above the xy plane."""
        azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
        right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        towards = np.array(
            [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
        )
        return cls(np.array([right, np.cross(towards, right), towards]))

    def project(self, positions: Array) -> tuple[Array, Array]:
        """Points in the picture, shape (..., 2), and their depth, shape (...), larger nearer to the reader."""
        seen = positions @ self.frame.T
        return seen[..., :2], seen[..., 2]


# Along −z with x to the right and y up; along +y with x to the right and z up.
XY_VIEW = Camera(np.eye(3))
XZ_VIEW = Camera(np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]))
# Of networks in their cubes.
CUBE_VIEW = Camera.looking_from(azimuth_deg=-62.0, elevation_deg=22.0)


def index_of(networks: xr.Dataset, name: str) -> int:
    """Where the network of that name stands. Raises DatasetError where none or several have it."""
    there = np.flatnonzero(networks["name"].values == name)
    if there.size != 1:
        raise DatasetError(f"the networks hold {there.size} named '{name}' where the figure draws one")
    return int(there[0])


def fibers_of(networks: xr.Dataset, index: int) -> Array:
    """Ends of the fibres of the network that stands there, shape (fibers, 2, 3), edges.

    A `Network` would bring along the engine, which figures have no time to import.
    """
    rows = {}
    for dim in ("node", "fiber"):
        counts = networks[f"{dim}_count"].values
        rows[dim] = slice(int(counts[:index].sum()), int(counts[: index + 1].sum()))
    nodes = networks["node_position"].values[rows["node"]]
    return np.asarray(nodes[networks["fiber_nodes"].values[rows["fiber"]]])


def draw_network(
    axes: Axes,
    camera: Camera,
    fibers: Array,
    colors: ArrayLike,
    width: float,
    fade: float,
    gradient: Array | None = None,
    edge_bar: bool = False,
) -> None:
    """Draw fibres (see draw_fibers) in their cube under F, shape (3, 3), at rest without it, and show all of it.

    With `edge_bar` a bar below is as long as the edge of the cube at rest.
    """
    draw_fibers(axes, camera, fibers, np.broadcast_to(colors, (len(fibers), 3)), width, fade)
    points = draw_outline(axes, camera, np.eye(3) if gradient is None else gradient)
    fit_view(axes, np.vstack([points, draw_edge_length(axes, points)]) if edge_bar else points)


def draw_state(
    axes: Axes, camera: Camera, state: xr.Dataset, largest: float, width: float = 0.35, edge_bar: bool = True
) -> None:
    """Draw one state of a file of states, fibres in colours of their stretch up to `largest`."""
    fibers = state["node_position"].values[state["fiber_nodes"].values]
    colors, gradient = stretch_colors(state["fiber_stretch"].values, largest), state["deformation_gradient"].values
    draw_network(axes, camera, fibers, colors, width, 0.4, gradient, edge_bar)


def draw_fibers(
    axes: Axes, camera: Camera, ends: Array, colors: Array, width: float, fade: float = 0.0
) -> LineCollection:
    """Draw fibres as one collection, the farthest first, rasterised inside vector files.

    `ends` has shape (fibers, 2, 3), `colors` (fibers, 3), red, green and blue from 0 to 1. With `fade` the farthest
    fibre is mixed with that share of white, the nearest with none.
    """
    points, depth = camera.project(ends)
    depth = depth.mean(axis=1)
    order = np.argsort(depth, kind="stable")
    farness = (depth.max() - depth) / max(float(np.ptp(depth)), 1e-12)
    shade = colors + (1.0 - colors) * (fade * farness)[:, None]
    lines = LineCollection(
        list(points[order]), colors=shade[order], linewidths=width, capstyle="round", rasterized=True, zorder=2
    )
    axes.add_collection(lines, autolim=False)
    return lines


def draw_outline(axes: Axes, camera: Camera, gradient: Array) -> Array:
    """Draw the unit cube under F, shape (3, 3), edges behind it faint; returns its corners in the picture, (8, 2)."""
    corners = _CORNERS @ gradient.T
    points, _ = camera.project(corners)
    # A face is seen when its outward normal, F^-T N, points to the reader; an edge, when one of its two faces is.
    inverse = np.linalg.inv(gradient)
    for a, b in _EDGES:
        faces = [(axis, sign) for axis, sign in _FACES if _CORNERS[a][axis] == _CORNERS[b][axis] == sign]
        seen = any(np.sign(sign) * inverse[axis] @ camera.frame[2] > 1e-9 for axis, sign in faces)
        color, width, order = (INK, 0.6, 3) if seen else (FAINT, 0.4, 1)
        axes.plot(*points[[a, b]].T, color=to_rgb(color), lw=width, zorder=order, solid_capstyle="round")
    return points


def draw_edge_length(axes: Axes, corners: Array) -> Array:
    """Draw a bar as long as the undeformed cube's edge below the network; returns its ends, shape (2, 2)."""
    (left, low), (right, high) = corners.min(axis=0), corners.max(axis=0)
    middle, y = 0.5 * (left + right), low - 0.08 * max(high - low, right - left)
    bar = np.array([[middle - 0.5, y], [middle + 0.5, y]])
    axes.plot(*bar.T, color=INK, lw=1.2, solid_capstyle="butt")
    return bar


def draw_axes_cross(axes: Axes, camera: Camera, length: float, origin: Array | None = None) -> None:
    """Draw the axes' directions without one that points at the reader.

    `origin`, shape (2,), is a point of the picture; without it, one near the lower left corner of what is shown.
    """
    if origin is None:
        origin = np.array([axes.get_xlim()[0], axes.get_ylim()[0]]) + 0.1
    tips, _ = camera.project(np.eye(3) * length)
    for name, tip in zip("xyz", tips, strict=True):
        if np.linalg.norm(tip) < 0.2 * length:
            continue
        ends = {"xy": tuple(origin + tip), "xytext": tuple(origin)}
        axes.annotate("", **ends, arrowprops=arrow(0.5, 4), annotation_clip=False)
        x, y = origin + tip * 1.25
        axes.text(x, y, name, fontsize=6.0, ha="center", va="center")


def fit_view(axes: Axes, points: Array, margin: float = 0.04) -> None:
    """Show all `points`, shape (n, 2), to one scale in the middle of the axes, with a margin; no axis lines."""
    box = axes.get_window_extent()
    low, high = points.min(axis=0), points.max(axis=0)
    scale = (1.0 + 2.0 * margin) * float(np.max((high - low) / [box.width, box.height]))
    middle, half = 0.5 * (low + high), 0.5 * scale * np.array([box.width, box.height])
    axes.set(xlim=(middle[0] - half[0], middle[0] + half[0]), ylim=(middle[1] - half[1], middle[1] + half[1]))
    axes.set_axis_off()
