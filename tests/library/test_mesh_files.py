"""A user's own mesh, fibres and motion: what was saved is read, and every fault is named with its row or element."""

import sys

import meshio
import numpy as np
import pandas as pd
import pytest
from netCDF4 import Dataset
from tissues import distorted_box

from fibrous.errors import FibrousError
from fibrous.fe.mesh import MeshError
from fibrous.io.meshes import DIRECTION, DISPLACEMENT, EIGENVALUES, TRANSVERSE, read_mesh, read_specimen
from fibrous.specimen import Slab

SPECIMEN = Slab(elements=(3, 4, 2)).specimen(3)


@pytest.fixture
def files(tmp_path):
    """Tables of the synthetic specimen's motion and fibres, and where the three files are."""
    eigenvalues, vectors = np.linalg.eigh(SPECIMEN.structure_tensor)
    fibers = pd.DataFrame(eigenvalues[:, ::-1], columns=EIGENVALUES)
    fibers[DIRECTION], fibers[TRANSVERSE] = 7.0 * vectors[..., 2], vectors[..., 1] + 0.3 * vectors[..., 2]
    fibers.insert(0, "element", np.arange(len(fibers)))
    held = np.flatnonzero(SPECIMEN.enthesis)
    motion = pd.concat(
        pd.DataFrame(SPECIMEN.prescribed_displacement[step, held], columns=DISPLACEMENT).assign(
            node=held, enthesis=SPECIMEN.enthesis[held], step=step + 1
        )
        for step in range(3)
    ).reset_index(drop=True)
    paths = {"mesh": tmp_path / "m.vtu", "motion": tmp_path / "m.csv", "fibers": tmp_path / "f.csv"}
    saved_mesh(paths["mesh"])
    return motion, fibers, {name: str(path) for name, path in paths.items()}


def saved_mesh(path, cells=None, points=SPECIMEN.mesh.node_position):
    meshio.Mesh(points, cells or [("hexahedron", SPECIMEN.mesh.element_nodes)]).write(path)
    return path


def read(motion, fibers, paths):
    motion.to_csv(paths["motion"], index=False)
    fibers.to_csv(paths["fibers"], index=False)
    return read_specimen(**paths)


def changed(table, row, column, value):
    table = table.astype(object)
    table.loc[row, column] = value
    return table


@pytest.mark.parametrize("name", ["m.vtu", "m.vtk", "m.msh", "m.inp", "m.mesh", "m.e"])
def test_a_mesh_is_read_in_any_format(name, tmp_path):
    mesh = distorted_box(3)
    meshio.Mesh(mesh.node_position, [("hexahedron", mesh.element_nodes)]).write(tmp_path / name)
    found = read_mesh(tmp_path / name)
    np.testing.assert_allclose(found.node_position, mesh.node_position, atol=1e-14)
    np.testing.assert_array_equal(found.element_nodes, mesh.element_nodes)


def netcdf_3_exodus(path, mesh):
    """As Cubit writes it: a coordinate in a variable, blocks of elements, nodes numbered from 1."""
    with Dataset(path, "w", format="NETCDF3_64BIT_OFFSET") as file:
        blocks = mesh.element_nodes[:5], mesh.element_nodes[5:]
        sizes = {"num_nodes": len(mesh.node_position), "eight": 8, "block1": 5, "block2": len(blocks[1])}
        for name, size in sizes.items():
            file.createDimension(name, size)
        for name, column in zip("xyz", mesh.node_position.T, strict=True):
            file.createVariable(f"coord{name}", "f8", ("num_nodes",))[:] = column
        for number, (name, block) in enumerate(zip(("HEX8", "HEX"), blocks, strict=True), 1):
            variable = file.createVariable(f"connect{number}", "i4", (f"block{number}", "eight"))
            variable.elem_type = name
            variable[:] = block + 1
    return path


def test_exodus_in_netcdf_3_is_read_whole_or_not_at_all(tmp_path):
    mesh = distorted_box(3)
    path = netcdf_3_exodus(tmp_path / "m.exo", mesh)
    found = read_mesh(path)
    np.testing.assert_array_equal(found.node_position, mesh.node_position)
    np.testing.assert_array_equal(found.element_nodes, mesh.element_nodes)
    content = path.read_bytes()
    for size in range(0, len(content), 211):
        path.write_bytes(content[:size])
        with pytest.raises(MeshError, match=r"not a mesh file that meshio can read|not a whole NetCDF-3 file"):
            read_mesh(path)


