"""Figure 4: the hybrid method followed through one element, and the stages of the study as the workflow runs them."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch, PathPatch
from matplotlib.path import Path as Outline
from matplotlib.ticker import MaxNLocator

from fibrous.curves import Curves
from fibrous.errors import DatasetError
from fibrous.fitting.hgo import strain_energy
from fibrous_study.curve_datasets import read_curves
from fibrous_study.datasets import read, read_table, write_table
from fibrous_study.figures import style
from fibrous_study.figures.deformed import Body, Run, field_scale, last_step
from fibrous_study.figures.flow import Chart, chart
from fibrous_study.figures.projection import CUBE_VIEW, draw_network, fibers_of
from fibrous_study.fit_tables import ALL, LOAD, SINGLE, fits_of

SHOWN = "maximum_shear_stress_MPa"
KPA = 1e3  # in MPa
ACCENT = "#D55E00"
TITLES = (
    "specimen",
    "network of one\nelement",
    "its curves, and\nthe first fit",
    "finite elements\nwith the constants",
    "along what they\nfound: the refit",
    "finite elements\nonce more",
)


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Follow the most stretched element of the initial run, the first of inputs["tissue"], and draw inputs["stages"].

    inputs["curves"] and inputs["fits"] hold the loads of config["load_set"], inputs["refit_curves"] and
    inputs["refits"] the deformation that the initial run found. Writes outputs["data"], curves and fits of panels a3
    and a5, and outputs["png"], outputs["svg"]. Raises DatasetError where a file does not hold the element's network.
    """
    config = params["config"]
    specimen = read(inputs["specimen"][0], "specimen")
    runs = [last_step(path, specimen) for path in inputs["tissue"]]
    element = int(np.argmax(runs[0].elements["largest_principal_stretch"]))
    network = int(specimen["element_network"].values[element])
    loads, load_set = config["load_set"]["loads"], config["load_set"]["name"]
    first = _curves(inputs["curves"], network).under(loads), _constants(inputs["fits"][0], network, load_set, ALL)
    refit = _curves(inputs["refit_curves"], network), _constants(inputs["refits"][0], network, SINGLE, LOAD)
    points = pd.concat([_points("a3", *first), _points("a5", *refit)], ignore_index=True).assign(element=element)
    columns = ["panel", "element", "kind", "series"]
    points = points[[*columns, *points.columns.difference(columns, sort=False)]]
    write_table(points, outputs["data"], params)
    fibers = _fibers(inputs["networks"], network)
    style.save(draw(specimen, runs, element, fibers, points, stages_of(inputs["stages"][0])), outputs, params)


def stages_of(path: Path) -> list[dict[str, Any]]:
    """Stages of the table that write data: `stage`, those that it `reads`, its `jobs`, the figures `drawn` of it."""
    table = read_table(path, "stages")
    reads = {row["stage"]: row["reads"].split(", ") if row["reads"] else [] for row in table.to_dict("records")}
    figures = [name for name in reads if name.startswith("figure_")]
    return [
        {
            "stage": name,
            "reads": reads[name],
            "jobs": int(jobs),
            "drawn": [figure for figure in figures if name in reads[figure]],
        }
        for name, jobs in zip(table["stage"], table["jobs"], strict=True)
        if name not in figures
    ]


@matplotlib.rc_context(style.SHEET)
def draw(
    specimen: xr.Dataset,
    runs: Sequence[Run],
    element: int,
    fibers: np.ndarray,
    points: pd.DataFrame,
    stages: Sequence[Mapping[str, Any]],
) -> Figure:
    """Panels a1 to a6 in a row above b, the flow chart of the stages.

    `fibers` (see fibers_of) are those of the network of `element`, `points` its curves and fits, a row a point.
    """
    figure = style.new_figure(style.FULL_WIDTH_MM, 138.0)
    lefts = [0.005, 0.175, 0.365, 0.50, 0.705, 0.835]
    widths = [0.155, 0.135, 0.105, 0.155, 0.105, 0.155]
    panels = [figure.add_axes((left, 0.68, width, 0.215)) for left, width in zip(lefts, widths, strict=True)]
    body, marked = Body.of(specimen), np.zeros(specimen.sizes["element"])
    marked[element] = 1.0
    colors = ScalarMappable(Normalize(0.0, 1.0), ListedColormap(["#e8e8e8", ACCENT]))
    body.draw_at_rest(panels[0], marked, colors, specimen["fiber_direction"].values, 0.1, 0.4, 0.4)
    draw_network(panels[1], CUBE_VIEW, fibers, 0.25, width=0.25, fade=0.6)
    colors = ScalarMappable(field_scale([run.elements[SHOWN] for run in runs]), "viridis")
    for axes, run in zip((panels[3], panels[5]), runs, strict=True):
        body.draw(axes, run.position, run.elements[SHOWN], colors)
    for axes in (panels[0], panels[3], panels[5]):
        body.show(axes, runs)
    for axes, panel in ((panels[2], "a3"), (panels[4], "a5")):
        _draw_curves(axes, points[points["panel"] == panel])
    for number, (axes, title) in enumerate(zip(panels, TITLES, strict=True), start=1):
        left = axes.get_position().x0 - (0.03 if axes.axison else 0.0)
        figure.text(left, 0.965, f"a{number}", fontsize=8.0, fontweight="bold", va="top")
        figure.text(left + 0.026, 0.966, title, va="top")
    for x in (0.163, 0.3165, 0.487, 0.652, 0.825):
        style.arrow_between_panels(figure, x, 0.79, 0.014, width=1.1, head=8.0)
    origin = specimen.attrs["origin"].capitalize()
    figure.text(0.005, 0.006, f"{origin}. Colour of a4 and a6: maximum shear stress.", fontsize=6.0)
    axes = figure.add_axes((0.005, 0.03, 0.99, 0.57))
    figure.text(0.005, 0.595, "b", fontsize=8.0, fontweight="bold", va="top")
    draw_stages(axes, stages)
    return figure


