"""A network along paths: Hill-Mandel, work, differences, objectivity, units, and the guard's answer to every state."""

import numpy as np
import pytest
from fibers import buckling, exponential, stress_scale
from reference import respond
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from fibrous.deformation import Load
from fibrous.networks.engine import Engine
from fibrous.networks.guard import EquilibriumSolver, Limits
from fibrous.networks.path import follow

SCALE = stress_scale(10.0, 0.1, 10.0)
F_GENERAL = np.array([[1.239, 0, 0.0035], [0, 1.048, -0.0014], [-0.0080, 0.102, 0.770]])  # Eq. 9
LAWS = {
    "exponential": exponential(2.5),
    "linear beyond": exponential(2.5, linear_beyond_stretch=1.05),
    "buckling": buckling(0.2),
}


def at(engine, F, **options):
    """The response at one F, reached from rest in one step, without the leading axes."""
    return {
        name: None if values is None else values[0, 0]
        for name, values in vars(follow(engine, np.asarray(F)[None, None], SCALE, **options)).items()
    }


def test_scale_is_modulus_times_area_over_face():
    assert stress_scale(10.0, 0.1, 20.0) == pytest.approx(10.0 * np.pi * 0.1**2 / 20.0**2)


def test_hill_mandel_stress_from_fibers_equals_stress_from_boundary_forces(tight_engine):
    response, network = at(tight_engine, F_GENERAL, geometry=True), tight_engine.network
    x = response["node_position"]
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
    stress = response["first_piola_kirchhoff_stress"]
    np.testing.assert_allclose(stress, from_boundary, atol=1e-10 * np.abs(from_boundary).max())


def test_cauchy_stress_is_equation_7_over_the_deformed_volume(tight_engine):
    response = at(tight_engine, F_GENERAL, geometry=True)
    x, (a, b) = response["node_position"], tight_engine.network.fiber_nodes.T
    d = x[b] - x[a]
    length = np.linalg.norm(d, axis=1)
    stretch = length / tight_engine.network.fiber_lengths
    np.testing.assert_allclose(response["fiber_stretch"], stretch, rtol=1e-12)
    force = np.expm1(1.25 * (stretch**2 - 1.0)) / 2.5
    n = d / length[:, None]
    printed = SCALE * np.einsum("m,mi,mj,m->ij", force, n, n, length) / np.linalg.det(F_GENERAL)
    stress = response["cauchy_stress"]
    np.testing.assert_allclose(stress, printed, atol=1e-10 * np.abs(printed).max())
    np.testing.assert_allclose(stress, stress.T, atol=1e-10 * np.abs(printed).max())


@pytest.mark.parametrize(("name", "end"), [("x_uniaxial", 1.5), ("xy_shear", 0.9), ("xy_biaxial", 1.3)])
def test_work_of_the_stress_along_a_path_is_the_energy(engine, name, end):
    load = Load.parse(name)
    magnitudes = np.linspace(load.rest, end, 201)
    gradients = load.deformation_gradient(magnitudes)
    response = follow(engine, gradients[None], SCALE)
    assert response.converged.all()
    rate = CubicSpline(magnitudes, gradients.reshape(-1, 9)).derivative()(magnitudes).reshape(-1, 3, 3)
    power = np.einsum("sij,sij->s", response.first_piola_kirchhoff_stress[0], rate)
    work = CubicSpline(magnitudes, power).antiderivative()(magnitudes)
    energy = response.strain_energy_density[0]
    np.testing.assert_allclose(work, energy, atol=1e-6 * energy[-1])


@pytest.mark.parametrize("F", [F_GENERAL, Load.parse("xy_shear").deformation_gradient(0.7), np.diag([1.3, 0.9, 0.85])])
def test_condensed_tangent_is_the_derivative_of_stress(tight_engine, F):
    step = 2e-6
    changes = step * np.eye(9).reshape(9, 3, 3)
    paths = np.array([[F, F + sign * change] for sign in (1.0, -1.0) for change in changes])
    response = follow(tight_engine, paths, SCALE, tangent=True)
    tangent = response.tangent[0, 0]
    up, down = response.first_piola_kirchhoff_stress[:, 1].reshape(2, 3, 3, 3, 3)
    differences = ((up - down) / (2.0 * step)).transpose(2, 3, 0, 1)
    np.testing.assert_allclose(tangent, differences, atol=1e-7 * np.abs(tangent).max())
    np.testing.assert_allclose(tangent, tangent.transpose(2, 3, 0, 1), atol=1e-7 * np.abs(tangent).max())


def test_solutions_rotate_with_the_load(tight_engine):
    R = Rotation.from_euler("z", 0.3).as_matrix()
    F = Load.parse("x_uniaxial").deformation_gradient(1.15)
    response = follow(tight_engine, np.array([[F], [R @ F]]), SCALE)
    one, other = response.cauchy_stress[:, 0]
    np.testing.assert_allclose(other, R @ one @ R.T, atol=1e-12 * np.abs(one).max())
    assert response.strain_energy_density[1, 0] == pytest.approx(response.strain_energy_density[0, 0], rel=1e-12)


