"""Statements about C2 and C3: what they depend on, how they change with alignment, and which loads one pair fits.

Each network of the study is fitted up to its own λ_f, that of one x-stretch, which grows with alignment; since the
constants depend on how far a network is followed, a trend is looked for up to one λ_f of all networks, too.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from fibrous.curves import Curves
from fibrous.deformation import Load
from fibrous.fitting.hgo import fit_hgo
from fibrous.fitting.surface import evaluate
from fibrous_study.audit.curves import dissimilarities
from fibrous_study.audit.evidence import Constants, Evidence
from fibrous_study.audit.verdict import (
    ENSEMBLE,
    NAMED,
    Array,
    Finding,
    Quantity,
    Thresholds,
    Verdict,
    ends,
    fraction,
    judged,
    judges,
    numbers,
    rank_correlation,
)

NEIGHBOURS = 20  # networks that are like network 5: in 750, those of H11 and H22 within 0.04
ROUNDING = 1e-9  # λ_f of a state that a load was matched to may miss it by so much
KINDS = ("uniaxial", "biaxial", "shear")


def constants_up_to(curves: Curves, largest_C3: float, stretch: float = math.inf) -> Constants:
    """Constants of every network from the energies of all its loads, pooled, in states of λ_f up to `stretch`."""
    beyond = curves.averaged_stretch > stretch * (1.0 + ROUNDING)
    part = replace(curves, strain_energy_density=np.where(beyond, np.nan, curves.strain_energy_density))
    # Eq. 2 by the energy, however poor the fit.
    fits = [fit_hgo(part.network(i), largest_C3=largest_C3) for i in range(len(curves.names))]
    return Constants(
        names=curves.names,
        **dict(zip(("H11", "H22", "H33"), np.einsum("nii->in", curves.structure_tensor), strict=True)),
        **{name: np.array([getattr(fit, name) for fit in fits]) for name in ("C2", "C3", "r_squared")},
        amplitude=np.array([fit.largest_stretch for fit in fits]),
    )


@dataclass(frozen=True)
class Fits:
    """Constants by one rule of how far each network is followed: an ensemble's, and those of networks 1 and 5.

    first, fifth : each with its replicates, the paper's network first
    """

    ensemble: Constants
    first: Constants
    fifth: Constants

    def trend(self, constant: str) -> tuple[float, float]:
        """Rank correlation of C2 or C3 with H11 over the networks aligned with x, and how networks 1 and 5 compare.

        The second is the fraction of all pairs of the two and their replicates in which network 5 has the larger.
        """
        aligned, first, fifth = self.ensemble.along_x(), getattr(self.first, constant), getattr(self.fifth, constant)
        return rank_correlation(aligned.H11, getattr(aligned, constant)), fraction(fifth[:, None] > first)

    def rises(self, constant: str, thresholds: Thresholds) -> bool:
        """Whether C2 or C3 clearly rises, over the ensemble and from network 1 to network 5."""
        rank, larger = self.trend(constant)
        return rank >= self._limit(thresholds) and larger >= thresholds.most

    def falls(self, constant: str, thresholds: Thresholds) -> bool:
        """Whether C2 or C3 clearly falls, likewise."""
        rank, larger = self.trend(constant)
        return rank <= -self._limit(thresholds) and larger <= 1.0 - thresholds.most

    def _limit(self, thresholds: Thresholds) -> float:
        return thresholds.trend_of(len(self.ensemble.along_x().H11))


@cache
def own_fits(evidence: Evidence) -> dict[str, Fits]:
    """Fits up to each network's own λ_f, by load set."""
    return {
        name: _three(evidence, evidence.ensemble_large_fits[name], evidence.large_fits[name])
        for name in evidence.load_sets
    }


