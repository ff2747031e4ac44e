"""Verdicts follow the data: the three-fibre example and curves of networks, made up to make a statement true or not."""

from dataclasses import replace

import numpy as np
import pytest
from made_up_evidence import (
    CASE,
    CONFIG,
    CONTRADICTED,
    LOADS,
    NOT,
    PARTLY,
    PRINTED,
    REPRODUCED,
    SETS,
    THRESHOLDS,
    constants,
    curves,
    evidence,
    found,
    value_of,
    verdict_of,
)

from fibrous.curves import Curves
from fibrous_study.audit import constants as of_constants
from fibrous_study.audit.checks import CHECKS
from fibrous_study.audit.constants import constants_up_to, group_fits
from fibrous_study.audit.verdict import Thresholds, numbers, rank_correlation


def test_every_statement_is_judged_and_nothing_else():
    assert sorted(PRINTED) == sorted(CHECKS)
    assert len(PRINTED) >= 35


def test_rank_correlation_is_that_of_ranks_with_ties():
    # Ranks 1, 2.5, 2.5, 4 against 1, 2, 3, 4: covariance 4.5, squares 4.5 and 5.
    assert rank_correlation([0.0, 1.0, 1.0, 9.0], [2.0, 3.0, 5.0, 7.0]) == pytest.approx(4.5 / np.sqrt(4.5 * 5.0))
    assert rank_correlation([1.0, 2.0, 3.0], [3.0, 2.0, -9.0]) == pytest.approx(-1.0)


def test_chance_makes_no_trend(rng):
    """One correlation in twenty of independent samples is beyond the limit, from ten networks on."""
    for count in (10, 40):
        chance = Thresholds(**vars(THRESHOLDS) | {"trend": 0.0}).trend_of(count)
        beyond = [abs(rank_correlation(*rng.standard_normal((2, count)))) > chance for _ in range(4000)]
        assert np.mean(beyond) == pytest.approx(0.05, abs=0.015)
    assert THRESHOLDS.trend_of(750) == THRESHOLDS.trend


def test_a_number_of_networks_is_that_of_the_first_and_ranges_over_the_others():
    (quantity,) = numbers(unit="MPa", load_set="a set", printed={"C2": 0.1}, C2=np.array([9.0, 2.0, 3.0]))
    assert (quantity.value, quantity.low, quantity.high, quantity.replicates) == (9.0, 2.0, 3.0, 2)
    assert (quantity.unit, quantity.load_set, quantity.printed) == ("MPa", "a set", 0.1)
    (alone,) = numbers(C3=1.0)
    assert np.isnan([alone.low, alone.high, alone.printed]).all()


# The three-fibre example -------------------------------------------------------------------------------------------


def stretched(**stretches: str) -> dict:
    """Fig. 7 with other stretches of its panels."""
    panels = CONFIG["paper"]["figure_7"]
    changed = {panel: {**panels[panel], "stretch": stretch} for panel, stretch in stretches.items()}
    return {"paper": {**CONFIG["paper"], "figure_7": {**panels, **changed}}}


@pytest.mark.parametrize(
    ("statement", "panel", "other"),
    [
        ("fig7-aligned-estimate", "b", "1.45"),
        ("fig7-transverse-estimate", "c", "20/29"),
        ("fig7-transverse-lengths", "c", "20/29"),
        ("fig7-transverse-stretches", "c", "20/29"),
    ],
)
def test_the_three_fibre_example_and_other_stretches_of_it(statement, panel, other):
    assert verdict_of(statement) is REPRODUCED
    assert verdict_of(statement, **stretched(**{panel: other})) is NOT