def draw_stages(axes: Axes, stages: Sequence[Mapping[str, Any]]) -> None:
    """The flow chart: a box a stage with its number of jobs and the figures drawn of it, arrows for reading."""
    reads = {stage["stage"]: [name for name in stage["reads"] if name != stage["stage"]] for stage in stages}
    flow = chart(reads)
    heights = [height for _, height in flow.position.values()]
    bends = [height for path in flow.paths.values() for _, height in path]
    layers = max(layer for layer, _ in flow.position.values())
    for path in flow.paths.values():
        _draw_path(axes, path)
    _draw_back(axes, flow)
    for stage in stages:
        _draw_box(axes, flow.position[stage["stage"]], stage)
    bottom, top = max(max(heights) + 0.55, max(bends) + 0.1), min(min(heights) - 0.95, min(bends) - 0.1)
    axes.set(xlim=(-0.5, layers + 0.5), ylim=(bottom, top))
    axes.set_axis_off()


HALF_WIDTH, HALF_HEIGHT = 0.40, 0.44
LONGEST_LINE = 12  # letters of a name that fit into a box


def _draw_box(axes: Axes, at: tuple[float, float], stage: Mapping[str, Any]) -> None:
    x, y = at
    box = FancyBboxPatch(
        (x - HALF_WIDTH, y - HALF_HEIGHT), 2 * HALF_WIDTH, 2 * HALF_HEIGHT, boxstyle="round,pad=0,rounding_size=0.08",
        fc="white", ec=style.INK, lw=0.7, zorder=4,
    )  # fmt: skip
    axes.add_patch(box)
    drawn = (name.removeprefix("figure_") for name in stage["drawn"])
    numbers = ", ".join(name for name in drawn if name.isdigit())
    name = "\n".join(textwrap.wrap(stage["stage"].replace("_", " "), LONGEST_LINE))
    axes.text(x, y - 0.2, name, ha="center", va="center", fontsize=6.0, zorder=5)
    words = f"{stage['jobs']} job{'s' if stage['jobs'] > 1 else ''}\n{'Fig. ' + numbers if numbers else ''}".strip()
    axes.text(x, y + 0.18, words, ha="center", va="center", fontsize=6.0, color=style.FAINT, zorder=5)


def _draw_path(axes: Axes, points: Sequence[tuple[float, float]]) -> None:
    """An arrow through these points, level where it leaves a layer and where it comes to the next one."""
    x, y = points[0]
    vertices, codes = [(x + HALF_WIDTH, y)], [Outline.MOVETO]
    for index, (x, y) in enumerate(points[1:], start=1):
        last = index == len(points) - 1
        start, end = vertices[-1], (x - HALF_WIDTH - (0.03 if last else 0.0), y)
        middle = 0.5 * (start[0] + end[0])
        vertices += [(middle, start[1]), (middle, end[1]), end]
        codes += [Outline.CURVE4] * 3
        if not last:
            vertices.append((x + HALF_WIDTH, y))
            codes.append(Outline.LINETO)
    axes.add_patch(PathPatch(Outline(vertices, codes), fc="none", ec=style.FAINT, lw=0.7, zorder=2))
    _draw_head(axes, vertices[-1], (1.0, 0.0), style.FAINT)


