"""The engine against its guard where trouble is, its linear algebra, fibre laws in every kernel, and its bits."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import small_network
from fibers import buckling, exponential
from reference import respond
from scipy.spatial.transform import Rotation

from fibrous.deformation import Load
from fibrous.errors import ConfigError, NetworkError
from fibrous.networks import kernels, relaxation
from fibrous.networks.elimination import solve
from fibrous.networks.engine import Engine, Room, room
from fibrous.networks.fiber_law import Fiber
from fibrous.networks.geometry import Geometry
from fibrous.networks.guard import LARGEST_MOVE, EquilibriumSolver, Limits
from fibrous.networks.lanes import LANES
from fibrous.networks.path import follow
from fibrous.networks.relaxation import REUSED, SHARP, STUCK

LAW = exponential(2.5)


def lanes(gradients) -> np.ndarray:
    """F of eight lanes, shape (3, 3, 8), from at most as many; the others at rest."""
    F = np.tile(np.eye(3)[..., None], (1, 1, LANES))
    F[..., : len(gradients)] = np.moveaxis(np.asarray(gradients), 0, -1)
    return F


def column(stays: int = 2) -> Geometry:
    """A straight column that is pushed along x, held by stays: in balance when straight, and unstable."""
    position = np.array([[-0.5, 0.0, 0.0], [0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.5]])
    fibers = np.array([[0, 1], [1, 2], [1, 3], [1, 4]])[: 2 + stays]
    return Geometry(position[: 3 + stays], np.array([True, False, True, True, True])[: 3 + stays], fibers)


def test_forces_and_hessian_are_derivatives_of_the_energy(network, rng):
    engine = Engine.of(network, LAW)
    n = engine.size
    u, directions = np.zeros((n + 1, 3, LANES)), np.zeros((n + 1, 3, LANES))
    u[:n] = 0.003 * rng.normal(size=(n, 3, LANES))
    directions[:n] = 0.003 * rng.normal(size=(n, 3, LANES))
    F = lanes(np.eye(3) + 0.1 * rng.normal(size=(8, 3, 3)))

    def energies(at):
        engine._pull(F, at)
        return engine.measures()[0]

    def residual(at):
        engine._pull(F, at)
        return room().array("residual", n + 1, 3)[:n].copy()

    step = 1e-4
    up, down = u + step * directions, u - step * directions
    slope = (residual(u) * directions[:n]).sum(axis=(0, 1))
    np.testing.assert_allclose(slope, (energies(up) - energies(down)) / (2.0 * step), rtol=1e-5)
    # The factor solves K x = r: K x by differences of the residual gives r back.
    stretched = lanes(np.eye(3) * np.linspace(1.01, 1.2, 8)[:, None, None])
    F = stretched
    u = np.zeros((n + 1, 3, LANES))
    engine._pull(F, u)
    assert engine._factorize(engine._forces()[1], 0.0).all()
    right = room().array("right", n, 3, 1)
    right[:, :, 0] = wanted = rng.normal(size=(n, 3, LANES))
    solve(engine.topology.starts, engine.topology.rows, engine._factor(), right)
    x = np.zeros_like(u)
    x[:n] = right[:, :, 0]
    h = 1e-6 / np.abs(x).max()
    product = (residual(u + h * x) - residual(u - h * x)) / (2.0 * h)
    np.testing.assert_allclose(product, wanted, atol=1e-5 * np.abs(wanted).max())


def test_lanes_blend_indefinite_hessians_as_the_guard_does(network):
    """Long steps into compression: the same equilibria, most of them without the guard."""
    ends = [np.diag([0.75, 1.05, 1.0]), np.diag([1.0, 0.7, 0.9]), np.diag([0.8, 0.8, 1.2]), np.diag([1.4, 0.8, 0.8])]
    engine = Engine.of(network, LAW)
    solver, state = EquilibriumSolver.of(network, LAW), engine.rest()
    direct = []
    for part in np.linspace(0.25, 1.0, 4):
        state = engine.advance(state, lanes(np.eye(3) + part * (np.array(ends) - np.eye(3))))
        direct.append(state.curved)
    assert state.converged.all()
    assert np.mean(direct) > 0.9
    P = engine.measures()[1]
    indefinite = 0
    for q, end in enumerate(ends):
        alone = solver.follow([np.eye(3) + part * (end - np.eye(3)) for part in np.linspace(0.0, 1.0, 5)])
        indefinite += sum(one.indefinite for one in alone)
        expected = solver.assembly.stress(alone[-1].point)
        np.testing.assert_allclose(P[..., q], expected, atol=1e-9 * np.abs(expected).max())
    assert indefinite > 0


def after(engine, F, steps) -> tuple[np.ndarray, np.ndarray]:
    """Fluctuation of all lanes after so many accepted steps from none, and where the last factor was made."""
    hasty, u = replace(engine, limits=Limits(largest_number_of_iterations=steps)), np.zeros((engine.size + 1, 3, LANES))
    assert (hasty.relax(F, u).steps == steps).all()
    return u, room().array("factored", engine.size, 3).copy()


def test_a_step_is_shortened_until_the_energy_falls(network):
    """From far away full steps raise the energy; the state that is reached is the one that is reached from near."""
    engine, solver = Engine.of(network, LAW), EquilibriumSolver.of(network, LAW)
    F = lanes([np.diag([0.6, 1.0, 0.9])] * 8)
    here, shortened = solver.assembly.evaluate(F[..., 0], np.zeros((engine.size + 1, 3))), 0
    place = np.empty(len(network.node_position), dtype=np.int64)
    place[solver.assembly.nodes] = np.arange(engine.size)
    place = place[engine.nodes]
    for steps in (1, 2, 3):
        factor = solver.assembly.factor(here)
        factor = solver._blended_factor(here) if factor is None else factor
        whole = -solver.assembly.solve(factor, here.residual).reshape(-1, 3)
        whole *= min(1.0, LARGEST_MOVE / np.abs(whole).max())
        u = np.zeros_like(here.displacement)
        u[place] = after(engine, F, steps)[0][: engine.size, :, 0]
        step = (u - here.displacement)[: engine.size]
        fraction = (step * whole).sum() / (whole * whole).sum()
        halvings = round(-np.log2(fraction))
        np.testing.assert_allclose(step, 0.5**halvings * whole, atol=1e-8)
        there = solver.assembly.evaluate(F[..., 0], u)
        assert solver.assembly.energy(there) < solver.assembly.energy(here)
        if halvings:
            u = here.displacement.copy()
            u[: engine.size] += 2.0 * 0.5**halvings * whole
            too_far = solver.assembly.evaluate(F[..., 0], u)
            assert solver.assembly.energy(too_far) > solver.assembly.energy(here)
            shortened += 1
        here = there
    assert shortened > 0
    relaxed = engine.relax(F, np.zeros((engine.size + 1, 3, LANES)))
    assert relaxed.converged.all()
    start = solver.assembly.evaluate(F[..., 0], np.zeros((engine.size + 1, 3)))
    found = solver._newton(start).state
    assert found.converged
    expected = solver.assembly.energy(found.point)
    np.testing.assert_allclose(engine.measures()[0], expected, rtol=1e-10)


def test_the_least_share_of_negative_tension_is_left_out(network):
    """K⁻¹ r with the softened Hessian is the guard's, which tries one share after the other; other lanes differ."""
    engine = Engine.of(network, LAW)
    n, assembly = engine.size, engine.guard.assembly
    ends = [np.diag([1.0 - 0.04 * k, 1.0, 0.95]) for k in range(8)]
    engine._pull(lanes(ends), np.zeros((n + 1, 3, LANES)))
    tried, space = [], engine._space()
    for q, F in enumerate(ends):
        point = assembly.evaluate(F, np.zeros((n + 1, 3)))
        if assembly.factor(point) is not None:
            continue
        expected = np.empty((len(network.node_position), 3))
        assert relaxation.blend(engine.topology, space, 0.0, q)
        expected[assembly.nodes] = assembly.solve(engine.guard._blended_factor(point), point.residual).reshape(n, 3)
        expected = expected[engine.nodes]
        np.testing.assert_allclose(space.right[:, :, 0, q], expected, atol=1e-8 * np.abs(expected).max())
        tried.append(q)
    assert len(tried) >= 3


