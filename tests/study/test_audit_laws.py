"""Verdicts follow the data: laws under Eq. 9, the tissue and its costs, made up for a statement to be true or not."""

from dataclasses import replace

import numpy as np
import pytest
from made_up_evidence import (
    CASE,
    CONTRADICTED,
    NOT,
    PARTLY,
    REPRODUCED,
    STATEMENTS,
    THRESHOLDS,
    UNKNOWN,
    constants,
    curves,
    verdict_of,
)

from fibrous.comparison import Fields
from fibrous.materials.hgo import HGOFamilies, HGOStructureTensor
from fibrous.specimen import SYNTHETIC
from fibrous_study.audit import costs, laws, tissue
from fibrous_study.audit.costs import Costs
from fibrous_study.audit.tissue import Tissue

# Laws under Eq. 9 --------------------------------------------------------------------------------------------------


def along_eq_9(law, C2: float, C3: float, tensor=CASE):
    """Two networks that answer as a law does."""
    end = np.reshape(STATEMENTS["eq9-isochoric"].value, (3, 3))
    gradient = np.eye(3) + np.linspace(0.0, 1.0, 21)[:, None, None] * (end - np.eye(3))
    material = law(tensor, C2, C3)
    return replace(
        curves().under(("x_uniaxial",)),
        loads=("eq9",),
        structure_tensor=np.broadcast_to(tensor, (2, 3, 3)),
        deformation_gradient=np.tile(gradient, (2, 1, 1, 1, 1)),
        strain_energy_density=np.tile(material.energy(gradient), (2, 1, 1)),
        cauchy_stress=np.tile(material.stress(gradient), (2, 1, 1, 1, 1)),
    )


def eq_2(tensor, C2, C3):
    return HGOStructureTensor(C2, C3, tensor)


def with_constants(C2: float, C3: float):
    return constants(np.full(2, C2), np.full(2, C3))


def test_errors_of_a_law_that_is_the_network():
    path = along_eq_9(eq_2, 0.2, 0.5)
    both = {laws.INITIAL: with_constants(0.1, 0.5), laws.REFIT: with_constants(0.2, 0.5)}
    found = laws.errors(path, both, tension_only=True)
    half, whole = found["Eq. 2", laws.INITIAL], found["Eq. 2", laws.REFIT]
    for name in ("end_ratio", "along_x", "others", "whole", "energy_ratio"):
        np.testing.assert_allclose(getattr(half, name), 0.5, rtol=1e-12)
    np.testing.assert_allclose([half.shape, whole.whole, whole.along_x, whole.others], 0.0, atol=1e-12)


def test_shape_is_that_of_the_curve_alone():
    """A component that is wrong by a factor is no other shape; one that bends is."""
    path = along_eq_9(eq_2, 0.2, 0.0)
    path.cauchy_stress[..., 1, 1] *= 5.0
    found = laws.errors(path, {laws.INITIAL: with_constants(0.2, 0.0)}, tension_only=True)["Eq. 2", laws.INITIAL]
    np.testing.assert_allclose(found.shape, 0.0, atol=1e-12)
    assert found.others.min() > 0.5
    found = laws.errors(path, {laws.INITIAL: with_constants(0.2, 5.0)}, tension_only=True)["Eq. 2", laws.INITIAL]
    stress = eq_2(CASE, 0.2, 5.0).stress(path.deformation_gradient[0, 0, 1:])[:, 0, 0]
    network = path.cauchy_stress[0, 0, 1:, 0, 0]
    # What is left is the part of the network's curve across the law's.
    angle = np.arccos(stress @ network / np.linalg.norm(stress) / np.linalg.norm(network))
    np.testing.assert_allclose(found.shape, np.sin(angle), rtol=1e-9)


def test_an_unknown_state_is_left_out():
    path = along_eq_9(eq_2, 0.2, 0.5)
    path.strain_energy_density[:, :, 7] = np.nan
    path.cauchy_stress[:, :, 7] = np.nan
    found = laws.errors(path, {laws.REFIT: with_constants(0.2, 0.5)}, tension_only=True)["Eq. 2", laws.REFIT]
    np.testing.assert_allclose(found.whole, 0.0, atol=1e-12)


def test_laws_carry_compression_where_they_are_asked_to():
    path = along_eq_9(lambda *values: HGOFamilies.of_structure_tensor(*values, tension_only=False), 0.2, 0.5)
    for tension_only, words in ((True, "in tension alone, as in FEBio"), (False, "as printed, in compression, too")):
        both = dict.fromkeys((laws.INITIAL, laws.REFIT), with_constants(0.2, 0.5))
        found = laws.errors(path, both, tension_only)
        assert (found["Eq. 10C", laws.REFIT].whole.max() < 1e-12) != tension_only
        for judge in (laws.initial_fit, laws.refit, laws.mixture):
            assert f"Eq. 10C ({words})" in judge(found, tension_only, THRESHOLDS).why