def _draw_back(axes: Axes, flow: Chart) -> None:
    """Edges that close a loop leave to the right, run above all boxes, and are broken and in a colour."""
    top = min(height for _, height in flow.position.values()) - 0.75
    for writer, reader in flow.back:
        (x, y), (end, height) = flow.position[writer], flow.position[reader]
        leaving, tip = y - 0.5 * HALF_HEIGHT, (end, height - HALF_HEIGHT - 0.05)
        vertices = [(x + HALF_WIDTH, leaving), (x + 0.5, leaving), (x + 0.5, top), (end, top), tip]
        codes = [Outline.MOVETO] + [Outline.LINETO] * (len(vertices) - 1)
        axes.add_patch(PathPatch(Outline(vertices, codes), fc="none", ec=ACCENT, lw=1.1, ls=(0, (4, 2)), zorder=3))
        _draw_head(axes, vertices[-1], (0.0, 1.0), ACCENT)
        axes.text(0.5 * (x + 0.5 + end), top - 0.06, "refit", ha="center", va="bottom", fontsize=6.5, color=ACCENT)


def _draw_head(axes: Axes, at: tuple[float, float], direction: tuple[float, float], color: str) -> None:
    start = (at[0] - 0.05 * direction[0], at[1] - 0.05 * direction[1])
    axes.add_patch(FancyArrowPatch(start, at, zorder=3, **style.arrow(0.7, 5.0, color)))


def _draw_curves(axes: Axes, points: pd.DataFrame) -> None:
    for kind, group in points.groupby("kind"):
        for number, (_, curve) in enumerate(group.groupby("series", sort=False)):
            x, y = curve["averaged_stretch"], KPA * curve["strain_energy_density_MPa"]
            if kind == "fit":
                axes.plot(x, y, **style.fit_style(0), zorder=4)
            else:
                axes.plot(x, y, color=style.load_style(number)["color"], lw=0.8, zorder=3)
    constants = points[points["kind"] == "fit"].iloc[0]
    label = f"$C_2$ = {constants['C2_MPa']:.3g} MPa\n$C_3$ = {constants['C3']:.3g}"
    axes.text(0.06, 1.0, label, transform=axes.transAxes, va="top", fontsize=6.0)
    largest = KPA * points.loc[points["kind"] == "network", "strain_energy_density_MPa"].max()
    axes.set_ylim(-0.02 * largest, 1.35 * largest)
    axes.yaxis.set_major_locator(MaxNLocator(3, steps=[1, 2, 5, 10]))  # whole numbers leave room for the arrow
    axes.set_xlabel("$\\lambda_f$ (1)")
    axes.set_ylabel("$W$ (kPa)", labelpad=1.0)


def _points(panel: str, curves: Curves, constants: tuple[float, float]) -> pd.DataFrame:
    """What a panel draws of one network, one row a point: its converged states, and Eq. 2 with these constants."""
    names = ("averaged_stretch", "strain_energy_density_MPa")
    tables = []
    for load, known, *state in zip(
        curves.loads, curves.converged[0], curves.averaged_stretch[0], curves.strain_energy_density[0], strict=True
    ):
        states = pd.DataFrame({name: values[known] for name, values in zip(names, state, strict=True)})
        tables.append(states.assign(panel=panel, kind="network", series=load))
    stretch = np.linspace(1.0, max(states["averaged_stretch"].max() for states in tables), 101)
    fitted = pd.DataFrame(dict(zip(names, (stretch, strain_energy(*constants, stretch)), strict=True)))
    tables.append(fitted.assign(panel=panel, kind="fit", series="Eq. 2", C2_MPa=constants[0], C3=constants[1]))
    return pd.concat(tables, ignore_index=True)


def _fibers(paths: list[Path], network: int) -> np.ndarray:
    for path in paths:
        networks = read(path, "networks")
        numbers = networks["network"].values.tolist()
        if network in numbers:
            return fibers_of(networks, numbers.index(network))
    raise DatasetError(f"{paths[0].parent}: no file holds network {network}; delete the networks and run again")


def _curves(paths: list[Path], network: int) -> Curves:
    """The curves of one network."""
    curves = read_curves(paths)
    if network not in curves.numbers:
        raise DatasetError(f"{paths[0].parent}: no file holds network {network}; delete the curves and run again")
    return curves.of(curves.numbers == network)


def _constants(path: Path, network: int, load_set: str, deformation: str) -> tuple[float, float]:
    """C2 (MPa) and C3 of Eq. 2 that were fitted to the energy of the network under these loads."""
    fits = fits_of(read_table(path, "fits"), "structure_tensor", "energy", load_set, deformation)
    fits = fits[fits["network"] == network]
    if len(fits) != 1:
        raise DatasetError(f"{path}: holds {len(fits)} fits of network {network} where one is drawn; run again")
    return float(fits["C2_MPa"].iloc[0]), float(fits["C3"].iloc[0])
