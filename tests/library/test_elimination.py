"""Sparse Cholesky of eight matrices at a time, against dense linear algebra; operations of lanes against NumPy."""

import numpy as np
import pytest
from conftest import small_network
from numba import njit

from fibrous.networks.elimination import Elimination, factorize, factorize_reference, solve
from fibrous.networks.lanes import (
    LANES,
    choose,
    exponential_less_one,
    greatest,
    least,
    load,
    magnitude,
    spread,
    square_root,
    store,
)


@njit
def mixed(a, b, single, result):
    x, y = load(a, (0,)), load(b, (1, 0))
    store(result, (0,), 2.0 * x + y / 3.0 - x * y)
    store(result, (1,), exponential_less_one(x) - square_root(magnitude(y)))
    store(result, (2,), least(x, y))
    store(result, (3,), load(single, (0,)) + spread(1))
    store(single, (0,), y)
    store(result, (4,), 7.0)
    store(result, (5,), choose(x, y, 3.0, x))
    store(result, (6,), greatest(y))


def test_lanes_compute_what_arrays_do(rng):
    a, b = rng.normal(size=(1, LANES)), rng.normal(size=(2, 1, LANES))
    single, result = rng.normal(size=(1, LANES)).astype(np.float32), np.empty((7, LANES))
    x, y, z = a[0], b[1, 0], single[0].astype(float)
    mixed(a, b, single, result)
    expected = [
        2.0 * x + y / 3.0 - x * y,
        np.expm1(x) - np.sqrt(np.abs(y)),
        np.minimum(x, y),
        z + 1.0,
        np.full(LANES, 7),
    ]
    expected += [np.where(x < y, 3.0, x), np.full(LANES, y.max())]
    np.testing.assert_allclose(result, expected, rtol=1e-14, atol=1e-15)
    np.testing.assert_array_equal(single[0], y.astype(np.float32))


@njit
def exponentials(a, result):
    for m in range(len(a)):
        store(result, (m,), exponential_less_one(load(a, (m,))))


def test_exponential_less_one_is_exact_to_rounding(rng):
    small = 10.0 ** rng.uniform(-12, -1, (500, LANES)) * rng.choice([-1.0, 1.0], (500, LANES))
    a = np.concatenate([rng.uniform(-700, 700, (500, LANES)), rng.uniform(-2, 2, (500, LANES)), small])
    a = np.concatenate([a, np.zeros((1, LANES))])
    result = np.empty_like(a)
    exponentials(a, result)
    np.testing.assert_allclose(result, np.expm1(a), rtol=1e-15)
    assert (result[-1] == 0.0).all()
    exponentials(np.full((1, LANES), 1e5), result[:1])
    assert (result[0] > 1e300).all()
    assert np.isfinite(result[0]).all()


def matrices(rng, size: int, pairs: np.ndarray) -> np.ndarray:
    """Random positive definite matrices of 3 × 3 blocks with the pattern of `pairs`, (lanes, size, 3, size, 3)."""
    K = np.zeros((LANES, size, 3, size, 3))
    for q in range(LANES):
        for a, b in pairs:
            d = rng.normal(size=3)
            block = np.outer(d, d) + 0.05 * np.eye(3)
            K[q, a, :, a] += block
            K[q, b, :, b] += block
            K[q, a, :, b] -= block
            K[q, b, :, a] -= block
        K[q] += 0.1 * np.eye(3 * size).reshape(size, 3, size, 3)
    return K


def blocks_of(elimination: Elimination, K: np.ndarray) -> np.ndarray:
    columns = np.repeat(np.arange(len(elimination.order)), np.diff(elimination.starts))
    row, column = elimination.order[elimination.rows], elimination.order[columns]
    return np.ascontiguousarray(np.stack([one[row, :, column, :].reshape(-1, 9) for one in K], axis=-1))


def interior_pairs(edge_length_um: float) -> tuple[int, np.ndarray]:
    network = small_network(0, edge_length_um=edge_length_um)
    interior = np.flatnonzero(~network.node_is_boundary)
    number = np.full(len(network.node_position), -1)
    number[interior] = np.arange(len(interior))
    ends = number[network.fiber_nodes]
    return len(interior), ends[(ends >= 0).all(axis=1)]


@pytest.mark.parametrize("edge_length_um", [6.0, 10.0, 14.0])
def test_factor_solves_all_systems(rng, edge_length_um):
    size, pairs = interior_pairs(edge_length_um)
    elimination, K = Elimination.of(size, pairs), matrices(rng, size, pairs)
    factor, slack, right = blocks_of(elimination, K), np.empty((2, LANES)), rng.normal(size=(size, 3, 2, LANES))
    factorize(elimination.starts, elimination.rows, elimination.leaders, factor, 0.0, slack)
    assert (slack[0] > 0.0).all()
    found = right.copy()
    solve(elimination.starts, elimination.rows, factor, found)
    for q in range(LANES):
        dense = K[q][elimination.order][:, :, elimination.order].reshape(3 * size, -1)
        expected = np.linalg.solve(dense, right[..., q].reshape(3 * size, 2))
        np.testing.assert_allclose(found[..., q].reshape(3 * size, 2), expected, atol=1e-10 * np.abs(expected).max())


