"""How far one solution of the tissue is from another: errors of fields, and where the peaks lie (section 3.4)."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fibrous.fe.fields import green_lagrange_strain, maximum_shear

Array = NDArray[np.float64]

#: Share of the elements, those with the largest values, that counts as peaks.
TOP = 0.1


@dataclass(frozen=True)
class Deviation:
    """Differences of values from a reference, in their unit but for the ratio; every value counts the same."""

    rms_error: float
    rms_reference: float
    relative_rms_error: float  # the ratio of the two; NaN where the reference is zero throughout
    largest_error: float  # of the absolute differences

    @classmethod
    def of(cls, values: ArrayLike, reference: ArrayLike, component_axes: int = 0) -> Self:
        """Of arrays of one shape, whose last `component_axes` axes are components and count by their Frobenius norm."""
        values, reference = np.asarray(values, dtype=float), np.asarray(reference, dtype=float)
        components = tuple(range(-component_axes, 0))
        error, size = (np.sum(one * one, axis=components) for one in (values - reference, reference))
        rms, of_reference = float(np.sqrt(error.mean())), float(np.sqrt(size.mean()))
        ratio = rms / of_reference if of_reference > 0.0 else np.nan
        return cls(rms, of_reference, ratio, float(np.sqrt(error.max())))


@dataclass(frozen=True)
class Fields:
    """What is compared of a solution at one load step.

    shear_stress, shear_strain : maximum shear of Cauchy stress, MPa, and of Green–Lagrange strain, mean over the Gauss
        points of each element, shape (elements,)
    cauchy_stress : shape (elements, Gauss points, 3, 3), MPa
    displacement : shape (nodes, 3), mm
    reaction : force of the moved bone on the tissue, shape (3,), N
    """

    shear_stress: Array
    shear_strain: Array
    cauchy_stress: Array
    displacement: Array
    reaction: Array

    @classmethod
    def of(cls, gradient: Array, cauchy_stress: Array, displacement: Array, reaction: Array) -> Self:
        """From F and Cauchy stress, shapes (elements, Gauss points, 3, 3), displacements and the reaction."""
        stress, strain = (
            maximum_shear(tensor).mean(axis=-1) for tensor in (cauchy_stress, green_lagrange_strain(gradient))
        )
        return cls(stress, strain, cauchy_stress, displacement, reaction)


@dataclass(frozen=True)
class Comparison:
    """Deviations of `Fields`: over elements, over all Gauss points and over nodes; of the reaction, that of a vector.

    shear_stress_overlap, shear_strain_overlap : see `peak_overlap`
    """

    shear_stress: Deviation
    shear_strain: Deviation
    cauchy_stress: Deviation
    displacement: Deviation
    reaction: Deviation
    shear_stress_overlap: float
    shear_strain_overlap: float

    @classmethod
    def of(cls, found: Fields, reference: Fields) -> Self:
        """Of a solution from the reference on the same mesh."""
        components = {"cauchy_stress": 2, "displacement": 1, "reaction": 1}
        deviations = {
            field.name: Deviation.of(
                getattr(found, field.name), getattr(reference, field.name), components.get(field.name, 0)
            )
            for field in fields(Fields)
        }
        return cls(
            **deviations,
            shear_stress_overlap=peak_overlap(found.shear_stress, reference.shear_stress),
            shear_strain_overlap=peak_overlap(found.shear_strain, reference.shear_strain),
        )


def peak_overlap(values: Array, reference: Array) -> float:
    """Share of the elements of the reference's top decile that are in the top decile of `values`, shape (elements,).

    A decile is rounded to whole elements, one at the least; of equal values the first are taken. Values at random
    would share a tenth.

    >>> reference = np.arange(20.0)
    >>> peak_overlap(-reference, reference), peak_overlap(np.roll(reference, 1), reference)
    (0.0, 0.5)
    """
    count = max(1, round(TOP * len(reference)))
    top, top_of_reference = (np.argsort(-one, kind="stable")[:count] for one in (values, reference))
    return len(np.intersect1d(top, top_of_reference)) / count