@cache
def common_fits(evidence: Evidence) -> dict[str, Fits]:
    """Fits up to the largest λ_f that all networks reach under the load that the others are matched to."""
    networks = evidence.ensemble, evidence.network(1), evidence.network(5)
    common = min(float(one.averaged_stretch[:, 0, -1].min()) for one in networks)
    by_set = {}
    for name, loads in evidence.load_sets.items():
        both = (evidence.ensemble.under(loads), evidence.large.under(loads))
        by_set[name] = _three(evidence, *(constants_up_to(one, evidence.largest_C3, common) for one in both))
    return by_set


def _three(evidence: Evidence, ensemble: Constants, named: Constants) -> Fits:
    return Fits(ensemble, named.called(evidence.survey[0]), named.called(evidence.survey[-1]))


@judges("c2-trend", NAMED, ENSEMBLE, rising=False)
@judges("c2-trend-discussion", NAMED, ENSEMBLE, rising=True)
def trends(evidence: Evidence, _: Mapping[str, float], rising: bool) -> Finding:
    """Section 3.2: C2 falls and C3 rises with alignment; section 4.1, `rising`: both rise.

    Contradicted where C2 clearly does the opposite in some of the fits, and nowhere what is said.
    """
    thresholds, own, common, found = evidence.thresholds, own_fits(evidence), common_fits(evidence), []
    falls, rises, nonlinear = [], [], []
    for way, by_set in (("own", own), ("common", common)):
        for name, fits in by_set.items():
            falls.append(fits.falls("C2", thresholds))
            rises.append(fits.rises("C2", thresholds))
            nonlinear.append(fits.rises("C3", thresholds))
            held = {"C2_falls": falls[-1], "C2_rises": rises[-1], "C3_rises": nonlinear[-1]}
            found += numbers({f"{key}_{way}": value for key, value in held.items()}, load_set=name)
            found += _of_trend(fits, name, way)
    said, denied = (rises, falls) if rising else (falls, rises)
    aligned = next(iter(own.values())).ensemble.along_x()
    found += numbers(aligned=len(aligned.H11), networks=len(evidence.ensemble.names))
    found += ends("lambda_f", [one for fits in own.values() for one in fits.ensemble.along_x().amplitude])
    found += numbers(lambda_f_common=max(float(fits.ensemble.amplitude.max()) for fits in common.values()))
    return Finding(Verdict.CONTRADICTED if any(denied) and not any(said) else judged([*said, *nonlinear]), found)


def _of_trend(fits: Fits, load_set: str, way: str) -> list[Quantity]:
    found = []
    for constant, unit in (("C2", "MPa"), ("C3", "1")):
        rank, larger = fits.trend(constant)
        found += numbers({f"rank_{constant}_{way}": rank, f"{constant}_larger_in_5_{way}": larger}, load_set=load_set)
        pair = {1: getattr(fits.first, constant), 5: getattr(fits.fifth, constant)}
        found += numbers({f"{constant}_{k}_{way}": values for k, values in pair.items()}, unit=unit, load_set=load_set)
    ranges = {f"lambda_f_{k}_{way}": one.amplitude[0] for k, one in ((1, fits.first), (5, fits.fifth))}
    at_bound = fraction(fits.ensemble.along_x().C3 == 0.0)
    return [*found, *numbers({f"C3_at_bound_{way}": at_bound, **ranges}, load_set=load_set)]


