"""Equilibrium of meshes: patch test, rotation, rate, code-to-code reactions, load steps, units, states, failures."""

from typing import ClassVar

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tissues import distorted_box, stretched_box, surface, tissue

from fibrous.errors import ConvergenceError
from fibrous.fe import hex8
from fibrous.fe.boundary import PrescribedDisplacement, reaction_force
from fibrous.fe.mesh import Mesh, box
from fibrous.fe.solver import LoadStepError, LoadStepper, Move
from fibrous.materials.neo_hookean import NeoHookean


def solved(mesh, material, prescribed, solver="auto", **limits):
    return LoadStepper.of(mesh, material, prescribed, solver, **limits).follow(prescribed.values)


@pytest.mark.parametrize("solver", ["direct", "cg"])
def test_patch_test_on_a_distorted_mesh(solver):
    mesh, nodes = distorted_box(3), surface(distorted_box(3))
    F = np.array([[1.2, 0.1, 0.0], [0.05, 0.9, -0.1], [0.0, 0.15, 1.05]])
    exact = mesh.node_position @ (F - np.eye(3)).T
    prescribed = PrescribedDisplacement.at(nodes, exact[nodes])
    stepper = LoadStepper.of(mesh, tissue(tension_only=True), prescribed, solver, tolerance=1e-14)
    solution = stepper.follow(prescribed.values)
    np.testing.assert_allclose(solution.displacement[0], exact, atol=1e-12)
    gradient = stepper.assembly.deformation_gradient(solution.displacement[0])
    np.testing.assert_allclose(gradient, np.broadcast_to(F, gradient.shape), atol=1e-12)
    # The whole boundary's force times position is the volume times the stress.
    work = solution.internal_force[0].T @ mesh.node_position
    np.testing.assert_allclose(work, tissue(tension_only=True)(F)[0], atol=1e-13)


def test_an_element_without_free_components_has_the_stress_of_its_material():
    mesh, F = box((1, 1, 1)), np.diag([1.2, 0.9, 1.05])
    values = np.stack([0.0 * mesh.node_position, mesh.node_position @ (F - np.eye(3))])
    solution = solved(mesh, tissue(), PrescribedDisplacement.at(np.arange(8), values, steps=2))
    assert (solution.internal_force[0] == 0.0).all()
    np.testing.assert_allclose(solution.internal_force[1].T @ mesh.node_position, tissue()(F)[0], atol=1e-15)
    inverted = PrescribedDisplacement.at(np.arange(8), -1.5 * mesh.node_position)
    with pytest.raises(LoadStepError, match="element 0 turned inside out"):
        solved(mesh, tissue(), inverted)


def test_rigid_rotation_of_one_face_turns_the_body_without_force():
    mesh = distorted_box(3)
    face = np.flatnonzero(mesh.node_position[:, 0] == 0.0)
    turns = Rotation.from_euler("z", np.linspace(0.0, 60.0, 7)[1:, None], degrees=True)
    exact = np.stack([mesh.node_position @ (R - np.eye(3)).T for R in turns.as_matrix()])
    prescribed = PrescribedDisplacement.at(face, exact[:, face], steps=6)
    solution = solved(mesh, tissue(), prescribed, tolerance=1e-11)
    np.testing.assert_allclose(solution.displacement, exact, atol=1e-12)
    np.testing.assert_allclose(solution.internal_force, 0.0, atol=1e-12)


def antiplane(position: np.ndarray) -> np.ndarray:
    """u_z = g(x, y) with g harmonic: isochoric, and an equilibrium of Eq. 10B at any amplitude.

    With J = 1, P = 2 C1 (F − F⁻ᵀ), whose divergence is 2 C1 ∇²g, for cofactors have no divergence.
    """
    x, y = position[..., 0], position[..., 1]
    return np.stack([0.0 * x, 0.0 * y, 0.2 * (x**3 - 3.0 * x * y**2) + 0.1 * np.exp(2.0 * x) * np.sin(2.0 * y)], -1)


