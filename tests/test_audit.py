"""Verdicts follow the data: data made up so that a statement is true, half true or false."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from made_up_evidence import CASE, LOADS, SETS, THRESHOLDS, constants, curves

from fibrous.audit import constants as of_constants
from fibrous.audit import costs, example, laws, tissue
from fibrous.audit import curves as of_curves
from fibrous.audit.costs import Costs
from fibrous.audit.finding import Verdict, rank_correlation
from fibrous.audit.statements import CHECKS
from fibrous.audit.tissue import Tissue
from fibrous.comparison import Fields
from fibrous.fitting import printed
from fibrous.fitting.surface import evaluate
from fibrous.material_point import along_path
from fibrous.materials.hgo import HGOFamilies, HGOStructureTensor
from fibrous.networks.generation import alignment_targets
from fibrous.networks.three_fibers import affine, equilibrium
from fibrous.study.claims import statement_of
from fibrous.study.configuration import CLAIMS

REPRODUCED, PARTLY, NOT, CONTRADICTED, UNKNOWN = Verdict
TALLIED = yaml.safe_load(CLAIMS.read_text(encoding="utf-8"))
STATEMENTS = {entry["id"]: statement_of(entry) for entry in TALLIED}


def test_every_statement_is_judged_and_nothing_else():
    assert list(STATEMENTS) == list(CHECKS)
    assert len(STATEMENTS) == len(TALLIED) >= 35


def test_rank_correlation_is_that_of_ranks_with_ties():
    # Ranks 1, 2.5, 2.5, 4 against 1, 2, 3, 4: covariance 4.5, squares 4.5 and 5.
    assert rank_correlation([0.0, 1.0, 1.0, 9.0], [2.0, 3.0, 5.0, 7.0]) == pytest.approx(4.5 / np.sqrt(4.5 * 5.0))
    assert rank_correlation([1.0, 2.0, 3.0], [3.0, 2.0, -9.0]) == pytest.approx(-1.0)


# The three-fibre example -------------------------------------------------------------------------------------------


def test_the_three_fibre_example_and_other_stretches_of_it():
    judge = {
        "fig7-aligned-estimate": lambda s, x: example.averaged_stretch(s, affine(x), THRESHOLDS),
        "fig7-transverse-estimate": lambda s, x: example.averaged_stretch(s, affine(1 / x), THRESHOLDS),
        "fig7-transverse-lengths": lambda s, x: example.transverse_lengths(s, equilibrium(1 / x), THRESHOLDS),
        "fig7-transverse-stretches": lambda s, x: example.transverse_stretches(s, equilibrium(1 / x), THRESHOLDS),
    }
    for name, judged in judge.items():
        assert judged(STATEMENTS[name], 1.5).verdict is REPRODUCED
        assert judged(STATEMENTS[name], 1.45).verdict is NOT


def test_the_mean_along_the_alignment_is_that_of_the_affine_state_alone():
    statement, states = STATEMENTS["fig7-aligned-mean"], (affine(1.5), equilibrium(1.5))
    found = example.aligned_mean(statement, *states, THRESHOLDS)
    assert found.verdict is CONTRADICTED
    assert found.here == "1.222 affine, 1.297 in equilibrium"
    for value, verdict in ((1.297, REPRODUCED), (1.4, NOT)):
        assert example.aligned_mean(replace(statement, value=(value,)), *states, THRESHOLDS).verdict is verdict


# Networks and their curves -----------------------------------------------------------------------------------------


def test_alignment_and_volume_fraction_are_those_printed():
    tensors = np.array([CASE, CASE])
    assert of_curves.alignment(STATEMENTS["case-alignment"], tensors).verdict is REPRODUCED
    off = tensors + np.diag([0.006, -0.006, 0.0])
    assert of_curves.alignment(STATEMENTS["case-alignment"], off).verdict is NOT
    for fraction, verdict in ((0.04, REPRODUCED), (0.0403, NOT)):
        found = of_curves.volume_fraction(STATEMENTS["case-volume-fraction"], np.full(3, fraction), THRESHOLDS)
        assert found.verdict is verdict


@pytest.mark.parametrize(("small", "large", "verdict"), [(0.2, 0.1, REPRODUCED), (0.1, 0.2, PARTLY), (0.01, 0.02, NOT)])
def test_realignment(small, large, verdict):
    few, many = (curves(orientation={"xy_shear": 0.7 - apart}) for apart in (small, large))
    assert of_curves.realignment(few, many, SETS, THRESHOLDS).verdict is verdict


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
    assert found.verdict is verdict


def test_energies_are_compared_at_one_averaged_stretch():
    """Loads of one law that end at different λ_f are alike, whichever ends first."""
    whole = curves()
    cut = replace(whole, **{name: value.copy() for name, value in vars(whole).items() if isinstance(value, np.ndarray)})
    for name in ("averaged_stretch", "strain_energy_density"):
        getattr(cut, name)[:, 2] = getattr(curves(stretch=1.5), name)[:, 2]
    assert cut.dissimilarity() == pytest.approx(1.0, rel=0.02)
    assert whole.dissimilarity() == pytest.approx(1.0, rel=1e-9)


def ensemble(*factors: tuple[float, float]):
    """Networks of rising H11; W of the last two shears grows from the least to the most aligned by these factors."""
    made = [
        curves(
            dict(zip(LOADS[-2:], growth.tolist(), strict=True)),
            tensors=np.diag([H11, 0.6 * (1 - H11), 0.4 * (1 - H11)]),
        )
        for H11, growth in zip(np.linspace(0.4, 0.8, 10), np.linspace(*factors, 10), strict=True)
    ]
    joined = {name: np.concatenate([getattr(one, name) for one in made]) for name in vars(made[0]) if name != "loads"}
    return replace(made[0], **joined)


def test_dissimilarity_over_alignment():
    for ends, verdict in (
        (((1.0, 1.0), (9.0, 9.0)), REPRODUCED),
        (((9.0, 1.0), (1.0, 9.0)), PARTLY),
        (((9.0, 9.0), (1.0, 1.0)), NOT),
    ):
        assert of_curves.dissimilarity(ensemble(*ends), SETS, THRESHOLDS).verdict is verdict


def test_fits_get_worse_with_alignment_and_curves_scatter():
    falling, rising = ({name: constants(np.ones(9), np.ones(9), r) for name in SETS} for r in R_SQUARED)
    tight, wide = curves(), curves({"xy_shear": 4.0})
    true = dict(zip("12345", (tight, wide, wide, wide, wide), strict=True))
    false = dict(zip("12345", (wide, wide, wide, tight, tight), strict=True))
    for survey, fits, verdict in ((true, falling, REPRODUCED), (true, rising, PARTLY), (false, rising, NOT)):
        assert of_curves.fit_spread(survey, fits, SETS, THRESHOLDS).verdict is verdict


R_SQUARED = np.linspace(0.9, 0.5, 9), np.linspace(0.5, 0.9, 9)


def test_magnitudes_of_network_3():
    statement, tensor = STATEMENTS["network3-stretches"], np.diag([0.36, 0.12, 0.52])
    network = curves(tensors=tensor)
    found = of_curves.magnitudes(statement, network, tensor, THRESHOLDS)
    assert found.verdict is CONTRADICTED
    # √(H:C) of diag(3.33, 3.33, 3.33⁻²) and of diag(1.17, 1.17⁻², 1.17).
    assert "2.31 and 1.13" in found.why
    ours = tuple(network.magnitude[0, 1:3, -1].tolist())
    assert of_curves.magnitudes(replace(statement, value=ours), network, tensor, THRESHOLDS).verdict is REPRODUCED
    both = tuple(curves(stretch=1.5, tensors=tensor).magnitude[0, 1:3, -1].tolist())  # one λ_f, but another
    assert of_curves.magnitudes(replace(statement, value=both), network, tensor, THRESHOLDS).verdict is NOT


@pytest.mark.parametrize(("factor", "verdict"), [(2.0, REPRODUCED), (0.5, NOT)])
def test_stiffer_across(factor, verdict):
    assert of_curves.stiffer_across(curves({"xy_biaxial": factor}), THRESHOLDS).verdict is verdict


@pytest.mark.parametrize(("iterations", "verdict"), [(6, REPRODUCED), (3, PARTLY), (11, NOT)])
def test_newton_iterations(iterations, verdict):
    statement = STATEMENTS["newton-iterations"]
    assert of_curves.newton_iterations(statement, curves(iterations=iterations), THRESHOLDS).verdict is verdict


@pytest.mark.parametrize(
    ("factors", "trusted", "denied"),
    [
        ({}, REPRODUCED, CONTRADICTED),
        ({"xy_biaxial": 9.0}, PARTLY, PARTLY),
    ],
)
def test_families(factors, trusted, denied):
    found = of_curves.fit_families({"112 %": curves(factors)}, SETS, 50.0)
    assert len(found) == 4
    assert found["x_uniaxial at 112 %"] == pytest.approx(1.0)
    assert of_curves.families(found, True, THRESHOLDS).verdict is trusted
    assert of_curves.families(found, False, THRESHOLDS).verdict is denied
    poor = {name: np.full(3, 0.2) for name in found}
    assert of_curves.families(poor, True, THRESHOLDS).verdict is CONTRADICTED
    assert of_curves.families(poor, False, THRESHOLDS).verdict is REPRODUCED


# Constants over alignment ------------------------------------------------------------------------------------------

FALLS, RISES, LEVEL = np.linspace(0.5, 0.1, 9), np.linspace(0.1, 0.5, 9), np.tile([0.2, 0.3, 0.2], 3)


@pytest.mark.parametrize(
    ("C2", "C3", "near_isotropy", "growth"),
    [
        (FALLS, RISES, REPRODUCED, CONTRADICTED),
        (RISES, RISES, CONTRADICTED, REPRODUCED),
        (LEVEL, RISES, PARTLY, PARTLY),
        (LEVEL, FALLS, NOT, NOT),
    ],
)
def test_trends_of_the_constants(C2, C3, near_isotropy, growth):
    fits = {name: constants(C2, C3) for name in SETS}
    pair = constants([C2[0], C2[0], C2[-1], C2[-1]], [C3[0], C3[0], C3[-1], C3[-1]], names="1155")
    ends = dict.fromkeys(SETS, pair)
    assert of_constants.near_isotropy(fits, ends, THRESHOLDS).verdict is near_isotropy
    assert of_constants.growth(fits, ends, THRESHOLDS).verdict is growth


def test_a_trend_over_the_ensemble_alone_is_none():
    """Networks 1 and 5 themselves must follow it."""
    turned = constants([FALLS[-1]] * 2 + [FALLS[0]] * 2, [RISES[0]] * 2 + [RISES[-1]] * 2, names="1155")
    fits = {name: constants(FALLS, RISES) for name in SETS}
    assert of_constants.near_isotropy(fits, dict.fromkeys(SETS, turned), THRESHOLDS).verdict is PARTLY


def test_no_reading_of_the_printed_moduli_is_one():
    H11, H22, H33 = np.einsum("nii->in", alignment_targets(np.arange(750), 2021, (0.33, 0.80), 0.05))
    level = constants(np.full(750, 0.3), np.full(750, 0.3))
    fits = {"one": replace(level, H11=H11, H22=H22, H33=H33)}
    found = of_constants.table_1(STATEMENTS["table1-c2"], "C2", fits, {"one": np.zeros(9)}, THRESHOLDS)
    assert found.verdict is CONTRADICTED
    assert found.here.endswith("0 of 9 (one)")
    # Swapped indices, by hand: each coefficient times H22^i H11^j.
    swapped = of_constants.readings(np.array(printed.C2_MPA), fits["one"])["(H22, H11)"]
    powers = ((0, 0), (0, 1), (1, 0), (1, 1), (0, 2), (2, 0), (1, 2), (2, 1), (2, 2))
    by_hand = sum(c * H22**i * H11**j for c, (i, j) in zip(printed.C2_MPA, powers, strict=True))
    np.testing.assert_allclose(swapped, by_hand, rtol=1e-12)


def test_a_printed_surface_that_is_ours_is_reproduced():
    # C2 = 0.7 - 0.5 H11, in the order 00 01 10 11 02 20 12 21 22.
    statement = replace(STATEMENTS["table1-c2"], value=(0.7, 0.0, -0.5, 0, 0, 0, 0, 0, 0))
    ours = constants(0.7 - 0.5 * np.linspace(0.33, 0.80, 9), RISES)
    surface = {"one": np.array([0.7, 1.89, -0.5, 0.59, 0.0, 0.0, 0.0, 0.0, 0.0])}
    for fits, verdict in ((ours, REPRODUCED), (constants(3.0 * ours.C2, RISES), PARTLY)):
        found = of_constants.table_1(statement, "C2", {"one": fits}, surface, THRESHOLDS)
        assert found.verdict is verdict
        assert found.here.endswith("8 of 9 (one)")  # 0.59 is outside 0 ± 0.58, 1.89 at the end of 0 ± 1.89
    turned = replace(statement, value=tuple(-one for one in statement.value))
    found = of_constants.table_1(turned, "C2", {"one": ours}, surface, THRESHOLDS)
    assert found.verdict is PARTLY
    assert "(H11, H22) with the sign turned" in found.why
    rising = replace(STATEMENTS["table1-c3"], value=(0.1, 0.0, 0.5, 0, 0, 0, 0, 0, 0))
    fits = constants(FALLS, evaluate(rising.value, ours.H11, ours.H22))
    assert of_constants.table_1(rising, "C3", {"one": fits}, surface, THRESHOLDS).verdict is REPRODUCED


@pytest.mark.parametrize(
    ("ours", "verdict"),
    [
        ({"a": (0.99, 0.9), "b": (0.49, 0.70)}, REPRODUCED),
        ({"a": (0.99, 0.9), "b": (0.23, 0.4)}, PARTLY),
        ({"a": (0.99, 0.9), "b": (0.90, 0.8)}, NOT),
    ],
)
def test_r_squared_of_the_surfaces(ours, verdict):
    assert of_constants.surface_r_squared(STATEMENTS["surface-r2"], ours, THRESHOLDS).verdict is verdict


def test_constants_belong_to_their_amplitude():
    small, large = constants(2.0 * FALLS, RISES), constants(FALLS, RISES)
    assert of_constants.amplitude(small, large, (small, large), THRESHOLDS).verdict is NOT
    assert of_constants.amplitude(large, large, (large, large), THRESHOLDS).verdict is REPRODUCED


def test_the_pair_of_shears_matters_where_constants_or_quality_of_the_fits_differ():
    fits = constants(FALLS, RISES)
    for other, verdict in (
        (fits, REPRODUCED),
        (constants(2.0 * FALLS, RISES), CONTRADICTED),
        (constants(FALLS, RISES, 0.5), CONTRADICTED),
    ):
        both = {"with_xz": fits, "with_yz": other}
        assert of_constants.shear_pair(both, both, THRESHOLDS).verdict is verdict


# Laws under Eq. 9 --------------------------------------------------------------------------------------------------


def along_eq_9(law, C2: float, C3: float):
    """Two networks that answer as a law does."""
    end = np.reshape(STATEMENTS["eq9-isochoric"].value, (3, 3))
    gradient = np.eye(3) + np.linspace(0.0, 1.0, 21)[:, None, None] * (end - np.eye(3))
    response = along_path(law(CASE, C2, C3), gradient)
    return replace(
        curves().under(("x_uniaxial",)),
        loads=("eq9",),
        deformation_gradient=np.tile(gradient, (2, 1, 1, 1, 1)),
        strain_energy_density=np.tile(response.strain_energy_density, (2, 1, 1)),
        cauchy_stress=np.tile(response.cauchy_stress, (2, 1, 1, 1, 1)),
    )


def eq_2(tensor, C2, C3):
    return HGOStructureTensor(C2, C3, tensor)


def with_constants(C2: float, C3: float):
    return constants(np.full(2, C2), np.full(2, C3))


def test_errors_of_a_law_that_is_the_network():
    path = along_eq_9(eq_2, 0.2, 0.5)
    found = laws.errors(path, {laws.INITIAL: with_constants(0.1, 0.5), laws.REFIT: with_constants(0.2, 0.5)})
    half, whole = found["Eq. 2", laws.INITIAL], found["Eq. 2", laws.REFIT]
    np.testing.assert_allclose([half.end_ratio, half.along_x, half.whole, half.energy_ratio], 0.5, rtol=1e-12)
    np.testing.assert_allclose([half.shape, whole.whole, whole.along_x], 0.0, atol=1e-12)


def test_an_unknown_state_is_left_out():
    path = along_eq_9(eq_2, 0.2, 0.5)
    path.strain_energy_density[:, :, 7] = np.nan
    path.cauchy_stress[:, :, 7] = np.nan
    found = laws.errors(path, {laws.REFIT: with_constants(0.2, 0.5)})["Eq. 2", laws.REFIT]
    np.testing.assert_allclose(found.whole, 0.0, atol=1e-12)


def made_up_errors(**values: float):
    """The same errors of both laws, initial and refit; `refit_…` changes those after the refit."""
    base = {"end_ratio": 1.2, "along_x": 0.4, "whole": 0.4, "shape": 0.2, "energy_ratio": 1.0}
    initial = base | {name: value for name, value in values.items() if name in base}
    refit = base | {name.removeprefix("refit_"): value for name, value in values.items() if name not in base}
    made = {
        kind: laws.Errors(**{name: np.full(3, value) for name, value in one.items()})
        for kind, one in ((laws.INITIAL, initial), (laws.REFIT, refit))
    }
    return {(law, kind): made[kind] for law in laws.LAWS for kind in made}


def test_the_initial_fit_and_the_refit():
    assert laws.initial_fit(made_up_errors(), THRESHOLDS).verdict is REPRODUCED
    assert laws.initial_fit(made_up_errors(end_ratio=2.0), THRESHOLDS).verdict is PARTLY
    assert laws.initial_fit(made_up_errors(end_ratio=0.5, shape=0.01), THRESHOLDS).verdict is NOT
    assert laws.refit(made_up_errors(refit_along_x=0.1, refit_whole=0.1), THRESHOLDS).verdict is REPRODUCED
    assert laws.refit(made_up_errors(refit_along_x=0.1), THRESHOLDS).verdict is PARTLY
    assert laws.refit(made_up_errors(refit_along_x=0.3, refit_whole=0.5), THRESHOLDS).verdict is NOT


def test_constants_of_one_law_run_in_the_other():
    path = along_eq_9(eq_2, 0.2, 0.5)
    found = laws.errors(path, dict.fromkeys((laws.INITIAL, laws.REFIT), with_constants(0.2, 0.5)))
    assert (found["Eq. 10C", laws.REFIT].energy_ratio > 1.5).all()  # Jensen
    assert laws.mixture(found, THRESHOLDS).verdict is CONTRADICTED
    same = {(law, kind): found["Eq. 2", kind] for law, kind in found}
    assert laws.mixture(same, THRESHOLDS).verdict is REPRODUCED
    families = laws.errors(
        along_eq_9(HGOFamilies.of_structure_tensor, 0.2, 0.5), {laws.REFIT: with_constants(0.2, 0.5)}
    )
    np.testing.assert_allclose(families["Eq. 10C", laws.REFIT].whole, 0.0, atol=1e-12)


def test_the_law_of_febio_needs_one_axis():
    for tensor, verdict in ((np.diag([0.6, 0.2, 0.2]), NOT), (CASE, PARTLY)):
        assert laws.hgo_in_febio(np.array([tensor] * 4), "synthetic specimen", THRESHOLDS).verdict is verdict


# The tissue and its costs ------------------------------------------------------------------------------------------


def fields(stress: np.ndarray, strain: np.ndarray) -> Fields:
    return Fields(stress, strain, np.zeros((40, 8, 3, 3)), np.zeros((5, 3)), np.ones(3))


RAMP = np.linspace(1.0, 2.0, 40)


def made_up_tissue(initial=(1.0, 1.0), refit=(1.0, 1.0), turned: bool = False) -> Tissue:
    """Stress and strain of the hybrid, factors of the multiscale run's; `turned` puts its peaks elsewhere."""
    hybrid = [fields(*(factor * (RAMP[::-1] if turned else RAMP) for factor in pair)) for pair in (initial, refit)]
    gradient = np.broadcast_to(np.eye(3), (40, 8, 3, 3))
    return Tissue("made up", fields(RAMP, RAMP), *hybrid, gradient)


