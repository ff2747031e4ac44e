"""Curves as datasets of the kind `curves`, and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fibrous.curves import Curves
from fibrous.errors import DatasetError, naming
from fibrous_study import datasets
from fibrous_study.schema import KINDS

# Variables that are NaN where `converged` is not set, whatever the file holds there.
OF_EQUILIBRIA = (
    "strain_energy_density", "cauchy_stress", "first_piola_kirchhoff_stress", "largest_orientation_eigenvalue",
)  # fmt: skip


def write_curves(curves: Curves, path: Path, params: Mapping[str, Any]) -> None:
    """Write curves as `datasets.write` does."""
    arrays = {name: getattr(curves, name) for name in KINDS["curves"].variables if name != "name"}
    arrays["name"] = curves.names.astype(object)
    steps = np.arange(curves.magnitude.shape[-1])
    coords = {"network": curves.numbers, "deformation": np.array(curves.loads, dtype=object), "step": steps}
    datasets.write(datasets.packed(arrays, "curves", coords), path, "curves", params)


def read_curves(paths: Sequence[Path]) -> Curves:
    """The networks of files of curves, one file after the other.

    Raises DatasetError where a file cannot be read or holds other loads or steps than the first, FitError where its
    curves are none.
    """
    parts: list[Curves] = []
    for path in paths:
        dataset = datasets.read(path, "curves")
        arrays = {name: dataset[name] for name in Curves.__dataclass_fields__ if name in KINDS["curves"].variables}
        arrays |= {name: dataset[name].where(dataset["converged"]) for name in OF_EQUILIBRIA}
        loads = tuple(str(load) for load in dataset["deformation"].values)
        numbers, names = dataset["network"].values, dataset["name"].values.astype(str)
        with naming(str(path)):
            part = Curves(numbers, names, loads, **{name: array.values for name, array in arrays.items()})
        if parts and (loads, part.magnitude.shape[1:]) != (parts[0].loads, parts[0].magnitude.shape[1:]):
            raise DatasetError(f"{path}: holds other deformations than {paths[0]}; delete the curves and run again")
        parts.append(part)
    return Curves.joined(parts)
