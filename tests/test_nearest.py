"""Nearest neighbours: grid, k-d tree and brute force find a node as near as any."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from cbrrt_ompl.planners.nearest import (
    BRUTE_FORCE,
    GRID,
    KD_TREE,
    PLACES_PER_CELL,
    WORD,
    enlarged,
    insert,
    leave_out,
    make_index,
    nearest,
    with_room_for_a_search,
)
from cbrrt_ompl.problem.obstacles import Bounds

KINDS = pytest.mark.parametrize("kind", [GRID, KD_TREE, BRUTE_FORCE], ids=["grid", "k-d tree", "brute force"])

WORLD = Bounds((-5.0, -5.0), (5.0, 5.0))
LONG_WORLD = Bounds((2.0, -1.0), (42.0, 1.5))
CAPACITIES = [PLACES_PER_CELL * (WORD * k) ** 2 for k in (1, 2, 8)]
"""Room for so many nodes makes a grid of one, two and eight words a row."""


class Nodes:
    """Positions in an index of one kind, entered one by one."""

    def __init__(self, kind: int, bounds: Bounds, capacity: int) -> None:
        """An empty index."""
        self.index = make_index(kind, bounds, capacity)
        self.count = 0

    def enter(self, positions: NDArray[np.float64]) -> None:
        """Enter positions, shape (n, 2)."""
        for x, y in positions.tolist():
            insert(self.index, self.count, x, y)
            self.count += 1
        self.index = with_room_for_a_search(self.index)

    def nearest(self, x: float, y: float, most_failures: float = math.inf, most_steps: float = math.inf) -> int:
        """The node found."""
        return int(nearest(self.index, x, y, self.count, most_failures, most_steps))

    def distance(self, x: float, y: float) -> float:
        """Squared distance of the node found."""
        node = self.nearest(x, y)
        assert 0 <= node < self.count
        place = self.index.places[node]
        dx, dy = place["x"] - x, place["y"] - y
        return float(dx * dx + dy * dy)


def smallest_distance(positions: NDArray[np.float64], x: float, y: float) -> float:
    """Squared distance of the nearest of some positions, shape (n, 2)."""
    offsets = positions - (x, y)
    return float((offsets[:, 0] ** 2 + offsets[:, 1] ** 2).min())


def assert_exact(positions: NDArray[np.float64], queries: NDArray[np.float64], bounds: Bounds, capacity: int) -> None:
    """All kinds of index find the smallest distance."""
    for kind in (GRID, KD_TREE, BRUTE_FORCE):
        nodes = Nodes(kind, bounds, capacity)
        nodes.enter(positions)
        for x, y in queries.tolist():
            assert nodes.distance(x, y) == smallest_distance(positions, x, y)


def positions_in(bounds: Bounds, most: int = 40) -> st.SearchStrategy[NDArray[np.float64]]:
    """Positions on a lattice of the bounds, so that many are equal, in line, or as far away as others."""
    lattice = arrays(np.int64, st.tuples(st.integers(1, most), st.just(2)), elements=st.integers(0, 12))
    return lattice.map(lambda ij: np.array(bounds.min) + ij / 12.0 * np.array(bounds.size))


def anywhere(most: int = 40) -> st.SearchStrategy[NDArray[np.float64]]:
    """Positions in and around the world."""
    return arrays(np.float64, st.tuples(st.integers(1, most), st.just(2)), elements=st.floats(-8.0, 8.0))


@given(positions_in(WORLD), positions_in(WORLD, 10), st.sampled_from(CAPACITIES))
def test_all_find_the_nearest_of_regular_positions(
    positions: NDArray[np.float64], queries: NDArray[np.float64], capacity: int
) -> None:
    assert_exact(positions, queries, WORLD, capacity)


@given(anywhere(), anywhere(10), st.sampled_from(CAPACITIES))
def test_all_find_the_nearest_of_positions_in_and_outside_of_the_world(
    positions: NDArray[np.float64], queries: NDArray[np.float64], capacity: int
) -> None:
    assert_exact(positions, queries, WORLD, capacity)


@KINDS
def test_a_position_outside_finds_one_that_is_outside_too(kind: int) -> None:
    """Of two beside the same edge the nearer one is in another row; both are nearer than the edge."""
    for turn in (np.eye(2), -np.eye(2), np.eye(2)[::-1], -np.eye(2)[::-1]):
        nodes = Nodes(kind, WORLD, 2)
        nodes.enter(np.array([(-7.0, 0.0), (-6.4, 0.3)]) @ turn)
        assert nodes.nearest(*(np.array([-6.4, 0.0]) @ turn).tolist()) == 1


@given(positions_in(LONG_WORLD), anywhere(10), st.sampled_from(CAPACITIES))
def test_all_find_the_nearest_in_a_world_that_is_not_square(
    positions: NDArray[np.float64], queries: NDArray[np.float64], capacity: int
) -> None:
    assert_exact(positions, queries * (6.0, 0.3), LONG_WORLD, capacity)


@pytest.mark.parametrize("bounds", [WORLD, LONG_WORLD], ids=["square", "long"])
@pytest.mark.parametrize("capacity", CAPACITIES)
@pytest.mark.parametrize("layout", ["random", "clustered", "collinear", "duplicated", "one place", "sorted"])
def test_all_find_the_nearest_of_a_thousand(layout: str, capacity: int, bounds: Bounds) -> None:
    rng = np.random.default_rng(3)
    low, size = np.array(bounds.min), np.array(bounds.size)
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
    assert_exact(low + size * share, queries, bounds, capacity)


@KINDS
def test_every_answer_is_right_while_the_nodes_come_in(kind: int) -> None:
    rng = np.random.default_rng(4)
    positions, nodes = rng.uniform(-5.0, 5.0, (300, 2)), Nodes(kind, WORLD, 300)
    for n, position in enumerate(positions, start=1):
        nodes.enter(position[None])
        x, y = rng.uniform(-5.0, 5.0, 2).tolist()
        assert nodes.distance(x, y) == smallest_distance(positions[:n], x, y)


@KINDS
def test_an_index_that_is_enlarged_again_and_again_gives_the_same_answers(kind: int) -> None:
    """Only the first four hundred nodes were there when it was made."""
    rng = np.random.default_rng(5)
    positions, queries = rng.uniform(-6.0, 6.0, (2500, 2)), rng.uniform(-7.0, 7.0, (60, 2)).tolist()
    nodes = Nodes(kind, WORLD, 400)
    for first, last in ((0, 400), (400, 1000), (1000, 2500)):
        nodes.enter(positions[first:last])
        expected = [smallest_distance(positions[:last], x, y) for x, y in queries]
        assert [nodes.distance(x, y) for x, y in queries] == expected
        while len(nodes.index.places) < 4 * last:
            nodes.index = enlarged(nodes.index, WORLD, nodes.count)
        assert [nodes.distance(x, y) for x, y in queries] == expected
    assert len(nodes.index.places) > CAPACITIES[0]


@KINDS
def test_a_single_node_is_the_nearest_to_all(kind: int) -> None:
    nodes = Nodes(kind, WORLD, CAPACITIES[-1])
    nodes.enter(np.array([[4.9, -4.9]]))
    assert [nodes.nearest(x, y) for x, y in [(-4.9, 4.9), (4.9, -4.9), (1e6, -1e6), (-1e9, 0.0)]] == [0] * 4


@KINDS
def test_a_node_is_its_own_nearest(kind: int) -> None:
    positions = np.random.default_rng(6).uniform(-5.0, 5.0, (200, 2))
    nodes = Nodes(kind, WORLD, 200)
    nodes.enter(positions)
    assert [nodes.nearest(x, y) for x, y in positions.tolist()] == list(range(200))


@KINDS
def test_a_node_without_a_place_of_its_own_is_never_found(kind: int) -> None:
    nodes = Nodes(kind, WORLD, 8)
    nodes.enter(np.array([[0.0, 0.0]]))
    leave_out(nodes.index, 1)
    nodes.count = 2
    nodes.enter(np.array([[1.0, 0.0]]))
    nodes.index = enlarged(nodes.index, WORLD, nodes.count)
    assert [nodes.nearest(x, 0.0) for x in (-1.0, 0.4, 0.6, 3.0)] == [0, 0, 2, 2]


@KINDS
@pytest.mark.parametrize(
    ("seed", "field", "argument", "lowest", "most"),
    [(1, "failures", "most_failures", 0.0, 20), (2, "steps", "most_steps", -20.0, 400)],
)
def test_the_nearest_node_within_a_limit_of_failures_or_steps_is_found(
    kind: int, seed: int, field: str, argument: str, lowest: float, most: int
) -> None:
    rng = np.random.default_rng(seed)
    positions, values = rng.uniform(-5.0, 5.0, (60, 2)), rng.integers(0, most, 60)
    nodes = Nodes(kind, WORLD, 60)
    nodes.enter(positions)
    nodes.index.places[field] = values
    for x, y, limit in rng.uniform((-5.0, -5.0, lowest), (5.0, 5.0, float(most)), (200, 3)).tolist():
        distances = np.where(values <= limit, np.hypot(*(positions - (x, y)).T), np.inf)
        expected = int(distances.argmin()) if np.isfinite(distances).any() else -1
        assert nodes.nearest(x, y, **{argument: limit}) == expected


@KINDS
def test_no_node_is_found_where_all_have_failed_too_often(kind: int) -> None:
    nodes = Nodes(kind, WORLD, 2)
    nodes.enter(np.array([[-3.0, 2.0], [2.0, 4.0]]))
    nodes.index.places["failures"] = 50
    assert nodes.nearest(1.0, 1.0, 10.0) == -1
    assert nodes.nearest(1.0, 1.0, 50.0) == 1
