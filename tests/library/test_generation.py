"""Generated networks against the theory of stretched isotropic clouds and Poisson-Delaunay tessellations."""

from itertools import combinations

import numpy as np
import pytest
from fibers import exponential
from scipy.spatial import Delaunay, cKDTree
from scipy.special import elliprg

from fibrous.errors import NetworkError
from fibrous.networks import generation
from fibrous.networks.generation import (
    alignment_targets,
    delaunay,
    expected_structure_tensor,
    network_seed,
    stretch_tensor_for,
    stretches_for,
)
from fibrous.networks.geometry import connected_to_boundary, structure_tensor

FIBER = exponential(2.5)
SIZE = 0.04, 20.0  # volume fraction, edge in µm


def test_expected_alignment_is_the_logarithmic_slope_of_carlsons_integral():
    """The mean length of a stretched unit vector is R_G(s²), and H_i = 2 ∂ ln R_G/∂ ln s_i²."""
    squares = np.array([4.0, 0.7, 0.4])
    step = 1e-5
    slopes = []
    for axis in range(3):
        up, down = squares.copy(), squares.copy()
        up[axis] *= np.exp(step)
        down[axis] *= np.exp(-step)
        slopes.append((np.log(elliprg(*up)) - np.log(elliprg(*down))) / (2.0 * step))
    np.testing.assert_allclose(expected_structure_tensor(np.sqrt(squares)), 2.0 * np.array(slopes), rtol=1e-8)


@pytest.mark.parametrize("wanted", [(1 / 3, 1 / 3, 1 / 3), (0.69, 0.21, 0.10), (0.33, 0.05, 0.62), (0.80, 0.05, 0.15)])
def test_stretches_invert_the_expectation(wanted):
    stretches = stretches_for(np.array(wanted))
    np.testing.assert_allclose(expected_structure_tensor(stretches), wanted, atol=1e-9)
    assert stretches.prod() == pytest.approx(1.0, rel=1e-12)


