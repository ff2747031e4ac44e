"""Errors of every law of the tissue from the coupled simulation, side by side and as they grow with the load."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import count
from pathlib import Path
from typing import Any

import matplotlib
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from fibrous_study.datasets import read_table, write_table
from fibrous_study.figures import style
from fibrous_study.words import law_label

# Panels: column of the tables, title.
ERRORS = {
    "shear_stress_relative_rms_error": "maximum shear stress",
    "shear_strain_relative_rms_error": "maximum shear strain",
    "cauchy_stress_relative_rms_error": "Cauchy stress tensor",
    "reaction_relative_error": "force on the bone",
}
LAW = ("run", "model", "law", "constants", "energy", "objective", "refits")
NETWORK, MATRIX = "network", "matrix"
PERCENT = 100.0
REFIT_LINE = (0, (4, 1.5))


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Draw the tables inputs["comparison"] and inputs["steps"].

    Writes outputs["data"], a row for each error at each load step, and outputs["png"], outputs["svg"].
    """
    ends = read_table(inputs["comparison"][0], "comparison")
    steps = read_table(inputs["steps"][0], "comparison_steps")
    write_table(points(ends, steps), outputs["data"], params)
    style.save(draw(ends, steps), outputs, params)


def points(ends: pd.DataFrame, steps: pd.DataFrame) -> pd.DataFrame:
    """What the panels draw, one row a point: the errors of each law at each step, without runs of the networks."""
    table = ends.loc[ends["law"] != NETWORK, list(LAW)].merge(steps, on="run", sort=False)
    return table.melt([*LAW, "step"], list(ERRORS), "quantity", "relative_error")


@matplotlib.rc_context(style.SHEET)
def draw(ends: pd.DataFrame, steps: pd.DataFrame) -> Figure:
    """Upper panels: errors at the last step, one row a model; lower panels: errors over the steps."""
    table = points(ends, steps)
    models = table.drop_duplicates("model")
    looks = _looks(models)
    figure = style.new_figure(style.FULL_WIDTH_MM, 100.0)
    upper, lower = (
        figure.add_gridspec(1, len(ERRORS), left=0.2, right=0.985, bottom=bottom, top=top, wspace=0.1)
        for bottom, top in ((0.565, 0.95), (0.15, 0.44))
    )
    ends_axes, growth_axes = (cells.subplots(sharex=True, sharey=True, squeeze=False)[0] for cells in (upper, lower))
    for column, (quantity, title) in enumerate(ERRORS.items()):
        errors = table[table["quantity"] == quantity]
        above, below = ends_axes[column], growth_axes[column]
        _draw_ends(above, errors[errors["step"] == errors["step"].max()], looks)
        above.set_title(title)
        above.set_xlabel("RMS error (%)" if "rms" in quantity else "error (%)")
        style.panel_letter(above, f"a{column + 1}", dx_mm=1.0)
        _draw_growth(below, errors, looks)
        below.set_xlabel("load step")
        style.panel_letter(below, f"b{column + 1}", dx_mm=1.0)
    ends_axes[0].set_yticks(range(len(looks)), [law_label(model) for model in models.to_dict("records")])
    ends_axes[0].set_ylim(len(looks) - 0.5, -0.5)
    growth_axes[0].set_ylabel("error (%)")
    for axis in (ends_axes[0].xaxis, growth_axes[0].yaxis):
        style.plain_ticks(axis, (1.0, 3.0))
    looks_of_kinds = {"initial, or no fit": {**_fill(0), "ls": "-"}, "refit": {**_fill(1), "ls": REFIT_LINE}}
    handles = [
        Line2D([], [], color=style.INK, marker="o", ms=3.0, label=kind, **look) for kind, look in looks_of_kinds.items()
    ]
    figure.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.005, 0.2), handlelength=2.6)
    figure.text(0.012, 0.012, _note(ends), fontsize=6.0)
    return figure


def _looks(models: pd.DataFrame) -> dict[str, dict[str, Any]]:
    """Colour and marker of each model; the matrix, which has no fibres, is grey."""
    numbers = count()
    return {
        model: {"color": style.FAINT, "marker": "x"} if law == MATRIX else style.law_marker(next(numbers))
        for model, law in zip(models["model"], models["law"], strict=True)
    }


def _draw_ends(axes: Axes, table: pd.DataFrame, looks: Mapping[str, dict[str, Any]]) -> None:
    for row, (name, look) in enumerate(looks.items()):
        errors = table[table["model"] == name].sort_values("refits", ascending=False)
        axes.plot(PERCENT * errors["relative_error"], [row] * len(errors), color=look["color"], lw=0.8, zorder=2)
        for refits, error in zip(errors["refits"], PERCENT * errors["relative_error"], strict=True):
            axes.plot(error, row, **look, **_fill(refits), ls="none", ms=4.0, zorder=3)
    axes.set_xscale("log")
    axes.tick_params(axis="y", left=False)
    axes.grid(axis="y", color=style.FAINT, lw=0.3, alpha=0.5)


def _draw_growth(axes: Axes, table: pd.DataFrame, looks: Mapping[str, dict[str, Any]]) -> None:
    for _, errors in table.groupby("run", sort=False):
        errors, first = errors.sort_values("step"), errors.iloc[0]
        line = "-" if first["refits"] == 0 else REFIT_LINE
        every = max(1, len(errors) // 5)
        look = {**looks[first["model"]], **_fill(first["refits"])}
        axes.plot(errors["step"], PERCENT * errors["relative_error"], **look, ls=line, ms=2.6, markevery=every)
    axes.set_yscale("log")


def _fill(refits: int) -> dict[str, Any]:
    """Markers of initial constants are open, so that a refit which changes nothing shows through."""
    return {"mfc": "none", "mew": 0.8} if refits == 0 else {"mew": 0.8}


def _note(ends: pd.DataFrame) -> str:
    origin = str(ends["specimen"].iloc[0]).capitalize()
    note = f"{origin}. Root mean square of the difference from the coupled simulation as "
    note += "a part of its own: over elements (maximum shear),\nGauss points (Cauchy stress), or of the one force."
    networks = ends[ends["law"] == NETWORK]
    if len(networks):
        names = ", ".join(str(name).replace("_", " ") for name in networks["run"])
        note += f" Not drawn: {names}, at most {PERCENT * networks[list(ERRORS)].to_numpy().max():.1g} % off."
    return note
