"""Curves as datasets of the kind `curves`, and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fibrous.curves import Curves
from fibrous.errors import DatasetError, naming
from fibrous_study import datasets


def write_curves(curves: Curves, path: Path, params: Mapping[str, Any]) -> None:
    """Write curves as `datasets.write` does."""
    datasets.write(curves.dataset, path, "curves", params)


def read_curves(paths: Sequence[Path]) -> Curves:
    """The networks of files of curves, one file after the other.

    Raises DatasetError where a file cannot be read or holds other loads or steps than the first, FitError where its
    curves are none.
    """
    parts: list[Curves] = []
    for path in paths:
        with naming(str(path)):
            part = Curves.from_dataset(datasets.read(path, "curves"))
        if parts and (part.loads, part.magnitude.shape[1:]) != (parts[0].loads, parts[0].magnitude.shape[1:]):
            raise DatasetError(f"{path}: holds other deformations than {paths[0]}; delete the curves and run again")
        parts.append(part)
    return Curves.joined(parts)


def curves_called(path: Path, name: str) -> Curves:
    """The curves of the one network of that name in a file. Raises DatasetError where none or several have it."""
    curves = read_curves([path]).called(name)
    if len(curves.names) != 1:
        raise DatasetError(
            f"{path}: holds {len(curves.names)} networks named '{name}', not one; see `named` in the config"
        )
    return curves
