"""The shortest path of a disc on the distance field: A* over a coarse grid."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.kernels import inner_kernel, kernel
from cbrrt_ompl.motion.records import Record
from cbrrt_ompl.optimise.field import distance_at

MOVES = (
    (1, 0), (-1, 0), (0, 1), (0, -1),
    (1, 1), (-1, 1), (1, -1), (-1, -1),
    (2, 1), (-2, 1), (2, -1), (-2, -1),
    (1, 2), (-1, 2), (1, -2), (-1, -2),
)  # fmt: skip
"""Sixteen neighbours of a cell: by (column, row)."""


@kernel
def cell_costs(
    grid: Record,
    distances: NDArray[np.float32],
    corner: tuple[float, float],
    cell: float,
    shape: tuple[int, int],
    inner: float,
    outer: float,
) -> NDArray[np.float32]:
    """What a metre costs in each cell of a grid, shape (rows * columns,).

    Args:
        grid: where the nodes of the distance field are.
        distances: at its nodes.
        corner: lower left corner of the cells [m].
        cell: side of a cell [m].
        shape: rows and columns of cells.
        inner: cells whose centres are nearer to anything are blocked: infinite [m].
        outer: cells whose centres are farther cost 1, those between up to 2 [m].
    """
    rows, columns = shape
    costs = np.empty(rows * columns, dtype=np.float32)
    for j in range(rows):
        for i in range(columns):
            d = distance_at(grid, distances, corner[0] + (i + 0.5) * cell, corner[1] + (j + 0.5) * cell)
            if d <= inner:
                costs[j * columns + i] = math.inf
            else:
                costs[j * columns + i] = 1.0 + max(0.0, outer - d) / max(outer - inner, 1e-9)
    return costs


@kernel
def shortest_path(costs: NDArray[np.float32], columns: int, begin: int, end: int) -> NDArray[np.int64]:
    """Cells of a cheapest path, from the first to the last; empty where there is none.

    A* with the straight distance as the bound of what is left, cell by cell with a binary heap (lazy deletion).

    Args:
        costs: of a metre in each cell, 1 or more, shape (rows * columns,).
        columns: of the grid.
        begin: cell to begin in.
        end: cell to end in.
    """
    count = len(costs)
    best, parents = np.empty(count, dtype=np.float32), np.empty(count, dtype=np.int32)
    for cell in range(count):
        best[cell] = math.inf
    keys, cells = np.empty(1024, dtype=np.float32), np.empty(1024, dtype=np.int32)
    goal_row, goal_column = end // columns, end % columns
    best[begin] = 0.0
    size = heap_push(keys, cells, 0, np.float32(0.0), begin)
    while size > 0:
        key, here = keys[0], cells[0]
        size = heap_pop(keys, cells, size)
        if here == end:
            return walk_back(parents, begin, end)
        if key > best[here] + math.hypot(goal_row - here // columns, goal_column - here % columns) + 1e-3:
            continue
        for step in MOVES:
            there, way = cell_beside(costs, columns, here, step)
            if there < 0:
                continue
            reached = best[here] + way
            if reached < best[there] - 1e-4:
                best[there] = reached
                parents[there] = here
                if size == len(keys):
                    keys, cells = doubled(keys), doubled(cells)
                left = math.hypot(goal_row - there // columns, goal_column - there % columns)
                size = heap_push(keys, cells, size, np.float32(reached + left), there)
    return np.empty(0, dtype=np.int64)


@kernel
def ways_to(costs: NDArray[np.float32], columns: int, end: int, begin: int, more: float) -> NDArray[np.float32]:
    """Costs of the cheapest paths from all cells to one, by Dijkstra's algorithm, shape (rows * columns,).

    Args:
        costs: of a metre in each cell, 1 or more, shape (rows * columns,).
        columns: of the grid.
        end: the cell to which the paths lead.
        begin: a cell of which the cost is of interest.
        more: those that cost more than so many times as much are not.

    Returns:
        Costs in terms of the side of a cell; infinite where they are not of interest, or there is no path.
    """
    count = len(costs)
    best = np.empty(count, dtype=np.float32)
    for cell in range(count):
        best[cell] = math.inf
    keys, cells = np.empty(1024, dtype=np.float32), np.empty(1024, dtype=np.int32)
    best[end] = 0.0
    most = math.inf
    size = heap_push(keys, cells, 0, np.float32(0.0), end)
    while size > 0:
        key, here = keys[0], cells[0]
        size = heap_pop(keys, cells, size)
        if key > best[here]:
            continue
        if key > most:
            break
        if here == begin:
            most = more * key
        for step in MOVES:
            there, way = cell_beside(costs, columns, here, step)
            if there < 0:
                continue
            reached = np.float32(key + way)
            if reached < best[there]:
                best[there] = reached
                if size == len(keys):
                    keys, cells = doubled(keys), doubled(cells)
                size = heap_push(keys, cells, size, reached, there)
    return best


@inner_kernel(forceinline=True)
def cell_beside(costs: NDArray[np.float32], columns: int, here: int, step: tuple[int, int]) -> tuple[int, float]:
    """The cell that one of the `MOVES` leads to, -1 where it is outside or blocked; and what the way there costs."""
    i, j = here % columns + step[0], here // columns + step[1]
    if i < 0 or j < 0 or i >= columns or j >= len(costs) // columns:
        return -1, 0.0
    there = j * columns + i
    if costs[there] == np.inf:
        return -1, 0.0
    length = math.sqrt(float(step[0] * step[0] + step[1] * step[1]))
    return there, length * 0.5 * (costs[here] + costs[there])


@inner_kernel
def walk_back(parents: NDArray[np.int32], begin: int, end: int) -> NDArray[np.int64]:
    """The cells from the first to the last."""
    length, here = 1, end
    while here != begin:
        here = parents[here]
        length += 1
    path = np.empty(length, dtype=np.int64)
    here = end
    for k in range(length - 1, -1, -1):
        path[k] = here
        here = parents[here]
    return path


@inner_kernel
def doubled(values: NDArray[np.generic]) -> NDArray[np.generic]:
    """The values, with as much room again."""
    larger = np.empty(2 * len(values), dtype=values.dtype)
    for i in range(len(values)):
        larger[i] = values[i]
    return larger


@inner_kernel
def heap_push(keys: NDArray[np.float32], cells: NDArray[np.int32], size: int, key: float, cell: int) -> int:
    """Add an entry to a binary heap; returns its new size."""
    i = size
    while i > 0:
        above = (i - 1) >> 1
        if keys[above] <= key:
            break
        keys[i], cells[i] = keys[above], cells[above]
        i = above
    keys[i], cells[i] = key, cell
    return size + 1


@inner_kernel
def heap_pop(keys: NDArray[np.float32], cells: NDArray[np.int32], size: int) -> int:
    """Take the first entry out of a binary heap; returns its new size."""
    size -= 1
    key, cell = keys[size], cells[size]
    i = 0
    while True:
        below = 2 * i + 1
        if below >= size:
            break
        if below + 1 < size and keys[below + 1] < keys[below]:
            below += 1
        if keys[below] >= key:
            break
        keys[i], cells[i] = keys[below], cells[below]
        i = below
    if size > 0:
        keys[i], cells[i] = key, cell
    return size
