"""Figure 8: stress of the case-study network under Eq. 9 beside the laws fitted to it, before and after the refit."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from fibrous_study.datasets import read_table, write_table
from fibrous_study.figures import style
from fibrous_study.fit_tables import INITIAL, REFIT
from fibrous_study.words import law_label

NETWORK = "network"
PANELS = {"a": (INITIAL, "initial fit"), "b": (REFIT, "refit")}
NORMAL, SHEAR = ("xx", "yy", "zz"), ("xy", "xz", "yz")
KPA = 1e3  # in MPa
MARKER: dict[str, Any] = {"ls": "none", "marker": "o", "ms": 2.6, "mfc": "white", "mec": style.INK, "mew": 0.6}
TEXTS = ("constants", "law", "energy", "objective")
ABOUT = ("model", *TEXTS, "step", "magnitude", "averaged_stretch")


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Draw the table inputs["stresses"]; writes outputs["data"], a row a point, and outputs["png"], outputs["svg"]."""
    stresses = read_table(inputs["stresses"][0], "section_2_6_stresses")
    write_table(points(stresses), outputs["data"], params)
    style.save(draw(stresses), outputs, params)


def largest_shear(stresses: pd.DataFrame) -> str:
    """The shear component that is largest in the network."""
    network = stresses[stresses["model"] == NETWORK]
    return max(SHEAR, key=lambda name: _largest(network, name))


def points(stresses: pd.DataFrame) -> pd.DataFrame:
    """What the panels draw, one row a point; in both are the network and what has no constants to fit again."""
    tables = []
    for panel, (constants, _) in PANELS.items():
        kept = stresses[stresses["constants"].isin(["", constants])]
        for component in (*NORMAL, largest_shear(stresses)):
            stress = kept[f"sigma_{component}_MPa"]
            tables.append(kept[list(ABOUT)].assign(stress_MPa=stress, panel=panel, component=component))
    table = pd.concat(tables, ignore_index=True)
    return table[["panel", "component", *ABOUT, "stress_MPa"]]


@matplotlib.rc_context(style.SHEET)
def draw(stresses: pd.DataFrame) -> Figure:
    """One column a panel, one row a component, both panels to the same scale."""
    table = points(stresses)
    components = (*NORMAL, largest_shear(stresses))
    laws = stresses[stresses["model"] != NETWORK].drop_duplicates("model").to_dict("records")
    looks = {NETWORK: MARKER} | {law["model"]: style.law_line(number) for number, law in enumerate(laws)}
    figure = style.new_figure(style.COLUMN_WIDTH_MM, 158.0)
    grid = figure.add_gridspec(len(components), 2, left=0.125, right=0.985, top=0.905, bottom=0.084)
    grid.update(wspace=0.1, hspace=0.14)
    panels = grid.subplots(sharey="row", squeeze=False)
    for row, component in enumerate(components):
        for axes, (letter, (_, title)) in zip(panels[row], PANELS.items(), strict=True):
            shown = table[(table["panel"] == letter) & (table["component"] == component)]
            for model, states in shown.groupby("model", sort=False):
                order = 2 if model == NETWORK else 3
                axes.plot(states["magnitude"], KPA * states["stress_MPa"], **looks[model], zorder=order)
            axes.margins(x=0.03)
            axes.set_xticks([0.0, 0.5, 1.0])
            axes.tick_params(labelbottom=row == len(components) - 1, labelleft=letter == "a")
            if letter == "a":
                axes.set_ylabel(f"$\\sigma_{{{component}}}$ (kPa)")
            if row == 0:
                axes.set_title(title)
                style.panel_letter(axes, letter)
            if row == len(components) - 1:
                axes.set_xlabel("part of Eq. 9's $F - I$ (1)")
    figure.align_ylabels()
    labels = ["network", *(law_label(law) for law in laws)]
    handles = [Line2D([], [], **look, label=label) for look, label in zip(looks.values(), labels, strict=True)]
    figure.legend(handles=handles, loc="upper center", ncols=2, handlelength=2.6, columnspacing=1.2)
    figure.text(0.015, 0.008, _note(stresses), fontsize=6.0)
    return figure


def _note(stresses: pd.DataFrame) -> str:
    end = float(stresses["averaged_stretch"].iloc[-1])
    hidden = [name for name in SHEAR if name != largest_shear(stresses)]
    bound = KPA * max(_largest(stresses, name) for name in hidden)
    names = " and ".join(f"$\\sigma_{{{name}}}$" for name in hidden)
    return (
        f"Cauchy stress of the fibres, without matrix; $\\lambda_f$ = {end:.3f} at the end.\n"
        f"Not shown: {names}, at most {bound:.2g} kPa in network and laws."
    )


def _largest(stresses: pd.DataFrame, component: str) -> float:
    return float(stresses[f"sigma_{component}_MPa"].abs().max())
