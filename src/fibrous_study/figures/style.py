"""The one style sheet of the figures, and the one function that writes them."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator
from numpy.typing import NDArray

from fibrous_study.datasets import place
from fibrous_study.provenance import attributes

MM = 1.0 / 25.4  # in inches
POINTS = 72.0  # of an inch
COLUMN_WIDTH_MM = 89.0
FULL_WIDTH_MM = 183.0

INK = "#1a1a1a"
FAINT = "#8a8a8a"
COLORED_SHARE = 0.99  # of fibres or elements inside colour scales; the few beyond take the end colours

# Starting from matplotlib's own defaults keeps a reader's matplotlibrc out of the figures.
_DEFAULTS: dict[Any, Any] = {
    key: value
    for key, value in matplotlib.rcParamsDefault.items()
    if not key.startswith(("backend", "interactive", "toolbar", "timezone", "webagg", "tk.", "macosx", "date."))
}
SHEET: dict[Any, Any] = {
    **_DEFAULTS,
    **dict.fromkeys(("font.size", "axes.labelsize", "axes.titlesize"), 7.0),
    **dict.fromkeys(("xtick.labelsize", "ytick.labelsize"), 6.5),
    **dict.fromkeys(("legend.fontsize", "legend.title_fontsize"), 6.0),
    **dict.fromkeys(("text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color"), INK),
    **dict.fromkeys(("axes.linewidth", "patch.linewidth", "xtick.major.width", "ytick.major.width"), 0.6),
    **dict.fromkeys(("xtick.major.size", "ytick.major.size"), 2.5),
    **dict.fromkeys(("axes.labelpad", "xtick.major.pad", "ytick.major.pad"), 2.0),
    **dict.fromkeys(("axes.spines.top", "axes.spines.right"), False),
    "mathtext.fontset": "dejavusans",
    "axes.titlepad": 3.0,
    "axes.formatter.use_mathtext": True,
    "lines.linewidth": 1.0,
    "lines.markersize": 3.0,
    "legend.frameon": False,
    "legend.handlelength": 1.8,
    "legend.labelspacing": 0.3,
    "legend.borderaxespad": 0.3,
    **dict.fromkeys(("figure.dpi", "savefig.dpi"), 300.0),
    "svg.fonttype": "path",
    "svg.hashsalt": "fibrous",
}

# Okabe and Ito's colours, which readers with any colour vision tell apart; the marker or the line says the same again.
_LOAD_COLORS = ("#000000", "#0072B2", "#56B4E9", "#D55E00", "#E69F00", "#009E73", "#CC79A7")
_LOAD_MARKERS = ("o", "s", "D", "^", "v", "<", "P")
_LAW_COLORS = ("#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
_LAW_LINES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (5, 1.5, 1, 1.5)), (0, (1.5, 1.2)), (0, (3, 3)), "-.")
_LAW_MARKERS = ("o", "s", "D", "^", "v", "P")

# Blue where a fibre is shorter than at rest, grey at rest (white would vanish on paper), red-brown where it is longer.
_STRETCH_MAP = LinearSegmentedColormap.from_list(
    "fiber_stretch", ["#08306b", "#2b7bba", "#c9c9c9", "#e06a1b", "#7f1d00"], N=256
)
_STRETCH_TICKS = (1.05, 1.1, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0, 10.0)


def new_figure(width_mm: float, height_mm: float) -> Figure:
    """An empty figure of that print size on its own canvas, unknown to pyplot."""
    figure = Figure(figsize=(width_mm * MM, height_mm * MM))
    FigureCanvasAgg(figure)
    return figure


def save(figure: Figure, outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Write `figure` to outputs["png"] and outputs["svg"], each whole or not at all.

    Both carry their provenance as JSON, the PNG under the text key `fibrous`, the SVG as its description. Neither
    holds a date or a time spent, so that equal inputs give equal bytes. Raises DatasetError where a file cannot be
    written.
    """
    provenance = {k: v for k, v in attributes(params).items() if k not in ("cpu_seconds", "peak_memory_MB")}
    text = json.dumps(provenance, sort_keys=True)
    metadata = {"png": {"fibrous": text}, "svg": {"Date": None, "Description": text}}
    with matplotlib.rc_context(SHEET):
        for kind, entries in metadata.items():
            content = io.BytesIO()
            figure.savefig(content, format=kind, metadata=entries)
            place(content.getvalue(), outputs[kind])


def panel_letter(axes: Axes, letter: str, dx_mm: float = -1.0, dy_mm: float = 1.0) -> None:
    """Write a panel's letter outside the upper left corner of its axes."""
    axes.annotate(
        letter,
        xy=(0.0, 1.0),
        xycoords="axes fraction",
        xytext=(dx_mm * MM * POINTS, dy_mm * MM * POINTS),
        textcoords="offset points",
        fontsize=8.0,
        fontweight="bold",
        ha="right",
        va="bottom",
    )


