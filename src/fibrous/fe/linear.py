"""Linear solvers: callables ``solve(matrix, right, tolerance) -> LinearSolution``, chosen by name.

None returns an answer whose residual was not looked at.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import cg, splu

from fibrous.errors import ConfigError, ConvergenceError

Array = NDArray[np.float64]
Name = Literal["auto", "direct", "cg", "pardiso"]

# Unknowns up to which `auto` factorises. Measured: below, that takes milliseconds at most and wins for slender bodies
# and indefinite matrices; above, conjugate gradients win for compact ones by more and more (tenfold at 5,000).
SMALL = 1000
# Conjugate gradients that took this many iterations would have been overtaken by a factorisation.
MOST_ITERATIONS = 2000
# Relative residual that a factorisation must reach, whatever was asked; beyond it the matrix is singular to rounding.
DIRECT = 1e-6


@dataclass(frozen=True)
class LinearSolution:
    """x with ‖b − K x‖ ≤ tolerance ‖b‖, shape (unknowns,), and the name of the solver that found it."""

    values: Array
    solver: str


LinearSolver = Callable[[csr_array, Array, float], LinearSolution]


def linear_solver(name: Name) -> LinearSolver:
    """The solver called `name`.

    ``direct`` is SuperLU, ``cg`` conjugate gradients with the diagonal as preconditioner, and SuperLU where they fail,
    ``auto`` the one that suits the size, ``pardiso`` MKL's (extra `fast`).
    Raises ConfigError for another name, and for ``pardiso`` where it is not installed.
    """
    solvers: dict[str, LinearSolver] = {"auto": _automatic, "direct": direct, "cg": conjugate_gradients}
    if name in solvers:
        return solvers[name]
    if name != "pardiso":
        raise ConfigError(f"linear_solver is '{name}'; it must be one of {', '.join(solvers)}, pardiso")
    try:
        import pypardiso
    except ImportError:
        raise ConfigError(
            "linear_solver is 'pardiso', which is not installed: pip install 'fibrous[fast]', or choose auto"
        ) from None
    return lambda matrix, right, tolerance: _checked(matrix, right, pypardiso.spsolve(matrix, right), "pardiso")


def direct(matrix: csr_array, right: Array, tolerance: float) -> LinearSolution:
    """SuperLU with a symmetric order; raises ConvergenceError for a matrix that is singular, or so to rounding."""
    try:
        # The pattern is symmetric, and so are its pivots unless the matrix is far from definite.
        factor = splu(
            matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01, options={"SymmetricMode": True}
        )
    except RuntimeError as error:
        if "singular" not in str(error):
            raise
        raise ConvergenceError(SINGULAR) from None
    return _checked(matrix, right, factor.solve(right), "direct")


def conjugate_gradients(matrix: csr_array, right: Array, tolerance: float) -> LinearSolution:
    """Conjugate gradients on a symmetric matrix scaled to a unit diagonal; SuperLU where a residual stays too large."""
    diagonal = matrix.diagonal()
    if (diagonal > 0.0).all():
        scaling = diags_array(1.0 / diagonal)
        # An indefinite matrix may have directions without stiffness; the residual tells.
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            x, _ = cg(matrix, right, rtol=tolerance, atol=0.0, maxiter=MOST_ITERATIONS, M=scaling)
        # The residual that was carried along drifts away from the true one.
        if np.linalg.norm(right - matrix @ x) <= 2.0 * tolerance * np.linalg.norm(right):
            return LinearSolution(x, "cg")
    return direct(matrix, right, tolerance)


def _automatic(matrix: csr_array, right: Array, tolerance: float) -> LinearSolution:
    return (direct if len(right) <= SMALL else conjugate_gradients)(matrix, right, tolerance)


def _checked(matrix: csr_array, right: Array, x: Array, solver: str) -> LinearSolution:
    with np.errstate(over="ignore", invalid="ignore"):
        residual = float(np.linalg.norm(right - matrix @ x))
    if not residual <= DIRECT * float(np.linalg.norm(right)):
        raise ConvergenceError(SINGULAR)
    return LinearSolution(x, solver)


SINGULAR = (
    "the stiffness is singular: the body can move or give way without force; "
    "prescribe more displacements, or take smaller load steps"
)
