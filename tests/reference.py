"""What a network answers by the guard alone, one state after the other: the reference for what the engine finds."""

from types import SimpleNamespace

import numpy as np

from fibrous.networks.geometry import structure_tensor
from fibrous.networks.guard import EquilibriumSolver, State


def respond(solver: EquilibriumSolver, gradients: np.ndarray, scale: float) -> SimpleNamespace:
    """W, P, σ, h and counts along F, shape (steps, 3, 3), in MPa; NaN where no equilibrium is found."""
    states = solver.follow(gradients)
    return SimpleNamespace(
        strain_energy_density=np.array([energy(solver, state, scale) for state in states]),
        first_piola_kirchhoff_stress=np.array([piola(solver, state, scale) for state in states]),
        cauchy_stress=np.array([cauchy(solver, state, scale) for state in states]),
        orientation_tensor=np.array([structure_tensor(state.point.vectors) for state in states]),
        newton_iterations=np.array([state.iterations for state in states]),
        cuts=np.array([state.cuts for state in states]),
        converged=np.array([state.converged for state in states]),
        node_position=np.array([solver.node_position(state) for state in states]),
        fiber_stretch=np.array([state.point.stretches for state in states]),
    )


def energy(solver: EquilibriumSolver, state: State, scale: float) -> float:
    """W, MPa."""
    return scale * solver.assembly.energy(state.point) if state.converged else np.nan


def piola(solver: EquilibriumSolver, state: State, scale: float) -> np.ndarray:
    """P = (1/V) Σ f ⊗ D, shape (3, 3), MPa."""
    return scale * solver.assembly.stress(state.point) if state.converged else np.full((3, 3), np.nan)


def cauchy(solver: EquilibriumSolver, state: State, scale: float) -> np.ndarray:
    """σ = P Fᵀ/J, shape (3, 3), MPa."""
    F = state.point.gradient
    return piola(solver, state, scale) @ F.T / np.linalg.det(F)
