"""Statements of sections 2.3, 2.5 and 3.1 to 4.1 about networks and their curves, network by network."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fibrous.deformation import Load, averaged_stretch, right_cauchy_green
from fibrous_study.audit.evidence import Evidence
from fibrous_study.audit.verdict import (
    ENSEMBLE,
    NAMED,
    Array,
    Finding,
    Verdict,
    fraction,
    half_of_last_digit,
    judged,
    judges,
    numbers,
    rank_correlation,
)


@judges("case-alignment")
def alignment(evidence: Evidence, printed: Mapping[str, float]) -> Finding:
    """The case-study network's H, to half of the last digit printed."""
    diagonal = np.einsum("nii->in", evidence.tensors)
    wanted = [printed[name] for name in ("H11", "H22", "H33")]
    off, doubt = float(np.abs(diagonal[:, 0] - wanted).max()), half_of_last_digit(wanted)
    tensor = dict(zip(("H11", "H22", "H33"), diagonal, strict=True))
    return Finding(judged([off <= doubt]), [*numbers(tensor, printed=printed), *numbers(off=off, rounding=doubt)])


@judges("case-volume-fraction")
def volume_fraction(evidence: Evidence, printed: Mapping[str, float]) -> Finding:
    """The volume fraction of the case-study network."""
    fractions = evidence.fractions
    agrees = evidence.thresholds.agrees(fractions[0], printed["volume_fraction"])
    return Finding(judged([agrees]), numbers(volume_fraction=fractions, printed=printed))


@judges("realignment-spread", NAMED)
def realignment(evidence: Evidence, _: Mapping[str, float]) -> Finding:
    """How far the largest eigenvalue of h is apart between loads at the ends of the small and of the large range.

    By itself and, since the statement may mean it so, over λ_f − 1, which grows by far more.
    """
    mostly, parts, found = evidence.thresholds.mostly, [], []
    small, large = evidence.case(evidence.small), evidence.case(evidence.large)
    for name, loads in evidence.load_sets.items():
        few, many = (
            np.ptp(curves.under(loads).largest_orientation_eigenvalue[..., -1], axis=1) for curves in (small, large)
        )
        early, late = (
            apart / (curves.averaged_stretch[..., -1].max(axis=1) - 1.0)
            for apart, curves in ((few, small), (many, large))
        )
        varies, more = mostly(many >= evidence.thresholds.orientation), mostly(few > many)
        parts += [varies, more]
        found += numbers(load_set=name, apart_small=few, apart_large=many, rate_small=early, rate_large=late)
        found += numbers(load_set=name, varies=varies, more_at_small=more, faster_at_small=mostly(early > late))
    return Finding(judged(parts), found)


def dissimilarities(evidence: Evidence, loads: tuple[str, ...]) -> tuple[Array, Array, bool]:
    """Largest over least W of the case study's loads at one λ_f, shape (networks,), and whether the loads approach.

    At the ends of the small and of the large range; they approach each other where they differ at the first, and by
    less at the second.
    """
    few, many = (evidence.case(one).under(loads).dissimilarity() for one in (evidence.small, evidence.large))
    return few, many, evidence.thresholds.mostly((few >= evidence.thresholds.same_magnitude) & (many < few))


@judges("curves-converge", NAMED)
def convergence(evidence: Evidence, _: Mapping[str, float]) -> Finding:
    """Whether the loads' W at one λ_f differ by less at the end of the large range than at that of the small one."""
    parts, found = [], []
    for name, loads in evidence.load_sets.items():
        few, many, approach = dissimilarities(evidence, loads)
        parts.append(approach)
        found += numbers(load_set=name, W_ratio_small=few, W_ratio_large=many, approach=approach)
    small, large = (float(evidence.case(one).reach[0]) for one in (evidence.small, evidence.large))
    return Finding(judged(parts), [*found, *numbers(lambda_f_small=small, lambda_f_large=large)])


@judges("network3-stretches", NAMED)
def magnitudes(evidence: Evidence, printed: Mapping[str, float]) -> Finding:
    """Magnitudes of the xy- and xz-biaxial loads that reach one λ_f in network 3."""
    curves, asked = evidence.network(3), evidence.asked[evidence.survey[2]]
    pair = curves.under(("xy_biaxial", "xz_biaxial"))
    ends, values = pair.magnitude[..., -1], [printed[load] for load in pair.loads]
    # λ_f of the printed magnitudes, and of the ends of what they may be rounded from.
    doubt = half_of_last_digit(values)
    stretch, least, largest = (
        [
            float(averaged_stretch(Load.parse(load).deformation_gradient(value + change), asked))
            for load, value in zip(pair.loads, values, strict=True)
        ]
        for change in (0.0, -doubt, doubt)
    )
    one_stretch = max(least) <= min(largest)
    return Finding(
        judged([evidence.thresholds.agrees(ends[0], values)]) if one_stretch else Verdict.CONTRADICTED,
        [
            *numbers(dict(zip(pair.loads, ends.T, strict=True)), printed=printed),
            *numbers(lambda_f=curves.averaged_stretch[0, 0, -1]),
            *numbers({f"lambda_f_of_printed_{load}": one for load, one in zip(pair.loads, stretch, strict=True)}),
        ],
    )


