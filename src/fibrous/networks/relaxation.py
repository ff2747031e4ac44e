"""Compiled Newton's method for one network at several deformation gradients, with tangents by static condensation.

This is the quick way along a path of stable states: it starts from a prediction, takes full steps, and gives up at the
first sign of trouble (a Hessian that is not positive definite, a residual that does not fall, a step too long). What to
do then is known to `equilibrium`. Nothing here holds Python's lock, so threads work on several networks at a time.

Index convention as in `kernels`; further, a pair (k, L) of F's indices is one index p = 3 k + L, and rates
∂u_i/∂F_kL of a node are an array (3, 9).
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fibrous.networks import kernels, lapack

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Index = NDArray[np.int64]

#: What became of a gradient.
CONVERGED, INDEFINITE, STUCK = 0, 1, 2
# Newton steps at one gradient; a start that needs more is no prediction.
MOST_STEPS = 20
# A factor is used again where two steps with it, each as good as the last, would reach the tolerance.
REUSED = 2
# Least fall of the residual in a step with a factor of its own.
FALL = 0.5


@njit(cache=True, nogil=True)
def pull(
    F: Array,
    u: Array,
    reference: Array,
    lengths: Array,
    tails: Index,
    heads: Index,
    law: tuple[float, float],
    d: Array,
    tension: Array,
    axial: Array,
    residual: Array,
) -> tuple[float, float]:
    """Fill end-to-end vectors d, stiffness and residual; return the squares' sums of the residual and of the forces."""
    size = len(residual) - 1
    residual[:] = 0.0
    forces = 0.0
    B, linear_beyond = law
    for m in range(len(lengths)):
        tail, head, length = tails[m], heads[m], lengths[m]
        D0, D1, D2 = reference[m, 0], reference[m, 1], reference[m, 2]
        d0 = u[head, 0] - u[tail, 0] + F[0, 0] * D0 + F[0, 1] * D1 + F[0, 2] * D2
        d1 = u[head, 1] - u[tail, 1] + F[1, 0] * D0 + F[1, 1] * D1 + F[1, 2] * D2
        d2 = u[head, 2] - u[tail, 2] + F[2, 0] * D0 + F[2, 1] * D1 + F[2, 2] * D2
        square = d0 * d0 + d1 * d1 + d2 * d2
        current = np.sqrt(square)
        stretch = current / length
        cut = min(stretch, linear_beyond)
        growth = np.exp(0.5 * B * (cut * cut - 1.0))
        stiffness = cut * growth
        force = (growth - 1.0) / B
        if stretch > cut:
            force += stiffness * (stretch - cut)
        t = force / current
        tension[m] = t
        axial[m] = (stiffness / length - t) / square
        d[m, 0], d[m, 1], d[m, 2] = d0, d1, d2
        residual[head, 0] += t * d0
        residual[head, 1] += t * d1
        residual[head, 2] += t * d2
        residual[tail, 0] -= t * d0
        residual[tail, 1] -= t * d1
        residual[tail, 2] -= t * d2
        forces += force * force
    out_of_balance = 0.0
    for a in range(size):
        for i in range(3):
            out_of_balance += residual[a, i] * residual[a, i]
    return out_of_balance, forces


@njit(cache=True, nogil=True)
def couple(reference: Array, tails: Index, heads: Index, d: Array, tension: Array, axial: Array, right: Array) -> None:
    """Fill `right`, (9, n, 3), with −K_uF: force_i = B_ik D_L for a unit rate of F_kL, B = tension I + axial d ⊗ d."""
    size = right.shape[1]
    right[:] = 0.0
    for m in range(len(tension)):
        tail, head = tails[m], heads[m]
        if tail == size:
            continue
        for k in range(3):
            for i in range(3):
                block = axial[m] * d[m, i] * d[m, k]
                if i == k:
                    block += tension[m]
                for L in range(3):
                    force = block * reference[m, L]
                    right[3 * k + L, tail, i] += force
                    if head < size:
                        right[3 * k + L, head, i] -= force


@njit(cache=True, nogil=True)
def condense(
    reference: Array,
    tails: Index,
    heads: Index,
    d: Array,
    tension: Array,
    axial: Array,
    G: Single,
    P: Array,
    A: Array,
) -> None:
    """Fill P = Σ f ⊗ D and A = Σ wᵀ B w, the energy's second rate where fibres change by w = ∂d/∂F = δ D + G_head − G_tail.

    Exact rates G make A the condensed tangent; an error in them enters squared, as at every minimum.
    """
    w, v = np.empty((3, 9)), np.empty((3, 9))
    P[:] = 0.0
    A[:] = 0.0
    for m in range(len(tension)):
        tail, head = tails[m], heads[m]
        for i in range(3):
            for p in range(9):
                w[i, p] = G[head, i, p] - G[tail, i, p]
            for L in range(3):
                w[i, 3 * i + L] += reference[m, L]
                P[i, L] += tension[m] * d[m, i] * reference[m, L]
        for p in range(9):
            along = axial[m] * (d[m, 0] * w[0, p] + d[m, 1] * w[1, p] + d[m, 2] * w[2, p])
            for i in range(3):
                v[i, p] = tension[m] * w[i, p] + along * d[m, i]
        for p in range(9):
            for q in range(9):
                A[p, q] += w[0, p] * v[0, q] + w[1, p] * v[1, q] + w[2, p] * v[2, q]