def test_displacement_converges_with_the_square_of_the_element_size():
    nodes, weights = np.polynomial.legendre.leggauss(4)
    points = np.stack(np.meshgrid(nodes, nodes, nodes, indexing="ij"), axis=-1).reshape(-1, 3)
    weight = (weights[:, None, None] * weights[:, None] * weights).ravel()
    sizes, errors = np.array([4, 8, 16]), []
    for count in sizes:
        regular = box((count, count, count))
        bulge = 0.1 * np.prod(np.sin(np.pi * regular.node_position), axis=1, keepdims=True)
        mesh = Mesh(regular.node_position + bulge * [1.0, -1.0, 0.5], regular.element_nodes)
        outside, exact = surface(regular), antiplane(mesh.node_position)
        solution = solved(mesh, tissue(with_fibers=False), PrescribedDisplacement.at(outside, exact[outside]))
        position, found = (
            np.einsum("qa,eai->eqi", hex8.shape_functions(points), values[mesh.element_nodes])
            for values in (mesh.node_position, solution.displacement[0])
        )
        squares = ((found - antiplane(position)) ** 2).sum(axis=-1)
        errors.append(np.sqrt((squares @ weight).sum() / 8.0 / len(mesh.element_nodes)))
    rates = -np.diff(np.log(errors)) / np.diff(np.log(sizes))
    assert ((rates > 1.95) & (rates < 2.05)).all(), rates


@pytest.mark.parametrize(
    ("count", "with_fibers", "reaction"),
    [(4, True, 0.0644469889), (10, True, 0.0630790711), (4, False, 0.0279609626), (10, False, 0.0268292807)],
)
def test_reactions_are_those_of_two_other_codes(count, with_fibers, reaction):
    # FElupe and scikit-fem give these digits for a unit cube stretched by 0.2 in five steps.
    mesh = box((count, count, count))
    prescribed = stretched_box(mesh, np.linspace(0.04, 0.2, 5))
    solution = solved(mesh, tissue(with_fibers=with_fibers), prescribed)
    pulled = np.flatnonzero(mesh.node_position[:, 0] == 1.0)
    force = reaction_force(solution.internal_force[-1], pulled)
    assert force[0] == pytest.approx(reaction, rel=2e-9)
    np.testing.assert_allclose(force[1:], 0.0, atol=1e-9)
    held = reaction_force(solution.internal_force[-1], np.flatnonzero(mesh.node_position[:, 0] == 0.0))
    np.testing.assert_allclose(held, -force, atol=1e-9)
    assert (solution.newton_iterations <= 4).all()
    assert solution.cuts.sum() == 0
    assert solution.linear_solvers == {"direct" if count == 4 else "cg": solution.newton_iterations.sum()}


@pytest.mark.parametrize("factor", [1e-6, 1e6])
@pytest.mark.parametrize("solver", ["direct", "cg"])
def test_units_change_no_iteration(factor, solver):
    mesh = distorted_box(3)
    prescribed = stretched_box(mesh, [0.1, 0.25])
    one, other = (solved(mesh, tissue(scale, tension_only=True), prescribed, solver) for scale in (1.0, factor))
    np.testing.assert_array_equal(other.newton_iterations, one.newton_iterations)
    np.testing.assert_allclose(other.displacement, one.displacement, atol=1e-10)
    np.testing.assert_allclose(other.internal_force, factor * one.internal_force, atol=1e-9 * factor)


def test_lengths_change_no_iteration():
    meshes = [distorted_box(3, lengths=3 * (length,)) for length in (1.0, 1e3)]
    one, other = (
        solved(mesh, tissue(), stretched_box(mesh, length * np.array([0.1, 0.25])))
        for mesh, length in zip(meshes, (1.0, 1e3), strict=True)
    )
    np.testing.assert_array_equal(other.newton_iterations, one.newton_iterations)
    np.testing.assert_allclose(other.displacement, 1e3 * one.displacement, atol=1e-7)


