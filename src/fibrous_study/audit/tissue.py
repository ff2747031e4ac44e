"""Statements of sections 2.6 and 3.4 about the tissue; of ours, since the paper's mesh and motion are not public."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fibrous.deformation import largest_principal_stretch
from fibrous_study.audit.evidence import Evidence
from fibrous_study.audit.verdict import Finding, Verdict, ends, judged, judges, numbers


@judges("eq9-isochoric")
def most_stretched(evidence: Evidence, _: Mapping[str, float]) -> Finding:
    """Eq. 9 beside the most stretched element of ours."""
    tissue, printed = evidence.tissue, np.array(evidence.paper["eq_9"])
    stretch = largest_principal_stretch(tissue.gradient).mean(axis=-1)
    volume = np.linalg.det(tissue.gradient).mean(axis=-1)
    element = int(np.argmax(stretch))
    paper = {"stretch": float(largest_principal_stretch(printed)), "J": float(np.linalg.det(printed))}
    return Finding(
        Verdict.UNKNOWN,
        [
            *numbers(stretch=stretch[element], J=volume[element], printed=paper),
            *numbers(volume_change_printed=abs(paper["J"] - 1.0)),
            *ends("J", volume),
            *tissue.size(),
        ],
    )


@judges("hgo-locates-peaks")
def peaks(evidence: Evidence, _: Mapping[str, float]) -> Finding:
    """Whether the hybrid method finds the regions of high shear stress and strain."""
    tissue = evidence.tissue
    initial, after = (tissue.comparison(refitted) for refitted in (False, True))
    overlap = {
        "initial_stress": initial.shear_stress_overlap,
        "initial_strain": initial.shear_strain_overlap,
        "refit_stress": after.shear_stress_overlap,
        "refit_strain": after.shear_strain_overlap,
    }
    count, size = tissue.peaks, tissue.size()
    chance = count / len(tissue.multiscale.shear_stress)
    return Finding(
        judged(one >= evidence.thresholds.peak_overlap for one in overlap.values()),
        [*numbers(overlap), *numbers(peaks=count, chance=chance), *size],
    )


def _opposite(evidence: Evidence, stress: float, strain: float, **others: float) -> Finding:
    """Whether a stress is lower and a strain higher than what they are a multiple of."""
    change = evidence.thresholds.change
    return Finding(
        judged([stress < 1.0 - change, strain > 1.0 + change]),
        [*numbers(others, stress_ratio=stress, strain_ratio=strain, change=change), *evidence.tissue.size()],
    )


@judges("hgo-initial-bias")
def bias(evidence: Evidence, _: Mapping[str, float]) -> Finding:
    """Whether the initial constants give too little shear stress and too much shear strain where the stress peaks."""
    tissue = evidence.tissue
    top = np.argsort(-tissue.multiscale.shear_stress, kind="stable")[: tissue.peaks]
    stress = tissue.initial.shear_stress[top].mean() / tissue.multiscale.shear_stress[top].mean()
    strain = tissue.initial.shear_strain[top].mean() / tissue.multiscale.shear_strain[top].mean()
    largest = tissue.initial.shear_stress.max() / tissue.multiscale.shear_stress.max()
    return _opposite(evidence, stress, strain, largest_ratio=largest, peaks=tissue.peaks)


@judges("refit-direction")
def refit_direction(evidence: Evidence, _: Mapping[str, float]) -> Finding:
    """Whether the refit lowers the error of stress and raises that of strain."""
    before, after = (evidence.tissue.comparison(refitted) for refitted in (False, True))
    return _opposite(
        evidence,
        after.shear_stress.rms_error / before.shear_stress.rms_error,
        after.shear_strain.rms_error / before.shear_strain.rms_error,
    )


@judges("rms-initial", refitted=False)
@judges("rms-refit", refitted=True)
def rms(evidence: Evidence, printed: Mapping[str, Any], refitted: bool) -> Finding:
    """Root mean square errors of maximum shear stress and strain."""
    comparison = evidence.tissue.comparison(refitted)
    stress, strain = comparison.shear_stress, comparison.shear_strain
    return Finding(
        Verdict.UNKNOWN,
        [
            *numbers(unit="MPa", stress_error=stress.rms_error, printed=printed),
            *numbers(unit="%", strain_error=100.0 * strain.rms_error, printed=printed),
            *numbers(stress_relative=stress.relative_rms_error, strain_relative=strain.relative_rms_error),
            *evidence.tissue.size(),
        ],
    )
