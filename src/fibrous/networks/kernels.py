"""Compiled loops over the fibres of eight networks of one topology: forces, Hessians, condensation, prediction.

Fibre m runs from node ``tails[m]`` to node ``heads[m]``; interior nodes are numbered 0 … n − 1 in the order of
`Elimination`, and every boundary node is n, whose displacement is zero. A fibre's stiffness block is
``tension I + axial d ⊗ d`` with d its current end-to-end vector. Lanes are the last axis of every array. A pair (k, L)
of F's indices is one index p = 3 k + L, so that rates ∂u_i/∂F_kL of a node have shape (3, 9, lanes). Nothing here holds
Python's lock, so threads work side by side.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fibrous.compiled import njit
from fibrous.networks.fiber_law import FIRST, SECOND, SECTION, Fibers, energy, respond
from fibrous.networks.lanes import LANES, choose, least, load, magnitude, spread, square_root, store

Array = NDArray[np.float64]
Single = NDArray[np.float32]

# Steps, in the length of the step before, over which a cubic through the last two states still predicts.
LONGEST = 4.0


class Topology(NamedTuple):
    """A network as compiled code takes it, with its nodes in the order of elimination.

    reference : end-to-end vectors D of the network as it is given, shape (fibers, 3), edges
    tails, heads : places of the ends, n for a boundary node, shape (fibers,)
    pairs : block of the Hessian that belongs to both ends, −1 where one is on the boundary, shape (fibers,)
    starts, rows, leaders : of `Elimination`
    """

    reference: Array
    tails: NDArray[np.int32]
    heads: NDArray[np.int32]
    pairs: NDArray[np.int32]
    starts: NDArray[np.int32]
    rows: NDArray[np.int32]
    leaders: NDArray[np.int32]


@njit(nogil=True, error_model="numpy")
def pull(
    topology: Topology,
    fibers: Fibers,
    F: Array,
    u: Array,
    d: Array,
    stiffness: Array,
    residual: Array,
    sums: Array,
) -> None:
    """Forces at F, (3, 3, lanes), and u, (≥ n + 1, 3, lanes), in fibres of a law.

    Fills end-to-end vectors d, (fibers, 3, lanes), tension and axial part of the fibres' blocks, (fibers, 2, lanes),
    the residual, (n + 1, 3, lanes), and in `sums`, (2, lanes), the squares of the residual and of the fibre forces.
    """
    size = len(topology.starts) - 1
    kind, lengths, constants = fibers
    residual[:] = 0.0
    forces = spread(0.0)
    for m in range(len(lengths)):
        c = min(m, len(constants) - 1)
        tail, head = topology.tails[m], topology.heads[m]
        D0, D1, D2 = topology.reference[m, 0], topology.reference[m, 1], topology.reference[m, 2]
        square = spread(0.0)
        for i in range(3):
            x = load(u, (head, i)) - load(u, (tail, i))
            x = x + load(F, (i, 0)) * D0 + load(F, (i, 1)) * D1 + load(F, (i, 2)) * D2
            store(d, (m, i), x)
            square = square + x * x
        current = square_root(square)
        shorten = 1.0 / lengths[m]
        force, slope = respond(kind, current * shorten, constants[c, FIRST], constants[c, SECOND])
        force = force * constants[c, SECTION]
        tension = force / current
        store(stiffness, (m, 0), tension)
        store(stiffness, (m, 1), (slope * (shorten * constants[c, SECTION]) - tension) / square)
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


@njit(nogil=True, error_model="numpy")
def homogenize(topology: Topology, fibers: Fibers, d: Array, stiffness: Array, sums: Array) -> None:
    """Fill `sums`, (19, lanes), with W, the nine of P = Σ f ⊗ D and the nine of h = Σ l n ⊗ n / Σ l."""
    kind, rest_lengths, constants = fibers
    for p in range(19):
        store(sums, (p,), 0.0)
    lengths = spread(0.0)
    for m in range(len(rest_lengths)):
        c = min(m, len(constants) - 1)
        tension = load(stiffness, (m, 0))
        square = load(d, (m, 0)) * load(d, (m, 0)) + load(d, (m, 1)) * load(d, (m, 1))
        current = square_root(square + load(d, (m, 2)) * load(d, (m, 2)))
        lengths = lengths + current
        shorten = 1.0 / current
        stretch = current * (1.0 / rest_lengths[m])
        stored = energy(kind, stretch, constants[c, FIRST], constants[c, SECOND])
        store(sums, (0,), load(sums, (0,)) + stored * (constants[c, SECTION] * rest_lengths[m]))
        for i in range(3):
            pulled, turned = tension * load(d, (m, i)), shorten * load(d, (m, i))
            for j in range(3):
                p = 1 + 3 * i + j
                store(sums, (p,), load(sums, (p,)) + pulled * topology.reference[m, j])
                store(sums, (9 + p,), load(sums, (9 + p,)) + turned * load(d, (m, j)))
    for p in range(10, 19):
        store(sums, (p,), load(sums, (p,)) / lengths)


@njit(nogil=True, error_model="numpy")
def stored_energy(topology: Topology, fibers: Fibers, F: Array, u: Array, lane: int) -> float:
    """Energy of one lane at F, (3, 3, lanes), and u, (≥ n + 1, 3, lanes): eight of its fibres at a time."""
    kind, rest_lengths, constants = fibers
    numbers = np.ones((3, LANES))
    total = 0.0
    for first in range(0, len(rest_lengths), LANES):
        many = min(LANES, len(rest_lengths) - first)
        for p in range(many):
            m = first + p
            c = min(m, len(constants) - 1)
            tail, head = topology.tails[m], topology.heads[m]
            square = 0.0
            for i in range(3):
                x = u[head, i, lane] - u[tail, i, lane]
                for j in range(3):
                    x += F[i, j, lane] * topology.reference[m, j]
                square += x * x
            numbers[0, p] = np.sqrt(square) / rest_lengths[m]
            numbers[1, p], numbers[2, p] = constants[c, FIRST], constants[c, SECOND]
        stored = energy(kind, load(numbers, (0,)), load(numbers, (1,)), load(numbers, (2,)))
        store(numbers, (0,), stored)
        for p in range(many):
            c = min(first + p, len(constants) - 1)
            total += numbers[0, p] * constants[c, SECTION] * rest_lengths[first + p]
    return total


@njit(nogil=True, error_model="numpy")
def spread_lane(lane: int, source: Array, target: Array) -> None:
    """Fill all lanes of `target`, (n, m, lanes), with one lane of `source`, (≥ n, m, lanes)."""
    for a in range(len(target)):
        for i in range(target.shape[1]):
            store(target, (a, i), source[a, i, lane])


@njit(nogil=True, error_model="numpy")
def soften(d: Array, stiffness: Array, fraction: Array, softened: Array) -> None:
    """Fill `softened`, (fibers, 2, lanes), with blocks that lack a fraction, (1, lanes), of negative tension.

    What is left out across compressed fibres stays along them: with 1 the Hessian is positive semidefinite.
    """
    left_out = load(fraction, (0,))
    for m in range(len(d)):
        square = load(d, (m, 0)) * load(d, (m, 0)) + load(d, (m, 1)) * load(d, (m, 1))
        square = square + load(d, (m, 2)) * load(d, (m, 2))
        tension = load(stiffness, (m, 0))
        removed = left_out * least(tension, 0.0)
        store(softened, (m, 0), tension - removed)
        store(softened, (m, 1), load(stiffness, (m, 1)) + removed / square)


@njit(nogil=True, error_model="numpy")
def assemble(topology: Topology, d: Array, stiffness: Array, blocks: Array) -> None:
    """Fill the blocks of the Hessians, (blocks, 9, lanes), of which the nodes' own are symmetric."""
    size = len(topology.starts) - 1
    blocks[:] = 0.0
    for m in range(len(stiffness)):
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


