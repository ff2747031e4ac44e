"""The tissue's finite element problem as an input file of FEBio, format 4.0 (.feb).

Units are mm, N and MPa. The material, NeoHookean + HGOFamilies, is a solid mixture: a coupled Mooney–Rivlin solid with
c1 = C1, c2 = 0 and k = λ (FEBio's k is the first Lamé parameter), and three ``fiber-exp-pow`` families with ksi = h C2,
alpha = C3 and beta = 2, which carry tension alone. FEBio numbers from 1. Times are load steps: at time 3 stand the
displacements of the third step, and the log has a block of nodal displacements and reactions for every step.
"""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fibrous.materials.contract import Material, MaterialError, Mixture
from fibrous.materials.hgo import HGOFamilies
from fibrous.materials.neo_hookean import NeoHookean
from fibrous.specimen import FIXED, MOVED, Specimen

Array = NDArray[np.float64]

PART, MATERIAL = "tissue", "matrix and fibers"
FIXED_SET = "fixed enthesis"
AXES = ("1,0,0", "0,1,0", "0,0,1")


def feb(specimen: Specimen, material: Material) -> bytes:
    """The content of a .feb file.

    The families of each element come in falling order of their weights. Raises MaterialError for a material that FEBio
    does not have: one other than NeoHookean + HGOFamilies in tension alone, with the same matrix everywhere.
    """
    match material:
        case Mixture((NeoHookean() as matrix, HGOFamilies(tension_only=True) as fibers)) if (
            np.size(matrix.C1) == np.size(matrix.lame_lambda) == 1
        ):
            pass
        case _:
            raise MaterialError(f"FEBio has no {material!r}; give it one NeoHookean + HGOFamilies in tension alone")
    count = len(specimen.mesh.element_nodes)
    C2, C3 = (np.broadcast_to(values, (count, 1))[:, 0] for values in (fibers.C2, fibers.C3))
    weights = np.broadcast_to(fibers.weights, (count, 1, 3))[:, 0]
    directions = np.broadcast_to(fibers.directions, (count, 1, 3, 3))[:, 0]
    order = np.argsort(-weights, axis=1)
    weights, axes = np.take_along_axis(weights, order, 1), np.take_along_axis(directions, order[..., None], 1)
    root = ElementTree.Element("febio_spec", version="4.0")
    root.append(ElementTree.Comment(f" {specimen.caption} "))
    _child(_child(root, "Module", type="solid"), "units", "mm-N-s")
    _control(root, len(specimen.prescribed_displacement))
    _material(root, float(matrix.C1), float(matrix.lame_lambda))
    _mesh(root, specimen)
    _child(_child(root, "MeshDomains"), "SolidDomain", name=PART, mat=MATERIAL)
    data = _child(root, "MeshData")
    _axes(data, axes)
    for family in range(3):
        _element_data(data, _ksi(family), weights[:, family] * C2)
    _element_data(data, "alpha", C3)
    _motion(root, specimen)
    _output(root)
    ElementTree.indent(root)
    return b'<?xml version="1.0" encoding="utf-8"?>\n' + ElementTree.tostring(root, encoding="utf-8")


def _control(root: ElementTree.Element, steps: int) -> None:
    control = _child(root, "Control")
    _child(control, "analysis", "STATIC")
    _child(control, "time_steps", str(steps))
    _child(control, "step_size", "1")
    # Newton's method with a new stiffness in every iteration, to tolerances whose error does not show in the log.
    solver = _child(control, "solver", type="solid")
    for name, value in (("max_refs", "50"), ("dtol", "1e-6"), ("etol", "1e-10"), ("rtol", "1e-6")):
        _child(solver, name, value)
    _child(_child(solver, "qn_method", type="BFGS"), "max_ups", "0")


def _material(root: ElementTree.Element, C1: float, lame_lambda: float) -> None:
    mixture = _child(_child(root, "Material"), "material", id="1", name=MATERIAL, type="solid mixture")
    matrix = _child(mixture, "solid", type="coupled Mooney-Rivlin")
    for name, value in (("c1", C1), ("c2", 0.0), ("k", lame_lambda)):
        _child(matrix, name, _text(value))
    for family, axis in enumerate(AXES):
        fibers = _child(mixture, "solid", type="fiber-exp-pow")
        _child(fibers, "ksi", _ksi(family), type="map")
        _child(fibers, "alpha", "alpha", type="map")
        _child(fibers, "beta", "2")
        _child(fibers, "fiber", axis, type="vector")