@pytest.mark.parametrize("name", ["m.xdmf", "m.med", "m.cgns", "m.h5m"])
def test_a_format_that_needs_another_library_says_which(name, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "h5py", None)  # as if it were not installed
    points = "<Geometry GeometryType='XYZ'><DataItem Dimensions='1 3' Format='XML'>0 0 0</DataItem></Geometry>"
    (tmp_path / name).write_text(f"<Xdmf Version='3.0'><Domain><Grid>{points}</Grid></Domain></Xdmf>")
    with pytest.raises(MeshError, match="pip install h5py"):
        read_mesh(tmp_path / name)


def test_a_specimen_is_read_as_it_was_saved_in_any_order_of_rows(files):
    motion, fibers, paths = files
    for one in (read(motion, fibers, paths), read(motion[::-1], fibers.sample(frac=1.0, random_state=0), paths)):
        for name in ("fiber_direction", "structure_tensor"):
            sign = np.sign((one.fiber_direction * SPECIMEN.fiber_direction).sum(axis=1))
            factor = sign[:, None] if name == "fiber_direction" else 1.0
            np.testing.assert_allclose(factor * getattr(one, name), getattr(SPECIMEN, name), atol=1e-14)
        np.testing.assert_array_equal(one.enthesis, SPECIMEN.enthesis)
        np.testing.assert_allclose(one.prescribed_displacement, SPECIMEN.prescribed_displacement, atol=1e-15)
        assert one.origin == f"mesh of {paths['mesh']}"


def test_fibers_alike_across_need_no_second_direction(files):
    motion, fibers, paths = files
    alike = fibers.drop(columns=TRANSVERSE).assign(H11=0.7, H22=0.15, H33=0.15)
    specimen = read(motion, alike, paths)
    n = specimen.fiber_direction
    np.testing.assert_allclose(
        specimen.structure_tensor, 0.15 * np.eye(3) + 0.55 * n[:, :, None] * n[:, None, :], atol=1e-14
    )


def test_meshes_that_cannot_be_computed_with_are_named(tmp_path):
    nodes, points = SPECIMEN.mesh.element_nodes, SPECIMEN.mesh.node_position

    def refused(text, cells=None, points=points):
        path = saved_mesh(tmp_path / "m.vtu", cells, points)
        with pytest.raises(MeshError, match=text) as error:
            read_mesh(path)
        assert "\n" not in str(error.value)
        assert str(path) in str(error.value)

    refused("has 12 tetra elements; only hexahedra", [("tetra", np.arange(48).reshape(12, 4))])
    mixed = [("hexahedron", nodes), ("quad", nodes[:2, :4]), ("wedge", nodes[:3, :6])]
    refused("has 2 quad and 3 wedge elements", mixed)
    refused("has 1 hexahedron20 elements", [("hexahedron20", np.arange(20)[None])])
    refused("node 60 belongs to no element; remove it", points=np.vstack([points, [[0.0, 0.0, 9.0]]]))
    nowhere = points.copy()
    nowhere[7, 1] = np.nan
    refused("node 7 has a position that is not a finite number", points=nowhere)
    turned = nodes.copy()
    turned[5] = turned[5, [4, 5, 6, 7, 0, 1, 2, 3]]
    refused("element 5 is numbered inside out", [("hexahedron", turned)])
    crossed = nodes.copy()
    crossed[5, [0, 1]] = crossed[5, [1, 0]]
    refused("element 5 is inverted or flat", [("hexahedron", crossed)])


@pytest.mark.parametrize(
    ("name", "text"), [("a.vtu", "no"), ("a.msh", "no"), ("a.inp", "no"), ("a.foo", "no"), ("gone.vtu", None)]
)
def test_files_that_are_no_meshes_are_refused(name, text, tmp_path, capsys):
    if text is not None:
        (tmp_path / name).write_text(text)
    refusals = r"not a mesh file that meshio can read \(.+\)|has no elements|no such file"
    with pytest.raises(FibrousError, match=refusals) as error:
        read_mesh(tmp_path / name)
    assert "\n" not in str(error.value)
    assert capsys.readouterr() == ("", "")