def test_the_mean_along_the_alignment_is_that_of_the_affine_state_alone():
    finding = found("fig7-aligned-mean")
    assert finding.verdict is PARTLY
    assert value_of(finding, "mean_affine") == pytest.approx((2 / 3 + 2 * 3 / 2) / 3)
    assert value_of(finding, "mean_balanced") == pytest.approx(1.297, abs=5e-4)
    for value, verdict in ((1.297, REPRODUCED), (1.4, NOT)):
        assert verdict_of("fig7-aligned-mean", {"mean_affine": value}) is verdict


# Networks and their curves -----------------------------------------------------------------------------------------


def test_alignment_and_volume_fraction_are_those_printed():
    tensors = np.array([CASE, CASE])
    assert verdict_of("case-alignment", tensors=tensors) is REPRODUCED
    off = found("case-alignment", tensors=tensors + np.diag([0.006, -0.006, 0.0]))
    assert off.verdict is NOT
    assert value_of(off, "off") == pytest.approx(0.006)
    for fraction, verdict in ((0.04, REPRODUCED), (0.0403, NOT)):
        assert verdict_of("case-volume-fraction", fractions=np.full(3, fraction)) is verdict


@pytest.mark.parametrize(
    ("small", "large", "verdict", "faster"),
    [
        (0.2, 0.1, REPRODUCED, True),
        (0.1, 0.2, PARTLY, True),  # λ_f − 1 grows more than twice
        (0.01, 0.2, PARTLY, False),
        (0.01, 0.02, NOT, True),
    ],
)
def test_realignment(small, large, verdict, faster):
    few, many = (
        curves(orientation={"xy_shear": 0.7 - apart}, stretch=stretch)
        for apart, stretch in ((small, 1.2), (large, 1.8))
    )
    finding = found("realignment-spread", small=few, large=many)
    assert finding.verdict is verdict
    for name in SETS:
        assert value_of(finding, "faster_at_small", name) == faster
        assert value_of(finding, "apart_large", name) == pytest.approx(large)


@pytest.mark.parametrize(
    ("small", "large", "verdict"),
    [
        ({"xy_shear": 3.0}, {"xy_shear": 1.5}, REPRODUCED),
        ({"xy_shear": 3.0}, {"xy_shear": 1.5, "yz_shear": 9.0}, PARTLY),
        ({"xy_shear": 1.5}, {"xy_shear": 3.0}, NOT),
        ({"xy_shear": 1.2}, {"xy_shear": 1.1}, NOT),  # alike at small strain, too
    ],
)
def test_curves_approach_each_other(small, large, verdict):
    finding = found("curves-converge", small=curves(small, 1.1), large=curves(large))
    assert finding.verdict is verdict
    assert value_of(finding, "W_ratio_small", "with_xz") == pytest.approx(small["xy_shear"], rel=0.05)


def test_energies_are_compared_at_one_averaged_stretch():
    """Loads of one law that end at different λ_f are alike, whichever ends first and wherever they are compared."""
    whole = curves()
    cut = replace(whole, **{name: value.copy() for name, value in vars(whole).items() if isinstance(value, np.ndarray)})
    for name in ("deformation_gradient", "strain_energy_density"):
        getattr(cut, name)[:, 2] = getattr(curves(stretch=1.5), name)[:, 2]
    assert cut.dissimilarity() == pytest.approx(1.0, rel=0.02)
    assert cut.dissimilarity(1.2) == pytest.approx(1.0, rel=0.02)
    assert whole.dissimilarity() == pytest.approx(1.0, rel=1e-9)
    energy = curves(steps=400).energies_at(1.2)
    assert energy == pytest.approx(0.2 / (2 * 0.5) * np.expm1(0.5 * (1.2**2 - 1.0) ** 2), rel=1e-3)


def ensemble(*factors: tuple[float, float], H11=(0.4, 0.8)):
    """Networks of rising H11; W of the last two shears grows from the least to the most aligned by these factors."""
    return Curves.joined(
        [
            curves(
                dict(zip(LOADS[-2:], growth.tolist(), strict=True)),
                tensors=np.diag([one, 0.6 * (1 - one), 0.4 * (1 - one)]),
            )
            for one, growth in zip(np.linspace(*H11, 10), np.linspace(*factors, 10), strict=True)
        ]
    )


