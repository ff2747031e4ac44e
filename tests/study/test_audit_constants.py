"""Verdicts follow the data: constants of Eq. 2 over alignment, made up so that a statement is true or false."""

from dataclasses import replace

import numpy as np
import pytest
from made_up_evidence import (
    CONFIG,
    CONTRADICTED,
    LOADS,
    NOT,
    PARTLY,
    PRINTED,
    REPRODUCED,
    SETS,
    constants,
    curves,
    evidence,
    fits,
    found,
    value_of,
)

from fibrous.deformation import Load
from fibrous.fitting.surface import evaluate
from fibrous.networks.generation import alignment_targets
from fibrous_study.audit import constants as of_constants
from fibrous_study.audit import table_1

FALLS, RISES, LEVEL = np.linspace(0.5, 0.1, 9), np.linspace(0.1, 0.5, 9), np.tile([0.2, 0.3, 0.2], 3)
NONE = np.zeros(9)


@pytest.fixture
def trend(monkeypatch):
    """The check of a trend, section 3.2's or 4.1's, on fits up to the networks' own λ_f and up to a common one."""

    def judge(statement, own, common):
        monkeypatch.setattr(of_constants, "own_fits", lambda _: own)
        monkeypatch.setattr(of_constants, "common_fits", lambda _: common)
        return found(statement, ensemble=curves())

    return judge


@pytest.mark.parametrize(
    ("C2", "C3", "near_isotropy", "growth"),
    [
        (FALLS, RISES, REPRODUCED, CONTRADICTED),
        (RISES, RISES, CONTRADICTED, REPRODUCED),
        (LEVEL, RISES, PARTLY, PARTLY),
        (LEVEL, FALLS, NOT, NOT),
    ],
)
def test_trends_of_the_constants(trend, C2, C3, near_isotropy, growth):
    made = fits(C2, C3)
    assert trend("c2-trend", made, made).verdict is near_isotropy
    assert trend("c2-trend-discussion", made, made).verdict is growth


def test_a_trend_of_the_amplitude_is_none_of_the_constants(trend):
    """C3 that rises up to the networks' own λ_f alone, and is at its bound up to a common one."""
    own, common = fits(FALLS, RISES), fits(FALLS, NONE)
    finding = trend("c2-trend", own, common)
    assert finding.verdict is PARTLY
    for name in SETS:
        for way, rises, rank, at_bound in (("own", 1, 1.0, 0.0), ("common", 0, 0.0, 1.0)):
            assert value_of(finding, f"C3_rises_{way}", name) == rises
            assert value_of(finding, f"rank_C3_{way}", name) == pytest.approx(rank)
            assert value_of(finding, f"C3_at_bound_{way}", name) == at_bound
    assert trend("c2-trend-discussion", common, own).verdict is CONTRADICTED


def test_a_trend_over_the_ensemble_alone_is_none(trend):
    """Networks 1 and 5 themselves must follow it."""
    turned = fits(FALLS, RISES, (FALLS[-1], RISES[0], FALLS[0], RISES[-1]))
    assert trend("c2-trend", turned, turned).verdict is PARTLY


def test_networks_aligned_across_the_loads_make_no_trend(trend):
    """Of H11 below 3/8 H22 is larger: with all of them C2 would rise."""
    made = constants(FALLS, RISES)
    steep = np.where(made.H11 < 0.375, -9.0, made.C2)
    by_set = {name: replace(one, ensemble=replace(made, C2=steep)) for name, one in fits(FALLS, RISES).items()}
    assert made.H11.searchsorted(0.375) == 1
    finding = trend("c2-trend", by_set, by_set)
    assert finding.verdict is REPRODUCED
    assert value_of(finding, "aligned") == 8


def test_the_common_stretch_is_that_which_all_networks_reach():
    """Fits up to it leave out what is beyond, and those up to the networks' own λ_f are the tables'."""
    named = replace(curves(stretch=1.5), names=np.array(["first", "fifth"]))
    large_fits = {name: replace(constants([1.0, 2.0], [3.0, 4.0]), names=named.names) for name in SETS}
    of = evidence(
        ensemble=curves(),
        large=named,
        large_fits=large_fits,
        ensemble_large_fits=large_fits,
        survey=("first", "", "", "", "fifth"),
    )
    common = of_constants.common_fits(of)["with_xz"]
    assert common.ensemble.amplitude.max() <= named.averaged_stretch[:, 0, -1].min() * (1 + 1e-9)
    assert pytest.approx([0.2], rel=1e-6) == common.fifth.C2
    assert of_constants.own_fits(of)["with_yz"].fifth.C3.tolist() == [4.0]


