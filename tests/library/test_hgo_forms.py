"""All four forms of the fit, law by objective, against the materials: a code path that shares no formula with it."""

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from scipy.stats import t as student

from fibrous.curves import Curves
from fibrous.deformation import Load, averaged_stretch, load_path
from fibrous.errors import FitError
from fibrous.fitting.hgo import fit_hgo
from fibrous.materials.contract import MaterialError
from fibrous.materials.hgo import HGOFamilies, HGOStructureTensor
from fibrous.materials.registry import law_called

FORMS = [(law, objective) for law in ("structure_tensor", "families") for objective in ("energy", "stress")]
LARGEST_C3 = 50.0
SECTION_2_6 = {"x_uniaxial": 1.25, "xy_biaxial": 1.1, "xz_biaxial": 1.1, "xy_shear": 0.15, "xz_shear": 0.15}
MODERATE = {"x_uniaxial": 1.4, "xy_biaxial": 1.25, "xz_biaxial": 1.25, "xy_shear": 0.6, "xz_shear": 0.6}
LARGE = {"x_uniaxial": 1.8, "xy_biaxial": 1.5, "xz_biaxial": 1.6, "xy_shear": 1.6, "yz_shear": 3.2}


def tensor(seed=0):
    """H with the eigenvalues 0.6, 0.28 and 0.12, turned by up to 0.7 from the axes: every load stretches fibres."""
    turn = Rotation.from_rotvec(np.random.default_rng(seed).uniform(-0.4, 0.4, 3)).as_matrix()
    return turn @ np.diag([0.6, 0.28, 0.12]) @ turn.T


def gradients(loads, steps=20):
    """The loads with a change of volume, as an element of tissue has it: J grows to 1.1."""
    swelling = np.cbrt(1.0 + 0.1 * np.linspace(0.0, 1.0, steps + 1))[:, None, None]
    return np.array([swelling * load_path(Load.parse(name), end, steps)[1] for name, end in loads.items()])


def material(law, H, C2, C3, tension_only=True):
    if law == "families":
        return HGOFamilies.of_structure_tensor(H, C2, C3, tension_only)
    return HGOStructureTensor(C2, C3, H, tension_only)


def cauchy(law, F):
    return law(F)[0] @ np.swapaxes(F, -1, -2) / np.linalg.det(F)[..., None, None]


def answer(law, F, H, deviation=0.0, seed=0):
    """Curves of a material, with noise relative to the largest value; a symmetric tensor's in its nine components."""
    noise = np.random.default_rng(seed).normal(size=(*F.shape[:2], 10))
    energy, stress = law.energy(F), cauchy(law, F)
    tensors = noise[..., 1:].reshape(F.shape)
    stress = stress + deviation * np.abs(stress).max() * 0.5 * (tensors + np.swapaxes(tensors, -1, -2))
    return Curves.of_network(F, H, energy + deviation * energy.max() * noise[..., 0], stress)


def fitted(curves, law, objective, tension_only=True, largest_C3=LARGEST_C3):
    options = {"largest_C3": largest_C3, "slope_fit_below_r_squared": -np.inf}
    return fit_hgo(curves, law_called(law).material, objective, tension_only=tension_only, **options)


def constants(fit):
    return fit.C2, fit.C3


def points(curves, law, tension_only=True):
    """States that the fit takes, shape (deformations, steps + 1)."""
    F, H = curves.deformation_gradient[0], curves.structure_tensor[0]
    if law == "structure_tensor":
        used = averaged_stretch(F, H) > 1.0
    else:
        mapped = F @ np.linalg.eigh(H)[1]
        change = np.sum(mapped**2, axis=-2) - 1.0
        used = (change > 1e-14).any(-1) if tension_only else (np.abs(change) > 1e-14).any(-1)
    used[:, 0] = False
    return used


