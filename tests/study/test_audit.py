"""Verdicts follow the data: the three-fibre example and curves of networks, made up to make a statement true or not."""

from dataclasses import replace

import numpy as np
import pytest
from made_up_evidence import (
    CASE,
    CONTRADICTED,
    LOADS,
    NOT,
    PARTLY,
    REPRODUCED,
    SETS,
    STATEMENTS,
    TALLIED,
    THRESHOLDS,
    assert_plain,
    constants,
    curves,
    verdict_of,
)

from fibrous.curves import Curves
from fibrous_study.audit import curves as of_curves
from fibrous_study.audit import example, families, scatter
from fibrous_study.audit.finding import number, rank_correlation
from fibrous_study.audit.refits import constants_up_to
from fibrous_study.audit.statements import CHECKS
from fibrous_study.three_fibers import affine, equilibrium


def test_every_statement_is_judged_and_nothing_else():
    assert list(STATEMENTS) == list(CHECKS)
    assert len(STATEMENTS) == len(TALLIED) >= 35


def test_rank_correlation_is_that_of_ranks_with_ties():
    # Ranks 1, 2.5, 2.5, 4 against 1, 2, 3, 4: covariance 4.5, squares 4.5 and 5.
    assert rank_correlation([0.0, 1.0, 1.0, 9.0], [2.0, 3.0, 5.0, 7.0]) == pytest.approx(4.5 / np.sqrt(4.5 * 5.0))
    assert rank_correlation([1.0, 2.0, 3.0], [3.0, 2.0, -9.0]) == pytest.approx(-1.0)


def test_chance_makes_no_trend(rng):
    """One correlation in twenty of independent samples is beyond the limit, from ten networks on."""
    for count in (10, 40):
        chance = replace(THRESHOLDS, trend=0.0).trend_of(count)
        beyond = [abs(rank_correlation(*rng.standard_normal((2, count)))) > chance for _ in range(4000)]
        assert np.mean(beyond) == pytest.approx(0.05, abs=0.015)
    assert THRESHOLDS.trend_of(750) == THRESHOLDS.trend


@pytest.mark.parametrize("value", [1.0e-5, 0.000123456, 0.5, 9.999, 1013.0, 1.2e6, -2622.69])
def test_numbers_in_words_have_three_digits_and_no_power_of_ten(value):
    text = number(value)
    assert not set(text) - set("-0123456789.,")
    assert float(text.replace(",", "")) == pytest.approx(value, rel=0.5e-2)


@pytest.mark.parametrize("why", ["", "One. Two. Three.", "It is 1e+03 times.", "It is nan.", "no end"])
def test_a_reason_that_reads_badly_is_noticed(why):
    with pytest.raises(AssertionError):
        assert_plain(why)


# The three-fibre example -------------------------------------------------------------------------------------------


def test_the_three_fibre_example_and_other_stretches_of_it():
    judge = {
        "fig7-aligned-estimate": lambda s, x: example.averaged_stretch(s, affine(x), THRESHOLDS),
        "fig7-transverse-estimate": lambda s, x: example.averaged_stretch(s, affine(1 / x), THRESHOLDS),
        "fig7-transverse-lengths": lambda s, x: example.transverse_lengths(s, equilibrium(1 / x), THRESHOLDS),
        "fig7-transverse-stretches": lambda s, x: example.transverse_stretches(s, equilibrium(1 / x), THRESHOLDS),
    }
    for name, judged in judge.items():
        assert verdict_of(judged(STATEMENTS[name], 1.5)) is REPRODUCED
        assert verdict_of(judged(STATEMENTS[name], 1.45)) is NOT


def test_the_mean_along_the_alignment_is_that_of_the_affine_state_alone():
    statement, states = STATEMENTS["fig7-aligned-mean"], (affine(1.5), equilibrium(1.5))
    found = example.aligned_mean(statement, *states, THRESHOLDS)
    assert verdict_of(found) is PARTLY
    assert found.here == "1.222 affine, 1.297 in equilibrium"
    for value, verdict in ((1.297, REPRODUCED), (1.4, NOT)):
        found = example.aligned_mean(replace(statement, value=(value,)), *states, THRESHOLDS)
        assert verdict_of(found) is verdict


