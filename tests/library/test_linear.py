"""Linear solvers: the answer, who gave it, and matrices that have none."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse import csr_array

from fibrous.errors import ConfigError, ConvergenceError
from fibrous.fe import linear
from fibrous.fe.linear import linear_solver


def matrix_of(eigenvalues, rng) -> csr_array:
    directions = np.linalg.qr(rng.standard_normal((len(eigenvalues), len(eigenvalues))))[0]
    return csr_array((directions * eigenvalues) @ directions.T)


@pytest.mark.parametrize(
    ("name", "eigenvalues", "used"),
    [
        ("direct", np.linspace(1.0, 50.0, 40), "direct"),
        ("cg", np.linspace(1.0, 50.0, 40), "cg"),
        ("auto", np.linspace(1.0, 50.0, 40), "direct"),
        ("cg", np.linspace(-1.0, 50.0, 40), "cg"),
        ("cg", -np.linspace(1.0, 50.0, 40), "direct"),
    ],
)
def test_solution_and_the_solver_that_found_it(name, eigenvalues, used, rng):
    matrix, x = matrix_of(eigenvalues, rng), rng.standard_normal(40)
    found = linear_solver(name)(matrix, matrix @ x, 1e-12)
    assert found.solver == used
    np.testing.assert_allclose(found.values, x, rtol=1e-9, atol=1e-10)


def test_conjugate_gradients_stop_at_the_tolerance(rng):
    matrix, right = matrix_of(np.geomspace(1.0, 1e4, 60), rng), rng.standard_normal(60)
    for tolerance in (1e-2, 1e-5):
        residual = np.linalg.norm(right - matrix @ linear_solver("cg")(matrix, right, tolerance).values)
        assert 1e-3 * tolerance < residual / np.linalg.norm(right) <= 2.0 * tolerance


def test_conjugate_gradients_that_take_too_long_give_way_to_a_factorisation(monkeypatch, rng):
    monkeypatch.setattr(linear, "MOST_ITERATIONS", 3)
    matrix, x = matrix_of(np.linspace(1.0, 50.0, 40), rng), rng.standard_normal(40)
    found = linear_solver("cg")(matrix, matrix @ x, 1e-12)
    assert found.solver == "direct"
    np.testing.assert_allclose(found.values, x, rtol=1e-9)


def test_larger_systems_go_to_conjugate_gradients():
    count = linear.SMALL + 1
    matrix = csr_array((np.full(count, 2.0), (np.arange(count), np.arange(count))))
    found = linear_solver("auto")(matrix, np.ones(count), 1e-10)
    assert found.solver == "cg"
    np.testing.assert_allclose(found.values, 0.5)


@pytest.mark.parametrize("name", ["auto", "direct", "cg"])
def test_singular_matrices_are_no_solution(name):
    with pytest.raises(ConvergenceError, match="singular"):
        linear_solver(name)(csr_array(np.array([[1.0, -1.0], [-1.0, 1.0]])), np.array([1.0, 1.0]), 1e-8)


def test_pardiso_is_chosen_by_name_and_its_residual_looked_at(monkeypatch, rng):
    matrix, x = matrix_of(np.linspace(1.0, 50.0, 40), rng), rng.standard_normal(40)
    monkeypatch.setitem(sys.modules, "pypardiso", SimpleNamespace(spsolve=lambda K, b: np.linalg.solve(K.toarray(), b)))
    found = linear_solver("pardiso")(matrix, matrix @ x, 1e-10)
    assert found.solver == "pardiso"
    np.testing.assert_allclose(found.values, x, rtol=1e-9)
    monkeypatch.setitem(sys.modules, "pypardiso", SimpleNamespace(spsolve=lambda K, b: b))
    with pytest.raises(ConvergenceError):
        linear_solver("pardiso")(matrix, matrix @ x, 1e-10)


def test_unknown_and_missing_solvers_are_refused_with_the_remedy(monkeypatch):
    with pytest.raises(ConfigError, match="one of auto, direct, cg, pardiso"):
        linear_solver("lu")
    monkeypatch.setitem(sys.modules, "pypardiso", None)
    with pytest.raises(ConfigError, match=r"pip install 'fibrous\[fast\]'"):
        linear_solver("pardiso")