def residuals(curves, law, objective, C2, C3, tension_only=True):
    """Model less data at the points, shape (points, components): W, or the nine components of the stress."""
    used = points(curves, law, tension_only)
    F, model = curves.deformation_gradient[0, used], material(law, curves.structure_tensor[0], C2, C3, tension_only)
    if objective == "energy":
        return (model.energy(F) - curves.strain_energy_density[0, used])[:, None]
    return (cauchy(model, F) - curves.cauchy_stress[0, used]).reshape(-1, 9)


def best(curves, law, objective, tension_only=True):
    """The constants that a general optimiser finds, and its Jacobian."""
    found = least_squares(
        lambda c: residuals(curves, law, objective, *c, tension_only).ravel(),
        [0.1, 1.0],
        jac="3-point",
        bounds=([0.0, 0.0], [np.inf, LARGEST_C3]),
        **dict.fromkeys(("xtol", "ftol", "gtol"), 1e-15),
    )
    return found.x, found.jac


@pytest.mark.parametrize(("law", "objective"), FORMS)
@pytest.mark.parametrize("tension_only", [True, False])
@settings(deadline=None, max_examples=20)
@given(
    C2=st.floats(1e-4, 1e2), C3=st.floats(0.05, 20.0), seed=st.integers(0, 1000), single=st.sampled_from([None, *LARGE])
)
def test_known_constants_come_back(law, objective, tension_only, C2, C3, seed, single):
    """The data of one point must not rule all others: C3 x² stays below 25."""
    H = tensor(seed)
    F = gradients(LARGE) if single is None else gradients({single: LARGE[single]})
    C = np.swapaxes(F, -1, -2) @ F
    largest = np.linalg.eigvalsh(C).max() - 1.0
    C3 = min(C3, 25.0 / largest**2)
    curves = answer(material(law, H, C2, C3, tension_only), F, H)
    fit = fitted(curves, law, objective, tension_only)
    assert constants(fit) == pytest.approx((C2, C3), rel=1e-6)
    assert fit.r_squared == pytest.approx(1.0, abs=1e-10)
    assert fit.identifiable
    assert fit.rule == fit.objective == objective
    used = points(curves, law, tension_only)
    assert fit.points_used == used.sum()
    assert fit.points_used + fit.points_dropped == used[:, 1:].size
    assert fit.largest_stretch == pytest.approx(averaged_stretch(F, H)[used].max(), rel=1e-14)


@pytest.mark.parametrize(("law", "objective"), FORMS)
@pytest.mark.parametrize("tension_only", [True, False])
@pytest.mark.parametrize("loads", [MODERATE, {"xy_shear": 0.9}])
def test_a_general_optimiser_finds_the_same_minimum_half_widths_and_goodness_of_fit(
    law, objective, tension_only, loads
):
    """The half-widths count six numbers a stress, not nine: the other three repeat them."""
    H = tensor(4)
    truth = material(law, H, 0.3, 2.5, tension_only)
    curves = answer(truth, gradients(loads), H, deviation=0.02, seed=1)
    fit = fitted(curves, law, objective, tension_only)
    expected, jacobian = best(curves, law, objective, tension_only)
    assert constants(fit) == pytest.approx(tuple(expected), rel=1e-5)

    left = residuals(curves, law, objective, *constants(fit), tension_only)
    data = residuals(curves, law, objective, 0.0, 0.0, tension_only)
    assert fit.r_squared == pytest.approx(1.0 - np.sum(left**2) / np.sum((data - data.mean(axis=0)) ** 2), rel=1e-9)

    numbers = len(left) * (1 if objective == "energy" else 6)
    covariance = np.sum(left**2) / (numbers - 2) * np.linalg.inv(jacobian.T @ jacobian)
    half_widths = student.ppf(0.975, numbers - 2) * np.sqrt(np.diag(covariance))
    assert (fit.C2_half_width, fit.C3_half_width) == pytest.approx(tuple(half_widths), rel=1e-4)


