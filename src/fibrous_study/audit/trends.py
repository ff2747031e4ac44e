"""Statements of sections 3.2 and 4.1 about how C2 and C3 change with alignment.

Each network of the study is fitted up to its own λ_f, that of one x-stretch, which grows with alignment; since the
constants depend on how far a network is followed, a trend is looked for up to one λ_f of all networks, too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np

from fibrous_study.audit.evidence import Constants, Fits
from fibrous_study.audit.finding import (
    Array,
    Finding,
    Thresholds,
    Verdict,
    judged,
    listed,
    over_replicates,
    percent,
    rank_correlation,
    say,
    share_of,
    span,
    stretches,
    where,
)

BySet = Mapping[str, Fits]
# By load set: in fits up to the networks' own λ_f, and up to a common one.
Holds = tuple[dict[str, bool], dict[str, bool]]


@dataclass(frozen=True)
class Trend:
    """How C2 and C3 change with alignment in the fits of one load set.

    count : networks of the ensemble aligned with x, of which C2 and C3 are the rank correlations with H11
    C2_ends, C3_ends : share of the pairs of networks 1 and 5 in which network 5 has the larger constant
    at_bound : share of the networks with C3 = 0
    """

    count: int
    C2: float
    C3: float
    C2_ends: float
    C3_ends: float
    at_bound: float

    @classmethod
    def of(cls, fits: Fits) -> Self:
        """Of fits of one load set."""
        aligned = fits.ensemble.along_x()
        return cls(
            len(aligned.H11),
            rank_correlation(aligned.H11, aligned.C2),
            rank_correlation(aligned.H11, aligned.C3),
            _larger(fits.fifth.C2, fits.first.C2),
            _larger(fits.fifth.C3, fits.first.C3),
            share_of(aligned.C3 == 0.0),
        )

    def rises(self, constant: str, thresholds: Thresholds) -> bool:
        """Whether C2 or C3 clearly rises, over the ensemble and from network 1 to network 5."""
        rank, ends = getattr(self, constant), getattr(self, f"{constant}_ends")
        return bool(rank >= thresholds.trend_of(self.count) and ends >= thresholds.most)

    def falls(self, constant: str, thresholds: Thresholds) -> bool:
        """Whether C2 or C3 clearly falls, likewise."""
        rank, ends = getattr(self, constant), getattr(self, f"{constant}_ends")
        return bool(rank <= -thresholds.trend_of(self.count) and ends <= 1.0 - thresholds.most)


@dataclass(frozen=True)
class _Trends:
    """Trends by load set, up to the networks' own λ_f and up to a common one."""

    own: dict[str, Trend]
    common: dict[str, Trend]

    @classmethod
    def of(cls, own: BySet, common: BySet) -> Self:
        return cls(*({name: Trend.of(fits) for name, fits in one.items()} for one in (own, common)))

    def holds(self, way: str, constant: str, thresholds: Thresholds) -> Holds:
        """Whether C2 or C3 rises or falls, the `way`, by load set: at the networks' own λ_f and at the common one."""
        own, common = (
            {name: getattr(trend, way)(constant, thresholds) for name, trend in trends.items()}
            for trends in (self.own, self.common)
        )
        return own, common

    def ranks(self, constant: str) -> tuple[str, str]:
        """Rank correlations of a constant with H11 in the order of the load sets, at both."""
        own, common = (
            listed([f"{getattr(trend, constant):+.2f}" for trend in trends.values()])
            for trends in (self.own, self.common)
        )
        return own, common

    def at_bound(self) -> tuple[str, str]:
        """Shares of networks with C3 = 0 in the order of the load sets, at both."""
        own, common = (
            listed([percent(trend.at_bound) for trend in trends.values()]) for trends in (self.own, self.common)
        )
        return own, common


def near_isotropy(own: BySet, common: BySet, thresholds: Thresholds) -> Finding:
    """Section 3.2: C2 falls and C3 rises with alignment; fits to the networks' own λ_f and to a common one."""
    trends = _Trends.of(own, common)
    falls, rises, nonlinear = _ways(trends, thresholds)
    against = _any(rises) and not _any(falls)
    parts = [holds for pair in (falls, nonlinear) for one in pair for holds in one.values()]
    return Finding(
        _ends(own, common),
        Verdict.CONTRADICTED if against else judged(parts),
        f"F{_modulus(trends, own, common, 'rises' if against else 'falls', rises if against else falls)[1:]}"
        f"{', as section 4.1 says' if against else ''}. {_nonlinearity(trends, own, nonlinear)}.",
        _spread(own, common),
    )