def test_one_step_ends_where_many_do():
    mesh = distorted_box(3)
    many = solved(mesh, tissue(), stretched_box(mesh, np.linspace(0.03, 0.3, 10)))
    one = solved(mesh, tissue(), stretched_box(mesh, [0.3]))
    np.testing.assert_allclose(one.displacement[-1], many.displacement[-1], atol=1e-8)


def test_targets_are_met_exactly_though_increments_are_cut_and_grow():
    mesh = distorted_box(3)
    targets = np.array([0.1, 0.37, 0.5, 0.9, 0.9])
    prescribed = stretched_box(mesh, targets)
    solution = solved(mesh, tissue(), prescribed, largest_number_of_iterations=3)
    pulled = mesh.node_position[:, 0] == 1.0
    for displacement, target in zip(solution.displacement, targets, strict=True):
        assert (displacement[pulled, 0] == target).all()
        assert (displacement[mesh.node_position[:, 0] == 0.0] == 0.0).all()
    assert solution.converged.all()
    assert solution.cuts.sum() > 0
    sizes = [attempt.end - attempt.start for attempt in solution.attempts if not attempt.failure]
    assert (np.diff(sizes) > 0.0).any(), "an increment grew again"
    assert sum(len(attempt.residuals) for attempt in solution.attempts) == solution.newton_iterations.sum()
    assert sum(bool(attempt.failure) for attempt in solution.attempts) == solution.cuts.sum()
    free = solved(mesh, tissue(), prescribed)
    np.testing.assert_allclose(solution.displacement, free.displacement, atol=1e-7)


@pytest.mark.parametrize("ratio", [1.0, 0.5, 2.0, -1.0])
def test_the_bend_of_two_moves_is_exact_on_a_parabola(ratio):
    # u(t) = 3 t + 5 t² in one free component, prescribed value t, from 0.2 over 0.3 on to 0.3 + 0.1 ratio.
    before, now = Move(np.array([0.1]), np.array([0.1 * (3.0 + 2.0)])), 0.1 * ratio
    move = Move(np.array([now]), np.array([now * (3.0 + 3.0)]))
    exact = 3.0 * now + 5.0 * ((0.3 + now) ** 2 - 0.3**2)
    assert (move.response + move.bend(before))[0] == pytest.approx(exact, rel=1e-12)


def test_moves_in_other_directions_say_nothing_of_the_bend():
    before = Move(np.array([0.1, 0.0]), np.array([1.0]))
    assert Move(np.array([0.05, 0.05]), np.array([2.0])).bend(before) == 0.0
    assert Move(np.array([0.1, 0.0]), np.array([2.0])).bend(Move(np.zeros(2), np.ones(1))) == 0.0


@pytest.mark.parametrize("fractions", [[0.25, 0.5, 0.5 + 1e-9, 0.75, 1.0], [1e-8, 1.0], [0.01, 1.0]])
def test_steps_of_very_different_lengths_need_no_cuts(fractions):
    """A plateau written to nine digits, or a small step first: the bend of a tiny step says nothing of a long one."""
    mesh = distorted_box(3)
    solution = solved(mesh, tissue(), stretched_box(mesh, 0.2 * np.array(fractions)))
    assert solution.cuts.sum() == 0
    assert solution.newton_iterations.max() <= 5


def test_smooth_paths_need_two_iterations_a_step():
    mesh = distorted_box(3)
    solution = solved(mesh, tissue(), stretched_box(mesh, np.linspace(0.01, 0.2, 20)))
    assert (solution.newton_iterations[4:] == 2).all()


def test_a_path_goes_on_from_where_it_ended():
    mesh = distorted_box(3)
    whole = solved(mesh, tissue(), stretched_box(mesh, [0.1, 0.2]))
    prescribed = stretched_box(mesh, [0.2])
    rest = LoadStepper.of(mesh, tissue(), prescribed).follow(prescribed.values, start=whole.displacement[0])
    np.testing.assert_allclose(rest.displacement[0], whole.displacement[1], atol=1e-8)
    assert rest.newton_iterations[0] <= 4