# Networks and their curves -----------------------------------------------------------------------------------------


def test_alignment_and_volume_fraction_are_those_printed():
    tensors = np.array([CASE, CASE])
    assert verdict_of(of_curves.alignment(STATEMENTS["case-alignment"], tensors)) is REPRODUCED
    off = tensors + np.diag([0.006, -0.006, 0.0])
    assert verdict_of(of_curves.alignment(STATEMENTS["case-alignment"], off)) is NOT
    for fraction, verdict in ((0.04, REPRODUCED), (0.0403, NOT)):
        found = of_curves.volume_fraction(STATEMENTS["case-volume-fraction"], np.full(3, fraction), THRESHOLDS)
        assert verdict_of(found) is verdict


@pytest.mark.parametrize(
    ("small", "large", "verdict", "by_rate"),
    [
        (0.2, 0.1, REPRODUCED, "strain with both load sets"),
        (0.1, 0.2, PARTLY, "strain with both load sets"),  # λ_f − 1 grows more than twice
        (0.01, 0.2, PARTLY, "strain with neither load set"),
        (0.01, 0.02, NOT, "strain with both load sets"),
    ],
)
def test_realignment(small, large, verdict, by_rate):
    few, many = (
        curves(orientation={"xy_shear": 0.7 - apart}, stretch=stretch)
        for apart, stretch in ((small, 1.2), (large, 1.8))
    )
    found = of_curves.realignment(few, many, SETS, THRESHOLDS)
    assert verdict_of(found) is verdict
    assert by_rate in found.why


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
    found = of_curves.convergence_of_curves(curves(small, 1.1), curves(large), SETS, THRESHOLDS)
    assert verdict_of(found) is verdict


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


def test_dissimilarity_over_alignment():
    for ends, verdict in (
        (((1.0, 1.0), (9.0, 9.0)), REPRODUCED),
        (((9.0, 1.0), (1.0, 9.0)), PARTLY),
        (((9.0, 9.0), (1.0, 1.0)), NOT),
    ):
        assert verdict_of(scatter.dissimilarity(ensemble(*ends), SETS, THRESHOLDS)) is verdict


def test_networks_aligned_across_the_loads_and_cut_loads_are_counted():
    """Those of H11 ≤ 3/8 have H22 = 0.6 (1 − H11) ≥ H11, and would turn the trend."""
    aligned, across = ensemble((1.0, 1.0), (9.0, 9.0)), ensemble((99.0, 99.0), (99.0, 99.0), H11=(0.34, 0.37))
    both = Curves.joined([aligned, across])
    both.amplitude_limited[:6, LOADS.index("yz_shear")] = True
    found = scatter.dissimilarity(both, SETS, THRESHOLDS)
    assert verdict_of(found) is REPRODUCED
    assert "Over the 20 of 40 networks" in found.why
    assert "in 0 networks with with_xz and 6 networks with with_yz" in found.why


def test_dissimilarity_is_judged_at_a_stretch_that_all_networks_reach():
    """The curves scatter ever more with λ_f; at one λ_f by less in aligned networks, whose own ends are further."""
    made, shear = ensemble((1.0, 1.0), (1.0, 1.0)), LOADS.index("xy_shear")
    energy = made.strain_energy_density.copy()
    growth = 1.0 + 20.0 * (made.averaged_stretch[:, shear] - 1.0) ** 2
    energy[:, shear] *= np.repeat(np.linspace(1.5, 1.0, 10), 2)[:, None] * growth
    found = scatter.dissimilarity(replace(made, strain_energy_density=energy), SETS, THRESHOLDS)
    assert verdict_of(found) is NOT
    assert "with H11 -1.00 at λ_f = 1.28, +1.00 where each network is taken at its own" in found.here


def test_fits_get_worse_with_alignment_and_curves_scatter():
    falling, rising = ({name: constants(np.ones(9), np.ones(9), r) for name in SETS} for r in R_SQUARED)
    tight, wide, wider = curves(), curves({"xy_shear": 4.0}), curves({"xy_shear": 9.0})
    true = dict(zip("12345", (tight, wide, wide, wide, wide), strict=True))
    false = dict(zip("12345", (wide, wide, wide, tight, tight), strict=True))
    loose = dict(zip("12345", (wide, wider, wider, wider, wider), strict=True))
    for survey, fits, verdict in (
        (true, falling, REPRODUCED),
        (true, rising, PARTLY),
        (loose, falling, PARTLY),  # network 1 has no tight cluster
        (false, rising, NOT),
    ):
        assert verdict_of(scatter.fit_spread(survey, fits, SETS, THRESHOLDS)) is verdict


