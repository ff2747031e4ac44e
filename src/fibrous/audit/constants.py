"""Statements of sections 3.2 and 4.1 about C2 and C3 over alignment, Table 1 among them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import permutations
from typing import Self

import numpy as np
from numpy.typing import NDArray

from fibrous.audit.evidence import Constants
from fibrous.audit.finding import (
    Array,
    Finding,
    Statement,
    Thresholds,
    Verdict,
    holds_for_most,
    judged,
    listed,
    percent,
    rank_correlation,
    say,
    share_of,
    span,
)
from fibrous.fitting import printed
from fibrous.fitting.surface import evaluate

COMPONENTS = ("H11", "H22", "H33")
AS_PRINTED, SWAPPED = "(H11, H22)", "(H22, H11)"


@dataclass(frozen=True)
class Trend:
    """How C2 and C3 change with alignment in one load set.

    C2, C3 : rank correlations with H11 over an ensemble
    C2_ends, C3_ends : share of the pairs of networks 1 and 5 in which network 5 has the larger constant
    """

    C2: float
    C3: float
    C2_ends: float
    C3_ends: float

    @classmethod
    def of(cls, ensemble: Constants, ends: Constants) -> Self:
        """Of an ensemble, and of networks 1 and 5 with as many replicates of both."""
        first, fifth = _pair(ends)
        return cls(
            rank_correlation(ensemble.H11, ensemble.C2),
            rank_correlation(ensemble.H11, ensemble.C3),
            share_of(fifth.C2 > first.C2),
            share_of(fifth.C3 > first.C3),
        )

    def C2_rises(self, thresholds: Thresholds) -> bool:
        """Whether C2 clearly rises."""
        return thresholds.trend <= self.C2 and self.C2_ends >= thresholds.most

    def C2_falls(self, thresholds: Thresholds) -> bool:
        """Whether C2 clearly falls."""
        return -thresholds.trend >= self.C2 and self.C2_ends <= 1.0 - thresholds.most

    def C3_rises(self, thresholds: Thresholds) -> bool:
        """Whether C3 clearly rises."""
        return thresholds.trend <= self.C3 and self.C3_ends >= thresholds.most

    def __str__(self) -> str:
        return (
            f"C2 {self.C2:+.2f} and C3 {self.C3:+.2f}, C2 of network 5 above that of network 1 in "
            f"{percent(self.C2_ends)} of pairs, C3 in {percent(self.C3_ends)}"
        )


def near_isotropy(fits: Mapping[str, Constants], ends: Mapping[str, Constants], thresholds: Thresholds) -> Finding:
    """Section 3.2: C2 falls and C3 rises with alignment; `ends` holds networks 1 and 5, both by load set."""
    trends = {name: Trend.of(fits[name], ends[name]) for name in fits}
    falls, rises = ([getattr(one, way)(thresholds) for one in trends.values()] for way in ("C2_falls", "C2_rises"))
    verdict, why = judged([*falls, *(one.C3_rises(thresholds) for one in trends.values())]), _said(trends, fits)
    if any(rises) and not any(falls):
        verdict, why = Verdict.CONTRADICTED, why + " Section 4.1 says that the modulus grows, and that comes out."
    return Finding(_ends(ends), verdict, why, _spread(ends))


def growth(fits: Mapping[str, Constants], ends: Mapping[str, Constants], thresholds: Thresholds) -> Finding:
    """Section 4.1: C2 and C3 both rise with alignment."""
    trends = {name: Trend.of(fits[name], ends[name]) for name in fits}
    falls, rises = ([getattr(one, way)(thresholds) for one in trends.values()] for way in ("C2_falls", "C2_rises"))
    verdict, why = judged([*rises, *(one.C3_rises(thresholds) for one in trends.values())]), _said(trends, fits)
    if any(falls) and not any(rises):
        verdict = Verdict.CONTRADICTED
        why += " Where the trend of the modulus is clear it falls, as section 3.2 says."
    return Finding(_ends(ends), verdict, why, _spread(ends))


def table_1(
    statement: Statement,
    constant: str,
    fits: Mapping[str, Constants],
    coefficients: Mapping[str, Array],
    thresholds: Thresholds,
) -> Finding:
    """The printed coefficients of a constant, C2 or C3: what they are at our networks, however they are read.

    A reading is sound where the constant is positive at most networks and, as section 3.2 says, C2 falls and C3 rises
    with alignment. `fits` holds our constants of the networks, `coefficients` those of our surface, shape (9,), both
    by load set.
    """
    ensemble = next(iter(fits.values()))
    values = readings(np.asarray(statement.value), ensemble)
    negative = {name: share_of(one < 0.0) for name, one in values.items()}
    along = {name: rank_correlation(ensemble.H11, one) for name, one in values.items()}
    direction, wanted = (-1.0, "falling") if constant == "C2" else (1.0, "rising")
    sound = [
        name
        for name in values
        if negative[name] <= 1.0 - thresholds.most and direction * along[name] >= thresholds.trend
    ]
    apart = {name: _apart(values[AS_PRINTED], getattr(one, constant)) for name, one in fits.items()}
    if AS_PRINTED in sound:
        near = any(one <= thresholds.same_magnitude - 1.0 for one in apart.values())
        verdict = Verdict.REPRODUCED if near else Verdict.PARTLY
    else:
        verdict = Verdict.PARTLY if sound else Verdict.CONTRADICTED
    as_printed, swapped = (_read(negative[name], along[name]) for name in (AS_PRINTED, SWAPPED))
    found = f"{listed(sound)} {'are' if len(sound) > 1 else 'is'}" if sound else "none is"
    why = (
        f"As printed {as_printed}, with the indices swapped {swapped}; of twelve readings (six relabellings of H, "
        f"either sign) {found} positive at {percent(thresholds.most)} of them at the least and {wanted} with "
        "alignment, as section 3.2 says."
    )
    survey = [float(evaluate(statement.value, *at)) for name, at in printed.ALIGNMENTS.items() if name != "isotropy"]
    off = "; ".join(f"{say(one)} ({name})" for name, one in apart.items())
    inside = {name: _inside(statement, one) for name, one in coefficients.items()}
    agreeing = "; ".join(f"{int(one.sum())} of {one.size} ({name})" for name, one in inside.items())
    return Finding(
        f"printed surface at networks 1 to 5: {say(*survey)}; off by so many times the root mean square of our "
        f"{constant}: {off}; our coefficients inside the printed intervals: {agreeing}",
        verdict,
        why,
    )


def _inside(statement: Statement, coefficient: Array) -> NDArray[np.bool_]:
    """Which of our coefficients lie inside the printed intervals, where these are printed."""
    value, half_width = np.asarray(statement.value), np.asarray(statement.half_width)
    return np.asarray(np.abs(coefficient - value) <= half_width)[np.isfinite(half_width)]


def readings(coefficient: Array, ensemble: Constants) -> dict[str, Array]:
    """Eq. 11 at the networks' alignments, with i and j belonging to any two components of H, and either sign."""
    values = {}
    for sign, word in ((1.0, ""), (-1.0, " with the sign turned")):
        for first, second in permutations(COMPONENTS, 2):
            values[f"({first}, {second}){word}"] = sign * evaluate(
                coefficient, getattr(ensemble, first), getattr(ensemble, second)
            )
    return values