def test_a_load_too_large_names_step_and_element_and_leaves_what_converged():
    mesh = box((2, 2, 2))
    prescribed = stretched_box(mesh, [-0.3, -1.5])
    with pytest.raises(LoadStepError, match=r"^step 2: no equilibrium found beyond .* % of its way") as error:
        solved(mesh, tissue(), prescribed, smallest_increment=1 / 8)
    assert "\n" not in str(error.value)
    solution = error.value.solution
    np.testing.assert_array_equal(solution.converged, [True, False])
    assert np.isfinite(solution.displacement[0]).all()
    assert np.isnan(solution.displacement[1]).all()
    assert np.isnan(solution.internal_force[1]).all()
    assert any("turned inside out" in attempt.failure for attempt in solution.attempts)
    assert solution.cuts[1] >= 4
    assert solution.newton_iterations[1] == sum(len(one.residuals) for one in solution.attempts if one.step == 1)


def test_an_element_turned_inside_out_is_named():
    mesh = box((3, 1, 1))
    stepper = LoadStepper.of(mesh, tissue(), stretched_box(mesh, [0.0]))
    displacement = np.zeros_like(mesh.node_position)
    displacement[mesh.node_position[:, 0] == 1.0, 0] = -0.4
    assert stepper.assembly.what_is_not_finite(displacement) == "element 2 turned inside out"


class Remembering(NeoHookean):
    """Counts commits: a new state is the old one plus one; refuses F beyond a stretch, like a network without one."""

    limit = np.inf
    trials: ClassVar[list[bool]] = []

    def __call__(self, gradient, state=None, near=None):
        if gradient[..., 0, 0].max() > self.limit:
            raise ConvergenceError("a network found no equilibrium")
        # What a trial returned comes back in the next one of the same increment, and in no other.
        assert near is None or (near == state + 1.0).all()
        self.trials.append(near is not None)
        state.flags.writeable = False  # what is passed in stays as it was
        return *super().__call__(gradient)[:2], state + 1.0


def test_states_advance_once_for_each_converged_increment():
    mesh = distorted_box(3)
    prescribed = stretched_box(mesh, [0.1, 0.2, 0.5])
    Remembering.trials.clear()
    stepper = LoadStepper.of(mesh, Remembering(0.025, 0.417), prescribed, largest_number_of_iterations=3)
    solution = stepper.follow(prescribed.values, state=np.zeros((27, 8)))
    converged = sum(not attempt.failure for attempt in solution.attempts)
    assert solution.cuts.sum() > 0
    # One for the evaluation at rest, one for each increment that converged, none for those that did not.
    np.testing.assert_array_equal(solution.state, 1.0 + converged)
    nears = [near for attempt in solution.attempts for near in [False] + [True] * (len(attempt.residuals) - 1)]
    assert Remembering.trials == [False, *nears]


def test_a_material_without_an_answer_cuts_the_increment_and_other_errors_pass():
    mesh = distorted_box(3)
    prescribed = stretched_box(mesh, [0.2])
    Limited = type("Limited", (Remembering,), {"limit": 1.15})
    with pytest.raises(LoadStepError, match="a network found no equilibrium"):
        LoadStepper.of(mesh, Limited(0.025, 0.417), prescribed, smallest_increment=1 / 4).follow(
            prescribed.values, state=np.zeros((27, 8))
        )

    class Broken(NeoHookean):
        def __call__(self, gradient, state=None, near=None):
            if gradient[..., 0, 0].max() > 1.15:
                raise RuntimeError("out of memory")
            return super().__call__(gradient, state)

    with pytest.raises(RuntimeError, match="out of memory"):
        solved(mesh, Broken(0.025, 0.417), prescribed)


def test_a_target_that_changes_nothing_is_met_at_once():
    mesh = box((2, 2, 2))
    solution = solved(mesh, tissue(), stretched_box(mesh, [0.0, 0.1, 0.1]))
    assert (solution.displacement[0] == 0.0).all()
    assert solution.newton_iterations[2] <= 1
