"""Equilibrium: affine and rigid limits, derivatives of the energy, stability, descent, independence of order."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import small_network
from fibers import exponential
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from fibrous.deformation import Load
from fibrous.errors import ConvergenceError, NetworkError
from fibrous.networks.banded import Assembly
from fibrous.networks.geometry import Geometry
from fibrous.networks.guard import EquilibriumSolver, Limits

LOADS = {"x_uniaxial": 1.5, "xz_biaxial": 1.3, "xy_shear": 0.8, "yz_shear": 1.2}


def path(name: str, end: float, steps: int = 6) -> np.ndarray:
    load = Load.parse(name)
    return load.deformation_gradient(np.linspace(load.rest, end, steps + 1))


def dense(band: np.ndarray) -> np.ndarray:
    size = band.shape[1]
    full = np.zeros((size, size))
    for row in range(len(band)):
        for column in range(size - row):
            full[column + row, column] = full[column, column + row] = band[row, column]
    return full


def random_point(assembly: Assembly, rng: np.random.Generator):
    """F, a smooth u and a smooth direction, zero on the faces, so that short fibres are not torn apart."""
    position = assembly.network.node_position[assembly.nodes]
    bubble = (1.0 - 4.0 * position**2).prod(axis=1)[:, None]
    waves = [bubble * np.sin(position @ rng.normal(size=(3, 3)) * 3.0 + rng.normal(size=3)) for _ in range(2)]
    displacement = np.zeros((assembly.size + 1, 3))
    displacement[:-1] = 0.03 * waves[0]
    return np.eye(3) + 0.1 * rng.normal(size=(3, 3)), displacement, waves[1].ravel()


def test_residual_is_the_gradient_of_the_energy(network, rng):
    assembly = Assembly(network, exponential(2.5))
    F, u, direction = random_point(assembly, rng)
    step = 1e-6
    up, down = (assembly.energy(assembly.evaluate(F, assembly.moved(u, s * step * direction))) for s in (1.0, -1.0))
    assert assembly.evaluate(F, u).residual @ direction == pytest.approx((up - down) / (2.0 * step), rel=1e-7)


def test_hessian_is_the_derivative_of_the_residual(network, rng):
    assembly = Assembly(network, exponential(2.5))
    F, u, direction = random_point(assembly, rng)
    step = 1e-7
    up, down = (assembly.evaluate(F, assembly.moved(u, s * step * direction)).residual for s in (1.0, -1.0))
    product = dense(assembly.hessian(assembly.evaluate(F, u))) @ direction
    np.testing.assert_allclose(product, (up - down) / (2.0 * step), atol=1e-6 * np.abs(product).max())


def test_stress_is_the_derivative_of_the_energy(network, rng):
    assembly = Assembly(network, exponential(2.5))
    F, u, _ = random_point(assembly, rng)
    direction = rng.normal(size=(3, 3))
    step = 1e-6
    up, down = (assembly.energy(assembly.evaluate(F + s * step * direction, u)) for s in (1.0, -1.0))
    slope = np.sum(assembly.stress(assembly.evaluate(F, u)) * direction)
    assert slope == pytest.approx((up - down) / (2.0 * step), rel=1e-7)


def test_leaving_out_negative_tension_makes_the_hessian_semidefinite_and_touches_nothing_else(network, rng):
    assembly = Assembly(network, exponential(2.5))
    point = assembly.evaluate(np.diag([0.6, 0.7, 0.8]), np.zeros((assembly.size + 1, 3)))
    assert np.linalg.eigvalsh(dense(assembly.hessian(point)))[0] < 0.0
    assert np.linalg.eigvalsh(dense(assembly.hessian(point, 1.0)))[0] > 0.0
    a, b = network.fiber_nodes.T
    expected = np.zeros((len(network.node_position),) * 2 + (3, 3))
    for first, second, D in zip(a, b, network.fiber_vectors, strict=True):
        d, L = point.gradient @ D, np.linalg.norm(D)
        length = np.linalg.norm(d)
        n = d / length
        force, stiffness = exponential(2.5).response(length / L)
        across = max(float(force), 0.0) / length
        block = across * (np.eye(3) - np.outer(n, n)) + stiffness / L * np.outer(n, n)
        for i, j, sign in ((first, first, 1), (second, second, 1), (first, second, -1), (second, first, -1)):
            expected[i, j] += sign * block
    expected = expected[np.ix_(assembly.nodes, assembly.nodes)].transpose(0, 2, 1, 3).reshape(3 * assembly.size, -1)
    np.testing.assert_allclose(dense(assembly.hessian(point, 1.0)), expected, atol=1e-10 * np.abs(expected).max())
    stretched = assembly.evaluate(1.2 * np.eye(3), np.zeros((assembly.size + 1, 3)))
    np.testing.assert_array_equal(assembly.hessian(stretched).copy(), assembly.hessian(stretched, 1.0))


@pytest.mark.parametrize("name", LOADS)
def test_states_are_balanced_stable_and_lower_than_affine(solver, name):
    assembly = solver.assembly
    for state in solver.follow(path(name, LOADS[name])):
        assert state.converged
        point = state.point
        bound = 1e-11 * np.sqrt(assembly.size) * max(1.0, np.sqrt((point.forces**2).sum(axis=1).mean()))
        assert np.linalg.norm(point.residual) <= bound
        assert np.linalg.eigvalsh(dense(assembly.hessian(point)))[0] > 0.0
        affine = assembly.evaluate(point.gradient, np.zeros_like(point.displacement))
        assert assembly.energy(point) <= assembly.energy(affine)


def test_states_agree_with_a_general_minimizer():
    """An independent computation: BFGS on the energy of node positions, written from Eq. 6 alone."""
    network = small_network(3, edge_length_um=8.0)
    solver = EquilibriumSolver.of(network, exponential(2.5))
    F = Load.parse("x_uniaxial").deformation_gradient(1.2)
    found = solver.node_position(solver.equilibrium(F))
    free = ~network.node_is_boundary
    affine = network.node_position @ F.T
    a, b = network.fiber_nodes.T
    L = np.linalg.norm(network.node_position[b] - network.node_position[a], axis=1)

    def energy_and_slope(unknowns):
        x = affine.copy()
        x[free] = unknowns.reshape(-1, 3)
        d = x[b] - x[a]
        length = np.linalg.norm(d, axis=1)
        nodes, weights = np.polynomial.legendre.leggauss(20)
        s = 1.0 + np.outer(length / L - 1.0, 0.5 * (nodes + 1.0))
        w = (np.expm1(2.5 * (s**2 - 1.0) / 2.0) / 2.5) @ weights * 0.5 * (length / L - 1.0)
        pull = (np.expm1(2.5 * ((length / L) ** 2 - 1.0) / 2.0) / 2.5 / length)[:, None] * d
        slope = np.zeros_like(x)
        np.add.at(slope, b, pull)
        np.add.at(slope, a, -pull)
        return L @ w, slope[free].ravel()

    best = minimize(
        energy_and_slope,
        affine[free].ravel(),
        jac=True,
        method="BFGS",
        options={"gtol": 1e-6},
    )
    assert best.success, best.message
    np.testing.assert_allclose(found[free].ravel(), best.x, atol=1e-5)


def test_a_single_node_between_collinear_fibers_finds_the_closed_form():
    """Three orthogonal pairs of fibres about an off-centre node: along each axis two springs in series."""
    centre = np.array([0.1, -0.2, 0.05])
    ends = np.concatenate([np.where(np.eye(3) > 0, s * 0.5, centre) for s in (-1.0, 1.0)])
    network = Geometry(
        np.vstack([centre, ends]), np.array([False] + [True] * 6), np.array([[0, k] for k in range(1, 7)])
    )
    solver = EquilibriumSolver.of(network, exponential(2.5))
    F = np.diag([1.3, 1.1, 1.2])
    state = solver.equilibrium(F)
    # Equal forces in series mean equal stretches: the fluctuation is zero and every fibre is stretched like its axis.
    np.testing.assert_allclose(state.point.stretches, [1.3, 1.1, 1.2] * 2, rtol=1e-12)
    np.testing.assert_allclose(state.point.displacement, 0.0, atol=1e-12)


def test_an_unstable_equilibrium_is_left():
    """A straight column pushed along its axis is in balance with its slack stays, and buckles."""
    position = np.array([[-0.5, 0.0, 0.0], [0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.5]])
    boundary = np.array([True, False, True, True, True])
    solver = EquilibriumSolver.of(
        Geometry(position, boundary, np.array([[0, 1], [1, 2], [1, 3], [1, 4]])), exponential(2.5)
    )
    F = np.diag([0.4, 1.0, 1.0])
    straight = solver.assembly.evaluate(F, np.zeros((2, 3)))
    np.testing.assert_allclose(straight.residual, 0.0, atol=1e-15)
    assert np.linalg.eigvalsh(dense(solver.assembly.hessian(straight)))[0] < 0.0
    state = solver.equilibrium(F)
    assert state.converged
    assert np.abs(state.point.displacement).max() > 0.01
    assert solver.assembly.energy(state.point) < solver.assembly.energy(straight)


@pytest.mark.parametrize("seed", range(3))
def test_rigid_rotation_costs_nothing(solver, seed):
    R = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    point = solver.assembly.evaluate(R, np.zeros((solver.assembly.size + 1, 3)))
    np.testing.assert_allclose(point.residual, 0.0, atol=1e-13)
    assert solver.assembly.energy(point) == pytest.approx(0.0, abs=1e-14)


def test_affine_limit_without_interior_nodes(rng):
    """All nodes on the faces: every fibre follows F, so the energy is the affine sum and nothing is iterated."""
    faces = rng.uniform(-0.5, 0.5, size=(12, 3))
    faces[np.arange(12), np.arange(12) % 3] = np.where(np.arange(12) % 2, 0.5, -0.5)
    network = Geometry(faces, np.ones(12, dtype=bool), np.array([[k, (k + 5) % 12] for k in range(12)]))
    solver = EquilibriumSolver.of(network, exponential(2.5))
    F = np.eye(3) + 0.2 * rng.normal(size=(3, 3))
    state = solver.equilibrium(F)
    stretches = np.linalg.norm(network.fiber_vectors @ F.T, axis=1) / network.fiber_lengths
    assert state.converged
    assert state.iterations == 0
    np.testing.assert_allclose(state.point.stretches, stretches, rtol=1e-14)
    assert solver.assembly.energy(state.point) == pytest.approx(
        network.fiber_lengths @ exponential(2.5).energy(stretches)
    )


def test_the_order_of_nodes_and_the_direction_of_fibers_do_not_matter(network, rng):
    shuffled = rng.permutation(len(network.node_position))
    place = np.argsort(shuffled)
    flipped = np.where(
        rng.random(len(network.fiber_nodes))[:, None] < 0.5, network.fiber_nodes, network.fiber_nodes[:, ::-1]
    )
    other = Geometry(network.node_position[shuffled], network.node_is_boundary[shuffled], place[flipped])
    F = path("xy_shear", 0.6)
    one, two = (EquilibriumSolver.of(net, exponential(2.5)) for net in (network, other))
    a, b = one.node_position(one.follow(F)[-1]), two.node_position(two.follow(F)[-1])
    np.testing.assert_allclose(b[place], a, atol=1e-8)


def test_prediction_is_the_tangent_of_the_equilibrium_path(tight_solver):
    F, dF = (
        Load.parse("x_uniaxial").deformation_gradient(1.2),
        np.array([[0.3, 0.1, 0], [0, -0.2, 0.05], [0.1, 0, -0.1]]),
    )
    step = 1e-5
    here = tight_solver.equilibrium(F)
    up, down = (tight_solver.equilibrium(F + s * step * dF, near=here).point.displacement[:-1].ravel() for s in (1, -1))
    assembly = tight_solver.assembly
    rate = assembly.displacement_rate(here.point, assembly.factor(here.point), dF)
    np.testing.assert_allclose(rate, (up - down) / (2.0 * step), atol=1e-6 * np.abs(rate).max())


def test_prediction_misses_by_a_term_of_fourth_order(tight_solver):
    """The cubic through two states and their rates, where F is linear in the step: half the step, 1/16 of the miss."""
    load = Load.parse("xy_shear")
    errors = []
    for step in (0.04, 0.02):
        gradients = load.deformation_gradient(0.2 + step * np.array([-1.0, 0.0, 1.0]))
        first = tight_solver._refactored(tight_solver.equilibrium(gradients[0]))
        here = tight_solver._reach(first, gradients[1], 0)
        start, _ = tight_solver._predicted(here, gradients[2])
        exact = tight_solver.equilibrium(gradients[2], near=here.state).point.displacement
        errors.append(np.linalg.norm(start.displacement - exact))
    assert 10.0 < errors[0] / errors[1] < 25.0


def test_the_scale_of_forces_is_their_root_mean_square_above_one(solver):
    u = np.zeros((solver.assembly.size + 1, 3))
    assert solver.assembly.evaluate(np.eye(3), u).force_scale == 1.0
    point = solver.assembly.evaluate(np.diag([3.0, 0.6, 0.6]), u)
    force, _ = exponential(2.5).response(point.stretches)
    assert point.force_scale == pytest.approx(np.sqrt(np.mean(force**2)), rel=1e-12)
    assert point.force_scale > 100.0


def test_forces_beyond_the_range_of_floats_are_no_equilibrium(network):
    stiff = EquilibriumSolver.of(network, exponential(50.0))
    assert not stiff.equilibrium(np.diag([4.2, 0.5, 0.5])).converged


def test_a_path_need_not_begin_at_rest(solver):
    gradient = Load.parse("x_uniaxial").deformation_gradient(1.2)
    direct, along = solver.follow([gradient])[0], solver.follow([np.eye(3), gradient])[1]
    assert direct.converged
    np.testing.assert_allclose(direct.point.displacement, along.point.displacement, atol=1e-9)
    assert solver.assembly.energy(direct.point) > 0.0


def test_a_step_too_long_is_cut_and_reaches_the_same_state(network):
    generous = EquilibriumSolver.of(network, exponential(2.5))
    hasty = replace(generous, limits=Limits(largest_number_of_iterations=3))
    F = path("x_uniaxial", 1.6, steps=2)
    cut, whole = hasty.follow(F)[-1], generous.follow(F)[-1]
    assert cut.converged
    assert cut.cuts > 0
    np.testing.assert_allclose(cut.point.displacement, whole.point.displacement, atol=1e-8)


def test_what_does_not_converge_says_so_and_stops_the_path(network):
    hopeless = EquilibriumSolver.of(
        network, exponential(2.5), Limits(largest_number_of_iterations=1, largest_number_of_cuts=0)
    )
    states = hopeless.follow(path("x_uniaxial", 2.5, steps=2))
    assert [state.converged for state in states] == [True, False, False]
    assert [state.iterations for state in states] == [0, 1, 0]
    with pytest.raises(ConvergenceError, match="no stable equilibrium, so it has no tangent"):
        hopeless.condensed_tangent(states[1])


def test_a_mechanism_is_refused():
    position = np.array([[-0.5, 0.0, 0.0], [0.0, 0.0, 0.0], [0.5, 0.0, 0.0]])
    chain = Geometry(position, np.array([True, False, True]), np.array([[0, 1], [1, 2]]))
    with pytest.raises(NetworkError, match="mechanism at rest"):
        EquilibriumSolver.of(chain, exponential(2.5)).follow([np.eye(3)])
