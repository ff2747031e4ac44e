"""Newton's method for eight networks of one topology at a time, with tangents by static condensation; compiled.

This is the quick way along a path of stable states: it starts from a prediction, takes full steps, and gives a network
up at the first sign of trouble (a Hessian that is not positive definite, a residual that does not fall, a step too
long). What to do then is known to `equilibrium`. Nothing here holds Python's lock, so threads work side by side.

A state is accepted where the residual is within tolerance and the Hessian is positive definite, at the state or where
the last factor was made; with an old factor a step must shrink the residual at least tenfold, which it could not beside
a direction of negative stiffness.

Index convention as in `kernels`, with lanes as the last axis and nodes in the order of `Elimination`; further, a pair
(k, L) of F's indices is one index p = 3 k + L, so that rates ∂u_i/∂F_kL of a node have shape (3, 9, lanes).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fibrous.networks.elimination import Elimination, factorize, solve
from fibrous.networks.lanes import LANES, exponential, least, load, magnitude, spread, square_root, store
from fibrous.networks.network import Network

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Count = NDArray[np.int64]

#: What became of a network.
RUNNING, CONVERGED, INDEFINITE, STUCK = -1, 0, 1, 2
# Newton steps; a start that needs more is no prediction.
MOST_STEPS = 20
# A factor is used again where the last step shrank the residual at least to this part, and this many steps as good as
# the last would reach the tolerance.
TENFOLD = 0.1
REUSED = 3
# Least fall of the residual in a step.
FALL = 0.5


class Topology(NamedTuple):
    """A network as compiled code takes it, with its nodes in the order of elimination.

    reference : end-to-end vectors D at rest, shape (fibers, 3), edges; lengths : theirs, shape (fibers,), edges
    tails, heads : places of the ends, n for a boundary node, shape (fibers,)
    pairs : block of the Hessian that belongs to both ends, −1 where one is on the boundary, shape (fibers,)
    starts, rows : of `Elimination`
    """

    reference: Array
    lengths: Array
    tails: NDArray[np.int32]
    heads: NDArray[np.int32]
    pairs: NDArray[np.int32]
    starts: NDArray[np.int32]
    rows: NDArray[np.int32]


@dataclass(frozen=True)
class Ordered:
    """A network with its nodes in the order of elimination.

    topology : for compiled code
    nodes : the network's number of the node at each place of the order, shape (n,)
    """

    topology: Topology
    nodes: NDArray[np.int64]

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
        return cls(topology, nodes)


@njit(cache=True, nogil=True)
def _pull(
    topology: Topology,
    law: tuple[float, float],
    F: Array,
    u: Array,
    d: Array,
    stiffness: Array,
    residual: Array,
    sums: Array,
) -> None:
    """Forces at F, (3, 3, lanes), and u, (≥ n + 1, 3, lanes).

    Fills end-to-end vectors d, (fibers, 3, lanes), tension and axial part of the fibres' blocks, (fibers, 2, lanes), the
    residual, (n + 1, 3, lanes), and in `sums`, (2, lanes), the sums of squares of the residual and of the fibre forces.
    """
    B, linear_beyond = law
    size = len(topology.starts) - 1
    residual[:] = 0.0
    forces = spread(0.0)
    for m in range(len(topology.lengths)):
        tail, head, length = topology.tails[m], topology.heads[m], topology.lengths[m]
        D0, D1, D2 = topology.reference[m, 0], topology.reference[m, 1], topology.reference[m, 2]
        square = spread(0.0)
        for i in range(3):
            x = load(u, (head, i)) - load(u, (tail, i))
            x = x + load(F, (i, 0)) * D0 + load(F, (i, 1)) * D1 + load(F, (i, 2)) * D2
            store(d, (m, i), x)
            square = square + x * x
        current = square_root(square)
        stretch = current * (1.0 / length)
        cut = least(stretch, linear_beyond)
        growth = exponential(0.5 * B * (cut * cut - 1.0))
        slope = cut * growth
        force = (growth - 1.0) * (1.0 / B) + slope * (stretch - cut)
        tension = force / current
        store(stiffness, (m, 0), tension)
        store(stiffness, (m, 1), (slope * (1.0 / length) - tension) / square)
        forces = forces + force * force
        for i in range(3):
            pulled = tension * load(d, (m, i))
            store(residual, (head, i), load(residual, (head, i)) + pulled)
            store(residual, (tail, i), load(residual, (tail, i)) - pulled)
    total = spread(0.0)
    for a in range(size):
        for i in range(3):
            total = total + load(residual, (a, i)) * load(residual, (a, i))
    store(sums, (0,), total)
    store(sums, (1,), forces)


@njit(cache=True, nogil=True)
def _assemble(topology: Topology, d: Array, stiffness: Array, blocks: Array) -> None:
    """Fill the blocks of the Hessians, (blocks, 9, lanes), of which the nodes' own are symmetric."""
    size = len(topology.starts) - 1
    blocks[:] = 0.0
    for m in range(len(topology.lengths)):
        tail, head, pair = topology.tails[m], topology.heads[m], topology.pairs[m]
        tension, axial = load(stiffness, (m, 0)), load(stiffness, (m, 1))
        for i in range(3):
            along = axial * load(d, (m, i))
            for j in range(3):
                entry = along * load(d, (m, j))
                if i == j:
                    entry = entry + tension
                if tail < size:
                    own = topology.starts[tail]
                    store(blocks, (own, 3 * i + j), load(blocks, (own, 3 * i + j)) + entry)
                if head < size:
                    own = topology.starts[head]
                    store(blocks, (own, 3 * i + j), load(blocks, (own, 3 * i + j)) + entry)
                if pair >= 0:
                    store(blocks, (pair, 3 * i + j), load(blocks, (pair, 3 * i + j)) - entry)