@njit(nogil=True, error_model="numpy")
def couple(topology: Topology, d: Array, stiffness: Array, right: Array) -> None:
    """Fill `right`, (n, 3, 9, lanes), with −K_uF.

    A unit rate of F_kL pulls with the force B_ik D_L, where B = tension I + axial d ⊗ d.
    """
    size = len(topology.starts) - 1
    right[:] = 0.0
    for m in range(len(stiffness)):
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


@njit(nogil=True, error_model="numpy")
def couple_along(topology: Topology, d: Array, stiffness: Array, change: Array, right: Array, column: int) -> None:
    """Fill right[:, :, column], of (n, 3, m, lanes), with −K_uF : ΔF for a change of F, (3, 3, lanes)."""
    size = len(topology.starts) - 1
    for a in range(size):
        for i in range(3):
            store(right, (a, i, column), 0.0)
    moved = np.empty((3, LANES))
    for m in range(len(stiffness)):
        tail, head = topology.tails[m], topology.heads[m]
        along = spread(0.0)
        for i in range(3):
            x = load(change, (i, 0)) * topology.reference[m, 0] + load(change, (i, 1)) * topology.reference[m, 1]
            x = x + load(change, (i, 2)) * topology.reference[m, 2]
            store(moved, (i,), x)
            along = along + x * load(d, (m, i))
        along = along * load(stiffness, (m, 1))
        for i in range(3):
            pulled = load(stiffness, (m, 0)) * load(moved, (i,)) + along * load(d, (m, i))
            if tail < size:
                store(right, (tail, i, column), load(right, (tail, i, column)) + pulled)
            if head < size:
                store(right, (head, i, column), load(right, (head, i, column)) - pulled)


