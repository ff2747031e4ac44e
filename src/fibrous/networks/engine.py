"""Equilibria of one network under eight deformation gradients at a time: the engine of every computation with networks.

Newton's method on the energy, stable states only; `relaxation` iterates. The eight lanes share a topology and nothing
else: each starts from a prediction, takes full steps where its Hessian is positive definite, leaves just enough of
compressed fibres' negative tension out of it where it is not, and shortens steps that do not go down in energy. A lane
that finds no stable equilibrium that way is handed to `guard`, which goes from the last equilibrium in shorter parts.
"""

from __future__ import annotations

import math
import threading
from contextlib import suppress
from dataclasses import dataclass, field
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from fibrous.clock import Clock
from fibrous.errors import ConvergenceError, NetworkError
from fibrous.networks import kernels, relaxation
from fibrous.networks.elimination import Elimination, solve
from fibrous.networks.fiber_law import FiberLaw, Fibers
from fibrous.networks.geometry import Geometry
from fibrous.networks.guard import LARGEST_MOVE, LIMITS, SINGULAR, EquilibriumSolver, Limits
from fibrous.networks.kernels import Topology
from fibrous.networks.lanes import LANES
from fibrous.networks.relaxation import CONVERGED, STUCK, Space

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Count = NDArray[np.int64]
Mask = NDArray[np.bool_]

#: Parts of the work.
EQUILIBRIUM, CONDENSATION = "equilibrium", "condensation"


class Room:
    """Arrays in which eight networks of one topology are solved: one room per thread, grown to the largest network.

    Attributes
    ----------
    holds : whose forces and factor are in the room, None where nobody may rely on them
    """

    def __init__(self) -> None:
        self._memory: dict[str, Array] = {}
        self._views: dict[tuple[str, tuple[int, ...]], Array] = {}
        self.holds: object = None

    def array(self, name: str, *shape: int) -> Array:
        """The array of that name, contiguous, with eight lanes behind `shape`; what it held before is undefined."""
        view = self._views.get((name, shape))
        if view is None:
            size = math.prod(shape) * LANES
            if name not in self._memory or self._memory[name].size < size:
                self._memory[name] = aligned(size)
                self._views = {key: kept for key, kept in self._views.items() if key[0] != name}
            view = self._views[name, shape] = self._memory[name][:size].reshape(*shape, LANES)
        return view


def aligned(size: int) -> Array:
    """An array of that many numbers that begins with a line of the cache: vectors of eight then lie in a line each."""
    memory = np.empty(size + LANES)
    first = -memory.ctypes.data % (8 * LANES) // 8
    return memory[first : first + size]


_THREAD = threading.local()


def room() -> Room:
    """The room of this thread."""
    if not hasattr(_THREAD, "room"):
        _THREAD.room = Room()
    return _THREAD.room


class Relaxed(NamedTuple):
    """What became of eight lanes, all of shape (8,).

    status : `CONVERGED` or `STUCK`; steps : of Newton's method; cuts : times the way was halved
    indefinite : Hessians met that were not positive definite
    residual : ‖r‖/(√n max(1, f_rms)) with n interior nodes and forces in kA
    direct : whether the lane got there from its first prediction, without the guard
    """

    status: Count
    steps: Count
    cuts: Count
    indefinite: Count
    residual: Array
    direct: Mask

    @property
    def converged(self) -> Mask:
        """Which lanes are in stable equilibrium."""
        return self.status == CONVERGED


class PathState(NamedTuple):
    """Eight lanes on their paths, at their last equilibria and those before.

    gradient, gradient_before : F, shape (3, 3, 8)
    displacement, displacement_before : fluctuation u, shape (n + 1, 3, 8), edges, with a last row of zeros
    factored : u at which the factor was made that led to the last equilibrium, the same shape
    rate_before : ∂u/∂F : ΔF at the equilibrium before, towards the last, the same shape
    curved : whether the two tell how the path bends; converged : whether the last F was reached
    iterations, cuts, indefinite : of the way from the F before; all of shape (8,)
    """

    gradient: Array
    displacement: Array
    factored: Array
    gradient_before: Array
    displacement_before: Array
    rate_before: Array
    curved: Mask
    converged: Mask
    iterations: Count
    cuts: Count
    indefinite: Count