@pytest.mark.parametrize(("law", "objective"), FORMS)
def test_vanishing_c3_is_the_quadratic_law_and_a_softening_answer_ends_there(law, objective):
    H, F = tensor(2), gradients(SECTION_2_6)
    exact = fitted(answer(material(law, H, 0.7, 0.0), F, H), law, objective)
    assert constants(exact) == pytest.approx((0.7, 0.0), abs=1e-6)
    nearly = fitted(answer(material(law, H, 0.7, 1e-6), F, H), law, objective)
    assert constants(nearly) == pytest.approx((0.7, 1e-6), abs=1e-6)

    curves = answer(material(law, H, 0.7, 0.0), F, H)
    weaker = 1.0 / (1.0 + np.linalg.norm(F - np.eye(3), axis=(-1, -2)))
    W, stress = curves.strain_energy_density * weaker, curves.cauchy_stress * weaker[..., None, None]
    curves = replace(curves, strain_energy_density=W, cauchy_stress=stress)
    fit = fitted(curves, law, objective)
    unit, data = (residuals(curves, law, objective, C2, 0.0) for C2 in (1.0, 0.0))
    regressor = unit - data
    assert constants(fit) == pytest.approx((-np.sum(regressor * data) / np.sum(regressor**2), 0.0), rel=1e-9)
    assert not fit.identifiable
    assert np.isnan(fit.C3_half_width)


@pytest.mark.parametrize(("law", "objective"), FORMS)
@pytest.mark.parametrize("tension_only", [True, False])
def test_turning_curves_and_structure_tensor_changes_nothing(law, objective, tension_only):
    H = tensor(3)
    curves = answer(material(law, H, 0.3, 2.0), gradients(MODERATE), H, deviation=0.05)
    one = fitted(curves, law, objective, tension_only)
    Q, R = Rotation.random(2, random_state=8).as_matrix()
    F, stress = Q @ curves.deformation_gradient[0] @ R.T, Q @ curves.cauchy_stress[0] @ Q.T
    turned = Curves.of_network(F, R @ H @ R.T, curves.strain_energy_density[0], stress)
    other = fitted(turned, law, objective, tension_only)
    for name in ("C2", "C3", "C2_half_width", "C3_half_width", "largest_stretch"):
        assert getattr(other, name) == pytest.approx(getattr(one, name), rel=1e-8), name
    assert (other.rule, other.points_used, other.identifiable) == (one.rule, one.points_used, one.identifiable)
    if objective == "energy":
        assert other.r_squared == pytest.approx(one.r_squared, rel=1e-9)


@pytest.mark.parametrize(("law", "objective"), FORMS)
@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_units_scale_c2_alone(law, objective, factor):
    H = tensor(1)
    curves = answer(material(law, H, 0.3, 2.0), gradients(MODERATE), H, deviation=0.05)
    scaled = replace(
        curves,
        strain_energy_density=factor * curves.strain_energy_density,
        cauchy_stress=factor * curves.cauchy_stress,
    )
    one, other = fitted(curves, law, objective), fitted(scaled, law, objective)
    assert constants(other) == pytest.approx((factor * one.C2, one.C3), rel=1e-9)
    assert other.C2_half_width == pytest.approx(factor * one.C2_half_width, rel=1e-9)
    assert (other.r_squared, other.C3_half_width) == pytest.approx((one.r_squared, one.C3_half_width), rel=1e-9)


