"""Newton's method for eight networks of one topology at a time, with tangents by static condensation.

This is the quick way along a path of stable states: it starts from a prediction, takes full steps, and gives a network
up at the first sign of trouble (a Hessian that is not positive definite, a residual that does not fall, a step too
long). What to do then is known to `equilibrium`.

A state is accepted where the residual is within tolerance and the Hessian is positive definite, at the state or where
the last factor was made; with an old factor every step must shrink the residual to a hundredth, which it could
not beside a direction of negative stiffness.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from fibrous.clock import Clock
from fibrous.networks import lane_kernels as kernels
from fibrous.networks.elimination import Elimination, factorize, solve
from fibrous.networks.equilibrium import LARGEST_MOVE
from fibrous.networks.fiber_law import FiberLaw
from fibrous.networks.lane_kernels import Topology
from fibrous.networks.lanes import LANES
from fibrous.networks.network import Network

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Count = NDArray[np.int64]

#: What became of a network.
RUNNING, CONVERGED, INDEFINITE, STUCK = range(4)
# Newton steps; a start that needs more is no prediction.
MOST_STEPS = 20
# A factor is used again where the last step shrank the residual at least to this part, and this many steps as good as
# the last would reach the tolerance. Rates ∂u/∂F that come from such a factor miss by as much, a tangent by its square.
SHARP = 0.01
REUSED = 3
# Least fall of the residual in a step.
FALL = 0.5


#: Parts of the work.
ASSEMBLY, FACTORISATION, CONDENSATION = "assembly", "factorisation", "condensation"


@dataclass(frozen=True)
class OrderedNetwork:
    """A network with its interior nodes in the order of elimination.

    network : as it is
    nodes : its number of the node at each place of the order, shape (n,)
    topology : for compiled code
    """

    network: Network
    nodes: NDArray[np.int64]
    topology: Topology

    @classmethod
    def of(cls, network: Network) -> Self:
        """The network, ordered so that factors of its Hessian have few blocks."""
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
        topology = Topology(
            *(network.fiber_vectors, network.fiber_lengths, tails, heads, pairs),
            *(elimination.starts, elimination.rows),
        )
        return cls(network, nodes, topology)


@dataclass(frozen=True)
class Relaxed:
    """What became of eight networks; only what converged has a stress and a tangent.

    stress : P = Σ f ⊗ D, shape (3, 3, 8), kA/edge²; tangent : ∂P/∂F along equilibria, shape (9, 9, 8), kA/edge²
    status : `CONVERGED`, `INDEFINITE` or `STUCK`; steps : of Newton's method
    residual : ‖r‖/(√n max(1, f_rms)) with n interior nodes and forces in kA; all shape (8,)
    """

    stress: Array
    tangent: Array
    status: Count
    steps: Count
    residual: Array


def relax(
    ordered: OrderedNetwork,
    law: FiberLaw,
    tolerance: float,
    F: Array,
    u: Array,
    G: Single,
    with_rates: bool,
    least_pivot: float = 0.0,
    clock: Clock | None = None,
) -> Relaxed:
    """Bring eight networks to equilibrium, each at its F, shape (3, 3, 8), from predictions of u and G, in place.

    u, shape (≥ n + 1, 3, 8), becomes the fluctuation, and G, shape (≥ n + 1, 3, 9, 8), its rate ∂u/∂F where
    `with_rates` says so; else the G given makes the tangent, in which an error of it is squared. Every pivot of a
    Hessian must be more than its share `least_pivot` of the diagonal element that it came from.

    `clock` counts CPU seconds: of forces and Hessians (`assembly`), of the `factorisation` with the solution for a
    move, and of the `condensation` with the rates.
    """
    clock = clock or Clock()
    topology, size, count = ordered.topology, len(ordered.nodes), len(ordered.topology.lengths)
    d, stiffness, residual = np.empty((count, 3, LANES)), np.empty((count, 2, LANES)), np.empty((size + 1, 3, LANES))
    factor, sums, slack = np.empty((len(topology.rows), 9, LANES)), np.empty((2, LANES)), np.empty((1, LANES))
    constants = (law.nonlinearity, law.linear_beyond)
    status, steps = np.full(LANES, RUNNING), np.zeros(LANES, dtype=np.int64)
    before, factored = np.full(LANES, np.inf), False
    # A trial may leave the range of floats; it is given up for that.
    with np.errstate(all="ignore"):
        while True:
            with clock.of(ASSEMBLY):
                kernels.pull(topology, constants, F, u, d, stiffness, residual, sums)
            norm, bound = np.sqrt(sums[0]), np.sqrt(size) * np.maximum(1.0, np.sqrt(sums[1] / count))
            good, shrunk = norm <= tolerance * bound, norm / before
            lost = ~np.isfinite(norm + bound) | (((shrunk > FALL) | (steps == MOST_STEPS)) & ~good)
            status[(status == RUNNING) & lost] = STUCK
            if factored:
                status[(status == RUNNING) & good] = CONVERGED
            slow = (shrunk > SHARP) | (norm * shrunk**REUSED > tolerance * bound)
            if (status == RUNNING).any() and (not factored or (slow & (status == RUNNING)).any()):
                with clock.of(ASSEMBLY):
                    kernels.assemble(topology, d, stiffness, factor)
                with clock.of(FACTORISATION):
                    factorize(topology.starts, topology.rows, factor, least_pivot, slack)
                factored = True
                status[(status != STUCK) & ~(slack[0] > 0.0)] = INDEFINITE
                status[(status == RUNNING) & good] = CONVERGED
            running = status == RUNNING
            if not running.any():
                break
            move = residual[:size, :, None].copy()
            with clock.of(FACTORISATION):
                solve(topology.starts, topology.rows, factor, move)
            move *= running
            u[:size] -= move[:, :, 0]
            status[running & (np.abs(move).max(axis=(0, 1, 2)) > LARGEST_MOVE)] = STUCK
            steps += running
            before = norm
        with clock.of(CONDENSATION):
            if with_rates:
                right = np.empty((size, 3, 9, LANES))
                kernels.couple(topology, d, stiffness, right)
                solve(topology.starts, topology.rows, factor, right)
                G[:size] = right
            P, A = np.empty((3, 3, LANES)), np.empty((9, 9, LANES))
            kernels.condense(topology, d, stiffness, G, P, A)
        return Relaxed(P, A, status, steps, norm / np.maximum(bound, 1e-300))