@pytest.mark.parametrize("stretch", [1.02, 1.1, 1.3])
def test_a_factor_is_used_again_where_the_last_step_was_sharp_and_nowhere_else(network, stretch):
    """The same in all lanes: a factor is made for the first step, and where another of its kind will not do."""
    engine = Engine.of(network, LAW)
    F = lanes([np.diag([stretch, 1.0, 0.97])] * 8)
    u = np.zeros((engine.size + 1, 3, LANES))
    relaxed = engine.relax(F, u)
    whole = u, room().array("factored", engine.size, 3).copy()
    assert relaxed.converged.all()
    steps = int(relaxed.steps[0])
    # A way that is stopped after k steps has made its factors at some of the states before the kth.
    ways = [*(after(engine, F, k) for k in range(1, steps)), whole]
    states, made, before = [np.zeros_like(u), *(state for state, _ in ways)], [], np.inf
    for state in states:
        norm, bound = (values[0] for values in engine._pull(F, state))
        bound *= engine.limits.residual_tolerance
        sharp = 0.0 < norm / before <= SHARP
        enough = norm <= bound or norm * (norm / before) ** REUSED <= bound
        made.append(not (sharp and enough))
        before = norm
    for k, (_, factored) in enumerate(ways, start=1):
        # The state that is accepted may have a factor, too.
        last = max(j for j in range(k + (k == steps)) if made[j])
        np.testing.assert_array_equal(factored, states[last][: engine.size])
    assert not all(made)


