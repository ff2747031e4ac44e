"""Verdicts follow the data: laws under Eq. 9, the tissue and its costs, made up for a statement to be true or not."""

from dataclasses import replace

import numpy as np
import pytest
from made_up_evidence import (
    CASE,
    CONFIG,
    CONTRADICTED,
    NOT,
    PARTLY,
    REPRODUCED,
    UNKNOWN,
    constants,
    curves,
    evidence,
    found,
    value_of,
    verdict_of,
)

from fibrous.comparison import Fields
from fibrous.materials.hgo import HGOFamilies, HGOStructureTensor
from fibrous.specimen import SYNTHETIC
from fibrous_study.audit import laws
from fibrous_study.audit.evidence import Costs, Tissue

# Laws under Eq. 9 --------------------------------------------------------------------------------------------------


def along_eq_9(law, C2: float, C3: float, tensor=CASE):
    """Two networks that answer as a law does."""
    end = np.array(CONFIG["paper"]["eq_9"])
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


def errors(path, initial, refit, tension_only: bool = True):
    return laws.errors(evidence(path=path, initial=initial, refit=refit, tension_only=tension_only))


def test_errors_of_a_law_that_is_the_network():
    path = along_eq_9(eq_2, 0.2, 0.5)
    of_law = errors(path, with_constants(0.1, 0.5), with_constants(0.2, 0.5))
    half, whole = of_law["eq_2", laws.INITIAL], of_law["eq_2", laws.REFIT]
    for name in ("end_ratio", "along_x", "others", "whole", "energy_ratio"):
        np.testing.assert_allclose(getattr(half, name), 0.5, rtol=1e-12)
    np.testing.assert_allclose([half.shape, whole.whole, whole.along_x, whole.others], 0.0, atol=1e-12)


def test_shape_is_that_of_the_curve_alone():
    """A component that is wrong by a factor is no other shape; one that bends is."""
    path = along_eq_9(eq_2, 0.2, 0.0)
    path.cauchy_stress[..., 1, 1] *= 5.0
    of_law = errors(path, with_constants(0.2, 0.0), with_constants(0.2, 5.0))
    same, bent = of_law["eq_2", laws.INITIAL], of_law["eq_2", laws.REFIT]
    np.testing.assert_allclose(same.shape, 0.0, atol=1e-12)
    assert same.others.min() > 0.5
    stress = eq_2(CASE, 0.2, 5.0).stress(path.deformation_gradient[0, 0, 1:])[:, 0, 0]
    network = path.cauchy_stress[0, 0, 1:, 0, 0]
    # What is left is the part of the network's curve across the law's.
    angle = np.arccos(stress @ network / np.linalg.norm(stress) / np.linalg.norm(network))
    np.testing.assert_allclose(bent.shape, np.sin(angle), rtol=1e-9)


def test_an_unknown_state_is_left_out():
    path = along_eq_9(eq_2, 0.2, 0.5)
    path.strain_energy_density[:, :, 7] = np.nan
    path.cauchy_stress[:, :, 7] = np.nan
    same = with_constants(0.2, 0.5)
    np.testing.assert_allclose(errors(path, same, same)["eq_2", laws.REFIT].whole, 0.0, atol=1e-12)


def test_laws_carry_compression_where_they_are_asked_to():
    path = along_eq_9(lambda *values: HGOFamilies.of_structure_tensor(*values, tension_only=False), 0.2, 0.5)
    same = with_constants(0.2, 0.5)
    for tension_only in (True, False):
        whole = errors(path, same, same, tension_only)["eq_10c", laws.REFIT].whole
        assert (whole.max() < 1e-12) != tension_only


@pytest.fixture
def with_errors(monkeypatch):
    """The check of a statement where both laws have the same errors; `refit_…` changes those after the refit."""

    def judge(statement: str, **values: float):
        base = {"end_ratio": 1.2, "shape": 0.2, "along_x": 0.4, "others": 0.4, "whole": 0.4, "energy_ratio": 1.0}
        initial = base | {name: value for name, value in values.items() if name in base}
        refit = base | {name.removeprefix("refit_"): value for name, value in values.items() if name not in base}
        made = {
            (law, kind): laws.Errors(**{name: np.full(3, value) for name, value in one.items()})
            for kind, one in ((laws.INITIAL, initial), (laws.REFIT, refit))
            for law in laws.LAWS
        }
        monkeypatch.setattr(laws, "errors", lambda _: made)
        return found(statement)

    return judge


@pytest.mark.parametrize(
    ("values", "verdict"),
    [
        ({}, REPRODUCED),
        ({"end_ratio": 2.0}, PARTLY),
        ({"shape": 0.02}, PARTLY),
        ({"end_ratio": 0.5, "shape": 0.01}, NOT),
    ],
)
def test_the_initial_fit(with_errors, values, verdict):
    finding = with_errors("initial-fit-under-eq9", **values)
    assert finding.verdict is verdict
    assert value_of(finding, "eq_10c_end_ratio") == values.get("end_ratio", 1.2)


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
def test_the_refit(with_errors, values, verdict):
    finding = with_errors("refit-under-eq9", **values)
    assert finding.verdict is verdict
    assert value_of(finding, "eq_2_shape_after") == values.get("refit_shape", 0.2)


def test_constants_of_one_law_run_in_the_other():
    path, same = along_eq_9(eq_2, 0.2, 0.5), with_constants(0.2, 0.5)
    finding = found("eq2-run-as-eq10c", path=path, initial=same, refit=same)
    assert finding.verdict is CONTRADICTED
    assert value_of(finding, "W_ratio") > 1.5  # Jensen
    assert value_of(finding, "eq_2_energy_ratio") == pytest.approx(1.0, rel=1e-12)
    of_families = errors(along_eq_9(HGOFamilies.of_structure_tensor, 0.2, 0.5), same, same)
    np.testing.assert_allclose(of_families["eq_10c", laws.REFIT].whole, 0.0, atol=1e-12)