@judges("network3-stiffer-transverse", NAMED)
def stiffer_across(evidence: Evidence, _: Mapping[str, float]) -> Finding:
    """Whether network 3, aligned with z, stores more energy under the loads across z than along it, at one λ_f."""
    curves = evidence.network(3)
    across = curves.under(("x_uniaxial", "xy_biaxial", "xz_biaxial"))
    energy = across.energies_at(curves.reach)
    ratio = energy[:, :2] / energy[:, 2:]
    return Finding(
        judged([evidence.thresholds.mostly(one > 1.0) for one in ratio.T]),
        [
            *numbers(x_uniaxial=ratio[:, 0], xy_biaxial=ratio[:, 1], lambda_f=curves.reach[0]),
            *numbers({f"W_{load}": one for load, one in zip(across.loads, energy.T, strict=True)}, unit="MPa"),
            *numbers(dict(zip(("end_x", "end_xy", "end_xz"), across.magnitude[0, :, -1], strict=True))),
        ],
    )


@judges("newton-iterations", ENSEMBLE)
def newton_iterations(evidence: Evidence, printed: Mapping[str, float]) -> Finding:
    """Newton iterations per step, over all networks, loads and steps after rest."""
    spent, thresholds = evidence.ensemble.newton_iterations[..., 1:], evidence.thresholds
    within, below = (spent >= printed["least"]) & (spent <= printed["most"]), spent <= printed["most"]
    few, middle, many = np.percentile(spent, (5, 50, 95))
    found = numbers(median=middle, percentile_5=few, percentile_95=many, states=spent.size)
    found += numbers(least=spent.min(), most=spent.max(), printed=printed)
    found += numbers(within=fraction(within), not_more=fraction(below))
    if thresholds.mostly(within):
        return Finding(Verdict.REPRODUCED, found)
    return Finding(Verdict.PARTLY if thresholds.mostly(below) else Verdict.NOT, found)


@judges("figure-3-rows", NAMED)
def rows_of_figure_3(evidence: Evidence, _: Mapping[str, float]) -> Finding:
    """Which range rows a and b of Fig. 3 show: section 3.1 and the caption say the opposite of each other."""
    found = []
    for name, curves in (("small", evidence.case(evidence.small)), ("large", evidence.case(evidence.large))):
        stretch, gradient = curves.averaged_stretch[0, 0, -1], curves.deformation_gradient[0, 0, -1]
        cube = 0.5 * (right_cauchy_green(gradient)[0, 0] - 1.0)
        fibers = 0.5 * (stretch**2 - 1.0)
        found += numbers({f"E_cube_{name}": cube, f"E_fibers_{name}": fibers, f"lambda_f_{name}": stretch})
    return Finding(Verdict.CONTRADICTED, found)


@judges("dissimilar-with-alignment", ENSEMBLE)
def dissimilarity(evidence: Evidence, _: Mapping[str, float]) -> Finding:
    """Whether curves of more aligned networks differ more, over those of an ensemble that are aligned with x.

    All are compared at the smallest λ_f that all of them reach under all loads, and each at its own largest λ_f, too.
    """
    aligned = evidence.ensemble.along_x()
    parts, found = [], numbers(aligned=len(aligned.names), networks=len(evidence.ensemble.names))
    for name, loads in evidence.load_sets.items():
        curves = aligned.under(loads)
        common = float(curves.reach.min())
        at_common, at_largest = curves.dissimilarity(common), curves.dissimilarity()
        rank, rank_at_largest = (rank_correlation(curves.H11, one) for one in (at_common, at_largest))
        parts.append(rank >= evidence.thresholds.trend_of(len(curves.names)))
        first, last = _fifths(curves.H11, at_common)
        cut = curves.amplitude_limited.any(axis=1).sum()
        found += numbers(load_set=name, rank=rank, rank_at_largest=rank_at_largest, lambda_f=common, rises=parts[-1])
        found += numbers(load_set=name, W_ratio_least_aligned=first, W_ratio_most_aligned=last, cut=cut)
    return Finding(judged(parts), found)


def _fifths(order: Array, values: Array) -> tuple[float, float]:
    """Medians of `values` over the least and the largest fifth by `order`."""
    ranked = values[np.argsort(order, kind="stable")]
    count = max(1, len(ranked) // 5)
    return float(np.median(ranked[:count])), float(np.median(ranked[-count:]))


@judges("fit-spread-grows", NAMED, ENSEMBLE)
def fit_spread(evidence: Evidence, _: Mapping[str, float]) -> Finding:
    """Whether curves of networks 4 and 5 scatter more than network 1's tight ones, and fits get worse with alignment.

    Networks 1 to 5 with their replicates are compared at the smallest λ_f that all of them reach under all loads.
    """
    thresholds, parts, found = evidence.thresholds, [], []
    for name, loads in evidence.load_sets.items():
        curves = [evidence.network(k).under(loads) for k in range(1, 6)]
        common = min(float(one.reach.min()) for one in curves)
        ratio, at_largest = [one.dissimilarity(common) for one in curves], [one.dissimilarity() for one in curves]
        wider = all(thresholds.mostly(one[:, None] > ratio[0]) for one in ratio[3:])
        tight = thresholds.mostly(ratio[0] <= thresholds.same_magnitude)
        aligned = evidence.ensemble_large_fits[name].along_x()
        rank = rank_correlation(aligned.H11, aligned.r_squared)
        worse = rank <= -thresholds.trend_of(len(aligned.H11))
        parts += [wider, tight, worse]
        found += numbers({f"W_ratio_{k}": one for k, one in enumerate(ratio, 1)}, load_set=name)
        found += numbers({f"W_ratio_at_largest_{k}": one for k, one in enumerate(at_largest, 1)}, load_set=name)
        found += numbers(load_set=name, lambda_f=common, wider=wider, tight=tight, rank_r_squared=rank, worse=worse)
        found += numbers(load_set=name, cut=sum(one.amplitude_limited.any(axis=1).sum() for one in curves))
    return Finding(
        judged(parts),
        [*found, *numbers(aligned=len(aligned.H11), networks=sum(len(one.names) for one in curves))],
    )
