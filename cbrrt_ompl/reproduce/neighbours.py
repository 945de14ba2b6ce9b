"""What a nearest-neighbour query costs the compiled planners by the number of nodes: grid, k-d tree, brute force."""

from __future__ import annotations

import math
import time

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.kernels import kernel
from cbrrt_ompl.planners.nearest import BRUTE_FORCE, KINDS, Index, insert, make_index, nearest, with_room_for_a_search
from cbrrt_ompl.problem.obstacles import Bounds

SIDE = 10.0
"""Side of the world, a square [m]."""

FIRST_CAPACITY = 256
"""Nodes that the planners' arrays have room for at first; they double it when they are full."""

NODE_VISITS = 20_000_000
"""Nodes that may be looked at in one repetition: bounds the number of slow queries."""

REPETITIONS = 5


def query_costs(kind: str, size: int, repetitions: int = REPETITIONS) -> NDArray[np.float64]:
    """Time of a query in a tree whose nodes are spread evenly.

    Args:
        kind: ``grid``, ``kd-tree`` or ``brute-force``.
        size: nodes of the tree.
        repetitions: each on other nodes and with other queries.

    Returns:
        Mean time of a query in each repetition, shape (repetitions,) [s].
    """
    return np.array([query_cost(KINDS[kind], size, seed=seed) for seed in range(repetitions)])


def query_cost(kind: int, size: int, spread: float = 1.0, most_queries: int = 100_000, seed: int = 0) -> float:
    """Mean time of a query [s].

    Args:
        kind: of the index, a value of `KINDS`.
        size: nodes of the tree.
        spread: side of the nodes' area, as a share of the world's; queries come from the whole world.
        most_queries: that are asked.
        seed: of nodes and queries.
    """
    rng = np.random.default_rng(seed)
    index = build_index(kind, spread * SIDE * rng.random((size, 2)))
    visits = size if kind == BRUTE_FORCE or spread < 1.0 else 1
    count = max(20, min(most_queries, NODE_VISITS // visits))
    queries = SIDE * rng.random((count, 2))
    answer(index, queries[:1], size)
    began = time.perf_counter()
    answer(index, queries, size)
    return (time.perf_counter() - began) / count


def build_index(kind: int, positions: NDArray[np.float64]) -> Index:
    """An index of positions, shape (n, 2), with as much room as a search would give it."""
    capacity = FIRST_CAPACITY
    while capacity < len(positions):
        capacity *= 2
    index = make_index(kind, Bounds((0.0, 0.0), (SIDE, SIDE)), capacity)
    fill(index, positions)
    return with_room_for_a_search(index)


@kernel
def fill(index: Index, positions: NDArray[np.float64]) -> None:
    """Enter positions, shape (n, 2), one after the other."""
    for node in range(len(positions)):
        insert(index, node, positions[node, 0], positions[node, 1])


@kernel
def answer(index: Index, queries: NDArray[np.float64], count: int) -> float:
    """Ask all queries, shape (m, 2); the sum of the distances keeps the compiler from leaving them out."""
    total = 0.0
    for i in range(len(queries)):
        node = nearest(index, queries[i, 0], queries[i, 1], count, math.inf, math.inf)
        place = index.places[node]
        total += math.hypot(place.x - queries[i, 0], place.y - queries[i, 1])
    return total
