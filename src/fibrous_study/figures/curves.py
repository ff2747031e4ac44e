"""Curves of one network and the fits to them: read as tables, and drawn the same way in every figure."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from fibrous.deformation import largest_principal_stretch
from fibrous.fitting.hgo import strain_energy
from fibrous_study.curve_datasets import curves_called
from fibrous_study.datasets import read_table
from fibrous_study.figures import style
from fibrous_study.fit_tables import ALL

# A load whose energy ends above this many times that of the default load set's leaves the panel.
SHOWN_RATIO = 2.0
FIT_POINTS = 201


def curve_table(path: Path, network: str) -> pd.DataFrame:
    """The curves of the network of that name as figures draw and write them: a row a state, loads as in the file.

    Columns: deformation, step, magnitude, averaged_stretch, largest_principal_stretch (of F),
    strain_energy_density_MPa, largest_orientation_eigenvalue, converged, amplitude_limited. Raises DatasetError where
    no network has the name.
    """
    curves = curves_called(path, network)
    loads, steps = curves.magnitude.shape[1:]
    return pd.DataFrame(
        {
            "deformation": np.repeat(np.array(curves.loads), steps),
            "step": np.tile(np.arange(steps), loads),
            "magnitude": curves.magnitude.ravel(),
            "averaged_stretch": curves.averaged_stretch.ravel(),
            "largest_principal_stretch": largest_principal_stretch(curves.deformation_gradient).ravel(),
            "strain_energy_density_MPa": curves.strain_energy_density.ravel(),
            "largest_orientation_eigenvalue": curves.largest_orientation_eigenvalue.ravel(),
            "converged": curves.converged.ravel(),
            "amplitude_limited": np.repeat(curves.amplitude_limited, steps),
        }
    )


def pooled_fits(path: Path) -> pd.DataFrame:
    """The rows of a table of fits that belong to a whole load set and to what panels draw, Eq. 2 fitted to energy."""
    table = read_table(path, "fits")
    eq_2 = (table["energy"] == "structure_tensor") & (table["objective"] == "energy")
    return table[eq_2 & (table["deformation"] == ALL)]


def stacked(tables: Mapping[str, pd.DataFrame], column: str) -> pd.DataFrame:
    """The tables under one another, their keys in a first column of that name."""
    return pd.concat([table.assign(**{column: key}) for key, table in tables.items()], ignore_index=True)


def energy_table(states: pd.DataFrame, fits: pd.DataFrame, by: str) -> pd.DataFrame:
    """States and fitted curves under one another: what a panel of W against λ_f draws.

    `by` is the column that tells the panels apart; `series` names the load, or the load set of a fitted curve, which
    runs from λ_f = 1 to the largest λ_f of its panel and holds no steps.
    """
    columns = [by, "step", "magnitude", "averaged_stretch", "strain_energy_density_MPa", "converged"]
    tables = [states[[*columns, "amplitude_limited"]].assign(kind="network", series=states["deformation"])]
    for fit in fits.to_dict("records"):
        stretch = np.linspace(1.0, states.loc[states[by] == fit[by], "averaged_stretch"].max(), FIT_POINTS)
        energy = strain_energy(fit["C2_MPa"], fit["C3"], stretch)
        curve = pd.DataFrame({"averaged_stretch": stretch, "strain_energy_density_MPa": energy})
        tables.append(curve.assign(**{by: fit[by]}, kind="fit", series=fit["load_set"]))
    first = [by, "kind", "series"]
    table = pd.concat(tables, ignore_index=True)
    return table[[*first, *table.columns.difference(first, sort=False)]]


def load_numbers(states: pd.DataFrame) -> dict[str, int]:
    """Each load's number among those of all the panels of a figure, which decides its colour and marker."""
    return {load: number for number, load in enumerate(states["deformation"].unique())}


