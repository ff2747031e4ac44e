"""Figure 6: five networks of different alignment, their curves and fits, and (C2, C3) over alignment."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
import xarray as xr
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from fibrous.fitting.surface import Region, evaluate
from fibrous_study.datasets import read, write_table
from fibrous_study.figures import curves, style
from fibrous_study.figures.projection import XY_VIEW, XZ_VIEW, draw_axes_cross, draw_network, fibers_of, index_of

# constant of the surface: column of the fits, column of its half-width, label
CONSTANTS = {"C2": ("C2_MPa", "C2_half_width_MPa", "$C_2$ (MPa)"), "C3": ("C3", "C3_half_width", "$C_3$ (1)")}
# Percentiles of the networks' constants between which the colours run; a few networks lie far outside.
COLORED_PERCENTILES = (2.0, 98.0)
SURFACE_POINTS = 61


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Draw the networks config["networks"] under config["protocol"], and the constants of the whole ensemble.

    inputs["fits"] holds the fits of the named networks and of the ensemble; config["load_sets"] the load sets as the
    study's config does: the figure shows the first. Writes outputs["curves"] (panels c), outputs["constants"] (d, e),
    outputs["surface"] (f, g) and outputs["png"], outputs["svg"]; panels a and b draw inputs["networks"] as it stands.
    """
    config = params["config"]
    names, load_set = config["networks"], config["load_sets"][0]
    networks, surface = read(inputs["networks"][0], "networks"), read(inputs["surface"][0], "surface")
    surface = surface.sel(protocol=config["protocol"], load_set=load_set["name"])

    states = curves.stacked({name: curves.curve_table(inputs["curves"][0], name) for name in names}, "name")
    states = states[states["deformation"].isin(load_set["loads"])]
    named, ensemble = (fits[fits["load_set"] == load_set["name"]] for fits in map(curves.pooled_fits, inputs["fits"]))
    fits = named.set_index("name").loc[names].reset_index()
    energies = curves.energy_table(states, fits, "name")
    constants = ensemble.dropna(subset=["C2_MPa", "C3"])
    fitted = surface_table(surface)

    about = {"protocol": config["protocol"], "load_set": load_set["name"]}
    least, largest = surface["lambda_f_max_range"].values
    write_table(energies, outputs["curves"], params)
    columns = ["network", "H11", "H22", "lambda_f_max", "C2_MPa", "C3"]
    write_table(constants[columns].assign(**about), outputs["constants"], params)
    write_table(
        fitted.assign(**about, lambda_f_max_least=least, lambda_f_max_largest=largest), outputs["surface"], params
    )
    style.save(draw(networks, states, fits, energies, constants, fitted, surface), outputs, params)


def surface_table(surface: xr.Dataset) -> pd.DataFrame:
    """Eq. 11 for both constants over the range of the networks fitted, on a grid of SURFACE_POINTS squared rows."""
    least, largest = surface["H11_range"].values
    smallest = float(min(surface["H22_range"].values[0], surface["H33_range"].values[0]))
    u, v = np.meshgrid(*[np.linspace(0.0, 1.0, SURFACE_POINTS)] * 2, indexing="ij")
    H11, H22, _ = Region(float(least), float(largest), smallest).points(u, v)
    values = {
        column: evaluate(surface["coefficient"].sel(constant=constant).values, H11, H22).ravel()
        for constant, (column, _, _) in CONSTANTS.items()
    }
    return pd.DataFrame({"H11": H11.ravel(), "H22": H22.ravel(), **values})


