"""Stress, energy, tangent and orientation of a network's state, in MPa (Eqs. 4.1 and 7)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fibrous.networks.equilibrium import EquilibriumSolver, State
from fibrous.networks.network import structure_tensor

Array = NDArray[np.float64]


def stress_scale(fiber_modulus_MPa: float, fiber_radius_um: float, edge_length_um: float) -> float:
    """k A / χ², in MPa: what forces in kA over areas in edges² are as stresses, and kA/edges² as energy density."""
    return fiber_modulus_MPa * np.pi * fiber_radius_um**2 / edge_length_um**2


def strain_energy_density(solver: EquilibriumSolver, state: State, scale: float) -> float:
    """W^f = (1/V) Σ kA L w(λ), in MPa (Eq. 4.1); `scale` in MPa from `stress_scale`."""
    return scale * solver.assembly.energy(state.point)


def first_piola_kirchhoff_stress(solver: EquilibriumSolver, state: State, scale: float) -> Array:
    """P = dW/dF = (1/V) Σ f ⊗ D, shape (3, 3), MPa, with D the fibres' reference vectors."""
    return scale * solver.assembly.stress(state.point)


def cauchy_stress(solver: EquilibriumSolver, state: State, scale: float) -> Array:
    """σ = P Fᵀ / J, shape (3, 3), MPa; equal to Eq. 7's sum Σ f ⊗ d over the deformed volume in equilibrium."""
    gradient = state.point.gradient
    stress = first_piola_kirchhoff_stress(solver, state, scale)
    return stress @ gradient.T / np.linalg.det(gradient)


def tangent(solver: EquilibriumSolver, state: State, scale: float) -> Array:
    """∂P_iJ/∂F_kL along equilibria, shape (3, 3, 3, 3), MPa, by static condensation.

    Raises ConvergenceError for a state that is no stable equilibrium.
    """
    return scale * solver.condensed_tangent(state)


def orientation_tensor(state: State) -> Array:
    """h = Σ l n ⊗ n / Σ l over all fibres in the deformed state, shape (3, 3), trace 1."""
    return structure_tensor(state.point.vectors)
