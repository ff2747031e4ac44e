"""Materials: stress from energy, tangent from stress, objectivity, rest, units, limits, and constants refused."""

import re
from collections import namedtuple

import mpmath
import numpy as np
import pytest
from conftest import small_network
from fibers import exponential, stress_scale
from scipy.spatial.transform import Rotation

from fibrous.clock import Clock
from fibrous.deformation import Load, averaged_stretch
from fibrous.fitting.hgo import strain_energy
from fibrous.materials import registry
from fibrous.materials.affine_fibers import AffineFibers, half_sphere
from fibrous.materials.contract import Material, MaterialError, Mixture, join, select
from fibrous.materials.hgo import HGO, HGOFamilies, HGOStructureTensor
from fibrous.materials.neo_hookean import NeoHookean
from fibrous.materials.registry import law_called
from fibrous.materials.timed import Timed
from fibrous.networks.banded import Assembly

ELEMENTS = 4
H_DIAGONAL = np.diag([0.6, 0.3, 0.1])
TURN = Rotation.from_euler("xyz", [[0.1, 0.2, 0.3], [1.0, 0.5, -0.4], [-0.7, 0.2, 2.0], [0.0, 0.0, 0.0]]).as_matrix()
H = (TURN @ H_DIAGONAL @ TURN.transpose(0, 2, 1))[:, None]  # (elements, 1, 3, 3)
C2, C3 = np.linspace(0.1, 0.4, ELEMENTS)[:, None], np.linspace(0.0, 1.5, ELEMENTS)[:, None]
LAW = exponential(2.5)
SCALE = stress_scale(10.0, 0.1, 10.0)


def bundles(scale: float = 1.0) -> AffineFibers:
    rng = np.random.default_rng(3)
    directions = rng.standard_normal((ELEMENTS, 1, 20, 3))
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    return AffineFibers(directions, scale * rng.random((ELEMENTS, 1, 20)), LAW)


def laws(scale: float = 1.0) -> dict:
    matrix = NeoHookean(scale * np.linspace(0.02, 0.03, ELEMENTS)[:, None], scale * 0.417)
    families = HGOFamilies.of_structure_tensor(H, scale * C2, C3)
    return {
        "matrix": matrix,
        "families": families,
        "families as printed": HGOFamilies.of_structure_tensor(H, scale * C2, C3, tension_only=False),
        "structure tensor": HGOStructureTensor(scale * C2, C3, H),
        "structure tensor as printed": HGOStructureTensor(scale * C2, C3, H, tension_only=False),
        "affine fibers": bundles(scale),
        "affine sphere": AffineFibers.of_structure_tensor(H_DIAGONAL, scale * 0.05, LAW),
        "mixture": Mixture((matrix, families, bundles(scale))),
        "timed": Timed(families, Clock(), "law"),
    }


LAWS = laws()
each_law = pytest.mark.parametrize("name", LAWS)


@pytest.fixture
def gradients(rng) -> np.ndarray:
    return np.eye(3) + 0.15 * rng.standard_normal((ELEMENTS, 8, 3, 3))


def unit_gradients(step: float):
    for k in range(3):
        for L in range(3):
            dF = np.zeros((3, 3))
            dF[k, L] = step
            yield k, L, dF


@each_law
def test_stress_is_the_derivative_of_the_energy(name, gradients):
    law, step = LAWS[name], 1e-5
    stress = law(gradients)[0]
    for k, L, dF in unit_gradients(step):
        slope = (law.energy(gradients + dF) - law.energy(gradients - dF)) / (2.0 * step)
        np.testing.assert_allclose(stress[..., k, L], slope, atol=1e-7 * np.abs(stress).max())


