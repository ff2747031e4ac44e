"""The engine against its guard where trouble is, its linear algebra, fibre laws in every kernel, and its bits."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import small_network
from reference import respond

from fibrous.deformation import Load
from fibrous.errors import ConfigError, NetworkError
from fibrous.networks import engine as engine_module
from fibrous.networks.engine import STUCK, Engine, Room, room
from fibrous.networks.fiber_law import BucklingFiber, ExponentialFiber
from fibrous.networks.guard import EquilibriumSolver
from fibrous.networks.lanes import LANES
from fibrous.networks.network import Network
from fibrous.networks.path import follow

LAW = ExponentialFiber(2.5)


def lanes(gradients) -> np.ndarray:
    """F of eight lanes, shape (3, 3, 8), from at most as many; the others at rest."""
    F = np.tile(np.eye(3)[..., None], (1, 1, LANES))
    F[..., : len(gradients)] = np.moveaxis(np.asarray(gradients), 0, -1)
    return F


def column(stays: int = 2) -> Network:
    """A straight column that is pushed along x, held by stays: in balance when straight, and unstable."""
    position = np.array([[-0.5, 0.0, 0.0], [0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.5]])
    fibers = np.array([[0, 1], [1, 2], [1, 3], [1, 4]])[: 2 + stays]
    return Network(position[: 3 + stays], np.array([True, False, True, True, True])[: 3 + stays], fibers)


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
    right = room().array("newton", n, 3, 1)
    right[:, :, 0] = wanted = rng.normal(size=(n, 3, LANES))
    engine_module.solve(engine.topology.starts, engine.topology.rows, engine._factor(), right)
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


def test_a_step_is_shortened_until_the_energy_falls(network, monkeypatch):
    """From far away full steps raise the energy; the state that is reached is the one that is reached from near."""
    refused = []
    original = engine_module._Relaxation._judge

    def judged(self, *masks):
        before = self.fraction.copy()
        original(self, *masks)
        refused.append((self.fraction < before).sum())

    monkeypatch.setattr(engine_module._Relaxation, "_judge", judged)
    engine = Engine.of(network, LAW)
    F = lanes([np.diag([0.6, 1.0, 0.9])] * 8)
    u = np.zeros((engine.size + 1, 3, LANES))
    relaxed = engine.relax(F, u)
    assert sum(refused) > 0
    assert relaxed.converged.all()
    solver = EquilibriumSolver.of(network, LAW)
    start = solver.assembly.evaluate(F[..., 0], np.zeros((engine.size + 1, 3)))
    found = solver._newton(start).state
    assert found.converged
    expected = solver.assembly.energy(found.point)
    np.testing.assert_allclose(engine.measures()[0], expected, rtol=1e-10)


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
    hasty = Engine.of(network, LAW, largest_number_of_iterations=2, largest_number_of_cuts=0)
    small, large = np.diag([1.001, 1.0, 1.0]), np.diag([2.0, 0.8, 0.8])
    state = hasty.advance(hasty.rest(), lanes([small, large]))
    assert state.converged.tolist() == [True, False] + [True] * 6
    np.testing.assert_array_equal(state.gradient[..., 1], np.eye(3))
    np.testing.assert_array_equal(state.displacement[..., 1], 0.0)
    later = hasty.advance(state, lanes([small, np.eye(3)]))
    assert not later.converged[1]
    assert later.iterations[1] == 0


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
    law = ExponentialFiber(
        rng.uniform(1.0, 4.0, count),
        rng.uniform(1.02, 1.3, count),
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
    same = ExponentialFiber(np.full(count, 2.5), section=np.ones(count))
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
    network = Network(
        np.vstack([np.zeros(3), ends]), np.array([False] + [True] * 6), np.array([[0, k] for k in range(1, 7)])
    )
    for rest_length in (0.9, 1.05):
        law = BucklingFiber(0.3, rest_length=rest_length)
        stretch = 1.0 / rest_length
        force = (stretch - 1.0) * (1.0 if stretch > 1.0 else 0.3)
        response = follow(Engine.of(network, law), np.eye(3)[None, None], 1.0)
        np.testing.assert_allclose(response.first_piola_kirchhoff_stress[0, 0], force * np.eye(3), atol=1e-14)
        weight = 3.0 * rest_length * (1.0 if stretch > 1.0 else 0.3)
        assert response.strain_energy_density[0, 0] == pytest.approx(0.5 * weight * (stretch - 1.0) ** 2, rel=1e-12)


def test_numbers_for_another_network_are_refused(network):
    with pytest.raises(ConfigError, match="has 3 numbers where the network has"):
        Engine.of(network, ExponentialFiber(np.full(3, 2.5)))
    with pytest.raises(ConfigError, match=r"fiber\.section of fiber 1 is -1\.0"):
        ExponentialFiber(2.5, section=np.array([1.0, -1.0]))
