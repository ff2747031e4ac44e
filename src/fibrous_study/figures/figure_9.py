"""Figure 9: maximum shear stress and strain of the coupled simulation and the hybrid method, and their difference."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from fibrous_study.datasets import read, write_table
from fibrous_study.figures import style
from fibrous_study.figures.deformed import Body, Run, draw_bar, field_scale, last_step

# Rows of panels: column of the table, label of the colours, unit.
FIELDS = (
    ("maximum_shear_stress_MPa", "maximum shear stress", "MPa"),
    ("maximum_shear_strain", "maximum shear strain", "1"),
)
# Columns of panels with the fields themselves; the others show the differences of the last two.
TITLES = ("multiscale", "initial", "refit")
FIELD_MAP, ERROR_MAP = "viridis", "RdBu_r"


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Draw inputs["tissue"], the coupled simulation, the initial and the refitted run, on inputs["specimen"].

    Writes outputs["data"], a row an element, with numbers under the names of the runs' files, and outputs["png"],
    outputs["svg"]. Raises DatasetError where a run is not one of this specimen.
    """
    specimen = read(inputs["specimen"][0], "specimen")
    runs = [last_step(path, specimen) for path in inputs["tissue"]]
    write_table(element_table(runs), outputs["data"], params)
    style.save(draw(specimen, runs), outputs, params)


def element_table(runs: list[Run]) -> pd.DataFrame:
    """One row an element: the fields of each run, and the errors from the first one under `{run}_error_…`."""
    columns: dict[str, np.ndarray] = {"element": np.arange(len(runs[0].elements[FIELDS[0][0]]))}
    for name, _, _ in FIELDS:
        columns |= {f"{run.name}_{name}": run.elements[name] for run in runs}
        columns |= {f"{run.name}_error_{name}": run.elements[name] - runs[0].elements[name] for run in runs[1:]}
    return pd.DataFrame(columns)


@matplotlib.rc_context(style.SHEET)
def draw(specimen: xr.Dataset, runs: list[Run]) -> Figure:
    """A row of panels for each field: that of each run with common colours, then the errors with common colours."""
    figure = style.new_figure(style.FULL_WIDTH_MM, 118.0)
    cells = figure.add_gridspec(len(FIELDS), 2 * len(runs) - 1, left=0.01, right=0.99, bottom=0.165, top=0.93)
    cells.update(hspace=0.5, wspace=0.03)
    body, table, drawn, count = Body.of(specimen), element_table(runs), [*runs, *runs[1:]], len(runs)
    for row, (name, label, unit) in enumerate(FIELDS):
        columns = [f"{run.name}_{name}" for run in runs] + [f"{run.name}_error_{name}" for run in runs[1:]]
        shown = [table[column].to_numpy() for column in columns]
        fields = ScalarMappable(field_scale(shown[:count]), FIELD_MAP)
        errors = ScalarMappable(error_scale(shown[count:]), ERROR_MAP)
        for column, (run, values) in enumerate(zip(drawn, shown, strict=True)):
            axes = figure.add_subplot(cells[row, column])
            body.draw(axes, run.position, values, fields if column < count else errors, rest_width=0.3)
            body.show(axes, runs)
            title = TITLES[column] if column < count else f"{TITLES[column - count + 1]} − {TITLES[0]}"
            if column >= count:
                title += f"\nRMS {np.sqrt(np.mean(values**2)):#.2g} {unit}".removesuffix(" 1")
            axes.set_title(title, pad=1.0)
            style.panel_letter(axes, f"{'ab'[row]}{column + 1}", dx_mm=4.0)
        boxes = [cells[row, column].get_position(figure) for column in range(len(drawn))]
        draw_bar(figure, Bbox.union(boxes[:count]), fields, f"{label} ({unit})", "max")
        draw_bar(figure, Bbox.union(boxes[count:]), errors, f"error of {label} ({unit})", "both")
    note = f"{specimen.attrs['origin'].capitalize()} at load step {runs[0].step}; means over the Gauss points of each "
    note += (
        f"element; lines are the edges at rest.\nColour scales hold {style.COLORED_SHARE:.0%} of the elements. Runs: "
    )
    note += f"{', '.join(run.name for run in runs)}."
    figure.text(0.012, 0.01, note, fontsize=6.0)
    return figure


def error_scale(values: list[np.ndarray]) -> Normalize:
    """Zero in the middle, and COLORED_SHARE of the values on the scale."""
    largest = float(np.quantile(np.abs(np.concatenate(values)), style.COLORED_SHARE))
    return Normalize(-largest, largest)
