"""The network as a material: against networks alone, derivatives, stability, failures, bits, and in finite elements."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import small_network
from fibers import buckling, exponential, stress_scale
from reference import respond
from scipy.spatial.transform import Rotation
from tissues import distorted_box, stretched_box, surface

from fibrous.errors import ConvergenceError, NetworkError
from fibrous.fe import assembly as fe_assembly
from fibrous.fe.boundary import PrescribedDisplacement
from fibrous.fe.mesh import box
from fibrous.fe.solver import LoadStepError, LoadStepper
from fibrous.materials.contract import MaterialError, Mixture, join, select
from fibrous.materials.neo_hookean import NeoHookean
from fibrous.materials.network import FiberNetworks
from fibrous.networks.banded import Assembly
from fibrous.networks.engine import Engine
from fibrous.networks.guard import EquilibriumSolver
from fibrous.networks.network import Network
from fibrous.specimen import Slab

LAW, SCALE, STEPS = exponential(2.5), stress_scale(10.0, 0.1, 10.0), 10
SIZE = {"fiber": LAW, "edge_um": 10.0}
NETWORKS = [small_network(seed) for seed in range(3)]


def random_ends() -> np.ndarray:
    """F of three elements, (3, 8, 3, 3), some of them so far from rest that Hessians lose definiteness on the way.

    None shortens a line to less than 0.4: crushed further, networks have equilibria so near to each other that which of
    them a path comes to hangs on rounding.
    """
    rng = np.random.default_rng(3)
    axes = Rotation.random(8, rng=rng).as_matrix()
    stretches = np.stack([rng.uniform(0.4, 0.75, 8), rng.uniform(0.8, 1.2, 8), rng.uniform(1.0, 1.4, 8)], axis=1)
    return np.broadcast_to((axes * stretches[:, None]) @ axes.swapaxes(1, 2), (len(NETWORKS), 8, 3, 3))


ENDS = random_ends()
PATH = np.stack([np.eye(3) + step / STEPS * (ENDS - np.eye(3)) for step in range(STEPS + 1)])


def material(**options) -> FiberNetworks:
    return FiberNetworks.of(NETWORKS, **options)


def followed(law, path=PATH):
    """States at the gradients of a path, rest left out."""
    states, state = [], None
    for F in path[1:]:
        P, A, state = law(F, state)
        states.append((P, A, state))
    return states


@pytest.fixture(scope="module")
def states():
    return followed(material())


def same_bits(one, other) -> bool:
    return all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


def test_every_point_answers_as_its_network_alone(states):
    for e, q in np.ndindex(3, 8):
        response = respond(EquilibriumSolver.of(NETWORKS[e], LAW), PATH[:, e, q], SCALE)
        assert response.converged.all()
        for expected, (P, _, state) in zip(response.first_piola_kirchhoff_stress[1:], states, strict=True):
            np.testing.assert_allclose(P[e, q], expected, atol=1e-10 * np.abs(expected).max())
            assert state.residual[e, q] <= 1e-11


def test_indefinite_hessians_are_met_and_no_state_that_is_returned_has_one(states):
    state = states[-1][2]
    assert (state.indefinite > 0).sum() >= 5
    assert (state.indefinite.max(axis=1) > 0).all()
    for e, q in np.ndindex(3, 8):
        assembly = Assembly(NETWORKS[e], LAW)
        for _, _, one in states[::3]:
            u = material().node_position(one, e, q) - NETWORKS[e].node_position @ one.gradient[e, ..., q].T
            point = assembly.evaluate(
                np.ascontiguousarray(one.gradient[e, ..., q]), np.vstack([u[assembly.nodes], np.zeros(3)])
            )
            assert assembly.factor(point) is not None
            assert np.linalg.norm(point.residual) <= 1.01e-11 * np.sqrt(assembly.size) * point.force_scale


def test_tangent_is_the_derivative_of_stress(states):
    law, step, state = material(), 1e-6, states[-1][2]
    _, A, here = law(ENDS, state)
    differences = np.empty_like(A)
    for k, L in np.ndindex(3, 3):
        change = np.zeros((3, 3))
        change[k, L] = step
        up, down = (law(ENDS + sign * change, here)[0] for sign in (1.0, -1.0))
        differences[..., k, L] = (up - down) / (2.0 * step)
    assert (state.indefinite > 0).sum() >= 5  # indefinite Hessians were met on the way to some of these
    scale = np.abs(A).max(axis=(2, 3, 4, 5), keepdims=True)
    np.testing.assert_array_less(np.abs(A - differences) / scale, 3e-7)
    np.testing.assert_allclose(A, A.transpose(0, 1, 4, 5, 2, 3), atol=1e-12 * scale.max())


def test_tangent_is_that_of_the_network_alone(states):
    F = PATH[3]
    A = material()(F, states[2][2])[1]
    for e, q in np.ndindex(3, 8):
        solver = EquilibriumSolver.of(NETWORKS[e], LAW)
        expected = SCALE * solver.condensed_tangent(solver.follow(PATH[:4, e, q])[-1])
        # The rates are those of the last factor, and their error enters squared.
        np.testing.assert_allclose(A[e, q], expected, atol=2e-7 * np.abs(expected).max())


def test_an_error_of_rates_from_nearby_enters_the_tangent_squared():
    law, here = material(), np.broadcast_to(np.diag([1.2, 1.0, 0.95]), (3, 1, 3, 3))
    near = law(here)[2]
    errors = []
    for size in (0.02, 0.01):
        F = here + size * np.array([[0.5, 0.2, 0.0], [1.0, -0.2, 0.1], [0.0, 0.3, -0.4]])
        kept, found = law(F, near, near)[1], law(F, near)[1]
        errors.append(np.abs(kept - found).max(axis=(1, 2, 3, 4, 5)))
    ratios = errors[0] / errors[1]
    assert ((ratios > 3.5) & (ratios < 4.5)).all(), ratios


def test_trials_keep_the_rates_of_nearby_unless_their_way_is_not_the_quick_one(states, monkeypatch):
    """Long ways, of which some are not gone quickly: there the rates are those of the state that is reached."""
    law, before = material(), states[2][2]
    near = law(PATH[4], before)[2]
    close = law(PATH[4] + 1e-4, before, near)[2]
    assert same_bits([close.rate], [near.rate])
    kept = near.rate.copy()
    direct, reach = [], Engine.reach

    def reached(self, *arguments, **options):
        found = reach(self, *arguments, **options)
        direct.append(found.direct)
        return found

    with monkeypatch.context() as patch:
        patch.setattr(Engine, "reach", reached)
        _, A, far = law(PATH[8], before, near)
    np.testing.assert_array_equal(near.rate, kept)
    same = (far.rate == near.rate).all(axis=(1, 2, 3))
    np.testing.assert_array_equal(same, direct)
    assert 0 < same.sum() < same.size
    rates = np.zeros_like(far.rate)
    for e, engine in enumerate(law.engines):
        engine.relax(far.gradient[e], far.displacement[e].copy())
        engine.rates(rates[e], exact=True)
        tangent = SCALE * np.moveaxis(engine.condense(rates[e])[1], -1, 0).reshape(8, 3, 3, 3, 3)
        np.testing.assert_allclose(A[e][~same[e]], tangent[~same[e]], atol=1e-6 * np.abs(tangent).max())
    changed = ~same[:, None, None, None] & np.ones(rates.shape, dtype=bool)
    np.testing.assert_allclose(far.rate[changed], rates[changed], atol=1e-4)


def test_counts_go_on_from_the_state_before(states):
    counts = np.array(
        [[getattr(state, name) for name in ("iterations", "cuts", "indefinite")] for _, _, state in states]
    )
    assert (np.diff(counts, axis=0) >= 0).all()
    assert (np.diff(counts[:, 0], axis=0) > 0).all()


def test_energy_is_the_work_of_the_stress():
    law, direction, step = material(), np.random.default_rng(4).normal(size=(3, 3)), 1e-5
    P = law(PATH[2])[0]
    up, down = (law.energy(PATH[2] + sign * step * direction) for sign in (1.0, -1.0))
    np.testing.assert_allclose((P * direction).sum(axis=(-1, -2)), (up - down) / (2.0 * step), rtol=1e-6, atol=1e-10)


def test_the_bend_makes_predictions_better():
    """Twenty small steps on a smooth path: with the cubic through two states a step needs fewer iterations."""
    load = np.eye(3) + np.linspace(0.0, 0.3, 21)[:, None, None] * np.diag([1.0, -0.4, -0.4])
    path = np.broadcast_to(load[:, None, None], (21, 3, 1, 3, 3))
    state = None
    for F in path[1:]:
        if state is not None:
            state = state._replace(bend=np.zeros_like(state.bend))
        state = material()(F, state)[2]
    straight = state.iterations.mean()
    bent = followed(material(), path)[-1][2].iterations.mean()
    assert bent < 0.85 * straight
    assert bent / 20 <= 3.0


@pytest.mark.parametrize("points", [1, 3])
def test_fewer_points_than_lanes(points, states):
    few = followed(material(), PATH[:, :, :points])
    for (P, A, state), (all_P, all_A, _) in zip(few, states, strict=True):
        assert P.shape == (3, points, 3, 3)
        assert state.residual.shape == (3, 8)
        np.testing.assert_allclose(P, all_P[:, :points], atol=1e-10 * np.abs(all_P[:, :points]).max())
        np.testing.assert_allclose(A, all_A[:, :points], atol=1e-6 * np.abs(all_A[:, :points]).max())


def test_networks_without_interior_nodes_are_affine():
    rng = np.random.default_rng(1)
    faces = rng.uniform(-0.5, 0.5, size=(12, 3))
    faces[np.arange(12), np.arange(12) % 3] = np.where(np.arange(12) % 2, 0.5, -0.5)
    network = Network(faces, np.ones(12, dtype=bool), np.array([[k, (k + 5) % 12] for k in range(12)]), **SIZE)
    law = FiberNetworks.of([network, NETWORKS[0]])
    P, A, state = law(PATH[2, :2])
    D, L = network.fiber_vectors, network.fiber_lengths
    for q in range(8):
        d = D @ PATH[2, 0, q].T
        force, _ = LAW.response(np.linalg.norm(d, axis=1) / L)
        expected = SCALE * ((force / np.linalg.norm(d, axis=1))[:, None] * d).T @ D
        np.testing.assert_allclose(P[0, q], expected, atol=1e-14)
    assert (state.iterations[0] == 0).all()
    step = 1e-6
    difference = (law(PATH[2, :2] + step * np.eye(3))[0] - law(PATH[2, :2] - step * np.eye(3))[0])[0] / (2.0 * step)
    np.testing.assert_allclose(np.einsum("qiJkk->qiJ", A[0]), difference, atol=1e-8)


def test_bits_depend_on_neither_threads_nor_blocks(states):
    threaded = followed(material(threads=3))
    law, parts = material(), (slice(0, 1), slice(1, 3))
    state = None
    for (P, A, one), (other_P, other_A, other), F in zip(states, threaded, PATH[1:], strict=True):
        assert np.array_equal(P, other_P)
        assert np.array_equal(A, other_A)
        assert same_bits(one, other)
        found = [law.of_elements(part)(F[part], select(state, part)) for part in parts]
        assert np.array_equal(P, np.concatenate([block[0] for block in found]))
        assert np.array_equal(A, np.concatenate([block[1] for block in found]))
        state = join([block[2] for block in found])
        assert same_bits(one, state)


def test_states_are_left_as_they_were_and_trials_leave_no_trace():
    law = material()
    _, _, here = followed(law, PATH[:4])[-1]
    copy = [part.copy() for part in here]
    near = law(PATH[5], here)[2]
    near_copy = [part.copy() for part in near]
    first = law(PATH[4], here, near)
    assert same_bits(here, copy)
    assert same_bits(near, near_copy)
    law(PATH[7], here, first[2])
    again = law(PATH[4], here, law(PATH[5], here)[2])
    assert np.array_equal(first[0], again[0])
    assert same_bits(first[2], again[2])


def test_a_network_that_finds_no_equilibrium_names_element_and_point():
    law = material().of_elements(slice(1, 3))
    F = PATH[1, 1:].copy()
    F[1, 5] = 60.0 * np.eye(3)
    with pytest.raises(ConvergenceError, match=r"^element 2, Gauss point 5: its network finds no stable equilibrium"):
        law(F)


def test_where_f_is_inverted_there_is_no_stress_and_elsewhere_there_is():
    F = PATH[1].copy()
    F[1, 5], F[2, 0] = np.diag([-1.0, 1.0, 1.0]), np.nan
    P, A, _ = material()(F)
    whole_P, whole_A, _ = material()(PATH[1])
    bad = np.zeros((3, 8), dtype=bool)
    bad[1, 5] = bad[2, 0] = True
    assert np.isnan(P[bad]).all()
    assert np.isnan(A[bad]).all()
    np.testing.assert_allclose(P[~bad], whole_P[~bad], atol=1e-10 * np.abs(whole_P).max())
    np.testing.assert_allclose(A[~bad], whole_A[~bad], atol=1e-6 * np.abs(whole_A).max())


def test_at_the_same_gradients_the_answer_has_the_same_bits(states):
    """So that a run can go on from a state that was kept, whatever led to it."""
    for P, A, state in states:
        again_P, again_A, again = material()(np.moveaxis(state.gradient, -1, 1), state)
        assert np.array_equal(P, again_P)
        assert np.array_equal(A, again_A)
        assert same_bits(state, again)


def test_a_mechanism_is_refused_with_the_number_of_its_element():
    position = np.array([[-0.5, 0.0, 0.0], [0.0, 0.0, 0.0], [0.5, 0.0, 0.0]])
    chain = Network(position, np.array([True, False, True]), np.array([[0, 1], [1, 2]]), **SIZE)
    with pytest.raises(NetworkError, match="element 1: the network is a mechanism at rest"):
        FiberNetworks.of([NETWORKS[0], chain])(PATH[1, :2])


def test_a_column_that_buckles_does_not_stay_straight():
    """Pushed along its axis it is in balance with its slack stays, and the way of the predictions is straight."""
    position = np.array([[-0.5, 0.0, 0.0], [0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.5]])
    boundary = np.array([True, False, True, True, True])
    column = Network(position, boundary, np.array([[0, 1], [1, 2], [1, 3], [1, 4]]), **SIZE)
    law = FiberNetworks.of([column])
    shares = np.linspace(1.0, 0.4, 7)[:, None, None, None, None]
    state = followed(law, np.eye(3) + (shares - 1.0) * np.diag([1.0, 0.0, 0.0]))[-1][2]
    assert (state.indefinite > 0).all()
    assert np.abs(state.displacement).max() > 0.01
    alone = EquilibriumSolver.of(column, LAW)
    energy = alone.assembly.energy(alone.assembly.evaluate(np.diag([0.4, 1.0, 1.0]), np.zeros((2, 3))))
    assert law.energy(np.diag([0.4, 1.0, 1.0])[None, None])[0, 0] < SCALE * energy


def test_what_is_wrong_is_refused():
    with pytest.raises(MaterialError, match="threads is 0"):
        material(threads=0)
    for shape in ((2, 8), (3, 9), (3, 0), (8,)):
        with pytest.raises(MaterialError, match="3 networks, one per element"):
            material()(np.broadcast_to(np.eye(3), (*shape, 3, 3)))


def test_stress_scales_with_the_modulus_and_iterations_do_not():
    one, other = (
        followed(
            FiberNetworks.of([replace(network, fiber=exponential(modulus_MPa=modulus)) for network in NETWORKS]),
            PATH[:3],
        )
        for modulus in (10.0, 1e7)
    )
    for (P, A, state), (more_P, more_A, more) in zip(one, other, strict=True):
        np.testing.assert_allclose(more_P, 1e6 * P, rtol=1e-14)
        np.testing.assert_allclose(more_A, 1e6 * A, rtol=1e-14)
        np.testing.assert_array_equal(more.iterations, state.iterations)


# In finite elements.


def tissue_of(networks, threads=1):
    return Mixture((NeoHookean(0.025, 0.417), FiberNetworks.of(networks, threads)))


def test_one_deformation_gradient_everywhere_is_the_network_alone():
    mesh, nodes = distorted_box(2), surface(distorted_box(2))
    F = np.array([[1.2, 0.1, 0.0], [0.05, 0.9, -0.1], [0.0, 0.15, 1.05]])
    shares = np.linspace(0.25, 1.0, 4)[:, None, None]
    exact = mesh.node_position @ (F - np.eye(3)).T
    prescribed = PrescribedDisplacement.at(nodes, shares * exact[nodes], steps=4)
    fibers = FiberNetworks.of([NETWORKS[0]] * 8)
    stepper = LoadStepper.of(mesh, fibers, prescribed, tolerance=1e-13)
    solution = stepper.follow(prescribed.values)
    np.testing.assert_allclose(solution.displacement[-1], exact, atol=1e-11)
    response = respond(EquilibriumSolver.of(NETWORKS[0], LAW), np.eye(3) + shares * (F - np.eye(3)), SCALE)
    expected = response.first_piola_kirchhoff_stress[-1]
    gradient = stepper.assembly.deformation_gradient(solution.displacement[-1])
    P = fibers(gradient, solution.state)[0]
    np.testing.assert_allclose(P, np.broadcast_to(expected, P.shape), atol=1e-10 * np.abs(expected).max())
    # The force on the boundary times position is the volume times the stress.
    work = solution.internal_force[-1].T @ mesh.node_position
    np.testing.assert_allclose(work, expected, atol=1e-10 * np.abs(expected).max())


@pytest.fixture(scope="module")
def specimen():
    """A small synthetic specimen with a network of its own in every element, and its equilibria in ten load steps."""
    specimen = Slab((3, 4, 1)).specimen(10)
    networks = [small_network(k, np.linalg.eigvalsh(H)[::-1], 8.0) for k, H in enumerate(specimen.structure_tensor)]
    stepper = LoadStepper.of(specimen.mesh, tissue_of(networks), specimen.prescribed)
    return specimen, networks, stepper.follow(specimen.prescribed.values)


def test_newtons_method_is_quadratic_and_networks_need_few_iterations(specimen):
    _, _, solution = specimen
    assert solution.converged.all()
    assert (solution.newton_iterations <= 4).all()
    assert solution.cuts.sum() == 0
    for attempt in solution.attempts:
        before, after = np.array(attempt.residuals[:-1]), np.array(attempt.residuals[1:])
        assert (after <= np.maximum(10.0 * before**2, 1e-9)).all(), attempt.residuals
    networks = solution.state[1]
    assert networks.iterations.mean() / 10 <= 5.0
    assert networks.residual.max() <= 1e-11


def test_one_load_step_ends_where_ten_do(specimen):
    specimen, networks, many = specimen
    law = tissue_of(networks)
    stepper = LoadStepper.of(specimen.mesh, law, specimen.prescribed, tolerance=1e-12)
    one = stepper.follow(specimen.prescribed.values[-1:])
    np.testing.assert_allclose(one.displacement[-1], many.displacement[-1], atol=1e-7)
    stresses = [
        law(stepper.assembly.deformation_gradient(solution.displacement[-1]), solution.state)[0]
        for solution in (one, stepper.follow(specimen.prescribed.values))
    ]
    np.testing.assert_allclose(*stresses, atol=1e-8)


def test_bits_of_a_run_depend_on_neither_threads_nor_blocks(specimen, monkeypatch):
    specimen, networks, whole = specimen
    monkeypatch.setattr(fe_assembly, "BLOCK", 5)
    values = specimen.prescribed.values
    stepper = LoadStepper.of(specimen.mesh, tissue_of(networks, threads=2), specimen.prescribed)
    blocks = stepper.follow(values)
    np.testing.assert_array_equal(blocks.displacement, whole.displacement)
    assert same_bits(blocks.state[1], whole.state[1])


def test_a_network_that_fails_in_a_trial_cuts_the_step_and_leaves_the_state(monkeypatch):
    """Trials beyond a stretch are refused: the step is cut, and ends where an unbroken way ends."""
    mesh = box((2, 2, 2))
    networks = [NETWORKS[k % 3] for k in range(8)]
    prescribed = stretched_box(mesh, [0.15, 0.3])
    free = LoadStepper.of(mesh, tissue_of(networks), prescribed).follow(prescribed.values)
    refused = []
    original = FiberNetworks.__call__

    def limited(self, gradient, state=None, near=None):
        if state is not None and np.abs(gradient - np.moveaxis(state.gradient, -1, 1)).max() > 0.1:
            refused.append(gradient)
            raise ConvergenceError("element 0, Gauss point 0: its network finds no stable equilibrium")
        return original(self, gradient, state, near)

    monkeypatch.setattr(FiberNetworks, "__call__", limited)
    stepper = LoadStepper.of(mesh, tissue_of(networks), prescribed)
    solution = stepper.follow(prescribed.values)
    assert refused
    assert solution.cuts.sum() > 0
    np.testing.assert_allclose(solution.displacement, free.displacement, atol=1e-7)
    with pytest.raises(LoadStepError, match="element 0, Gauss point 0: its network finds no stable equilibrium"):
        LoadStepper.of(mesh, tissue_of(networks), prescribed, smallest_increment=0.9).follow(prescribed.values)


def test_another_fiber_law_runs_in_finite_elements():
    """Fibres that buckle: the stress of every Gauss point is that of its network alone."""
    law, mesh = buckling(0.3), box((2, 1, 1))
    prescribed = stretched_box(mesh, [0.06, 0.12])
    fibers = FiberNetworks.of([replace(network, fiber=law) for network in NETWORKS[:2]])
    stepper = LoadStepper.of(mesh, Mixture((NeoHookean(0.025, 0.417), fibers)), prescribed)
    solution = stepper.follow(prescribed.values)
    assert solution.converged.all()
    gradients = stepper.assembly.deformation_gradient(solution.displacement[-1])
    P = fibers(gradients, solution.state[1])[0]
    for e, q in np.ndindex(2, 8):
        path = np.stack([np.eye(3), *solution.deformation_gradient[:, e, q]])
        expected = respond(EquilibriumSolver.of(NETWORKS[e], law), path, SCALE).first_piola_kirchhoff_stress[-1]
        np.testing.assert_allclose(P[e, q], expected, atol=1e-9 * np.abs(expected).max())