@each_law
def test_tangent_is_the_derivative_of_the_stress_and_symmetric(name, gradients):
    law, step = LAWS[name], 2e-6
    tangent = law(gradients)[1]
    scale = np.abs(tangent).max()
    for k, L, dF in unit_gradients(step):
        slope = (law(gradients + dF)[0] - law(gradients - dF)[0]) / (2.0 * step)
        np.testing.assert_allclose(tangent[..., k, L], slope, atol=1e-7 * scale)
    np.testing.assert_allclose(tangent, tangent.transpose(0, 1, 4, 5, 2, 3), atol=1e-13 * scale)


@each_law
def test_rotations_turn_the_stress_and_leave_the_energy(name, gradients):
    law = LAWS[name]
    R = Rotation.from_euler("xyz", [0.4, -0.7, 1.1]).as_matrix()
    stress = law(gradients)[0]
    np.testing.assert_allclose(law.energy(R @ gradients), law.energy(gradients), rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(law(R @ gradients)[0], R @ stress, atol=1e-13 * np.abs(stress).max())


@each_law
def test_rest_has_no_stress_and_no_energy(name):
    law = LAWS[name]
    stress, tangent, _ = law(np.broadcast_to(np.eye(3), (ELEMENTS, 8, 3, 3)))
    np.testing.assert_allclose(stress, 0.0, atol=1e-14 * np.abs(tangent).max())
    np.testing.assert_allclose(law.energy(np.eye(3)), 0.0, atol=1e-15)


@each_law
@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_moduli_scale_stress_tangent_and_energy(name, factor, gradients):
    one, other = LAWS[name], laws(factor)[name]
    for mine, scaled in zip(one(gradients)[:2], other(gradients)[:2], strict=True):
        np.testing.assert_allclose(scaled, factor * mine, rtol=1e-12, atol=1e-15 * factor)
    np.testing.assert_allclose(other.energy(gradients), factor * one.energy(gradients), rtol=1e-12, atol=1e-15 * factor)


@each_law
def test_any_leading_axes_and_any_range_of_elements_give_the_same_numbers(name, gradients):
    law = LAWS[name]
    stress, tangent, state = law(gradients)
    assert state is None
    part = slice(1, 3)
    some_stress, some_tangent, _ = law.of_elements(part)(gradients[part])
    np.testing.assert_allclose(some_stress, stress[part], rtol=1e-13, atol=1e-16)
    np.testing.assert_allclose(some_tangent, tangent[part], rtol=1e-13, atol=1e-16)
    one = law.of_elements(slice(2, 3))
    np.testing.assert_allclose(one(gradients[2, 5])[0].reshape(3, 3), stress[2, 5], rtol=1e-12, atol=1e-15)


def test_neo_hookean_is_linear_elastic_at_rest():
    tangent = NeoHookean(0.025, 0.417)(np.eye(3))[1]
    d = np.eye(3)
    hooke = 0.417 * np.einsum("ij,kl->ijkl", d, d)
    hooke += 0.05 * (np.einsum("ik,jl->ijkl", d, d) + np.einsum("il,jk->ijkl", d, d))
    np.testing.assert_allclose(tangent, hooke, atol=1e-16)


def test_neo_hookean_is_equation_10B():
    F = np.diag([1.3, 0.8, 1.1])
    J = 1.3 * 0.8 * 1.1
    printed = 0.025 * (1.69 + 0.64 + 1.21 - 3.0) - 0.05 * np.log(J) + 0.2085 * np.log(J) ** 2
    assert NeoHookean(0.025, 0.417).energy(F) == pytest.approx(printed, rel=1e-14)


def test_matter_turned_inside_out_has_no_finite_stress():
    stress, tangent, _ = NeoHookean(0.025, 0.417)(np.diag([1.0, 1.0, -0.1]))
    assert not np.isfinite(stress).any()
    assert not np.isfinite(tangent).any()


@pytest.mark.parametrize("nonlinearity", [0.0, 1e-12, 1.0, 3.0])
def test_families_are_equation_10C_and_small_C3_is_a_limit(nonlinearity):
    stretches = [1.4, 0.9, 1.05]
    with mpmath.workdps(40):

        def printed(tension_only):
            total = mpmath.mpf(0)
            for h, stretch in zip([0.6, 0.3, 0.1], stretches, strict=True):
                x = mpmath.mpf(stretch) ** 2 - 1
                if x < 0 and tension_only:
                    continue
                c = mpmath.mpf(nonlinearity)
                total += h * (mpmath.expm1(c * x * x) / c if c else x * x) * mpmath.mpf(0.2) / 2
            return float(total)

        for tension_only in (True, False):
            law = HGOFamilies(0.2, nonlinearity, np.array([0.6, 0.3, 0.1]), np.eye(3), tension_only)
            assert law.energy(np.diag(stretches)) == pytest.approx(printed(tension_only), rel=1e-12)


def test_structure_tensor_law_is_the_one_that_is_fitted():
    F = Load.parse("xy_shear").deformation_gradient(0.9) @ np.diag([1.2, 0.9, 0.95])
    stretch = averaged_stretch(F, H_DIAGONAL)
    assert stretch > 1.0
    law = HGOStructureTensor(0.2, 1.5, H_DIAGONAL)
    assert law.energy(F) == pytest.approx(float(strain_energy(0.2, 1.5, stretch)), rel=1e-13)


def test_tension_only_is_a_switch_of_each_family_or_of_the_averaged_stretch():
    squeezed = np.diag([0.9, 1.05, 1.05])  # λ_f < 1, although two families are stretched
    assert averaged_stretch(squeezed, H_DIAGONAL) < 1.0
    assert (HGOStructureTensor(0.2, 1.5, H_DIAGONAL)(squeezed)[0] == 0.0).all()
    printed = HGOStructureTensor(0.2, 1.5, H_DIAGONAL, tension_only=False)(squeezed)[0]
    assert printed[0, 0] < 0.0
    families = HGOFamilies.of_structure_tensor(H_DIAGONAL, 0.2, 1.5)(squeezed)[0]
    assert families[0, 0] == 0.0
    assert families[1, 1] > 0.0
    assert HGOFamilies.of_structure_tensor(H_DIAGONAL, 0.2, 1.5, tension_only=False)(squeezed)[0][0, 0] < 0.0


def test_families_count_in_the_tangent_at_rest():
    for F in (np.eye(3), Rotation.from_euler("xyz", [0.3, 0.2, 0.1]).as_matrix()):
        stiffness = np.einsum("ijkl,ij,kl", HGOFamilies.of_structure_tensor(np.eye(3) / 3, 0.3, 1.0)(F)[1], F, F)
        # Along F itself every family stretches alike: 4 C2 Σ h.
        assert stiffness == pytest.approx(4.0 * 0.3, rel=1e-10)


def test_families_are_never_softer_than_the_averaged_stretch(rng):
    gradients = np.eye(3) + 0.3 * rng.standard_normal((200, 3, 3))
    families = HGOFamilies.of_structure_tensor(H_DIAGONAL, 0.2, 1.5, tension_only=False).energy(gradients)
    average = HGOStructureTensor(0.2, 1.5, H_DIAGONAL, tension_only=False).energy(gradients)
    assert (families >= average * (1.0 - 1e-12)).all()  # Jensen's inequality


def test_affine_fibers_are_the_network_without_fluctuations(network):
    assembly = Assembly(network, LAW)
    F = np.array([[1.239, 0, 0.0035], [0, 1.048, -0.0014], [-0.0080, 0.102, 0.770]])  # Eq. 9
    affine = assembly.evaluate(F, np.zeros((assembly.size + 1, 3)))
    other = small_network(1)
    law = AffineFibers.of_networks([network, other])
    stress, _, _ = law(np.broadcast_to(F, (2, 8, 3, 3)))
    expected = SCALE * assembly.stress(affine)
    np.testing.assert_allclose(stress[0, 3], expected, atol=1e-12 * np.abs(expected).max())
    assert law.energy(F)[0, 0] == pytest.approx(SCALE * assembly.energy(affine), rel=1e-12)
    weights = law.weights[1, 0]
    H_other = np.einsum("m,mI,mJ->IJ", weights, law.directions[1, 0], law.directions[1, 0]) / weights.sum()
    np.testing.assert_allclose(H_other, other.structure_tensor, atol=1e-14)


def test_half_sphere_integrates_even_polynomials():
    directions, weights = half_sphere(4)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, rtol=1e-15)
    x, y, z = directions.T
    assert weights.sum() == pytest.approx(1.0, rel=1e-14)
    for mean, exact in (
        (x**2, 1 / 3),
        (z**4, 1 / 5),
        (x**2 * y**2, 1 / 15),
        (x**6, 1 / 7),
        (x**2 * y**2 * z**2, 1 / 105),
    ):
        assert weights @ mean == pytest.approx(exact, rel=1e-12)


