"""What flows between rules: every file of the study, declared, checked when read, and written whole or not at all.

A file that is not what its declaration says raises DatasetError with one line: which file, what is wrong, what to do.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
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

# What to do about a file of the study.
IF_MISSING = "run the rule that writes it"
IF_BROKEN = "delete it and run again"


@dataclass(frozen=True)
class Variable:
    """Declaration of one variable: its dimensions in order, NumPy kind, unit and meaning."""

    dims: tuple[str, ...]
    kind: str
    units: str
    long_name: str


def _variable(dims: str, kind: str, units: str, long_name: str) -> Variable:
    return Variable(tuple(dims.split()), kind, units, long_name)


NETWORKS = {
    "node_count": _variable("network", "i", "1", "number of nodes; the network's rows in the dimension node"),
    "fiber_count": _variable("network", "i", "1", "number of fibers; the network's rows in the dimension fiber"),
    "node_position": _variable("node axis", "f", "edge", "reference position in the unit cube centred on the origin"),
    "node_is_boundary": _variable("node", "b", "1", "whether the node lies on a face and moves with F"),
    "fiber_nodes": _variable("fiber end", "i", "1", "nodes at the fiber's ends, numbered within their own network"),
    "structure_tensor": _variable("network axis axis_b", "f", "1", "generalized structure tensor H (Eq. 3)"),
    "target_structure_tensor": _variable("network axis axis_b", "f", "1", "structure tensor asked of the generator"),
    "volume_fraction": _variable("network", "f", "1", "fiber volume fraction (Eq. 5)"),
    "shortest_fiber": _variable("network", "f", "edge", "reference length of the shortest fiber"),
    "seed": _variable("network", "i", "1", "seed from which this network alone is generated"),
    "name": _variable("network", "U", "1", "name of the network, empty in an ensemble without names"),
}

CURVES = {
    "deformation_gradient": _variable("network deformation step axis axis_b", "f", "1", "deformation gradient F"),
    "magnitude": _variable("network deformation step", "f", "1", "stretch, amount of shear, or part of the way"),
    "averaged_stretch": _variable("network deformation step", "f", "1", "averaged fiber stretch √(H:C)"),
    "strain_energy_density": _variable("network deformation step", "f", "MPa", "strain energy density of the fibers"),
    "cauchy_stress": _variable("network deformation step axis axis_b", "f", "MPa", "Cauchy stress (Eq. 7)"),
    "first_piola_kirchhoff_stress": _variable(
        "network deformation step axis axis_b", "f", "MPa", "first Piola-Kirchhoff stress dW/dF"
    ),
    "largest_orientation_eigenvalue": _variable(
        "network deformation step", "f", "1", "largest eigenvalue of the length-weighted orientation tensor h"
    ),
    "newton_iterations": _variable("network deformation step", "i", "1", "Newton iterations spent on the state"),
    "cuts": _variable("network deformation step", "i", "1", "times the step to this state was halved"),
    "converged": _variable("network deformation step", "b", "1", "whether the state is a stable equilibrium"),
    "amplitude_limited": _variable(
        "network deformation", "b", "1", "whether the load ends at the limit of the principal stretch"
    ),
    "structure_tensor": _variable("network axis axis_b", "f", "1", "generalized structure tensor H (Eq. 3)"),
    "name": _variable("network", "U", "1", "name of the network, empty in an ensemble without names"),
}

STATES = {
    "node_position": _variable("deformation step node axis", "f", "edge", "position in the deformed state"),
    "fiber_stretch": _variable("deformation step fiber", "f", "1", "stretch of the fiber"),
    "fiber_nodes": _variable("fiber end", "i", "1", "nodes at the fiber's ends"),
    "averaged_stretch": _variable("deformation step", "f", "1", "averaged fiber stretch √(H:C)"),
    "deformation_gradient": _variable("deformation step axis axis_b", "f", "1", "deformation gradient F"),
}

SURFACE = {
    "coefficient": _variable("protocol load_set constant term", "f", "MPa for C2, 1 for C3", "coefficient of Eq. 11"),
    "half_width": _variable(
        "protocol load_set constant term", "f", "MPa for C2, 1 for C3", "95 % half-width of the coefficient"
    ),
    "covariance": _variable(
        "protocol load_set constant term term_b", "f", "squared unit of the constant", "covariance of the coefficients"
    ),
    "residual_variance": _variable(
        "protocol load_set constant", "f", "squared unit of the constant", "variance of a network about the surface"
    ),
    "degrees_of_freedom": _variable("protocol load_set constant", "i", "1", "networks less terms"),
    "r_squared": _variable("protocol load_set constant", "f", "1", "coefficient of determination"),
    "cross_validated_r_squared": _variable("protocol load_set constant", "f", "1", "the same over held-out folds"),
    "networks_at_bound": _variable("protocol load_set constant", "i", "1", "networks whose constant is at a bound"),
    "network_count": _variable("protocol load_set", "i", "1", "networks fitted"),
    "H11_range": _variable("protocol load_set bound", "f", "1", "least and largest H11 of the networks fitted"),
    "H22_range": _variable("protocol load_set bound", "f", "1", "least and largest H22 of the networks fitted"),
    "H33_range": _variable("protocol load_set bound", "f", "1", "least and largest H33 of the networks fitted"),
    "lambda_f_max_range": _variable(
        "protocol load_set bound", "f", "1", "least and largest amplitude λ_f of the networks' fits"
    ),
}

SPECIMEN = {
    "node_position": _variable("node axis", "f", "mm", "reference position"),
    "element_nodes": _variable("element corner", "i", "1", "nodes at the element's corners, in the order of VTK"),
    "element_network": _variable("element", "i", "1", "number of the element's network in the ensemble tissue"),
    "structure_tensor": _variable("element axis axis_b", "f", "1", "structure tensor H asked of the element's network"),
    "fiber_direction": _variable("element axis", "f", "1", "mean direction of the element's fibers, a unit vector"),
    "enthesis": _variable("node", "i", "1", "0 for a node of none, 1 of the fixed, 2 of the moved enthesis"),
    "prescribed_displacement": _variable(
        "step node axis", "f", "mm", "displacement at the end of the step, NaN at nodes of no enthesis"
    ),
}

TISSUE = {
    "displacement": _variable("step node axis", "f", "mm", "displacement at the end of the step"),
    "deformation_gradient": _variable("step element gauss_point axis axis_b", "f", "1", "deformation gradient F"),
    "cauchy_stress": _variable(
        "step element gauss_point axis axis_b", "f", "MPa", "Cauchy stress of matrix and fibers"
    ),
    "reaction_force": _variable("step enthesis axis", "f", "N", "force of the bone on the tissue"),
    "newton_iterations": _variable("step", "i", "1", "Newton iterations spent on the step"),
    "cuts": _variable("step", "i", "1", "times an increment of the step was halved"),
    "converged": _variable("step", "b", "1", "whether the step's displacement was reached in equilibrium"),
    "network_iterations": _variable(
        "step", "i", "1", "Newton iterations of all networks in the increments that converged; 0 in laws without them"
    ),
    "network_cuts": _variable("step", "i", "1", "times the way of a network was halved there"),
    "indefinite_hessians": _variable("step", "i", "1", "Hessians of networks met there that were indefinite"),
    "structure_tensor": _variable("element axis axis_b", "f", "1", "structure tensor H of the element's fibers"),
    "C2": _variable("step element", "f", "MPa", "fiber modulus of the step, NaN in a law without it"),
    "C3": _variable("step element", "f", "1", "fiber nonlinearity of the step, NaN in a law without it"),
}

MICROSTRUCTURE = {
    "node_position": _variable("path step node axis", "f", "edge", "position in the deformed state"),
    "fiber_nodes": _variable("fiber end", "i", "1", "nodes at the fiber's ends"),
    "fiber_stretch": _variable("path step fiber", "f", "1", "stretch of the fiber"),
    "fiber_stress": _variable("path step fiber", "f", "MPa", "force of the fiber over its undeformed section (Eq. 6)"),
    "orientation_tensor": _variable(
        "path step axis axis_b", "f", "1", "length-weighted orientation tensor h of the deformed fibers"
    ),
    "cauchy_stress": _variable("path step axis axis_b", "f", "MPa", "Cauchy stress of the network alone (Eq. 7)"),
    "deformation_gradient": _variable("path step axis axis_b", "f", "1", "deformation gradient F"),
    "converged": _variable("path step", "b", "1", "whether the state is a stable equilibrium, else NaN"),
}

# Coordinates of all kinds: unit and meaning. A coordinate that counts or names has no dimension.
COORDINATES = {
    "network": ("1", "number of the network in its whole ensemble"),
    "deformation": ("1", "name of the load"),
    "step": ("1", "step of the load; 0 is rest"),
    "path": ("1", "Gauss point whose F the network follows, or `mean` for the mean over the element's"),
    "enthesis": ("1", "1 is the fixed, 2 the moved enthesis"),
    "protocol": ("1", "name of the protocol"),
    "load_set": ("1", "name of the load set"),
    "constant": ("1", "constant of Eq. 2; C3_eight is C3 without the term 22"),
    "term": ("1", "powers of H11 and H22 in Eq. 11"),
    "term_b": ("1", "powers of H11 and H22 in Eq. 11"),
    "bound": ("1", "least and largest"),
}
# Attributes without which a file of the kind says nothing: what turns a network's edges and kA into µm and MPa.
ATTRIBUTES: dict[str, tuple[str, ...]] = {
    "networks": (
        "edge_length_um",
        "fiber_radius_um",
        "fiber_modulus_MPa",
        "fiber_nonlinearity",
        "fiber_linear_beyond_stretch",
    ),
    "microstructure": ("element", "network", "edge_length_um", "fiber_radius_um"),
}
KINDS: dict[str, dict[str, Variable]] = {
    "networks": NETWORKS,
    "curves": CURVES,
    "states": STATES,
    "surface": SURFACE,
    "specimen": SPECIMEN,
    "tissue": TISSUE,
    "microstructure": MICROSTRUCTURE,
}


def write(dataset: xr.Dataset, path: Path, kind: str, params: Mapping[str, Any]) -> None:
    """Check `dataset` against the declaration of `kind`, add units and provenance, and write it whole.

    `params` is what the rule gave the stage (its config, code hash, stage name); it goes into the attributes.
    Raises DatasetError where a variable is missing or misshapen, or the file cannot be written.
    """
    declared = KINDS[kind]
    _check(dataset, kind, path)
    dataset = dataset[list(declared)]
    for name, variable in declared.items():
        dataset[name].attrs.update(units=variable.units, long_name=variable.long_name)
    for coordinate in dataset.coords.values():
        units, long_name = COORDINATES[str(coordinate.name)]
        coordinate.attrs.update(units=units, long_name=long_name)
    dataset.attrs.update(kind=kind, **attributes(params))
    encoding = {name: {"zlib": True, "complevel": 1} for name, variable in declared.items() if variable.kind != "U"}
    with in_place_of(path) as beside:
        save(dataset, beside, encoding)


def read(path: Path, kind: str) -> xr.Dataset:
    """The dataset at `path`, in memory and checked.

    Raises DatasetError where it is not a file of `kind`, is broken, or may not be read now.
    """
    with opened(path, IF_MISSING, IF_BROKEN) as dataset:
        dataset.load()
    found = dataset.attrs.get("kind")
    if found != kind:
        raise DatasetError(f"{path}: holds '{found or 'something else'}' where a file of {kind} is needed")
    _check(dataset, kind, path)
    return dataset


def write_table(table: pd.DataFrame, path: Path, params: Mapping[str, Any]) -> None:
    """Write a CSV whole, with its provenance beside it as `write_bytes` does."""
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


def read_table(path: Path, columns: tuple[str, ...]) -> pd.DataFrame:
    """The CSV at `path`. Raises DatasetError where it is broken, may not be read now, or lacks one of `columns`."""
    content = content_of(path, IF_MISSING)
    try:
        table = pd.read_csv(BytesIO(content), keep_default_na=True)
    except ValueError as error:
        raise DatasetError(f"{path}: not a readable table ({_line(error)}); {IF_BROKEN}") from None
    missing = [column for column in columns if column not in table]
    if missing:
        raise DatasetError(f"{path}: lacks the column '{missing[0]}'; delete it and run again")
    return table


def _check(dataset: xr.Dataset, kind_of_file: str, path: Path) -> None:
    for name in ATTRIBUTES.get(kind_of_file, ()):
        if not isinstance(dataset.attrs.get(name), Real):
            raise DatasetError(f"{path}: lacks the attribute '{name}', or it is no number; delete it and run again")
    for name, variable in KINDS[kind_of_file].items():
        if name not in dataset:
            raise DatasetError(f"{path}: lacks the variable '{name}'; delete it and run again")
        array = dataset[name]
        if array.dims != variable.dims:
            raise DatasetError(f"{path}: '{name}' has dimensions {array.dims}, not {variable.dims}")
        kind = "U" if array.dtype.kind in "UOST" else array.dtype.kind
        if kind != variable.kind and not (kind == "u" and variable.kind == "i"):
            raise DatasetError(f"{path}: '{name}' holds numbers of kind '{kind}', not '{variable.kind}'")


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


def packed(arrays: Mapping[str, np.ndarray], declared: Mapping[str, Variable], coords: Mapping[str, Any]) -> xr.Dataset:
    """A dataset of `arrays` with the dimensions that `declared` gives each of them."""
    return xr.Dataset({name: (declared[name].dims, array) for name, array in arrays.items()}, coords=dict(coords))