def test_predictions_miss_by_a_term_of_fourth_order(tight_engine):
    """The cubic through two states and their rates, where F is linear in the step: half the step, 1/16 of the miss."""
    engine, errors = tight_engine, []

    def with_new_factor(state):
        """The rates are those of the state, not of the iterate before."""
        engine._factorize(engine._forces()[1], 0.0)
        return state

    for step in (0.04, 0.02):
        path = Load.parse("xy_shear").deformation_gradient(0.2 + step * np.array([-1.0, 0.0, 1.0]))
        first, second, third = (lanes([F] * 8) for F in path)
        before = with_new_factor(engine.advance(engine.rest(), first))
        rate = engine._along(second - first)[0]
        here = with_new_factor(engine.advance(before, second))
        here.rate_before[: engine.size] = rate
        start = engine._predicted(here, third)[1]
        errors.append(np.linalg.norm(start - engine.advance(here, third).displacement))
    assert 10.0 < errors[0] / errors[1] < 25.0


def two_steps(engine, path):
    """The state at the second of two F, the same in all lanes, with its forces and factor in the room."""
    return engine.advance(engine.advance(engine.rest(), lanes([path[0]] * 8)), lanes([path[1]] * 8))


def test_lanes_start_from_the_prediction_that_leaves_the_smaller_residual(engine):
    path = Load.parse("xy_shear").deformation_gradient(np.array([0.1, 0.15, 0.2]))
    F, starts = lanes([path[2]] * 8), []
    for change in ({}, {"curved": np.zeros(LANES, dtype=bool)}, {"rate_before": None}):
        here = two_steps(engine, path[:2])
        if "rate_before" in change:
            change = {"rate_before": here.rate_before + 0.01}
        starts.append(engine._predicted(here._replace(**change), F)[1])
    cubic, tangent, spoiled = starts
    np.testing.assert_array_equal(spoiled, tangent)
    assert (engine._pull(F, cubic)[0] < 0.5 * engine._pull(F, tangent)[0]).all()


def test_no_prediction_carries_a_node_farther_than_allowed(engine):
    far, near = (lanes([np.diag([1.0 + by, 1.0, 1.0])] * 8) for by in (40.0, 1e-3))
    moves = [engine._predicted(engine.rest(), F)[1] for F in (far, near)]
    assert np.abs(moves[0]).max() == pytest.approx(LARGEST_MOVE)
    largest = np.abs(moves[1]).max()
    np.testing.assert_allclose(moves[0] / LARGEST_MOVE, moves[1] / largest, atol=1e-9)


