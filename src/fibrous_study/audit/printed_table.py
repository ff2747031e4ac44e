"""Table 1 and the R² of its surfaces (section 3.2) against ours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from fibrous.fitting.surface import evaluate
from fibrous_study import printed
from fibrous_study.audit.evidence import Constants
from fibrous_study.audit.finding import (
    Array,
    Finding,
    Statement,
    Thresholds,
    Verdict,
    judged,
    listed,
    number,
    percent,
    rank_correlation,
    say,
    share_of,
    stretches,
    where,
)

COMPONENTS = ("H11", "H22", "H33")
AS_PRINTED, SWAPPED = "(H11, H22)", "(H22, H11)"
TURNED = " with the sign turned"


def table_1(
    statement: Statement,
    constant: str,
    fits: Mapping[str, Constants],
    coefficients: Mapping[str, Array],
    thresholds: Thresholds,
) -> Finding:
    """The printed coefficients of a constant, C2 or C3: what they are at our networks, however they are read.

    A reading is sound where the constant is positive at most networks and its trend with H11, over those aligned with
    x, is the one of section 3.2: C2 falls and C3 rises. Section 4.1 wants C2 to rise. `fits` holds our constants of the
    networks, `coefficients` those of our surface, shape (9,), both by load set.
    """
    ensemble = next(iter(fits.values()))
    values = readings(np.asarray(statement.value), ensemble)
    negative = {name: share_of(one < 0.0) for name, one in values.items()}
    aligned = ensemble.along_x()
    along = {
        name: rank_correlation(aligned.H11, one) for name, one in readings(np.asarray(statement.value), aligned).items()
    }
    limit = thresholds.trend_of(len(aligned.H11))
    positive = [name for name in values if negative[name] <= 1.0 - thresholds.most]
    falling, rising = ([name for name in positive if sign * along[name] >= limit] for sign in (-1.0, 1.0))
    apart = {name: _apart(values[AS_PRINTED], getattr(one, constant)) for name, one in fits.items()}
    sound = falling if constant == "C2" else rising
    if AS_PRINTED in sound:
        verdict = judged([True, any(one <= thresholds.surface_error for one in apart.values())])
    else:
        verdict = Verdict.PARTLY if sound else Verdict.CONTRADICTED
    both = "section 4.1 says" if constant == "C2" else "both sections say"
    wanted = f"and rises with alignment, as {both}, in {_count(rising)}"
    if constant == "C2":
        wanted = f"and falls with alignment, as section 3.2 says, in {_count(falling)}, {wanted}"
    named = f"readings that rise: {_named(rising, negative)}"
    if constant == "C2":
        named = f"readings that fall: {_named(falling, negative)}; {named}"
    survey = [float(evaluate(statement.value, *at)) for name, at in printed.ALIGNMENTS.items() if name != "isotropy"]
    off = listed([f"{number(one)} ({name})" for name, one in apart.items() if np.isfinite(one)] or ["unknown"])
    inside = {name: _inside(statement, one) for name, one in coefficients.items()}
    agreeing = listed([f"{int(one.sum())} of {one.size} ({name})" for name, one in inside.items()])
    amplitudes = stretches(np.concatenate([one.amplitude for one in fits.values()]))
    return Finding(
        f"printed surface at networks 1 to 5: {say(*survey, unit='MPa' if constant == 'C2' else '')}; RMS difference "
        f"from ours, in RMS of ours: {off}; our coefficients inside the printed intervals: {agreeing}; ours are fitted "
        f"up to λ_f = {amplitudes}; {named}",
        verdict,
        f"As printed {constant} is negative at {percent(negative[AS_PRINTED])} of the alignments of our "
        f"{len(ensemble.H11)} networks, and at {percent(negative[SWAPPED])} with the indices swapped (rank "
        f"correlations with H11 over the {len(aligned.H11)} aligned with x {along[AS_PRINTED]:+.2f} and "
        f"{along[SWAPPED]:+.2f}). Of twelve readings, any two components of H as the H11 and H22 of Eq. 11 with either "
        f"sign, it is positive at {percent(thresholds.most)} of the alignments {wanted}.",
    )


def _named(found: Sequence[str], negative: Mapping[str, float]) -> str:
    """Readings, with the share of alignments at which each is negative."""
    return listed([f"{name} (negative at {percent(negative[name])})" for name in found]) if found else "none"


def _count(found: Sequence[str]) -> str:
    return str(len(found)) if found else "none"


def _inside(statement: Statement, coefficient: Array) -> NDArray[np.bool_]:
    """Which of our coefficients lie inside the printed intervals, where these are printed."""
    value, half_width = np.asarray(statement.value), np.asarray(statement.half_width)
    return np.asarray(np.abs(coefficient - value) <= half_width)[np.isfinite(half_width)]


def readings(coefficient: Array, ensemble: Constants) -> dict[str, Array]:
    """Eq. 11 at the networks' alignments, with i and j belonging to any two components of H, and either sign."""
    values = {}
    for sign, word in ((1.0, ""), (-1.0, TURNED)):
        for first, second in permutations(COMPONENTS, 2):
            values[f"({first}, {second}){word}"] = sign * evaluate(
                coefficient, getattr(ensemble, first), getattr(ensemble, second)
            )
    return values


def _apart(values: Array, reference: Array) -> float:
    """Root mean square of the difference over that of the reference; infinite where that is zero."""
    size = float(np.linalg.norm(reference))
    return float(np.linalg.norm(values - reference)) / size if size else np.inf


def surface_r_squared(
    statement: Statement,
    ours: Mapping[str, tuple[float, float]],
    fits: Mapping[str, Constants],
    named: Mapping[str, Constants],
    thresholds: Thresholds,
) -> Finding:
    """R² of the surfaces of C2, nine terms, and C3, the eight printed, by load set against the printed ones.

    `fits` holds the ensemble's constants, `named` those of the named networks with their replicates, which tell how far
    networks of one alignment differ, both by load set.
    """
    wanted = np.asarray(statement.value)
    near = {name: np.abs(np.asarray(one) - wanted) <= thresholds.r_squared for name, one in ours.items()}
    best = max(near.values(), key=lambda one: int(one.sum()))
    shares = {name: [_scatter(fits[name], named[name], constant) for constant in ("C2", "C3")] for name in ours}
    scatter = ", and ".join(
        f"{percent(C2)} and {percent(C3)} with {name}, whose surfaces leave {percent(1.0 - ours[name][0])} and "
        f"{percent(1.0 - ours[name][1])} unexplained"
        for name, (C2, C3) in shares.items()
    )
    return Finding(
        "; ".join(f"{name}: C2 (nine terms) {say(one[0])}, C3 (eight) {say(one[1])}" for name, one in ours.items()),
        judged(best.tolist()),
        f"The printed R² of C2 comes out within {number(thresholds.r_squared)} {_near(near, 0)}, that of C3 "
        f"{_near(near, 1)}. Networks of one alignment, a median over the named ones, have of the ensemble's variance "
        f"of C2 and C3 {scatter}.",
    )


def _near(near: Mapping[str, NDArray[np.bool_]], constant: int) -> str:
    return where({name: bool(one[constant]) for name, one in near.items()})


def _scatter(ensemble: Constants, named: Constants, constant: str) -> float:
    """Median variance of a constant among networks of one alignment, as a part of its variance over an ensemble."""
    groups = [getattr(named.called(str(name)), constant) for name in np.unique(named.names)]
    within = float(np.median([np.var(one, ddof=1) for one in groups if len(one) > 1]))
    whole = float(np.var(getattr(ensemble, constant), ddof=1))
    return within / whole if whole else 0.0
