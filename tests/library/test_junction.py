"""The junction law: exact derivatives, its limits, κ of stars by hand, and networks that were never fitted."""

import numpy as np
import pytest
from fibers import exponential
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import fibrous as fb
from fibrous.errors import NetworkError
from fibrous.materials.contract import MaterialError
from fibrous.materials.junction import few_fibers, release
from fibrous.networks.geometry import Geometry

FIBER = fb.Fiber(modulus_MPa=10.0, nonlinearity=2.5, radius_um=0.1)
# Fibres in tension on the whole, in compression on the whole, and both.
GRADIENTS = {
    "tension": [[1.2, 0.1, 0.0], [0.02, 1.05, -0.05], [0.0, 0.03, 0.97]],
    "compression": [[0.85, 0.05, 0.0], [0.02, 0.92, -0.03], [0.01, 0.0, 0.95]],
    "both": [[1.1, 0.2, 0.0], [0.0, 0.85, 0.1], [0.05, 0.0, 0.93]],
}
LAWS = {
    "Eq. 6": FIBER,
    "cut": fb.Fiber(modulus_MPa=10.0, nonlinearity=2.5, radius_um=0.1, linear_beyond_stretch=1.05),
    "buckling": fb.BucklingFiber(modulus_MPa=10.0, radius_um=0.1, compressive=0.2),
}


def made_up(law=FIBER, kappa: float = 0.2) -> fb.Junction:
    rng = np.random.default_rng(5)
    directions = rng.normal(size=(12, 3)) * [2.0, 1.0, 1.0]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return fb.Junction(directions, rng.uniform(0.5, 1.0, 12), law, kappa)


@pytest.fixture(scope="module")
def networks() -> list[fb.Network]:
    H = ((0.45, 0.35, 0.2), (0.7, 0.2, 0.1))
    return [fb.delaunay(one, FIBER, volume_fraction=0.04, edge_um=20.0, seed=k) for k, one in enumerate(H)]


def energy_by_hand(law: fb.Junction, F: np.ndarray) -> float:
    C = F.T @ F
    N, v = law.directions, law.weights
    stretch = np.sqrt(np.einsum("qi,ij,qj->q", N, C, N))
    force, slope = law.law.response(stretch)
    s, ds = force / stretch, (slope - force / stretch) / stretch**2
    p = v / v.sum()
    A, B, mean = (N.T * (p * s * s)) @ N, (N.T * (p * ds)) @ N, p @ s
    T, q = np.linalg.inv(B), mean * np.linalg.inv(C)
    M = np.linalg.inv(B + q) if mean >= 0.0 else T - T @ q @ T + T @ q @ T @ q @ T
    return float(v @ law.law.energy(stretch) - law.release * v.sum() * np.trace(A @ M))


@pytest.mark.parametrize("name", GRADIENTS)
@pytest.mark.parametrize("law", LAWS)
def test_the_energy_is_the_formula(name, law):
    F = np.array(GRADIENTS[name])
    assert float(made_up(LAWS[law]).energy(F)) == pytest.approx(energy_by_hand(made_up(LAWS[law]), F), rel=1e-12)


@pytest.mark.parametrize("name", GRADIENTS)
@pytest.mark.parametrize("law", LAWS)
def test_stress_and_tangent_are_derivatives(name, law):
    material, F, step = made_up(LAWS[law]), np.array(GRADIENTS[name]), 1e-6
    changes = step * np.eye(9).reshape(9, 3, 3)
    P, A, _ = material(F)
    energy = (material.energy(F + changes) - material.energy(F - changes)) / (2 * step)
    np.testing.assert_allclose(energy, P.ravel(), atol=3e-9 * abs(P).max() + 1e-9)
    stress = (material.piola(F + changes) - material.piola(F - changes)) / (2 * step)
    np.testing.assert_allclose(stress.reshape(9, 9).T, A.reshape(9, 9), atol=1e-8 * abs(A).max())
    np.testing.assert_allclose(A, A.transpose(2, 3, 0, 1), atol=1e-14 * abs(A).max())


def test_the_stress_does_not_jump_where_the_series_begins():
    material, shape = made_up(), np.diag([1.05, 0.95, 1.0])

    def mean_force(stretch: float) -> float:
        stretches = np.linalg.norm(material.directions @ (stretch * shape), axis=1)
        return float(material.weights @ (material.law.response(stretches)[0] / stretches))

    zero = brentq(mean_force, 0.9, 1.1, xtol=1e-15)
    below, above = (material.piola((zero + step) * shape) for step in (-1e-9, 1e-9))
    np.testing.assert_allclose(below, above, atol=1e-7 * abs(above).max())
    np.testing.assert_array_less(1e-3, abs(above).max())


def test_turning_the_tissue_turns_the_stress():
    R, F = Rotation.from_rotvec([0.3, -0.5, 0.8]).as_matrix(), np.array(GRADIENTS["both"])
    np.testing.assert_allclose(made_up().piola(R @ F), R @ made_up().piola(F), atol=1e-14)


