"""A law at one point of the tissue along a path of deformation gradients, and how far its stress is from another's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
class StressError:
    """Differences of a stress component from a reference over a path, in MPa but for the ratio.

    The whole tensor counts by its Frobenius norm, so that its `end_error` has no sign.
    """

    rms_error: float
    rms_reference: float
    relative_rms_error: float  # the ratio of the two; NaN where the reference is zero throughout
    largest_error: float  # of the absolute differences
    end_error: float  # at the last step, law less reference


def stress_errors(stress: Array, reference: Array) -> dict[str, StressError]:
    """Errors of Cauchy stress over the steps of a path, for each of COMPONENTS and for the WHOLE tensor.

    `stress` and `reference` have shape (steps, 3, 3), one step at the least, in MPa.
    """
    difference = stress - reference
    errors = {
        name: _error(difference[:, i, j], reference[:, i, j], difference[-1, i, j])
        for name, (i, j) in COMPONENTS.items()
    }
    size = np.linalg.norm(difference, axis=(1, 2))
    return {**errors, WHOLE: _error(size, np.linalg.norm(reference, axis=(1, 2)), size[-1])}


def _error(difference: Array, reference: Array, end: float) -> StressError:
    rms, of_reference = (float(np.sqrt(np.mean(values * values))) for values in (difference, reference))
    ratio = rms / of_reference if of_reference > 0.0 else np.nan
    return StressError(rms, of_reference, ratio, float(np.abs(difference).max()), float(end))
