"""The network inside a piece of tissue, looked at along the piece's deformation (section 2.5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fibrous.fe.fields import cauchy_stress
from fibrous.materials.contract import Material
from fibrous.networks import homogenization
from fibrous.networks.equilibrium import EquilibriumSolver

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Microstructure:
    """States of one network along a path; the leading axis of every array is the step.

    node_position : deformed, shape (steps, nodes, 3), edges
    fiber_stretch : shape (steps, fibers); fiber_stress : force over the undeformed section (Eq. 6), the same shape, MPa
    orientation_tensor : h = Σ l n⊗n / Σ l, shape (steps, 3, 3); cauchy_stress : Eq. 7, the same shape, MPa
    converged : shape (steps,); where it is false, the other arrays are NaN
    """

    node_position: Array
    fiber_stretch: Array
    fiber_stress: Array
    orientation_tensor: Array
    cauchy_stress: Array
    converged: NDArray[np.bool_]


def microstructure(
    solver: EquilibriumSolver, gradients: Array, fiber_modulus_MPa: float, scale: float
) -> Microstructure:
    """The network driven from rest along F, shape (steps, 3, 3); `scale` in MPa from `stress_scale`.

    Raises NetworkError for a network that is a mechanism at rest.
    """
    states = solver.follow(gradients)
    network, steps = solver.assembly.network, len(states)
    position = np.full((steps, *network.node_position.shape), np.nan)
    stretch, fiber_stress = np.full((2, steps, len(network.fiber_nodes)), np.nan)
    orientation, stress = np.full((2, steps, 3, 3), np.nan)
    for step, state in enumerate(states):
        if state.converged:
            position[step] = solver.node_position(state)
            stretch[step] = state.point.stretches
            fiber_stress[step] = fiber_modulus_MPa * solver.assembly.law.response(state.point.stretches)[0]
            orientation[step] = homogenization.orientation_tensor(state)
            stress[step] = homogenization.cauchy_stress(solver, state, scale)
    converged = np.array([state.converged for state in states])
    return Microstructure(position, stretch, fiber_stress, orientation, stress, converged)


def stress_difference(network_stress: Array, matrix: Material, gradients: Array, tissue_stress: Array) -> float:
    """Largest difference of a component, MPa, of the network's and the matrix's Cauchy stress from the tissue's.

    All of shape (..., 3, 3) and in MPa but F; states without an equilibrium, NaN, are left out, and NaN is returned
    where nothing is left.
    """
    of_matrix = cauchy_stress(matrix(gradients)[0], gradients)
    difference = np.abs(network_stress + of_matrix - tissue_stress)
    known = difference[np.isfinite(difference)]
    return float(known.max()) if known.size else np.nan