def draw_load(axes: Axes, states: pd.DataFrame, column: str, number: int, scale: float = 1.0) -> None:
    """Draw `scale` times `column` of one load's converged states against λ_f.

    The marker at the end is filled; it is open where the load ended at the amplitude limit, a cross where states
    after it did not converge.
    """
    drawn = states[states["converged"]]
    look = style.load_style(number)
    x, y = drawn["averaged_stretch"].to_numpy(), scale * drawn[column].to_numpy()
    axes.plot(x, y, color=look["color"], zorder=3)
    if drawn.empty:
        return
    marker, face = look["marker"], look["color"]
    if bool(drawn["amplitude_limited"].iloc[-1]):
        face = "white"
    if drawn["step"].iloc[-1] != states["step"].iloc[-1]:
        marker = "x"
    axes.plot(x[-1], y[-1], marker, color=look["color"], mfc=face, ms=3.2, mew=0.8, zorder=4)


def draw_energies(
    axes: Axes, states: pd.DataFrame, curves: pd.DataFrame, default_loads: Collection[str], numbers: Mapping[str, int]
) -> dict[str, str]:
    """Draw W against λ_f, states of one network and rows of energy_table that are fitted curves.

    `numbers` are the load_numbers of the figure. The energy axis ends where the default load set does, or the loads
    that end within SHOWN_RATIO of it. Returns the loads that leave the panel, with the energy they end at in words.
    """
    ends = states[states["converged"]].groupby("deformation", sort=False)["strain_energy_density_MPa"].max()
    default = float(ends[ends.index.isin(list(default_loads))].max())
    limit = float(ends[ends <= SHOWN_RATIO * default].max())
    scale, unit = (1.0, "MPa") if limit > 0.01 else (1e3, "kPa")
    for load in states["deformation"].unique():
        draw_load(axes, states[states["deformation"] == load], "strain_energy_density_MPa", numbers[load], scale)
    for number, (_, curve) in enumerate(curves.groupby("series", sort=False)):
        energy = scale * curve["strain_energy_density_MPa"]
        axes.plot(curve["averaged_stretch"], energy, **style.fit_style(number), zorder=5)
    axes.set_ylim(-0.02 * scale * limit, 1.06 * scale * limit)
    axes.set_xlabel("averaged fibre stretch $\\lambda_f$ (1)")
    axes.set_ylabel(f"strain energy density $W$ ({unit})")
    beyond = ends[ends > SHOWN_RATIO * default]
    return {style.load_label(str(load)): f"ends at {energy:.3g} MPa" for load, energy in beyond.items()}


def load_handles(states: pd.DataFrame) -> list[Line2D]:
    """Legend entries of the loads in `states`, and of the two kinds of end that are not the load's target."""
    handles = [
        Line2D([], [], **style.load_style(number), ms=3.2, mew=0.8, label=style.load_label(load))
        for load, number in load_numbers(states).items()
    ]
    if states["amplitude_limited"].any():
        handles.append(_end("o", "white", "ends at the amplitude limit"))
    if (failed := int((~states["converged"]).sum())) > 0:
        handles.append(_end("x", style.INK, f"{failed} unconverged states left out"))
    return handles


def fit_label(fit: Mapping[Any, Any], separator: str) -> str:
    """C2 and C3, then R² on a line of its own; `at bound` where the fit gave a constant no half-width."""
    parts = [f"$C_2$ = {fit['C2_MPa']:.3g} MPa", f"$C_3$ = {fit['C3']:.3g}"]
    for i, column in enumerate(("C2_half_width_MPa", "C3_half_width")):
        if pd.isna(fit[column]):
            parts[i] += " (at bound)"
    return f"{separator.join(parts)}\n$R^2$ = {fit['r_squared']:.2f}"


def amplitude(states: pd.DataFrame) -> str:
    """Largest principal Green strain of the first load of the protocol, which all others follow in λ_f."""
    load = str(states["deformation"].iloc[0])
    stretch = float(states.loc[states["deformation"] == load, "largest_principal_stretch"].iloc[-1])
    return f"{50.0 * (stretch**2 - 1.0):.0f} % Green strain in {style.load_label(load)}"


def _end(marker: str, face: str, label: str) -> Line2D:
    return Line2D([], [], ls="none", marker=marker, color=style.INK, mfc=face, ms=3.2, mew=0.8, label=label)