@pytest.mark.parametrize(
    ("ends", "verdict"),
    [
        (((1.0, 1.0), (9.0, 9.0)), REPRODUCED),
        (((9.0, 1.0), (1.0, 9.0)), PARTLY),
        (((9.0, 9.0), (1.0, 1.0)), NOT),
    ],
)
def test_dissimilarity_over_alignment(ends, verdict):
    assert verdict_of("dissimilar-with-alignment", ensemble=ensemble(*ends)) is verdict


def test_networks_aligned_across_the_loads_and_cut_loads_are_counted():
    """Those of H11 ≤ 3/8 have H22 = 0.6 (1 − H11) ≥ H11, and would turn the trend."""
    aligned, across = ensemble((1.0, 1.0), (9.0, 9.0)), ensemble((99.0, 99.0), (99.0, 99.0), H11=(0.34, 0.37))
    both = Curves.joined([aligned, across])
    both.amplitude_limited[:6, LOADS.index("yz_shear")] = True
    finding = found("dissimilar-with-alignment", ensemble=both)
    assert finding.verdict is REPRODUCED
    assert [value_of(finding, name) for name in ("aligned", "networks")] == [20, 40]
    assert [value_of(finding, "cut", name) for name in SETS] == [0, 6]


def test_dissimilarity_is_judged_at_a_stretch_that_all_networks_reach():
    """The curves scatter ever more with λ_f; at one λ_f by less in aligned networks, whose own ends are further."""
    made, shear = ensemble((1.0, 1.0), (1.0, 1.0)), LOADS.index("xy_shear")
    energy = made.strain_energy_density.copy()
    growth = 1.0 + 20.0 * (made.averaged_stretch[:, shear] - 1.0) ** 2
    energy[:, shear] *= np.repeat(np.linspace(1.5, 1.0, 10), 2)[:, None] * growth
    finding = found("dissimilar-with-alignment", ensemble=replace(made, strain_energy_density=energy))
    assert finding.verdict is NOT
    ranks = [value_of(finding, name, "with_xz") for name in ("rank", "rank_at_largest")]
    assert ranks == pytest.approx([-1.0, 1.0], abs=0.01)
    assert value_of(finding, "lambda_f", "with_xz") == pytest.approx(made.reach.min())


def test_fits_get_worse_with_alignment_and_curves_scatter():
    falling, rising = ({name: constants(np.ones(9), np.ones(9), r) for name in SETS} for r in R_SQUARED)
    tight, wide, wider = curves(), curves({"xy_shear": 4.0}), curves({"xy_shear": 9.0})
    for survey, fits, verdict in (
        ((tight, wide, wide, wide, wide), falling, REPRODUCED),
        ((tight, wide, wide, wide, wide), rising, PARTLY),
        ((wide, wider, wider, wider, wider), falling, PARTLY),  # network 1 has no tight cluster
        ((wide, wide, wide, tight, tight), rising, NOT),
    ):
        named = [replace(one, names=np.array([f"n{k}"] * 2)) for k, one in enumerate(survey, 1)]
        results = {"large": Curves.joined(named), "survey": [f"n{k}" for k in range(1, 6)]}
        assert verdict_of("fit-spread-grows", ensemble_large_fits=fits, **results) is verdict


R_SQUARED = np.linspace(0.9, 0.5, 9), np.linspace(0.5, 0.9, 9)


def third(network: Curves) -> dict:
    """Curves as those of network 3."""
    return {"large": replace(network, names=np.array(["third"] * 2)), "survey": ["first", "second", "third"]}