def _apart(values: Array, reference: Array) -> float:
    """Root mean square of the difference over that of the reference; infinite where that is zero."""
    size = float(np.linalg.norm(reference))
    return float(np.linalg.norm(values - reference)) / size if size else np.inf


def _read(negative: float, along: float) -> str:
    return f"it is negative at {percent(negative)} of the networks' alignments (rank correlation with H11 {along:+.2f})"


def surface_r_squared(statement: Statement, ours: Mapping[str, tuple[float, float]], thresholds: Thresholds) -> Finding:
    """R² of the surfaces of C2, nine terms, and C3, the eight printed, by load set against the printed ones."""
    wanted, found = np.asarray(statement.value), np.array(list(ours.values()))
    near = (np.abs(found - wanted) <= thresholds.r_squared).all(axis=1)
    between = bool(((found.min(axis=0) <= wanted) & (wanted <= found.max(axis=0))).all())
    verdict = Verdict.REPRODUCED if near.any() else Verdict.PARTLY if between else Verdict.NOT
    why = "Networks of equal volume fraction and prescribed alignment differ little; what lowers R² is the load set" + (
        ": the printed values lie between those of the two sets." if between else "."
    )
    said = "; ".join(f"{name}: C2 (nine terms) {say(one[0])}, C3 (eight) {say(one[1])}" for name, one in ours.items())
    return Finding(said, verdict, why)


