"""Networks inside chosen elements of the tissue: the coupled simulation beside the hybrid method (section 2.5)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fibrous_study.datasets import read, write_table
from fibrous_study.figures import style
from fibrous_study.figures.projection import CUBE_VIEW, draw_axes_cross, draw_state

MEAN = "mean"
SHARES = np.linspace(0.0, 1.0, 101)
ROW_MM = 52.0

# The files by element, those of one element in the order of the runs.
Elements = dict[int, list[xr.Dataset]]


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Draw inputs["states"], the same elements of two runs.

    Writes outputs["data"], the distributions, and outputs["png"], outputs["svg"]; the networks are drawn as they
    stand at the last step in the states files.
    """
    elements: Elements = {}
    for path in inputs["states"]:
        states = read(path, "microstructure")
        elements.setdefault(int(states.attrs["element"]), []).append(states)
    write_table(distributions(elements), outputs["data"], params)
    style.save(draw(elements), outputs, params)


def last_state(states: xr.Dataset) -> xr.Dataset:
    """The states of the last step at which the network found an equilibrium along the mean F of its element."""
    return states.isel(step=np.flatnonzero(states["converged"].sel(path=MEAN).values)[-1])


def distributions(elements: Elements) -> pd.DataFrame:
    """How the stretches of fibres are distributed at the last step: one row a share, for each element, run and path.

    `share` of the fibres have at most the stretch `fiber_stretch`. Paths without an equilibrium there have no rows.
    """
    tables = []
    for element, runs in elements.items():
        for states in runs:
            end = last_state(states)
            for path in end["path"].values[end["converged"].values]:
                stretch = np.quantile(end["fiber_stretch"].sel(path=path).values, SHARES)
                about = {"element": element, "run": end.attrs["run"], "path": path, "step": int(end["step"])}
                tables.append(pd.DataFrame({**about, "share": SHARES, "fiber_stretch": stretch}))
    return pd.concat(tables, ignore_index=True)


@matplotlib.rc_context(style.SHEET)
def draw(elements: Elements) -> Figure:
    """A row an element: the network in each run, and the distributions of fibre stretches."""
    table = distributions(elements)
    height = ROW_MM * len(elements) + 14.0
    figure = style.new_figure(style.FULL_WIDTH_MM, height)
    runs = max(len(files) for files in elements.values())
    # Between networks and distributions the scale of the colours has a column of its own.
    rows = figure.add_gridspec(len(elements), runs + 2, width_ratios=[*[1.0] * runs, 0.45, 0.85])
    rows.update(left=0.01, right=0.985, bottom=16.0 / height, top=1.0 - 7.0 / height, hspace=0.3, wspace=0.04)
    ends = {element: [last_state(states).sel(path=MEAN) for states in files] for element, files in elements.items()}
    largest = style.stretch_limit(np.concatenate([end["fiber_stretch"].values for row in ends.values() for end in row]))
    for row, (element, states) in enumerate(ends.items()):
        for column, state in enumerate(states):
            axes = figure.add_subplot(rows[row, column])
            draw_state(axes, CUBE_VIEW, state, largest)
            if row == column == 0:
                draw_axes_cross(axes, CUBE_VIEW, 0.25)
            turned = np.linalg.eigvalsh(state["orientation_tensor"].values)[-1]
            title = f"element {element}, {state.attrs['run'].replace('_', ' ')}"
            axes.set_title(f"{title}\nlargest eigenvalue of $h$: {turned:.3f}", pad=1.0)
            style.panel_letter(axes, f"{chr(ord('a') + row)}{column + 1}", dx_mm=4.0)
        axes = figure.add_subplot(rows[row, runs + 1])
        _draw_distributions(axes, table[table["element"] == element])
        style.panel_letter(axes, f"{chr(ord('a') + row)}{runs + 1}")
        if row == len(elements) - 1:
            axes.set_xlabel("fibre stretch $\\lambda$ (1)")
    box = rows[0, runs - 1].get_position(figure)
    style.stretch_bar(figure, (box.x1 + 0.012, box.y0 + 0.1 * box.height, 0.011, 0.75 * box.height), largest)
    figure.text(0.012, 0.012, _note(elements), fontsize=6.0)
    return figure


def _draw_distributions(axes: Axes, table: pd.DataFrame) -> None:
    """The mean path of each run as a line, all of its Gauss points as a band."""
    for number, (name, of_run) in enumerate(table.groupby("run", sort=False)):
        look = style.law_line(number)
        mean, points = of_run[of_run["path"] == MEAN], of_run[of_run["path"] != MEAN].groupby("share")["fiber_stretch"]
        axes.fill_betweenx(SHARES, points.min(), points.max(), color=look["color"], alpha=0.2, lw=0.0, zorder=2)
        axes.plot(mean["fiber_stretch"], mean["share"], **look, label=str(name).replace("_", " "), zorder=3)
    axes.set_ylabel("share of fibres up to $\\lambda$ (1)")
    axes.set_ylim(0.0, 1.0)
    axes.legend(loc="upper left")


def _note(elements: Elements) -> str:
    first = next(iter(elements.values()))[0]
    return (
        f"{str(first.attrs['origin']).capitalize()} at load step {int(last_state(first)['step'])}. Networks and lines: "
        "under the mean F of their element; bands: under F of its Gauss points.\nBars: edge of the undeformed cube. "
        f"Farther fibres are drawn paler. The colour scale holds {style.COLORED_SHARE:.0%} of the fibres."
    )