def test_sphere_has_the_structure_tensor_and_the_volume_fraction_asked_for():
    law = AffineFibers.of_structure_tensor(H[1, 0], 0.05, LAW)
    assert law.weights.sum() == pytest.approx(10.0 * 0.05, rel=1e-13)
    found = np.einsum("m,mI,mJ->IJ", law.weights, law.directions, law.directions) / law.weights.sum()
    np.testing.assert_allclose(found, H[1, 0], atol=1e-4)


def test_mixture_passes_states_and_returns_new_ones():
    class Counting(Material):
        def __call__(self, gradient, state=None, near=None):
            return *NeoHookean(0.025, 0.417)(gradient)[:2], state + (1.0 if near is None else 0.5 * near)

    states, law, rest = (None, np.zeros((ELEMENTS, 8))), Mixture((LAWS["families"], Counting())), np.eye(3)
    _, _, new = law(np.broadcast_to(rest, (ELEMENTS, 8, 3, 3)), states)
    assert new[0] is None
    assert (new[1] == 1.0).all()
    assert (states[1] == 0.0).all()
    assert (law(np.broadcast_to(rest, (ELEMENTS, 8, 3, 3)), states, new)[2][1] == 0.5).all()
    halves = [select(new, slice(0, 1)), select(new, slice(1, ELEMENTS))]
    np.testing.assert_array_equal(join(halves)[1], new[1])


