"""Statements of sections 2.6 and 3.4 about the tissue; of ours, since the paper's mesh and motion are not public."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fibrous.comparison import TOP, Comparison, Fields
from fibrous.deformation import largest_principal_stretch
from fibrous.specimen import SYNTHETIC
from fibrous_study.audit.finding import (
    Array,
    Finding,
    Statement,
    Thresholds,
    Verdict,
    counted,
    judged,
    percent,
    say,
    span,
)


@dataclass(frozen=True)
class Tissue:
    """The runs of Fig. 9 at the last load step, and where the specimen comes from.

    multiscale, initial, refit : their fields
    gradient : F of the multiscale run, shape (elements, Gauss points, 3, 3)
    """

    origin: str
    multiscale: Fields
    initial: Fields
    refit: Fields
    gradient: Array

    def comparison(self, refitted: bool) -> Comparison:
        """Errors of the hybrid method."""
        return Comparison.of(self.refit if refitted else self.initial, self.multiscale)

    @property
    def elements(self) -> int:
        """Number of elements."""
        return len(self.multiscale.shear_stress)

    @property
    def top(self) -> int:
        """Number of the elements that count as peaks."""
        return max(1, round(TOP * self.elements))

    @property
    def share(self) -> str:
        """How many elements the peaks are."""
        return f"{self.top} of {self.elements}"

    def caveat(self) -> str:
        """Words at the end of every reason."""
        made = "one specimen of one seed" if self.origin == SYNTHETIC else "one specimen"
        return (
            f" This is {made} ({self.origin}, {counted(self.elements, 'element')}); the paper's mesh and motion are "
            "not public."
        )


def most_stretched(statement: Statement, tissue: Tissue) -> Finding:
    """Eq. 9 beside the most stretched element of ours."""
    printed = np.reshape(statement.value, (3, 3))
    stretch = largest_principal_stretch(tissue.gradient).mean(axis=-1)
    element = int(np.argmax(stretch))
    volume = np.linalg.det(tissue.gradient).mean(axis=-1)
    return Finding(
        f"largest principal stretch {stretch[element]:.3f}, J {volume[element]:.3f} in the most stretched element; Eq. "
        f"9 {float(largest_principal_stretch(printed)):.3f}, {np.linalg.det(printed):.4f}",
        Verdict.UNKNOWN,
        f"The printed F keeps the volume to {percent(abs(np.linalg.det(printed) - 1.0))}, although the matrix of Eq. "
        f"10B is compressible; in our elements J runs from {span(volume)}." + tissue.caveat(),
    )


def peaks(tissue: Tissue, thresholds: Thresholds) -> Finding:
    """Whether the hybrid method finds the regions of high shear stress and strain."""
    parts, said, top = [], [], tissue.top
    for word, refitted in (("initial", False), ("refit", True)):
        one = tissue.comparison(refitted)
        shares = one.shear_stress_overlap, one.shear_strain_overlap
        parts += [share >= thresholds.peak_overlap for share in shares]
        counts = [f"{percent(share)} ({round(share * top)} of {top})" for share in shares]
        said.append(f"{word}: {counts[0]} of the peaks of stress, {counts[1]} of those of strain")
    return Finding(
        "; ".join(said),
        judged(parts),
        f"Peaks are the tenth of the elements with the largest values in the multiscale run ({tissue.share}), found "
        f"where they are in that tenth of the hybrid run, too; chance finds {percent(top / tissue.elements)} of them."
        + tissue.caveat(),
    )


def bias(tissue: Tissue, thresholds: Thresholds) -> Finding:
    """Whether the initial constants give too little shear stress and too much shear strain where the stress peaks."""
    top = np.argsort(-tissue.multiscale.shear_stress, kind="stable")[: tissue.top]
    stress = tissue.initial.shear_stress[top].mean() / tissue.multiscale.shear_stress[top].mean()
    strain = tissue.initial.shear_strain[top].mean() / tissue.multiscale.shear_strain[top].mean()
    largest = tissue.initial.shear_stress.max() / tissue.multiscale.shear_stress.max()
    return Finding(
        f"at the peaks of stress {say(stress)} times the stress and {say(strain)} times the strain of the multiscale "
        "run",
        judged([stress < 1.0 - thresholds.change, strain > 1.0 + thresholds.change]),
        f"Over the tenth of the elements with the largest stress ({tissue.share}) the initial constants give "
        f"{_change(stress, thresholds)} stress and {_change(strain, thresholds)} strain, where "
        f"{percent(thresholds.change)} counts as a difference; the largest stress is {say(largest)} times the "
        "multiscale run's." + tissue.caveat(),
    )


def rms(tissue: Tissue, refitted: bool) -> Finding:
    """Root mean square errors of maximum shear stress and strain."""
    one = tissue.comparison(refitted)
    stress, strain = one.shear_stress, one.shear_strain
    return Finding(
        f"{say(stress.rms_error, unit='MPa')}, {say(100.0 * strain.rms_error, unit='%')}",
        Verdict.UNKNOWN,
        f"The errors are {percent(stress.relative_rms_error)} of the RMS stress and "
        f"{percent(strain.relative_rms_error)} of the RMS strain of the multiscale run." + tissue.caveat(),
    )


def refit_direction(tissue: Tissue, thresholds: Thresholds) -> Finding:
    """Whether the refit lowers the error of stress and raises that of strain."""
    before, after = (tissue.comparison(refitted) for refitted in (False, True))
    stress = after.shear_stress.rms_error / before.shear_stress.rms_error
    strain = after.shear_strain.rms_error / before.shear_strain.rms_error
    return Finding(
        f"error of stress {say(stress)} times, of strain {say(strain)} times the initial one",
        judged([stress < 1.0 - thresholds.change, strain > 1.0 + thresholds.change]),
        f"With refitted constants there is {_change(stress, thresholds)} error of stress and "
        f"{_change(strain, thresholds)} error of strain, where {percent(thresholds.change)} counts as a difference."
        + tissue.caveat(),
    )


def _change(ratio: float, thresholds: Thresholds) -> str:
    if abs(ratio - 1.0) <= thresholds.change:
        return "as much"
    return "less" if ratio < 1.0 else "more"
