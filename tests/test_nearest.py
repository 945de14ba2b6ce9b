"""Nearest neighbours: grid, k-d tree and brute force find a node as near as any."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from cbrrt_ompl.planners.nearest import BRUTE_FORCE, GRID, KD_TREE, Index, insert, nearest

KINDS = pytest.mark.parametrize("kind", [GRID, KD_TREE, BRUTE_FORCE], ids=["grid", "k-d tree", "brute force"])

Extent = tuple[float, float, float, float]

WORLD: Extent = (-5.0, -5.0, 5.0, 5.0)
LONG_WORLD: Extent = (2.0, -1.0, 42.0, 1.5)


class Nodes:
    """Positions in an index of one kind, entered one by one."""

    def __init__(self, kind: int, extent: Extent, capacity: int, cells: int) -> None:
        """An empty index, the grid of about so many cells."""
        x_min, y_min, x_max, y_max = extent
        cell = math.sqrt((x_max - x_min) * (y_max - y_min) / cells)
        shape = (math.ceil((y_max - y_min) / cell), math.ceil((x_max - x_min) / cell)) if kind == GRID else (1, 1)
        heads = np.full(shape, -1, dtype=np.int32)
        occupied = np.array([2**31, -1, 2**31, -1, 0] if kind == GRID else [0] * 5, dtype=np.int64)
        states, links = np.zeros((capacity, 5)), np.empty((capacity, 2), dtype=np.int32)
        self.index = Index(kind, states, links, heads, occupied, x_min, y_min, cell)
        self.count = 0

    def enter(self, positions: NDArray[np.float64]) -> None:
        """Enter positions, shape (n, 2)."""
        for position in positions:
            self.index.states[self.count, :2] = position
            insert(self.index, self.count)
            self.count += 1

    def distance(self, x: float, y: float) -> float:
        """Squared distance of the node found."""
        stack = np.empty((2 * self.count + 64, 3))
        node = nearest(self.index, x, y, self.count, stack)
        assert 0 <= node < self.count
        dx, dy = self.index.states[node, :2] - (x, y)
        return float(dx * dx + dy * dy)


def smallest_distance(positions: NDArray[np.float64], x: float, y: float) -> float:
    """Squared distance of the nearest of some positions, shape (n, 2)."""
    offsets = positions - (x, y)
    return float((offsets[:, 0] ** 2 + offsets[:, 1] ** 2).min())


def assert_exact(positions: NDArray[np.float64], queries: NDArray[np.float64], extent: Extent, cells: int) -> None:
    """All kinds of index find the smallest distance."""
    for kind in (GRID, KD_TREE, BRUTE_FORCE):
        nodes = Nodes(kind, extent, len(positions), cells)
        nodes.enter(positions)
        for x, y in queries:
            assert nodes.distance(x, y) == smallest_distance(positions, x, y)


def positions_in(extent: Extent, most: int = 40) -> st.SearchStrategy[NDArray[np.float64]]:
    """Positions on a lattice of the extent, so that many are equal, in line, or as far away as others."""
    lattice = arrays(np.int64, st.tuples(st.integers(1, most), st.just(2)), elements=st.integers(0, 12))
    x_min, y_min, x_max, y_max = extent
    return lattice.map(lambda ij: np.array([x_min, y_min]) + ij / 12.0 * np.array([x_max - x_min, y_max - y_min]))


def anywhere(most: int = 40) -> st.SearchStrategy[NDArray[np.float64]]:
    """Positions in and around the world."""
    return arrays(np.float64, st.tuples(st.integers(1, most), st.just(2)), elements=st.floats(-8.0, 8.0))


@given(positions_in(WORLD), positions_in(WORLD, 10), st.sampled_from([1, 4, 100, 5000]))
def test_all_find_the_nearest_of_regular_positions(
    positions: NDArray[np.float64], queries: NDArray[np.float64], cells: int
) -> None:
    assert_exact(positions, queries, WORLD, cells)


@given(anywhere(), anywhere(10), st.sampled_from([1, 4, 100, 5000]))
def test_all_find_the_nearest_of_positions_in_and_outside_of_the_world(
    positions: NDArray[np.float64], queries: NDArray[np.float64], cells: int
) -> None:
    assert_exact(positions, queries, WORLD, cells)


@given(positions_in(LONG_WORLD), anywhere(10), st.sampled_from([1, 30, 1000]))
def test_all_find_the_nearest_in_a_world_that_is_not_square(
    positions: NDArray[np.float64], queries: NDArray[np.float64], cells: int
) -> None:
    assert_exact(positions, queries * (6.0, 0.3), LONG_WORLD, cells)


@pytest.mark.parametrize("extent", [WORLD, LONG_WORLD], ids=["square", "long"])
@pytest.mark.parametrize("cells", [16, 1000])
@pytest.mark.parametrize("layout", ["random", "clustered", "collinear", "duplicated", "one place", "sorted"])
def test_all_find_the_nearest_of_a_thousand(layout: str, cells: int, extent: Extent) -> None:
    rng = np.random.default_rng(3)
    low, size = np.array(extent[:2]), np.array(extent[2:]) - np.array(extent[:2])
    share = rng.random((1000, 2))
    if layout == "clustered":
        share = 0.3 + 0.01 * rng.standard_normal((1000, 2))
        share[500:] += 0.5
    elif layout == "collinear":
        share[:, 1] = 0.5
    elif layout == "duplicated":
        share[500:] = share[:500]
    elif layout == "one place":
        share[:] = 0.7
    elif layout == "sorted":
        share = np.sort(share, axis=0)
    queries = low + size * np.concatenate([rng.random((100, 2)), rng.uniform(-1.0, 2.0, (50, 2)), share[:50]])
    assert_exact(low + size * share, queries, extent, cells)


@KINDS
def test_every_answer_is_right_while_the_nodes_come_in(kind: int) -> None:
    rng = np.random.default_rng(4)
    positions, nodes = rng.uniform(-5.0, 5.0, (300, 2)), Nodes(kind, WORLD, 300, 64)
    for n, position in enumerate(positions, start=1):
        nodes.enter(position[None])
        x, y = rng.uniform(-5.0, 5.0, 2)
        assert nodes.distance(x, y) == smallest_distance(positions[:n], x, y)


@KINDS
def test_a_finer_index_of_the_same_nodes_gives_the_same_answers(kind: int) -> None:
    rng = np.random.default_rng(5)
    positions, queries = rng.uniform(-5.0, 5.0, (500, 2)), rng.uniform(-6.0, 6.0, (100, 2))
    answers = []
    for cells in (4, 250, 1000, 40_000):
        nodes = Nodes(kind, WORLD, 1000, cells)
        nodes.enter(positions)
        answers.append([nodes.distance(x, y) for x, y in queries])
    assert answers[1:] == answers[:-1]


@KINDS
def test_a_single_node_is_the_nearest_to_all(kind: int) -> None:
    nodes = Nodes(kind, WORLD, 1, 10_000)
    nodes.enter(np.array([[4.9, -4.9]]))
    assert nodes.distance(-4.9, 4.9) == smallest_distance(np.array([[4.9, -4.9]]), -4.9, 4.9)


@KINDS
def test_a_node_is_its_own_nearest(kind: int) -> None:
    positions = np.random.default_rng(6).uniform(-5.0, 5.0, (200, 2))
    nodes = Nodes(kind, WORLD, 200, 100)
    nodes.enter(positions)
    assert {nodes.distance(x, y) for x, y in positions} == {0.0}
