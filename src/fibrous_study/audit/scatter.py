"""Statements of sections 3.2 and 4.1 about how the curves of different loads scatter in more aligned networks."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fibrous.curves import Curves
from fibrous_study.audit.evidence import Constants
from fibrous_study.audit.finding import (
    Array,
    Finding,
    Thresholds,
    counted,
    holds_for_most,
    judged,
    listed,
    number,
    over_replicates,
    rank_correlation,
    say,
    span,
    where,
)

LoadSets = Mapping[str, tuple[str, ...]]


def dissimilarity(ensemble: Curves, load_sets: LoadSets, thresholds: Thresholds) -> Finding:
    """Whether curves of more aligned networks differ more, over those of an ensemble that are aligned with x.

    All are compared at the smallest λ_f that all of them reach under all loads; what comes out where each network is
    compared at its own largest λ_f is said, too.
    """
    aligned = ensemble.along_x()
    holds, said, medians, cuts = {}, [], [], []
    for name, loads in load_sets.items():
        curves = aligned.under(loads)
        common = float(curves.reach.min())
        at_common, at_own = curves.dissimilarity(common), curves.dissimilarity()
        trend, own = (rank_correlation(curves.H11, one) for one in (at_common, at_own))
        holds[name] = trend >= thresholds.trend_of(len(curves.names))
        said.append(
            f"{name}: rank correlation of largest over least W with H11 {trend:+.2f} at λ_f = {common:.2f}, {own:+.2f} "
            "where each network is taken at its own largest λ_f"
        )
        first, last = _fifths(curves.H11, at_common)
        medians.append(f"from {number(first)} to {number(last)} with {name}")
        cuts.append(f"{counted(int(curves.amplitude_limited.any(axis=1).sum()), 'network')} with {name}")
    return Finding(
        "; ".join(said),
        judged(holds.values()),
        f"Over the {len(aligned.names)} of {len(ensemble.names)} networks whose H11 is the largest component, compared "
        f"at one λ_f, curves of more aligned networks differ more {where(holds)}. Largest over least W goes, as a "
        f"median over the least and the most aligned fifth, {listed(medians)}; the limit of the principal stretch cuts "
        f"a load in {listed(cuts)}.",
    )


def fit_spread(
    survey: Mapping[str, Curves], fits: Mapping[str, Constants], load_sets: LoadSets, thresholds: Thresholds
) -> Finding:
    """Whether curves of networks 4 and 5 scatter more than network 1's tight ones, and fits get worse with alignment.

    `survey` holds networks 1 to 5 with their replicates, compared at the smallest λ_f that all of them reach under all
    loads; `fits` the whole ensemble's by load set, of which those aligned with x count.
    """
    first, *_, fourth, fifth = survey
    wider, tight, worse, said, ranks, cuts, spreads = {}, {}, {}, [], [], [], []
    for name, loads in load_sets.items():
        curves = {network: one.under(loads) for network, one in survey.items()}
        common = min(float(one.reach.min()) for one in curves.values())
        factors = {network: one.dissimilarity(common) for network, one in curves.items()}
        wider[name] = all(
            holds_for_most(factors[network][:, None] > factors[first], thresholds.most) for network in (fourth, fifth)
        )
        tight[name] = holds_for_most(factors[first] <= thresholds.same_magnitude, thresholds.most)
        aligned = fits[name].along_x()
        trend = rank_correlation(aligned.H11, aligned.r_squared)
        worse[name] = trend <= -thresholds.trend_of(len(aligned.H11))
        said.append(
            f"{name}: largest over least W in networks 1 to 5 {_firsts(factors)} at λ_f = {common:.2f} and "
            f"{_firsts({network: one.dissimilarity() for network, one in curves.items()})} at their own largest λ_f"
        )
        ranks.append(f"{trend:+.2f} with {name}")
        cuts.append(f"{sum(int(one.amplitude_limited.any(axis=1).sum()) for one in curves.values())} with {name}")
        spreads.append(f"{name}: " + ", ".join(span(one[1:]) for one in factors.values()))
    total = sum(len(one.names) for one in survey.values())
    return Finding(
        "; ".join(said),
        judged([*wider.values(), *tight.values(), *worse.values()]),
        f"Compared at one λ_f, curves of networks 4 and 5 scatter more than those of network 1 {where(wider)}, and "
        f"those of network 1 are within a factor of {number(thresholds.same_magnitude)} {where(tight)}. R² of the fits "
        f"falls with H11 {where(worse)} (rank correlations over the {len(aligned.H11)} networks aligned with x "
        f"{listed(ranks)}); the limit of the principal stretch cuts a load in {listed(cuts)} of the {total} networks 1 "
        "to 5 and replicates.",
        over_replicates(spreads, min(len(one.names) for one in survey.values()) - 1),
    )


def _firsts(values: Mapping[str, Array]) -> str:
    """Those of the paper's networks."""
    return say(*(float(one[0]) for one in values.values()))


def _fifths(order: Array, values: Array) -> tuple[float, float]:
    """Medians of `values` over the least and the largest fifth by `order`."""
    ranked = values[np.argsort(order, kind="stable")]
    count = max(1, len(ranked) // 5)
    return float(np.median(ranked[:count])), float(np.median(ranked[-count:]))