def test_stretched_random_directions_have_the_expected_alignment(rng):
    wanted = np.array([0.6, 0.3, 0.1])
    directions = rng.normal(size=(400_000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    np.testing.assert_allclose(structure_tensor(directions * stretches_for(wanted)), np.diag(wanted), atol=3e-3)


def test_a_rotated_target_is_met_in_its_own_frame():
    angle = 0.5
    R = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    target = R @ np.diag([0.69, 0.21, 0.10]) @ R.T
    np.testing.assert_allclose(
        stretch_tensor_for(target), R @ stretch_tensor_for(np.diag([0.69, 0.21, 0.10])) @ R.T, atol=1e-9
    )
    network = delaunay(target, FIBER, *SIZE, 5, 0.002)
    np.testing.assert_allclose(network.structure_tensor, target, atol=0.002)


@pytest.fixture(scope="module", params=[(0.69, 0.21, 0.10), (0.35, 0.32, 0.33), (0.36, 0.12, 0.52), (0.74, 0.14, 0.12)])
def full(request):
    return delaunay(request.param, FIBER, *SIZE, network_seed(1, "test", 3), 0.002), np.diag(request.param)


def test_alignment_and_volume_fraction_are_met(full):
    network, target = full
    np.testing.assert_allclose(network.structure_tensor, target, atol=0.002)
    assert network.volume_fraction == pytest.approx(0.04, rel=1e-9)


def test_size_and_coordination_are_those_of_the_laboratorys_networks(full):
    network, _ = full
    assert 2_200 < len(network.fiber_nodes) < 3_800
    assert 14.8 < network.interior_coordination < 16.2


def test_fibers_fill_the_cube_and_boundary_nodes_lie_on_its_faces(full):
    network, _ = full
    farthest = np.abs(network.node_position).max(axis=1)
    np.testing.assert_array_equal(farthest[network.node_is_boundary], 0.5)
    assert (farthest[~network.node_is_boundary] <= 0.5 - 0.8 * generation.SNAP).all()
    for axis in range(3):
        for face in (-0.5, 0.5):
            assert (network.node_position[:, axis] == face).sum() > 30


def test_fibers_through_two_faces_are_kept(full):
    network, _ = full
    through = network.node_is_boundary[network.fiber_nodes].all(axis=1)
    assert through.sum() > 50


def test_nothing_floats_repeats_or_vanishes(full):
    network, _ = full
    assert connected_to_boundary(network).all()
    assert network.fiber_lengths.min() > 1e-6
    assert len(np.unique(np.sort(network.fiber_nodes, axis=1), axis=0)) == len(network.fiber_nodes)
    np.testing.assert_array_equal(np.unique(network.fiber_nodes), np.arange(len(network.node_position)))
    interior = network.node_position[~network.node_is_boundary]
    assert cKDTree(interior).query(interior, k=2)[0][:, 1].min() > 1e-9


def test_fibers_inside_are_delaunay_edges_of_their_own_preimage(full):
    """Undo the stretch: around an edge of a Delaunay tessellation some sphere through its ends holds no other node."""
    network, target = full
    inside = network.node_position[~network.node_is_boundary] @ np.linalg.inv(stretch_tensor_for(target))
    number = np.cumsum(~network.node_is_boundary) - 1
    ends = network.fiber_nodes[~network.node_is_boundary[network.fiber_nodes].any(axis=1)]
    ends = number[ends]
    middle = inside[ends].mean(axis=1)
    half = 0.5 * np.linalg.norm(np.diff(inside[ends], axis=1)[:, 0], axis=1)
    # Every pair whose smallest sphere is empty (a Gabriel pair) is a Delaunay edge, so it must be a fibre.
    pairs = cKDTree(inside).query_pairs(half.max() * 1.2, output_type="ndarray")
    known = {tuple(pair) for pair in np.sort(ends, axis=1).tolist()}
    tree = cKDTree(inside)
    deep = np.abs(network.node_position[~network.node_is_boundary]).max(axis=1) < 0.3
    checked = 0
    for first, second in pairs:
        if deep[first] and deep[second]:
            radius = 0.5 * np.linalg.norm(inside[first] - inside[second])
            if len(tree.query_ball_point(0.5 * (inside[first] + inside[second]), radius * (1 - 1e-9))) == 0:
                checked += 1
                assert (min(first, second), max(first, second)) in known
    assert checked > 20
    assert len(middle) == len(ends)


# The box around the preimage that it gives the cube holds two thirds more points than are needed.
OBLIQUE = stretch_tensor_for(np.array([[0.4, 0.2, 0.1], [0.2, 0.35, 0.1], [0.1, 0.1, 0.25]]))


def sides_of_tetrahedra(cloud):
    """The sorted pairs of nodes that share a Delaunay tetrahedron, shape (edges, 2)."""
    corners = np.sort(Delaunay(cloud).simplices, axis=1)
    return np.array(sorted({pair for row in corners.tolist() for pair in combinations(row, 2)}))


def test_edges_are_the_sides_of_the_tetrahedra_each_once_and_in_order():
    cloud, edges = generation._triangulated(OBLIQUE, 3.0, np.random.default_rng(8))
    np.testing.assert_array_equal(edges, sides_of_tetrahedra(cloud))


@pytest.mark.parametrize("stretch", [np.eye(3), np.diag([0.6, 1.0, 1 / 0.6]), OBLIQUE])
def test_the_cube_holds_the_edges_of_a_cloud_that_goes_on(stretch, rng):
    cloud, edges = generation._triangulated(stretch, 5.0, np.random.default_rng(8))
    box = np.abs(cloud).max(axis=0) + 3.0
    around = rng.uniform(-box, box, (int(8.0 * box.prod()), 3))
    further = np.concatenate([cloud, around[Delaunay(cloud).find_simplex(around) < 0]])
    wider = sides_of_tetrahedra(further)
    # Also in a cube a tenth wider: sizing it may well end there.
    inside, inside_wider = (
        pairs[generation._pieces(points @ stretch / 5.5, pairs)[0]]
        for points, pairs in ((cloud, edges), (further, wider))
    )
    assert len(inside) > 1_000
    np.testing.assert_array_equal(inside, inside_wider)


def length_inside(start, end):
    """Length of one edge in the closed unit cube: of its intervals between planes of faces, those with their middle in.

    Independent of the order in which an edge passes the planes, and exact for edges that lie in one.
    """
    vector = end - start
    moving = vector != 0.0
    passed = np.concatenate([(plane - start[moving]) / vector[moving] for plane in (-0.5, 0.5)])
    stops = np.sort(np.concatenate([[0.0, 1.0], passed[(passed > 0.0) & (passed < 1.0)]]))
    middles = start + 0.5 * (stops[1:] + stops[:-1])[:, None] * vector
    return np.diff(stops)[(np.abs(middles) <= 0.5).all(axis=1)].sum() * np.linalg.norm(vector)


@pytest.mark.parametrize("on_planes", [False, True])
def test_pieces_are_what_the_cube_holds_of_each_edge(rng, on_planes):
    """Also of edges in the plane of a face, along the sides of the cube, through its corners and parallel to axes."""
    ends = rng.choice([-0.75, -0.5, 0.0, 0.25, 0.5, 0.75], (4000, 3)) if on_planes else rng.uniform(-1, 1, (4000, 3))
    edges = np.arange(4000).reshape(-1, 2)
    edges = edges[(ends[edges[:, 0]] != ends[edges[:, 1]]).any(axis=1)]
    expected = np.array([length_inside(ends[first], ends[second]) for first, second in edges])
    crossing, start, vector, enter, leave = generation._pieces(ends, edges)
    lengths = np.zeros(len(edges))
    lengths[crossing] = (leave - enter) * np.linalg.norm(vector, axis=1)
    np.testing.assert_allclose(lengths, expected, atol=1e-12)
    np.testing.assert_array_equal(crossing, np.flatnonzero(expected > 1e-9))
    np.testing.assert_array_equal(start, ends[edges[crossing, 0]])
    np.testing.assert_allclose(start + vector, ends[edges[crossing, 1]], atol=1e-15)
    assert generation._clipped_length(ends, edges) == pytest.approx(expected.sum(), rel=1e-12)


def test_a_network_is_a_function_of_seed_and_number():
    one, two = (delaunay((0.6, 0.3, 0.1), FIBER, 0.04, 10.0, network_seed(3, "e", 4), 0.01) for _ in range(2))
    np.testing.assert_array_equal(one.node_position, two.node_position)
    np.testing.assert_array_equal(one.fiber_nodes, two.fiber_nodes)
    seeds = {network_seed(s, e, k) for s in (3, 4) for e in ("delaunay", "named") for k in range(50)}
    assert len(seeds) == 200


def test_targets_cover_the_admissible_alignments_evenly():
    targets = alignment_targets(np.arange(600), 2021, (0.33, 0.80), 0.05)
    H11, H22, H33 = targets[:, 0, 0], targets[:, 1, 1], targets[:, 2, 2]
    np.testing.assert_allclose(H11 + H22 + H33, 1.0, atol=1e-15)
    assert H11.min() >= 0.33
    assert H11.max() <= 0.80
    assert min(H22.min(), H33.min()) >= 0.05 - 1e-15
    assert (H33 > H11).any()
    # Uniform over the trapezoid: the share left of H11 = h, and of each half of the room of H22, follows its area.
    for h in (0.4, 0.5, 0.6, 0.7):
        share = (0.57**2 - (0.9 - h) ** 2) / (0.57**2 - 0.10**2)
        assert (h >= H11).mean() == pytest.approx(share, abs=0.01)
    assert (H33 > H22).mean() == pytest.approx(0.5, abs=0.01)


def test_targets_do_not_depend_on_how_many_are_asked_for():
    all_of_them = alignment_targets(np.arange(40), 9, (0.33, 0.80), 0.05)
    np.testing.assert_array_equal(all_of_them[[7, 31]], alignment_targets(np.array([7, 31]), 9, (0.33, 0.80), 0.05))


def test_what_cannot_be_generated_says_why():
    with pytest.raises(NetworkError, match="no cloud can be stretched"):
        delaunay((0.9, 0.2, -0.1), FIBER, *SIZE, 0)
    with pytest.raises(NetworkError, match="fewer than four nodes"):
        delaunay(np.eye(3) / 3.0, FIBER, 0.04, 2.0, 0)
    with pytest.raises(NetworkError, match="more than the tolerance"):
        delaunay((0.6, 0.3, 0.1), FIBER, 0.04, 7.0, 0, 1e-9)
    for H in ((0.6, 0.3, 0.2), (0.6, 0.4), np.full((3, 3), np.nan)):
        with pytest.raises(NetworkError, match="three numbers of sum 1"):
            delaunay(H, FIBER, *SIZE, 0)
    with pytest.raises(NetworkError, match=r"volume_fraction is -0\.04"):
        delaunay((0.6, 0.3, 0.1), FIBER, -0.04, 20.0, 0)


@pytest.mark.parametrize("number", [98, 362, 675])
def test_the_volume_fraction_is_exact_where_a_node_passes_the_plane_of_a_face(number):
    """Networks of the study in which the length inside the cube jumped with its size before outer nodes counted."""
    target = alignment_targets(np.array([number]), 2021, (0.33, 0.80), 0.05)[0]
    network = delaunay(target, FIBER, *SIZE, network_seed(2021, "delaunay", number), 0.002)
    assert network.volume_fraction == pytest.approx(0.04, rel=1e-9)
