"""What a nearest-neighbour query costs: grid, k-d tree and brute force, by the number of nodes.

Nodes and queries are drawn uniformly; with --spread, the nodes from a part of the world in its lower left corner, as
where a tree has not left its room. The grid has as many cells as the compiled planners give it: one a node of the
arrays' capacity, which is doubled from 256 on. Every figure is the median of some repetitions, each on other nodes.

    python benchmarks/nearest_neighbour.py --sizes 100 1000 10000 100000 1000000
    python benchmarks/nearest_neighbour.py --spread 0.1
"""

from __future__ import annotations

import argparse
import math
import time

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cbrrt_ompl.compiled.nearest import BRUTE_FORCE, GRID, KD_TREE, KINDS, Index, insert, nearest

SIDE = 10.0  # of the world [m]
FIRST_CAPACITY = 256
NODE_VISITS = 20_000_000
"""Nodes that may be looked at in one repetition: bounds the number of slow queries."""


@njit(cache=True)
def fill(index: Index, count: int) -> None:
    """Enter the first nodes, one after the other."""
    for node in range(count):
        insert(index, node)


@njit(cache=True)
def answer(index: Index, queries: NDArray[np.float64], count: int, stack: NDArray[np.float64]) -> float:
    """Ask all queries, shape (m, 2); the sum of the distances keeps the compiler from leaving them out."""
    total = 0.0
    for i in range(len(queries)):
        node = nearest(index, queries[i, 0], queries[i, 1], count, stack)
        total += math.hypot(index.states[node, 0] - queries[i, 0], index.states[node, 1] - queries[i, 1])
    return total


def build(kind: int, positions: NDArray[np.float64]) -> Index:
    """An index of positions, shape (n, 2), as a search would have it."""
    capacity = FIRST_CAPACITY
    while capacity < len(positions):
        capacity *= 2
    cell = math.sqrt(SIDE * SIDE / capacity)
    cells = math.ceil(SIDE / cell)
    heads = np.full((cells, cells) if kind == GRID else (1, 1), -1, dtype=np.int32)
    occupied = np.array([2**31, -1, 2**31, -1, 0] if kind == GRID else [0] * 5, dtype=np.int64)
    states = np.zeros((capacity, 5))
    states[: len(positions), :2] = positions
    index = Index(kind, states, np.empty((capacity, 2), dtype=np.int32), heads, occupied, 0.0, 0.0, cell)
    fill(index, len(positions))
    return index


def cost(kind: int, size: int, spread: float, most_queries: int, seed: int) -> float:
    """Seconds per query."""
    rng = np.random.default_rng(seed)
    index = build(kind, spread * SIDE * rng.random((size, 2)))
    visits = size if kind == BRUTE_FORCE or spread < 1.0 else 1
    count = max(20, min(most_queries, NODE_VISITS // visits))
    queries = SIDE * rng.random((count, 2))
    stack = np.empty((2 * int(index.occupied[0]) + 64 if kind == KD_TREE else 0, 3))
    answer(index, queries[:1], size, stack)
    began = time.perf_counter()
    answer(index, queries, size, stack)
    return (time.perf_counter() - began) / count


def main() -> None:
    """Print one table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", type=int, nargs="+", default=[10**2, 10**3, 10**4, 10**5, 10**6])
    parser.add_argument("--queries", type=int, default=100_000, help="queries of a repetition, at most")
    parser.add_argument("--repetitions", type=int, default=5)
    parser.add_argument("--spread", type=float, default=1.0, help="side of the nodes' area, as a share of the world's")
    arguments = parser.parse_args()
    print(f"{'ns per query':>12}" + "".join(f"{name:>24}" for name in KINDS))
    for size in arguments.sizes:
        costs = {
            name: np.median(
                [cost(kind, size, arguments.spread, arguments.queries, seed) for seed in range(arguments.repetitions)]
            )
            for name, kind in KINDS.items()
        }
        cells = (f"{1e9 * value:>13,.0f} ({value / costs['grid']:>7.1f}x)" for value in costs.values())
        print(f"{size:>12,}" + "".join(f"{cell:>24}" for cell in cells), flush=True)


if __name__ == "__main__":
    main()