def test_named_states_keep_their_names():
    Named = namedtuple("Named", "one other")
    state = Named(np.arange(4.0), np.arange(8.0).reshape(4, 2))
    halves = [select((None, state), slice(0, 3)), select((None, state), slice(3, 4))]
    assert halves[1][1].other.tolist() == [[6.0, 7.0]]
    assert join(halves)[1].one.tolist() == state.one.tolist()


FAMILIES = HGOFamilies.of_structure_tensor(H, C2, C3)


def per_element(*values) -> np.ndarray:
    return np.array(values, dtype=float)[:, None]


BAD = {
    "element 1: C1 is -0.1": lambda: NeoHookean(per_element(0.1, -0.1), 0.4),
    "C1 is 0.0": lambda: NeoHookean(0.0, 0.4),
    "lame_lambda is nan": lambda: NeoHookean(0.025, np.nan),
    "element 0: lame_lambda is -0.4": lambda: NeoHookean(per_element(0.1, 0.2), per_element(-0.4, 0.3)),
    "element 2: C2 is -1.0": lambda: HGOFamilies.of_structure_tensor(H_DIAGONAL, per_element(0, 1, -1), 1.0),
    "element 1: C3 is nan": lambda: HGOStructureTensor(0.1, per_element(0.0, np.nan), H_DIAGONAL),
    "weights is [0.5, 0.6, -0.1]": lambda: HGOFamilies(0.1, 1.0, np.array([0.5, 0.6, -0.1]), np.eye(3)),
    "weights is of shape (2,)": lambda: HGOFamilies(0.1, 1.0, np.array([0.5, 0.5]), np.eye(3)),
    "directions is [[1.0, 0.0, 0.0], [0.0, 1.0": lambda: HGOFamilies(0.1, 1.0, np.ones(3), np.diag([1.0, 1.0, 1.1])),
    "element 1: structure_tensor is [[0.5": lambda: HGOStructureTensor(
        0.1, 1.0, np.stack([H_DIAGONAL, 0.5 * np.eye(3)])[:, None]
    ),
    "structure_tensor is [[1.2": lambda: HGOStructureTensor(0.1, 1.0, np.diag([1.2, -0.1, -0.1])),
    "structure_tensor is [[nan": lambda: HGOFamilies.of_structure_tensor(np.full((3, 3), np.nan), 0.1, 1.0),
    "fibers have directions of shape (4, 3) and weights of shape (3,)": lambda: AffineFibers(
        np.eye(4, 3), np.ones(3), LAW
    ),
    "directions is [[1.0, 0.0, 0.0], [0.0, 2.0": lambda: AffineFibers(np.diag([1.0, 2.0, 1.0]), np.ones(3), LAW),
    "weights is [1.0, -1.0]": lambda: AffineFibers(np.eye(2, 3), np.array([1.0, -1.0]), LAW),
}


