"""Equilibrium of one network whose boundary moves with F: the guard of `engine`, and the reference of its tests.

A state is accepted where the residual is within tolerance and the Hessian is positive definite. Where compressed
fibres make the Hessian indefinite, the step is taken with just enough of their negative tension left out, and goes
down in energy; a stationary point that is no minimum is left along its most unstable direction.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eig_banded
from threadpoolctl import threadpool_limits

from fibrous.errors import ConvergenceError, NetworkError
from fibrous.networks.banded import Assembly, Point
from fibrous.networks.fiber_law import FiberLaw
from fibrous.networks.geometry import Geometry

Array = NDArray[np.float64]

# No step or prediction moves a node farther than this, in edges; a fibre of the study is about 0.17 edges long.
LARGEST_MOVE = 0.3
# First share of negative tension left out of an indefinite Hessian; thrice as much each time until it is definite.
FIRST_SHARE = 0.02
# With a definite Hessian a step is accepted without asking the energy, whose digits end sooner than the residual's,
# where the slope along the step has fallen to this share of its first value.
FLAT = 0.1
# Share of the decrease that the slope promises, below which a step is halved, and the step given up as too short.
SUFFICIENT = 1e-4
SHORTEST = 1e-10
# Least pivot of the rest Hessian, over the diagonal element it came from, that tells a structure from a mechanism.
SINGULAR = 1e-12


@dataclass(frozen=True)
class Limits:
    """When a network is in equilibrium, and how hard to try.

    residual_tolerance : ‖r‖ ≤ tolerance √n max(1, f_rms), with n interior nodes and forces in kA
    largest_number_of_iterations : of Newton's method in one attempt at an F
    largest_number_of_cuts : how often the way to an F is halved before it is given up
    """

    residual_tolerance: float = 1e-11
    largest_number_of_iterations: int = 60
    largest_number_of_cuts: int = 6


#: Those of whoever asks for none.
LIMITS = Limits()


@dataclass(frozen=True)
class State:
    """A network under one deformation gradient; see `Point` for its arrays.

    converged : whether the residual is within tolerance and the Hessian positive definite
    iterations : Newton iterations spent; cuts : times the way to this state was halved
    indefinite : how many of the points met had a Hessian that is not positive definite
    """

    point: Point
    converged: bool
    iterations: int
    cuts: int = 0
    indefinite: int = 0


@dataclass(frozen=True)
class _Reached:
    """A state, the factor of its Hessian (valid until the next one is made), and the prediction that led to it.

    Only a state that did not converge has an empty factor.
    """

    state: State
    factor: Array
    #: gradient and displacement of the state before, and the rate ∂u/∂F : ΔF there, for the same ΔF
    before: tuple[Array, Array, Array] | None = None


@dataclass(frozen=True)
class EquilibriumSolver:
    """Newton's method for one network, `assembly` in the order of its band, within `limits`."""

    assembly: Assembly
    limits: Limits = LIMITS

    @classmethod
    def of(cls, network: Geometry, law: FiberLaw, limits: Limits = LIMITS) -> EquilibriumSolver:
        """The solver of a network with a fibre law."""
        return cls(Assembly(network, law), limits)

    def follow(self, gradients: Iterable[Array]) -> list[State]:
        """States along a path of deformation gradients, each of shape (3, 3), reached one after the other from rest.

        Beyond a gradient that cannot be reached the states are returned unconverged and untried.
        Raises NetworkError where the network is a mechanism at rest.
        """
        with _reproducible():
            here = self._rest()
            states: list[State] = []
            for gradient in gradients:
                gradient = np.ascontiguousarray(gradient, dtype=float)
                if not here.state.converged:
                    here = replace(here, state=replace(here.state, iterations=0, cuts=0, indefinite=0))
                elif states or not np.array_equal(gradient, here.state.point.gradient):
                    here = self._reach(here, gradient, 0)
                states.append(here.state)
            return states

    def equilibrium(self, gradient: Array, near: State | None = None) -> State:
        """The state at F, shape (3, 3), reached from a converged state at another F, or from rest."""
        with _reproducible():
            here = self._rest() if near is None else self._refactored(near)
            return self._reach(here, np.ascontiguousarray(gradient, dtype=float), 0).state

    def state(self, gradient: Array, displacement: Array) -> State:
        """The equilibrium at F, shape (3, 3), with the fluctuation u, (n + 1, 3), edges, in the assembly's order."""
        return State(self.assembly.evaluate(np.ascontiguousarray(gradient), displacement), True, 0)

    def node_position(self, state: State) -> Array:
        """Deformed positions of all nodes in the network's own order, shape (nodes, 3), edges."""
        position = self.assembly.network.node_position @ state.point.gradient.T
        position[self.assembly.nodes] += state.point.displacement[:-1]
        return position

    def condensed_tangent(self, state: State) -> Array:
        """∂P/∂F of `Assembly.condensed_tangent` at a converged state; raises ConvergenceError at any other."""
        with _reproducible():
            return self.assembly.condensed_tangent(state.point, self._refactored(state).factor)

    def _rest(self) -> _Reached:
        point = self.assembly.evaluate(np.eye(3), np.zeros((self.assembly.size + 1, 3)))
        diagonal = self.assembly.hessian(point)[0].copy()
        factor = self.assembly.factor(point)
        free_of_stress = (
            _norm(point) <= self.limits.residual_tolerance * np.sqrt(self.assembly.size) * point.force_scale
        )
        if free_of_stress and (factor is None or (factor[0] ** 2 < SINGULAR * diagonal).any()):
            raise NetworkError(
                "the network is a mechanism at rest: some nodes move without stretching a fiber, so it has no stable "
                "equilibrium; join more fibers at them (a node needs three out of one plane at the least)"
            )
        reached = self._newton(point)
        if not reached.state.converged:
            raise NetworkError(
                "the network finds no equilibrium at rest: let the fibers' rest lengths differ less from 1"
            )
        return reached

    def _reach(self, here: _Reached, gradient: Array, depth: int) -> _Reached:
        start, rate = self._predicted(here, gradient)
        there = self._newton(start)
        if there.state.converged:
            point = here.state.point
            return replace(there, before=(point.gradient, point.displacement, rate))
        if depth == self.limits.largest_number_of_cuts:
            return there
        here = self._refactored(here.state)
        middle = self._reach(here, 0.5 * (here.state.point.gradient + gradient), depth + 1)
        end = self._reach(replace(middle, before=None), gradient, depth + 1) if middle.state.converged else there
        tried = [there.state, middle.state, *([end.state] if end is not there else [])]
        spent, indefinite = sum(one.iterations for one in tried), sum(one.indefinite for one in tried)
        cuts = 1 + middle.state.cuts + end.state.cuts
        state = replace(end.state, iterations=spent, cuts=cuts, indefinite=indefinite)
        return replace(end, state=state, before=None)

    def _refactored(self, state: State) -> _Reached:
        factor = self.assembly.factor(state.point) if state.converged else None
        if factor is None:
            raise ConvergenceError(
                "the state is no stable equilibrium, so it has no tangent; start from a converged one"
            )
        return _Reached(state, factor)

    def _predicted(self, here: _Reached, gradient: Array) -> tuple[Point, Array]:
        """The point to start from at F, and the rate ∂u/∂F : ΔF at `here`.

        The tangent prediction, or the cubic through the last two states and their rates, whichever leaves the
        smaller residual. The cubic is written so that it is exact where u is linear in F.
        """
        assembly, point = self.assembly, here.state.point
        forward = assembly.displacement_rate(point, here.factor, gradient - point.gradient)
        moves = [forward]
        if here.before is not None:
            gradient_before, displacement_before, rate_before = here.before
            backward = assembly.displacement_rate(point, here.factor, point.gradient - gradient_before)
            bend = (displacement_before - point.displacement)[:-1].ravel() + backward
            moves.append(forward + 5.0 * bend + 2.0 * (rate_before - backward))
        starts = [assembly.evaluate(gradient, assembly.moved(point.displacement, _limited(move))) for move in moves]
        return min(starts, key=_norm), forward

    def _newton(self, start: Point) -> _Reached:
        assembly, point = self.assembly, start
        factor, norm_before, indefinite = None, np.inf, 0
        for iteration in range(self.limits.largest_number_of_iterations + 1):
            norm = _norm(point)
            if not np.isfinite(norm * point.force_scale):
                break
            tolerance = self.limits.residual_tolerance * np.sqrt(assembly.size) * point.force_scale
            # Where a step shrank the residual so much that another with the same factor will do, no new one is made.
            if factor is None or norm <= tolerance or norm * norm > tolerance * norm_before:
                factor = assembly.factor(point)
                indefinite += factor is None
            if norm <= tolerance and factor is not None:
                return _Reached(State(point, True, iteration, indefinite=indefinite), factor)
            if iteration == self.limits.largest_number_of_iterations:
                break
            if norm <= tolerance:
                move = self._unstable_direction(point)
            else:
                definite = factor if factor is not None else self._blended_factor(point)
                if definite is None:
                    break
                move = -assembly.solve(definite, point.residual)
            lower = self._line_search(point, _limited(move), definite=factor is not None)
            if lower is None:
                break
            point, norm_before = lower, norm
        return _Reached(State(point, False, iteration, indefinite=indefinite), np.empty((0, 0)))

    def _blended_factor(self, point: Point) -> Array | None:
        """Factor of the Hessian with the least share of negative tension left out that makes it positive definite."""
        share = FIRST_SHARE
        while share < 3.0:
            factor = self.assembly.factor(point, min(share, 1.0))
            if factor is not None:
                return factor
            share *= 3.0
        return None

    def _unstable_direction(self, point: Point) -> Array:
        """Eigenvector of the least eigenvalue, as long as the largest move, its largest component positive.

        At a stationary point the energy falls either way; the sign only has to be the same on every machine.
        """
        vector = eig_banded(self.assembly.hessian(point).copy(), lower=True, select="i", select_range=(0, 0))[1][:, 0]
        return vector * (LARGEST_MOVE / vector[np.argmax(np.abs(vector))])

    def _line_search(self, point: Point, move: Array, definite: bool) -> Point | None:
        """The point after the longest halving of `move` that lowers the energy enough; None where none does."""
        assembly = self.assembly
        slope = float(move @ point.residual)
        energy = None
        length = 1.0
        while length > SHORTEST:
            trial = assembly.evaluate(point.gradient, assembly.moved(point.displacement, length * move))
            if definite and abs(move @ trial.residual) <= FLAT * abs(slope):
                return trial
            if energy is None:
                energy = assembly.energy(point)
            if assembly.energy(trial) < energy + SUFFICIENT * length * slope:
                return trial
            length *= 0.5
        return None


@contextmanager
def _reproducible() -> Iterator[None]:
    """One BLAS thread, whose sums do not depend on the machine's load; trial points may leave the range of floats."""
    with threadpool_limits(limits=1, user_api="blas"), np.errstate(over="ignore", invalid="ignore"):
        yield


def _norm(point: Point) -> float:
    norm = float(np.sqrt(point.residual @ point.residual))
    return norm if np.isfinite(norm) else np.inf


def _limited(move: Array) -> Array:
    """The move, shortened where it would carry a node farther than allowed along an axis."""
    farthest = float(np.abs(move).max(initial=0.0))
    return move * min(1.0, LARGEST_MOVE / farthest) if farthest > 0.0 else move
