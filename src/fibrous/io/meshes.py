"""A user's own specimen: mesh, fibres and motion from files, checked before anything is made of them.

Nodes and elements are numbered from 0 in the order of the mesh file; lengths are in mm. Three files:

mesh : any format that meshio reads, of eight-node hexahedra alone; it reads some (XDMF, MED) with h5py only
motion : CSV with columns node, enthesis, step, ux_mm, uy_mm, uz_mm. Every node of an enthesis has one row for each
    load step, steps counting from 1; displacements are those at the end of the step, from the reference position.
    Enthesis 1 is held fixed, enthesis 2 is moved; all other nodes are free.
fibers : CSV with one row for each element and columns element, direction_x, direction_y, direction_z, H11, H22, H33.
    The direction, of any length, is that of H11, the first eigenvalue of the structure tensor. Where H22 and H33
    differ, columns transverse_x, transverse_y, transverse_z say which way H22 is; their part along the direction does
    not count.
"""

from __future__ import annotations

from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

import meshio
import numpy as np
from netCDF4 import Dataset
from numpy.typing import NDArray

from fibrous.errors import DatasetError, naming
from fibrous.fe.mesh import Mesh, MeshError
from fibrous.io.netcdf import NETCDF_3, content_of
from fibrous.io.tables import columns, read_csv
from fibrous.specimen import FIXED, MOVED, NO_ENTHESIS, Specimen, structure_tensor_of

Array = NDArray[np.float64]
Index = NDArray[np.int64]

DIRECTION = ["direction_x", "direction_y", "direction_z"]
TRANSVERSE = ["transverse_x", "transverse_y", "transverse_z"]
EIGENVALUES = ["H11", "H22", "H33"]
DISPLACEMENT = ["ux_mm", "uy_mm", "uz_mm"]
# Largest error of a sum of eigenvalues, and of their equality, that passes for rounding in a file.
ROUNDING = 1e-6
# Sine of the angle between the two directions of an element's fibres below which they are one and the same.
PARALLEL = 1e-3


def read_specimen(mesh: Path | str, motion: Path | str, fibers: Path | str) -> Specimen:
    """The specimen of three files, formats as in the module's text.

    Raises MeshError, naming the file and the row, node or element at fault, where they do not make one.
    """
    hexahedra = read_mesh(Path(mesh))
    enthesis, displacement = _read_motion(Path(motion), len(hexahedra.node_position))
    direction, tensor = _read_fibers(Path(fibers), len(hexahedra.element_nodes))
    with naming(str(motion)):
        return Specimen(hexahedra, direction, tensor, enthesis, displacement, f"mesh of {mesh}")


def read_mesh(path: Path) -> Mesh:
    """The hexahedra of a file in any format that meshio reads.

    Raises MeshError where it cannot be read, holds elements of another type, or is no mesh to compute with.
    """
    content = _read_with_meshio(path)
    wrong: dict[str, int] = {}
    for block in content.cells:
        if block.type != "hexahedron":
            wrong[block.type] = wrong.get(block.type, 0) + len(block.data)
    if wrong:
        names = " and ".join(f"{count} {type_}" for type_, count in wrong.items())
        raise MeshError(f"{path}: has {names} elements; only hexahedra, of eight nodes, can be computed with")
    if not content.cells:
        raise MeshError(f"{path}: has no elements; it needs hexahedra of eight nodes")
    with naming(str(path)):
        return Mesh(content.points, np.concatenate([block.data for block in content.cells]))


def _read_with_meshio(path: Path) -> meshio.Mesh:
    try:
        content = content_of(path, "give the path of a mesh file")
    except DatasetError as error:
        raise MeshError(str(error)) from None
    if content.startswith(NETCDF_3):
        _refuse_cut(path, content)
    printed = StringIO()
    try:
        # meshio prints what it finds wrong, and ends the process for some files.
        with redirect_stdout(printed), redirect_stderr(printed):
            return meshio.read(path)
    except MemoryError:
        raise
    except ModuleNotFoundError as error:
        raise MeshError(
            f"{path}: meshio reads this format with {error.name}, which is not installed; "
            f"pip install {error.name}, or convert the mesh to VTU"
        ) from None
    except (Exception, SystemExit) as error:  # its readers let pass whatever they stumble over
        text = " ".join((printed.getvalue() or str(error) or type(error).__name__).split())[:120]
        raise MeshError(f"{path}: not a mesh file that meshio can read ({text})") from None


def _refuse_cut(path: Path, content: bytes) -> None:
    """Refuse NetCDF-3 that is not whole: opened by its name, as meshio does it, what is missing is read as zeros."""
    try:
        with Dataset("mesh", memory=content) as dataset:
            for variable in dataset.variables.values():
                variable[...]
    except (OSError, RuntimeError):
        raise MeshError(f"{path}: not a whole NetCDF-3 file; export or copy the mesh again") from None


