"""Statements of sections 2.3, 2.5 and 3.1 to 3.3 about networks and their curves, network by network."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fibrous.curves import Curves
from fibrous.deformation import Load, averaged_stretch, right_cauchy_green
from fibrous_study.audit.finding import (
    Array,
    Finding,
    Statement,
    Thresholds,
    Verdict,
    agrees,
    half_of_last_digit,
    holds_for_most,
    judged,
    listed,
    number,
    over_replicates,
    percent,
    say,
    share_of,
    span,
    where,
)

LoadSets = Mapping[str, tuple[str, ...]]


def alignment(statement: Statement, tensors: Array) -> Finding:
    """The case-study network's H, shape (networks, 3, 3), the paper's first, to half the last digit printed."""
    diagonal = np.einsum("nii->ni", tensors)
    off, doubt = float(np.abs(diagonal[0] - statement.value).max()), half_of_last_digit(statement.value)
    return Finding(
        ", ".join(f"{one:.3f}" for one in diagonal[0]),
        judged([off <= doubt]),
        f"The generated network is off by {number(off, 1)} at most, where half of the last digit printed is "
        f"{number(doubt)}.",
        over_replicates([f"H{i + 1}{i + 1} {span(diagonal[1:, i])}" for i in range(3)], len(tensors) - 1),
    )


def volume_fraction(statement: Statement, fractions: Array, thresholds: Thresholds) -> Finding:
    """The volume fraction, shape (networks,), the paper's first."""
    return Finding(
        f"{fractions[0]:.4f}",
        judged([agrees(fractions[0], statement.value, thresholds.printed_digits)]),
        "The generator sizes its cube until the fibres fill this share of it (Eq. 5).",
        over_replicates([f"{fractions[1:].min():.4f} to {fractions[1:].max():.4f}"], len(fractions) - 1),
    )


def realignment(small: Curves, large: Curves, load_sets: LoadSets, thresholds: Thresholds) -> Finding:
    """How far the largest eigenvalue of h is apart between loads at the ends of the small and of the large range.

    By itself and, since the statement may mean it so, over λ_f − 1, which grows by far more.
    """
    varies, more, faster, said, rates, spreads = {}, {}, {}, [], [], []
    for name, loads in load_sets.items():
        few, many = (
            np.ptp(curves.under(loads).largest_orientation_eigenvalue[..., -1], axis=1) for curves in (small, large)
        )
        rate, later = (
            apart / (curves.averaged_stretch[..., -1].max(axis=1) - 1.0)
            for apart, curves in ((few, small), (many, large))
        )
        varies[name] = holds_for_most(many >= thresholds.orientation, thresholds.most)
        more[name] = holds_for_most(few > many, thresholds.most)
        faster[name] = holds_for_most(rate > later, thresholds.most)
        said.append(
            f"{name}: largest less least eigenvalue {say(few[0])} at the end of the small range, {say(many[0])} of "
            "the large range"
        )
        rates.append(f"{say(rate[0])} against {say(later[0])} with {name}")
        spreads.append(f"{name}: {span(few[1:])} and {span(many[1:])}")
    return Finding(
        "; ".join(said),
        judged([*varies.values(), *more.values()]),
        f"The eigenvalue depends on the load {where(varies)}, and differs more between loads at the end of the small "
        f"range than at that of the large one {where(more)}. Per unit of λ_f − 1 it differs more at small strain "
        f"{where(faster)}: {listed(rates)}.",
        over_replicates(spreads, len(small.names) - 1),
    )


def converge(small: Curves, large: Curves, loads: tuple[str, ...], thresholds: Thresholds) -> bool:
    """Whether the loads' W at one λ_f differ at the end of the small range, and by less at that of the large one."""
    few, many = (curves.under(loads).dissimilarity() for curves in (small, large))
    return holds_for_most((few >= thresholds.same_magnitude) & (many < few), thresholds.most)


def convergence_of_curves(small: Curves, large: Curves, load_sets: LoadSets, thresholds: Thresholds) -> Finding:
    """Whether the loads' W at one λ_f differ by less at the end of the large range than at that of the small one."""
    holds = {name: converge(small, large, loads, thresholds) for name, loads in load_sets.items()}
    said, spreads = [], []
    for name, loads in load_sets.items():
        few, many = (curves.under(loads).dissimilarity() for curves in (small, large))
        said.append(f"{name}: largest over least W {say(few[0])} at small, {say(many[0])} at large strain")
        spreads.append(f"{name}: {span(few[1:])} and {span(many[1:])}")
    ends = [float(curves.reach[0]) for curves in (small, large)]
    return Finding(
        "; ".join(said),
        judged(holds.values()),
        f"The curves approach each other {where(holds)}. Compared is W of all loads at the λ_f that they all reach, "
        f"{ends[0]:.2f} at 10 % Green strain and {ends[1]:.2f} at 112 %.",
        over_replicates(spreads, len(small.names) - 1),
    )