@njit(nogil=True, error_model="numpy")
def condense(topology: Topology, d: Array, stiffness: Array, G: Single, P: Array, A: Array) -> None:
    """Fill P = Σ f ⊗ D, (3, 3, lanes), and A = Σ wᵀ B w, (9, 9, lanes), with w = ∂d/∂F = δ D + G_head − G_tail.

    A is the energy's second derivative when the nodes move at the rates G, and least where they keep the balance: exact
    rates make it the condensed tangent K_FF − K_Fu K_uu⁻¹ K_uF, and an error in them enters squared.
    """
    w = np.empty((36, LANES))
    P[:] = 0.0
    A[:] = 0.0
    for m in range(len(stiffness)):
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
        # Three columns at a time, whose w stay in the registers; entries below the diagonal blocks come in the end.
        for q in range(0, 9, 3):
            w00, w10, w20, w30 = load(w, (q,)), load(w, (9 + q,)), load(w, (18 + q,)), load(w, (27 + q,))
            w01, w11, w21, w31 = load(w, (q + 1,)), load(w, (10 + q,)), load(w, (19 + q,)), load(w, (28 + q,))
            w02, w12, w22, w32 = load(w, (q + 2,)), load(w, (11 + q,)), load(w, (20 + q,)), load(w, (29 + q,))
            for p in range(q + 3):
                v0, v1 = tension * load(w, (p,)), tension * load(w, (9 + p,))
                v2, v3 = tension * load(w, (18 + p,)), axial * load(w, (27 + p,))
                store(A, (p, q), load(A, (p, q)) + v0 * w00 + v1 * w10 + v2 * w20 + v3 * w30)
                store(A, (p, q + 1), load(A, (p, q + 1)) + v0 * w01 + v1 * w11 + v2 * w21 + v3 * w31)
                store(A, (p, q + 2), load(A, (p, q + 2)) + v0 * w02 + v1 * w12 + v2 * w22 + v3 * w32)
    for p in range(9):
        for q in range(p):
            store(A, (p, q), load(A, (q, p)))


@njit(nogil=True, error_model="numpy")
def dot(size: int, one: Array, other: Array, total: Array) -> None:
    """Fill `total`, (1, lanes), with the products of two fields of the first nodes, both (≥ size, 3, lanes)."""
    sum_ = spread(0.0)
    for a in range(size):
        for i in range(3):
            sum_ = sum_ + load(one, (a, i)) * load(other, (a, i))
    store(total, (0,), sum_)


