"""A law at one point of the tissue along a path of deformation gradients, and how far its stress is from another's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fibrous.comparison import Deviation
from fibrous.fe.fields import cauchy_stress
from fibrous.materials.contract import Material

Array = NDArray[np.float64]

#: The six components of a symmetric tensor by name.
COMPONENTS = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}
#: Name of the whole tensor beside its components.
WHOLE = "all"


@dataclass(frozen=True)
class PathResponse:
    """What a law answers: strain_energy_density, shape (steps,), and cauchy_stress, shape (steps, 3, 3), in MPa."""

    strain_energy_density: Array
    cauchy_stress: Array


def along_path(material: Material, gradients: Array) -> PathResponse:
    """W and σ = P Fᵀ/J of a law without a state under F, shape (steps, 3, 3); its parameters are those of one point."""
    # One element with a Gauss point for each step, so that the parameters may have a leading axis of elements.
    points = np.asarray(gradients, dtype=float)[None]
    stress, _, _ = material(points)
    return PathResponse(material.energy(points)[0], cauchy_stress(stress, points)[0])


@dataclass(frozen=True)
class StressError(Deviation):
    """The deviation of a stress component, in MPa; `end_error` is that at the last step, law less reference.

    The whole tensor counts by its Frobenius norm, so that its `end_error` has no sign.
    """

    end_error: float


def stress_errors(stress: Array, reference: Array) -> dict[str, StressError]:
    """Errors of Cauchy stress over the steps of a path, for each of COMPONENTS and for the WHOLE tensor.

    `stress` and `reference` have shape (steps, 3, 3), one step at the least, in MPa.
    """
    difference = stress - reference
    errors = {
        name: _error(Deviation.of(stress[:, i, j], reference[:, i, j]), float(difference[-1, i, j]))
        for name, (i, j) in COMPONENTS.items()
    }
    return {**errors, WHOLE: _error(Deviation.of(stress, reference, 2), float(np.linalg.norm(difference[-1])))}


def _error(deviation: Deviation, end: float) -> StressError:
    return StressError(**vars(deviation), end_error=end)