def test_every_fault_of_a_table_is_named(files):
    motion, fibers, paths = files

    def refused(text, motion=motion, fibers=fibers):
        with pytest.raises(MeshError, match=text) as error:
            read(motion, fibers, paths)
        assert "\n" not in str(error.value)
        assert any(paths[name] in str(error.value) for name in ("motion", "fibers"))

    held = np.flatnonzero(SPECIMEN.enthesis)
    moved = motion[motion["enthesis"] == 2].index[4]
    refused("lacks the column 'uz_mm'", motion=motion.drop(columns="uz_mm"))
    refused("row 3 has no finite number in the column 'ux_mm'", motion=changed(motion, 3, "ux_mm", np.nan))
    refused("row 3 has no finite number in the column 'node'", motion=changed(motion, 3, "node", "corner"))
    refused("row 3 has no whole number in the column 'step'", motion=changed(motion, 3, "step", 0.5))
    refused("row 3 has step 0; steps count from 1", motion=changed(motion, 3, "step", 0))
    refused("no rows of step 4, though some of step 2000000000", motion=changed(motion, 3, "step", 2_000_000_000))
    refused("row 3 has node 60, but the mesh's nodes are numbered from 0 to 59", motion=changed(motion, 3, "node", 60))
    refused("row 3 has node -1", motion=changed(motion, 3, "node", -1))
    refused("row 3 has enthesis 3; it must be 1", motion=changed(motion, 3, "enthesis", 3))
    refused(f"node {held[3]} belongs to both entheses", motion=changed(motion, 3, "enthesis", 2))
    refused(f"node {held[3]} has none at step 1", motion=motion.drop(index=3))
    refused(f"node {held[3]} has more than one displacement at step 1", motion=pd.concat([motion, motion.loc[[3]]]))
    refused(f"node {held[3]} of the fixed enthesis 1 moves at step 1", motion=changed(motion, 3, "uy_mm", 1e-3))
    refused("has no rows", motion=motion.iloc[:0])
    refused("no node belongs to enthesis 2", motion=motion[motion["enthesis"] == 1])
    refused("no node belongs to enthesis 1", motion=motion[motion["enthesis"] == 2])
    refused(f"row {moved} has no finite number", motion=changed(motion, moved, "uz_mm", np.inf))
    refused("lacks the column 'direction_y'", fibers=fibers.drop(columns="direction_y"))
    refused("lacks the column 'transverse_y'", fibers=fibers.drop(columns="transverse_y"))
    refused("element 0 has H22 unlike H33, but no direction for H22", fibers=fibers.drop(columns=TRANSVERSE))
    refused("row 2 has no finite number in the column 'H11'", fibers=changed(fibers, 2, "H11", np.nan))
    refused("row 2 has element 24, but the mesh's elements", fibers=changed(fibers, 2, "element", 24))
    refused("element 2 has 0 rows; every element needs one", fibers=fibers.drop(index=2))
    refused("element 2 has 2 rows", fibers=pd.concat([fibers, fibers.loc[[2]]]))
    refused("element 2 has H11, H22, H33 .* their sum must be 1", fibers=changed(fibers, 2, "H11", 0.9))
    negative = changed(changed(changed(fibers, 2, "H11", 1.0), 2, "H22", 0.2), 2, "H33", -0.2)
    refused("element 2 has H11, H22, H33 .* must be above 0", fibers=negative)
    nowhere = fibers.assign(**{name: np.where(fibers["element"] == 2, 0.0, fibers[name]) for name in DIRECTION})
    refused("element 2 has a direction of length 0", fibers=nowhere)
    along = fibers.assign(**dict(zip(TRANSVERSE, fibers[DIRECTION].to_numpy().T, strict=True)))
    refused("element 0 has a transverse direction of length 0 or along", fibers=along)


def test_a_table_that_is_missing_is_named(files):
    motion, fibers, paths = files
    read(motion, fibers, paths)
    for name in ("motion", "fibers"):
        with pytest.raises(MeshError, match=r"gone\.csv: not a readable CSV file"):
            read_specimen(**paths | {name: "gone.csv"})