def magnitudes(statement: Statement, curves: Curves, asked: Array, thresholds: Thresholds) -> Finding:
    """Magnitudes of the xy- and xz-biaxial loads that reach one λ_f in network 3, of tensor `asked`, shape (3, 3)."""
    pair = curves.under(("xy_biaxial", "xz_biaxial"))
    ends = pair.magnitude[..., -1]
    # λ_f of the printed magnitudes, and of the ends of what they may be rounded from.
    doubt = half_of_last_digit(statement.value)
    printed, least, largest = (
        [
            float(averaged_stretch(Load.parse(load).deformation_gradient(value + change), asked))
            for load, value in zip(pair.loads, statement.value, strict=True)
        ]
        for change in (0.0, -doubt, doubt)
    )
    if max(least) <= min(largest):
        verdict = judged([agrees(ends[0], statement.value, thresholds.printed_digits)])
        why = f"The printed magnitudes reach λ_f = {say(*printed)}."
    else:
        verdict = Verdict.CONTRADICTED
        why = (
            f"At the network's H the printed magnitudes mean λ_f = {printed[0]:.2f} and {printed[1]:.2f}, where "
            f"section 2.3 wants that of the first load for both, {curves.averaged_stretch[0, 0, -1]:.2f}."
        )
    spreads = [f"{load} {span(ends[1:, i])}" for i, load in enumerate(pair.loads)]
    here = ", ".join(f"{load} {number(end)}" for load, end in zip(pair.loads, ends[0], strict=True))
    return Finding(here, verdict, why, over_replicates(spreads, len(ends) - 1))


def stiffer_across(curves: Curves, thresholds: Thresholds) -> Finding:
    """Whether network 3, aligned with z, stores more energy under the loads across z than along it, at one λ_f."""
    energy = curves.under(("x_uniaxial", "xy_biaxial", "xz_biaxial")).energies_at(curves.reach)
    ratio = energy[:, :2] / energy[:, 2:]
    ends = curves.under(("x_uniaxial", "xy_biaxial", "xz_biaxial")).magnitude[0, :, -1]
    return Finding(
        f"W of x-uniaxial {say(ratio[0, 0])} and of xy-biaxial {say(ratio[0, 1])} times that of xz-biaxial",
        judged([holds_for_most(one > 1.0, thresholds.most) for one in ratio.T]),
        f"At λ_f = {curves.reach[0]:.2f} W is {say(*energy[0, :2], unit='MPa')} under x-uniaxial and xy-biaxial "
        f"stretch, across the alignment, and {say(energy[0, 2], unit='MPa')} under xz-biaxial stretch, along it; the "
        f"magnitudes at the ends of these loads are {say(*ends)}.",
        over_replicates(
            [f"{load} {span(ratio[1:, i])}" for i, load in enumerate(("x-uniaxial", "xy-biaxial"))], len(ratio) - 1
        ),
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
        f"{percent(inside)} of {spent.size:,} states need {least:.0f} to {most:.0f} iterations, and {percent(below)} "
        f"no more than {most:.0f}: each step starts from the tangent's prediction.",
    )


def rows_of_figure_3(small: Curves, large: Curves) -> Finding:
    """Which range rows a and b of Fig. 3 show: section 3.1 and the caption say the opposite of each other."""
    ends = [curves.deformation_gradient[0, 0, -1] for curves in (small, large)]
    cube = [0.5 * (right_cauchy_green(end)[0, 0] - 1.0) for end in ends]
    stretch = [curves.averaged_stretch[0, 0, -1] for curves in (small, large)]
    mean_fiber = [0.5 * (end**2 - 1.0) for end in stretch]
    return Finding(
        f"Green strain {percent(cube[0])} along x ends at λ_f = {stretch[0]:.3f}, {percent(cube[1])} at "
        f"{stretch[1]:.3f}",
        Verdict.CONTRADICTED,
        "Section 3.1 puts the small range into row a and the caption into row b, which no data of ours can decide. The "
        f"percentages are the cube's Green strain along x, {percent(cube[0])} and {percent(cube[1])}, and not that of "
        f"the fibres, as the caption says, which is ½(λ_f² − 1) = {percent(mean_fiber[0])} and "
        f"{percent(mean_fiber[1])}; the caption also gives d, the close-up of small stretches in the text, the large "
        "range.",
    )