def arrow(width: float, head: float, color: str = INK) -> dict[str, Any]:
    """Look of a straight arrow with a line and a head of these sizes in points."""
    return {"arrowstyle": "-|>", "mutation_scale": head, "lw": width, "color": color, "shrinkA": 0, "shrinkB": 0}


def arrow_between_panels(figure: Figure, x: float, y: float, length: float, width: float, head: float) -> None:
    """Draw an arrow to the right around (x, y); x, y and `length` in shares of the figure, the others in points."""
    ends = [(x + shift, y) for shift in (-0.5 * length, 0.5 * length)]
    figure.add_artist(FancyArrowPatch(*ends, transform=figure.transFigure, **arrow(width, head)))


def plain_ticks(axis: Axis, digits: tuple[float, ...]) -> None:
    """Ticks at these digits of each decade of a logarithmic axis, written as plain numbers."""
    axis.set_major_locator(LogLocator(subs=digits))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())


def load_label(name: str) -> str:
    """The load as the paper writes it: ``xy_shear`` becomes ``xy-shear``."""
    return name.replace("_", "-")


def load_style(number: int) -> dict[str, Any]:
    """Colour and marker of the load with that number in its figure; an eighth has the first colour, another marker."""
    again, number = divmod(number, len(_LOAD_COLORS))
    return {"color": _LOAD_COLORS[number], "marker": _LOAD_MARKERS[(number + again) % len(_LOAD_MARKERS)]}


def law_line(number: int) -> dict[str, Any]:
    """Colour and line of the law with that number in its table."""
    number %= len(_LAW_COLORS)
    return {"color": _LAW_COLORS[number], "ls": _LAW_LINES[number]}


def law_marker(number: int) -> dict[str, Any]:
    """Colour and marker of the law with that number in its table."""
    number %= len(_LAW_COLORS)
    return {"color": _LAW_COLORS[number], "marker": _LAW_MARKERS[number]}


def fit_style(number: int) -> dict[str, Any]:
    """Line of the fit to the load set with that number: the default one in full, the others broken and paler."""
    return {"color": INK, "ls": (0, (4, 1.5)), "lw": 1.3} if number == 0 else {"color": FAINT, "ls": ":", "lw": 1.3}


def load_set_label(load_sets: list[dict[str, Any]], number: int) -> str:
    """The section a load set is named after, and its loads that not every set has: ``section 3.1 (xz-shear)``."""
    shared = set.intersection(*(set(load_set["loads"]) for load_set in load_sets))
    special = [load_label(load) for load in load_sets[number]["loads"] if load not in shared]
    words = load_sets[number]["name"].split("_")
    name = f"section {'.'.join(words[1:])}" if words[0] == "section" else " ".join(words)
    return f"{name} ({', '.join(special)})" if special else name


def stretch_colors(stretch: NDArray[np.float64], largest: float) -> NDArray[np.float64]:
    """Red, green and blue of fibre stretches of shape (n,), as an array (n, 3); see stretch_bar for the scale."""
    return _STRETCH_MAP(_stretch_norm(largest)(np.log(stretch)))[:, :3]


def stretch_limit(stretch: NDArray[np.float64]) -> float:
    """The end of the colour scale that holds COLORED_SHARE of the fibre stretches, of any shape."""
    return float(np.exp(np.quantile(np.abs(np.log(stretch)), COLORED_SHARE)))


def stretch_bar(figure: Figure, box: tuple[float, float, float, float], largest: float) -> None:
    """Draw the colour bar of stretch_colors into `box` (left, bottom, width, height, shares of the figure).

    The scale is linear in ln λ, from 1/largest over 1, its middle, to `largest`; beyond it the end colours hold.
    """
    colors = figure.colorbar(ScalarMappable(_stretch_norm(largest), _STRETCH_MAP), cax=figure.add_axes(box))
    ticks = [1.0]
    for tick in _STRETCH_TICKS:
        if np.log(tick / ticks[-1]) > 0.25 * np.log(largest) and tick <= largest:
            ticks.append(tick)
    ticks = [1.0 / tick for tick in ticks[:0:-1]] + ticks
    # As few digits as tell the ticks apart.
    labels = next(
        texts for texts in ([f"{tick:.{n}g}" for tick in ticks] for n in (2, 3, 4)) if len({*texts}) == len(texts)
    )
    colors.set_ticks(list(np.log(ticks)), labels=labels)
    colors.set_label("fibre stretch $\\lambda$ (1)")


def _stretch_norm(largest: float) -> Normalize:
    return Normalize(-float(np.log(largest)), float(np.log(largest)))
