"""Loads: isochoric, at rest the identity, matched in averaged stretch."""

import numpy as np
import pytest

from fibrous.deformation import (
    Load,
    LoadCase,
    averaged_stretch,
    largest_principal_stretch,
    load_paths,
    loads,
    matching_magnitude,
)
from fibrous.errors import LoadError

LOADS = [
    "x_uniaxial",
    "y_uniaxial",
    "xy_biaxial",
    "xz_biaxial",
    "yz_biaxial",
    "xy_shear",
    "xz_shear",
    "yz_shear",
    "zx_shear",
]
H = np.array([[0.69, 0.02, -0.01], [0.02, 0.21, 0.005], [-0.01, 0.005, 0.10]])


@pytest.mark.parametrize("name", LOADS)
def test_loads_begin_at_rest_and_keep_the_volume(name):
    load = Load.parse(name)
    magnitudes = load.rest + np.linspace(0.0, 1.3, 9)
    gradients = load.deformation_gradient(magnitudes)
    np.testing.assert_array_equal(gradients[0], np.eye(3))
    np.testing.assert_allclose(np.linalg.det(gradients), 1.0, rtol=1e-14)
    assert (largest_principal_stretch(gradients[1:]) > 1.0).all()


def test_loads_are_the_formulas_of_the_design():
    np.testing.assert_allclose(Load.parse("x_uniaxial").deformation_gradient(1.8), np.diag([1.8, 1.8**-0.5, 1.8**-0.5]))
    np.testing.assert_allclose(Load.parse("xy_biaxial").deformation_gradient(1.3), np.diag([1.3, 1.3, 1.3**-2]))
    np.testing.assert_allclose(Load.parse("xz_biaxial").deformation_gradient(1.3), np.diag([1.3, 1.3**-2, 1.3]))
    e = np.eye(3)
    for name, (first, second) in {"xy_shear": (0, 1), "xz_shear": (0, 2), "yz_shear": (1, 2)}.items():
        F = Load.parse(name).deformation_gradient(0.4)
        np.testing.assert_allclose(F, e + 0.4 * np.outer(e[second], e[first]))
        assert (F.T @ F)[first, first] == pytest.approx(1.0 + 0.4**2)


@pytest.mark.parametrize("name", ["", "x", "x_pull", "xx_shear", "xyz_shear", "w_uniaxial", "xy_uniaxial", "x_shear"])
def test_other_names_are_refused(name):
    assert Load.kind_of(name) is None
    with pytest.raises(LoadError, match="unknown"):
        Load.parse(name)


@pytest.mark.parametrize("name", LOADS)
def test_the_kind_is_known_by_the_name(name):
    assert Load.kind_of(name) == Load.parse(name).kind == name.split("_")[1]


@pytest.mark.parametrize("name", LOADS)
def test_principal_stretch_is_the_largest_singular_value(name):
    load = Load.parse(name)
    F = load.deformation_gradient(load.magnitude_at_principal_stretch(2.2))
    assert np.linalg.svd(F, compute_uv=False)[0] == pytest.approx(2.2, rel=1e-12)
    assert largest_principal_stretch(F) == pytest.approx(2.2, rel=1e-12)