def made_up_errors(**values: float):
    """The same errors of both laws, initial and refit; `refit_…` changes those after the refit."""
    base = {"end_ratio": 1.2, "shape": 0.2, "along_x": 0.4, "others": 0.4, "whole": 0.4, "energy_ratio": 1.0}
    initial = base | {name: value for name, value in values.items() if name in base}
    refit = base | {name.removeprefix("refit_"): value for name, value in values.items() if name not in base}
    made = {
        kind: laws.Errors(**{name: np.full(3, value) for name, value in one.items()})
        for kind, one in ((laws.INITIAL, initial), (laws.REFIT, refit))
    }
    return {(law, kind): made[kind] for law in laws.LAWS for kind in made}


@pytest.mark.parametrize(
    ("values", "verdict"),
    [
        ({}, REPRODUCED),
        ({"end_ratio": 2.0}, PARTLY),
        ({"shape": 0.02}, PARTLY),
        ({"end_ratio": 0.5, "shape": 0.01}, NOT),
    ],
)
def test_the_initial_fit(values, verdict):
    assert verdict_of(laws.initial_fit(made_up_errors(**values), True, THRESHOLDS)) is verdict


@pytest.mark.parametrize(
    ("values", "verdict"),
    [
        ({"refit_shape": 0.05, "refit_along_x": 0.1, "refit_whole": 0.1}, REPRODUCED),
        ({"refit_shape": 0.15, "refit_along_x": 0.1, "refit_whole": 0.1}, PARTLY),
        ({"shape": 0.02, "refit_shape": 0.001, "refit_along_x": 0.1, "refit_whole": 0.1}, PARTLY),
        ({"refit_along_x": 0.1}, PARTLY),
        ({"refit_shape": 0.15, "refit_along_x": 0.3, "refit_whole": 0.5}, NOT),
        ({"shape": 0.02, "refit_shape": 0.001}, NOT),  # no other shape to correct
    ],
)
def test_the_refit(values, verdict):
    assert verdict_of(laws.refit(made_up_errors(**values), True, THRESHOLDS)) is verdict


def test_constants_of_one_law_run_in_the_other():
    path = along_eq_9(eq_2, 0.2, 0.5)
    both = dict.fromkeys((laws.INITIAL, laws.REFIT), with_constants(0.2, 0.5))
    found = laws.errors(path, both, tension_only=True)
    assert (found["Eq. 10C", laws.REFIT].energy_ratio > 1.5).all()  # Jensen
    assert verdict_of(laws.mixture(found, True, THRESHOLDS)) is CONTRADICTED
    same = {(law, kind): found["Eq. 2", kind] for law, kind in found}
    assert verdict_of(laws.mixture(same, True, THRESHOLDS)) is REPRODUCED
    families = laws.errors(along_eq_9(HGOFamilies.of_structure_tensor, 0.2, 0.5), both, tension_only=True)
    np.testing.assert_allclose(families["Eq. 10C", laws.REFIT].whole, 0.0, atol=1e-12)


def test_the_fibres_of_febio_are_eq_2_about_one_axis():
    """k1/(2 k2) Σ (exp(k2 ⟨E⟩²) − 1) over two families on one axis, E = κ (I1 − 3) + (1 − 3 κ)(I4 − 1), by hand."""
    tensor = np.diag([0.6, 0.25, 0.15])
    axial = laws.about_one_axis(tensor)
    np.testing.assert_allclose(axial, np.diag([0.6, 0.2, 0.2]), atol=1e-15)
    path = along_eq_9(eq_2, 0.2, 0.5, axial)
    F = path.deformation_gradient[0, 0, -1]
    C, kappa = F.T @ F, 0.2
    E = kappa * (np.trace(C) - 3.0) + (1.0 - 3.0 * kappa) * (C[0, 0] - 1.0)
    by_hand = 2 * (0.2 / 2) / (2 * 0.5) * np.expm1(0.5 * E**2)
    assert path.strain_energy_density[0, 0, -1] == pytest.approx(by_hand, rel=1e-12)


@pytest.mark.parametrize(
    ("tensor", "C3", "verdict"),
    [
        (np.diag([0.6, 0.2, 0.2]), 0.5, NOT),  # FEBio's law is Eq. 2
        (CASE, 0.5, NOT),
        (np.diag([0.48, 0.47, 0.05]), 50.0, PARTLY),  # far from one axis, and as nonlinear as a fit may be
    ],
)
def test_febio_has_the_law_where_its_own_is_near_eq_2(tensor, C3, verdict):
    path = along_eq_9(eq_2, 0.2, C3, tensor)
    found = laws.hgo_in_febio(path, with_constants(0.2, C3), True, THRESHOLDS)
    assert verdict_of(found) is verdict
    if tensor[1, 1] == tensor[2, 2]:
        assert found.here.startswith("W of FEBio's law 1 times that of Eq. 2")


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
    found = tissue.peaks(made_up_tissue(), THRESHOLDS)
    assert verdict_of(found) is REPRODUCED
    assert "initial: 100 % (4 of 4) of the peaks of stress" in found.here
    assert "(4 of 40)" in found.why
    assert verdict_of(tissue.peaks(made_up_tissue(turned=True), THRESHOLDS)) is NOT


