"""What flows between rules: files that are checked against the schema, and written whole or not at all.

A file that is not what its declaration says raises DatasetError with one line: which file, what is wrong, what to do.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from io import BytesIO
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from fibrous.errors import DatasetError
from fibrous.io.netcdf import content_of, opened, save
from fibrous_study.provenance import attributes
from fibrous_study.schema import COORDINATES, KINDS, TABLES

# What to do about a file of the study.
IF_MISSING = "run the rule that writes it"
IF_BROKEN = "delete it and run again"
TYPES = {"f": "real numbers", "i": "whole numbers", "b": "true or false", "U": "text"}


def write(dataset: xr.Dataset, path: Path, kind: str, params: Mapping[str, Any]) -> None:
    """Check `dataset` against the declaration of `kind`, add units and provenance, and write it whole.

    `params` is what the rule gave the stage (its config, code hash, stage name); it goes into the attributes.
    Raises DatasetError where a variable is missing or misshapen, or the file cannot be written.
    """
    declared = KINDS[kind].variables
    _check(dataset, kind, path)
    dataset = dataset[list(declared)]
    for name, variable in declared.items():
        dataset[name].attrs.update(units=variable.unit, long_name=variable.meaning)
    for coordinate in dataset.coords.values():
        coordinate.attrs.update(units="1", long_name=COORDINATES[str(coordinate.name)])
    dataset.attrs.update(kind=kind, **attributes(params))
    encoding = {name: {"zlib": True, "complevel": 1} for name, variable in declared.items() if variable.dtype != "U"}
    with in_place_of(path) as beside:
        save(dataset, beside, encoding)


def read(path: Path, kind: str) -> xr.Dataset:
    """The dataset at `path`, in memory and checked.

    Raises DatasetError where it is not a file of `kind`, is broken, or may not be read now.
    """
    with opened(path, IF_MISSING, IF_BROKEN) as dataset:
        dataset.load()
    if (held := dataset.attrs.get("kind")) != kind:
        raise DatasetError(f"{path}: holds '{held or 'something else'}' where a file of {kind} is needed")
    _check(dataset, kind, path)
    return dataset


def write_table(table: pd.DataFrame, path: Path, params: Mapping[str, Any], name: str | None = None) -> None:
    """Write a CSV whole, with its provenance beside it as `write_bytes` does.

    With the `name` of a table of the schema its columns are written in the order declared there, and without rows, too.
    DatasetError is raised where one of them is missing or of another type, and where there are others. The data that a
    figure draws has no name: its columns are those of the tables that it comes from.
    """
    if name is not None:
        declared = TABLES[name].columns
        table = table if len(table) else table.reindex(columns=list(declared))
        if unknown := [str(column) for column in table if column not in declared]:
            raise DatasetError(f"{path}: the table '{name}' has no column '{unknown[0]}'; declare it in the schema")
        _check_columns(table, name, path, "mend its step or the schema")
        table = table[list(declared)]
    write_bytes(table.to_csv(index=False).encode(), path, params)


def write_bytes(content: bytes, path: Path, params: Mapping[str, Any]) -> None:
    """Write a file that has no place for provenance whole, with provenance and SHA-256 beside it as ``{path}.json``.

    Raises DatasetError where it cannot; no provenance is left of a file that is not there.
    """
    provenance = {**attributes(params), "sha256": hashlib.sha256(content).hexdigest()}
    beside = Path(f"{path}.json")
    place(json.dumps(provenance, indent=1).encode(), beside)
    try:
        place(content, path)
    except DatasetError:
        beside.unlink(missing_ok=True)
        raise


def provenance_of(path: Path) -> dict[str, Any]:
    """What a NetCDF file, or the companion of another one, says of how it was made.

    Raises DatasetError where it says nothing, may not be read now, or the content is not the one that was written.
    """
    if path.suffix == ".nc":
        with opened(path, IF_MISSING, IF_BROKEN) as dataset:
            return dict(dataset.attrs)
    try:
        companion = json.loads(Path(f"{path}.json").read_text(encoding="utf-8"))
        if companion["sha256"] == hashlib.sha256(path.read_bytes()).hexdigest():
            return companion
    except (OSError, ValueError, KeyError) as error:
        raise DatasetError(f"{path}: says nothing of how it was made ({_line(error)})") from None
    raise DatasetError(f"{path}: not the content that was written")


def read_table(path: Path, name: str) -> pd.DataFrame:
    """The CSV at `path`, the table of the schema of that name; an empty cell of a column of text is an empty text.

    Raises DatasetError where it is broken, may not be read now, lacks a column or holds another type in it.
    """
    content = content_of(path, IF_MISSING)
    columns = TABLES[name].columns
    texts = {column: str for column in columns if columns[column].dtype == "U"}
    nothing = {column: [""] for column in columns if column not in texts}
    try:
        table = pd.read_csv(BytesIO(content), dtype=texts, keep_default_na=False, na_values=nothing)
    except ValueError as error:
        raise DatasetError(f"{path}: not a readable table ({_line(error)}); {IF_BROKEN}") from None
    _check_columns(table, name, path, IF_BROKEN)
    return table


def _check_columns(table: pd.DataFrame, name: str, path: Path, remedy: str) -> None:
    for column, declared in TABLES[name].columns.items():
        if column not in table:
            raise DatasetError(f"{path}: lacks the column '{column}'; {remedy}")
        is_text = not pd.api.types.is_numeric_dtype(table[column])
        if table[column].notna().any() and is_text != (declared.dtype == "U"):
            raise DatasetError(f"{path}: the column '{column}' holds no {TYPES[declared.dtype]}; {remedy}")


def _check(dataset: xr.Dataset, kind: str, path: Path) -> None:
    for name in KINDS[kind].attributes:
        if not isinstance(dataset.attrs.get(name), Real):
            raise DatasetError(f"{path}: lacks the attribute '{name}', or it is no number; {IF_BROKEN}")
    for name, variable in KINDS[kind].variables.items():
        if name not in dataset:
            raise DatasetError(f"{path}: lacks the variable '{name}'; {IF_BROKEN}")
        array = dataset[name]
        if array.dims != variable.dims:
            raise DatasetError(f"{path}: '{name}' has dimensions {array.dims}, not {variable.dims}; {IF_BROKEN}")
        found = {"O": "U", "S": "U", "T": "U", "u": "i"}.get(array.dtype.kind, array.dtype.kind)
        if found != variable.dtype:
            wanted = TYPES[variable.dtype]
            raise DatasetError(f"{path}: '{name}' holds {TYPES.get(found, found)}, not {wanted}; {IF_BROKEN}")


def place(content: bytes, path: Path) -> None:
    """Write `content` to `path` whole or not at all: beside it, then renamed. Raises DatasetError if it cannot."""
    with in_place_of(path) as beside:
        beside.write_bytes(content)


@contextmanager
def in_place_of(path: Path) -> Iterator[Path]:
    """An empty file beside `path` to be written; it then takes the place of `path`, or is gone after an error.

    Raises DatasetError for an OSError.
    """
    path = Path(path)
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        beside.write_bytes(b"")  # where it cannot be made Python says why, netCDF4 does not
        yield beside
        with open(beside, "rb") as stream:
            os.fsync(stream.fileno())
        os.replace(beside, path)
    except OSError as error:
        raise DatasetError(f"{path}: cannot be written ({_line(error)}); free space or mend the permission") from None
    finally:
        with suppress(OSError):
            beside.unlink(missing_ok=True)


def _line(error: BaseException) -> str:
    text = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return " ".join(text.split())[:160]


def packed(arrays: Mapping[str, np.ndarray], kind: str, coords: Mapping[str, Any]) -> xr.Dataset:
    """A dataset of `arrays` with the dimensions that the schema gives to the variables of `kind`."""
    declared = KINDS[kind].variables
    return xr.Dataset({name: (declared[name].dims, array) for name, array in arrays.items()}, coords=dict(coords))
