"""The hexahedron and its meshes: interpolation, integration, assembly, and meshes refused."""

import numpy as np
import pytest
from tissues import distorted_box, surface, tissue

from fibrous.fe import assembly as assembly_module
from fibrous.fe import hex8
from fibrous.fe.assembly import Assembly
from fibrous.fe.boundary import PrescribedDisplacement
from fibrous.fe.mesh import Mesh, MeshError, box
from fibrous.materials.contract import Mixture
from fibrous.materials.hgo import HGOFamilies
from fibrous.materials.neo_hookean import NeoHookean


def test_shape_functions_are_one_at_their_corner_and_sum_to_one(rng):
    np.testing.assert_allclose(hex8.shape_functions(hex8.CORNERS), np.eye(8), atol=1e-15)
    points = rng.uniform(-1.0, 1.0, (50, 3))
    np.testing.assert_allclose(hex8.shape_functions(points).sum(axis=1), 1.0, rtol=1e-14)
    np.testing.assert_allclose(hex8.shape_functions(points) @ hex8.CORNERS, points, atol=1e-14)


def test_shape_gradients_are_derivatives(rng):
    points, step = rng.uniform(-1.0, 1.0, (20, 3)), 1e-6
    for j in range(3):
        move = step * np.eye(3)[j]
        slope = (hex8.shape_functions(points + move) - hex8.shape_functions(points - move)) / (2.0 * step)
        np.testing.assert_allclose(hex8.shape_gradients(points)[..., j], slope, atol=1e-9)


def test_gauss_points_integrate_polynomials_of_degree_three():
    x, y, z = hex8.GAUSS_POINTS.T
    for values, exact in ((x**2 * y**2, 8 / 9), (x**3 * y**2, 0.0), (z**2, 8 / 3), (np.ones(8), 8.0)):
        assert values.sum() == pytest.approx(exact, abs=1e-14)


def test_volumes_and_gradients_of_a_distorted_mesh():
    mesh = distorted_box(3, lengths=(2.0, 1.0, 0.5))
    gradients, volumes = mesh.integration
    assert volumes.sum() == pytest.approx(1.0, rel=1e-13)  # inner nodes moved, the box is the same
    slope = np.array([[0.3, -0.2, 0.5], [0.1, 0.4, -0.7]])
    values = mesh.node_position @ slope.T
    found = np.einsum("eqaJ,eai->eqiJ", gradients, values[mesh.element_nodes])
    np.testing.assert_allclose(found, np.broadcast_to(slope, found.shape), atol=1e-13)


def test_nodal_forces_are_the_derivative_of_the_energy_and_stiffness_of_the_forces(rng):
    mesh, law = distorted_box(2), tissue()
    prescribed = np.array([17, 0, 5])
    assembly = Assembly(mesh, law, prescribed)
    u, v = 0.03 * rng.standard_normal((2, *mesh.node_position.shape))
    step = 1e-5

    def energy(displacement):
        return (law.energy(assembly.deformation_gradient(displacement)) * mesh.integration[1]).sum()

    point = assembly.evaluate(u, (None,))
    slope = (energy(u + step * v) - energy(u - step * v)) / (2.0 * step)
    assert (point.internal_force * v).sum() == pytest.approx(slope, rel=1e-8)

    up, down = (assembly.evaluate(u + sign * step * v, (None,)).internal_force.ravel() for sign in (1.0, -1.0))
    change = ((up - down) / (2.0 * step))[assembly.free]
    direction = v.ravel()
    found = point.stiffness @ direction[assembly.free] + point.coupling @ direction[prescribed]
    np.testing.assert_allclose(found, change, atol=1e-7 * np.abs(change).max())
    asymmetry = np.abs((point.stiffness - point.stiffness.T).toarray()).max()
    assert asymmetry < 1e-14 * np.abs(point.stiffness.data).max()


