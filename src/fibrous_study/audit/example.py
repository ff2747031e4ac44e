"""The three-fibre example of section 3.2 (Fig. 7), from its equations alone."""

from __future__ import annotations

from fibrous_study.audit.finding import Finding, Statement, Thresholds, Verdict, agrees, judged, number
from fibrous_study.three_fibers import State


def averaged_stretch(statement: Statement, state: State, thresholds: Thresholds) -> Finding:
    """λ_f of a state against the printed one."""
    found = state.averaged_stretch
    return Finding(
        f"{found:.3f}",
        judged([agrees(found, statement.value, thresholds.printed_digits)]),
        f"√(H:C) of the printed H and F is {found:.4f}.",
    )


def aligned_mean(statement: Statement, affine: State, equilibrium: State, thresholds: Thresholds) -> Finding:
    """The mean stretch along the alignment: of the affine state and of the one that Eq. 12 balances."""
    of_affine, of_equilibrium = (
        agrees(state.mean_stretch, statement.value, thresholds.printed_digits) for state in (affine, equilibrium)
    )
    here = f"{affine.mean_stretch:.3f} affine, {equilibrium.mean_stretch:.3f} in equilibrium"
    if of_equilibrium or not of_affine:
        return Finding(here, judged([of_equilibrium]), f"Eq. 12 balances at {equilibrium.mean_stretch:.3f}.")
    return Finding(
        here,
        Verdict.PARTLY,
        "The printed number is right for the affine state, which Eq. 12 does not balance: it leaves the node a force "
        f"of {number(affine.vertical_force)} kA. Balance, which the paper asks of the other case, gives "
        f"{equilibrium.mean_stretch:.3f}, where λ_f = {equilibrium.averaged_stretch:.3f}.",
    )


def transverse_lengths(statement: Statement, state: State, thresholds: Thresholds) -> Finding:
    """L1, L2 and θ across the alignment."""
    found = (*state.lengths[:2], state.angle)
    return Finding(
        f"{found[0]:.3f}, {found[1]:.3f}, {found[2]:.1f} deg",
        judged([agrees(found, statement.value, thresholds.printed_digits)]),
        "Eq. 12 with the two constraints is solved; the force left on the node is "
        f"{number(abs(state.vertical_force), 1)} kA.",
    )


def transverse_stretches(statement: Statement, state: State, thresholds: Thresholds) -> Finding:
    """The stretches of fibres 1 and 2 and the mean of the three across the alignment."""
    found = (*state.fiber_stretches[:2], state.mean_stretch)
    return Finding(
        f"{found[0]:.2f}, {found[1]:.2f}, {found[2]:.3f}",
        judged([agrees(found, statement.value, thresholds.printed_digits)]),
        f"The most stretched of the three fibres has {max(state.fiber_stretches):.2f} of its length at rest, while "
        f"λ_f = {state.averaged_stretch:.3f}.",
    )
