"""The specimen: its fibres, the constants fitted to its networks, and what the last load step makes of it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpecFromSubplotSpec, SubplotSpec

from fibrous_study.datasets import read, write_table
from fibrous_study.figures import style
from fibrous_study.figures.deformed import CAMERA, Body, Run, draw_bar, field_scale, last_step
from fibrous_study.figures.projection import draw_axes_cross, fit_view

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
    columns = {"element": np.arange(specimen.sizes["element"]), "H_largest": largest_eigenvalue(specimen)}
    for run in runs:
        columns |= {f"{run.name}_{name}": values for name, values in run.elements.items()}
    return pd.DataFrame(columns)


def largest_eigenvalue(specimen: xr.Dataset) -> np.ndarray:
    """The largest eigenvalue of H of each element, shape (elements,)."""
    return np.linalg.eigvalsh(specimen["structure_tensor"].values)[:, -1]


@matplotlib.rc_context(style.SHEET)
def draw(specimen: xr.Dataset, runs: list[Run]) -> Figure:
    """Panel a, the specimen at rest, beside one row of panels for each run."""
    height = 25.0 + 46.0 * len(runs)
    figure = style.new_figure(style.FULL_WIDTH_MM, height)
    bottom, top = 19.0 / height, 1.0 - 6.0 / height
    # Constants that no run's law has are left out.
    shown = {
        key: field for key, field in FIELDS.items() if any(np.isfinite(run.elements[field[0]]).any() for run in runs)
    }
    titles = TITLES if len(runs) == len(TITLES) else [run.name.replace("_", " ") for run in runs]
    widths = [1.4] + [1.0] * len(shown)
    columns = figure.add_gridspec(
        1, len(widths), left=0.01, right=0.995, bottom=bottom, top=top, wspace=0.08, width_ratios=widths
    )
    body = Body.of(specimen)
    _draw_fibers(figure, columns[0], specimen, body)
    for number, (letter, (name, label)) in enumerate(shown.items(), start=1):
        colors = ScalarMappable(field_scale([run.elements[name] for run in runs]), "viridis")
        cells = GridSpecFromSubplotSpec(len(runs), 1, columns[number], hspace=0.1)
        for row, run in enumerate(runs):
            axes = figure.add_subplot(cells[row])
            deformed = letter == DEFORMED
            position = run.position if deformed else body.rest
            body.draw(axes, position, run.elements[name], colors, rest_width=0.4 if deformed else 0.0)
            body.show(axes, runs)
            axes.set_title(titles[row], pad=1.0)
            style.panel_letter(axes, f"{letter}{row + 1}", dx_mm=4.0)
        draw_bar(figure, columns[number].get_position(figure), colors, label, "max")
    note = f"{specimen.attrs['origin'].capitalize()}. a: at rest, lines are the mean directions of fibres. "
    note += f"d: means over the elements at load step {runs[0].step}; lines are the edges at rest.\n"
    note += f"Scales of b to d hold {style.COLORED_SHARE:.0%} of the elements."
    figure.text(0.012, 0.01, note, fontsize=6.0)
    return figure


def _draw_fibers(figure: Figure, spec: SubplotSpec, specimen: xr.Dataset, body: Body) -> None:
    """Panel a: the body at rest with its mean directions of fibres, its bones and a bar of a round length below."""
    axes = figure.add_subplot(spec)
    largest = largest_eigenvalue(specimen)
    colors = ScalarMappable(Normalize(float(largest.min()), float(largest.max())), "viridis")
    body.draw_at_rest(axes, largest, colors, specimen["fiber_direction"].values, 0.15, 0.6, 0.6)
    points, _ = CAMERA.project(body.rest)
    for enthesis, text in BONES.items():
        x, y = points[specimen["enthesis"].values == enthesis].mean(axis=0)
        side = float(np.sign(x - points[:, 0].mean()))  # away from the middle of the specimen
        place: dict[str, Any] = {"xytext": (side * 9.0, 0.0), "textcoords": "offset points", "va": "center"}
        axes.annotate(text, (x, y), **place, ha="left" if side > 0.0 else "right", fontsize=6.5)
    (left, low), (right, high) = points.min(axis=0), points.max(axis=0)
    width, height = right - left, high - low
    y = low - 0.2 * height
    power = 10.0 ** np.floor(np.log10(0.4 * width))
    length = power * max(digit for digit in (1, 2, 5) if digit * power <= 0.4 * width)
    start = left + 0.5 * width
    axes.plot([start, start + length], [y, y], color=style.INK, lw=1.2, solid_capstyle="butt")
    axes.text(start + 0.5 * length, y - 0.02 * height, f"{length:g} mm", ha="center", va="top", fontsize=6.5)
    draw_axes_cross(axes, CAMERA, 0.2 * width, np.array([left + 0.1 * width, y]))
    fit_view(axes, np.array([[left - 0.12 * width, low - 0.25 * height], [right + 0.12 * width, high]]))
    style.panel_letter(axes, "a", dx_mm=4.0)
    draw_bar(figure, spec.get_position(figure), colors, "largest eigenvalue of $H$ (1)")