@dataclass(frozen=True, eq=False, repr=False)
class Engine:
    """Newton's method for a network with a fibre law, in eight lanes.

    Parameters
    ----------
    network : as it is; law : of its fibres
    nodes : its number of the node at each place of the order of elimination, shape (n,)
    topology, fibers : for compiled code
    limits : the lanes, and each part of the guard's way, are attempts at an F
    clock : counts CPU seconds of `equilibrium`, which is forces, Hessians, factors and moves, and of the `condensation`
        with the rates
    """

    network: Geometry
    law: FiberLaw
    nodes: NDArray[np.int64]
    topology: Topology
    fibers: Fibers
    limits: Limits = LIMITS
    clock: Clock = field(default_factory=Clock)

    @classmethod
    def of(cls, network: Geometry, law: FiberLaw, limits: Limits = LIMITS, clock: Clock | None = None) -> Self:
        """The engine of a network, ordered so that factors of its Hessian have few blocks."""
        interior = np.flatnonzero(~network.node_is_boundary)
        number = np.full(len(network.node_position), len(interior))
        number[interior] = np.arange(len(interior))
        inside = (number[network.fiber_nodes] < len(interior)).all(axis=1)
        elimination = Elimination.of(len(interior), number[network.fiber_nodes[inside]])
        nodes = interior[elimination.order]
        number[nodes] = np.arange(len(interior))
        ends = number[network.fiber_nodes]
        pairs = np.full(len(ends), -1, dtype=np.int32)
        pairs[inside] = elimination.block(ends[inside].max(axis=1), ends[inside].min(axis=1))
        tails, heads = (np.ascontiguousarray(end, dtype=np.int32) for end in ends.T)
        lists = elimination.starts, elimination.rows, elimination.leaders
        topology = Topology(network.fiber_vectors, tails, heads, pairs, *lists)
        return cls(network, law, nodes, topology, law.fibers(network.fiber_lengths), limits, clock or Clock())

    @property
    def size(self) -> int:
        """Number n of interior nodes."""
        return len(self.nodes)

    @property
    def guard(self) -> EquilibriumSolver:
        """The method for what leaves the lanes."""
        return EquilibriumSolver.of(self.network, self.law, self.limits)

    def relax(self, F: Array, u: Array, quick: bool = False, least_pivot: float = 0.0) -> Relaxed:
        """Bring the lanes to equilibrium at F, shape (3, 3, 8), from predictions u, (≥ n + 1, 3, 8), in place.

        A lane converges where its residual is within tolerance and its Hessian positive definite. A new factor tells,
        or the last one if all of its pivots are more than a hundredth of their diagonal elements and the last step
        shrank the residual to a hundredth, so that the two Hessians are nearly the same. Every pivot must be more than
        its fraction `least_pivot` of the diagonal element that it came from. Forces and factor stay in the room.

        The `quick` way is for predictions that are nearly right: a lane is stuck at the first sign of trouble, which is
        a Hessian that is not positive definite, or a step that is long or leaves more than half of the residual.
        """
        limits = self.limits.residual_tolerance, self.limits.largest_number_of_iterations
        space = self._space()
        with self.clock.of(EQUILIBRIUM):
            status, steps, indefinite, residual = relaxation.relax(
                self.topology, self.fibers, space, F, u, *limits, quick, least_pivot
            )
        return Relaxed(status, steps, np.zeros_like(steps), indefinite, residual, status == CONVERGED)

    def reach(self, F: Array, u: Array, from_F: Array, from_u: Array, quick: bool = False) -> Relaxed:
        """`relax`, and other ways for lanes that are stuck, from equilibria at `from_F` and `from_u`, shaped alike.

        What is stuck on the `quick` way starts again from the tangent's prediction. A lane that even the
        guard does not bring there is left at the equilibrium it came from, as `STUCK`.
        """
        relaxed = self.relax(F, u, quick)
        if relaxed.converged.all():
            return relaxed
        direct, stuck = relaxed.converged, ~relaxed.converged
        status, steps, cuts, indefinite = (values.copy() for values in relaxed[:4])
        if quick:
            self.relax(from_F, from_u.copy())
            moved = from_u[: self.size] + _limited(self._along(F - from_F)[0])
            u[: self.size] = np.where(stuck, moved, u[: self.size])
            relaxed = self.relax(F, u)
            status, steps = relaxed.status.copy(), steps + relaxed.steps
            indefinite += relaxed.indefinite
            if relaxed.converged.all():
                return Relaxed(status, steps, cuts, indefinite, relaxed.residual, direct)
        guard = self.guard
        place = np.empty(len(self.network.node_position), dtype=np.int64)
        place[guard.assembly.nodes] = np.arange(self.size)
        place = place[self.nodes]
        goal = F.copy()
        for q in np.flatnonzero(~relaxed.converged):
            start = np.zeros((self.size + 1, 3))
            start[place] = from_u[: self.size, :, q]
            state = None
            with suppress(ConvergenceError):  # the equilibrium that it came from is none by the guard's own factor
                state = guard.equilibrium(F[..., q], guard.state(from_F[..., q], start))
                steps[q] += state.iterations
                cuts[q] += state.cuts
                indefinite[q] += state.indefinite
            if state is not None and state.converged:
                status[q] = CONVERGED
                u[: self.size, :, q] = state.point.displacement[place]
            else:
                goal[..., q], u[: self.size, :, q] = from_F[..., q], from_u[: self.size, :, q]
        again = self.relax(goal, u)
        status[~again.converged] = STUCK
        u[: self.size] = np.where(status == CONVERGED, u[: self.size], from_u[: self.size])
        return Relaxed(status, steps + again.steps, cuts, indefinite, again.residual, direct)

    def rest(self) -> PathState:
        """All lanes at F = I. Raises NetworkError where the network is a mechanism there."""
        F = np.ascontiguousarray(np.broadcast_to(np.eye(3)[..., None], (3, 3, LANES)))
        u = np.zeros((self.size + 1, 3, LANES))
        relaxed = self.relax(F, u, least_pivot=SINGULAR)
        if not relaxed.converged.all():
            self._pull(F, np.zeros_like(u))
            d, stiffness = self._forces()
            kernels.soften(d, stiffness, np.ones((1, LANES)), stiffness)
            if self._factorize(stiffness, SINGULAR).all():
                raise NetworkError(
                    "the network finds no equilibrium at rest: let the fibers' rest lengths differ less from 1, or "
                    "allow more iterations and a larger residual"
                )
            raise NetworkError(
                "the network is a mechanism at rest: some nodes move without stretching a fiber, so it has no stable "
                "equilibrium; join more fibers at them (a node needs three out of one plane at the least)"
            )
        nothing = np.zeros(LANES, dtype=np.int64)
        no = np.zeros(LANES, dtype=bool)
        state = PathState(
            F, u, self._factored(), F, u, np.zeros_like(u), no, ~no, relaxed.steps, nothing, relaxed.indefinite
        )
        room().holds = state
        return state

    def advance(self, state: PathState, F: Array) -> PathState:
        """The lanes at F, shape (3, 3, 8), from a state; those lost before stay where they are.

        A lane whose F has no positive determinant is lost.

        Each starts from the tangent's prediction or the cubic through the last two equilibria and their rates:
        whichever leaves the smaller residual. Forces and factor stay in the room.
        """
        space, size = room(), self.size
        if space.holds is not state:
            self._pull(state.gradient, state.factored)
            self._factorize(self._forces()[1], 0.0)
            self._pull(state.gradient, state.displacement)
        with np.errstate(invalid="ignore"):
            possible = np.linalg.det(np.moveaxis(F, -1, 0)) > 0.0
        F = np.where(state.converged & possible, F, state.gradient)
        forward, u = self._predicted(state, F)
        relaxed = self.reach(F, u, state.gradient, state.displacement)
        converged = state.converged & possible & relaxed.converged
        lost = ~state.converged
        counts = (np.where(lost, 0, values) for values in (relaxed.steps, relaxed.cuts, relaxed.indefinite))
        rate = np.zeros_like(u)
        rate[:size] = forward
        new = PathState(
            np.where(converged, F, state.gradient),
            u,
            self._factored(),
            state.gradient,
            state.displacement,
            rate,
            relaxed.direct & converged,
            converged,
            *counts,
        )
        space.holds = new
        return new

    def _predicted(self, state: PathState, F: Array) -> tuple[Array, Array]:
        """∂u/∂F : ΔF at `state`, shape (n, 3, 8), and the u from which to start at F, shape (n + 1, 3, 8)."""
        size = self.size
        forward, backward = self._along(F - state.gradient, state.gradient - state.gradient_before)
        u = state.displacement.copy()
        u[:size] += _limited(forward)
        if not state.curved.any():
            return forward, u
        # The cubic, written so that it is exact where u is linear in F.
        bend = (state.displacement_before - state.displacement)[:size] + backward
        cubic = state.displacement.copy()
        cubic[:size] += _limited(forward + 5.0 * bend + 2.0 * (state.rate_before[:size] - backward))
        norms = []
        for start in (u, cubic):
            norm = self._pull(F, start)[0]
            norms.append(np.where(np.isfinite(norm), norm, np.inf))
        better = state.curved & (norms[1] < norms[0])
        return forward, np.where(better, cubic, u)

    def _along(self, *changes: Array) -> list[Array]:
        """∂u/∂F : ΔF, shape (n, 3, 8), for changes ΔF, (3, 3, 8), from the forces and the factor in the room."""
        right = room().array("right", self.size, 3, len(changes))
        with self.clock.of(CONDENSATION):
            for column, change in enumerate(changes):
                kernels.couple_along(self.topology, *self._forces(), np.ascontiguousarray(change), right, column)
            solve(self.topology.starts, self.topology.rows, self._factor(), right)
        return [right[:, :, column].copy() for column in range(len(changes))]

    def rates(self, G: Single, lanes: Mask | None = None, exact: bool = False) -> None:
        """Fill G, (≥ n + 1, 3, 9, 8), with ∂u/∂F from the forces and the factor in the room, in some lanes or all.

        An `exact` rate comes from a new factor, another one from that which led there.
        """
        if exact:
            room().holds = None
            self._factorize(self._forces()[1], 0.0)
        right = room().array("right", self.size, 3, 9)
        with self.clock.of(CONDENSATION):
            kernels.couple(self.topology, *self._forces(), right)
            solve(self.topology.starts, self.topology.rows, self._factor(), right)
            if lanes is None:
                G[: self.size] = right
            else:
                G[: self.size, ..., lanes] = right[..., lanes]

    def condense(self, G: Single) -> tuple[Array, Array]:
        """P = Σ f ⊗ D, (3, 3, 8), and ∂P/∂F with rates G, (9, 9, 8), in kA/edge², of what is in the room."""
        P, A = np.empty((3, 3, LANES)), np.empty((9, 9, LANES))
        with self.clock.of(CONDENSATION):
            kernels.condense(self.topology, *self._forces(), G, P, A)
        return P, A

    def tangent(self) -> Array:
        """∂P/∂F along equilibria, shape (9, 9, 8), kA/edge², of what is in the room, by static condensation."""
        G = np.zeros((self.size + 1, 3, 9, LANES), dtype=np.float32)
        self.rates(G, exact=True)
        return self.condense(G)[1]

    def measures(self) -> tuple[Array, Array, Array]:
        """W, shape (8,), P and the orientation tensor h, (3, 3, 8), of what is in the room; kA/edge² and none."""
        sums = np.empty((19, LANES))
        kernels.homogenize(self.topology, self.fibers, *self._forces(), sums)
        return sums[0], sums[1:10].reshape(3, 3, LANES), sums[10:].reshape(3, 3, LANES)

    def stretches(self) -> Array:
        """Stretches of the fibres of what is in the room, shape (fibers, 8)."""
        d = self._forces()[0]
        return np.sqrt(np.einsum("miq,miq->mq", d, d)) / self.fibers.rest_lengths[:, None]

    def node_position(self, F: Array, u: Array) -> Array:
        """Deformed positions of all nodes in the network's order at F, (3, 3, L), and u; (L, nodes, 3), edges."""
        position = np.einsum("ijq,nj->qni", F, self.network.node_position)
        position[:, self.nodes] += u[: self.size].transpose(2, 0, 1)
        return position

    def _pull(self, F: Array, u: Array) -> tuple[Array, Array]:
        """Forces at F and u into the room; ‖r‖ and √n max(1, f_rms), shape (8,)."""
        norm, scale = np.empty((2, LANES))
        space = self._space()
        with self.clock.of(EQUILIBRIUM):
            relaxation.balance(self.topology, self.fibers, space, F, u, norm, scale)
        return norm, scale

    def _factorize(self, stiffness: Array, least_pivot: float) -> Mask:
        """The factors of Hessians with the fibres' blocks into the room; in which lanes they are positive definite."""
        factor, slack = self._factor(), np.empty((2, LANES))
        with self.clock.of(EQUILIBRIUM):
            relaxation.hessian(self.topology, self._forces()[0], stiffness, factor, least_pivot, slack)
        return slack[0] > 0.0

    def _forces(self) -> tuple[Array, Array]:
        """End-to-end vectors, shape (fibers, 3, 8), and stiffness of the fibres, (fibers, 2, 8), in the room."""
        space, count = room(), len(self.fibers.rest_lengths)
        return space.array("vectors", count, 3), space.array("stiffness", count, 2)

    def _factor(self) -> Array:
        return room().array("factor", len(self.topology.rows), 9)

    def _factored(self) -> Array:
        """A copy of the fluctuation at which the factor was made, shape (n + 1, 3, 8)."""
        u = np.zeros((self.size + 1, 3, LANES))
        u[: self.size] = room().array("factored", self.size, 3)
        return u

    def _space(self) -> Space:
        """What the room has for this network, to be written over."""
        array, n, fibers, blocks = room().array, self.size, len(self.fibers.rest_lengths), len(self.topology.rows)
        room().holds = None
        return Space(
            *self._forces(),
            array("residual", n + 1, 3),
            self._factor(),
            array("factored", n, 3),
            array("right", n, 3, 1),
            array("start", n + 1, 3),
            array("move", n, 3),
            array("lane's vectors", fibers, 3),
            array("lane's stiffness", fibers, 2),
            array("lane's softened", fibers, 2),
            array("lane's factor", blocks, 9),
            array("lane's right", n, 3, 1),
        )


def _limited(move: Array) -> Array:
    """Moves, shape (n, 3, 8), of which each lane is shortened where it would carry a node farther than allowed."""
    farthest = np.abs(move).max(axis=(0, 1), initial=0.0)
    return move * np.minimum(1.0, LARGEST_MOVE / np.maximum(farthest, 1e-300))