def of_table(statement, ours, coefficient, printed=None):
    """The check of Table 1 on constants of an ensemble and coefficients of their surface."""
    results = {"ensemble_large_fits": {"one": ours}, "surface_coefficients": {"C2": coefficient, "C3": coefficient}}
    return found(statement, printed, **results)


def test_no_reading_of_the_printed_moduli_is_one():
    H11, H22, H33 = np.einsum("nii->in", alignment_targets(np.arange(750), 2021, (0.33, 0.80), 0.05))
    ours = replace(constants(np.full(750, 0.3), np.full(750, 0.3)), H11=H11, H22=H22, H33=H33)
    finding = of_table("table1-c2", ours, {"one": np.zeros(9)})
    assert finding.verdict is CONTRADICTED
    assert value_of(finding, "coefficients_inside", "one") == 0
    # Section 4.1's modulus that grows is what two relabellings and two turned signs give.
    assert [value_of(finding, f"readings_{way}") for way in ("falling", "rising")] == [0, 4]
    # Swapped indices, by hand: each coefficient times H22^i H11^j.
    swapped = table_1.readings(PRINTED["table1-c2"]["coefficient"], ours)["H22_H11"]
    powers = ((0, 0), (0, 1), (1, 0), (1, 1), (0, 2), (2, 0), (1, 2), (2, 1), (2, 2))
    by_hand = sum(c * H22**i * H11**j for c, (i, j) in zip(PRINTED["table1-c2"]["coefficient"], powers, strict=True))
    np.testing.assert_allclose(swapped, by_hand, rtol=1e-12)
    assert value_of(finding, "negative_H22_H11") == np.mean(by_hand < 0)


def test_a_printed_surface_that_is_ours_is_reproduced():
    # C2 = 0.7 - 0.5 H11, in the order 00 01 10 11 02 20 12 21 22.
    falling = {"coefficient": [0.7, 0.0, -0.5, 0, 0, 0, 0, 0, 0]}
    ours = constants(0.7 - 0.5 * np.linspace(0.33, 0.80, 9), RISES)
    surface = {"one": np.array([0.7, 1.89, -0.5, 0.59, 0.0, 0.0, 0.0, 0.0, 0.0])}
    for made, verdict in ((ours, REPRODUCED), (constants(3.0 * ours.C2, RISES), PARTLY)):
        finding = of_table("table1-c2", made, surface, falling)
        assert finding.verdict is verdict
        # 0.59 is outside 0 ± 0.58, 1.89 at the end of 0 ± 1.89
        assert value_of(finding, "coefficients_inside", "one") == 8
    turned = of_table("table1-c2", ours, surface, {"coefficient": [-one for one in falling["coefficient"]]})
    assert turned.verdict is PARTLY
    assert value_of(turned, "negative_H11_H22_turned") == 0.0
    rising = {"coefficient": [0.1, 0.0, 0.5, 0, 0, 0, 0, 0, 0]}
    made = constants(FALLS, evaluate(rising["coefficient"], ours.H11, ours.H22))
    assert of_table("table1-c3", made, surface, rising).verdict is REPRODUCED
    assert of_table("table1-c3", constants(FALLS, NONE), surface, rising).verdict is PARTLY


@pytest.mark.parametrize(
    ("ours", "verdict"),
    [
        ({"a": (0.99, 0.9), "b": (0.49, 0.70)}, REPRODUCED),
        ({"a": (0.99, 0.9), "b": (0.49, 0.4)}, PARTLY),
        ({"a": (0.99, 0.9), "b": (0.23, 0.4)}, NOT),  # the printed ones between the two are nothing
        ({"a": (0.49, 0.9), "b": (0.90, 0.70)}, PARTLY),  # one surface each is not one study
    ],
)
def test_r_squared_of_the_surfaces(ours, verdict):
    ensemble, named = constants(FALLS, RISES), constants([0.1, 0.3, 0.2, 0.4], [0.3, 0.3, 0.4, 0.4], names="aabb")
    finding = found(
        "surface-r2",
        surface_r_squared={name: {"C2": one, "C3": other} for name, (one, other) in ours.items()},
        ensemble_large_fits=dict.fromkeys(ours, ensemble),
        large_fits=dict.fromkeys(ours, named),
    )
    assert finding.verdict is verdict
    # Var of 0.1, 0.3 is 0.02; of nine numbers 0.05 apart it is 60 · 0.05²/8.
    assert value_of(finding, "C2_scatter", "a") == pytest.approx(0.02 / (60 * 0.05**2 / 8))
    assert value_of(finding, "C3_scatter", "a") == 0.0