@pytest.mark.parametrize("text", BAD)
def test_constants_out_of_range_are_refused_in_a_line_that_names_the_element(text):
    with pytest.raises(MaterialError, match=re.escape(text)) as error:
        BAD[text]()
    assert "\n" not in str(error.value)


def test_a_law_is_known_by_its_name_and_no_other_law_stands_in_for_it():
    gradients = Load.parse("xy_biaxial").deformation_gradient(np.full((ELEMENTS, 1), 1.2))
    for name, law in {"structure_tensor": HGOStructureTensor(C2, C3, H), "families": FAMILIES}.items():
        np.testing.assert_array_equal(
            law_called(name).material.of_structure_tensor(H, C2, C3)(gradients)[0], law(gradients)[0], strict=True
        )
    with pytest.raises(MaterialError, match=r"^law 'gasser_dispersion' .* are structure_tensor, families$"):
        law_called("gasser_dispersion")


def test_the_registry_names_classes_of_the_kinds_that_it_says():
    for law in registry.LAWS.values():
        assert issubclass(law.material, Material)
        assert law.has_constants == issubclass(law.material, HGO)


@each_law
def test_stress_piola_and_tangent_are_those_of_one_call(name, gradients):
    law = LAWS[name]
    P, A, _ = law(gradients)
    np.testing.assert_array_equal(law.piola(gradients), P)
    np.testing.assert_array_equal(law.tangent(gradients), A)
    expected = np.einsum("...iJ,...jJ->...ij", P, gradients) / np.linalg.det(gradients)[..., None, None]
    np.testing.assert_allclose(law.stress(gradients), expected, atol=1e-14 * np.abs(P).max())


def test_a_sum_of_sums_is_the_sum_of_all(gradients):
    matrix, families = LAWS["matrix"], LAWS["families"]
    total = matrix + (families + bundles())
    assert len(total.parts) == 3
    assert isinstance(total, Mixture)
    np.testing.assert_array_equal(total(gradients)[0], LAWS["mixture"](gradients)[0])


def test_every_repr_is_one_line():
    for law in [*LAWS.values(), *LAWS["mixture"].parts]:
        assert "\n" not in repr(law)
        assert len(repr(law)) < 400


def test_terms_are_the_energy_of_the_law(gradients):
    """W = Σ w C2/2 (M : C − 1)² where C3 = 0 and compression counts, too."""
    C = np.swapaxes(gradients, -1, -2) @ gradients
    for law in (HGOFamilies, HGOStructureTensor):
        made = law.of_structure_tensor(H, 0.3, 0.0, False)
        weights, structures = made.terms
        excess = np.einsum("ebpIJ,egIJ->egp", structures, C) - 1.0
        np.testing.assert_allclose(made.energy(gradients), 0.15 * (weights * excess**2).sum(axis=-1), rtol=1e-12)
