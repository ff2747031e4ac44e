"""The three-fibre example of section 3.2 (Fig. 7), from its equations alone."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from fibrous_study.audit.evidence import Evidence
from fibrous_study.audit.verdict import Finding, Verdict, judged, judges, numbers
from fibrous_study.three_fibers import State, affine, equilibrium

ALONG, ACROSS = "b", "c"  # panels of Fig. 7


def states(evidence: Evidence, panel: str) -> tuple[State, State]:
    """The affine and the balanced state of a panel of Fig. 7."""
    stretch = float(Fraction(evidence.paper["figure_7"][panel]["stretch"]))
    return affine(stretch), equilibrium(stretch)


@judges("fig7-aligned-estimate", panel=ALONG)
@judges("fig7-transverse-estimate", panel=ACROSS)
def averaged_stretch(evidence: Evidence, printed: Mapping[str, float], panel: str) -> Finding:
    """λ_f = √(H:C) of the printed H and F."""
    stretch = states(evidence, panel)[0].averaged_stretch
    agrees = evidence.thresholds.agrees(stretch, printed["lambda_f"])
    return Finding(judged([agrees]), numbers(lambda_f=stretch, printed=printed))


@judges("fig7-aligned-mean")
def aligned_mean(evidence: Evidence, printed: Mapping[str, float]) -> Finding:
    """The mean stretch along the alignment: of the affine state and of the one that Eq. 12 balances."""
    moved, balanced = states(evidence, ALONG)
    of_affine, of_balanced = (
        evidence.thresholds.agrees(state.mean_stretch, printed["mean_affine"]) for state in (moved, balanced)
    )
    return Finding(
        Verdict.PARTLY if of_affine and not of_balanced else judged([of_balanced]),
        [
            *numbers(mean_affine=moved.mean_stretch, mean_balanced=balanced.mean_stretch, printed=printed),
            *numbers(lambda_f=balanced.averaged_stretch),
            *numbers(unit="kA", force_affine=moved.vertical_force),
        ],
    )


@judges("fig7-transverse-lengths")
@judges("fig7-transverse-stretches")
def transverse(evidence: Evidence, printed: Mapping[str, float]) -> Finding:
    """What is printed of the balanced state across the alignment: L1, L2 and θ, or stretches and their mean."""
    state = states(evidence, ACROSS)[1]
    lengths = {"L1": state.lengths[0], "L2": state.lengths[1]}
    stretches = {"stretch_1": state.fiber_stretches[0], "stretch_2": state.fiber_stretches[1]}
    values = {**lengths, "theta": state.angle, **stretches, "mean": state.mean_stretch}
    found = numbers({name: values[name] for name in printed if name != "theta"}, printed=printed)
    found += numbers(unit="degree", theta=state.angle, printed=printed) if "theta" in printed else []
    return Finding(
        judged([evidence.thresholds.agrees([values[name] for name in printed], [*printed.values()])]),
        [
            *found,
            *numbers(largest=max(state.fiber_stretches), lambda_f=state.averaged_stretch),
            *numbers(unit="kA", force=abs(state.vertical_force)),
        ],
    )
