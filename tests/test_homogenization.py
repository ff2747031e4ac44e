"""Homogenised stress, energy and tangent: Hill-Mandel, work, differences, objectivity, units."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from fibrous.deformation import Load
from fibrous.networks import homogenization
from fibrous.networks.equilibrium import EquilibriumSolver
from fibrous.networks.fiber_law import FiberLaw
from fibrous.networks.homogenization import stress_scale
from fibrous.networks.response import respond

SCALE = stress_scale(10.0, 0.1, 10.0)
F_GENERAL = np.array([[1.239, 0, 0.0035], [0, 1.048, -0.0014], [-0.0080, 0.102, 0.770]])  # Eq. 9


def test_scale_is_modulus_times_area_over_face():
    assert stress_scale(10.0, 0.1, 20.0) == pytest.approx(10.0 * np.pi * 0.1**2 / 20.0**2)


def test_hill_mandel_stress_from_fibers_equals_stress_from_boundary_forces(tight_solver):
    state = tight_solver.equilibrium(F_GENERAL)
    network = tight_solver.assembly.network
    x = tight_solver.node_position(state)
    a, b = network.fiber_nodes.T
    d = x[b] - x[a]
    length = np.linalg.norm(d, axis=1)
    pull = (np.expm1(1.25 * ((length / network.fiber_lengths) ** 2 - 1.0)) / 2.5 / length)[:, None] * d
    traction = np.zeros_like(x)
    np.add.at(traction, b, pull)
    np.add.at(traction, a, -pull)
    assert np.abs(traction[~network.node_is_boundary]).max() < 1e-12
    boundary = network.node_is_boundary
    from_boundary = SCALE * traction[boundary].T @ network.node_position[boundary]
    from_fibers = homogenization.first_piola_kirchhoff_stress(tight_solver, state, SCALE)
    np.testing.assert_allclose(from_fibers, from_boundary, atol=1e-10 * np.abs(from_boundary).max())


def test_cauchy_stress_is_equation_7_over_the_deformed_volume(tight_solver):
    state = tight_solver.equilibrium(F_GENERAL)
    x, (a, b) = tight_solver.node_position(state), tight_solver.assembly.network.fiber_nodes.T
    d = x[b] - x[a]
    length = np.linalg.norm(d, axis=1)
    force = np.expm1(1.25 * ((length / tight_solver.assembly.lengths) ** 2 - 1.0)) / 2.5
    n = d / length[:, None]
    printed = SCALE * np.einsum("m,mi,mj,m->ij", force, n, n, length) / np.linalg.det(F_GENERAL)
    stress = homogenization.cauchy_stress(tight_solver, state, SCALE)
    np.testing.assert_allclose(stress, printed, atol=1e-10 * np.abs(printed).max())
    np.testing.assert_allclose(stress, stress.T, atol=1e-10 * np.abs(printed).max())


@pytest.mark.parametrize(("name", "end"), [("x_uniaxial", 1.5), ("xy_shear", 0.9), ("xy_biaxial", 1.3)])
def test_work_of_the_stress_along_a_path_is_the_energy(solver, name, end):
    load = Load.parse(name)
    magnitudes = np.linspace(load.rest, end, 201)
    gradients = load.deformation_gradient(magnitudes)
    response = respond(solver, gradients, SCALE)
    assert response.converged.all()
    rate = CubicSpline(magnitudes, gradients.reshape(-1, 9)).derivative()(magnitudes).reshape(-1, 3, 3)
    power = np.einsum("sij,sij->s", response.first_piola_kirchhoff_stress, rate)
    work = CubicSpline(magnitudes, power).antiderivative()(magnitudes)
    np.testing.assert_allclose(work, response.strain_energy_density, atol=1e-6 * response.strain_energy_density[-1])


@pytest.mark.parametrize("F", [F_GENERAL, Load.parse("xy_shear").deformation_gradient(0.7), np.diag([1.3, 0.9, 0.85])])
def test_condensed_tangent_is_the_derivative_of_stress(tight_solver, F):
    here = tight_solver.equilibrium(F)
    tangent = homogenization.tangent(tight_solver, here, SCALE)
    step = 2e-6
    differences = np.empty((3, 3, 3, 3))
    for k in range(3):
        for L in range(3):
            dF = np.zeros((3, 3))
            dF[k, L] = step
            up, down = (
                homogenization.first_piola_kirchhoff_stress(
                    tight_solver, tight_solver.equilibrium(F + s * dF, near=here), SCALE
                )
                for s in (1.0, -1.0)
            )
            differences[:, :, k, L] = (up - down) / (2.0 * step)
    np.testing.assert_allclose(tangent, differences, atol=1e-7 * np.abs(tangent).max())
    np.testing.assert_allclose(tangent, tangent.transpose(2, 3, 0, 1), atol=1e-12 * np.abs(tangent).max())


def test_frame_indifference(tight_solver):
    R = Rotation.from_euler("xyz", [0.4, -0.7, 1.1]).as_matrix()
    one = tight_solver.equilibrium(F_GENERAL)
    # Rotating the boundary of an equilibrium rotates all of it: the rotated state is reached without an iteration.
    turned = one.point.displacement @ R.T
    two = tight_solver.assembly.evaluate(R @ F_GENERAL, turned)
    scale = np.abs(tight_solver.assembly.stress(one.point)).max()
    assert tight_solver.assembly.energy(two) == pytest.approx(tight_solver.assembly.energy(one.point), rel=1e-12)
    np.testing.assert_allclose(
        tight_solver.assembly.stress(two), R @ tight_solver.assembly.stress(one.point), atol=1e-12 * scale
    )
    np.testing.assert_allclose(two.residual, (one.point.residual.reshape(-1, 3) @ R.T).ravel(), atol=1e-12 * scale)


def test_solutions_rotate_with_the_load(tight_solver):
    R = Rotation.from_euler("z", 0.3).as_matrix()
    F = Load.parse("x_uniaxial").deformation_gradient(1.15)
    one = homogenization.cauchy_stress(tight_solver, tight_solver.equilibrium(F), SCALE)
    two = homogenization.cauchy_stress(tight_solver, tight_solver.equilibrium(R @ F), SCALE)
    np.testing.assert_allclose(two, R @ one @ R.T, atol=1e-12 * np.abs(one).max())


@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_units_scale_stress_and_energy_and_change_no_iteration(solver, factor):
    gradients = Load.parse("xz_biaxial").deformation_gradient(np.linspace(1.0, 1.4, 6))
    one, two = respond(solver, gradients, SCALE), respond(solver, gradients, stress_scale(10.0 * factor, 0.1, 10.0))
    np.testing.assert_array_equal(one.newton_iterations, two.newton_iterations)
    np.testing.assert_allclose(two.cauchy_stress, factor * one.cauchy_stress, rtol=1e-13, atol=1e-13 * factor)
    np.testing.assert_allclose(two.strain_energy_density, factor * one.strain_energy_density, rtol=1e-13)


def test_orientation_tensor_weighs_current_lengths(solver):
    state = solver.equilibrium(Load.parse("xy_shear").deformation_gradient(0.5))
    x, (a, b) = solver.node_position(state), solver.assembly.network.fiber_nodes.T
    h = np.zeros((3, 3))
    for d in x[b] - x[a]:
        h += np.outer(d, d) / np.linalg.norm(d)
    h /= np.linalg.norm(x[b] - x[a], axis=1).sum()
    np.testing.assert_allclose(homogenization.orientation_tensor(state), h, atol=1e-13)
    assert np.trace(h) == pytest.approx(1.0)
    response = respond(solver, np.array([np.eye(3), state.point.gradient]), SCALE)
    assert response.largest_orientation_eigenvalue[1] == pytest.approx(np.linalg.eigvalsh(h)[-1], rel=1e-9)


def test_stretch_aligns_and_rest_is_free_of_stress(solver):
    response = respond(solver, Load.parse("x_uniaxial").deformation_gradient(np.array([1.0, 1.3])), SCALE)
    assert response.strain_energy_density[0] == 0.0
    np.testing.assert_allclose(response.cauchy_stress[0], 0.0, atol=1e-15)
    assert response.largest_orientation_eigenvalue[1] > response.largest_orientation_eigenvalue[0]
    assert response.cauchy_stress[1, 0, 0] > 0.0


def test_unconverged_steps_carry_no_number(network):
    hopeless = EquilibriumSolver.of(network, FiberLaw(2.5), largest_number_of_iterations=1, largest_number_of_cuts=0)
    response = respond(hopeless, Load.parse("x_uniaxial").deformation_gradient(np.array([1.0, 2.0, 2.5])), SCALE)
    np.testing.assert_array_equal(response.converged, [True, False, False])
    assert np.isnan(response.strain_energy_density[1:]).all()
    assert np.isnan(response.cauchy_stress[1:]).all()
    assert np.isnan(response.largest_orientation_eigenvalue[1:]).all()
