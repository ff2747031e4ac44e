"""What figures of the tissue share: the last load step of a run, the body drawn with it, colour bars below panels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

from fibrous.deformation import largest_principal_stretch
from fibrous_study.figures import style
from fibrous_study.figures.projection import Camera, fit_view
from fibrous_study.figures.surface_of_mesh import Surface, draw_directions, draw_edges, draw_surface
from fibrous_study.tissue_runs import fields_of, read_run

Array = NDArray[np.float64]

CAMERA = Camera.looking_from(azimuth_deg=-74.0, elevation_deg=50.0)


@dataclass(frozen=True)
class Run:
    """The last load step of one run: node positions, shape (nodes, 3), mm, and numbers of each element by name."""

    name: str
    step: int
    position: Array
    elements: Mapping[str, Array]


def last_step(path: Path, specimen: xr.Dataset) -> Run:
    """The last load step of the run in the file at `path`, which is named after the run.

    Raises DatasetError where the run is not one of this specimen.
    """
    last = read_run(path, specimen, "specimen").isel(step=-1)
    fields = fields_of(last)
    return Run(
        path.stem,
        int(last["step"]),
        specimen["node_position"].values + fields.displacement,
        {
            "C2_MPa": last["C2"].values,
            "C3": last["C3"].values,
            "largest_principal_stretch": largest_principal_stretch(last["deformation_gradient"].values).mean(axis=1),
            "maximum_shear_stress_MPa": fields.shear_stress,
            "maximum_shear_strain": fields.shear_strain,
        },
    )


@dataclass(frozen=True)
class Body:
    """The specimen as it is drawn: its surface, its nodes at rest, shape (nodes, 3), and its sharp edges."""

    surface: Surface
    rest: Array
    edges: NDArray[np.int64]

    @classmethod
    def of(cls, specimen: xr.Dataset) -> Self:
        """The body of a dataset of the kind `specimen`."""
        surface, rest = Surface.of(specimen["element_nodes"].values), specimen["node_position"].values
        return cls(surface, rest, surface.sharp_edges(rest))

    def draw_at_rest(
        self,
        axes: Axes,
        values: Array,
        colors: ScalarMappable,
        directions: Array,
        mesh_width: float,
        line_width: float,
        edge_width: float,
    ) -> None:
        """Draw its mesh in the colours of `values`, (elements,), with `directions` (elements, 3); widths in points."""
        draw_surface(axes, CAMERA, self.surface, self.rest, values, colors, mesh_width)
        draw_directions(axes, CAMERA, self.surface, self.rest, directions, line_width)
        draw_edges(axes, CAMERA, self.rest, self.edges, style.INK, edge_width, order=1)

    def draw(self, axes: Axes, position: Array, values: Array, colors: ScalarMappable, rest_width: float = 0.0) -> None:
        """Draw it with nodes at `position`; with a `rest_width` in points its edges at rest, too."""
        draw_surface(axes, CAMERA, self.surface, position, values, colors)
        draw_edges(axes, CAMERA, position, self.edges, style.INK, width=0.4, order=1)
        if rest_width:
            draw_edges(axes, CAMERA, self.rest, self.edges, style.INK, rest_width, order=3)

    def show(self, axes: Axes, runs: Sequence[Run]) -> None:
        """Show all of it at rest and in these runs, so that panels with the same runs share their scale."""
        points, _ = CAMERA.project(np.concatenate([self.rest, *(run.position for run in runs)]))
        fit_view(axes, points, margin=0.02)


def field_scale(values: Sequence[Array]) -> Normalize:
    """From the least of the values to one that COLORED_SHARE of them do not pass; none where there is no number.

    At the corners, where bones end, fields are singular; and constants fitted to a network that is hardly stretched are
    as large as they please.
    """
    together = np.concatenate(values)
    return Normalize(float(np.nanmin(together)), float(np.nanquantile(together, style.COLORED_SHARE)))


def draw_bar(figure: Figure, box: Bbox, colors: ScalarMappable, label: str, beyond: str = "neither") -> None:
    """Draw the colour bar of panels that fill `box`, in shares of the figure, below them.

    `beyond` says at which ends values may leave it: `neither`, `max` or `both`.
    """
    height = figure.get_figheight() / style.MM
    bar = figure.add_axes((box.x0 + 0.12 * box.width, box.y0 - 3.0 / height, 0.76 * box.width, 1.5 / height))
    # A tick's label may be as wide as six of its digits.
    ticks = MaxNLocator(max(2, int(bar.get_window_extent().width / figure.dpi / style.MM / 9.0)), steps=[1, 2, 5, 10])
    figure.colorbar(colors, cax=bar, orientation="horizontal", label=label, ticks=ticks, extend=beyond)