@njit(cache=True, nogil=True)
def _couple(topology: Topology, d: Array, stiffness: Array, right: Array) -> None:
    """Fill `right`, (n, 3, 9, lanes), with −K_uF: a unit rate of F_kL pulls with B_ik D_L, B = tension I + axial d ⊗ d."""
    size = len(topology.starts) - 1
    right[:] = 0.0
    for m in range(len(topology.lengths)):
        tail, head = topology.tails[m], topology.heads[m]
        tension, axial = load(stiffness, (m, 0)), load(stiffness, (m, 1))
        for i in range(3):
            along = axial * load(d, (m, i))
            for k in range(3):
                entry = along * load(d, (m, k))
                if i == k:
                    entry = entry + tension
                for L in range(3):
                    pulled = entry * topology.reference[m, L]
                    p = 3 * k + L
                    if tail < size:
                        store(right, (tail, i, p), load(right, (tail, i, p)) + pulled)
                    if head < size:
                        store(right, (head, i, p), load(right, (head, i, p)) - pulled)


@njit(cache=True, nogil=True)
def _condense(topology: Topology, d: Array, stiffness: Array, G: Single, P: Array, A: Array) -> None:
    """Fill P = Σ f ⊗ D, (3, 3, lanes), and A = Σ wᵀ B w, (9, 9, lanes), with w = ∂d/∂F = δ D + G_head − G_tail.

    A is the energy's second rate when the nodes move at the rates G, and least where they keep the balance: exact rates
    make it the condensed tangent K_FF − K_Fu K_uu⁻¹ K_uF, and an error in them enters squared.
    """
    w = np.empty((36, LANES))
    P[:] = 0.0
    A[:] = 0.0
    for m in range(len(topology.lengths)):
        tail, head = topology.tails[m], topology.heads[m]
        tension, axial = load(stiffness, (m, 0)), load(stiffness, (m, 1))
        d0, d1, d2 = load(d, (m, 0)), load(d, (m, 1)), load(d, (m, 2))
        for i in range(3):
            for p in range(9):
                store(w, (9 * i + p,), load(G, (head, i, p)) - load(G, (tail, i, p)))
            pulled = tension * load(d, (m, i))
            for L in range(3):
                D = topology.reference[m, L]
                store(w, (12 * i + L,), load(w, (12 * i + L,)) + D)
                store(P, (i, L), load(P, (i, L)) + pulled * D)
        for p in range(9):
            store(w, (27 + p,), d0 * load(w, (p,)) + d1 * load(w, (9 + p,)) + d2 * load(w, (18 + p,)))
        for p in range(9):
            v0, v1, v2 = tension * load(w, (p,)), tension * load(w, (9 + p,)), tension * load(w, (18 + p,))
            v3 = axial * load(w, (27 + p,))
            for q in range(p, 9):
                rate = v0 * load(w, (q,)) + v1 * load(w, (9 + q,)) + v2 * load(w, (18 + q,)) + v3 * load(w, (27 + q,))
                store(A, (p, q), load(A, (p, q)) + rate)
    for p in range(9):
        for q in range(p):
            store(A, (p, q), load(A, (q, p)))