def test_magnitudes_of_network_3():
    tensor = np.diag([0.36, 0.12, 0.52])
    network = curves(tensors=tensor)
    results = {**third(network), "asked": {"third": tensor}}
    finding = found("network3-stretches", **results)
    assert finding.verdict is CONTRADICTED
    for load, F in (("xy_biaxial", [3.33, 3.33, 3.33**-2]), ("xz_biaxial", [1.17, 1.17**-2, 1.17])):
        stretch = np.sqrt(np.diag(tensor) @ np.square(F))
        assert value_of(finding, f"lambda_f_of_printed_{load}") == pytest.approx(stretch)
    for stretch, verdict in ((1.8, REPRODUCED), (1.5, NOT)):  # one λ_f, but another
        ours = curves(stretch=stretch, tensors=tensor).magnitude[0, 1:3, -1].round(3)
        printed = dict(zip(("xy_biaxial", "xz_biaxial"), ours.tolist(), strict=True))
        assert verdict_of("network3-stretches", printed, **results) is verdict


@pytest.mark.parametrize(
    ("biaxial", "uniaxial", "verdict"), [(2.0, 2.0, REPRODUCED), (2.0, 0.5, PARTLY), (0.5, 0.5, NOT)]
)
def test_stiffer_across(biaxial, uniaxial, verdict):
    finding = found("network3-stiffer-transverse", **third(curves({"xy_biaxial": biaxial, "x_uniaxial": uniaxial})))
    assert finding.verdict is verdict
    assert value_of(finding, "xy_biaxial") == pytest.approx(biaxial, rel=0.02)


def shortened(made: Curves) -> Curves:
    """The same with a load of another kind behind the others, under which the mean fibre gets shorter."""
    fixed = ("numbers", "names", "loads", "structure_tensor")
    arrays = {
        name: np.concatenate([value, value[:, :1]], axis=1) for name, value in vars(made).items() if name not in fixed
    }
    arrays["deformation_gradient"][:, -1] = np.linspace(1.0, 0.9, made.magnitude.shape[2])[:, None, None] * np.eye(3)
    return replace(made, loads=(*made.loads, "squeeze"), **arrays)


@pytest.mark.parametrize(
    ("statement", "results"),
    [
        ("curves-converge", {"small": curves({"xy_shear": 3.0}, 1.1), "large": curves({"xy_shear": 1.5})}),
        ("network3-stiffer-transverse", third(curves())),
        ("dissimilar-with-alignment", {"ensemble": ensemble((1.0, 1.0), (1.0, 3.0))}),
    ],
)
def test_a_load_that_shortens_the_mean_fibre_is_compared_with_no_other(statement, results):
    """There is no λ_f above 1 at which it has an energy; what is computed of the others stays."""
    more = {name: shortened(one) if isinstance(one, Curves) else one for name, one in results.items()}
    sets = {name: (*loads, "squeeze") for name, loads in SETS.items()}
    of_others, of_all = found(statement, **results), found(statement, load_sets=sets, **more)
    assert of_all.verdict is of_others.verdict
    assert repr(of_all.numbers) == repr(of_others.numbers)  # NaN equals NaN so


@pytest.mark.parametrize(("iterations", "verdict"), [(6, REPRODUCED), (3, PARTLY), (11, NOT)])
def test_newton_iterations(iterations, verdict):
    finding = found("newton-iterations", ensemble=curves(iterations=iterations))
    assert finding.verdict is verdict
    assert value_of(finding, "median") == iterations


def test_the_percentages_of_figure_3_are_the_cubes():
    finding = found("figure-3-rows", small=curves(stretch=np.sqrt(1.2)), large=curves())
    assert finding.verdict is CONTRADICTED
    assert value_of(finding, "E_cube_small") == pytest.approx(0.1)
    assert value_of(finding, "E_cube_large") == pytest.approx(1.12)
    assert value_of(finding, "E_fibers_large") == pytest.approx(0.5 * (0.69 * 1.8**2 + 0.31 / 1.8 - 1))