@pytest.mark.parametrize(("law", "objective"), FORMS)
@pytest.mark.parametrize("tension_only", [True, False])
@pytest.mark.parametrize("data", ["last state", "noise", "c3 60"])
def test_nothing_overflows_at_large_stretch(law, objective, tension_only, data):
    """I4 − 1 of a family reaches 10: exp(50 · 10²) is no number, so C3 ends where C3 x² does."""
    H, F = np.diag([0.7, 0.2, 0.1]), gradients(LARGE)
    W, stress = np.zeros(F.shape[:2]), np.zeros(F.shape)
    if data == "last state":
        W[:, -1], stress[:, -1] = 1.0, np.eye(3)
    elif data == "noise":
        W, tensors = (np.random.default_rng(0).uniform(0.5, 1.0, shape) for shape in (W.shape, F.shape))
        stress = tensors + np.swapaxes(tensors, -1, -2)
    else:
        small = gradients({name: 1.0 + 0.1 * (end - 1.0) for name, end in LARGE.items() if "shear" not in name})
        W, stress, F = (lambda one: (one.energy(small), cauchy(one, small), small))(material(law, H, 1.0, 60.0))
    with np.errstate(over="raise", invalid="raise", divide="raise"):
        fit = fitted(Curves.of_network(F, H, W, stress), law, objective, tension_only)
    assert np.isfinite([fit.C2, fit.C3, fit.r_squared]).all()
    assert fit.C2 >= 0.0
    assert 0.0 <= fit.C3 <= LARGEST_C3
    model = material(law, H, fit.C2, fit.C3, tension_only)
    assert np.isfinite(model.energy(F)).all()
    assert np.isfinite(model(F)[0]).all()
    if data == "c3 60" and (law == "structure_tensor" or tension_only):
        assert fit.C3 == LARGEST_C3
        assert not fit.identifiable
        assert np.isnan(fit.C3_half_width)


@pytest.mark.parametrize(("law", "objective"), FORMS)
def test_states_without_equilibrium_are_counted_and_change_nothing_else(law, objective):
    H = tensor(6)
    curves = answer(material(law, H, 0.3, 2.0), gradients(MODERATE), H, deviation=0.05)
    lost = deepcopy(curves)
    lost.strain_energy_density[0, 1, 7:] = lost.cauchy_stress[0, 1, 7:] = np.nan
    fit = fitted(lost, law, objective)
    taken = points(curves, law) & np.isfinite(lost.strain_energy_density[0])
    assert (fit.points_used, fit.points_dropped) == (taken.sum(), 100 - taken.sum())
    moved = deepcopy(lost)
    moved.deformation_gradient[0, 1, 7:] = 3.0 * np.eye(3)
    assert fitted(moved, law, objective) == fit


@pytest.mark.parametrize("objective", ["energy", "stress"])
def test_no_fibre_stretched_means_no_fibres_and_none_known_means_no_answer(objective):
    H = np.diag([0.6, 0.3, 0.1])
    shrinking = 1.0 - 0.1 * np.linspace(0.0, 1.0, 11)[:, None, None] * np.eye(3)
    shrinking = np.where(np.eye(3) > 0.0, shrinking, 0.0)[None]
    curves = Curves.of_network(shrinking, H, np.ones((1, 11)), np.ones((1, 11, 3, 3)))
    for law in ("structure_tensor", "families"):
        fit = fitted(curves, law, objective)
        assert (fit.C2, fit.C3, fit.rule, fit.objective) == (0.0, 0.0, "zero", objective)
        assert (fit.points_used, fit.points_dropped, fit.largest_stretch) == (0, 10, pytest.approx(0.99))
        assert not fit.identifiable
    assert fitted(curves, "families", objective, tension_only=False).points_used == 10

    F = gradients(SECTION_2_6)
    unknown = Curves.of_network(F, H, np.full(F.shape[:2], np.nan), np.full(F.shape, np.nan))
    for law in ("structure_tensor", "families"):
        fit = fitted(unknown, law, objective)
        assert (fit.rule, fit.points_used, fit.points_dropped) == ("none", 0, 100)
        assert np.isnan([fit.C2, fit.C3]).all()


@pytest.mark.parametrize("objective", ["energy", "stress"])
def test_families_are_fitted_where_one_is_stretched_although_the_average_is_not(objective):
    """Stretch across the fibres: λ_f < 1 throughout, so Eq. 2 says nothing, and Eq. 10C does."""
    H, F = np.diag([0.8, 0.1, 0.1]), gradients({"z_uniaxial": 1.2})
    assert averaged_stretch(F, H)[0, 1:].max() < 1.0
    curves = answer(material("families", H, 0.5, 3.0), F, H)
    assert fitted(curves, "structure_tensor", objective).rule == "zero"
    assert constants(fitted(curves, "families", objective)) == pytest.approx((0.5, 3.0), rel=1e-6)


