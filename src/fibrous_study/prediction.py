"""(C2, C3) of a network that was never simulated, from the surface of Eq. 11 that a study left in a file."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from fibrous.errors import FitError
from fibrous.fitting.surface import Surface, alignment, prediction
from fibrous_study import datasets


@dataclass(frozen=True)
class Prediction:
    """Constants of Eq. 2 for a new network, each with the interval that holds 95 % of such networks.

    The surface is a polynomial through scattered networks: a lower end below zero means that zero is among them.
    """

    C2_MPa: float
    C2_interval_MPa: tuple[float, float]
    C3: float
    C3_interval: tuple[float, float]
    protocol: str
    load_set: str
    largest_stretch: tuple[float, float]  # amplitude: least and largest of the λ_f up to which the networks were fitted


def predict(
    structure_tensor: ArrayLike,
    surface: Path | str | None = None,
    *,
    load_set: str = "section_3_1",
    protocol: str = "large",
) -> Prediction:
    """C2 and C3 of Eq. 2 for a Delaunay network of structure tensor H, shape (3, 3), in its principal axes.

    `surface` is a study's `results/tables/surface.nc`; without it, that of the paper-size run that comes with the
    package. C3 is that of the surface with nine terms. The intervals are t √(residual variance + mᵀ Cov m) to either
    side, m being the monomials of Eq. 11. The constants depend on the loads and on the amplitude of the fit.

    Raises FitError where H is no structure tensor (3 by 3, finite, symmetric, positive, trace 1), is not in its
    principal axes or lies outside the alignments fitted, and where the surface has no such load set or protocol;
    DatasetError where the file is no surface.

    >>> predict([[0.5, 0, 0], [0, 0.3, 0], [0, 0, 0.2]]).protocol
    'large'
    """
    if surface is None:
        with resources.as_file(resources.files("fibrous_study") / "data" / "surface.nc") as shipped:
            dataset = datasets.read(shipped, "surface")
    else:
        dataset = datasets.read(Path(surface), "surface")
    return Predictor.of(dataset, protocol, load_set).at(structure_tensor)


@dataclass(frozen=True)
class Predictor:
    """The surfaces of C2 and C3 of one protocol and load set.

    ranges : least and largest H11, H22, H33 of the networks fitted, shape (3, 2); largest_stretch : as in Prediction
    """

    C2: Surface
    C3: Surface
    ranges: NDArray[np.float64]
    protocol: str
    load_set: str
    largest_stretch: tuple[float, float]

    @classmethod
    def of(cls, dataset: xr.Dataset, protocol: str, load_set: str) -> Predictor:
        """From a dataset of the kind `surface`; raises FitError where it has no such protocol or load set."""
        dataset = _selected(_selected(dataset, "protocol", protocol), "load_set", load_set)
        ranges = np.stack([dataset[f"{name}_range"].values for name in ("H11", "H22", "H33")])
        least, largest = dataset["lambda_f_max_range"].values
        surfaces = _surface(dataset, "C2"), _surface(dataset, "C3")
        return cls(*surfaces, ranges, protocol, load_set, (float(least), float(largest)))

    def at(self, structure_tensor: ArrayLike) -> Prediction:
        """The constants for H, shape (3, 3), in its principal axes; raises FitError as `predict` does."""
        H11, H22 = alignment(structure_tensor, self.ranges)
        C2, C2_half_width = prediction(self.C2, H11, H22)
        C3, C3_half_width = prediction(self.C3, H11, H22)
        return Prediction(
            C2,
            (C2 - C2_half_width, C2 + C2_half_width),
            C3,
            (C3 - C3_half_width, C3 + C3_half_width),
            self.protocol,
            self.load_set,
            self.largest_stretch,
        )


def _selected(dataset: xr.Dataset, dimension: str, name: str) -> xr.Dataset:
    known = [str(value) for value in dataset[dimension].values]
    if name not in known:
        raise FitError(f"the surface has no {dimension} '{name}': choose one of {', '.join(known)}")
    return dataset.isel({dimension: known.index(name)})


def _surface(dataset: xr.Dataset, constant: str) -> Surface:
    of_constant = _selected(dataset, "constant", constant)
    return Surface(
        of_constant["coefficient"].values,
        of_constant["covariance"].values,
        float(of_constant["residual_variance"]),
        int(of_constant["degrees_of_freedom"]),
        float(of_constant["r_squared"]),
        float(of_constant["cross_validated_r_squared"]),
    )