R_SQUARED = np.linspace(0.9, 0.5, 9), np.linspace(0.5, 0.9, 9)


def test_magnitudes_of_network_3():
    statement, tensor = STATEMENTS["network3-stretches"], np.diag([0.36, 0.12, 0.52])
    network = curves(tensors=tensor)
    found = of_curves.magnitudes(statement, network, tensor, THRESHOLDS)
    assert verdict_of(found) is CONTRADICTED
    # √(H:C) of diag(3.33, 3.33, 3.33⁻²) and of diag(1.17, 1.17⁻², 1.17).
    assert "2.31 and 1.13" in found.why
    ours = tuple(network.magnitude[0, 1:3, -1].round(3).tolist())
    found = of_curves.magnitudes(replace(statement, value=ours), network, tensor, THRESHOLDS)
    assert verdict_of(found) is REPRODUCED
    both = tuple(curves(stretch=1.5, tensors=tensor).magnitude[0, 1:3, -1].round(3).tolist())  # one λ_f, but another
    assert verdict_of(of_curves.magnitudes(replace(statement, value=both), network, tensor, THRESHOLDS)) is NOT


@pytest.mark.parametrize(
    ("biaxial", "uniaxial", "verdict"), [(2.0, 2.0, REPRODUCED), (2.0, 0.5, PARTLY), (0.5, 0.5, NOT)]
)
def test_stiffer_across(biaxial, uniaxial, verdict):
    made = curves({"xy_biaxial": biaxial, "x_uniaxial": uniaxial})
    assert verdict_of(of_curves.stiffer_across(made, THRESHOLDS)) is verdict


def shortened(made: Curves) -> Curves:
    """The same with a load of another kind behind the others, under which the mean fibre gets shorter."""
    arrays = {name: np.concatenate([value, value[:, :1]], axis=1) for name, value in loaded_arrays(made).items()}
    arrays["deformation_gradient"][:, -1] = np.linspace(1.0, 0.9, made.magnitude.shape[2])[:, None, None] * np.eye(3)
    return replace(made, loads=(*made.loads, "squeeze"), **arrays)


def loaded_arrays(made: Curves) -> dict[str, np.ndarray]:
    fixed = ("numbers", "names", "loads", "structure_tensor")
    return {name: value for name, value in vars(made).items() if name not in fixed}


def test_a_load_that_shortens_the_mean_fibre_is_compared_with_no_other():
    """There is no λ_f above 1 at which it has an energy; what is said of the others stays."""
    small, large = curves({"xy_shear": 3.0}, 1.1), curves({"xy_shear": 1.5})
    sets = {name: (*loads, "squeeze") for name, loads in SETS.items()}
    of_others = of_curves.convergence_of_curves(small, large, SETS, THRESHOLDS)
    assert of_curves.convergence_of_curves(shortened(small), shortened(large), sets, THRESHOLDS) == of_others
    assert of_curves.stiffer_across(shortened(large), THRESHOLDS) == of_curves.stiffer_across(large, THRESHOLDS)
    every = ensemble((1.0, 1.0), (1.0, 3.0))
    found = scatter.dissimilarity(shortened(every), sets, THRESHOLDS)
    assert found == scatter.dissimilarity(every, SETS, THRESHOLDS)


@pytest.mark.parametrize(("iterations", "verdict"), [(6, REPRODUCED), (3, PARTLY), (11, NOT)])
def test_newton_iterations(iterations, verdict):
    statement = STATEMENTS["newton-iterations"]
    assert verdict_of(of_curves.newton_iterations(statement, curves(iterations=iterations), THRESHOLDS)) is verdict