@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_units_scale_stress_and_energy_and_change_no_iteration(engine, factor):
    gradients = Load.parse("xz_biaxial").deformation_gradient(np.linspace(1.0, 1.4, 6))[None]
    one, two = (follow(engine, gradients, stress_scale(10.0 * by, 0.1, 10.0)) for by in (1.0, factor))
    np.testing.assert_array_equal(one.newton_iterations, two.newton_iterations)
    np.testing.assert_allclose(two.cauchy_stress, factor * one.cauchy_stress, rtol=1e-13, atol=1e-13 * factor)
    np.testing.assert_allclose(two.strain_energy_density, factor * one.strain_energy_density, rtol=1e-13)


def test_orientation_tensor_weighs_current_lengths(engine):
    response = at(engine, Load.parse("xy_shear").deformation_gradient(0.5), geometry=True)
    x, (a, b) = response["node_position"], engine.network.fiber_nodes.T
    h = np.zeros((3, 3))
    for d in x[b] - x[a]:
        h += np.outer(d, d) / np.linalg.norm(d)
    h /= np.linalg.norm(x[b] - x[a], axis=1).sum()
    np.testing.assert_allclose(response["orientation_tensor"], h, atol=1e-13)
    assert np.trace(h) == pytest.approx(1.0)


def test_stretch_aligns_and_rest_is_free_of_stress(engine):
    response = follow(engine, Load.parse("x_uniaxial").deformation_gradient(np.array([[1.0, 1.3]])), SCALE)
    assert response.strain_energy_density[0, 0] == pytest.approx(0.0, abs=1e-15)
    np.testing.assert_allclose(response.cauchy_stress[0, 0], 0.0, atol=1e-15)
    rest, stretched = response.largest_orientation_eigenvalue[0]
    assert stretched > rest
    assert response.cauchy_stress[0, 1, 0, 0] > 0.0


def test_unconverged_steps_carry_no_number_and_stop_no_other_path(network):
    hasty = Engine.of(network, exponential(2.5), Limits(largest_number_of_iterations=2, largest_number_of_cuts=0))
    loads = [np.array([1.0, 2.0, 2.5]), np.array([1.0, 1.0005, 1.001])]
    paths = np.array([Load.parse("x_uniaxial").deformation_gradient(load) for load in loads])
    response = follow(hasty, paths, SCALE, tangent=True, geometry=True)
    np.testing.assert_array_equal(response.converged, [[True, False, False], [True, True, True]])
    assert response.newton_iterations[0, 2] == 0
    for name, values in vars(response).items():
        if values.dtype.kind == "f":
            assert np.isnan(values[0, 1:]).all(), name
            assert np.isfinite(values[1]).all(), name
    np.testing.assert_array_equal(np.isnan(response.largest_orientation_eigenvalue), ~response.converged)


@pytest.mark.parametrize("law", LAWS)
def test_every_state_is_the_guards(network, law):
    """Nine paths, so that lanes are filled twice; some meet indefinite Hessians on the way."""
    ends = {"x_uniaxial": 1.5, "z_uniaxial": 0.8, "xy_biaxial": 1.2, "xz_biaxial": 1.3, "yz_biaxial": 1.3}
    ends |= {"xy_shear": 0.8, "xz_shear": 0.7, "yz_shear": 1.0, "y_uniaxial": 0.75}
    paths = np.array(
        [
            Load.parse(name).deformation_gradient(np.linspace(Load.parse(name).rest, end, 9))
            for name, end in ends.items()
        ]
    )
    response = follow(Engine.of(network, LAWS[law]), paths, SCALE, tangent=True, geometry=True)
    solver = EquilibriumSolver.of(network, LAWS[law])
    assert response.converged.all()
    if law == "exponential":
        assert response.indefinite_hessians.sum() > 0
    for p, path in enumerate(paths):
        alone = respond(solver, path, SCALE)
        assert alone.converged.all()
        for name in ("strain_energy_density", "cauchy_stress", "orientation_tensor", "node_position", "fiber_stretch"):
            expected, values = getattr(alone, name), getattr(response, name)[p]
            np.testing.assert_allclose(values, expected, atol=1e-8 * np.abs(expected).max(), err_msg=f"{name} {p}")
        state = solver.follow(path)[-1]
        expected = SCALE * solver.condensed_tangent(state)
        np.testing.assert_allclose(response.tangent[p, -1], expected, atol=1e-7 * np.abs(expected).max())


def test_paths_do_not_know_of_each_other_beyond_rounding(engine):
    paths = np.array(
        [
            np.eye(3) + np.linspace(0.0, 1.0, 4)[:, None, None] * (end - np.eye(3))
            for end in (F_GENERAL, np.diag([1.2, 0.9, 0.95]))
        ]
    )
    both, first = follow(engine, paths, SCALE), follow(engine, paths[:1], SCALE)
    np.testing.assert_allclose(
        both.cauchy_stress[:1], first.cauchy_stress, atol=1e-10 * np.abs(first.cauchy_stress).max()
    )


def test_a_path_need_not_begin_at_rest(engine):
    gradient = Load.parse("x_uniaxial").deformation_gradient(1.2)
    direct = follow(engine, gradient[None, None], SCALE)
    along = follow(engine, np.array([[np.eye(3), gradient]]), SCALE)
    assert direct.converged.all()
    np.testing.assert_allclose(direct.cauchy_stress[0, 0], along.cauchy_stress[0, 1], atol=1e-10)
    assert direct.strain_energy_density[0, 0] > 0.0