def test_what_is_stuck_on_the_quick_way_starts_again_from_the_tangent(network, monkeypatch):
    """From a hopeless prediction near an equilibrium: what is tried next misses by a part of the way."""
    engine = Engine.of(network, LAW)
    here = two_steps(engine, Load.parse("x_uniaxial").deformation_gradient(np.array([1.1, 1.2])))
    F = here.gradient + 1e-3 * np.diag([1.0, -0.5, 0.3])[..., None]
    exact = engine.advance(here, F).displacement
    starts, relax = [], Engine.relax

    def relaxed(self, at, u, *options):
        if at is F:
            starts.append(u.copy())
        return relax(self, at, u, *options)

    monkeypatch.setattr(Engine, "relax", relaxed)
    u = here.displacement.copy()
    u[0] += 0.2
    found = engine.reach(F, u, here.gradient, here.displacement, quick=True)
    assert found.converged.all()
    assert not found.direct.any()
    hopeless, again = starts
    way = np.abs(exact - here.displacement).max()
    assert np.abs(hopeless - exact).max() > 10.0 * way
    assert np.abs(again - exact).max() < 0.02 * way
    np.testing.assert_allclose(u, exact, atol=1e-9)


def test_the_guard_cuts_a_way_that_is_too_long_and_ends_where_others_do(network):
    hasty, generous = Engine.of(network, LAW, Limits(largest_number_of_iterations=3)), Engine.of(network, LAW)
    path = Load.parse("x_uniaxial").deformation_gradient(np.array([1.3, 1.6]))
    cut, whole = two_steps(hasty, path), two_steps(generous, path)
    assert cut.converged.all()
    assert (cut.cuts > 0).all()
    assert not cut.curved.any()
    assert (cut.iterations > whole.iterations).all()
    np.testing.assert_allclose(cut.displacement, whole.displacement, atol=1e-8)


def test_an_unstable_balance_is_left_to_the_guard_which_leaves_it():
    engine = Engine.of(column(), LAW)
    F = lanes([np.diag([0.4, 1.0, 1.0])])
    u = np.zeros((2, 3, LANES))
    assert engine.relax(F, u).status[0] == STUCK
    state = engine.advance(engine.rest(), F)
    assert state.converged.all()
    assert not state.curved[0]
    assert np.abs(state.displacement[0, :, 0]).max() > 0.01
    straight = column().fiber_lengths @ LAW.energy(np.array([0.4, 0.4, 1.0, 1.0]))
    assert engine.measures()[0][0] < straight


def test_a_mechanism_is_refused():
    with pytest.raises(NetworkError, match="mechanism at rest"):
        follow(Engine.of(column(stays=0), LAW), np.eye(3)[None, None], 1.0)


@pytest.mark.parametrize("seed", range(4))
def test_a_mechanism_is_refused_where_rounding_makes_it_stiff(seed):
    """Turned, the column's other pivots are rounding, of either sign."""
    chain = column(stays=0)
    turned = Geometry(
        chain.node_position @ Rotation.random(rng=seed).as_matrix(), chain.node_is_boundary, chain.fiber_nodes
    )
    with pytest.raises(NetworkError, match="mechanism at rest"):
        Engine.of(turned, LAW).rest()


def test_a_state_goes_on_with_the_same_bits_whatever_was_done_in_between(network):
    engine, other = Engine.of(network, LAW), Engine.of(small_network(3), LAW)
    path = [lanes(Load.parse("xy_shear").deformation_gradient(np.linspace(0, g, 8))) for g in (0.1, 0.2, 0.3)]
    first = engine.advance(engine.advance(engine.rest(), path[0]), path[1])
    second = engine.advance(first, path[2])
    other.advance(other.rest(), path[2])
    again = engine.advance(first, path[2])
    for one, more in zip(second, again, strict=True):
        np.testing.assert_array_equal(one, more)


