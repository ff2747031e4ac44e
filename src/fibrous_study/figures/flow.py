"""A flow chart of stages in layers from left to right: what reads what, with as few crossings as a few sweeps find."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

Edge = tuple[str, str]
SWEEPS = 24


@dataclass(frozen=True)
class Chart:
    """Where boxes and arrows of a flow chart are.

    position : of each stage, (layer, height); layers count from 0, heights of one layer are at least 1 apart
    paths : of each edge, the points (layer, height) that its arrow runs through
    back : edges that close a loop, against the direction of the others
    """

    position: Mapping[str, tuple[float, float]]
    paths: Mapping[Edge, list[tuple[float, float]]]
    back: Collection[Edge]


def chart(reads: Mapping[str, Collection[str]]) -> Chart:
    """The chart of stages and the stages that each reads, without edges that follow from others."""
    back = closing_edges(reads)
    forward = {name: {one for one in found if (one, name) not in back} for name, found in reads.items()}
    kept = reduced(forward)
    layer = {name: longest_way(name, forward) for name in reads}
    rows, chains = _layers(layer, kept)
    heights = _heights(rows, chains)
    position = {name: (float(layer[name]), heights[name]) for name in reads}
    paths = {
        (chain[0], chain[-1]): [(float(layer[chain[0]] + i), heights[node]) for i, node in enumerate(chain)]
        for chain in chains
    }
    return Chart(position, paths, back)


def closing_edges(reads: Mapping[str, Collection[str]]) -> set[Edge]:
    """Edges (from, to) without which there is no loop: those that lead back to a stage under way in a depth-first walk.

    >>> closing_edges({"a": [], "b": ["a", "c"], "c": ["b"]})
    {('c', 'b')}
    """
    writes: dict[str, list[str]] = {name: [] for name in reads}
    for name, found in reads.items():
        for one in found:
            writes[one].append(name)
    closing: set[Edge] = set()
    done: set[str] = set()

    def walk(name: str, under_way: tuple[str, ...]) -> None:
        for other in writes[name]:
            if other in (*under_way, name):
                closing.add((name, other))
            elif other not in done:
                walk(other, (*under_way, name))
        done.add(name)

    for name in reads:
        if name not in done:
            walk(name, ())
    return closing


def longest_way(name: str, reads: Mapping[str, Collection[str]]) -> int:
    """Edges on the longest way from a stage that reads nothing to this one."""
    return max((1 + longest_way(other, reads) for other in reads[name]), default=0)


def reduced(reads: Mapping[str, Collection[str]]) -> set[Edge]:
    """Edges (from, to) of a graph without loops, but for those that a longer way between the same stages implies.

    >>> sorted(reduced({"a": [], "b": ["a"], "c": ["a", "b"]}))
    [('a', 'b'), ('b', 'c')]
    """

    def reached(name: str) -> set[str]:
        return set(reads[name]).union(*(reached(other) for other in reads[name]))

    return {
        (one, name)
        for name, found in reads.items()
        for one in found
        if not any(one in reached(other) for other in found if other != one)
    }


def _layers(layer: Mapping[str, int], edges: Collection[Edge]) -> tuple[list[list[str]], list[list[str]]]:
    """Nodes of each layer, and of each edge its chain of nodes with one in every layer: stages, and bends between."""
    rows: list[list[str]] = [[] for _ in range(1 + max(layer.values()))]
    for name, depth in layer.items():
        rows[depth].append(name)
    chains = []
    for one, other in sorted(edges, key=lambda edge: (layer[edge[0]], edge)):
        bends = [f"{one}>{depth}" for depth in range(layer[one] + 1, layer[other])]
        for depth, bend in enumerate(bends, start=layer[one] + 1):
            # Arrows from one stage share their way as long as they can.
            if bend not in rows[depth]:
                rows[depth].append(bend)
        chains.append([one, *bends, other])
    return rows, chains


def _heights(rows: list[list[str]], chains: list[list[str]]) -> dict[str, float]:
    """Heights that put every node near the mean of its neighbours, those of a layer at least 1 apart."""
    near: dict[str, list[str]] = {node: [] for row in rows for node in row}
    for chain in chains:
        for one, other in pairwise(chain):
            near[one].append(other)
            near[other].append(one)
    heights = {node: float(i) - 0.5 * (len(row) - 1) for row in rows for i, node in enumerate(row)}
    for sweep in range(SWEEPS):
        for row in rows if sweep % 2 == 0 else rows[::-1]:
            wanted = {node: float(np.mean([heights[one] for one in near[node] or [node]])) for node in row}
            row.sort(key=lambda node: wanted[node])
            heights |= _apart(row, wanted)
    return heights


def _apart(row: list[str], wanted: Mapping[str, float]) -> dict[str, float]:
    """Heights in the order of `row`, at least 1 apart, as near as possible to those wanted in mean square.

    Neighbours that are too near are moved together as one block.
    """
    blocks: list[tuple[float, int]] = []  # mean of what its nodes want of its first one, and its size
    for index, node in enumerate(row):
        mean, size = wanted[node] - index, 1
        while blocks and blocks[-1][0] > mean:
            other, count = blocks.pop()
            mean, size = (mean * size + other * count) / (size + count), size + count
        blocks.append((mean, size))
    first = [mean for mean, size in blocks for _ in range(size)]
    return {node: first[index] + index for index, node in enumerate(row)}