def test_blocks_change_nothing_and_parameters_stay_with_their_elements(monkeypatch, rng):
    mesh = distorted_box(3)
    elements = np.arange(len(mesh.element_nodes))[:, None]
    law = Mixture(
        (
            NeoHookean(0.025 + 0.001 * elements, 0.417),
            HGOFamilies(0.1 + 0.01 * elements, 0.1 * elements, rng.random((27, 1, 3)), np.eye(3)),
        )
    )
    u = 0.02 * rng.standard_normal(mesh.node_position.shape)
    whole = Assembly(mesh, law, np.arange(6)).evaluate(u, (None,))
    monkeypatch.setattr(assembly_module, "BLOCK", 5)
    in_blocks = Assembly(mesh, law, np.arange(6))
    blocked = in_blocks.evaluate(u, in_blocks.split(None))
    np.testing.assert_allclose(blocked.internal_force, whole.internal_force, atol=1e-15)
    np.testing.assert_allclose(blocked.stiffness.toarray(), whole.stiffness.toarray(), atol=1e-15)
    stress = law(whole_gradient := Assembly(mesh, law, np.arange(6)).deformation_gradient(u))[0]
    assert whole_gradient.shape == (27, 8, 3, 3)
    gradients, volumes = mesh.integration
    forces = np.zeros_like(u)
    np.add.at(forces, mesh.element_nodes, np.einsum("eq,eqaJ,eqiJ->eai", volumes, gradients, stress))
    np.testing.assert_allclose(whole.internal_force, forces, atol=1e-15)


def test_surface_nodes_of_a_box_are_all_but_the_inner_ones():
    mesh = box((4, 3, 2), (4.0, 3.0, 2.0))
    assert len(mesh.node_position) == 60
    assert len(surface(mesh)) == 60 - 3 * 2 * 1
    np.testing.assert_allclose(mesh.integration[1].sum(axis=1), 1.0)


CUBE = box((1, 1, 1)).node_position
ORDER = box((1, 1, 1)).element_nodes[0]


def cubes(*corners, position=CUBE):
    return lambda: Mesh(position, np.array(corners))


BAD_MESHES = {
    "element 1 is numbered inside out: swap its first four corners with its last four": cubes(
        ORDER, ORDER[[4, 5, 6, 7, 0, 1, 2, 3]]
    ),
    "element 1 is inverted or flat": cubes(ORDER, ORDER[[0, 2, 1, 3, 4, 5, 6, 7]]),
    "element 0 is inverted or flat": cubes(ORDER, position=CUBE * [1.0, 1.0, 0.0]),
    "element 0 has corners [0, 4, 6, 2, 1, 5, 7, 8], but nodes are numbered from 0 to 7": cubes(
        [0, 4, 6, 2, 1, 5, 7, 8]
    ),
    "element 0 has a corner twice": cubes([0, 4, 6, 2, 1, 5, 7, 7]),
    "node 8 belongs to no element": cubes(ORDER, position=np.vstack([CUBE, [[2.0, 0.0, 0.0]]])),
    "node 3 has a position that is not a finite number": cubes(
        ORDER, position=np.where(np.arange(8)[:, None] == 3, np.nan, CUBE)
    ),
    "corners of shape (elements, 8), not (8, 3) and (1, 4)": cubes([0, 1, 2, 4]),
}


@pytest.mark.parametrize("text", BAD_MESHES)
def test_bad_meshes_are_refused_in_a_line_that_names_the_culprit(text):
    with pytest.raises(MeshError) as error:
        BAD_MESHES[text]()
    assert text in str(error.value)
    assert "\n" not in str(error.value)


BAD_DISPLACEMENTS = {
    "node 4 has a prescribed displacement at step 1 that is not a number": lambda: PrescribedDisplacement(
        [3, 4], [0, 0], [[0.0, 0.0], [0.0, np.nan]]
    ),
    "node 3 has its displacement along y prescribed twice": lambda: PrescribedDisplacement(
        [3, 4, 3], [1, 1, 1], np.zeros((1, 3))
    ),
    "a displacement is prescribed at node 8, but nodes are numbered from 0 to 7": lambda: PrescribedDisplacement.at(
        [0, 8], 0.0
    ).unknowns(box((1, 1, 1))),
    "axes 0, 1 and 2": lambda: PrescribedDisplacement([0], [3], [[0.0]]),
    "(2,) nodes, (2,) axes and (1, 3) values": lambda: PrescribedDisplacement([0, 1], [0, 0], np.zeros((1, 3))),
}


@pytest.mark.parametrize("text", BAD_DISPLACEMENTS)
def test_bad_displacements_are_refused_in_a_line(text):
    with pytest.raises(MeshError) as error:
        BAD_DISPLACEMENTS[text]()
    assert text in str(error.value)