def test_a_lane_that_is_lost_stays_at_its_last_equilibrium(network):
    hasty = Engine.of(network, LAW, Limits(largest_number_of_iterations=2, largest_number_of_cuts=0))
    small, large = np.diag([1.001, 1.0, 1.0]), np.diag([2.0, 0.8, 0.8])
    state = hasty.advance(hasty.rest(), lanes([small, large]))
    assert state.converged.tolist() == [True, False] + [True] * 6
    np.testing.assert_array_equal(state.gradient[..., 1], np.eye(3))
    np.testing.assert_array_equal(state.displacement[..., 1], 0.0)
    later = hasty.advance(state, lanes([small, np.eye(3)]))
    assert not later.converged[1]
    assert later.iterations[1] == 0


# Compiled loops that no equilibrium shows to be wrong, as it is reached in the end.


def test_the_energy_of_a_lane_is_that_of_all_lanes(network, rng):
    count = len(network.fiber_nodes)
    law = exponential(
        rng.uniform(1.0, 4.0, count), section=rng.uniform(0.5, 2.0, count), rest_length=rng.uniform(0.9, 1.1, count)
    )
    engine = Engine.of(network, law)
    u = np.zeros((engine.size + 1, 3, LANES))
    u[: engine.size] = 0.01 * rng.normal(size=(engine.size, 3, LANES))
    F = lanes(np.eye(3) + 0.1 * rng.normal(size=(8, 3, 3)))
    engine._pull(F, u)
    energies = [kernels.stored_energy(engine.topology, engine.fibers, F, u, q) for q in range(LANES)]
    np.testing.assert_allclose(energies, engine.measures()[0], rtol=1e-12)


def test_a_step_goes_against_the_residual_no_farther_than_allowed_in_lanes_that_are_ready(rng):
    residual, u, start, move = (rng.normal(size=(5, 3, LANES)) for _ in range(4))
    right, slope, farthest = 0.02 * rng.normal(size=(5, 3, 1, LANES)), rng.normal(size=(1, LANES)), np.empty((1, LANES))
    right[..., 4:] *= 1000.0
    ready = np.array([[1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0]])
    before = [array.copy() for array in (u, start, move, slope)]
    kernels.begin_step(residual, right, ready, 0.3, u, start, move, slope, farthest)
    whole = -right[:, :, 0]
    np.testing.assert_array_equal(farthest[0], np.abs(whole).max(axis=(0, 1)))
    expected = np.where(np.arange(LANES) < 4, whole, 0.3 * whole / np.abs(whole).max(axis=(0, 1)))
    slopes = (expected * residual).sum(axis=(0, 1))[None]
    for found, kept, wanted in zip(
        (u, start, move, slope), before, (before[0] + expected, before[0], expected, slopes), strict=True
    ):
        np.testing.assert_allclose(found[..., ::2], wanted[..., ::2], rtol=1e-12, atol=1e-14)
        np.testing.assert_array_equal(found[..., 1::2], kept[..., 1::2])


def test_products_of_fields_are_those_of_the_first_nodes(rng):
    one, other = rng.normal(size=(2, 5, 3, LANES))
    total = np.empty((1, LANES))
    kernels.dot(4, one, other, total)
    np.testing.assert_allclose(total[0], (one[:4] * other[:4]).sum(axis=(0, 1)), rtol=1e-12)


def test_a_cubic_path_is_predicted_exactly(rng):
    """u of third order in the way of F: two states with their rates give the third, along the way and not beyond."""
    n = 4
    coefficients, slopes = rng.normal(size=(2, 3, n, 3, LANES)), rng.normal(size=(n, 3, 9, LANES))
    start, step = rng.normal(size=(2, 3, 3, LANES))
    # A rate that does not enter along the way is another one at each state.
    square = (step * step).sum(axis=(0, 1))

    def state(t):
        F, u, G = start + t * step, np.zeros((n + 1, 3, LANES)), np.zeros((n + 1, 3, 9, LANES), dtype=np.float32)
        constant, *higher = coefficients[0]
        u[:n] = constant + t * coefficients[1, 0] + t**2 * higher[0] + t**3 * higher[1]
        along = coefficients[1, 0] + 2.0 * t * higher[0] + 3.0 * t**2 * higher[1]
        across = slopes * (1.0 + t)
        across -= (
            np.einsum("aipq,pq->aiq", across, step.reshape(9, LANES))[:, :, None] * step.reshape(9, LANES) / square
        )
        G[:n] = across + along[:, :, None] * step.reshape(9, LANES) / square
        return np.ascontiguousarray(F), u, G

    before, here = state(0.0), state(0.5)
    bend = np.zeros((2, n + 1, 3, LANES), dtype=np.float32)
    kernels.find_bend(n, *here, *before, bend)
    increment = here[0] - before[0]
    for t, bent in ((0.0, True), (0.25, True), (1.3, True), (3.0, False), (-2.0, False)):
        F, expected, _ = state(t)
        u = np.zeros((n + 1, 3, LANES))
        kernels.predict(n, F, *here, u)
        straight = here[1].copy()
        rate = np.einsum("aipq,pq->aiq", here[2].astype(float), (F - here[0]).reshape(9, LANES))
        np.testing.assert_allclose(u, straight + rate, atol=1e-12)
        kernels.add_bend(n, F, here[0], increment, bend, u)
        np.testing.assert_allclose(u, expected if bent else straight + rate, atol=2e-5)


