"""Figure 3: the case-study network under every load at both ranges, and how its fibres turn."""

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
from matplotlib.gridspec import GridSpecFromSubplotSpec, SubplotSpec

from fibrous.deformation import Load
from fibrous_study.datasets import read, write_table
from fibrous_study.figures import curves, style
from fibrous_study.figures.projection import CUBE_VIEW, draw_axes_cross, draw_state

# How the magnitude of a load is written, by its kind; that of a load with its own F is the part of its path.
MAGNITUDES = {
    "uniaxial": "$\\lambda = {:.2f}$",
    "biaxial": "$m = {:.2f}$",
    "shear": "$\\gamma = {:.2f}$",
    None: "at {:.0%}",
}


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Draw the network config["network"] from inputs["states"] and inputs["curves"], in config["protocols"]' order.

    Writes outputs["data"], the table that panels c and d draw, and outputs["png"], outputs["svg"]; panels a and b
    draw the last converged state of each load as it stands in the states files.
    """
    network, protocols = params["config"]["network"], params["config"]["protocols"]
    states = [read(path, "states") for path in inputs["states"]]
    paths = zip(protocols, inputs["curves"], strict=True)
    table = curves.stacked({protocol: curves.curve_table(path, network) for protocol, path in paths}, "protocol")
    write_table(table.drop(columns=["strain_energy_density_MPa", "largest_principal_stretch"]), outputs["data"], params)
    style.save(draw(states, table), outputs, params)


@matplotlib.rc_context(style.SHEET)
def draw(states: list[xr.Dataset], table: pd.DataFrame) -> Figure:
    """Panels a and b, one column a load, above panels c and d; `table` holds the protocols in the order of `states`."""
    figure = style.new_figure(style.FULL_WIDTH_MM, 158.0)
    rows = figure.add_gridspec(
        3, 1, left=0.01, right=0.905, top=0.945, bottom=0.085, height_ratios=[1, 1, 1], hspace=0.28
    )
    parts = [part for _, part in table.groupby("protocol", sort=False)]
    below = GridSpecFromSubplotSpec(1, 4, rows[2], width_ratios=[0.1, 1, 1, 0.28], wspace=0.36)
    for row, (upper, lower) in enumerate(zip("ab", "cd", strict=True)):
        _draw_networks(figure, rows[row], states[row], parts[row], upper)
        axes = figure.add_subplot(below[row + 1])
        _draw_eigenvalues(axes, parts[row], curves.load_numbers(table))
        axes.set_title(f"end states: row {upper}", loc="right", color=style.FAINT)
        style.panel_letter(axes, lower)
    axes.legend(handles=curves.load_handles(table), loc="upper left", bbox_to_anchor=(1.04, 1.0), handlelength=1.4)
    note = "Bars: edge of the undeformed cube. Farther fibres are drawn paler."
    note += f" Colour scales hold {style.COLORED_SHARE:.0%} of the fibres of their row."
    figure.text(0.012, 0.006, note, fontsize=6.0)
    return figure


def last_state(states: xr.Dataset, load: str) -> xr.Dataset:
    """The state of the last step of `load` that the file holds an equilibrium for."""
    under_load = states.sel(deformation=load)
    return under_load.isel(step=np.flatnonzero(np.isfinite(under_load["fiber_stretch"].values).all(axis=1))[-1])


def _draw_networks(figure: Figure, spec: SubplotSpec, states: xr.Dataset, table: pd.DataFrame, letter: str) -> None:
    ends = {load: last_state(states, load) for load in states["deformation"].values.astype(str)}
    largest = style.stretch_limit(np.concatenate([state["fiber_stretch"].values for state in ends.values()]))
    cells = GridSpecFromSubplotSpec(1, len(ends), spec, wspace=0.08)
    for column, (load, state) in enumerate(ends.items()):
        axes = figure.add_subplot(cells[column])
        draw_state(axes, CUBE_VIEW, state, largest)
        if letter == "a" and column == 0:
            draw_axes_cross(axes, CUBE_VIEW, 0.3)
        of_load, step = table[table["deformation"] == load].set_index("step"), int(state["step"])
        magnitude = MAGNITUDES[Load.kind_of(load)].format(of_load.loc[step, "magnitude"])
        axes.set_title(f"{style.load_label(load)}\n{magnitude}", pad=1.0)
        style.panel_letter(axes, f"{letter}{column + 1}", dx_mm=4.0)
        if step != of_load.index.max() or of_load.loc[step, "amplitude_limited"]:
            note = "amplitude limit" if step == of_load.index.max() else "no equilibrium beyond"
            axes.text(0.5, 0.0, note, transform=axes.transAxes, ha="center", va="top", fontsize=6.0)
    box = spec.get_position(figure)
    style.stretch_bar(figure, (0.92, box.y0 + 0.08 * box.height, 0.011, 0.75 * box.height), largest)


def _draw_eigenvalues(axes: Axes, table: pd.DataFrame, numbers: Mapping[str, int]) -> None:
    for load in table["deformation"].unique():
        curves.draw_load(axes, table[table["deformation"] == load], "largest_orientation_eigenvalue", numbers[load])
    axes.set(xlabel="averaged fibre stretch $\\lambda_f$ (1)", ylabel="largest eigenvalue of $h$ (1)")