def of_amplitude(small, large, pair=None):
    """The check of constants at two ranges, those of the case study and of the ensemble being the same."""
    by_set = [{"with_xz": one} for one in (small, large)]
    results = {
        "case_name": "",
        "survey": ("",),
        "small": pair or replace(curves(stretch=1.1), names=np.array([""] * 2)),
    }
    names = "small_fits", "large_fits", "ensemble_small_fits", "ensemble_large_fits"
    return found("constants-of-alignment-alone", **results, **dict(zip(names, by_set * 2, strict=True)))


def test_constants_belong_to_their_amplitude():
    small, large, nonlinear = constants(2.0 * FALLS, RISES), constants(FALLS, RISES), constants(FALLS, 2.0 * RISES)
    for first, verdict in ((large, REPRODUCED), (small, NOT), (nonlinear, NOT)):
        assert of_amplitude(first, large).verdict is verdict
    assert value_of(of_amplitude(small, large), "median_C2_ratio") == pytest.approx(2.0)


def test_the_exponent_of_the_energy_at_small_strain():
    """That of Eq. 2 is 2, and a law that is linear in λ_f - 1 has 1."""
    made = replace(curves(stretch=1.02), names=np.array([""] * 2))
    np.testing.assert_allclose(of_constants.starting_exponents(made), 2.0, atol=0.05)
    linear = replace(made, strain_energy_density=0.3 * (made.averaged_stretch - 1.0))
    np.testing.assert_allclose(of_constants.starting_exponents(linear), 1.0, rtol=1e-9)
    shear = np.array([Load.parse(load).kind == "shear" for load in LOADS])[:, None]
    mixed = replace(
        made, strain_energy_density=np.where(shear, linear.strain_energy_density, made.strain_energy_density)
    )
    fit = constants(FALLS, RISES)
    for one in (mixed, replace(mixed, loads=("mine", *LOADS[1:]))):  # a load with its own gradient is no shear
        finding = of_amplitude(fit, fit, one)
        assert value_of(finding, "exponent_shear_largest") == pytest.approx(1.0)
        assert value_of(finding, "exponent_others_least") == pytest.approx(2.0, abs=0.05)


def of_pair(with_xz, with_yz, every, small=None, large=None):
    """The check of the two load sets, whose constants are those of the case study and of the ensemble."""
    both = {"with_xz": with_xz, "with_yz": with_yz}
    pair = [replace(one or curves(), names=np.array([""] * 2)) for one in (small, large)]
    results = {"case_name": "", "small": pair[0], "large": pair[1], "ensemble": every}
    return found("shear-pair", large_fits=both, ensemble_large_fits=both, **results)


def test_the_pair_of_shears_matters_where_constants_or_quality_of_the_fits_differ():
    made = constants(FALLS, RISES)
    every = curves().of(np.zeros(9, dtype=int))
    for other, verdict in (
        (made, REPRODUCED),
        (constants(2.0 * FALLS, RISES), CONTRADICTED),
        (constants(FALLS, 2.0 * RISES), CONTRADICTED),
        (constants(FALLS, RISES, 0.5), CONTRADICTED),
    ):
        assert of_pair(made, other, every).verdict is verdict


LOW, AROUND = np.full(20, 0.5), np.tile([2.0, 3.0], 10)


@pytest.mark.parametrize(("with_xz", "with_yz", "reached"), [(LOW, AROUND, [0, 1]), (AROUND, LOW, [1, 0])])
def test_which_pair_of_shears_the_paper_used(with_xz, with_yz, reached):
    """The printed C3 of network 5 is 2.51; curves approach each other with xz-shear alone."""
    every = curves().of(np.zeros(20, dtype=int))
    cut = replace(every, amplitude_limited=np.tile([load == "yz_shear" for load in LOADS], (20, 1)))
    pair = curves({"xy_shear": 3.0}, 1.1), curves({"xy_shear": 1.5, "yz_shear": 9.0})
    finding = of_pair(constants(np.ones(20), with_xz), constants(np.ones(20), with_yz), cut, *pair)
    assert finding.verdict is CONTRADICTED
    assert value_of(finding, "nearest") == 4
    table, at = CONFIG["paper"]["table_1"], CONFIG["paper"]["alignments"]["network_5"]
    assert value_of(finding, "C3_printed") == pytest.approx(float(evaluate(table["C3"], *at)))
    for name, values in (("approach", [1, 0]), ("reached", reached), ("cut", [0, 4])):
        assert [value_of(finding, name, load_set) for load_set in SETS] == values
