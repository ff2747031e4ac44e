"""Figure 2: from fibres to two constants, one network followed through the stages of the study."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib
import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

from fibrous_study.datasets import read, write_table
from fibrous_study.figures import curves, style
from fibrous_study.figures.figure_3 import last_state
from fibrous_study.figures.projection import CUBE_VIEW, draw_network, draw_state, fibers_of, index_of

# Panels: left, bottom, width, height; where the words begin, in shares of the figure; the stage whose work is shown.
PANELS: tuple[tuple[tuple[float, float, float, float], float, str, str, str], ...] = (
    (
        (0.01, 0.38, 0.18, 0.48), 0.01, "networks", "fibres between random points",
        "$\\phi = \\chi \\Sigma \\pi R^2 L \\, / \\, \\chi^3 V$   (Eq. 5)\n"
        "$H = \\Sigma V N \\otimes N \\, / \\, \\Sigma V$   (Eq. 3)",
    ),
    (
        (0.25, 0.38, 0.20, 0.48), 0.25, "curves", "deformed, in equilibrium",
        "$f = (kA/B) \\, [\\exp(B E) - 1]$   (Eq. 6)\n$\\Sigma f = 0$ at every inner node",
    ),
    (
        (0.545, 0.40, 0.165, 0.46), 0.495, "curves", "energy against averaged stretch",
        "$W = \\Sigma w V \\, / \\, V$   (Eq. 4)\n$\\lambda_f = \\sqrt{H : C}$",
    ),
    (
        (0.815, 0.40, 0.175, 0.46), 0.765, "fits", "two constants",
        "$W = \\frac{C_2}{2 C_3} [\\exp(C_3 (\\lambda_f^2 - 1)^2) - 1]$\n(Eq. 2)",
    ),
)  # fmt: skip


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Draw config["network"] of inputs["networks"] with its states, curves and fits, for config["load_set"].

    config["jobs"] says of each stage how many jobs it is. Writes outputs["data"], the points and curves of panels c
    and d, and outputs["png"], outputs["svg"].
    """
    config = params["config"]
    name, load_set = config["network"], config["load_set"]
    points = curves.curve_table(inputs["curves"][0], name)
    points = points[points["deformation"].isin(load_set["loads"])].assign(name=name)
    fits = curves.pooled_fits(inputs["fits"][0])
    fits = fits[(fits["name"] == name) & (fits["load_set"] == load_set["name"])]
    table = curves.energy_table(points, fits, "name")
    write_table(table, outputs["data"], params)
    networks, states = read(inputs["networks"][0], "networks"), read(inputs["states"][0], "states")
    style.save(draw(networks, states, points, fits, table, config["jobs"]), outputs, params)


@matplotlib.rc_context(style.SHEET)
def draw(
    networks: xr.Dataset,
    states: xr.Dataset,
    points: pd.DataFrame,
    fits: pd.DataFrame,
    table: pd.DataFrame,
    jobs: Mapping[str, int],
) -> Figure:
    """Four panels from left to right; `jobs` is the number of jobs of each stage."""
    figure = style.new_figure(style.FULL_WIDTH_MM, 74.0)
    panels = [figure.add_axes(box) for box, *_ in PANELS]
    fit, load = fits.to_dict("records")[0], str(points["deformation"].iloc[0])
    draw_network(panels[0], CUBE_VIEW, fibers_of(networks, index_of(networks, fit["name"])), 0.25, width=0.3, fade=0.6)
    state = last_state(states, load)
    limit = style.stretch_limit(state["fiber_stretch"].values)
    draw_state(panels[1], CUBE_VIEW, state, limit, width=0.3, edge_bar=False)
    numbers = curves.load_numbers(points)
    for axes in panels[2:]:
        for deformation, number in numbers.items():
            curves.draw_load(axes, points[points["deformation"] == deformation], "strain_energy_density_MPa", number)
        axes.set(xlabel="averaged stretch $\\lambda_f$ (1)", ylabel="energy density $W$ (MPa)")
    fitted = table[table["kind"] == "fit"]
    panels[3].plot(fitted["averaged_stretch"], fitted["strain_energy_density_MPa"], **style.fit_style(0), zorder=5)
    panels[3].text(0.05, 1.0, curves.fit_label(fit, "\n"), transform=panels[3].transAxes, va="top", fontsize=6.0)
    panels[3].set_ylim(panels[2].get_ylim())
    for letter, (_, left, stage, title, equations) in zip("abcd", PANELS, strict=True):
        figure.text(left, 0.94, letter, fontsize=8.0, fontweight="bold", va="center")
        figure.text(left + 0.018, 0.94, title, va="center")
        figure.text(left, 0.23, f"stage {stage}, {jobs[stage]} files", va="top", fontsize=6.5, color=style.FAINT)
        figure.text(left, 0.175, equations, va="top", fontsize=6.5, linespacing=1.6)
    figure.text(PANELS[1][1] + 0.09, 0.31, style.load_label(load), ha="center", fontsize=6.5)
    for _, left, *_ in PANELS[1:]:
        style.arrow_between_panels(figure, left - 0.02, 0.61, 0.02, width=1.2, head=9.0)
    figure.legend(
        handles=curves.load_handles(points), loc="lower right", ncols=len(numbers), bbox_to_anchor=(0.995, -0.005)
    )
    return figure
