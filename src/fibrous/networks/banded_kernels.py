"""Compiled loops over the fibres of one network: stretches, forces, banded Hessian.

Index convention of all kernels: fibre m runs from node ``tails[m]`` to node ``heads[m]``; interior nodes are numbered
0 … n − 1 in the order of the band, with tails[m] < heads[m], and every boundary node is n, whose displacement row is
zero. A fibre's stiffness block is ``tension I + axial d ⊗ d`` with d its current end-to-end vector.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fibrous.compiled import njit

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@njit()
def stretch_fibers(
    gradient: Array, displacement: Array, reference: Array, lengths: Array, tails: Index, heads: Index, vectors: Array
) -> Array:
    """Fill `vectors` with d = F D + u_head − u_tail, shape (fibers, 3), and return the stretches |d|/L, (fibers,)."""
    stretches = np.empty(len(lengths))
    for m in range(len(lengths)):
        square = 0.0
        for i in range(3):
            d = displacement[heads[m], i] - displacement[tails[m], i]
            for j in range(3):
                d += gradient[i, j] * reference[m, j]
            vectors[m, i] = d
            square += d * d
        stretches[m] = np.sqrt(square) / lengths[m]
    return stretches


@njit()
def sum_at_nodes(forces: Array, tails: Index, heads: Index, size: int) -> Array:
    """Gradient of the energy at the interior nodes, shape (size, 3): fibre forces pull at their tails' cost."""
    residual = np.zeros((size + 1, 3))
    for m in range(len(forces)):
        for i in range(3):
            residual[heads[m], i] += forces[m, i]
            residual[tails[m], i] -= forces[m, i]
    return residual[:size]


@njit()
def assemble(vectors: Array, tension: Array, axial: Array, tails: Index, heads: Index, band: Array) -> None:
    """Fill `band`, shape (3 n, width), with the lower Hessian: row j holds K[j, j], K[j + 1, j], … down its column."""
    size = len(band) // 3
    band[:] = 0.0
    for m in range(len(tension)):
        tail, head = tails[m], heads[m]
        if tail == size:
            continue
        for i in range(3):
            for j in range(3):
                block = axial[m] * vectors[m, i] * vectors[m, j]
                if i == j:
                    block += tension[m]
                if i >= j:
                    band[3 * tail + j, i - j] += block
                    if head < size:
                        band[3 * head + j, i - j] += block
                if head < size:
                    band[3 * tail + j, 3 * (head - tail) + i - j] -= block


@njit()
def force_rates(gradient_rate: Array, reference: Array, vectors: Array, tension: Array, axial: Array) -> Array:
    """Rates of the fibre forces, shape (fibers, 3), when F changes at `gradient_rate` and u stands still."""
    rates = np.empty_like(vectors)
    rate = np.empty(3)
    for m in range(len(tension)):
        along = 0.0
        for i in range(3):
            rate[i] = 0.0
            for j in range(3):
                rate[i] += gradient_rate[i, j] * reference[m, j]
            along += vectors[m, i] * rate[i]
        for i in range(3):
            rates[m, i] = tension[m] * rate[i] + axial[m] * along * vectors[m, i]
    return rates
