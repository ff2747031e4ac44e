"""Figure 2: from fibres to two constants, one network followed through the stages of the study."""

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
from matplotlib.patches import FancyArrowPatch

from fibrous_study.datasets import read, write_table
from fibrous_study.figures import style
from fibrous_study.figures.curves import (
    curve_table,
    draw_load,
    energy_table,
    fit_label,
    load_handles,
    load_numbers,
    pooled_fits,
)
from fibrous_study.figures.figure_3 import CAMERA, COLORED_SHARE, last_state
from fibrous_study.figures.networks import fibers_of, index_of
from fibrous_study.figures.projection import draw_fibers, draw_outline, fit_view

# Stage whose work a panel shows, its title, and the equations that it evaluates.
PANELS = (
    (
        "networks",
        "fibres between random points",
        "$\\phi = \\chi \\Sigma \\pi R^2 L \\, / \\, \\chi^3 V$   (Eq. 5)\n"
        "$H = \\Sigma V N \\otimes N \\, / \\, \\Sigma V$   (Eq. 3)",
    ),
    (
        "curves",
        "deformed, in equilibrium",
        "$f = (kA/B) \\, [\\exp(B E) - 1]$   (Eq. 6)\n$\\Sigma f = 0$ at every inner node",
    ),
    (
        "curves",
        "energy against averaged stretch",
        "$W = \\Sigma w V \\, / \\, V$   (Eq. 4)\n$\\lambda_f = \\sqrt{H : C}$",
    ),
    (
        "fits",
        "two constants",
        "$W = \\frac{C_2}{2 C_3} [\\exp(C_3 (\\lambda_f^2 - 1)^2) - 1]$\n(Eq. 2)",
    ),
)
LETTERS = "abcd"
# Left, bottom, width, height of the panels, and where their words begin, in shares of the figure.
BOXES = ((0.01, 0.38, 0.18, 0.48), (0.25, 0.38, 0.20, 0.48), (0.545, 0.40, 0.165, 0.46), (0.815, 0.40, 0.175, 0.46))
LEFT = (0.01, 0.25, 0.495, 0.765)


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Draw config["network"] of inputs["networks"] with its states, curves and fits, for config["load_set"].

    config["jobs"] says of each stage how many jobs it is. Writes outputs["data"], the points and curves of panels c
    and d, and outputs["png"], outputs["svg"].
    """
    config = params["config"]
    name, load_set = config["network"], config["load_set"]
    curves = curve_table(inputs["curves"][0], name)
    curves = curves[curves["deformation"].isin(load_set["loads"])].assign(name=name)
    fits = pooled_fits(inputs["fits"][0])
    fits = fits[(fits["name"] == name) & (fits["load_set"] == load_set["name"])]
    table = energy_table(curves, fits, "name")
    write_table(table, outputs["data"], params)
    networks, states = read(inputs["networks"][0], "networks"), read(inputs["states"][0], "states")
    style.save(draw(networks, states, curves, fits, table, config["jobs"]), outputs, params)


@matplotlib.rc_context(style.SHEET)
def draw(
    networks: xr.Dataset,
    states: xr.Dataset,
    curves: pd.DataFrame,
    fits: pd.DataFrame,
    table: pd.DataFrame,
    jobs: Mapping[str, int],
) -> Figure:
    """Four panels from left to right; `jobs` is the number of jobs of each stage."""
    figure = style.new_figure(style.FULL_WIDTH_MM, 74.0)
    panels = [figure.add_axes(box) for box in BOXES]
    name, load = str(fits["name"].iloc[0]), str(curves["deformation"].iloc[0])
    _draw_at_rest(panels[0], networks, name)
    _draw_deformed(panels[1], states, load)
    numbers = load_numbers(curves)
    for axes in panels[2:]:
        for deformation, number in numbers.items():
            draw_load(axes, curves[curves["deformation"] == deformation], "strain_energy_density_MPa", number)
        axes.set_xlabel("averaged stretch $\\lambda_f$ (1)")
        axes.set_ylabel("energy density $W$ (MPa)")
    fitted = table[table["kind"] == "fit"]
    panels[3].plot(fitted["averaged_stretch"], fitted["strain_energy_density_MPa"], **style.fit_style(0), zorder=5)
    label = fit_label(fits.to_dict("records")[0], "\n")
    panels[3].text(0.05, 1.0, label, transform=panels[3].transAxes, va="top", fontsize=6.0)
    panels[3].set_ylim(panels[2].get_ylim())
    for letter, left, (stage, title, equations) in zip(LETTERS, LEFT, PANELS, strict=True):
        figure.text(left, 0.94, letter, fontsize=8.0, fontweight="bold", va="center")
        figure.text(left + 0.018, 0.94, title, va="center")
        figure.text(left, 0.23, f"stage {stage}, {jobs[stage]} files", va="top", fontsize=6.5, color=style.FAINT)
        figure.text(left, 0.175, equations, va="top", fontsize=6.5, linespacing=1.6)
    figure.text(LEFT[1] + 0.09, 0.31, style.load_label(load), ha="center", fontsize=6.5)
    for left in LEFT[1:]:
        _draw_arrow(figure, left - 0.02)
    figure.legend(handles=load_handles(curves), loc="lower right", ncols=len(numbers), bbox_to_anchor=(0.995, -0.005))
    return figure


def _draw_at_rest(axes: Axes, networks: xr.Dataset, name: str) -> None:
    fibers = fibers_of(networks, index_of(networks, name))
    gray = np.full((len(fibers), 3), 0.25)
    draw_fibers(axes, CAMERA, fibers, gray, width=0.3, fade=0.6)
    fit_view(axes, draw_outline(axes, CAMERA, np.eye(3)))


def _draw_deformed(axes: Axes, states: xr.Dataset, load: str) -> None:
    state = states.sel(deformation=load, step=last_state(states, load))
    stretch = state["fiber_stretch"].values
    fibers = state["node_position"].values[states["fiber_nodes"].values]
    colors = style.stretch_colors(stretch, style.stretch_limit(stretch, COLORED_SHARE))
    draw_fibers(axes, CAMERA, fibers, colors, width=0.3, fade=0.4)
    fit_view(axes, draw_outline(axes, CAMERA, state["deformation_gradient"].values))


def _draw_arrow(figure: Figure, middle: float) -> None:
    """An arrow to the right between two panels, around that share of the figure's width."""
    ends = [(middle + shift, 0.61) for shift in (-0.01, 0.01)]
    figure.add_artist(FancyArrowPatch(*ends, transform=figure.transFigure, **style.arrow(1.2, 9.0)))