def test_without_release_it_is_the_affine_sum():
    law, F = made_up(kappa=0.0), np.array(list(GRADIENTS.values()))
    affine = fb.AffineFibers(law.directions, law.weights, law.law)
    for ours, theirs in zip(law(F)[:2], affine(F)[:2], strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-13 * abs(theirs).max())
    np.testing.assert_allclose(law.energy(F), affine.energy(F), rtol=1e-12)


def test_points_of_elements_take_their_own_fibres(networks):
    """Eleven points, more than a vector holds, and an F that is turned inside out among them."""
    law = fb.Junction.of_networks(networks)
    F = np.eye(3) + 0.05 * np.random.default_rng(0).normal(size=(2, 11, 3, 3))
    F[0, 3] = np.diag([-1.0, 1.0, 1.0])
    P, A, _ = law(F)
    W = law.energy(F)
    assert np.isnan(P[0, 3]).all()
    assert np.isnan(W[0, 3])
    for e, q in ((0, 0), (1, 10), (1, 3)):
        one = fb.Junction(law.directions[e, 0], law.weights[e, 0], FIBER, float(law.release[e, 0]))
        np.testing.assert_array_equal(one.piola(F[e, q]), P[e, q])
        assert float(one.energy(F[e, q])) == W[e, q]
        np.testing.assert_array_equal(law.of_elements(slice(e, e + 1)).tangent(F[e : e + 1])[0, q], A[e, q])


def test_few_fibres_keep_the_moments_of_many(networks):
    vectors = networks[1].fiber_vectors
    lengths = np.linalg.norm(vectors, axis=1)
    N, v = few_fibers(vectors / lengths[:, None], lengths)
    assert len(v) <= 28
    assert (v > 0.0).all()
    for powers in ((6, 0, 0), (2, 2, 2), (3, 1, 2), (0, 4, 0), (1, 1, 0), (0, 0, 0)):
        many = (lengths * np.prod((vectors / lengths[:, None]) ** powers, axis=1)).sum()
        assert (v * np.prod(N**powers, axis=1)).sum() == pytest.approx(many, abs=1e-9 * lengths.sum())


def test_release_of_a_star_by_hand():
    """A node with three pairs of fibres along the axes, of lengths 1 and 2 each: along an axis e the pair is out of
    balance by 0, so only what is not balanced counts: here a fourth fibre along x with no partner."""
    ends = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    position = np.vstack([[0.0, 0, 0], 0.5 * ends, [[0.25, 0.0, 0.0]]])
    fibers = np.array([[0, k] for k in range(1, 8)])
    star = Geometry(position, np.array([False, *[True] * 7]), fibers)
    # g = ε_xx e_x from the seventh; K_xx = 2/0.5 + 1/0.25; Q = ½ ε_xx²/8, whose trace over strains is 1/16.
    L = np.array([0.5] * 6 + [0.25])
    B = np.array([1.25, 1.0, 1.0]) / L.sum()
    R = 1.25 / B[0] + 1.0 / B[1] + 1.0 / B[2]
    assert release(star) == pytest.approx((1.0 / 16.0) / R)


def test_it_follows_networks_that_it_was_not_fitted_to(networks):
    law = fb.Junction.of_networks(networks)
    affine = fb.AffineFibers.of_networks(networks)
    rng = np.random.default_rng(3)
    Q = Rotation.random(6, random_state=1).as_matrix()
    F = Q.transpose(0, 2, 1) @ (rng.uniform(0.9, 1.25, (6, 3, 1)) * Q)
    wanted = np.stack([network.stress(F) for network in networks])
    size = np.linalg.norm(wanted, axis=(-1, -2))
    of_law, of_affine = (
        np.linalg.norm(one.stress(np.stack([F, F])) - wanted, axis=(-1, -2)) / size for one in (law, affine)
    )
    assert np.median(of_law) < 0.02
    assert np.median(of_affine) > 0.06
    assert 0.019 < law.release.mean() < 0.025


def test_what_is_out_of_range_is_refused():
    N, v = np.eye(3), np.ones(3)
    for release_, match in ((-0.1, "release"), (np.ones(3), "release")):
        with pytest.raises(MaterialError, match=match):
            fb.Junction(N, v, FIBER, release_)
    with pytest.raises(MaterialError, match="weights"):
        fb.Junction(N, 0.0 * v, FIBER, 0.02)
    with pytest.raises(MaterialError, match="plane"):
        fb.Junction(N[:2], v[:2], FIBER, 0.02)
    with pytest.raises(MaterialError, match="per fiber"):
        fb.Junction(N, v, exponential(np.full(3, 2.5)), 0.02)
    position = np.array([[0.0, 0, 0], [0.5, 0, 0], [-0.5, 0.1, 0], [0.1, 0.5, 0]])
    flat = Geometry(position, np.array([False, True, True, True]), np.array([[0, 1], [0, 2], [0, 3]]))
    with pytest.raises(NetworkError, match="node 0"):
        release(flat)