@pytest.mark.parametrize("objective", ["energy", "stress"])
def test_a_family_without_weight_neither_carries_nor_counts(objective):
    """Rounding of an eigenvalue that is 0 must not be taken for fibres, which would then be stiff beyond measure."""
    for turn in np.concatenate([np.eye(3)[None], Rotation.random(20, random_state=0).as_matrix()]):
        H = turn @ np.diag([0.7, 0.3, 0.0]) @ turn.T
        F = turn @ gradients({"z_uniaxial": 1.3}) @ turn.T
        assert fitted(answer(material("families", H, 1.0, 1.0), F, H), "families", objective).rule == "zero"


@pytest.mark.parametrize("objective", ["energy", "stress"])
def test_both_laws_are_one_where_all_fibres_run_one_way(objective):
    axis = np.array([2.0, 1.0, -2.0]) / 3.0
    H = np.outer(axis, axis)
    curves = answer(material("structure_tensor", H, 0.3, 2.0), gradients(MODERATE), H, deviation=0.05)
    one, other = (fitted(curves, law, objective) for law in ("structure_tensor", "families"))
    assert constants(one) == pytest.approx(constants(other), rel=1e-9)
    assert one.points_used == other.points_used


def test_one_state_tells_the_constants_apart_by_its_stress_alone_and_only_with_two_families_stretched():
    F = gradients({"x_uniaxial": 1.5, "xy_biaxial": 1.2}, steps=1)
    F[1, 1] = np.diag([1.3, 1.1, 0.8])
    H = np.diag([0.6, 0.3, 0.1])
    curves = answer(material("families", H, 0.4, 1.5), F, H)
    uniaxial, biaxial = (curves.under([load]) for load in curves.loads)
    assert constants(fitted(biaxial, "families", "stress")) == pytest.approx((0.4, 1.5), rel=1e-9)
    for one, objective in ((biaxial, "energy"), (uniaxial, "energy"), (uniaxial, "stress")):
        fit = fitted(one, "families", objective)
        assert fit.C3 == 0.0
        assert not fit.identifiable


def test_the_slope_rule_is_for_eq_2_and_energy_alone():
    H = np.diag([0.6, 0.3, 0.1])
    curves = answer(material("families", H, 0.4, 1.5), gradients({"x_uniaxial": 1.5}), H, deviation=0.05)
    options = {"tension_only": True, "largest_C3": LARGEST_C3, "slope_fit_below_r_squared": 2.0}
    rules = [fit_hgo(curves, law_called(law).material, objective, **options).rule for law, objective in FORMS]
    assert rules == ["slope", "stress", "energy", "stress"]


def test_what_is_no_curve_law_or_structure_tensor_is_refused():
    F, H = gradients(SECTION_2_6), tensor()
    curves = answer(material("families", H, 1.0, 1.0), F, H)
    with pytest.raises(FitError, match="shape"):
        replace(curves, strain_energy_density=np.ones((1, 5, 20)))
    with pytest.raises(FitError, match="shape"):
        Curves.of_network(np.ones((0, 5, 3, 3)), H, np.ones((0, 5)), np.ones((0, 5, 3, 3)))
    for value in (-np.eye(3), np.zeros((3, 3)), np.full((3, 3), np.nan)):
        bad = F.copy()
        bad[2, 4] = value
        with pytest.raises(FitError, match="deformation 2, step 4"):
            replace(curves, deformation_gradient=bad[None])
    with pytest.raises(FitError, match="'work'"):
        fitted(curves, "families", "work")
    with pytest.raises(MaterialError, match="structure_tensor"):
        fitted(replace(curves, structure_tensor=2.0 * H[None]), "families", "energy")
