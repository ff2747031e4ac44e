"""Figure 7: the three-fibre example computed, with the numbers that the paper prints beside ours."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Rectangle

from fibrous_study.datasets import write_table
from fibrous_study.figures import style
from fibrous_study.three_fibers import State, affine, equilibrium

TITLES = {"a": "undeformed", "b": "stretched along the alignment", "c": "stretched across the alignment"}
ROWS = {
    "lambda_f": "$\\lambda_f = \\sqrt{H:C}$",
    "L1": "$L_1$",
    "L2": "$L_2 = L_3$",
    "theta_deg": "$\\theta$ (°)",
    "stretch_1": "$\\lambda_1$",
    "stretch_2": "$\\lambda_2 = \\lambda_3$",
    "mean": "mean $\\overline{\\lambda}$",
}
DECIMALS = {"theta_deg": 1}
LARGEST_STRETCH = 1.6


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Write outputs["data"], the numbers of the three states, and outputs["png"], outputs["svg"].

    The config holds the panels as printed (`paper`): stretch, numbers, and the state that these describe.
    """
    panels = params["config"]["paper"]
    write_table(numbers(panels), outputs["data"], params)
    style.save(draw(panels), outputs, params)


def numbers(panels: Mapping[str, Any]) -> pd.DataFrame:
    """Per panel and quantity: the balanced state, the affine one, the paper's number and which state it describes."""
    rows = []
    for panel, paper in panels.items():
        stretch = float(Fraction(paper["stretch"]))
        for quantity, balanced, moved in zip(
            ROWS, _quantities(equilibrium(stretch)), _quantities(affine(stretch)), strict=True
        ):
            printed = paper["printed"].get(quantity)
            described = "both" if quantity == "lambda_f" else paper["describes"]
            number, described = (float(Fraction(printed)), described) if printed else (np.nan, "")
            rows.append((panel, quantity, balanced, moved, number, described))
    return pd.DataFrame(rows, columns=["panel", "quantity", "equilibrium", "affine", "paper", "paper_describes"])


def _quantities(state: State) -> tuple[float, ...]:
    """The numbers of ROWS."""
    return state.averaged_stretch, *state.lengths[:2], state.angle, *state.fiber_stretches[:2], state.mean_stretch


@matplotlib.rc_context(style.SHEET)
def draw(panels: Mapping[str, Any]) -> Figure:
    """The three states to one scale, fibres coloured by stretch, and under each the table of its numbers."""
    figure = style.new_figure(style.FULL_WIDTH_MM, 95.0)
    grid = figure.add_gridspec(2, 3, left=0.02, right=0.90, top=0.92, bottom=0.05, height_ratios=[1.25, 1])
    grid.update(hspace=0.05, wspace=0.08)
    table = numbers(panels)
    for column, (panel, paper) in enumerate(panels.items()):
        stretch = float(Fraction(paper["stretch"]))
        axes = figure.add_subplot(grid[0, column])
        _draw_state(axes, equilibrium(stretch), affine(stretch))
        axes.set_title(TITLES[panel])
        style.panel_letter(axes, panel, dx_mm=4.0)
        _draw_table(figure.add_subplot(grid[1, column]), table[table["panel"] == panel], paper["printed"])
    note = "Lengths in sides of the undeformed square. Bold: the state that the paper's number describes. "
    note += "Dashed, hollow node: the affine state, out of balance in b and c."
    figure.text(0.035, 0.02, note, fontsize=6.0)
    style.stretch_bar(figure, (0.925, 0.52, 0.013, 0.36), LARGEST_STRETCH)
    return figure


def _draw_state(axes: Axes, state: State, moved: State) -> None:
    width, height = np.diag(state.gradient)
    axes.add_patch(Rectangle((-width / 2, -height / 2), width, height, fill=False, ec=style.FAINT, lw=0.8))
    if not np.isclose(moved.node_height, state.node_height):
        for anchor in moved.anchors:
            axes.plot(*np.transpose([anchor, moved.node]), ls=(0, (3, 2)), lw=0.8, color=style.FAINT)
        axes.plot(*moved.node, "o", mfc="white", mec=style.FAINT, ms=3.5)
    colors = style.stretch_colors(state.fiber_stretches, LARGEST_STRETCH)
    for number, (anchor, color) in enumerate(zip(state.anchors, colors, strict=True), start=1):
        axes.plot(*np.transpose([anchor, state.node]), lw=2.5, color=color, solid_capstyle="round")
        axes.plot(*anchor, "s", color=style.INK, ms=3.0)
        x, y = (anchor + state.node) / 2
        if number == 1:
            axes.text(x + 0.04, y, "$L_1$", ha="left", va="center")
        else:
            axes.text(x, y + 0.06, f"$L_{number}$", ha="center", va="bottom")
    axes.plot(*state.node, "o", color=style.INK, ms=4.0)
    if state.node_height > 0.0:
        corner = tuple(state.node)
        axes.add_patch(Arc(corner, 0.28, 0.28, theta1=270.0, theta2=270.0 + state.angle, ec=style.INK, lw=0.8))
        axes.plot([0.0, 0.0], [state.node_height, state.node_height - 0.2], color=style.INK, lw=0.5)
        half = np.radians(state.angle / 2)
        axes.text(0.19 * np.sin(half), state.node_height - 0.21 * np.cos(half), "$\\theta$", ha="center", va="center")
    axes.set(xlim=(-0.85, 0.85), ylim=(-0.8, 0.8), aspect="equal")
    axes.set_axis_off()


def _draw_table(axes: Axes, table: pd.DataFrame, paper: Mapping[str, str]) -> None:
    columns = {"equilibrium": 0.47, "affine": 0.72, "paper": 0.91}
    axes.set(xlim=(0, 1), ylim=(0, len(ROWS) + 1.6))
    axes.set_axis_off()
    top = len(ROWS) + 0.7
    for name, x in columns.items():
        axes.text(x, top, name, ha="center", fontsize=6.5)
    axes.plot([0.05, 0.98], [top - 0.25] * 2, color=style.INK, lw=0.5)
    for number, row in enumerate(table.itertuples()):
        y = top - 1.1 - number
        quantity = str(row.quantity)
        axes.text(0.06, y, ROWS[quantity], fontsize=6.5)
        axes.text(columns["paper"], y, paper.get(quantity, "–"), ha="center", fontsize=6.5)
        for name in ("equilibrium", "affine"):
            weight = "bold" if row.paper_describes in (name, "both") else "normal"
            text = f"{float(getattr(row, name)):.{DECIMALS.get(quantity, 3)}f}"
            axes.text(columns[name], y, text, ha="center", fontsize=6.5, fontweight=weight)