@pytest.mark.parametrize("edge_length_um", [6.0, 12.0])
def test_factor_is_the_references(rng, edge_length_um):
    size, pairs = interior_pairs(edge_length_um)
    elimination, K = Elimination.of(size, pairs), matrices(rng, size, pairs)
    blocks, slack = blocks_of(elimination, K), np.empty((2, LANES))
    expected = [
        factorize_reference(elimination.starts, elimination.rows, blocks[..., q].reshape(-1, 3, 3))
        for q in range(LANES)
    ]
    factorize(elimination.starts, elimination.rows, elimination.leaders, blocks, 0.0, slack)
    found = np.moveaxis(blocks, -1, 0).reshape(LANES, -1, 3, 3)
    own = np.isin(np.arange(len(elimination.rows)), elimination.starts[:-1])
    np.testing.assert_allclose(found[:, ~own], np.array(expected)[:, ~own], atol=1e-12)
    for entry in np.ndindex(3, 3):
        if entry[0] >= entry[1]:
            here, there = found[:, own][..., *entry], np.array(expected)[:, own][..., *entry]
            np.testing.assert_allclose(1.0 / here if entry[0] == entry[1] else here, there, atol=1e-12)


def test_a_matrix_that_is_not_definite_is_told_and_harms_no_other(rng):
    size, pairs = interior_pairs(8.0)
    elimination, K = Elimination.of(size, pairs), matrices(rng, size, pairs)
    good, slack, untouched = blocks_of(elimination, K), np.empty((2, LANES)), np.empty((2, LANES))
    least_eigenvalue = np.linalg.eigvalsh(K[3].reshape(3 * size, -1))[0]
    K[3] -= 1.01 * least_eigenvalue * np.eye(3 * size).reshape(size, 3, size, 3)
    bad = blocks_of(elimination, K)
    factorize(elimination.starts, elimination.rows, elimination.leaders, good, 0.0, untouched)
    factorize(elimination.starts, elimination.rows, elimination.leaders, bad, 0.0, slack)
    np.testing.assert_array_equal(slack[0] > 0.0, np.arange(LANES) != 3)
    others = np.arange(LANES) != 3
    np.testing.assert_array_equal(bad[..., others], good[..., others])


@pytest.mark.parametrize("entries", [[1, 3], [2, 6], [5, 7]])
def test_a_pivot_that_is_rounding_is_told(entries):
    elimination = Elimination.of(1, np.empty((0, 2), dtype=np.int64))
    blocks, slack = np.zeros((1, 9, LANES)), np.empty((2, LANES))
    blocks[0, [0, 4, 8]] = 2.0
    blocks[0, entries] = 2.0 - 1e-14
    for least_pivot, definite in ((0.0, True), (1e-12, False)):
        factor = blocks.copy()
        factorize(elimination.starts, elimination.rows, elimination.leaders, factor, least_pivot, slack)
        assert (slack[0] > 0.0).all() == definite


def test_blocks_are_where_the_factor_of_a_dense_matrix_is_not_zero(rng):
    size, pairs = interior_pairs(10.0)
    elimination = Elimination.of(size, pairs)
    np.testing.assert_array_equal(np.sort(elimination.order), np.arange(size))
    K = matrices(rng, size, pairs)[0][elimination.order][:, :, elimination.order].reshape(3 * size, -1)
    filled = np.abs(np.linalg.cholesky(K)).reshape(size, 3, size, 3).max(axis=(1, 3)) > 1e-14
    columns = np.repeat(np.arange(size), np.diff(elimination.starts))
    expected = np.zeros((size, size), dtype=bool)
    expected[elimination.rows, columns] = True
    np.testing.assert_array_equal(filled, expected)
    row, column = np.nonzero(expected)
    block = elimination.block(row, column)
    np.testing.assert_array_equal(elimination.rows[block], row)
    np.testing.assert_array_equal(columns[block], column)


def test_columns_of_a_supernode_have_the_same_rows_below_and_no_other_neighbors_do():
    size, pairs = interior_pairs(12.0)
    elimination = Elimination.of(size, pairs)
    rows = np.split(elimination.rows, elimination.starts[1:-1])
    joined = [j > 0 and rows[j - 1][1:].tolist() == rows[j].tolist() for j in range(size)]
    np.testing.assert_array_equal(elimination.leaders != np.arange(size), joined)
    np.testing.assert_array_equal(elimination.leaders, np.maximum.accumulate(np.where(joined, 0, np.arange(size))))
    assert np.bincount(elimination.leaders).max() >= 3


def test_eliminating_by_degree_fills_little():
    size, pairs = interior_pairs(14.0)
    assert len(Elimination.of(size, pairs).rows) < 0.3 * size * (size + 1) / 2
