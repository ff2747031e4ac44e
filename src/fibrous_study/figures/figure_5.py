"""Figure 5: W–λ_f curves of the case-study network at both ranges, with Eq. 2 fitted to both load sets."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from fibrous_study.datasets import write_table
from fibrous_study.figures import curves, style


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Draw the network config["network"] from inputs["curves"] and inputs["fits"], in config["protocols"]' order.

    config["load_sets"] holds the load sets as the study's config does, the default one first. Writes
    outputs["data"], the states and fitted curves of both panels, and outputs["png"], outputs["svg"].
    """
    config = params["config"]
    network, protocols = config["network"], config["protocols"]
    tables = dict(zip(protocols, (curves.curve_table(path, network) for path in inputs["curves"]), strict=True))
    states = curves.stacked(tables, "protocol")
    fits = curves.stacked(dict(zip(protocols, map(curves.pooled_fits, inputs["fits"]), strict=True)), "protocol")
    fits = fits[fits["name"] == network]
    table = curves.energy_table(states, fits, "protocol")
    write_table(table, outputs["data"], params)
    style.save(draw(states, fits, table, config["load_sets"]), outputs, params)


@matplotlib.rc_context(style.SHEET)
def draw(states: pd.DataFrame, fits: pd.DataFrame, table: pd.DataFrame, load_sets: list[dict[str, Any]]) -> Figure:
    """One panel a protocol, from the states, the fits and the energy_table of both."""
    figure = style.new_figure(style.FULL_WIDTH_MM, 86.0)
    grid = figure.add_gridspec(1, 2, left=0.065, right=0.985, top=0.865, bottom=0.11, wspace=0.17)
    for column, protocol in enumerate(states["protocol"].unique()):
        axes = figure.add_subplot(grid[column])
        in_protocol = states[states["protocol"] == protocol]
        fitted = table[(table["protocol"] == protocol) & (table["kind"] == "fit")]
        beyond = curves.draw_energies(axes, in_protocol, fitted, load_sets[0]["loads"], curves.load_numbers(states))
        handles = []
        for fit in fits[fits["protocol"] == protocol].to_dict("records"):
            number = [load_set["name"] for load_set in load_sets].index(fit["load_set"])
            label = f"Eq. 2 to {style.load_set_label(load_sets, number)}\n{curves.fit_label(fit, ', ')}"
            handles.append(Line2D([], [], **style.fit_style(number), label=label))
        handles += [Line2D([], [], ls="none", label=f"{load} leaves the panel,\n{end}") for load, end in beyond.items()]
        title = f"{curves.amplitude(in_protocol)},\n$\\lambda_f$ ≤ {in_protocol['averaged_stretch'].max():.3f}"
        axes.legend(handles=handles, loc="upper left", title=title, alignment="left")
        style.panel_letter(axes, "abcdefgh"[column])
    figure.legend(handles=curves.load_handles(states), loc="upper center", ncols=6, fontsize=6.5)
    return figure