def test_peaks():
    assert tissue.peaks(made_up_tissue(), THRESHOLDS).verdict is REPRODUCED
    assert tissue.peaks(made_up_tissue(turned=True), THRESHOLDS).verdict is NOT


@pytest.mark.parametrize(("initial", "verdict"), [((0.8, 1.2), REPRODUCED), ((1.2, 1.2), PARTLY), ((1.2, 0.8), NOT)])
def test_bias_at_the_peaks(initial, verdict):
    assert tissue.bias(made_up_tissue(initial)).verdict is verdict


@pytest.mark.parametrize(("refit", "verdict"), [((1.1, 1.3), REPRODUCED), ((1.1, 1.1), PARTLY), ((1.3, 1.1), NOT)])
def test_the_direction_of_the_refit(refit, verdict):
    assert tissue.refit_direction(made_up_tissue((1.2, 1.2), refit)).verdict is verdict


def test_what_only_their_specimen_could_tell_says_so():
    for found in (
        tissue.rms(made_up_tissue((1.1, 1.0)), refitted=False),
        tissue.most_stretched(STATEMENTS["eq9-isochoric"], made_up_tissue()),
    ):
        assert found.verdict is UNKNOWN
        assert "made up" in found.why
    assert tissue.rms(made_up_tissue((1.1, 1.0)), refitted=False).here == (
        f"{0.1 * np.sqrt((RAMP**2).mean()):.3g} MPa, 0 %"
    )


