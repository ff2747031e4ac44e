"""The three-fibre example against the paper, against its energy, and against Eq. 12 as the paper writes it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import fsolve, minimize

from fibrous_study.three_fibers import ANCHORS, REFERENCE_LENGTH, STRUCTURE_TENSOR, affine, equilibrium

ALONG, ACROSS = 3 / 2, 2 / 3


def energy(node, stretch):
    """Σ ½ (L/l − 1)² l of the three linear fibres, written out from coordinates."""
    ends = [(0.0, 0.5 / stretch), (-0.5 * stretch, 0.0), (0.5 * stretch, 0.0)]
    return sum(0.25 * (np.hypot(node[0] - x, node[1] - y) / 0.5 - 1.0) ** 2 for x, y in ends)


def test_structure_tensor_is_that_of_the_reference_geometry():
    lengths = np.linalg.norm(ANCHORS, axis=1)
    directions = ANCHORS / lengths[:, None]
    np.testing.assert_allclose(lengths, REFERENCE_LENGTH)
    np.testing.assert_allclose((lengths[:, None] * directions).T @ directions / lengths.sum(), STRUCTURE_TENSOR)


def test_along_the_alignment_the_paper_prints_the_affine_state():
    state = affine(ALONG)
    assert round(state.averaged_stretch, 3) == 1.284
    assert round(state.mean_stretch, 3) == 1.222
    np.testing.assert_allclose(state.fiber_stretches, [2 / 3, 3 / 2, 3 / 2])
    np.testing.assert_allclose(state.lengths, [1 / 3, 3 / 4, 3 / 4])


def test_across_the_alignment_the_paper_prints_the_balanced_state():
    state = equilibrium(ACROSS)
    assert round(state.averaged_stretch, 3) == 1.023
    assert [round(length, 3) for length in state.lengths] == [0.439, 0.456, 0.456]
    assert round(state.angle, 1) == 47.0
    assert [round(stretch, 2) for stretch in state.fiber_stretches] == [0.88, 0.91, 0.91]
    assert round(state.mean_stretch, 3) == 0.900


def test_eq_12_with_the_two_constraints_as_the_paper_writes_them():
    def equations(unknowns):
        L1, L2, theta = unknowns
        return [
            (L1 / 0.5 - 1) - 2 * (L2 / 0.5 - 1) * np.cos(theta),
            L2 * np.cos(theta) + L1 - 1.5 / 2,
            2 * L2 * np.sin(theta) - 1 / 1.5,
        ]

    L1, L2, theta = fsolve(equations, [0.4, 0.5, 0.8], xtol=1e-13)
    state = equilibrium(ACROSS)
    np.testing.assert_allclose([*state.lengths[:2], np.radians(state.angle)], [L1, L2, theta], rtol=1e-9)


def test_along_the_alignment_balance_lies_elsewhere_than_the_paper_draws():
    assert affine(ALONG).vertical_force == pytest.approx(-1 / 3)  # fibre 1, shortened by a third, pushes the node down
    assert equilibrium(ALONG).node_height < 0.0
    assert equilibrium(ALONG).mean_stretch == pytest.approx(1.2972, abs=5e-5)


@given(st.floats(0.4, 2.5))
def test_balance_is_the_least_energy_in_the_plane(stretch):
    found = [
        minimize(energy, start, args=(stretch,), tol=1e-12)
        for start in ((0.1, 0.6 / stretch), (-0.2, -0.1), (0.3 * stretch, 0.05))
    ]
    best = min(found, key=lambda result: result.fun)
    state = equilibrium(stretch)
    assert energy(state.node, stretch) <= best.fun + 1e-12
    np.testing.assert_allclose(state.node, best.x, atol=2e-6)


@given(st.floats(0.4, 2.5), st.floats(-0.4, 0.15))
def test_vertical_force_is_minus_the_slope_of_the_energy(stretch, height):
    state = type(affine(stretch))(stretch, height)
    step = 1e-6
    slope = (energy((0.0, height + step), stretch) - energy((0.0, height - step), stretch)) / (2 * step)
    assert state.vertical_force == pytest.approx(-slope, abs=1e-8)


def test_undeformed_square_is_at_rest():
    state = equilibrium(1.0)
    np.testing.assert_allclose(state.fiber_stretches, 1.0, rtol=1e-14)
    assert state.averaged_stretch == pytest.approx(1.0, abs=1e-15)
