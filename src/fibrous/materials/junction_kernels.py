"""Compiled code of the junction law: a few fibres whose junctions relax, at eight deformation gradients at a time.

A symmetric matrix is held by its six components 00, 11, 22, 12, 02, 01. Lanes are the last axis of every array.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fibrous.compiled import njit
from fibrous.networks.fiber_law import energy, force_per_stretch
from fibrous.networks.lanes import LANES, choose, greatest, load, spread, square_root, store

Array = NDArray[np.float64]

# Row and column of the six components, the place of ij among them, and how often each stands in the matrix.
ROWS = np.array([0, 1, 2, 1, 0, 0])
COLUMNS = np.array([0, 1, 2, 2, 2, 1])
PLACE = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
TIMES = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])


@njit(nogil=True, error_model="numpy")
def respond(
    F: Array, directions: Array, weights: Array, release: Array, constants: tuple[int, float, float], P: Array, A: Array
) -> None:
    """Fill P, (n, 9, lanes), and A, (n, 81, lanes), at F, (n, 9, lanes), with the fibres of each of n owners.

    directions : products N_i N_j, six of each fibre, shape (n, fibers, 6); weights : v, (n, fibers); release : κ, (n,)
    constants : the number of the fibres' law and its two constants
    """
    count = directions.shape[1]
    s = np.empty((count, 4, LANES))
    right, inverse, S, D = np.empty((6, LANES)), np.empty((6, LANES)), np.empty((6, LANES)), np.empty((36, LANES))
    sums = np.empty((85, LANES))
    room, full = np.empty((216, LANES)), np.empty((450, LANES))
    half = np.empty((54, LANES))
    for n in range(len(F)):
        _right_cauchy_green(F[n], right)
        _sum_up(right, directions[n], weights[n], constants, s, S, D, sums)
        if release[n] != 0.0:
            _invert(right, inverse)
            _release(release[n], directions[n], weights[n], inverse, s, sums, S, D, room, full)
        _push(F[n], S, D, half, P[n], A[n])


@njit(nogil=True, error_model="numpy")
def _right_cauchy_green(F: Array, right: Array) -> None:
    for a in range(6):
        i, j = ROWS[a], COLUMNS[a]
        x = load(F, (i,)) * load(F, (j,)) + load(F, (3 + i,)) * load(F, (3 + j,))
        store(right, (a,), x + load(F, (6 + i,)) * load(F, (6 + j,)))


#: Where sums over the fibres begin: p s² N N (A), p s' N N (B), p 2 s s' N N N N, p s'' N N N N.
OF_A, OF_B, OF_DA, OF_DB, MEAN = 0, 6, 12, 48, 84


@njit(nogil=True, error_model="numpy")
def _sum_up(
    right: Array, directions: Array, weights: Array, constants: tuple[int, float, float], s: Array, S: Array, D: Array,
    sums: Array,
) -> None:  # fmt: skip
    """Fill S = Σ v s N N, (6, lanes), D = Σ v s' N N N N, (36, lanes), `sums` for the release, and s, s' …"""
    kind, first, second = constants
    S[:], D[:], sums[:] = 0.0, 0.0, 0.0
    total = weights.sum()
    for q in range(len(weights)):
        square = spread(0.0)
        for a in range(6):
            square = square + load(right, (a,)) * (TIMES[a] * directions[q, a])
        s0, s1, s2, s3 = force_per_stretch(kind, 0.5 * (square - 1.0), first, second)
        store(s, (q, 0), s0)
        store(s, (q, 1), s1)
        store(s, (q, 2), s2)
        store(s, (q, 3), s3)
        v, p = weights[q], weights[q] / total
        store(sums, (MEAN,), load(sums, (MEAN,)) + s0 * p)
        both = 2.0 * s0 * s1
        for a in range(6):
            x, y = v * directions[q, a], p * directions[q, a]
            store(S, (a,), load(S, (a,)) + s0 * x)
            store(sums, (OF_A + a,), load(sums, (OF_A + a,)) + s0 * s0 * y)
            store(sums, (OF_B + a,), load(sums, (OF_B + a,)) + s1 * y)
            for b in range(a, 6):
                m = 6 * a + b
                x2, y2 = x * directions[q, b], y * directions[q, b]
                store(D, (m,), load(D, (m,)) + s1 * x2)
                store(sums, (OF_DA + m,), load(sums, (OF_DA + m,)) + both * y2)
                store(sums, (OF_DB + m,), load(sums, (OF_DB + m,)) + s2 * y2)
    for a in range(6):
        for b in range(a):
            for first_ in (OF_DA, OF_DB):
                store(sums, (first_ + 6 * a + b,), load(sums, (first_ + 6 * b + a,)))


@njit(nogil=True, error_model="numpy")
def _push(F: Array, S: Array, D: Array, half: Array, P: Array, A: Array) -> None:
    """P = F S and A_iJkL = δ_ik S_JL + F_iM F_kN D_MJNL."""
    for a in range(6):
        for b in range(a):
            store(D, (6 * a + b,), load(D, (6 * b + a,)))
    for i in range(3):
        f0, f1, f2 = load(F, (3 * i,)), load(F, (3 * i + 1,)), load(F, (3 * i + 2,))
        for J in range(3):
            m0, m1, m2 = PLACE[0, J], PLACE[1, J], PLACE[2, J]
            store(P, (3 * i + J,), f0 * load(S, (m0,)) + f1 * load(S, (m1,)) + f2 * load(S, (m2,)))
            for b in range(6):
                x = f0 * load(D, (6 * m0 + b,)) + f1 * load(D, (6 * m1 + b,)) + f2 * load(D, (6 * m2 + b,))
                store(half, (18 * i + 6 * J + b,), x)
    for i in range(3):
        for k in range(i, 3):
            f0, f1, f2 = load(F, (3 * k,)), load(F, (3 * k + 1,)), load(F, (3 * k + 2,))
            for J in range(3):
                first = 18 * i + 6 * J
                for L in range(3):
                    x = f0 * load(half, (first + PLACE[0, L],)) + f1 * load(half, (first + PLACE[1, L],))
                    x = x + f2 * load(half, (first + PLACE[2, L],))
                    if i == k:
                        x = x + load(S, (PLACE[J, L],))
                    store(A, (27 * i + 9 * J + 3 * k + L,), x)
                    if i != k:
                        store(A, (27 * k + 9 * L + 3 * i + J,), x)


# Places in the room of `_release`: Lᵀ X L of A and of C⁻¹; of the derivatives of A, K and C⁻¹ by each component of the
# strain; weights x of A'', y of K'' and w of (σ C⁻¹)'' in R''; L; Â β_m as full matrices; matrices to work with.
A_HAT, P_HAT, X, Y, ROOT, ONE, OTHER, DA, DK, DP, LEFT, W = 0, 6, 12, 18, 24, 30, 39, 48, 84, 120, 156, 210


@njit(nogil=True, error_model="numpy")
def _release(
    kappa: float, directions: Array, weights: Array, inverse: Array, s: Array, sums: Array, S: Array, D: Array,
    room: Array, full: Array,
) -> None:  # fmt: skip
    """Subtract κ v times the first and second derivatives of R by the strain from S, (6, lanes), and D, (36, lanes).

    R = tr[A M] with M = (B + σ C⁻¹)⁻¹ for σ ≥ 0, and its series T − T q T + T q T q T for σ < 0, with T = B⁻¹ and
    q = σ C⁻¹. With K = B + σ C⁻¹, or B in the series, and L Lᵀ = K⁻¹, a matrix X becomes X̂ = Lᵀ X L, so that K̂ = 1
    and K̂⁻¹ = 1 − β + β² for its change β.
    """
    mean = load(sums, (MEAN,))
    closed = choose(mean, 0.0, 0.0, 1.0)  # 1 where σ ≥ 0
    inside, outside = closed * mean, (1.0 - closed) * mean
    series = greatest(1.0 - closed) > 0.5
    for a in range(6):
        store(room, (ONE + a,), load(sums, (OF_B + a,)) + inside * load(inverse, (a,)))
    _root_of_inverse(room, ONE, ROOT)
    _turn(sums, OF_A, room, A_HAT)
    _turn(inverse, 0, room, P_HAT)
    for m in range(6):
        _turn(sums, OF_DA + 6 * m, room, DA + 6 * m)
        _turn(sums, OF_DB + 6 * m, room, DK + 6 * m)
        i, j = ROWS[m], COLUMNS[m]
        for b in range(6):
            k, n = ROWS[b], COLUMNS[b]
            x = load(inverse, (PLACE[k, i],)) * load(inverse, (PLACE[j, n],))
            store(room, (ONE + b,), -1.0 * (x + load(inverse, (PLACE[k, j],)) * load(inverse, (PLACE[i, n],))))
        _turn(room, ONE, room, DP + 6 * m)
        slope = closed * load(sums, (OF_B + m,))
        for b in range(6):
            x = slope * load(room, (P_HAT + b,)) + inside * load(room, (DP + 6 * m + b,))
            store(room, (DK + 6 * m + b,), load(room, (DK + 6 * m + b,)) + x)
        _multiply(room, A_HAT, DK + 6 * m, LEFT + 9 * m)
    for b in range(6):
        store(room, (X + b,), 1.0 if ROWS[b] == COLUMNS[b] else 0.0)
        store(room, (Y + b,), -1.0 * load(room, (A_HAT + b,)))
        store(room, (W + b,), -1.0 * load(room, (A_HAT + b,)))
    scale = kappa * weights.sum()
    if series:
        _products_in_series(scale, closed, outside, sums, room, D, full)
    else:
        for m in range(6):
            for n in range(m, 6):
                x = _trace(room, LEFT + 9 * m, DK + 6 * n) + _trace(room, LEFT + 9 * n, DK + 6 * m)
                x = x - _dot(room, DA + 6 * m, DK + 6 * n) - _dot(room, DA + 6 * n, DK + 6 * m)
                store(D, (6 * m + n,), load(D, (6 * m + n,)) - scale * x)
    z = _dot(room, W, P_HAT)
    for m in range(6):
        x = _dot(room, X, DA + 6 * m) + _dot(room, Y, DK + 6 * m)
        x = x + (1.0 - closed) * z * load(sums, (OF_B + m,)) + outside * _dot(room, W, DP + 6 * m)
        store(S, (m,), load(S, (m,)) - scale * x)
        for n in range(m, 6):
            x = load(sums, (OF_B + m,)) * _dot(room, W, DP + 6 * n)
            x = x + load(sums, (OF_B + n,)) * _dot(room, W, DP + 6 * m)
            store(D, (6 * m + n,), load(D, (6 * m + n,)) - scale * x)
    # C⁻¹ is curved, too: with G = L ŵ Lᵀ and Z = C⁻¹ G C⁻¹ it counts 8 Z (E_m) C⁻¹ (E_n), symmetrised.
    _turn_back(room, W, ONE)
    _sandwich(inverse, room, ONE, OTHER)
    for m in range(6):
        i, j = ROWS[m], COLUMNS[m]
        for n in range(m, 6):
            k, o = ROWS[n], COLUMNS[n]
            x = load(room, (OTHER + PLACE[i, k],)) * load(inverse, (PLACE[j, o],))
            x = x + load(room, (OTHER + PLACE[i, o],)) * load(inverse, (PLACE[j, k],))
            x = x + load(room, (OTHER + PLACE[j, k],)) * load(inverse, (PLACE[i, o],))
            x = x + load(room, (OTHER + PLACE[j, o],)) * load(inverse, (PLACE[i, k],))
            store(D, (6 * m + n,), load(D, (6 * m + n,)) - (2.0 * scale) * mean * x)
    # The fibres' law is curved.
    _turn_back(room, X, ONE)
    _turn_back(room, Y, OTHER)
    for q in range(len(weights)):
        x, y = spread(0.0), spread(0.0)
        for a in range(6):
            x = x + load(room, (ONE + a,)) * (TIMES[a] * directions[q, a])
            y = y + load(room, (OTHER + a,)) * (TIMES[a] * directions[q, a])
        s0, s1, s2, s3 = load(s, (q, 0)), load(s, (q, 1)), load(s, (q, 2)), load(s, (q, 3))
        x = (2.0 * (s1 * s1 + s0 * s2) * x + s3 * y + s2 * z) * (kappa * weights[q])
        for m in range(6):
            xm = x * directions[q, m]
            for n in range(m, 6):
                store(D, (6 * m + n,), load(D, (6 * m + n,)) - xm * directions[q, n])


# Places of full matrices, nine components each: Â, q, p, w, three to work with, and by each component of the strain the
# derivatives Â_m, β_m, P̂_m, q_m, V_m, p_m, M_m.
FULL_A, FULL_Q, FULL_P, FULL_W, WORK, DERIVATIVES = 0, 9, 18, 27, 36, 72
OF_A_M, OF_K_M, OF_P_M, OF_Q_M, OF_V_M, OF_POLYNOMIAL_M, OF_M_M = range(0, 378, 54)


@njit(nogil=True, error_model="numpy")
def _products_in_series(scale: float, closed, outside, sums: Array, room: Array, D: Array, full: Array) -> None:  # type: ignore[no-untyped-def]
    """Weights x, y and w, and what products of first derivatives are in the second ones of R, subtracted from D.

    M = T p with V = q T and p = 1 − V + V²; lanes with σ ≥ 0 have q = 0 and M = T.
    """
    for i in range(3):
        for j in range(3):
            m = PLACE[i, j]
            store(full, (FULL_A + 3 * i + j,), load(room, (A_HAT + m,)))
            store(full, (FULL_Q + 3 * i + j,), outside * load(room, (P_HAT + m,)))
    square, twice, thrice = WORK, WORK + 9, WORK + 18
    _mul(full, FULL_Q, FULL_Q, square)
    for a in range(9):
        x = load(full, (square + a,)) - load(full, (FULL_Q + a,))
        store(full, (FULL_P + a,), x + 1.0 if a % 4 == 0 else x)
    _mul(full, FULL_Q, FULL_A, twice)
    _mul(full, twice, FULL_Q, thrice)
    _mul(full, square, FULL_A, WORK + 27)
    for b in range(6):
        i, j = ROWS[b], COLUMNS[b]
        both = load(full, (twice + 3 * i + j,)) + load(full, (twice + 3 * j + i,))
        more = load(full, (WORK + 27 + 3 * i + j,)) + load(full, (WORK + 27 + 3 * j + i,))
        w = both - load(room, (A_HAT + b,))
        store(room, (X + b,), load(full, (FULL_P + 3 * i + j,)))
        store(room, (Y + b,), w - more - load(full, (thrice + 3 * i + j,)))
        store(room, (W + b,), w)
    for i in range(3):
        for j in range(3):
            store(full, (FULL_W + 3 * i + j,), load(room, (W + PLACE[i, j],)))
    for m in range(6):
        at = DERIVATIVES + 9 * m
        slope = (1.0 - closed) * load(sums, (OF_B + m,))
        for i in range(3):
            for j in range(3):
                b, c = 6 * m + PLACE[i, j], 3 * i + j
                store(full, (at + OF_A_M + c,), load(room, (DA + b,)))
                store(full, (at + OF_K_M + c,), load(room, (DK + b,)))
                store(full, (at + OF_P_M + c,), load(room, (DP + b,)))
                x = slope * load(room, (P_HAT + PLACE[i, j],)) + outside * load(room, (DP + b,))
                store(full, (at + OF_Q_M + c,), x)
        _mul(full, FULL_Q, at + OF_K_M, WORK)
        for c in range(9):
            store(full, (at + OF_V_M + c,), load(full, (at + OF_Q_M + c,)) - load(full, (WORK + c,)))
        _mul(full, at + OF_V_M, FULL_Q, WORK)
        _mul(full, FULL_Q, at + OF_V_M, WORK + 9)
        _mul(full, at + OF_K_M, FULL_P, WORK + 18)
        for c in range(9):
            x = load(full, (WORK + c,)) + load(full, (WORK + 9 + c,)) - load(full, (at + OF_V_M + c,))
            store(full, (at + OF_POLYNOMIAL_M + c,), x)
            store(full, (at + OF_M_M + c,), x - load(full, (WORK + 18 + c,)))
    for m in range(6):
        for n in range(m, 6):
            a, b = DERIVATIVES + 9 * m, DERIVATIVES + 9 * n
            # U: of V'' what is made of first derivatives.
            _mul(full, a + OF_K_M, b + OF_K_M, WORK)
            _mul(full, b + OF_K_M, a + OF_K_M, WORK + 9)
            for c in range(9):
                store(full, (WORK + c,), load(full, (WORK + c,)) + load(full, (WORK + 9 + c,)))
            _mul(full, FULL_P, FULL_A, WORK + 9)
            x = _trace_of_product(full, WORK, WORK + 9)
            _mul(full, FULL_Q, WORK, WORK + 18)
            _mul(full, a + OF_Q_M, b + OF_K_M, WORK + 9)
            _mul(full, b + OF_Q_M, a + OF_K_M, WORK)
            for c in range(9):
                u = load(full, (WORK + 18 + c,)) - load(full, (WORK + 9 + c,)) - load(full, (WORK + c,))
                store(full, (WORK + 18 + c,), u)
            x = x + _trace_of_product(full, WORK + 18, FULL_W)
            x = x + _trace_of_product(full, a + OF_A_M, b + OF_M_M) + _trace_of_product(full, b + OF_A_M, a + OF_M_M)
            for c, d in ((a, b), (b, a)):
                _mul(full, FULL_A, c + OF_K_M, WORK)
                x = x - _trace_of_product(full, WORK, d + OF_POLYNOMIAL_M)
                _mul(full, FULL_A, c + OF_V_M, WORK)
                x = x + _trace_of_product(full, WORK, d + OF_V_M)
            store(D, (6 * m + n,), load(D, (6 * m + n,)) - scale * x)


@njit(nogil=True, error_model="numpy")
def _mul(full: Array, one: int, other: int, result: int) -> None:
    """X Y of full matrices."""
    for i in range(3):
        x0, x1, x2 = load(full, (one + 3 * i,)), load(full, (one + 3 * i + 1,)), load(full, (one + 3 * i + 2,))
        for j in range(3):
            y = x0 * load(full, (other + j,)) + x1 * load(full, (other + 3 + j,))
            store(full, (result + 3 * i + j,), y + x2 * load(full, (other + 6 + j,)))


@njit(nogil=True, error_model="numpy")
def _trace_of_product(full: Array, one: int, other: int):  # type: ignore[no-untyped-def]
    """tr[X Y] of full matrices."""
    x = spread(0.0)
    for i in range(3):
        for j in range(3):
            x = x + load(full, (one + 3 * i + j,)) * load(full, (other + 3 * j + i,))
    return x


@njit(nogil=True, error_model="numpy")
def _invert(packed: Array, inverse: Array) -> None:
    x00, x11, x22 = load(packed, (0,)), load(packed, (1,)), load(packed, (2,))
    x12, x02, x01 = load(packed, (3,)), load(packed, (4,)), load(packed, (5,))
    c0, c1, c2 = x11 * x22 - x12 * x12, x02 * x12 - x01 * x22, x01 * x12 - x02 * x11
    scale = 1.0 / (x00 * c0 + x01 * c1 + x02 * c2)
    store(inverse, (0,), scale * c0)
    store(inverse, (1,), scale * (x00 * x22 - x02 * x02))
    store(inverse, (2,), scale * (x00 * x11 - x01 * x01))
    store(inverse, (3,), scale * (x01 * x02 - x00 * x12))
    store(inverse, (4,), scale * c2)
    store(inverse, (5,), scale * c1)


@njit(nogil=True, error_model="numpy")
def _root_of_inverse(room: Array, packed: int, root: int) -> None:
    """Upper triangular L with L Lᵀ the inverse of a matrix, by its components 00, 11, 22, 12, 02, 01."""
    a = 1.0 / square_root(load(room, (packed,)))
    b, c = load(room, (packed + 5,)) * a, load(room, (packed + 4,)) * a
    d = 1.0 / square_root(load(room, (packed + 1,)) - b * b)
    e = (load(room, (packed + 3,)) - c * b) * d
    f = 1.0 / square_root(load(room, (packed + 2,)) - c * c - e * e)
    store(room, (root,), a)
    store(room, (root + 1,), d)
    store(room, (root + 2,), f)
    store(room, (root + 3,), -1.0 * e * d * f)
    store(room, (root + 4,), (b * e * d - c) * a * f)
    store(room, (root + 5,), -1.0 * b * a * d)


@njit(nogil=True, error_model="numpy")
def _turn(source: Array, packed: int, room: Array, result: int) -> None:
    """Lᵀ X L of a symmetric matrix."""
    x00, x11, x22 = load(source, (packed,)), load(source, (packed + 1,)), load(source, (packed + 2,))
    x12, x02, x01 = load(source, (packed + 3,)), load(source, (packed + 4,)), load(source, (packed + 5,))
    l00, l11, l22 = load(room, (ROOT,)), load(room, (ROOT + 1,)), load(room, (ROOT + 2,))
    l12, l02, l01 = load(room, (ROOT + 3,)), load(room, (ROOT + 4,)), load(room, (ROOT + 5,))
    b0, b1 = x00 * l01 + x01 * l11, x01 * l01 + x11 * l11
    c0 = x00 * l02 + x01 * l12 + x02 * l22
    c1 = x01 * l02 + x11 * l12 + x12 * l22
    c2 = x02 * l02 + x12 * l12 + x22 * l22
    store(room, (result,), l00 * x00 * l00)
    store(room, (result + 1,), l01 * b0 + l11 * b1)
    store(room, (result + 2,), l02 * c0 + l12 * c1 + l22 * c2)
    store(room, (result + 3,), l01 * c0 + l11 * c1)
    store(room, (result + 4,), l00 * c0)
    store(room, (result + 5,), l00 * b0)


@njit(nogil=True, error_model="numpy")
def _turn_back(room: Array, packed: int, result: int) -> None:
    """L X Lᵀ of a symmetric matrix."""
    x00, x11, x22 = load(room, (packed,)), load(room, (packed + 1,)), load(room, (packed + 2,))
    x12, x02, x01 = load(room, (packed + 3,)), load(room, (packed + 4,)), load(room, (packed + 5,))
    l00, l11, l22 = load(room, (ROOT,)), load(room, (ROOT + 1,)), load(room, (ROOT + 2,))
    l12, l02, l01 = load(room, (ROOT + 3,)), load(room, (ROOT + 4,)), load(room, (ROOT + 5,))
    a0, a1, a2 = l00 * x00 + l01 * x01 + l02 * x02, l00 * x01 + l01 * x11 + l02 * x12, l00 * x02 + l01 * x12 + l02 * x22
    b1, b2 = l11 * x11 + l12 * x12, l11 * x12 + l12 * x22
    store(room, (result,), a0 * l00 + a1 * l01 + a2 * l02)
    store(room, (result + 1,), b1 * l11 + b2 * l12)
    store(room, (result + 2,), l22 * x22 * l22)
    store(room, (result + 3,), b2 * l22)
    store(room, (result + 4,), a2 * l22)
    store(room, (result + 5,), a1 * l11 + a2 * l12)


@njit(nogil=True, error_model="numpy")
def _sandwich(inverse: Array, room: Array, packed: int, result: int) -> None:
    """C⁻¹ G C⁻¹ of symmetric matrices."""
    for m in range(6):
        i, j = ROWS[m], COLUMNS[m]
        x = spread(0.0)
        for k in range(3):
            y = load(room, (packed + PLACE[k, 0],)) * load(inverse, (PLACE[0, j],))
            y = y + load(room, (packed + PLACE[k, 1],)) * load(inverse, (PLACE[1, j],))
            y = y + load(room, (packed + PLACE[k, 2],)) * load(inverse, (PLACE[2, j],))
            x = x + load(inverse, (PLACE[i, k],)) * y
        store(room, (result + m,), x)


@njit(nogil=True, error_model="numpy")
def _multiply(room: Array, one: int, other: int, result: int) -> None:
    """X Y of symmetric matrices as the nine components of a full one."""
    for i in range(3):
        x0, x1, x2 = (
            load(room, (one + PLACE[i, 0],)),
            load(room, (one + PLACE[i, 1],)),
            load(room, (one + PLACE[i, 2],)),
        )
        for j in range(3):
            y = x0 * load(room, (other + PLACE[0, j],)) + x1 * load(room, (other + PLACE[1, j],))
            store(room, (result + 3 * i + j,), y + x2 * load(room, (other + PLACE[2, j],)))


@njit(nogil=True, error_model="numpy")
def _dot(room: Array, one: int, other: int):  # type: ignore[no-untyped-def]
    """tr[X Y] of symmetric matrices."""
    x = load(room, (one,)) * load(room, (other,))
    for a in range(1, 3):
        x = x + load(room, (one + a,)) * load(room, (other + a,))
    y = load(room, (one + 3,)) * load(room, (other + 3,))
    for a in range(4, 6):
        y = y + load(room, (one + a,)) * load(room, (other + a,))
    return x + 2.0 * y


@njit(nogil=True, error_model="numpy")
def _trace(room: Array, full: int, packed: int):  # type: ignore[no-untyped-def]
    """tr[X Y] of a full and a symmetric matrix."""
    x = spread(0.0)
    for i in range(3):
        for j in range(3):
            x = x + load(room, (full + 3 * i + j,)) * load(room, (packed + PLACE[i, j],))
    return x


@njit(nogil=True, error_model="numpy")
def stored_energy(
    F: Array, directions: Array, weights: Array, release: Array, constants: tuple[int, float, float], W: Array
) -> None:
    """Fill W, (n, lanes), at F, (n, 9, lanes), as `respond`."""
    kind, first, second = constants
    right, inverse, S, D = np.empty((6, LANES)), np.empty((6, LANES)), np.empty((6, LANES)), np.empty((36, LANES))
    s, sums, room = np.empty((directions.shape[1], 4, LANES)), np.empty((85, LANES)), np.empty((216, LANES))
    for n in range(len(F)):
        _right_cauchy_green(F[n], right)
        total = spread(0.0)
        for q in range(directions.shape[1]):
            square = spread(0.0)
            for a in range(6):
                square = square + load(right, (a,)) * (TIMES[a] * directions[n, q, a])
            total = total + weights[n, q] * energy(kind, square_root(square), first, second)
        if release[n] != 0.0:
            _sum_up(right, directions[n], weights[n], constants, s, S, D, sums)
            _invert(right, inverse)
            mean = load(sums, (MEAN,))
            inside = choose(mean, 0.0, 0.0, mean)
            for a in range(6):
                store(room, (ONE + a,), load(sums, (OF_B + a,)) + inside * load(inverse, (a,)))
            _root_of_inverse(room, ONE, ROOT)
            _turn(sums, OF_A, room, A_HAT)
            _turn(inverse, 0, room, P_HAT)
            released = load(room, (A_HAT,)) + load(room, (A_HAT + 1,)) + load(room, (A_HAT + 2,))
            outside = mean - inside
            _multiply(room, A_HAT, P_HAT, OTHER)
            released = released - outside * _dot(room, A_HAT, P_HAT) + outside * outside * _trace(room, OTHER, P_HAT)
            total = total - (release[n] * weights[n].sum()) * released
        store(W, (n,), total)