def _mesh(root: ElementTree.Element, specimen: Specimen) -> None:
    mesh = _child(root, "Mesh")
    nodes = _child(mesh, "Nodes", name="nodes")
    for number, position in enumerate(specimen.mesh.node_position, start=1):
        _child(nodes, "node", _text(position), id=str(number))
    elements = _child(mesh, "Elements", type="hex8", name=PART)
    for number, corners in enumerate(specimen.mesh.element_nodes + 1, start=1):
        _child(elements, "elem", ",".join(map(str, corners)), id=str(number))
    fixed = np.flatnonzero(specimen.enthesis == FIXED) + 1
    _child(mesh, "NodeSet", ",".join(map(str, fixed)), name=FIXED_SET)
    for node in np.flatnonzero(specimen.enthesis == MOVED) + 1:
        _child(mesh, "NodeSet", str(node), name=f"node {node}")


def _axes(data: ElementTree.Element, axes: Array) -> None:
    """Material axes of each element as rows, in which the families lie along 1, 2 and 3."""
    entries = _child(data, "ElementData", type="mat_axis", elem_set=PART)
    for number, axis in enumerate(axes, start=1):
        entry = _child(entries, "elem", lid=str(number))
        _child(entry, "a", _text(axis[0]))
        _child(entry, "d", _text(axis[1]))


def _element_data(data: ElementTree.Element, name: str, values: Array) -> None:
    entries = _child(data, "ElementData", name=name, elem_set=PART)
    for number, value in enumerate(values, start=1):
        _child(entries, "elem", _text(value), lid=str(number))


def _motion(root: ElementTree.Element, specimen: Specimen) -> None:
    """Each component of each moved node has a load curve of its own: its path is no multiple of another's."""
    boundary, curves = _child(root, "Boundary"), ElementTree.Element("LoadData")
    # Zero displacements as prescribed ones: FEBio reports reactions at those alone.
    for axis in "xyz":
        _prescribed(boundary, FIXED_SET, axis, "0")
    for node in np.flatnonzero(specimen.enthesis == MOVED):
        for axis, path in zip("xyz", specimen.prescribed_displacement[:, node].T, strict=True):
            curve = len(curves) + 1
            _prescribed(boundary, f"node {node + 1}", axis, "1", lc=str(curve))
            controller = _child(curves, "load_controller", id=str(curve), type="loadcurve")
            _child(controller, "interpolate", "LINEAR")
            _child(controller, "extend", "CONSTANT")
            points = _child(controller, "points")
            for time, value in enumerate([0.0, *path]):
                _child(points, "point", f"{time},{_text(value)}")
    root.append(curves)


def _prescribed(boundary: ElementTree.Element, node_set: str, axis: str, value: str, **curve: str) -> None:
    condition = _child(boundary, "bc", type="prescribed displacement", node_set=node_set)
    _child(condition, "dof", axis)
    _child(condition, "value", value, **curve)
    _child(condition, "relative", "0")


def _output(root: ElementTree.Element) -> None:
    output = _child(root, "Output")
    plot = _child(output, "plotfile", type="febio")
    for variable in ("displacement", "stress"):
        _child(plot, "var", type=variable)
    _child(_child(output, "logfile"), "node_data", data="ux;uy;uz;Rx;Ry;Rz", delim=",", name="nodes")


def _ksi(family: int) -> str:
    return f"ksi_{family + 1}"


def _child(parent: ElementTree.Element, tag: str, text: str | None = None, **attributes: str) -> ElementTree.Element:
    element = ElementTree.SubElement(parent, tag, attributes)
    element.text = text
    return element


def _text(values: ArrayLike) -> str:
    """Numbers with all their digits, so that reading them gives the same bits."""
    return ",".join(repr(float(value)) for value in np.atleast_1d(values))