def amplitude(
    small: Constants, large: Constants, ensemble: tuple[Constants, Constants], thresholds: Thresholds
) -> Finding:
    """Whether Eq. 11's constants belong to the network alone: C2 fitted at the small range over that at the large one.

    `small` and `large` are the case-study network with its replicates, `ensemble` all networks at both ranges.
    """
    ratio, over_all = small.C2 / large.C2, ensemble[0].C2 / ensemble[1].C2
    same = share_of(np.abs(np.log(over_all)) <= np.log(thresholds.same_magnitude))
    middle, largest = float(np.median(over_all)), float(over_all.max())
    return Finding(
        f"C2 {say(small.C2[0], unit='MPa')} at λ_f = {small.amplitude[0]:.2f}, {say(large.C2[0], unit='MPa')} at "
        f"{large.amplitude[0]:.2f}; C3 {say(small.C3[0])} and {say(large.C3[0])}",
        judged([same >= thresholds.most]),
        f"Over {over_all.size} networks C2 fitted up to 10 % Green strain is {say(middle)} times (median, "
        f"{say(largest)} at most) that fitted up to 112 %: the curves leave λ_f = 1 with a slope that Eq. 2 cannot "
        "have, so the constants mean nothing without their amplitude.",
        f"ratio of C2 {span(ratio[1:])}",
    )


def shear_pair(fits: Mapping[str, Constants], case: Mapping[str, Constants], thresholds: Thresholds) -> Finding:
    """Whether it matters which two shears are fitted: fits of an ensemble and of the case-study network by load set.

    The first and the last load set are compared.
    """
    pairs = list(fits.items())
    (first, one), (second, other) = pairs[0], pairs[-1]
    same = (np.abs(np.log(other.C2 / one.C2)) <= np.log(thresholds.same_magnitude)) & (
        np.abs(other.r_squared - one.r_squared) <= thresholds.r_squared
    )
    fit, nonlinearity = (
        [float(np.median(getattr(fit, field))) for fit in (one, other)] for field in ("r_squared", "C3")
    )
    return Finding(
        "; ".join(
            f"{name}: C2 {say(fit.C2[0], unit='MPa')}, C3 {say(fit.C3[0])}, R² {fit.r_squared[0]:.2f}"
            for name, fit in case.items()
        ),
        Verdict.REPRODUCED if holds_for_most(same, thresholds.most) else Verdict.CONTRADICTED,
        f"Fits agree in {percent(share_of(same))} of {same.size} networks (C2 within a factor of "
        f"{thresholds.same_magnitude:g}, R² within {thresholds.r_squared:g}); medians with {first} and {second}: R² "
        f"{fit[0]:.2f} and {fit[1]:.2f}, C3 {say(nonlinearity[0])} and {say(nonlinearity[1])}.",
        "; ".join(f"{name}: C3 {span(fit.C3[1:])}, R² {span(fit.r_squared[1:])}" for name, fit in case.items()),
    )


def _ends(ends: Mapping[str, Constants]) -> str:
    """C2 and C3 of the paper's networks 1 and 5, by load set; of each name the paper's network stands first."""
    said = []
    for name, one in ends.items():
        first, fifth = _pair(one)
        moduli, nonlinearities = say(first.C2[0], fifth.C2[0], unit="MPa"), say(first.C3[0], fifth.C3[0])
        said.append(f"{name}, networks 1 and 5: C2 {moduli}, C3 {nonlinearities}")
    return "; ".join(said)


def _spread(ends: Mapping[str, Constants]) -> str:
    said = []
    for name, one in ends.items():
        first, fifth = _pair(one)
        moduli, nonlinearities = (
            f"{span(getattr(first, constant)[1:])} and {span(getattr(fifth, constant)[1:])}"
            for constant in ("C2", "C3")
        )
        said.append(f"{name}: C2 {moduli} MPa, C3 {nonlinearities}")
    return "; ".join(said)


def _pair(ends: Constants) -> list[Constants]:
    return [ends.called(str(name)) for name in dict.fromkeys(ends.names.tolist())]


def _said(trends: Mapping[str, Trend], fits: Mapping[str, Constants]) -> str:
    count = len(next(iter(fits.values())).H11)
    found = "; ".join(f"{name}: {trend}" for name, trend in trends.items())
    return f"Rank correlations with H11 over {count} networks, and single networks, {found}."