def test_the_percentages_of_figure_3_are_the_cubes():
    found = of_curves.rows_of_figure_3(curves(stretch=np.sqrt(1.2)), curves())
    assert verdict_of(found) is CONTRADICTED
    # ½(1.2 − 1) and ½(1.8² − 1); ½(λ_f² − 1) with λ_f² = 0.69 · 1.8² + 0.31/1.8.
    assert "10 % and 112 %" in found.why
    assert f"{50 * (0.69 * 1.8**2 + 0.31 / 1.8 - 1):.0f} %;" in found.why


def test_the_percentages_of_figure_3_are_the_cubes_under_a_load_with_its_own_gradient():
    """A line along x becomes as long as the first column of F."""
    made = curves()
    gradient = made.deformation_gradient.copy()
    gradient[:, 0, -1] = [[1.2, 0.0, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 1.0]]
    own = replace(made, loads=("mine", *LOADS[1:]), deformation_gradient=gradient)
    assert of_curves.rows_of_figure_3(own, made).here.startswith("Green strain 34 % along x")


def test_constants_of_one_law_are_found_up_to_any_stretch():
    made = curves()
    for stretch in (np.inf, 1.3):
        found = constants_up_to(made, 50.0, stretch)
        np.testing.assert_allclose(found.C2, 0.2, rtol=1e-6)
        np.testing.assert_allclose(found.C3, 0.5, rtol=1e-6)
        assert found.amplitude.max() <= stretch
    beyond = made.averaged_stretch > 1.3
    stiffened = replace(made, strain_energy_density=np.where(beyond, 9.0, 1.0) * made.strain_energy_density)
    np.testing.assert_allclose(constants_up_to(stiffened, 50.0, 1.3).C2, 0.2, rtol=1e-6)
    assert constants_up_to(stiffened, 50.0).C3.min() > 0.6


def group_fits(small, large):
    return families.group_fits({"112 %": curves(large), "10 %": curves(small)}, ["case"], SETS, 50.0)


@pytest.mark.parametrize(
    ("small", "large", "trusted", "denied"),
    [
        ({}, {}, REPRODUCED, CONTRADICTED),
        ({"xy_biaxial": 9.0, "xy_shear": 9.0}, {}, PARTLY, PARTLY),
        ({"xy_biaxial": 9.0, "xy_shear": 9.0}, {"xy_biaxial": 9.0, "xy_shear": 9.0}, CONTRADICTED, REPRODUCED),
    ],
)
def test_families(small, large, trusted, denied):
    found = group_fits(small, large)
    # Two ranges and two load sets, each with a pair of biaxial loads, one of shears, and all five; no load alone.
    assert sorted(len(one.loads) for one in found) == [2] * 8 + [5] * 4
    assert verdict_of(families.families(found, True, THRESHOLDS)) is trusted
    assert verdict_of(families.families(found, False, THRESHOLDS)) is denied


def test_the_range_of_strain_decides_between_the_sections():
    found = families.families(group_fits({"xy_biaxial": 9.0, "xy_shear": 9.0}, {}), True, THRESHOLDS)
    assert found.why.endswith("nearer to the truth is section 4.1 at 112 % and section 3.1 at 10 %.")


def test_a_load_with_its_own_gradient_belongs_to_no_family():
    """It counts among all loads, and leaves the families of the others as they are."""
    own = replace(curves(), loads=("mine", *LOADS[1:]))
    sets = {name: ("mine", *loads[1:]) for name, loads in SETS.items()}
    found = families.group_fits({"10 %": own}, ["case"], sets, 50.0)
    usual = families.group_fits({"10 %": curves()}, ["case"], SETS, 50.0)
    assert [one.loads for one in found if not one.pooled] == [one.loads for one in usual if not one.pooled]
    assert [one.loads for one in found if one.pooled] == list(sets.values())


def test_a_load_set_without_families_leaves_the_verdict_to_the_others():
    """One load of a kind is no family, as in a set of tension alone."""
    for factors, verdict in (({}, REPRODUCED), ({"xy_biaxial": 9.0, "xy_shear": 9.0}, CONTRADICTED)):
        ranges = {"112 %": curves(factors), "10 %": curves(factors)}
        found = families.group_fits(ranges, ["case"], {**SETS, "tension": LOADS[:2]}, 50.0)
        assert verdict_of(families.families(found, True, THRESHOLDS)) is verdict
