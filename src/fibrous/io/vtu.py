"""A state of the tissue for ParaView, as an unstructured grid in VTK's XML format (.vtu)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

import meshio
import numpy as np
from numpy.typing import NDArray

from fibrous.deformation import element_shear, green_lagrange_strain
from fibrous.specimen import Specimen

Array = NDArray[np.float64]


def vtu(
    specimen: Specimen,
    displacement: Array,
    deformation_gradient: Array,
    stress: Array,
    cells: Mapping[str, Array],
) -> bytes:
    """The content of a .vtu file: the mesh in the reference state with the fields of a deformed one.

    A comment near its top says where the specimen comes from.

    Points carry the displacement (ParaView's filter *Warp By Vector* shows the deformed body) and the enthesis. Cells
    carry means over their Gauss points: Cauchy stress, Green–Lagrange strain, the maximum shear of both, the
    reference direction of the fibres, and the constants. Tensors have nine components, xx, xy, xz, yx, ….

    Parameters
    ----------
    displacement : shape (nodes, 3), mm
    deformation_gradient : F, shape (elements, Gauss points, 3, 3)
    stress : Cauchy stress, shape (elements, Gauss points, 3, 3), MPa
    cells : further numbers of each element, shape (elements,), by the name they get, such as ``C2_MPa`` and ``C3``
    """
    strain = green_lagrange_strain(deformation_gradient)
    cell_data = {
        "cauchy_stress_MPa": stress.mean(axis=1).reshape(-1, 9),
        "green_lagrange_strain": strain.mean(axis=1).reshape(-1, 9),
        "maximum_shear_stress_MPa": element_shear(stress),
        "maximum_shear_strain": element_shear(strain),
        "fiber_direction": specimen.fiber_direction,
        **cells,
    }
    grid = meshio.Mesh(
        specimen.mesh.node_position,
        [("hexahedron", specimen.mesh.element_nodes)],
        point_data={"displacement_mm": displacement, "enthesis": specimen.enthesis},
        cell_data={name: [values] for name, values in cell_data.items()},
    )
    # meshio writes this format to paths alone.
    with TemporaryDirectory() as folder:
        path = Path(folder) / "state.vtu"
        grid.write(path)
        start, grid_tag, rest = path.read_bytes().partition(b"<UnstructuredGrid>")
    return start + f"<!-- {specimen.caption} -->\n".encode() + grid_tag + rest
