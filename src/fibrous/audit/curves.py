"""Statements of sections 2.3, 2.5, 3.1 and 4.1 about networks and their curves."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from fibrous.audit.evidence import Constants, Curves
from fibrous.audit.finding import (
    Array,
    Finding,
    Statement,
    Thresholds,
    Verdict,
    agrees,
    holds_for_most,
    judged,
    listed,
    percent,
    rank_correlation,
    say,
    share_of,
    span,
)
from fibrous.deformation import Load, averaged_stretch
from fibrous.fitting import hgo
from fibrous.fitting.hgo import fit_constants

LoadSets = Mapping[str, tuple[str, ...]]


def alignment(statement: Statement, tensors: Array) -> Finding:
    """The case-study network's H, shape (networks, 3, 3), the paper's first; printed with two decimals."""
    diagonal = np.einsum("nii->ni", tensors)
    off = np.abs(diagonal[0] - statement.value).max()
    return Finding(
        ", ".join(f"{one:.3f}" for one in diagonal[0]),
        judged([off <= 0.5e-2]),
        f"The generator is asked for this tensor; its network is off by {off:.1g} at most.",
        "; ".join(f"H{i + 1}{i + 1} {span(diagonal[1:, i])}" for i in range(3)),
    )


def volume_fraction(statement: Statement, fractions: Array, thresholds: Thresholds) -> Finding:
    """The volume fraction, shape (networks,), the paper's first."""
    return Finding(
        f"{fractions[0]:.4f}",
        judged([agrees(fractions[0], statement.value, thresholds.printed_digits)]),
        "The generator sizes its cube until the fibres fill this share of it exactly (Eq. 5).",
        f"{fractions[1:].min():.4f} to {fractions[1:].max():.4f}",
    )


def realignment(small: Curves, large: Curves, load_sets: LoadSets, thresholds: Thresholds) -> Finding:
    """How far the largest eigenvalue of h is apart between loads at the ends of the small and of the large range."""
    varies, most_at_small, said, rates, spreads = [], [], [], [], []
    for name, loads in load_sets.items():
        few, many = (np.ptp(curves.under(loads).orientation[..., -1], axis=1) for curves in (small, large))
        strains = [curves.averaged_stretch[..., -1].max(axis=1) - 1.0 for curves in (small, large)]
        varies.append(holds_for_most(many >= thresholds.orientation, thresholds.most))
        most_at_small.append(holds_for_most(few > many, thresholds.most))
        said.append(f"{name}: apart by {say(few[0])} at the end of the small, {say(many[0])} of the large range")
        rates.append(f"{say(few[0] / strains[0][0])} against {say(many[0] / strains[1][0])} ({name})")
        spreads.append(f"{name}: {span(few[1:])}, {span(many[1:])}")
    return Finding(
        "; ".join(said),
        judged([*varies, *most_at_small]),
        _by_set(load_sets, varies, "The eigenvalue depends on the load")
        + _by_set(load_sets, most_at_small, " It differs more at small than at large strain")
        + f" Per unit of λ_f it does: {'; '.join(rates)}.",
        "; ".join(spreads),
    )


def convergence_of_curves(small: Curves, large: Curves, load_sets: LoadSets, thresholds: Thresholds) -> Finding:
    """Whether the loads' W at one λ_f differ by less at the end of the large range than at that of the small one."""
    holds, said, spreads = [], [], []
    for name, loads in load_sets.items():
        few, many = (curves.under(loads).dissimilarity() for curves in (small, large))
        holds.append(holds_for_most((few >= thresholds.same_magnitude) & (many < few), thresholds.most))
        said.append(f"{name}: W apart by a factor of {say(few[0])} at small, {say(many[0])} at large strain")
        spreads.append(f"{name}: {span(few[1:])}, {span(many[1:])}")
    return Finding(
        "; ".join(said),
        judged(holds),
        _by_set(load_sets, holds, "The curves approach each other")
        + " The factor is that of the largest to the least W at the same λ_f.",
        "; ".join(spreads),
    )


def dissimilarity(ensemble: Curves, load_sets: LoadSets, thresholds: Thresholds) -> Finding:
    """Whether curves of more aligned networks differ more, over the whole ensemble."""
    H11 = ensemble.structure_tensor[:, 0, 0]
    holds, said, medians = [], [], []
    for name, loads in load_sets.items():
        factor = ensemble.under(loads).dissimilarity()
        trend = rank_correlation(H11, factor)
        holds.append(trend >= thresholds.trend)
        said.append(f"{name}: rank correlation with H11 {trend:+.2f}")
        first, last = _fifths(H11, factor)
        medians.append(f"from {say(first)} to {say(last)} ({name})")
    return Finding(
        "; ".join(said),
        judged(holds),
        _by_set(load_sets, holds, "Curves of more aligned networks differ more")
        + " The largest over the least W at one λ_f goes, as a median over the least and the most aligned fifth, "
        + "; ".join(medians)
        + ".",
    )