@njit(cache=True, nogil=True)
def definite(addresses: tuple[int, int], band: Array, diagonal: Array, least_pivot: float) -> bool:
    """Factorise a band in place, and say whether all its pivots exist and none is less than its share of a diagonal."""
    for j in range(len(band)):
        diagonal[j] = band[j, 0]
    if lapack.factor_band(addresses, band) != 0:
        return False
    for j in range(len(band)):
        if band[j, 0] * band[j, 0] < least_pivot * diagonal[j]:
            return False
    return True


@njit(cache=True, nogil=True)
def predict(size: int, F: Array, from_F: Array, from_u: Array, from_G: Single, u: Array) -> None:
    """Fill u, (points, ≥ n + 1, 3), with the tangent's u + ∂u/∂F : ΔF at each of several F, (points, 3, 3)."""
    for q in range(len(F)):
        change = (F[q] - from_F[q]).ravel()
        for a in range(size):
            for i in range(3):
                moved = from_u[q, a, i]
                for p in range(9):
                    moved += from_G[q, a, i, p] * change[p]
                u[q, a, i] = moved


@njit(cache=True, nogil=True)
def add_bend(size: int, F: Array, from_F: Array, increment: Array, bend: Single, u: Array) -> None:
    """Add to u the second and third order of the path that led to `from_F` by `increment`, at t = its share in ΔF."""
    for q in range(len(F)):
        square = (increment[q] * increment[q]).sum()
        if square == 0.0:
            continue
        t = ((F[q] - from_F[q]) * increment[q]).sum() / square
        for a in range(size):
            for i in range(3):
                u[q, a, i] += t * t * (bend[q, 0, a, i] + t * bend[q, 1, a, i])


@njit(cache=True, nogil=True)
def find_bend(
    size: int, F: Array, u: Array, G: Single, from_F: Array, from_u: Array, from_G: Single, bend: Single
) -> None:
    """Fill the coefficients of t² and t³, (points, 2, ≥ n + 1, 3), of the cubic through two states and their rates.

    It is u + t ∂u/∂F : ΔF + t² bend₀ + t³ bend₁ with t = 0 at F and −1 at `from_F`.
    """
    for q in range(len(F)):
        change = (F[q] - from_F[q]).ravel()
        for a in range(size):
            for i in range(3):
                here, there = 0.0, 0.0
                for p in range(9):
                    here += G[q, a, i, p] * change[p]
                    there += from_G[q, a, i, p] * change[p]
                missed = from_u[q, a, i] - u[q, a, i] + here
                bend[q, 0, a, i] = 3.0 * missed + (there - here)
                bend[q, 1, a, i] = 2.0 * missed + (there - here)


@njit(cache=True, nogil=True)
def relax(
    addresses: tuple[int, int],
    law: tuple[float, float],
    network: tuple[Array, Array, Index, Index],
    size: int,
    width: int,
    tolerance: float,
    farthest: float,
    least_pivot: float,
    gradients: Array,
    u: Array,
    G: Single,
    with_rates: bool,
    P: Array,
    A: Array,
    residuals: Array,
    counts: Index,
) -> None:
    """Bring one network to equilibrium at each of several F, shape (points, 3, 3), from predictions of u and G.

    Fills u, (points, ≥ n + 1, 3), P, (points, 3, 3), A, (points, 9, 9), the relative residuals, (points,), and
    `counts`, (points, 3), with what became of the point, Newton steps and factors; G, (points, ≥ n + 1, 3, 9), too
    where `with_rates` says so. `farthest` is the longest step of a node along an axis, and `least_pivot` that of the factors, over
    the diagonal element it came from.
    """
    reference, lengths, tails, heads = network
    count = len(lengths)
    d, tension, axial = np.empty((count, 3)), np.empty(count), np.empty(count)
    residual, diagonal = np.empty((size + 1, 3)), np.empty(3 * size)
    band = np.empty((3 * size, width))
    move = np.empty((1, 3 * size))
    right = np.empty((9, size, 3))
    for q in range(len(gradients)):
        F, x = gradients[q], u[q]
        status, steps, factors = STUCK, 0, 0
        factored, before = False, np.inf
        while True:
            square, forces = pull(F, x, reference, lengths, tails, heads, law, d, tension, axial, residual)
            norm = np.sqrt(square)
            bound = np.sqrt(size) * max(1.0, np.sqrt(forces / count))
            limit = tolerance * bound
            residuals[q] = norm / max(bound, 1e-300)
            if not np.isfinite(norm + forces) or norm > FALL * before:
                break
            if norm <= limit and factored:
                status = CONVERGED
                break
            if not factored or norm * (norm / before) ** REUSED > limit:
                kernels.assemble(d, tension, axial, tails, heads, band)
                factored = True
                factors += 1
                if size > 0 and not definite(addresses, band, diagonal, least_pivot):
                    status = INDEFINITE
                    break
                if norm <= limit:
                    status = CONVERGED
                    break
            if steps == MOST_STEPS:
                break
            for a in range(size):
                for i in range(3):
                    move[0, 3 * a + i] = -residual[a, i]
            lapack.solve_band(addresses, band, move)
            longest = 0.0
            for a in range(size):
                for i in range(3):
                    x[a, i] += move[0, 3 * a + i]
                    longest = max(longest, abs(move[0, 3 * a + i]))
            if longest > farthest:
                break
            steps += 1
            before = norm
        counts[q, 0], counts[q, 1], counts[q, 2] = status, steps, factors
        if status != CONVERGED:
            continue
        if with_rates and size > 0:
            couple(reference, tails, heads, d, tension, axial, right)
            lapack.solve_band(addresses, band, right.reshape(9, 3 * size))
            for a in range(size):
                for i in range(3):
                    for p in range(9):
                        G[q, a, i, p] = right[p, a, i]
        condense(reference, tails, heads, d, tension, axial, G[q], P[q], A[q])