@pytest.mark.parametrize(
    ("initial", "verdict"),
    [((0.8, 1.2), REPRODUCED), ((1.2, 1.2), PARTLY), ((1.2, 0.8), NOT), ((0.99, 1.01), NOT), ((0.8, 1.01), PARTLY)],
)
def test_bias_at_the_peaks(initial, verdict):
    assert verdict_of(tissue.bias(made_up_tissue(initial), THRESHOLDS)) is verdict


@pytest.mark.parametrize(
    ("refit", "verdict"),
    [((1.1, 1.3), REPRODUCED), ((1.1, 1.1), PARTLY), ((1.3, 1.1), NOT), ((1.199, 1.201), NOT)],
)
def test_the_direction_of_the_refit(refit, verdict):
    assert verdict_of(tissue.refit_direction(made_up_tissue((1.2, 1.2), refit), THRESHOLDS)) is verdict


def test_what_only_their_specimen_could_tell_says_so():
    stretched = replace(made_up_tissue(), gradient=np.linspace(1.0, 1.1, 40)[:, None, None, None] * np.eye(3))
    of_stretch = tissue.most_stretched(STATEMENTS["eq9-isochoric"], stretched)
    for found in (tissue.rms(made_up_tissue((1.1, 1.0)), refitted=False), of_stretch):
        assert verdict_of(found) is UNKNOWN
        assert "This is one specimen (made up, 40 elements)" in found.why
    assert "J runs from 1 to 1.33" in of_stretch.why  # 1.1³
    synthetic = tissue.rms(replace(stretched, origin=SYNTHETIC), refitted=True)
    assert "one specimen of one seed (synthetic specimen, 40 elements)" in synthetic.why
    assert tissue.rms(made_up_tissue((1.1, 1.0)), refitted=False).here == (
        f"{0.1 * np.sqrt((RAMP**2).mean()):.3g} MPa, 0 %"
    )


SPENT = Costs(
    initial=1.0, refit=0.3, finite_elements=0.02, multiscale=2000.0, networks=900, loads=5, steps=20, load_steps=20,
    runs=2, fibers=3000.0, nodes=300.0, evaluations=1000, network_evaluations=1000, law_seconds=1.0,
    networks_seconds=4000.0, hybrid_seconds=100.0, multiscale_seconds=5000.0, origin="made up",
)  # fmt: skip


def timed(hours: float, spent: Costs = SPENT):
    return costs.time(STATEMENTS["time-ensemble"], hours, spent.initial_words, spent, THRESHOLDS)


@pytest.mark.parametrize(
    ("hours", "verdict"), [(0.7, REPRODUCED), (0.2, PARTLY), (5.0, PARTLY), (0.03, NOT), (50.0, NOT)]
)
def test_times(hours, verdict):
    found = timed(hours)
    assert verdict_of(found) is verdict
    assert ("faster" if hours < 1.12 else "slower") in found.why
    assert "900 networks under 5 loads of 20 steps" in found.here
    # A study with fewer networks is judged as if it had the paper's.
    scaled = timed(hours / 9.0, replace(SPENT, networks=100))
    assert verdict_of(scaled) is verdict
    assert "scaled from 100 to the paper's 900 networks" in scaled.why
    assert "scaled" not in found.why


def test_long_times_read_well():
    assert "1,010 times faster than printed" in timed(1.12 / 1013.0).why


@pytest.mark.parametrize(("multiscale", "verdict"), [(2000.0, REPRODUCED), (20.0, PARTLY), (0.5, NOT)])
def test_the_gain(multiscale, verdict):
    spent = replace(SPENT, multiscale=multiscale)
    found = costs.total(STATEMENTS["time-total"], spent, THRESHOLDS)
    assert verdict_of(found) is verdict
    assert "98 % of the hybrid's cost" in found.why  # 1.3 of 1.32


def test_costs_per_state_are_those_of_networks_and_fits():
    why = costs.total(STATEMENTS["time-total"], SPENT, THRESHOLDS).why
    # 900 networks under 5 loads of 20 steps and along 20 more: 1.3 CPU-hours; 900 times 8 points and 20 steps: 5,000 s.
    assert f"{1e3 * 1.3 * 3600.0 / (900 * 120):.3g} ms" in why
    assert f"{1e3 * 5000.0 / (900 * 160):.3g} ms" in why


@pytest.mark.parametrize(("seconds", "verdict"), [(4000.0, REPRODUCED), (40.0, PARTLY), (0.5, NOT)])
def test_the_gain_a_gauss_point(seconds, verdict):
    found = costs.per_gauss_point(replace(SPENT, networks_seconds=seconds))
    assert verdict_of(found) is verdict
    assert "differ by 50 times an evaluation" in found.why
