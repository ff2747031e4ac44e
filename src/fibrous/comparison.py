"""How far a stress, or a solution of the tissue, is from another: errors, and where peaks lie (sections 2.6, 3.4)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fibrous.deformation import element_shear, green_lagrange_strain

Array = NDArray[np.float64]

#: The six components of a symmetric tensor by name.
COMPONENTS = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}
#: Name of the whole tensor beside its components.
WHOLE = "all"
#: Share of the elements, those with the largest values, that counts as peaks.
TOP = 0.1


@dataclass(frozen=True, repr=False)
class Deviation:
    """Differences of values from a reference, in their unit but for the ratio; every value counts the same."""

    rms_error: float
    rms_reference: float
    relative_rms_error: float  # the ratio of the two; NaN where the reference is zero throughout
    largest_error: float  # of the absolute differences
    unit: str = field(default="", kw_only=True)

    @classmethod
    def of(cls, values: ArrayLike, reference: ArrayLike, component_axes: int = 0, unit: str = "") -> Self:
        """Of arrays of one shape, whose last `component_axes` axes are components and count by their Frobenius norm."""
        values, reference = np.asarray(values, dtype=float), np.asarray(reference, dtype=float)
        components = tuple(range(-component_axes, 0))
        error, size = (np.sum(part * part, axis=components) for part in (values - reference, reference))
        rms, of_reference = float(np.sqrt(error.mean())), float(np.sqrt(size.mean()))
        ratio = rms / of_reference if of_reference > 0.0 else np.nan
        return cls(rms, of_reference, ratio, float(np.sqrt(error.max())), unit=unit)

    def __repr__(self) -> str:
        return f"{f'{self.rms_error:.3g} {self.unit}'.rstrip()} ({self.relative_rms_error:.1%})"


@dataclass(frozen=True, repr=False)
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
        name: (Deviation.of(stress[:, i, j], reference[:, i, j], unit="MPa"), float(difference[-1, i, j]))
        for name, (i, j) in COMPONENTS.items()
    }
    errors[WHOLE] = Deviation.of(stress, reference, 2, "MPa"), float(np.linalg.norm(difference[-1]))
    return {name: StressError(**vars(deviation), end_error=end) for name, (deviation, end) in errors.items()}


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
        stress, strain = element_shear(cauchy_stress), element_shear(green_lagrange_strain(gradient))
        return cls(stress, strain, cauchy_stress, displacement, reaction)


# Unit and number of component axes of each of Fields.
KINDS = {
    "shear_stress": ("MPa", 0), "shear_strain": ("", 0), "cauchy_stress": ("MPa", 2), "displacement": ("mm", 1),
    "reaction": ("N", 1),
}  # fmt: skip


@dataclass(frozen=True, repr=False)
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
    def of(cls, values: Fields, reference: Fields) -> Self:
        """Of a solution from the reference on the same mesh."""
        deviations = {
            name: Deviation.of(getattr(values, name), getattr(reference, name), axes, unit)
            for name, (unit, axes) in KINDS.items()
        }
        return cls(
            **deviations,
            shear_stress_overlap=peak_overlap(values.shear_stress, reference.shear_stress),
            shear_strain_overlap=peak_overlap(values.shear_strain, reference.shear_strain),
        )

    def __repr__(self) -> str:
        return f"<Comparison, RMS: {', '.join(f'{name} {getattr(self, name)}' for name in KINDS)}>"


def peak_overlap(values: Array, reference: Array) -> float:
    """Share of the elements of the reference's top decile that are in the top decile of `values`, shape (elements,).

    A decile is rounded to whole elements, one at the least; of equal values the first are taken. Values at random
    would share a tenth.

    >>> reference = np.arange(20.0)
    >>> peak_overlap(-reference, reference), peak_overlap(np.roll(reference, 1), reference)
    (0.0, 0.5)
    """
    count = max(1, round(TOP * len(reference)))
    top, top_of_reference = (np.argsort(-of, kind="stable")[:count] for of in (values, reference))
    return len(np.intersect1d(top, top_of_reference)) / count