@judges("shear-pair", NAMED, ENSEMBLE)
def shear_pair(evidence: Evidence, _: Mapping[str, float]) -> Finding:
    """Whether it makes a difference which two shears are fitted, and which the paper fitted.

    The first and the last load set are compared. Two things tell which the paper had: with which loads the case-study
    network's curves approach each other, as Fig. 5's do, and with which the C3 of networks like network 5 is Table 1's.
    """
    thresholds, paper = evidence.thresholds, evidence.paper
    pairs = list(evidence.ensemble_large_fits.items())
    first, last = pairs[0], pairs[-1]
    same = first[1].alike(last[1], thresholds)
    same &= np.abs(last[1].r_squared - first[1].r_squared) <= thresholds.r_squared
    at = paper["alignments"]["network_5"]
    C3_printed = float(evaluate(paper["table_1"]["C3"], *at))
    like = _nearest(first[1], *at)
    found = numbers(same=fraction(same), networks=same.size, nearest=len(like), C3_printed=C3_printed)
    for name, fits in (first, last):
        case, C3 = evidence.case(evidence.large_fits[name]), fits.C3[like]
        loads = evidence.load_sets[name]
        cut = evidence.ensemble.under(loads).amplitude_limited[like].any(axis=1).sum()
        found += numbers(unit="MPa", load_set=name, C2=case.C2)
        found += numbers(load_set=name, C3=case.C3, r_squared=case.r_squared, lambda_f=case.amplitude[0])
        found += numbers(load_set=name, median_r_squared=np.median(fits.r_squared))
        found += numbers(load_set=name, approach=dissimilarities(evidence, loads)[2])
        found += numbers(load_set=name, reached=C3.min() <= C3_printed <= C3.max(), cut=cut)
        found += numbers(load_set=name, C3_nearest_least=C3.min(), C3_nearest_largest=C3.max())
    return Finding(Verdict.REPRODUCED if thresholds.mostly(same) else Verdict.CONTRADICTED, found)