@matplotlib.rc_context(style.SHEET)
def draw(
    networks: xr.Dataset,
    states: pd.DataFrame,
    fits: pd.DataFrame,
    energies: pd.DataFrame,
    constants: pd.DataFrame,
    fitted: pd.DataFrame,
    surface: xr.Dataset,
) -> Figure:
    """Three rows with one column a network (a, b, c), above the contours (d to g)."""
    figure = style.new_figure(style.FULL_WIDTH_MM, 185.0)
    grid = figure.add_gridspec(3, len(fits), left=0.068, right=0.992, top=0.945, bottom=0.425, wspace=0.42, hspace=0.1)
    for column, fit in enumerate(fits.to_dict("records")):
        index = index_of(networks, fit["name"])
        fibers, tensor = fibers_of(networks, index), networks["structure_tensor"].values[index]
        for row, (letter, camera) in enumerate({"a": XY_VIEW, "b": XZ_VIEW}.items()):
            axes = figure.add_subplot(grid[row, column])
            draw_network(axes, camera, fibers, 0.1, width=0.3, fade=0.85)
            if column == 0:
                draw_axes_cross(axes, camera, 0.17, np.array([-0.8, -0.47]))
            style.panel_letter(axes, f"{letter}{column + 1}", dy_mm=-2.5)
            if row == 0:
                alignment = ", ".join(f"{component:.2f}" for component in np.diag(tensor))
                axes.set_title(f"network {column + 1}\n$H$ = ({alignment})", pad=2.0)
        axes = figure.add_subplot(grid[2, column])
        of_network = states[states["name"] == fit["name"]]
        drawn = energies[(energies["name"] == fit["name"]) & (energies["kind"] == "fit")]
        curves.draw_energies(axes, of_network, drawn, of_network["deformation"].unique(), curves.load_numbers(states))
        axes.text(0.04, 1.0, curves.fit_label(fit, "\n"), transform=axes.transAxes, va="top", fontsize=6.0)
        axes.set(xlabel="$\\lambda_f$ (1)", ylabel=axes.get_ylabel().removeprefix("strain energy density "))
        style.panel_letter(axes, f"c{column + 1}")
    handles = [*curves.load_handles(states), Line2D([], [], **style.fit_style(0), label="fit of Eq. 2")]
    figure.legend(handles=handles, loc="upper center", ncols=8, bbox_to_anchor=(0.5, 0.384))
    notes = _draw_contours(figure, fits, constants, fitted, surface)
    range_note = f"Fits and surface: load set {surface['load_set'].item()}, {curves.amplitude(states)}."
    figure.text(0.035, 0.004, f"{range_note}\n{notes}", fontsize=6.0)
    return figure


def _draw_contours(
    figure: Figure, fits: pd.DataFrame, constants: pd.DataFrame, fitted: pd.DataFrame, surface: xr.Dataset
) -> str:
    """Draw panels d to g; returns what the colours leave out, in words."""
    grid = figure.add_gridspec(1, 4, left=0.06, right=0.99, top=0.33, bottom=0.147, wspace=0.3)
    notes = ["Colours hold percentiles {:g} to {:g} of the networks".format(*COLORED_PERCENTILES)]
    for column, (constant, (name, half_width, label)) in enumerate(CONSTANTS.items()):
        values = constants[name].to_numpy()
        low, high = np.percentile(values, COLORED_PERCENTILES)
        levels = MaxNLocator(8).tick_values(low, high if high > low else low + 1.0)
        outside = int(((values < levels[0]) | (values > levels[-1])).sum())
        at_bound = int(constants[half_width].isna().sum())
        notes.append(f"{label.split()[0]}: {outside} beyond, largest {values.max():.3g}, {at_bound} at a bound")
        colors: dict[str, Any] = {"levels": levels, "cmap": "viridis", "extend": "both"}

        data_axes, surface_axes = (figure.add_subplot(grid[place]) for place in (column, column + 2))
        filled = data_axes.tricontourf(constants["H11"], constants["H22"], values, **colors)
        data_axes.plot(constants["H11"], constants["H22"], ",", color=style.INK, rasterized=True)
        data_axes.set_title(f"fits to {len(values)} networks")
        shape = (SURFACE_POINTS, SURFACE_POINTS)
        H11, H22, value = (fitted[key].to_numpy().reshape(shape) for key in ("H11", "H22", name))
        surface_axes.contourf(H11, H22, value, **colors)
        if value.min() < 0.0 < value.max():
            surface_axes.contour(H11, H22, value, levels=[0.0], colors="white", linestyles="--", linewidths=0.8)
        surface_axes.set_title(f"nine terms, $R^2$ = {float(surface['r_squared'].sel(constant=constant)):.3f}")
        for axes, letter in ((data_axes, "de"[column]), (surface_axes, "fg"[column])):
            _finish(axes, letter, fits, H11, H22)
            box = axes.get_position()
            bar = figure.add_axes((box.x0, 0.083, box.width, 0.009))
            figure.colorbar(filled, cax=bar, orientation="horizontal", label=label, ticks=levels[::2])
    return ". ".join([*notes, "Dashed: the surface is 0."])


def _finish(axes: Axes, letter: str, fits: pd.DataFrame, H11: np.ndarray, H22: np.ndarray) -> None:
    """Number the networks at their alignments, show these alignments with a margin, and write labels."""
    halo = [patheffects.withStroke(linewidth=1.6, foreground="white")]
    for number, fit in enumerate(fits.to_dict("records"), start=1):
        at = (fit["H11"], fit["H22"])
        axes.text(*at, str(number), ha="center", va="center", fontsize=7.0, fontweight="bold", path_effects=halo)
    style.panel_letter(axes, letter)
    x, y = ((values.min() - 0.02 * np.ptp(values), values.max() + 0.02 * np.ptp(values)) for values in (H11, H22))
    axes.set(xlabel="$H_{11}$ (1)", ylabel="$H_{22}$ (1)", xlim=x, ylim=y)