@njit(cache=True, nogil=True)
def predict(size: int, F: Array, from_F: Array, from_u: Array, from_G: Single, u: Array) -> None:
    """Fill u, (≥ n + 1, 3, lanes), with the tangent's u + ∂u/∂F : ΔF at F, (3, 3, lanes)."""
    u[:] = 0.0
    for a in range(size):
        for i in range(3):
            moved = load(from_u, (a, i))
            for p in range(9):
                change = load(F, (p // 3, p % 3)) - load(from_F, (p // 3, p % 3))
                moved = moved + load(from_G, (a, i, p)) * change
            store(u, (a, i), moved)


@njit(cache=True, nogil=True)
def add_bend(size: int, F: Array, from_F: Array, increment: Array, bend: Single, u: Array) -> None:
    """Add to u the second and third order of the path that led to `from_F` by `increment`, (3, 3, lanes).

    They belong to the share t = ΔF : increment / increment : increment of it in the way to F.
    """
    square, along = spread(1e-300), spread(0.0)
    for i in range(3):
        for j in range(3):
            step = load(increment, (i, j))
            square = square + step * step
            along = along + step * (load(F, (i, j)) - load(from_F, (i, j)))
    t = along / square
    for a in range(size):
        for i in range(3):
            further = t * t * (load(bend, (0, a, i)) + t * load(bend, (1, a, i)))
            store(u, (a, i), load(u, (a, i)) + further)


@njit(cache=True, nogil=True)
def find_bend(
    size: int, F: Array, u: Array, G: Single, from_F: Array, from_u: Array, from_G: Single, bend: Single
) -> None:
    """Fill the coefficients of t² and t³, (2, ≥ n + 1, 3, lanes), of the cubic through two states and their rates.

    It is u + t ∂u/∂F : ΔF + t² bend₀ + t³ bend₁ with t = 0 at F and −1 at `from_F`.
    """
    bend[:] = 0.0
    for a in range(size):
        for i in range(3):
            here, there = spread(0.0), spread(0.0)
            for p in range(9):
                change = load(F, (p // 3, p % 3)) - load(from_F, (p // 3, p % 3))
                here = here + load(G, (a, i, p)) * change
                there = there + load(from_G, (a, i, p)) * change
            missed = load(from_u, (a, i)) - load(u, (a, i)) + here
            store(bend, (0, a, i), 3.0 * missed + (there - here))
            store(bend, (1, a, i), 2.0 * missed + (there - here))


@njit(cache=True, nogil=True)
def relax(
    topology: Topology,
    law: tuple[float, float],
    tolerance: float,
    farthest: float,
    least_pivot: float,
    F: Array,
    u: Array,
    G: Single,
    with_rates: bool,
    P: Array,
    A: Array,
    residuals: Array,
    counts: Count,
) -> None:
    """Bring eight networks to equilibrium, each at its F, (3, 3, lanes), from predictions of u and G.

    Fills u, (≥ n + 1, 3, lanes), P, (3, 3, lanes), A, (9, 9, lanes), the relative residuals, (lanes,), and `counts`,
    (2, lanes), with what became of the networks and their Newton steps; G, (≥ n + 1, 3, 9, lanes), too where
    `with_rates` says so. `farthest` is the longest step of a node along an axis, `least_pivot` as in `factorize`.
    """
    count, size = len(topology.lengths), len(topology.starts) - 1
    d, stiffness = np.empty((count, 3, LANES)), np.empty((count, 2, LANES))
    residual, move = np.empty((size + 1, 3, LANES)), np.empty((size, 3, 1, LANES))
    factor = np.empty((len(topology.rows), 9, LANES))
    sums, slack, longest, running = np.empty((2, LANES)), np.empty((1, LANES)), np.empty((1, LANES)), np.ones((1, LANES))
    before, limit = np.full(LANES, np.inf), np.empty(LANES)
    status, steps = counts[0], counts[1]
    status[:], steps[:] = RUNNING, 0
    factored = False
    while True:
        _pull(topology, law, F, u, d, stiffness, residual, sums)
        stale = not factored
        for q in range(LANES):
            if status[q] != RUNNING:
                continue
            norm = np.sqrt(sums[0, q])
            bound = np.sqrt(size) * max(1.0, np.sqrt(sums[1, q] / count))
            limit[q] = tolerance * bound
            residuals[q] = norm / max(bound, 1e-300)
            shrunk = norm / before[q]
            if not np.isfinite(norm + sums[1, q]) or shrunk > FALL or steps[q] == MOST_STEPS:
                status[q] = STUCK
            elif norm <= limit[q] and factored:
                status[q] = CONVERGED
            elif shrunk > TENFOLD or norm * shrunk**REUSED > limit[q]:
                stale = True
            sums[0, q] = norm
        if stale and (status == RUNNING).any():
            _assemble(topology, d, stiffness, factor)
            factorize(topology.starts, topology.rows, factor, least_pivot, slack)
            factored = True
            for q in range(LANES):
                if status[q] != STUCK and not slack[0, q] > 0.0:
                    status[q] = INDEFINITE
                elif status[q] == RUNNING and sums[0, q] <= limit[q]:
                    status[q] = CONVERGED
        if not (status == RUNNING).any():
            break
        for q in range(LANES):
            running[0, q] = 1.0 if status[q] == RUNNING else 0.0
            before[q] = sums[0, q]
            if status[q] == RUNNING:
                steps[q] += 1
        for a in range(size):
            for i in range(3):
                store(move, (a, i, 0), load(residual, (a, i)))
        solve(topology.starts, topology.rows, factor, move)
        shortest = spread(0.0)
        for a in range(size):
            for i in range(3):
                step = load(move, (a, i, 0)) * load(running, (0,))
                shortest = least(-1.0 * magnitude(step), shortest)
                store(u, (a, i), load(u, (a, i)) - step)
        store(longest, (0,), -1.0 * shortest)
        for q in range(LANES):
            if status[q] == RUNNING and longest[0, q] > farthest:
                status[q] = STUCK
    if with_rates and size > 0:
        right = np.empty((size, 3, 9, LANES))
        _couple(topology, d, stiffness, right)
        solve(topology.starts, topology.rows, factor, right)
        for a in range(size):
            for i in range(3):
                for p in range(9):
                    store(G, (a, i, p), load(right, (a, i, p)))
    _condense(topology, d, stiffness, G, P, A)
