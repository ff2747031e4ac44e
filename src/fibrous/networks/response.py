"""What a network answers to a path of deformation gradients, in MPa: one point of the W-λ curve a step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fibrous.networks import homogenization
from fibrous.networks.equilibrium import EquilibriumSolver

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Response:
    """Homogenised quantities along a path; the leading axis of every array is the step, rest first.

    strain_energy_density (steps,) MPa; first_piola_kirchhoff_stress, cauchy_stress (steps, 3, 3) MPa;
    largest_orientation_eigenvalue (steps,); newton_iterations, cuts (steps,); converged (steps,).
    Where a step did not converge its energy, stresses and eigenvalue are NaN.
    """

    strain_energy_density: Array
    first_piola_kirchhoff_stress: Array
    cauchy_stress: Array
    largest_orientation_eigenvalue: Array
    newton_iterations: NDArray[np.int64]
    cuts: NDArray[np.int64]
    converged: NDArray[np.bool_]


def respond(solver: EquilibriumSolver, gradients: Array, scale: float) -> Response:
    """The network's response to F, shape (steps, 3, 3), from the identity on; `scale` in MPa from `stress_scale`.

    Raises NetworkError for a network that is a mechanism at rest.
    """
    states = solver.follow(gradients)
    count = len(states)
    energy, eigenvalue = np.full(count, np.nan), np.full(count, np.nan)
    piola, cauchy = np.full((count, 3, 3), np.nan), np.full((count, 3, 3), np.nan)
    for step, state in enumerate(states):
        if state.converged:
            energy[step] = homogenization.strain_energy_density(solver, state, scale)
            piola[step] = homogenization.first_piola_kirchhoff_stress(solver, state, scale)
            cauchy[step] = homogenization.cauchy_stress(solver, state, scale)
            eigenvalue[step] = np.linalg.eigvalsh(homogenization.orientation_tensor(state))[-1]
    return Response(
        energy,
        piola,
        cauchy,
        eigenvalue,
        np.array([state.iterations for state in states]),
        np.array([state.cuts for state in states]),
        np.array([state.converged for state in states]),
    )
