"""What figures of the tissue share: the last load step of a run, the camera, and colour bars below panels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

from fibrous.deformation import element_shear, green_lagrange_strain, largest_principal_stretch
from fibrous.errors import DatasetError
from fibrous_study.datasets import read
from fibrous_study.figures import style
from fibrous_study.figures.projection import Camera, fit_view

Array = NDArray[np.float64]

# Share of the elements inside the colour scales. At the corners, where bones end, fields are singular; and constants
# fitted to a network that is hardly stretched are as large as they please.
COLORED_SHARE = 0.99
CAMERA = Camera.looking_from(azimuth_deg=-74.0, elevation_deg=50.0)


@dataclass(frozen=True)
class Run:
    """The last load step of one run: node positions, shape (nodes, 3), mm, and numbers of each element by name."""

    name: str
    step: int
    position: Array
    elements: Mapping[str, Array]


def last_step(path: Path, specimen: xr.Dataset) -> Run:
    """The last load step of the run in the file at `path`, which is named after the run.

    Raises DatasetError where the run is not one of this specimen.
    """
    tissue = read(path, "tissue")
    for name in ("node", "element"):
        if tissue.sizes[name] != specimen.sizes[name]:
            raise DatasetError(
                f"{path}: has {tissue.sizes[name]} {name}s where the specimen has {specimen.sizes[name]}; "
                "delete it and run again"
            )
    last = tissue.isel(step=-1)
    gradient = last["deformation_gradient"].values
    return Run(
        path.stem,
        int(last["step"]),
        specimen["node_position"].values + last["displacement"].values,
        {
            "C2_MPa": last["C2"].values,
            "C3": last["C3"].values,
            "largest_principal_stretch": largest_principal_stretch(gradient).mean(axis=1),
            "maximum_shear_stress_MPa": element_shear(last["cauchy_stress"].values),
            "maximum_shear_strain": element_shear(green_lagrange_strain(gradient)),
        },
    )


def show_bodies(axes: Axes, positions: Sequence[Array]) -> None:
    """Show all of these bodies, each of shape (nodes, 3), so that panels with the same ones share their scale."""
    points, _ = CAMERA.project(np.concatenate(positions))
    fit_view(axes, points, margin=0.02)


def field_scale(values: Sequence[Array]) -> Normalize:
    """From the least of the values to one that COLORED_SHARE of them do not pass; none where there is no number."""
    together = np.concatenate(values)
    return Normalize(float(np.nanmin(together)), float(np.nanquantile(together, COLORED_SHARE)))


def draw_bar(figure: Figure, box: Bbox, colors: ScalarMappable, label: str, beyond: str = "neither") -> None:
    """Draw the colour bar of panels that fill `box`, in shares of the figure, below them.

    `beyond` says at which ends values may leave it: `neither`, `max` or `both`.
    """
    height = figure.get_figheight() / style.MM
    bar = figure.add_axes((box.x0 + 0.12 * box.width, box.y0 - 3.0 / height, 0.76 * box.width, 1.5 / height))
    # A tick's label may be as wide as six of its digits.
    ticks = MaxNLocator(max(2, int(bar.get_window_extent().width / figure.dpi / style.MM / 9.0)), steps=[1, 2, 5, 10])
    figure.colorbar(colors, cax=bar, orientation="horizontal", label=label, ticks=ticks, extend=beyond)