def growth(own: BySet, common: BySet, thresholds: Thresholds) -> Finding:
    """Section 4.1: C2 and C3 both rise with alignment; on C2 section 3.2 says the opposite, on C3 the same."""
    trends = _Trends.of(own, common)
    falls, rises, nonlinear = _ways(trends, thresholds)
    against = _any(falls) and not _any(rises)
    parts = [holds for pair in (rises, nonlinear) for one in pair for holds in one.values()]
    return Finding(
        _ends(own, common),
        Verdict.CONTRADICTED if against else judged(parts),
        "On the modulus section 3.2 says the opposite: "
        f"{_modulus(trends, own, common, 'falls' if against else 'rises', falls if against else rises)}. On "
        f"nonlinearity both sections agree: {_nonlinearity(trends, own, nonlinear)}.",
        _spread(own, common),
    )


def _ways(trends: _Trends, thresholds: Thresholds) -> tuple[Holds, Holds, Holds]:
    """Whether C2 falls, C2 rises and C3 rises."""
    return (
        trends.holds("falls", "C2", thresholds),
        trends.holds("rises", "C2", thresholds),
        trends.holds("rises", "C3", thresholds),
    )


def _modulus(trends: _Trends, own: BySet, common: BySet, way: str, holds: Holds) -> str:
    """What C2 does where networks are fitted up to their own λ_f, and up to one of all."""
    amplitudes = np.concatenate([fits.ensemble.along_x().amplitude for fits in own.values()])
    limit = max(float(fits.ensemble.amplitude.max()) for fits in common.values())
    of_own, of_common = trends.ranks("C2")
    return (
        f"fitted up to each network's own λ_f ({stretches(amplitudes)}) C2 {way} {where(holds[0])} (rank correlations "
        f"with H11 {of_own} with {listed(list(own))}), and up to one λ_f of {stretches(limit)} for all "
        f"{where(holds[1])} ({of_common})"
    )


def _nonlinearity(trends: _Trends, own: BySet, holds: Holds) -> str:
    """The same of C3, how many fits are at its bound, and over which networks."""
    (of_own, of_common), (bound, common_bound) = trends.ranks("C3"), trends.at_bound()
    ensemble = next(iter(own.values())).ensemble
    return (
        f"C3 rises {where(holds[0])} in the first case ({of_own}; it is 0, its bound, in {bound} of networks) and "
        f"{where(holds[1])} in the second ({of_common}; {common_bound}); correlations are over the "
        f"{len(ensemble.along_x().H11)} of {len(ensemble.H11)} networks whose H11 is the largest component, and "
        "networks 1 and 5 must agree"
    )


def _any(holds: Holds) -> bool:
    return any(one for part in holds for one in part.values())


def _larger(fifth: Array, first: Array) -> float:
    """Share of all pairs in which network 5 has the larger value."""
    return share_of(fifth[:, None] > first)


def _ends(own: BySet, common: BySet) -> str:
    """C2 and C3 of the paper's networks 1 and 5, with their amplitudes."""
    said = []
    for name, fits in own.items():
        parts = [
            f"C2 {say(one.first.C2[0], one.fifth.C2[0], unit='MPa')}, C3 {say(one.first.C3[0], one.fifth.C3[0])} up to "
            f"λ_f = {stretches(one.first.amplitude[0])}, {stretches(one.fifth.amplitude[0])}"
            for one in (fits, common[name])
        ]
        said.append(f"networks 1 and 5 with {name}: {' and '.join(parts)}")
    return "; ".join(said)


def _spread(own: BySet, common: BySet) -> str:
    said = []
    for name, fits in own.items():
        for word, one in (("own", fits), ("common", common[name])):
            said.append(
                f"{name}, {word} λ_f: C2 {_range(one.first, 'C2')} and {_range(one.fifth, 'C2')} MPa, "
                f"C3 {_range(one.first, 'C3')} and {_range(one.fifth, 'C3')}"
            )
    count = min(len(one.C2) for fits in own.values() for one in (fits.first, fits.fifth)) - 1
    return over_replicates(said, count)


def _range(one: Constants, constant: str) -> str:
    return span(getattr(one, constant)[1:])
