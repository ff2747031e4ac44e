"""The flow chart of the stages: layers, what it leaves out, and where boxes stand."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fibrous_study.figures.flow import chart, closing_edges, longest_way, reduced

LOOP = {
    "networks": [], "curves": ["networks"], "fits": ["curves"], "tissue": ["fits", "refits", "networks"],
    "refit_curves": ["tissue", "networks"], "refits": ["refit_curves"],
}  # fmt: skip


def test_the_loop_of_the_refit_is_one_edge_back():
    found = chart(LOOP)
    assert found.back == {("refits", "tissue")}
    layers = {name: at[0] for name, at in found.position.items()}
    assert [name for name, _ in sorted(layers.items(), key=lambda item: item[1])] == list(LOOP)
    assert ("networks", "tissue") not in found.paths  # by way of curves and fits
    assert ("refits", "tissue") not in found.paths


@st.composite
def graphs(draw) -> dict[str, list[str]]:
    """Up to nine stages, each of which reads some of those before it."""
    count = draw(st.integers(1, 9))
    return {str(i): [str(j) for j in range(i) if draw(st.booleans())] for i in range(count)}


def ways(reads: dict[str, list[str]]) -> np.ndarray:
    """Which stage is reached from which, by powers of the adjacency matrix."""
    names = list(reads)
    step = np.array([[one in reads[other] for other in names] for one in names], dtype=int)
    total, power = step.copy(), step.copy()
    for _ in names:
        power = np.minimum(power @ step, 1)
        total = np.maximum(total, power)
    return total


@given(graphs())
def test_left_out_edges_follow_from_those_that_stay(reads):
    assert closing_edges(reads) == set()
    kept = reduced(reads)
    short = {name: [one for one, other in kept if other == name] for name in reads}
    np.testing.assert_array_equal(ways(short), ways(reads))
    for edge in kept:  # and none of those is one too many
        fewer = {name: [one for one in found if (one, name) != edge] for name, found in short.items()}
        assert not np.array_equal(ways(fewer), ways(reads))


@given(graphs())
def test_arrows_run_to_the_right_and_boxes_of_a_layer_are_apart(reads):
    found = chart(reads)
    for name, others in reads.items():
        assert found.position[name][0] == longest_way(name, reads)
        assert all(found.position[one][0] < found.position[name][0] for one in others)
    for points in found.paths.values():
        assert [x for x, _ in points] == list(range(int(points[0][0]), int(points[-1][0]) + 1))
    places = {*found.position.values()} | {point for points in found.paths.values() for point in points}
    for layer in {x for x, _ in places}:
        heights = sorted(y for x, y in places if x == layer)
        assert all(high - low >= 1.0 - 1e-9 for low, high in pairwise(heights))


def test_a_chain_is_a_straight_line():
    heights = [y for _, y in chart({"a": [], "b": ["a"], "c": ["b"]}).position.values()]
    assert heights == pytest.approx([heights[0]] * 3)