def test_rooms_grow_and_are_not_shared_between_names():
    space = Room()
    one, two = space.array("a", 3, 2), space.array("b", 3, 2)
    one[...], two[...] = 1.0, 2.0
    assert (one == 1.0).all()
    assert space.array("a", 3, 1).shape == (3, 1, LANES)
    assert space.array("a", 5, 4).shape == (5, 4, LANES)


# Fibre laws.


def test_numbers_per_fiber_are_those_of_each_fiber(network, rng):
    """Sections, rest lengths and constants of each fibre: the guard, whose forces are summed in another order."""
    count = len(network.fiber_nodes)
    law = exponential(
        rng.uniform(1.0, 4.0, count),
        linear_beyond_stretch=rng.uniform(1.02, 1.3, count),
        section=rng.uniform(0.5, 2.0, count),
        rest_length=rng.uniform(0.99, 1.01, count),
    )
    path = Load.parse("x_uniaxial").deformation_gradient(np.linspace(1.0, 1.3, 5))
    response, alone = (
        follow(Engine.of(network, law), path[None], 1.0),
        respond(EquilibriumSolver.of(network, law), path, 1.0),
    )
    assert response.converged.all()
    for name in ("strain_energy_density", "first_piola_kirchhoff_stress"):
        expected = getattr(alone, name)
        np.testing.assert_allclose(getattr(response, name)[0], expected, atol=1e-9 * np.abs(expected).max())
    assert np.abs(response.first_piola_kirchhoff_stress[0, 0]).max() > 0.0
    same = exponential(np.full(count, 2.5), section=np.ones(count))
    expected = follow(Engine.of(network, LAW), path[None], 1.0)
    np.testing.assert_allclose(
        follow(Engine.of(network, same), path[None], 1.0).cauchy_stress, expected.cauchy_stress, rtol=0, atol=1e-12
    )


def test_twice_the_section_is_twice_the_stress(network):
    path = Load.parse("xy_shear").deformation_gradient(np.linspace(0.0, 0.4, 3))[None]
    one, twice = (follow(Engine.of(network, replace(LAW, section=by)), path, 1.0) for by in (1.0, 2.0))
    np.testing.assert_allclose(twice.cauchy_stress, 2.0 * one.cauchy_stress, rtol=1e-8, atol=1e-10)


def test_a_taut_fiber_pulls_at_rest_and_a_slack_one_pushes():
    """Three pairs of fibres about a node: P at rest is the sum of the fibres' forces, in closed form."""
    ends = np.concatenate([sign * 0.5 * np.eye(3) for sign in (-1.0, 1.0)])
    network = Geometry(
        np.vstack([np.zeros(3), ends]), np.array([False] + [True] * 6), np.array([[0, k] for k in range(1, 7)])
    )
    for rest_length in (0.9, 1.05):
        law = buckling(0.3, rest_length=rest_length)
        stretch = 1.0 / rest_length
        force = (stretch - 1.0) * (1.0 if stretch > 1.0 else 0.3)
        response = follow(Engine.of(network, law), np.eye(3)[None, None], 1.0)
        np.testing.assert_allclose(response.first_piola_kirchhoff_stress[0, 0], force * np.eye(3), atol=1e-14)
        weight = 3.0 * rest_length * (1.0 if stretch > 1.0 else 0.3)
        assert response.strain_energy_density[0, 0] == pytest.approx(0.5 * weight * (stretch - 1.0) ** 2, rel=1e-12)