def test_the_percentages_of_figure_3_are_the_cubes_under_a_load_with_its_own_gradient():
    """A line along x becomes as long as the first column of F."""
    made = curves()
    gradient = made.deformation_gradient.copy()
    gradient[:, 0, -1] = [[1.2, 0.0, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 1.0]]
    own = replace(made, loads=("mine", *LOADS[1:]), deformation_gradient=gradient)
    finding = found("figure-3-rows", small=own, large=made)
    assert value_of(finding, "E_cube_small") == pytest.approx(0.5 * (1.2**2 + 0.5**2 - 1.0))


def test_constants_of_one_law_are_found_up_to_any_stretch():
    made = curves()
    for stretch in (np.inf, 1.3):
        fit = constants_up_to(made, 50.0, stretch)
        np.testing.assert_allclose(fit.C2, 0.2, rtol=1e-6)
        np.testing.assert_allclose(fit.C3, 0.5, rtol=1e-6)
        assert fit.amplitude.max() <= stretch
    beyond = made.averaged_stretch > 1.3
    stiffened = replace(made, strain_energy_density=np.where(beyond, 9.0, 1.0) * made.strain_energy_density)
    np.testing.assert_allclose(constants_up_to(stiffened, 50.0, 1.3).C2, 0.2, rtol=1e-6)
    assert constants_up_to(stiffened, 50.0).C3.min() > 0.6


# Families of loads -------------------------------------------------------------------------------------------------

UNLIKE = {"xy_biaxial": 9.0, "xy_shear": 9.0}


def of_families(statement: str, small: dict, large: dict, **results):
    return found(statement, small=curves(small), large=curves(large), **{"survey": (), **results})


@pytest.mark.parametrize(
    ("small", "large", "trusted", "denied"),
    [
        ({}, {}, REPRODUCED, CONTRADICTED),
        (UNLIKE, {}, PARTLY, PARTLY),
        (UNLIKE, UNLIKE, CONTRADICTED, REPRODUCED),
    ],
)
def test_families(small, large, trusted, denied):
    finding = of_families("family-fits", small, large)
    assert finding.verdict is trusted
    assert of_families("family-fits-denied", small, large).verdict is denied
    # The range of strain decides between the sections.
    assert value_of(finding, "fitting_small") == (small is not UNLIKE)
    assert value_of(finding, "fitting_large") == (large is not UNLIKE)


def test_groups_of_loads_that_are_fitted():
    """A load with its own gradient belongs to no family, and counts among all loads."""
    usual = group_fits(evidence(small=curves(), large=curves(), survey=()))
    # Two ranges and two load sets, each with a pair of biaxial loads, one of shears, and all five; no load alone.
    assert sorted(len(one.loads) for one in usual) == [2] * 8 + [5] * 4
    own = replace(curves(), loads=("mine", *LOADS[1:]))
    sets = {name: ("mine", *loads[1:]) for name, loads in SETS.items()}
    fits = group_fits(evidence(small=own, large=own, survey=(), load_sets=sets))
    assert [one.loads for one in fits if not one.pooled] == [one.loads for one in usual if not one.pooled]
    assert {one.loads for one in fits if one.pooled} == set(sets.values())


def test_a_load_set_without_families_leaves_the_verdict_to_the_others():
    """One load of a kind is no family, as in a set of tension alone."""
    for factors, verdict in (({}, REPRODUCED), (UNLIKE, CONTRADICTED)):
        sets = {**SETS, "tension": LOADS[:2]}
        assert of_families("family-fits", factors, factors, load_sets=sets).verdict is verdict


def test_no_check_keeps_what_another_study_gave():
    """Fits that several statements share are those of the evidence at hand."""
    for factors in ({}, UNLIKE):
        of = evidence(small=curves(factors), large=curves(factors), survey=())
        assert of_constants.group_fits(of) is of_constants.group_fits(of)
        assert (min(one.r_squared.min() for one in group_fits(of)) > 0.99) == (not factors)
