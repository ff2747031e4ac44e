"""What C2 and C3 depend on beside alignment: how far a network is followed, and which loads are fitted."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from fibrous.curves import Curves
from fibrous.deformation import Load
from fibrous.fitting.surface import evaluate
from fibrous_study import printed
from fibrous_study.audit.curves import converge
from fibrous_study.audit.evidence import Constants
from fibrous_study.audit.finding import (
    Array,
    Finding,
    Thresholds,
    Verdict,
    alike,
    holds_for_most,
    judged,
    listed,
    number,
    over_replicates,
    percent,
    say,
    share_of,
    span,
    stretches,
)

NETWORK_5 = "network_5"  # of fibrous_study.printed
NEIGHBOURS = 20  # networks that are like it: in 750, those of H11 and H22 within 0.04


def amplitude(
    case: tuple[Constants, Constants],
    ensemble: tuple[Constants, Constants],
    curves: tuple[Curves, Curves],
    thresholds: Thresholds,
) -> Finding:
    """Whether Eq. 11's constants belong to the network alone: those of the small range beside those of the large one.

    `case` is the case-study network with its replicates, `ensemble` all networks, each at the small and the large
    range; `curves` are those of the case-study network and of network 1 at the small range.
    """
    (small, large), (few, many) = case, ensemble
    same = alike(few.C2, many.C2, thresholds.same_magnitude) & alike(few.C3, many.C3, thresholds.same_magnitude)
    ratio = few.C2[many.C2 > 0.0] / many.C2[many.C2 > 0.0]
    middle, largest = float(np.median(ratio)), float(ratio.max())
    belong = holds_for_most(same, thresholds.most)
    shear = np.array([Load.kind_of(load) == "shear" for load in curves[0].loads])
    of_case, of_first = (starting_exponents(one)[0] for one in curves)
    return Finding(
        f"C2 {say(small.C2[0], unit='MPa')} up to λ_f = {small.amplitude[0]:.2f}, {say(large.C2[0], unit='MPa')} up to "
        f"{large.amplitude[0]:.2f}; C3 {say(small.C3[0])} and {say(large.C3[0])}",
        judged([belong]),
        f"Both constants fitted up to 10 % Green strain (λ_f {stretches(few.amplitude)}) and up to 112 % "
        f"({stretches(many.amplitude)}) agree within a factor of {number(thresholds.same_magnitude)} in "
        f"{percent(share_of(same))} of {len(same)} networks, and the first C2 is {number(middle)} times the second "
        f"(median; {number(largest)} at most){'' if belong else ': they belong to the range they were fitted on'}. At "
        f"small strain W grows as a power of λ_f − 1, which is 2 in Eq. 2 and here {_known_span(of_case[shear])} under "
        f"shear and {_known_span(of_case[~shear])} under the other loads of the case-study network, "
        f"{_known_span(of_first)} under all loads of network 1.",
        over_replicates([f"ratio of C2 {span(small.C2[1:] / large.C2[1:])}"], len(small.C2) - 1),
    )


def starting_exponents(curves: Curves) -> Array:
    """Exponent p of W ~ (λ_f − 1)^p by least squares of the logarithms, shape (networks, loads).

    Of the states after λ_f is least that stretch the mean fibre; NaN where there are fewer than three of them.
    """
    stretch = curves.averaged_stretch
    found = np.full(stretch.shape[:2], np.nan)
    for i, j in np.ndindex(*found.shape):
        excess, energy = stretch[i, j] - 1.0, curves.strain_energy_density[i, j]
        rising = (np.arange(len(excess)) > np.argmin(excess)) & (excess > 0.0) & (energy > 0.0)
        if rising.sum() > 2:
            found[i, j] = np.polyfit(np.log(excess[rising]), np.log(energy[rising]), 1)[0]
    return found


def _known_span(values: Array) -> str:
    known = values[np.isfinite(values)]
    return span(known) if known.size else "unknown"


def shear_pair(
    ensemble: Mapping[str, Constants],
    case: Mapping[str, Constants],
    curves: tuple[Curves, Curves, Curves],
    load_sets: Mapping[str, tuple[str, ...]],
    thresholds: Thresholds,
) -> Finding:
    """Whether it matters which two shears are fitted, and which the paper fitted.

    `ensemble` and `case` are the constants of all networks and of the case-study network by load set, of which the
    first and the last are compared; `curves` those of the case-study network at the small and the large range, and of
    all networks at the large one. Two things tell which the paper had: with which loads the case-study network's curves
    approach each other, as Fig. 5's do, and with which the C3 of networks like network 5 is that of Table 1.
    """
    small, large, every = curves
    pairs = list(ensemble.items())
    (first, one), (second, other) = pairs[0], pairs[-1]
    same = alike(one.C2, other.C2, thresholds.same_magnitude) & alike(one.C3, other.C3, thresholds.same_magnitude)
    same &= np.abs(other.r_squared - one.r_squared) <= thresholds.r_squared
    quality = [float(np.median(fits.r_squared)) for fits in (one, other)]
    approaching = [name for name in (first, second) if converge(small, large, load_sets[name], thresholds)]
    alignment = printed.ALIGNMENTS[NETWORK_5]
    wanted = float(evaluate(printed.C3, *alignment))
    like = _nearest(one, *alignment)
    nonlinearity = {name: fits.C3[like] for name, fits in ((first, one), (second, other))}
    reaching = [name for name, C3 in nonlinearity.items() if C3.min() <= wanted <= C3.max()]
    ranges = listed([f"{span(C3)} with {name}" for name, C3 in nonlinearity.items()])
    cut = [int(every.under(load_sets[name]).amplitude_limited[like].any(axis=1).sum()) for name in (first, second)]
    return Finding(
        "; ".join(
            f"{name}: C2 {say(fits.C2[0], unit='MPa')}, C3 {say(fits.C3[0])}, R² {fits.r_squared[0]:.2f} up to λ_f = "
            f"{fits.amplitude[0]:.2f}"
            for name, fits in case.items()
        ),
        Verdict.REPRODUCED if holds_for_most(same, thresholds.most) else Verdict.CONTRADICTED,
        f"Fits agree in {percent(share_of(same))} of {same.size} networks (C2 and C3 within a factor of "
        f"{number(thresholds.same_magnitude)}, R² within {number(thresholds.r_squared)}), and the median R² is "
        f"{quality[0]:.2f} with {first} and {quality[1]:.2f} with {second}. Curves that approach each other as in Fig. "
        f"5 come out with {_alone(approaching)}, and Table 1's C3 of {number(wanted)} at network 5 is in the range of "
        f"our {len(like)} networks nearest to it with {_alone(reaching)} ({ranges}, a load being cut at the limit of "
        f"the principal stretch in {listed([str(count) for count in cut])} of them){_used(approaching, reaching)}.",
        over_replicates(
            [f"{name}: C3 {span(fits.C3[1:])}, R² {span(fits.r_squared[1:])}" for name, fits in case.items()],
            min(len(fits.C3) for fits in case.values()) - 1,
        ),
    )


def _nearest(fits: Constants, H11: float, H22: float) -> NDArray[np.int64]:
    """The networks nearest to an alignment, at most NEIGHBOURS of them or a fifth of all."""
    order = np.argsort(np.hypot(fits.H11 - H11, fits.H22 - H22), kind="stable")
    return np.asarray(order[: max(1, min(NEIGHBOURS, len(order) // 5))])


def _alone(names: list[str]) -> str:
    return f"{names[0]} alone" if len(names) == 1 else listed(names or ["neither"])


def _used(approaching: list[str], reaching: list[str]) -> str:
    """Which loads the paper seems to have used, where each of two results comes out with some."""
    if not approaching or not reaching:
        return ""
    both = [name for name in approaching if name in reaching]
    return f": the paper seems to have used {' or '.join(both) if both else 'both, one for each'}"