def test_laws_that_store_the_same_energy_are_as_good_as_one(with_errors):
    assert with_errors("eq2-run-as-eq10c").verdict is REPRODUCED


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
    path, same = along_eq_9(eq_2, 0.2, C3, tensor), with_constants(0.2, C3)
    finding = found("febio-hgo", path=path, refit=same)
    assert finding.verdict is verdict
    if tensor[1, 1] == tensor[2, 2]:
        assert value_of(finding, "febio_W_ratio") == pytest.approx(1.0, rel=1e-12)


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
    finding = found("hgo-locates-peaks", tissue=made_up_tissue())
    assert finding.verdict is REPRODUCED
    assert [value_of(finding, name) for name in ("initial_stress", "peaks", "elements", "chance")] == [1, 4, 40, 0.1]
    assert verdict_of("hgo-locates-peaks", tissue=made_up_tissue(turned=True)) is NOT


@pytest.mark.parametrize(
    ("initial", "verdict"),
    [((0.8, 1.2), REPRODUCED), ((1.2, 1.2), PARTLY), ((1.2, 0.8), NOT), ((0.99, 1.01), NOT), ((0.8, 1.01), PARTLY)],
)
def test_bias_at_the_peaks(initial, verdict):
    finding = found("hgo-initial-bias", tissue=made_up_tissue(initial))
    assert finding.verdict is verdict
    ratios = [value_of(finding, f"{name}_ratio") for name in ("stress", "strain", "largest")]
    assert ratios == pytest.approx([*initial, initial[0]])


@pytest.mark.parametrize(
    ("refit", "verdict"),
    [((1.1, 1.3), REPRODUCED), ((1.1, 1.1), PARTLY), ((1.3, 1.1), NOT), ((1.199, 1.201), NOT)],
)
def test_the_direction_of_the_refit(refit, verdict):
    finding = found("refit-direction", tissue=made_up_tissue((1.2, 1.2), refit))
    assert finding.verdict is verdict
    assert value_of(finding, "stress_ratio") == pytest.approx((refit[0] - 1.0) / 0.2)


def test_what_only_their_specimen_could_tell():
    stretched = replace(made_up_tissue(), gradient=np.linspace(1.0, 1.1, 40)[:, None, None, None] * np.eye(3))
    most = found("eq9-isochoric", tissue=stretched)
    assert most.verdict is UNKNOWN
    assert [value_of(most, name) for name in ("stretch", "J", "J_least")] == pytest.approx([1.1, 1.1**3, 1.0])
    errors = found("rms-initial", tissue=made_up_tissue((1.1, 1.0)))
    assert errors.verdict is UNKNOWN
    assert value_of(errors, "stress_error") == pytest.approx(0.1 * np.sqrt((RAMP**2).mean()))
    assert value_of(errors, "stress_relative") == pytest.approx(0.1)
    assert value_of(errors, "strain_error") == 0.0
    assert value_of(errors, "synthetic") == 0
    assert value_of(found("rms-refit", tissue=replace(stretched, origin=SYNTHETIC)), "synthetic") == 1


SPENT = Costs(
    initial=1.0, refit=0.3, finite_elements=0.02, multiscale=2000.0, networks=900, loads=5, steps=20, load_steps=20,
    runs=2, fibers=3000.0, nodes=300.0, evaluations=1000, network_evaluations=1000, law_seconds=1.0,
    networks_seconds=4000.0, hybrid_seconds=100.0, multiscale_seconds=5000.0, origin="made up",
)  # fmt: skip


@pytest.mark.parametrize(
    ("hours", "verdict"), [(0.7, REPRODUCED), (0.2, PARTLY), (5.0, PARTLY), (0.03, NOT), (50.0, NOT)]
)
def test_times(hours, verdict):
    finding = found("time-ensemble", costs=replace(SPENT, initial=hours))
    assert finding.verdict is verdict
    assert value_of(finding, "faster") == (hours < 1.12)
    assert value_of(finding, "factor") == pytest.approx(max(hours / 1.12, 1.12 / hours))
    # A study with fewer networks is judged as if it had the paper's.
    scaled = found("time-ensemble", costs=replace(SPENT, initial=hours / 9.0, networks=100))
    assert scaled.verdict is verdict
    assert value_of(scaled, "factor") == pytest.approx(value_of(finding, "factor"))


@pytest.mark.parametrize(("multiscale", "verdict"), [(2000.0, REPRODUCED), (20.0, PARTLY), (0.5, NOT)])
def test_the_gain(multiscale, verdict):
    finding = found("time-total", costs=replace(SPENT, multiscale=multiscale))
    assert finding.verdict is verdict
    assert value_of(finding, "networks_of_hybrid") == pytest.approx(1.3 / 1.32)
    # 900 networks under 5 loads of 20 steps and along 20 more: 1.3 CPU-hours; 900 times 8 points and 20 steps: 5,000 s.
    assert value_of(finding, "state") == pytest.approx(1e3 * 1.3 * 3600.0 / (900 * 120))
    assert value_of(finding, "coupled_state") == pytest.approx(1e3 * 5000.0 / (900 * 160))


@pytest.mark.parametrize(("seconds", "verdict"), [(4000.0, REPRODUCED), (40.0, PARTLY), (0.5, NOT)])
def test_the_gain_per_gauss_point(seconds, verdict):
    finding = found("cost-estimate", costs=replace(SPENT, networks_seconds=seconds))
    assert finding.verdict is verdict
    assert value_of(finding, "times_law") == pytest.approx(seconds)
    assert value_of(finding, "times_run") == pytest.approx(50.0)