def test_numbers_for_another_network_are_refused(network):
    with pytest.raises(ConfigError, match="has 3 numbers where the network has"):
        Engine.of(network, exponential(np.full(3, 2.5)))
    with pytest.raises(ConfigError, match=r"fiber\.section of fiber 1 is -1\.0"):
        exponential(2.5, section=np.array([1.0, -1.0]))


def test_a_fiber_at_rest_counts_as_stretched(network):
    """Whatever rounding makes of its length: the tangent at rest is the guard's, which is that of tension."""
    law = buckling(0.1)
    tangent = follow(Engine.of(network, law), np.eye(3)[None, None], 1.0, tangent=True).tangent[0, 0]
    solver = EquilibriumSolver.of(network, law)
    expected = solver.condensed_tangent(solver.follow([np.eye(3)])[0])
    np.testing.assert_allclose(tangent, expected, atol=1e-6 * np.abs(expected).max())
    linear = solver.of(network, buckling(1.0))
    np.testing.assert_allclose(
        tangent, linear.condensed_tangent(linear.follow([np.eye(3)])[0]), atol=1e-6 * np.abs(expected).max()
    )


def symmetric_chain(section: float) -> tuple[Geometry, Fiber]:
    """A chain on x of two free nodes, each held by four slight stays alike, so that no step ever leaves the axis."""
    inner = np.array([[-0.3, 0.0, 0.0], [0.1, 0.0, 0.0]])
    ends = np.array([[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]])
    stays = np.array([[x, *yz] for x in (-0.3, 0.1) for yz in ((0.5, 0.0), (-0.5, 0.0), (0.0, 0.5), (0.0, -0.5))])
    fibers = [[2, 0], [0, 1], [1, 3], *([0, k] for k in range(4, 8)), *([1, k] for k in range(8, 12))]
    network = Geometry(np.vstack([inner, ends, stays]), np.array([False] * 2 + [True] * 10), np.array(fibers))
    return network, exponential(20.0, section=np.array([1.0, 2.0, 1.0, *[section] * 8]))


def test_no_state_is_accepted_whose_hessian_is_indefinite():
    """Near the load at which the chain buckles Newton's steps stay on the axis, and shrink the residual even so."""
    network, law = symmetric_chain(0.1)
    engine, found = Engine.of(network, law), 0
    for stretch in [*np.linspace(0.90, 0.96, 121), 0.9327150003860285]:
        F = lanes([np.diag([stretch, 1.0, 1.0])])
        state = engine.advance(engine.rest(), F)
        if state.converged[0]:
            engine._pull(F, state.displacement)
            assert engine._factorize(engine._forces()[1], 0.0)[0], stretch
            found += 1
    assert found > 60


@pytest.mark.parametrize("F", [np.diag([-1.0, 1.0, 1.0]), np.zeros((3, 3)), np.full((3, 3), np.nan)])
def test_an_impossible_gradient_is_flagged_and_stops_no_other_path(network, F):
    good = np.diag([1.1, 1.0, 0.95])
    response = follow(Engine.of(network, LAW), np.array([[F, good], [good, good]]), 1.0)
    np.testing.assert_array_equal(response.converged, [[False, False], [True, True]])
    assert np.isnan(response.cauchy_stress[0]).all()
    assert np.isfinite(response.cauchy_stress[1]).all()


def test_no_paths_have_no_answers(network):
    assert follow(Engine.of(network, LAW), np.empty((0, 3, 3, 3)), 1.0).converged.shape == (0, 3)


def test_what_finds_no_equilibrium_at_rest_is_no_mechanism(network):
    hasty = Engine.of(network, exponential(2.5, rest_length=1.1), Limits(largest_number_of_iterations=2))
    with pytest.raises(NetworkError, match="finds no equilibrium at rest"):
        hasty.rest()