def fit_spread(
    survey: Mapping[str, Curves], fits: Mapping[str, Constants], load_sets: LoadSets, thresholds: Thresholds
) -> Finding:
    """Whether curves of networks 4 and 5 scatter more than network 1's, and the fit gets worse with alignment.

    `survey` holds networks 1 to 5 with their replicates, `fits` the whole ensemble's by load set.
    """
    first, *_, fourth, fifth = survey
    parts, said, why, spreads = [], [], [], []
    for name, loads in load_sets.items():
        factors = {network: curves.under(loads).dissimilarity() for network, curves in survey.items()}
        wider = holds_for_most(np.minimum(factors[fourth], factors[fifth]) > factors[first], thresholds.most)
        trend = rank_correlation(fits[name].H11, fits[name].r_squared)
        parts += [wider, trend <= -thresholds.trend]
        said.append(f"{name}: W of networks 1 to 5 apart by {say(*(one[0] for one in factors.values()))}")
        why.append(
            f"with {name} networks 4 and 5 scatter {'more' if wider else 'no more'} than network 1, and R² of the fits "
            f"{'falls' if parts[-1] else 'does not fall'} with H11 (rank correlation {trend:+.2f})"
        )
        spreads.append(f"{name}: " + ", ".join(span(one[1:]) for one in factors.values()))
    return Finding("; ".join(said), judged(parts), f"W{'; '.join(why)[1:]}.", "; ".join(spreads))


def magnitudes(statement: Statement, curves: Curves, asked: Array, thresholds: Thresholds) -> Finding:
    """Magnitudes of the xy- and xz-biaxial loads that reach one λ_f in network 3, of tensor `asked`, shape (3, 3)."""
    pair = curves.under(("xy_biaxial", "xz_biaxial"))
    ends = pair.magnitude[..., -1]
    printed = [
        float(averaged_stretch(Load.parse(load).deformation_gradient(value), asked))
        for load, value in zip(pair.loads, statement.value, strict=True)
    ]
    if agrees(printed[0], printed[1], 10 * thresholds.printed_digits):
        verdict = judged([agrees(ends[0], statement.value, thresholds.printed_digits)])
        why = f"The printed magnitudes reach λ_f = {say(*printed)}."
    else:
        verdict = Verdict.CONTRADICTED
        why = (
            f"At the network's H the printed magnitudes mean λ_f = {printed[0]:.2f} and {printed[1]:.2f}, where "
            f"section 2.3 wants that of the first load for both, {curves.averaged_stretch[0, 0, -1]:.2f}."
        )
    return Finding(say(*ends[0]), verdict, why, "; ".join(span(ends[1:, i]) for i in range(2)))


def stiffer_across(curves: Curves, thresholds: Thresholds) -> Finding:
    """Whether network 3, aligned with z, stores more energy under xy- than under xz-biaxial load at one λ_f."""
    energy = curves.under(("xy_biaxial", "xz_biaxial")).energies_at_common_stretch()
    ratio = energy[:, 0] / energy[:, 1]
    return Finding(
        f"W of xy-biaxial {say(ratio[0])} times that of xz-biaxial",
        judged([holds_for_most(ratio > 1.0, thresholds.most)]),
        f"At the same λ_f W is {say(*energy[0], unit='MPa')}; the load across the alignment needs the larger stretch.",
        span(ratio[1:]),
    )


def newton_iterations(statement: Statement, ensemble: Curves, thresholds: Thresholds) -> Finding:
    """Newton iterations a step, over all networks, loads and steps after rest."""
    spent = ensemble.newton_iterations[..., 1:]
    least, most = statement.value
    inside, below = share_of((spent >= least) & (spent <= most)), share_of(spent <= most)
    if inside >= thresholds.most:
        verdict = Verdict.REPRODUCED
    else:
        verdict = Verdict.PARTLY if below >= thresholds.most else Verdict.NOT
    few, middle, many = np.percentile(spent, (5, 50, 95))
    return Finding(
        f"median {middle:.0f}, 5th to 95th percentile {few:.0f} to {many:.0f}",
        verdict,
        f"{percent(inside)} of {spent.size} states need {least:.0f} to {most:.0f} iterations, and {percent(below)} no "
        f"more than {most:.0f}: each step starts from the tangent's prediction.",
    )


