"""Compiled loops over the fibres of eight networks of one topology: forces, Hessians, static condensation, prediction.

Index convention as in `kernels`, with lanes as the last axis and nodes in the order of `Elimination`; tails and heads
come as they are. A pair (k, L) of F's indices is one index p = 3 k + L, so that rates ∂u_i/∂F_kL of a node have shape
(3, 9, lanes). Nothing here holds Python's lock, so threads work side by side.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fibrous.compiled import njit
from fibrous.networks.lanes import LANES, exponential, least, load, spread, square_root, store

Array = NDArray[np.float64]
Single = NDArray[np.float32]

# Steps, in the length of the step before, over which a cubic through the last two states still predicts.
LONGEST = 4.0


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


@njit(nogil=True, error_model="numpy")
def pull(
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

    Fills end-to-end vectors d, (fibers, 3, lanes), tension and axial part of the fibres' blocks, (fibers, 2, lanes),
    the residual, (n + 1, 3, lanes), and in `sums`, (2, lanes), the squares of the residual and of the fibre forces.
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


@njit(nogil=True, error_model="numpy")
def assemble(topology: Topology, d: Array, stiffness: Array, blocks: Array) -> None:
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


@njit(nogil=True, error_model="numpy")
def couple(topology: Topology, d: Array, stiffness: Array, right: Array) -> None:
    """Fill `right`, (n, 3, 9, lanes), with −K_uF.

    A unit rate of F_kL pulls with the force B_ik D_L, where B = tension I + axial d ⊗ d.
    """
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


@njit(nogil=True, error_model="numpy")
def condense(topology: Topology, d: Array, stiffness: Array, G: Single, P: Array, A: Array) -> None:
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


@njit(nogil=True, error_model="numpy")
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


@njit(nogil=True, error_model="numpy")
def add_bend(size: int, F: Array, from_F: Array, increment: Array, bend: Single, u: Array) -> None:
    """Add to u the second and third order of the path that led to `from_F` by `increment`, (3, 3, lanes).

    They belong to the share t = ΔF : increment / increment : increment of it in the way to F. Where that is many times
    the way so far, nothing is known of the bend, and rounding would be blown up.
    """
    shares = np.zeros((1, LANES))
    for lane in range(LANES):
        square, along = 0.0, 0.0
        for i in range(3):
            for j in range(3):
                square += increment[i, j, lane] ** 2
                along += increment[i, j, lane] * (F[i, j, lane] - from_F[i, j, lane])
        if abs(along) <= LONGEST * square and square > 0.0:
            shares[0, lane] = along / square
    t = load(shares, (0,))
    for a in range(size):
        for i in range(3):
            further = t * t * (load(bend, (0, a, i)) + t * load(bend, (1, a, i)))
            store(u, (a, i), load(u, (a, i)) + further)


@njit(nogil=True, error_model="numpy")
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
