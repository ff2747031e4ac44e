"""Networks drawn in space: one camera, fibres sorted by depth, the cube's outline before and behind them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from fibrous_study.figures.style import FAINT, INK

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


def draw_axes_cross(axes: Axes, camera: Camera, origin: Array, length: float) -> None:
    """Draw the axes' directions at `origin`, shape (2,), in the picture, without one that points at the reader."""
    tips, _ = camera.project(np.eye(3) * length)
    for name, tip in zip("xyz", tips, strict=True):
        if np.linalg.norm(tip) < 0.2 * length:
            continue
        axes.annotate(
            "",
            xy=tuple(origin + tip),
            xytext=tuple(origin),
            arrowprops={"arrowstyle": "-|>", "lw": 0.5, "color": INK, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 4},
            annotation_clip=False,
        )
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
