"""How the constants of Eq. 2, its R² and its error in stress move with one number of the study at a time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.transforms import offset_copy

from fibrous_study.datasets import read_table, write_table
from fibrous_study.figures import style
from fibrous_study.sensitivity.summary import CASE, QUANTITIES, completed

# Rows: what is drawn, how many times its value, and the scale of the axis; C3 may be 0.
ROWS = {
    "C2_MPa": ("$C_2$ (MPa)", 1.0, "log"),
    "C3": ("$C_3$ (1)", 1.0, "linear"),
    "r_squared": ("$R^2$ (1)", 1.0, "linear"),
    "stress_error": ("error of stress (%)", 100.0, "log"),
}
COLUMNS = {
    "edge_length_um": "edge length $\\chi$ (µm)",
    "volume_fraction": "volume fraction $\\varphi$ (1)",
    "nonlinearity": "nonlinearity $B$ (1)",
    "amplitude": "amplitude, x-stretch (1)",
    "steps": "number of steps (1)",
}
APART = 2.8  # between the points of two cases at one value, in points of print


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Draw the trials of every variant, inputs["trials"].

    The config holds the `factors` with their `name` and the study's `own_value`, and the `load_sets`, the default one
    first. Writes outputs["data"], a row a network, load set and value, and outputs["png"], outputs["svg"].
    """
    config = params["config"]
    tables = [read_table(path, "sensitivity_trials") for path in inputs["trials"]]
    trials = completed(tables, {factor["name"]: factor["own_value"] for factor in config["factors"]})
    table = trials[["factor", "value", "is_base", *CASE, "replicate", *QUANTITIES]]
    write_table(table, outputs["data"], params)
    style.save(draw(table, config["load_sets"]), outputs, params)


@matplotlib.rc_context(style.SHEET)
def draw(trials: pd.DataFrame, load_sets: list[dict[str, Any]]) -> Figure:
    """One column a factor, one row a quantity, from `completed` trials."""
    figure = style.new_figure(style.FULL_WIDTH_MM, 150.0)
    columns = {factor: label for factor, label in COLUMNS.items() if factor in set(trials["factor"])}
    grid = figure.add_gridspec(
        len(ROWS), len(columns), left=0.07, right=0.99, top=0.935, bottom=0.1, wspace=0.12, hspace=0.2
    )
    panels = grid.subplots(sharex="col", sharey="row", squeeze=False)
    for row, (quantity, (label, times, kind)) in enumerate(ROWS.items()):
        for column, factor in enumerate(columns):
            _draw_panel(panels[row, column], trials[trials["factor"] == factor], quantity, times, load_sets)
        panels[row, 0].set_ylabel(label)
        panels[row, 0].set_yscale(kind)
        if kind == "log":
            style.plain_ticks(panels[row, 0].yaxis, (1.0, 2.0, 5.0))
        style.panel_letter(panels[row, 0], "abcd"[row])
    for axes, (factor, label) in zip(panels[-1], columns.items(), strict=True):
        values = list(dict.fromkeys(trials.loc[trials["factor"] == factor, "value"]))
        axes.set_xticks(values, [f"{value:.3g}" for value in values])
        axes.set_xlabel(label)
    figure.align_ylabels()
    figure.legend(handles=_handles(trials, load_sets), loc="upper center", ncols=4, handlelength=2.6)
    figure.text(0.012, 0.012, _note(trials), fontsize=6.0)
    return figure


def _draw_panel(axes: Axes, trials: pd.DataFrame, quantity: str, times: float, load_sets: list[dict[str, Any]]) -> None:
    """Networks as faint points, beside one another where cases meet, and the median of each case as a line."""
    axes.margins(x=0.12)
    axes.axvline(trials.loc[trials["is_base"], "value"].iloc[0], color=style.FAINT, lw=0.5, alpha=0.5, zorder=1)
    numbers = {load_set["name"]: number for number, load_set in enumerate(load_sets)}
    cases = trials.groupby(CASE, sort=False)
    networks = list(dict.fromkeys(trials["network"]))
    for place, ((network, load_set), of_case) in enumerate(cases):
        look = style.law_marker(networks.index(network))
        beside = (place - 0.5 * (len(cases) - 1)) * APART
        moved = offset_copy(axes.transData, axes.get_figure(root=True), x=beside, units="points")
        values = times * of_case[quantity]
        axes.plot(of_case["value"], values, **look, ls="none", ms=2.0, mew=0.0, alpha=0.4, transform=moved)
        median = values.groupby(of_case["value"], sort=False).median()
        axes.plot(median.index, median, **look, **_load_set_look(numbers[load_set]), ms=2.8, mew=0.7, zorder=3)


def _load_set_look(number: int) -> dict[str, Any]:
    """The default load set in full, its markers, too; the others broken and open."""
    return {"ls": style.law_line(number)["ls"]} | ({} if number == 0 else {"mfc": "white"})


def _handles(trials: pd.DataFrame, load_sets: list[dict[str, Any]]) -> list[Line2D]:
    networks = [
        Line2D([], [], **style.law_marker(number), ls="none", ms=3.0, label=name)
        for number, name in enumerate(dict.fromkeys(trials["network"]))
    ]
    lines = [
        Line2D([], [], color=style.INK, marker="o", ms=2.8, mew=0.7, label=label, **_load_set_look(number))
        for number, label in enumerate(style.load_set_label(load_sets, number) for number in range(len(load_sets)))
    ]
    return networks + lines


def _note(trials: pd.DataFrame) -> str:
    seeds = trials.groupby("network")["replicate"].nunique().min()
    return (
        f"Lines: medians over {seeds} networks of each alignment; faint: each of them; upright lines: the study's own "
        "value. Error of stress: root mean square of the difference of\nEq. 2's Cauchy stress from the network's along "
        "Eq. 9's path, to which it was not fitted, as a part of the network's own."
    )