def _read_motion(path: Path, node_count: int) -> tuple[Index, Array]:
    """Enthesis of every node, shape (nodes,), and displacements, shape (steps, nodes, 3), mm, NaN at free nodes."""
    values = columns(path, read_csv(path, MeshError), ["node", "enthesis", "step", *DISPLACEMENT], MeshError)
    node, number, step = _whole(path, values[:, :3], ["node", "enthesis", "step"]).T
    if not len(node):
        raise MeshError(f"{path}: has no rows; without entheses there is no load")
    _refuse_unknown(path, node, node_count, "node")
    bad = np.flatnonzero(~np.isin(number, (FIXED, MOVED)))
    if bad.size:
        raise MeshError(f"{path}: row {bad[0]} has enthesis {number[bad[0]]}; it must be {FIXED} (fixed) or {MOVED}")
    enthesis = np.full(node_count, NO_ENTHESIS)
    enthesis[node] = number
    bad = np.flatnonzero(enthesis[node] != number)
    if bad.size:
        raise MeshError(f"{path}: node {node[bad[0]]} belongs to both entheses; it can belong to one")
    if step.min() < 1:
        raise MeshError(f"{path}: row {np.argmin(step)} has step {step.min()}; steps count from 1")
    absent = np.setdiff1d(np.arange(1, min(step.max(), len(step) + 1) + 1), step)
    if absent.size:
        raise MeshError(
            f"{path}: has no rows of step {absent[0]}, though some of step {step.max()}; steps have no gaps"
        )
    held, place = np.unique(node, return_inverse=True)
    counts = np.zeros((step.max(), len(held)), dtype=np.int64)
    np.add.at(counts, (step - 1, place), 1)
    for wrong, what in ((np.argwhere(counts > 1), "more than one displacement"), (np.argwhere(counts == 0), "none")):
        if wrong.size:
            raise MeshError(
                f"{path}: node {held[wrong[0, 1]]} has {what} at step {wrong[0, 0] + 1}; "
                f"every node of an enthesis needs one at each of the steps 1 to {step.max()}"
            )
    displacement = np.full((step.max(), node_count, 3), np.nan)
    displacement[step - 1, node] = values[:, 3:]
    return enthesis, displacement


def _read_fibers(path: Path, element_count: int) -> tuple[Array, Array]:
    """Directions, shape (elements, 3), and structure tensors, shape (elements, 3, 3)."""
    table = read_csv(path, MeshError)
    given = [name for name in TRANSVERSE if name in table]
    values = columns(path, table, ["element", *EIGENVALUES, *DIRECTION, *(TRANSVERSE if given else [])], MeshError)
    element = _whole(path, values[:, :1], ["element"])[:, 0]
    _refuse_unknown(path, element, element_count, "element")
    count = np.bincount(element, minlength=element_count)
    if (count != 1).any():
        first = int(np.flatnonzero(count != 1)[0])
        raise MeshError(f"{path}: element {first} has {count[first]} rows; every element needs one")
    values = values[np.argsort(element)]
    eigenvalues, direction = values[:, 1:4], values[:, 4:7]
    _refuse_eigenvalues(path, eigenvalues)
    if given:
        axes = _axes(path, direction, values[:, 7:])
    else:
        bad = np.flatnonzero(np.abs(eigenvalues[:, 1] - eigenvalues[:, 2]) > ROUNDING)
        if bad.size:
            raise MeshError(
                f"{path}: element {bad[0]} has H22 unlike H33, but no direction for H22; add {', '.join(TRANSVERSE)}"
            )
        # Across the fibres all directions are alike: the axis that is least along them will do.
        axes = _axes(path, direction, np.eye(3)[np.argmin(np.abs(direction), axis=1)])
    return axes[..., 0], structure_tensor_of(axes, eigenvalues / eigenvalues.sum(axis=1, keepdims=True))


def _refuse_eigenvalues(path: Path, eigenvalues: Array) -> None:
    bad = np.flatnonzero((eigenvalues <= 0.0).any(axis=1) | (np.abs(eigenvalues.sum(axis=1) - 1.0) > ROUNDING))
    if bad.size:
        raise MeshError(
            f"{path}: element {bad[0]} has H11, H22, H33 {eigenvalues[bad[0]].tolist()}; "
            "they must be above 0, and their sum must be 1"
        )


def _axes(path: Path, direction: Array, transverse: Array) -> Array:
    """Orthonormal axes as columns, shape (elements, 3, 3): along the direction, and the next nearest to transverse."""
    lengths = np.linalg.norm(direction, axis=1, keepdims=True)
    bad = np.flatnonzero(lengths == 0.0)
    if bad.size:
        raise MeshError(f"{path}: element {bad[0]} has a direction of length 0")
    first = direction / lengths
    third = np.cross(first, transverse)
    lengths = np.linalg.norm(third, axis=1, keepdims=True)
    bad = np.flatnonzero(lengths[:, 0] <= PARALLEL * np.linalg.norm(transverse, axis=1))
    if bad.size:
        raise MeshError(f"{path}: element {bad[0]} has a transverse direction of length 0 or along its direction")
    third /= lengths
    return np.stack([first, np.cross(third, first), third], axis=-1)


def _refuse_unknown(path: Path, numbers: Index, count: int, what: str) -> None:
    bad = np.flatnonzero((numbers < 0) | (numbers >= count))
    if bad.size:
        raise MeshError(
            f"{path}: row {bad[0]} has {what} {numbers[bad[0]]}, but the mesh's {what}s are numbered "
            f"from 0 to {count - 1}"
        )


def _whole(path: Path, values: Array, names: list[str]) -> Index:
    # Beyond 2^53 not every whole number has a floating-point one.
    bad = np.argwhere((values != np.round(values)) | (np.abs(values) > 2.0**53))
    if bad.size:
        raise MeshError(f"{path}: row {bad[0, 0]} has no whole number in the column '{names[bad[0, 1]]}'")
    return values.astype(np.int64)
