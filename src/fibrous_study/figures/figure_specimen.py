"""The specimen: its fibres, the constants fitted to its networks, and what the last load step makes of it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpecFromSubplotSpec, SubplotSpec

from fibrous_study.datasets import read, write_table
from fibrous_study.figures import style
from fibrous_study.figures.deformed import CAMERA, COLORED_SHARE, Run, draw_bar, field_scale, last_step, show_bodies
from fibrous_study.figures.projection import draw_axes_cross, fit_view
from fibrous_study.figures.surface_of_mesh import Surface, draw_directions, draw_edges, draw_surface

# Columns of panels that show each run: letter, column of the table, label of the colours.
FIELDS = {
    "b": ("C2_MPa", "$C_2$ (MPa)"),
    "c": ("C3", "$C_3$ (1)"),
    "d": ("largest_principal_stretch", "largest principal stretch (1)"),
}
DEFORMED = "d"
TITLES = ("initial constants", "after the refit")  # of a run and the one with its constants fitted anew
BONES = {1: "fixed\nbone", 2: "moved\nbone"}


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Draw inputs["specimen"] and the runs inputs["tissue"], named after their files.

    Writes outputs["data"], a row an element, and outputs["png"], outputs["svg"]. Raises DatasetError where a run is not
    one of this specimen.
    """
    specimen = read(inputs["specimen"][0], "specimen")
    runs = [last_step(path, specimen) for path in inputs["tissue"]]
    write_table(element_table(specimen, runs), outputs["data"], params)
    style.save(draw(specimen, runs), outputs, params)


def element_table(specimen: xr.Dataset, runs: list[Run]) -> pd.DataFrame:
    """One row an element: the largest eigenvalue of H, and the numbers of each run under the run's name."""
    columns = {
        "element": np.arange(specimen.sizes["element"]),
        "H_largest": np.linalg.eigvalsh(specimen["structure_tensor"].values)[:, -1],
    }
    for one in runs:
        columns |= {f"{one.name}_{name}": values for name, values in one.elements.items()}
    return pd.DataFrame(columns)


@matplotlib.rc_context(style.SHEET)
def draw(specimen: xr.Dataset, runs: list[Run]) -> Figure:
    """Panel a, the specimen at rest, beside one row of panels for each run."""
    height = 25.0 + 46.0 * len(runs)
    figure = style.new_figure(style.FULL_WIDTH_MM, height)
    bottom, top = 19.0 / height, 1.0 - 6.0 / height
    shown = _shown(runs)
    titles = TITLES if len(runs) == len(TITLES) else [one.name.replace("_", " ") for one in runs]
    widths = [1.4] + [1.0] * len(shown)
    columns = figure.add_gridspec(
        1, len(widths), left=0.01, right=0.995, bottom=bottom, top=top, wspace=0.08, width_ratios=widths
    )
    surface = Surface.of(specimen["element_nodes"].values)
    rest = specimen["node_position"].values
    edges = surface.sharp_edges(rest)
    _draw_fibers(figure, columns[0], specimen, surface)
    for number, (letter, (name, label)) in enumerate(shown.items(), start=1):
        colors = ScalarMappable(field_scale([one.elements[name] for one in runs]), "viridis")
        cells = GridSpecFromSubplotSpec(len(runs), 1, columns[number], hspace=0.1)
        for row, one in enumerate(runs):
            axes = figure.add_subplot(cells[row])
            position = one.position if letter == DEFORMED else rest
            draw_surface(axes, CAMERA, surface, position, one.elements[name], colors)
            draw_edges(axes, CAMERA, position, edges, style.INK, width=0.4, order=1)
            if letter == DEFORMED:
                draw_edges(axes, CAMERA, rest, edges, style.INK, width=0.4, order=3)
            show_bodies(axes, [rest, *(other.position for other in runs)])
            axes.set_title(titles[row], pad=1.0)
            style.panel_letter(axes, f"{letter}{row + 1}", dx_mm=4.0)
        draw_bar(figure, columns[number].get_position(figure), colors, label, "max")
    note = f"{specimen.attrs['origin'].capitalize()}. a: at rest, lines are the mean directions of fibres. "
    note += f"d: means over the elements at load step {runs[0].step}; lines are the edges at rest.\n"
    note += f"Scales of b to d hold {COLORED_SHARE:.0%} of the elements."
    figure.text(0.012, 0.01, note, fontsize=6.0)
    return figure


def _shown(runs: list[Run]) -> dict[str, tuple[str, str]]:
    """The FIELDS without constants that no run's law has."""
    return {
        key: field for key, field in FIELDS.items() if any(np.isfinite(one.elements[field[0]]).any() for one in runs)
    }


def _draw_fibers(figure: Figure, spec: SubplotSpec, specimen: xr.Dataset, surface: Surface) -> None:
    axes = figure.add_subplot(spec)
    rest = specimen["node_position"].values
    largest = np.linalg.eigvalsh(specimen["structure_tensor"].values)[:, -1]
    colors = ScalarMappable(Normalize(float(largest.min()), float(largest.max())), "viridis")
    draw_surface(axes, CAMERA, surface, rest, largest, colors, mesh_width=0.15)
    draw_directions(axes, CAMERA, surface, rest, specimen["fiber_direction"].values, width=0.6)
    draw_edges(axes, CAMERA, rest, surface.sharp_edges(rest), style.INK, width=0.6, order=1)
    _name_bones(axes, specimen)
    _draw_scale(axes, rest)
    style.panel_letter(axes, "a", dx_mm=4.0)
    draw_bar(figure, spec.get_position(figure), colors, "largest eigenvalue of $H$ (1)")


def _name_bones(axes: Axes, specimen: xr.Dataset) -> None:
    """Write beside each enthesis what its bone does, away from the middle of the specimen."""
    points, _ = CAMERA.project(specimen["node_position"].values)
    middle = points.mean(axis=0)
    for enthesis, text in BONES.items():
        there = points[specimen["enthesis"].values == enthesis].mean(axis=0)
        side = float(np.sign(there[0] - middle[0]))
        axes.annotate(
            text,
            tuple(there),
            xytext=(side * 9.0, 0.0),
            textcoords="offset points",
            ha="left" if side > 0.0 else "right",
            va="center",
            fontsize=6.5,
        )


def _draw_scale(axes: Axes, rest: np.ndarray) -> None:
    """Draw a bar of a round length and the axes' directions below the body, and show all of it."""
    points, _ = CAMERA.project(rest)
    (left, low), (right, high) = points.min(axis=0), points.max(axis=0)
    width, y = right - left, low - 0.2 * (high - low)
    power = 10.0 ** np.floor(np.log10(0.4 * width))
    length = power * max(digit for digit in (1, 2, 5) if digit * power <= 0.4 * width)
    start = left + 0.5 * width
    axes.plot([start, start + length], [y, y], color=style.INK, lw=1.2, solid_capstyle="butt")
    axes.text(start + 0.5 * length, y - 0.02 * (high - low), f"{length:g} mm", ha="center", va="top", fontsize=6.5)
    draw_axes_cross(axes, CAMERA, np.array([left + 0.1 * width, y]), 0.2 * width)
    fit_view(axes, np.array([[left - 0.12 * width, low - 0.25 * (high - low)], [right + 0.12 * width, high]]))