SPENT = Costs(
    initial=1.0, refit=0.3, finite_elements=0.02, multiscale=2000.0, fibers=3000.0, nodes=300.0, evaluations=1000,
    network_evaluations=1000, hybrid_seconds=1.0, network_seconds=4000.0, network_share=1.0, origin="made up",
)  # fmt: skip


@pytest.mark.parametrize(
    ("hours", "verdict"), [(0.7, REPRODUCED), (0.2, PARTLY), (5.0, PARTLY), (0.03, NOT), (50.0, NOT)]
)
def test_times(hours, verdict):
    assert costs.time(STATEMENTS["time-ensemble"], hours, "synthetic specimen", THRESHOLDS).verdict is verdict


@pytest.mark.parametrize(("multiscale", "verdict"), [(2000.0, REPRODUCED), (20.0, PARTLY), (0.5, NOT)])
def test_the_gain(multiscale, verdict):
    spent = replace(SPENT, multiscale=multiscale)
    assert costs.total(STATEMENTS["time-total"], spent, THRESHOLDS).verdict is verdict


@pytest.mark.parametrize(("seconds", "verdict"), [(4000.0, REPRODUCED), (40.0, PARTLY), (0.5, NOT)])
def test_the_gain_a_gauss_point(seconds, verdict):
    assert costs.per_gauss_point(replace(SPENT, network_seconds=seconds)).verdict is verdict
