"""Figure 8: stress of the case-study network under Eq. 9 beside the laws fitted to it, before and after the refit."""

from __future__ import annotations

from collections.abc import Mapping
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

NETWORK = "network"
PANELS = {"a": ("initial", "initial fit"), "b": ("refit", "refit")}
NORMAL, SHEAR = ("xx", "yy", "zz"), ("xy", "xz", "yz")
KPA = 1e3  # in MPa
MARKER: dict[str, Any] = {"ls": "none", "marker": "o", "ms": 2.6, "mfc": "white", "mec": style.INK, "mew": 0.6}


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Draw the table inputs["stresses"]; writes outputs["data"], a row a point, and outputs["png"], outputs["svg"]."""
    stresses = read_table(inputs["stresses"][0], "section_2_6_stresses")
    write_table(drawn(stresses), outputs["data"], params)
    style.save(draw(stresses), outputs, params)


def shown_components(stresses: pd.DataFrame) -> list[str]:
    """The normal stresses, and the shear stress that is largest in the network."""
    network = stresses[stresses["model"] == NETWORK]
    return [*NORMAL, max(SHEAR, key=lambda name: _largest(network, name))]


def drawn(stresses: pd.DataFrame) -> pd.DataFrame:
    """What the panels draw, one row a point; in both are the network and what has no constants to fit again."""
    tables = []
    for panel, (constants, _) in PANELS.items():
        own = stresses[stresses["constants"].isin(["", constants])]
        for name in shown_components(stresses):
            kept = own[["model", "constants", "law", "energy", "objective", "step", "magnitude", "averaged_stretch"]]
            tables.append(kept.assign(stress_MPa=own[f"sigma_{name}_MPa"], panel=panel, component=name))
    table = pd.concat(tables, ignore_index=True)
    first = ["panel", "component"]
    return table[[*first, *table.columns.difference(first, sort=False)]]


@matplotlib.rc_context(style.SHEET)
def draw(stresses: pd.DataFrame) -> Figure:
    """One column a panel, one row a component, both panels to the same scale."""
    table = drawn(stresses)
    components = shown_components(stresses)
    figure = style.new_figure(style.COLUMN_WIDTH_MM, 158.0)
    grid = figure.add_gridspec(
        len(components), 2, left=0.125, right=0.985, top=0.905, bottom=0.084, wspace=0.1, hspace=0.14
    )
    for row, component in enumerate(components):
        left: Axes | None = None
        for column, (letter, (_, title)) in enumerate(PANELS.items()):
            axes = figure.add_subplot(grid[row, column], sharey=left)
            own = table[(table["panel"] == letter) & (table["component"] == component)]
            _draw_stresses(axes, own, _numbers(stresses))
            axes.tick_params(labelbottom=row == len(components) - 1, labelleft=left is None)
            if left is None:
                axes.set_ylabel(f"$\\sigma_{{{component}}}$ (kPa)")
            if row == 0:
                axes.set_title(title)
                style.panel_letter(axes, letter)
            if row == len(components) - 1:
                axes.set_xlabel("part of Eq. 9's $F - I$ (1)")
            left = left or axes
    figure.align_ylabels()
    figure.legend(handles=_handles(stresses), loc="upper center", ncols=2, handlelength=2.6, columnspacing=1.2)
    figure.text(0.015, 0.008, _note(stresses), fontsize=6.0)
    return figure


def _numbers(stresses: pd.DataFrame) -> dict[str, int]:
    """Each law's number in the table, which decides its colour and line."""
    laws = [name for name in stresses["model"].unique() if name != NETWORK]
    return {str(name): number for number, name in enumerate(laws)}


def _draw_stresses(axes: Axes, table: pd.DataFrame, numbers: Mapping[str, int]) -> None:
    for model, states in table.groupby("model", sort=False):
        look = MARKER if model == NETWORK else style.model_style(numbers[str(model)])
        order = 2 if model == NETWORK else 3
        axes.plot(states["magnitude"], KPA * states["stress_MPa"], **look, zorder=order)
    axes.margins(x=0.03)
    axes.set_xticks([0.0, 0.5, 1.0])


def _handles(stresses: pd.DataFrame) -> list[Line2D]:
    handles = [Line2D([], [], **MARKER, label="network")]
    numbers = _numbers(stresses)
    for model in stresses.drop_duplicates("model").to_dict("records"):
        if model["model"] != NETWORK:
            handles.append(Line2D([], [], **style.model_style(numbers[model["model"]]), label=law_label(model)))
    return handles


def _note(stresses: pd.DataFrame) -> str:
    end = float(stresses["averaged_stretch"].iloc[-1])
    hidden = [name for name in SHEAR if name not in shown_components(stresses)]
    bound = KPA * max(_largest(stresses, name) for name in hidden)
    names = " and ".join(f"$\\sigma_{{{name}}}$" for name in hidden)
    return (
        f"Cauchy stress of the fibres, without matrix; $\\lambda_f$ = {end:.3f} at the end.\n"
        f"Not shown: {names}, at most {bound:.2g} kPa in network and laws."
    )


def _largest(stresses: pd.DataFrame, component: str) -> float:
    return float(stresses[f"sigma_{component}_MPa"].abs().max())
