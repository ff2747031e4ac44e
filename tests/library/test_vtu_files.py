"""A state for ParaView: what is read back is what the finite elements found, with means and shear by hand."""

import meshio
import numpy as np
import pytest

from fibrous.deformation import cauchy_stress, green_lagrange_strain, maximum_shear
from fibrous.materials.hgo import HGOFamilies
from fibrous.materials.neo_hookean import NeoHookean
from fibrous.specimen import Slab
from fibrous.tissue import solve


@pytest.fixture(scope="module")
def state():
    specimen = Slab(elements=(3, 4, 2)).specimen(2)
    fibers = HGOFamilies.of_structure_tensor(specimen.structure_tensor[:, None], 0.15, 0.33)
    return solve(specimen, NeoHookean(0.025, 0.417) + fibers)


def test_a_state_is_read_back_as_it_was(state, tmp_path):
    specimen, displacement, gradient = state.specimen, state.displacement[-1], state.deformation_gradient[-1]
    P, J = state.piola[-1], np.linalg.det(gradient)
    stress = np.einsum("...iJ,...jJ->...ij", P, gradient) / J[..., None, None]
    elements = len(specimen.mesh.element_nodes)
    constants = {"C2_MPa": np.linspace(0.1, 0.2, elements), "C3": np.linspace(0.0, 1.0, elements)}
    (tmp_path / "state.vtu").write_bytes(state.vtu(cells=constants))
    found = meshio.read(tmp_path / "state.vtu")
    np.testing.assert_array_equal(found.points, specimen.mesh.node_position)
    assert [block.type for block in found.cells] == ["hexahedron"]
    np.testing.assert_array_equal(found.cells[0].data, specimen.mesh.element_nodes)
    np.testing.assert_array_equal(found.point_data["displacement_mm"], displacement)
    np.testing.assert_array_equal(found.point_data["enthesis"], specimen.enthesis)
    cells = {name: values[0] for name, values in found.cell_data.items()}
    np.testing.assert_array_equal(cells["fiber_direction"], specimen.fiber_direction)
    for name, values in constants.items():
        np.testing.assert_array_equal(cells[name], values)
    np.testing.assert_allclose(cells["cauchy_stress_MPa"].reshape(-1, 3, 3), sum(stress[:, q] for q in range(8)) / 8)
    # Tresca's shear from singular values: principal strains are (s² − 1)/2.
    stretches = np.linalg.svd(gradient, compute_uv=False)
    shear = ((stretches[..., 0] ** 2 - stretches[..., 2] ** 2) / 4.0).mean(axis=1)
    np.testing.assert_allclose(cells["maximum_shear_strain"], shear, rtol=1e-12)
    expected = np.swapaxes(gradient, 2, 3) @ gradient / 2.0 - np.eye(3) / 2.0
    np.testing.assert_allclose(
        cells["green_lagrange_strain"], expected.mean(axis=1).reshape(-1, 9), rtol=0.0, atol=1e-15
    )
    assert (cells["maximum_shear_stress_MPa"] > 0.0).all()


def test_maximum_shear_is_the_largest_over_all_planes(rng):
    tensor = rng.normal(size=(3, 3))
    tensor = tensor + tensor.T
    pairs = np.linalg.qr(rng.normal(size=(20000, 3, 3)))[0]
    found = np.abs(np.einsum("ki,ij,kj->k", pairs[..., 0], tensor, pairs[..., 1])).max()
    assert found <= maximum_shear(tensor) * (1.0 + 1e-12)
    assert found > 0.98 * maximum_shear(tensor)


def test_stress_and_strain_of_a_turned_stretch(rng):
    # F = R diag(s): σ is R diag(P_i s_i / J) Rᵀ, and E knows no rotation.
    stretches, principal = np.array([1.3, 0.9, 1.1]), np.array([0.2, -0.1, 0.05])
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    gradient, stress = turn * stretches, turn * principal
    expected = (turn * (principal * stretches / stretches.prod())) @ turn.T
    np.testing.assert_allclose(cauchy_stress(stress, gradient), expected, atol=1e-15)
    np.testing.assert_allclose(green_lagrange_strain(gradient), np.diag((stretches**2 - 1.0) / 2.0), atol=1e-15)