def test_averaged_stretch_is_the_mean_square_over_fibers(rng):
    directions = rng.normal(size=(50, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    weights = rng.random(50)
    tensor = np.einsum("m,mi,mj->ij", weights, directions, directions) / weights.sum()
    F = np.eye(3) + 0.3 * rng.normal(size=(3, 3))
    squares = np.linalg.norm(directions @ F.T, axis=1) ** 2
    assert averaged_stretch(F, tensor) == pytest.approx(np.sqrt(weights @ squares / weights.sum()), rel=1e-13)


@pytest.mark.parametrize(("first", "second"), [(0, 1), (0, 2), (1, 2)])
def test_matched_shear_solves_its_quadratic(first, second):
    target = 1.2
    name = "xyz"[first] + "xyz"[second] + "_shear"
    found, limited = matching_magnitude(Load.parse(name), H, target, limit=9.0)
    a, b, c = H[first, first], 2.0 * H[first, second], 1.0 - target**2
    assert found == pytest.approx((-b + np.sqrt(b * b - 4.0 * a * c)) / (2.0 * a), rel=1e-12)
    assert not limited


def test_matching_takes_the_crossing_that_stays_above():
    """Aligned with z, an xy-biaxial load first lowers λ_f below 1 and only later raises it: network 3 of Fig. 6."""
    tensor = np.diag([0.36, 0.12, 0.52])
    load = Load.parse("xy_biaxial")
    found, limited = matching_magnitude(load, tensor, 1.0005, limit=3.5)
    assert not limited
    assert found > 1.2
    assert averaged_stretch(load.deformation_gradient(found), tensor) == pytest.approx(1.0005, rel=1e-12)
    assert averaged_stretch(load.deformation_gradient(1.0 + 0.5 * (found - 1.0)), tensor) < 1.0


def test_a_load_that_would_stretch_too_far_ends_at_the_limit():
    paths = load_paths([LoadCase("x_uniaxial", 1.8), LoadCase("yz_shear")], np.diag([0.80, 0.05, 0.15]), 20, 3.5)
    assert [path.amplitude_limited for path in paths] == [False, True]
    assert largest_principal_stretch(paths[1].gradients)[-1] == pytest.approx(3.5, rel=1e-12)


def test_paths_grow_linearly_and_end_at_one_averaged_stretch():
    paths = load_paths(
        [LoadCase("x_uniaxial", 1.8), LoadCase("xy_biaxial"), LoadCase("xz_shear"), LoadCase("xy_shear", 0.15)],
        H,
        20,
        3.5,
    )
    ends = [averaged_stretch(path.gradients[-1], H) for path in paths]
    np.testing.assert_allclose(ends[:3], ends[0], rtol=1e-12)
    assert paths[3].magnitudes[-1] == 0.15
    for path in paths:
        np.testing.assert_allclose(np.diff(path.magnitudes, 2), 0.0, atol=1e-14)
        assert len(path.gradients) == 21


def test_a_load_that_never_reaches_the_target_is_refused():
    with pytest.raises(LoadError, match="never has the averaged stretch"):
        load_paths([LoadCase("x_uniaxial", 0.9), LoadCase("xy_shear")], np.diag([0.6, 0.3, 0.1]), 5, 3.5)
    with pytest.raises(LoadError, match="needs a magnitude"):
        load_paths([LoadCase("x_uniaxial")], H, 5, 3.5)


def test_own_gradients_are_ends_or_paths():
    path = np.eye(3) + np.linspace(0.0, 1.0, 3)[:, None, None] ** 2 * np.diag([0.2, 0.0, -0.1])
    straight, curved = load_paths(loads({"mine": path[-1], "bent": path}), H, 2, 3.5)
    np.testing.assert_allclose(
        straight.gradients, np.eye(3) + np.array([0.0, 0.5, 1.0])[:, None, None] * (path[-1] - np.eye(3))
    )
    np.testing.assert_array_equal(curved.gradients, path)
    for made in (straight, curved):
        np.testing.assert_array_equal(made.magnitudes, [0.0, 0.5, 1.0])
        assert not made.amplitude_limited


@pytest.mark.parametrize(
    ("ends", "text"),
    [
        ({"mine": 1.2}, "load 'mine' is unknown"),
        ({"x_uniaxial": -1.2}, "it must be at least 0"),
        ({"x_uniaxial": np.nan}, "it must be at least 0"),
        ({"mine": np.eye(2)}, r"it must be \(3, 3\)"),
    ],
)
def test_a_load_that_is_none_is_refused(ends, text):
    with pytest.raises(LoadError, match=text):
        loads(ends)
    with pytest.raises(LoadError, match="at 3 steps, not at 6"):
        load_paths(loads({"mine": np.broadcast_to(np.eye(3), (3, 3, 3))}), H, 5, 3.5)