def fit_families(ranges: Mapping[str, Curves], load_sets: LoadSets, largest_C3: float) -> dict[str, Array]:
    """R² of Eq. 2 fitted to each family of loads, uniaxial, biaxial and shear, shape (networks,).

    `ranges` holds curves by the words that name their range; load sets with other loads of a family give it twice.
    """
    found = {}
    for word, curves in ranges.items():
        groups = [
            tuple(load for load in loads if Load.parse(load).kind == kind)
            for loads in load_sets.values()
            for kind in ("uniaxial", "biaxial", "shear")
        ]
        for group in dict.fromkeys(group for group in groups if group):
            found[f"{' + '.join(group)} at {word}"] = _r_squared(curves.under(group), largest_C3)
    return found


def _r_squared(curves: Curves, largest_C3: float) -> Array:
    """R² of the fit of Eq. 2 to the energies of all loads, pooled, shape (networks,)."""
    fields = ("deformation_gradient", "structure_tensor", "strain_energy_density", "cauchy_stress")
    fits = [
        fit_constants(
            hgo.Curves(*(getattr(curves, field)[i] for field in fields)),
            "structure_tensor",
            "energy",
            tension_only=True,
            largest_C3=largest_C3,
            slope_fit_below_r_squared=-math.inf,  # the energy, however poor the fit
        )
        for i in range(len(curves.names))
    ]
    return np.array([fit.r_squared for fit in fits])


def families(r_squared: Mapping[str, Array], trusted: bool, thresholds: Thresholds) -> Finding:
    """Whether Eq. 2 fits within families of loads, as section 4.1 says (`trusted`), or not even there, as 3.1 says.

    `r_squared` is what `fit_families` gives. Where it fits all or none, one of the two sections contradicts the other.
    """
    good = [holds_for_most(one >= thresholds.confident_r_squared, thresholds.most) for one in r_squared.values()]
    poor = [name for name, one in zip(r_squared, good, strict=True) if not one]
    if all(good):
        verdict = Verdict.REPRODUCED if trusted else Verdict.CONTRADICTED
    elif any(good):
        verdict = Verdict.PARTLY
    else:
        verdict = Verdict.CONTRADICTED if trusted else Verdict.REPRODUCED
    return Finding(
        "; ".join(f"{name} {one[0]:.3f}" for name, one in r_squared.items()),
        verdict,
        f"R² reaches {thresholds.confident_r_squared:g} in {sum(good)} of {len(good)} families"
        + (f", not in {listed(poor)}" if poor else "")
        + f"; section {'3.1 denies' if trusted else '4.1 says'} what is said here.",
        "; ".join(f"{name} {one[1:].min():.3f} to {one[1:].max():.3f}" for name, one in r_squared.items()),
    )


def rows_of_figure_3(small: Curves, large: Curves) -> Finding:
    """Which range rows a and b of Fig. 3 show: section 3.1 and the caption say the opposite of each other."""
    strains = [0.5 * (curves.deformation_gradient[0, 0, -1, 0, 0] ** 2 - 1.0) for curves in (small, large)]
    ends = [curves.averaged_stretch[0, 0, -1] for curves in (small, large)]
    return Finding(
        f"Green strain {percent(strains[0])} ends at λ_f = {ends[0]:.3f}, {percent(strains[1])} at {ends[1]:.3f}",
        Verdict.CONTRADICTED,
        "Section 3.1 puts the small range into row a, the caption into row b. The caption is the likelier: text and "
        f"caption give c the full range, so that in the caption's order a and c both show {percent(strains[1])}.",
    )


def _fifths(order: Array, values: Array) -> tuple[float, float]:
    """Medians of `values` over the least and the largest fifth by `order`."""
    ranked = values[np.argsort(order, kind="stable")]
    count = max(1, len(ranked) // 5)
    return float(np.median(ranked[:count])), float(np.median(ranked[-count:]))


def _by_set(load_sets: LoadSets, holds: ArrayLike, what: str) -> str:
    """In which load sets a statement holds, in words."""
    yes = [name for name, one in zip(load_sets, np.asarray(holds), strict=True) if one]
    no = [name for name in load_sets if name not in yes]
    parts = [f"with {listed(yes)}"] if yes else []
    if no:
        parts.append(f"not with {' or '.join(no)}")
    return f"{what}: {', but '.join(parts)}."
