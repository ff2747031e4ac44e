"""Sparse Cholesky of the Hessians of eight networks of one topology at a time.

Nodes are eliminated in an order of minimum degree. Where the factor has 3 × 3 blocks depends on the topology alone and
is found once; the numbers of all eight networks stand in the lanes of one array, so that every index serves eight.

Blocks of a column stand one after the other: the node's own, then those of the nodes below in rising order. Entry
(i, j) of a block is number 3 i + j; of a factor's own blocks the diagonal holds reciprocals, and entries above it
nothing. All compiled functions take the index arrays `starts`, `rows` (see `Elimination`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, eye_array
from scipy.sparse.linalg import splu

from fibrous.compiled import njit
from fibrous.networks.lanes import least, load, magnitude, spread, square_root, store

Array = NDArray[np.float64]
Index = NDArray[np.int32]

# Pivots above this fraction of their diagonal element tell that a matrix near by is positive definite, too.
STEADY = 0.01


@dataclass(frozen=True)
class Elimination:
    """Where the factor of a network's Hessian has blocks.

    order : number, among the interior nodes, of the node at each place of the order, shape (n,)
    starts : first block of each place's column, and their total, shape (n + 1,)
    rows : place of each block's row, shape (blocks,)
    leaders : first of the columns in a row that have the same rows below them (a supernode), shape (n,)
    """

    order: NDArray[np.int64]
    starts: Index
    rows: Index
    leaders: Index

    @classmethod
    def of(cls, size: int, pairs: NDArray[np.int64]) -> Self:
        """The elimination of `size` nodes; `pairs`, shape (m, 2), are different nodes joined by fibres."""
        order = minimum_degree(size, pairs)
        place = np.argsort(order)
        low, high = np.sort(place[pairs], axis=1).T if len(pairs) else np.empty((2, 0), dtype=np.int64)
        keys = np.unique(low * max(size, 1) + high)
        low, high = np.divmod(keys, max(size, 1))
        first = np.searchsorted(low, np.arange(size + 1))
        starts, rows = _filled(first, high)
        return cls(order, starts, rows, _leaders(starts, rows))

    def block(self, row: NDArray[np.int64], column: NDArray[np.int64]) -> Index:
        """Numbers of the blocks at (row, column) with row ≥ column, all of which exist."""
        columns = np.repeat(np.arange(len(self.order)), np.diff(self.starts))
        size = max(len(self.order), 1)
        return np.searchsorted(columns * size + self.rows, column * size + row).astype(np.int32)


def minimum_degree(size: int, pairs: NDArray[np.int64]) -> NDArray[np.int64]:
    """Order of nodes, shape (size,), in which each has nearly the fewest neighbours when its turn comes (SuperLU's)."""
    if size < 2:
        return np.arange(size)
    graph = coo_array((np.full(len(pairs), -1.0), pairs.T), shape=(size, size))
    matrix = csc_array(graph + graph.T + 2.0 * len(pairs) * eye_array(size) + eye_array(size))
    factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return np.argsort(factor.perm_c)


@njit()
def _filled(first: NDArray[np.int64], neighbors: NDArray[np.int64]) -> tuple[Index, Index]:
    """`starts` and `rows` of the factor: below its diagonal a column has its own rows and those of its children."""
    size = len(first) - 1
    below = np.zeros((size, size), dtype=np.bool_)
    starts = np.zeros(size + 1, dtype=np.int32)
    for j in range(size):
        below[j, j] = True
        for m in range(first[j], first[j + 1]):
            below[j, neighbors[m]] = True
        parent = -1
        count = 0
        for i in range(j, size):
            if below[j, i]:
                count += 1
                if i > j and parent < 0:
                    parent = i
                if parent >= 0:
                    below[parent, i] = True
        starts[j + 1] = starts[j] + count
    rows = np.empty(starts[size], dtype=np.int32)
    at = 0
    for j in range(size):
        for i in range(j, size):
            if below[j, i]:
                rows[at] = i
                at += 1
    return starts, rows


@njit()
def _leaders(starts: Index, rows: Index) -> Index:
    """A column goes with the one before if that has it for its first row below, and as many rows as it in all."""
    leaders = np.arange(len(starts) - 1, dtype=np.int32)
    for j in range(1, len(leaders)):
        above = starts[j] - starts[j - 1]
        if above == starts[j + 1] - starts[j] + 1 and rows[starts[j - 1] + 1] == j:
            leaders[j] = leaders[j - 1]
    return leaders


@njit(nogil=True, error_model="numpy")
def _give(rows: Index, place: Index, blocks: Array, first: int, count: int) -> None:
    """Subtract L_b L_firstᵀ from the blocks at `place` for `count` blocks b of a column, from `first` on."""
    w0, w1, w2 = load(blocks, (first, 0)), load(blocks, (first, 1)), load(blocks, (first, 2))
    w3, w4, w5 = load(blocks, (first, 3)), load(blocks, (first, 4)), load(blocks, (first, 5))
    w6, w7, w8 = load(blocks, (first, 6)), load(blocks, (first, 7)), load(blocks, (first, 8))
    for b in range(first, first + count):
        c = place[rows[b]]
        for i in range(0, 9, 3):
            x0, x1, x2 = load(blocks, (b, i)), load(blocks, (b, i + 1)), load(blocks, (b, i + 2))
            store(blocks, (c, i), load(blocks, (c, i)) - x0 * w0 - x1 * w1 - x2 * w2)
            store(blocks, (c, i + 1), load(blocks, (c, i + 1)) - x0 * w3 - x1 * w4 - x2 * w5)
            store(blocks, (c, i + 2), load(blocks, (c, i + 2)) - x0 * w6 - x1 * w7 - x2 * w8)


@njit(nogil=True, error_model="numpy")
def _give_two(rows: Index, place: Index, blocks: Array, first: int, second: int, count: int) -> None:
    """`_give` for two columns of a supernode at once: what receives is loaded and stored once."""
    w0, w1, w2 = load(blocks, (first, 0)), load(blocks, (first, 1)), load(blocks, (first, 2))
    w3, w4, w5 = load(blocks, (first, 3)), load(blocks, (first, 4)), load(blocks, (first, 5))
    w6, w7, w8 = load(blocks, (first, 6)), load(blocks, (first, 7)), load(blocks, (first, 8))
    v0, v1, v2 = load(blocks, (second, 0)), load(blocks, (second, 1)), load(blocks, (second, 2))
    v3, v4, v5 = load(blocks, (second, 3)), load(blocks, (second, 4)), load(blocks, (second, 5))
    v6, v7, v8 = load(blocks, (second, 6)), load(blocks, (second, 7)), load(blocks, (second, 8))
    for m in range(count):
        b, a = first + m, second + m
        c = place[rows[b]]
        for i in range(0, 9, 3):
            x0, x1, x2 = load(blocks, (b, i)), load(blocks, (b, i + 1)), load(blocks, (b, i + 2))
            y0, y1, y2 = load(blocks, (a, i)), load(blocks, (a, i + 1)), load(blocks, (a, i + 2))
            z0 = load(blocks, (c, i)) - x0 * w0 - x1 * w1 - x2 * w2
            z1 = load(blocks, (c, i + 1)) - x0 * w3 - x1 * w4 - x2 * w5
            z2 = load(blocks, (c, i + 2)) - x0 * w6 - x1 * w7 - x2 * w8
            store(blocks, (c, i), z0 - y0 * v0 - y1 * v1 - y2 * v2)
            store(blocks, (c, i + 1), z1 - y0 * v3 - y1 * v4 - y2 * v5)
            store(blocks, (c, i + 2), z2 - y0 * v6 - y1 * v7 - y2 * v8)


@njit(nogil=True, error_model="numpy")
def _give_all(starts: Index, rows: Index, place: Index, blocks: Array, leader: int, end: int, count: int) -> None:
    """What the columns of a supernode from `leader` up to `end` subtract with the last `count` blocks of each."""
    k = leader
    while k + 1 < end:
        _give_two(rows, place, blocks, starts[k + 1] - count, starts[k + 2] - count, count)
        k += 2
    if k < end:
        _give(rows, place, blocks, starts[k + 1] - count, count)


@njit(nogil=True, error_model="numpy")
def factorize(starts: Index, rows: Index, leaders: Index, blocks: Array, least_pivot: float, slack: Array) -> None:
    """Cholesky factors in place of matrices, (blocks, 9, lanes); `slack`, (2, lanes), is above 0 where they exist.

    They exist where every pivot is more than its fraction `least_pivot` of the diagonal element that it came from. The
    second row is above 0 where every pivot is more than the fraction STEADY.
    `factorize_reference` says the same in NumPy, for one matrix.
    """
    size = len(starts) - 1
    place = np.empty(size, dtype=np.int32)
    # Supernodes that still have something to give, chained by the next row they give to; how many blocks are left, and
    # where a supernode ends.
    chain, following = np.full(size, -1), np.full(size, -1)
    left, ends = np.empty(size, dtype=np.int32), np.empty(size, dtype=np.int32)
    room, steady = spread(np.inf), spread(np.inf)
    for j in range(size):
        own, end, leader = starts[j], starts[j + 1], leaders[j]
        a00, a11, a22 = load(blocks, (own, 0)), load(blocks, (own, 4)), load(blocks, (own, 8))
        a00, a11, a22 = magnitude(a00), magnitude(a11), magnitude(a22)
        for b in range(own, end):
            place[rows[b]] = b
        k = chain[j]
        while k >= 0:
            after, count = following[k], left[k]
            _give_all(starts, rows, place, blocks, k, ends[k], count)
            if count > 1:
                left[k] = count - 1
                row = rows[starts[ends[k]] - count + 1]
                following[k] = chain[row]
                chain[row] = k
            k = after
        _give_all(starts, rows, place, blocks, leader, j, end - own)
        p0 = load(blocks, (own, 0))
        room, steady = least(p0 - least_pivot * a00, room), least(p0 - STEADY * a00, steady)
        d0 = 1.0 / square_root(p0)
        l10, l20 = load(blocks, (own, 3)) * d0, load(blocks, (own, 6)) * d0
        p1 = load(blocks, (own, 4)) - l10 * l10
        room, steady = least(p1 - least_pivot * a11, room), least(p1 - STEADY * a11, steady)
        d1 = 1.0 / square_root(p1)
        l21 = (load(blocks, (own, 7)) - l20 * l10) * d1
        p2 = load(blocks, (own, 8)) - l20 * l20 - l21 * l21
        room, steady = least(p2 - least_pivot * a22, room), least(p2 - STEADY * a22, steady)
        d2 = 1.0 / square_root(p2)
        store(blocks, (own, 0), d0)
        store(blocks, (own, 3), l10)
        store(blocks, (own, 4), d1)
        store(blocks, (own, 6), l20)
        store(blocks, (own, 7), l21)
        store(blocks, (own, 8), d2)
        for b in range(own + 1, end):
            for i in range(0, 9, 3):
                x0 = load(blocks, (b, i)) * d0
                x1 = (load(blocks, (b, i + 1)) - x0 * l10) * d1
                x2 = (load(blocks, (b, i + 2)) - x0 * l20 - x1 * l21) * d2
                store(blocks, (b, i), x0)
                store(blocks, (b, i + 1), x1)
                store(blocks, (b, i + 2), x2)
        if (j + 1 == size or leaders[j + 1] != leader) and own + 1 < end:
            ends[leader], left[leader] = j + 1, end - own - 1
            row = rows[own + 1]
            following[leader] = chain[row]
            chain[row] = leader
    store(slack, (0,), room)
    store(slack, (1,), steady)


def factorize_reference(starts: Index, rows: Index, blocks: Array) -> Array:
    """The same factor in NumPy, block by block, of one positive definite matrix, (blocks, 3, 3): a copy.

    L_jj L_jjᵀ = A_jj − Σ_k L_jk L_jkᵀ and L_ij = (A_ij − Σ_k L_ik L_jkᵀ) L_jj⁻ᵀ for i > j, with k the columns before j;
    here each column k subtracts its products from those after it as soon as it is done.
    """
    factor = blocks.copy()
    size = len(starts) - 1
    block = {(int(rows[b]), j): b for j in range(size) for b in range(starts[j], starts[j + 1])}
    for j in range(size):
        below = range(starts[j] + 1, starts[j + 1])
        lower = np.linalg.cholesky(factor[starts[j]])
        factor[starts[j]] = lower
        for b in below:
            factor[b] = np.linalg.solve(lower, factor[b].T).T
        for b in below:
            for c in below:
                if rows[c] >= rows[b]:
                    factor[block[rows[c], rows[b]]] -= factor[c] @ factor[b].T
    return factor


@njit(nogil=True, error_model="numpy")
def solve(starts: Index, rows: Index, factor: Array, right: Array) -> None:
    """Solve in place for m right sides, (n, 3, m, lanes), with the factor of `factorize`."""
    size, many = len(starts) - 1, right.shape[2]
    for j in range(size):
        own = starts[j]
        d0, l10, d1 = load(factor, (own, 0)), load(factor, (own, 3)), load(factor, (own, 4))
        l20, l21, d2 = load(factor, (own, 6)), load(factor, (own, 7)), load(factor, (own, 8))
        for p in range(many):
            y0 = load(right, (j, 0, p)) * d0
            y1 = (load(right, (j, 1, p)) - y0 * l10) * d1
            store(right, (j, 0, p), y0)
            store(right, (j, 1, p), y1)
            store(right, (j, 2, p), (load(right, (j, 2, p)) - y0 * l20 - y1 * l21) * d2)
        for b in range(own + 1, starts[j + 1]):
            row = rows[b]
            x0, x1, x2 = load(factor, (b, 0)), load(factor, (b, 1)), load(factor, (b, 2))
            x3, x4, x5 = load(factor, (b, 3)), load(factor, (b, 4)), load(factor, (b, 5))
            x6, x7, x8 = load(factor, (b, 6)), load(factor, (b, 7)), load(factor, (b, 8))
            for p in range(many):
                y0, y1, y2 = load(right, (j, 0, p)), load(right, (j, 1, p)), load(right, (j, 2, p))
                z0 = load(right, (row, 0, p)) - (y0 * x0 + y1 * x1 + y2 * x2)
                z1 = load(right, (row, 1, p)) - (y0 * x3 + y1 * x4 + y2 * x5)
                z2 = load(right, (row, 2, p)) - (y0 * x6 + y1 * x7 + y2 * x8)
                store(right, (row, 0, p), z0)
                store(right, (row, 1, p), z1)
                store(right, (row, 2, p), z2)
    for j in range(size - 1, -1, -1):
        own = starts[j]
        for b in range(own + 1, starts[j + 1]):
            row = rows[b]
            x0, x1, x2 = load(factor, (b, 0)), load(factor, (b, 1)), load(factor, (b, 2))
            x3, x4, x5 = load(factor, (b, 3)), load(factor, (b, 4)), load(factor, (b, 5))
            x6, x7, x8 = load(factor, (b, 6)), load(factor, (b, 7)), load(factor, (b, 8))
            for p in range(many):
                y0, y1, y2 = load(right, (row, 0, p)), load(right, (row, 1, p)), load(right, (row, 2, p))
                z0 = load(right, (j, 0, p)) - (y0 * x0 + y1 * x3 + y2 * x6)
                z1 = load(right, (j, 1, p)) - (y0 * x1 + y1 * x4 + y2 * x7)
                z2 = load(right, (j, 2, p)) - (y0 * x2 + y1 * x5 + y2 * x8)
                store(right, (j, 0, p), z0)
                store(right, (j, 1, p), z1)
                store(right, (j, 2, p), z2)
        d0, l10, d1 = load(factor, (own, 0)), load(factor, (own, 3)), load(factor, (own, 4))
        l20, l21, d2 = load(factor, (own, 6)), load(factor, (own, 7)), load(factor, (own, 8))
        for p in range(many):
            y2 = load(right, (j, 2, p)) * d2
            y1 = (load(right, (j, 1, p)) - y2 * l21) * d1
            store(right, (j, 2, p), y2)
            store(right, (j, 1, p), y1)
            store(right, (j, 0, p), (load(right, (j, 0, p)) - y2 * l20 - y1 * l10) * d0)