def _nearest(fits: Constants, H11: float, H22: float) -> NDArray[np.int64]:
    """The networks nearest to an alignment, at most NEIGHBOURS of them or a fifth of all."""
    order = np.argsort(np.hypot(fits.H11 - H11, fits.H22 - H22), kind="stable")
    return np.asarray(order[: max(1, min(NEIGHBOURS, len(order) // 5))])


def starting_exponents(curves: Curves) -> Array:
    """Exponent p of W ~ (λ_f − 1)^p by least squares of the logarithms, shape (networks, loads).

    Of the states after λ_f is least that stretch the mean fibre; NaN where there are fewer than three of them.
    """
    stretch = curves.averaged_stretch
    exponents = np.full(stretch.shape[:2], np.nan)
    for i, j in np.ndindex(*exponents.shape):
        excess, energy = stretch[i, j] - 1.0, curves.strain_energy_density[i, j]
        rising = (np.arange(len(excess)) > np.argmin(excess)) & (excess > 0.0) & (energy > 0.0)
        if rising.sum() > 2:
            exponents[i, j] = np.polyfit(np.log(excess[rising]), np.log(energy[rising]), 1)[0]
    return exponents


@judges("constants-of-alignment-alone", NAMED, ENSEMBLE)
def amplitude(evidence: Evidence, _: Mapping[str, float]) -> Finding:
    """Whether Eq. 11's constants belong to the network alone: those of the small range beside those of the large one.

    By the first load set.
    """
    thresholds, by_set = evidence.thresholds, next(iter(evidence.load_sets))
    small, large = (evidence.case(one[by_set]) for one in (evidence.small_fits, evidence.large_fits))
    few, many = evidence.ensemble_small_fits[by_set], evidence.ensemble_large_fits[by_set]
    same = few.alike(many, thresholds)
    ratio = few.C2[many.C2 > 0.0] / many.C2[many.C2 > 0.0]
    case, first = evidence.case(evidence.small), evidence.small.called(evidence.survey[0])
    shear = np.array([Load.kind_of(load) == "shear" for load in case.loads])
    exponents = {"shear": starting_exponents(case)[0][shear], "others": starting_exponents(case)[0][~shear]}
    exponents["network_1"] = starting_exponents(first)[0]
    return Finding(
        Verdict.REPRODUCED if thresholds.mostly(same) else Verdict.NOT,
        [
            *numbers(unit="MPa", C2_small=small.C2, C2_large=large.C2),
            *numbers(C3_small=small.C3, C3_large=large.C3, C2_ratio=small.C2 / large.C2),
            *numbers(lambda_f_small=small.amplitude[0], lambda_f_large=large.amplitude[0]),
            *numbers(same=fraction(same), networks=len(same)),
            *numbers(median_C2_ratio=np.median(ratio), largest_C2_ratio=ratio.max()),
            *ends("lambda_f_small", few.amplitude),
            *ends("lambda_f_large", many.amplitude),
            *[one for name, values in exponents.items() for one in ends(f"exponent_{name}", values)],
        ],
    )


@dataclass(frozen=True)
class GroupFit:
    """Eq. 2 fitted to a group of loads: a whole load set (`pooled`) or a family of it.

    strain : `small` or `large`, the range; load_set, network : names
    r_squared : of the network and its replicates, shape (networks,)
    """

    strain: str
    load_set: str
    network: str
    loads: tuple[str, ...]
    pooled: bool
    r_squared: Array


@cache
def group_fits(evidence: Evidence) -> list[GroupFit]:
    """Fits to every load set and to every family of two loads or more within it; one curve alone would tell little.

    In the case-study network and networks 1 to 5. A load with its own deformation gradient belongs to no family.
    """
    fits = []
    for load_set, loads in evidence.load_sets.items():
        of_kind = [tuple(load for load in loads if Load.kind_of(load) == kind) for kind in KINDS]
        groups = [(loads, True), *((family, False) for family in of_kind if len(family) > 1)]
        for strain, curves in (("large", evidence.large), ("small", evidence.small)):
            for name in (evidence.case_name, *evidence.survey):
                for group, pooled in groups:
                    quality = constants_up_to(curves.called(name).under(group), evidence.largest_C3).r_squared
                    fits.append(GroupFit(strain, load_set, name, group, pooled, quality))
    return fits


@judges("family-fits", NAMED, trusted=True)
@judges("family-fits-denied", NAMED, trusted=False)
def families(evidence: Evidence, _: Mapping[str, float], trusted: bool) -> Finding:
    """Whether Eq. 2 fits within families of loads, as section 4.1 says (`trusted`), or not even there, as 3.1 says.

    Each range of strain with each load set is judged by itself, by the fraction of networks and families that fit and,
    for the denial, by that of fits to all loads together as well. What is false of most everywhere, the other section
    contradicts.
    """
    thresholds, fits, true, found = evidence.thresholds, group_fits(evidence), [], []
    good = {id(one): thresholds.mostly(one.r_squared >= thresholds.confident_r_squared) for one in fits}
    strains = tuple(dict.fromkeys(one.strain for one in fits))
    for load_set in evidence.load_sets:
        for strain in strains:
            for word, pooled in (("families", False), ("pooled", True)):
                # A load set may have no two loads of a kind.
                group = [one for one in fits if (one.load_set, one.strain, one.pooled) == (load_set, strain, pooled)]
                fitting = [good[id(one)] for one in group]
                if group and not (pooled and trusted):
                    true.append(fraction(fitting) if trusted else 1.0 - fraction(fitting))
                found += numbers(
                    {f"{word}_{strain}": len(group), f"{word}_fitting_{strain}": sum(fitting)}, load_set=load_set
                )
                found += ends(f"r_squared_{word}_{strain}", [one.r_squared[0] for one in group], load_set)
    for one in fits:
        if one.network == evidence.case_name and not one.pooled:
            found += numbers({f"r_squared_{'_'.join(one.loads)}_{one.strain}": one.r_squared}, load_set=one.load_set)
    for strain in strains:
        within = [good[id(one)] for one in fits if one.strain == strain and not one.pooled]
        found += numbers({f"fitting_{strain}": fraction(within)})
    found += numbers(networks=len({one.network for one in fits}))
    if all(share >= thresholds.most for share in true):
        return Finding(Verdict.REPRODUCED, found)
    false = all(share <= 1.0 - thresholds.most for share in true)
    return Finding(Verdict.CONTRADICTED if false else Verdict.PARTLY, found)