@njit(nogil=True, error_model="numpy")
def begin_step(
    residual: Array,
    right: Array,
    ready: Array,
    largest: float,
    u: Array,
    start: Array,
    move: Array,
    slope: Array,
    farthest: Array,
) -> None:
    """Newton's step −`right`, (n, 3, 1, lanes), of the lanes where `ready`, (1, lanes), is 1, and of no others.

    A step is shortened where it would carry a node farther than `largest`. Fills `start` and `move`, (n, 3, lanes), the
    step's `slope`, (1, lanes), along the `residual`, (≥ n, 3, lanes), and moves u, (≥ n, 3, lanes). Fills `farthest`,
    (1, lanes), with the largest element of `right` in every lane.
    """
    most, moving = spread(0.0), load(ready, (0,))
    for a in range(len(right)):
        for i in range(3):
            size = magnitude(load(right, (a, i, 0)))
            most = choose(most, size, size, most)
    store(farthest, (0,), most)
    shorten = least(largest / most, 1.0)
    slopes = spread(0.0)
    for a in range(len(right)):
        for i in range(3):
            x = spread(0.0) - load(right, (a, i, 0)) * shorten
            slopes = slopes + x * load(residual, (a, i))
            store(move, (a, i), choose(moving, 0.5, load(move, (a, i)), x))
            store(start, (a, i), choose(moving, 0.5, load(start, (a, i)), load(u, (a, i))))
            store(u, (a, i), choose(moving, 0.5, load(u, (a, i)), load(u, (a, i)) + x))
    store(slope, (0,), choose(moving, 0.5, load(slope, (0,)), slopes))


@njit(nogil=True, error_model="numpy")
def predict(size: int, F: Array, from_F: Array, from_u: Array, from_G: Single, u: Array) -> None:
    """Fill the first n rows of u, (≥ n + 1, 3, lanes), with the tangent's u + ∂u/∂F : ΔF at F, (3, 3, lanes).

    The others are not touched: what was never written takes no memory.
    """
    for a in range(size):
        for i in range(3):
            moved = load(from_u, (a, i))
            for p in range(9):
                change = load(F, (p // 3, p % 3)) - load(from_F, (p // 3, p % 3))
                moved = moved + load(from_G, (a, i, p)) * change
            store(u, (a, i), moved)


@njit(nogil=True, error_model="numpy")
def add_bend(size: int, F: Array, from_F: Array, increment: Array, bend: Single, u: Array) -> None:
    """Add to u the second and third order of the path that led to `from_F` by `increment`, (3, 3, lanes).

    They belong to the fraction t = ΔF : increment / increment : increment of it in the way to F. Where that is many
    times the way so far, nothing is known of the bend, and rounding would grow.
    """
    fractions = np.zeros((1, LANES))
    for lane in range(LANES):
        square, along = 0.0, 0.0
        for i in range(3):
            for j in range(3):
                square += increment[i, j, lane] ** 2
                along += increment[i, j, lane] * (F[i, j, lane] - from_F[i, j, lane])
        if abs(along) <= LONGEST * square and square > 0.0:
            fractions[0, lane] = along / square
    t = load(fractions, (0,))
    for a in range(size):
        for i in range(3):
            further = t * t * (load(bend, (0, a, i)) + t * load(bend, (1, a, i)))
            store(u, (a, i), load(u, (a, i)) + further)


@njit(nogil=True, error_model="numpy")
def find_bend(
    size: int, F: Array, u: Array, G: Single, from_F: Array, from_u: Array, from_G: Single, bend: Single
) -> None:
    """Fill the first n rows of the coefficients of t² and t³, (2, ≥ n + 1, 3, lanes), of a cubic through two states.

    With their rates it is u + t ∂u/∂F : ΔF + t² bend₀ + t³ bend₁ with t = 0 at F and −1 at `from_F`.
    """
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
