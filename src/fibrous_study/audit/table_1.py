"""Table 1 and the R² of its surfaces (section 3.2) against ours."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import permutations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fibrous.fitting.surface import evaluate
from fibrous_study.audit.evidence import Constants, Evidence
from fibrous_study.audit.verdict import (
    ENSEMBLE,
    NAMED,
    Array,
    Finding,
    Verdict,
    ends,
    fraction,
    judged,
    judges,
    numbers,
    rank_correlation,
)

AS_PRINTED = "H11_H22"
CONSTANTS = ("C2", "C3")


def readings(coefficient: ArrayLike, networks: Constants) -> dict[str, Array]:
    """Eq. 11 at the networks' alignments, with i and j belonging to any two components of H, and either sign."""
    return {
        f"{first}_{second}{word}": sign * evaluate(coefficient, getattr(networks, first), getattr(networks, second))
        for sign, word in ((1.0, ""), (-1.0, "_turned"))
        for first, second in permutations(("H11", "H22", "H33"), 2)
    }


@judges("table1-c2", ENSEMBLE, constant="C2")
@judges("table1-c3", ENSEMBLE, constant="C3")
def table_1(evidence: Evidence, printed: Mapping[str, Any], constant: str) -> Finding:
    """The printed coefficients of a constant, C2 or C3: what they are at our networks, however they are read.

    A reading is sound where the constant is positive at most networks and its trend with H11, over those aligned with
    x, is that of section 3.2: C2 falls and C3 rises. Section 4.1 wants C2 to rise.
    """
    thresholds, by_set = evidence.thresholds, evidence.ensemble_large_fits
    coefficient, half_width = np.asarray(printed["coefficient"]), np.asarray(printed["half_width"], dtype=float)
    ensemble = next(iter(by_set.values()))
    aligned = ensemble.along_x()
    values, along = readings(coefficient, ensemble), readings(coefficient, aligned)
    limit = thresholds.trend_of(len(aligned.H11))
    found = numbers(networks=len(ensemble.H11), aligned=len(aligned.H11), readings=len(values))
    falling, rising = [], []
    for name, value in values.items():
        negative, rank = fraction(value < 0.0), rank_correlation(aligned.H11, along[name])
        found += numbers({f"negative_{name}": negative, f"rank_{name}": rank})
        if negative <= 1.0 - thresholds.most:
            falling += [name] if rank <= -limit else []
            rising += [name] if rank >= limit else []
    found += numbers(readings_falling=len(falling), readings_rising=len(rising))
    at = {name: float(evaluate(coefficient, *place)) for name, place in evidence.paper["alignments"].items()}
    found += numbers({f"printed_{name}": value for name, value in at.items()}, unit="MPa" if constant == "C2" else "1")
    apart = {}
    for name, fits in by_set.items():
        ours = getattr(fits, constant)
        size = float(np.linalg.norm(ours))
        apart[name] = float(np.linalg.norm(values[AS_PRINTED] - ours)) / size if size else np.inf
        off = np.abs(evidence.surface_coefficients[constant][name] - coefficient)[np.isfinite(half_width)]
        within = off <= half_width[np.isfinite(half_width)]
        found += numbers(load_set=name, apart=apart[name], coefficients_inside=within.sum(), coefficients=within.size)
    found += ends("lambda_f", np.concatenate([fits.amplitude for fits in by_set.values()]))
    sound = falling if constant == "C2" else rising
    if AS_PRINTED in sound:
        return Finding(judged([True, any(one <= thresholds.surface_error for one in apart.values())]), found)
    return Finding(Verdict.PARTLY if sound else Verdict.CONTRADICTED, found)


@judges("surface-r2", NAMED, ENSEMBLE)
def surface_r_squared(evidence: Evidence, printed: Mapping[str, float]) -> Finding:
    """R² of the surfaces of C2, nine terms, and C3, the eight printed, against the printed ones, by load set.

    Beside what they leave of the variance stands how far networks of one alignment differ, the named ones with their
    replicates: the median of their variance as a fraction of the ensemble's.
    """
    best, found = [False, False], []
    for name, ours in evidence.surface_r_squared.items():
        near = [abs(ours[constant] - printed[constant]) <= evidence.thresholds.r_squared for constant in CONSTANTS]
        best = max(best, near, key=sum)
        found += numbers(ours, load_set=name, printed=printed)
        for constant, held in zip(CONSTANTS, near, strict=True):
            scatter = _scatter(evidence.ensemble_large_fits[name], evidence.large_fits[name], constant)
            words = {"near": held, "unexplained": 1.0 - ours[constant], "scatter": scatter}
            found += numbers({f"{constant}_{word}": value for word, value in words.items()}, load_set=name)
    return Finding(judged(best), found)


def _scatter(ensemble: Constants, named: Constants, constant: str) -> float:
    """Median variance of a constant among networks of one alignment, as a fraction of its variance in an ensemble."""
    groups = [getattr(named.called(str(name)), constant) for name in np.unique(named.names)]
    within = float(np.median([np.var(one, ddof=1) for one in groups if len(one) > 1]))
    whole = float(np.var(getattr(ensemble, constant), ddof=1))
    return within / whole if whole else 0.0
