"""Compiled nearest neighbours in (x, y): a grid, a k-d tree and brute force.

All three index positions. Nodes at exactly the position of their parent (point turns) share its entry, so that neither
structure degenerates; which of them is extended is drawn by lot (see :mod:`cbrrt_ompl.planners.growth`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cbrrt_ompl.problem.settings import NEAREST_NEIGHBOUR

GRID, KD_TREE, BRUTE_FORCE = 0, 1, 2
"""Kinds of index."""

KINDS = dict(zip(NEAREST_NEIGHBOUR, (GRID, KD_TREE, BRUTE_FORCE), strict=True))
"""Their names in the settings."""


class Index(NamedTuple):
    """Positions that can be searched; node numbers point into ``states``."""

    kind: int
    """`GRID`, `KD_TREE` or `BRUTE_FORCE`."""
    states: NDArray[np.float64]
    """State of each node, (x, y) first, shape (n, 5)."""
    links: NDArray[np.int32]
    """Grid: next node of the cell. k-d tree: left and right child. -1 at the end, shape (n, 2)."""
    heads: NDArray[np.int32]
    """Grid: first node of each cell, -1 where empty, shape (ny, nx)."""
    occupied: NDArray[np.int64]
    """Grid: smallest and largest column, smallest and largest row that hold a node; k-d tree: its depth in [0]; all:
    the number of indexed nodes in [4]; shape (5,)."""
    x_min: float
    """Lower left corner of the grid [m]."""
    y_min: float
    cell: float
    """Side of a cell [m]."""


@njit(cache=True)
def cell_of(index: Index, x: float, y: float) -> tuple[int, int]:
    """Column and row of a position; positions outside fall into the nearest cell."""
    ny, nx = index.heads.shape
    column = int(min(max((x - index.x_min) / index.cell, 0.0), nx - 1.0))
    row = int(min(max((y - index.y_min) / index.cell, 0.0), ny - 1.0))
    return column, row


@njit(cache=True)
def insert(index: Index, node: int) -> None:
    """Add a node whose state is already there."""
    index.links[node, 0] = -1
    index.links[node, 1] = -1
    if index.kind == GRID:
        column, row = cell_of(index, index.states[node, 0], index.states[node, 1])
        index.links[node, 0] = index.heads[row, column]
        index.heads[row, column] = node
        o = index.occupied
        o[0], o[1], o[2], o[3] = min(o[0], column), max(o[1], column), min(o[2], row), max(o[3], row)
    elif index.kind == KD_TREE:
        _insert_into_kd_tree(index, node)
    index.occupied[4] += 1


@njit(cache=True)
def _insert_into_kd_tree(index: Index, node: int) -> None:
    """Hang a node under the leaf where its position belongs; the first node ever is the root, number 0."""
    if index.occupied[4] == 0:
        return
    parent, axis, depth = 0, 0, 1
    while True:
        side = 0 if index.states[node, axis] < index.states[parent, axis] else 1
        child = index.links[parent, side]
        if child < 0:
            index.links[parent, side] = node
            index.occupied[0] = max(index.occupied[0], depth)
            return
        parent, axis, depth = child, 1 - axis, depth + 1


@njit(cache=True)
def is_passed_over(node: int, failures: NDArray[np.int32] | None, limit: float) -> bool:
    """Whether the failures of a node are above a limit; where none are counted, this costs nothing once compiled."""
    return False if failures is None else failures[node] > limit


@njit(cache=True)
def nearest(
    index: Index,
    x: float,
    y: float,
    count: int,
    stack: NDArray[np.float64],
    failures: NDArray[np.int32] | None = None,
    limit: float = 0.0,
) -> int:
    """The indexed node nearest to a position.

    Args:
        index: the index; not empty.
        x: position [m].
        y: position [m].
        count: nodes in the tree, for brute force.
        stack: room for the k-d tree's search, more rows than the tree is deep, shape (m, 3).
        failures: failed extensions from each node, shape (n,); None passes no node over.
        limit: nodes with more failures are passed over.

    Returns:
        Its number, -1 where all are passed over.
    """
    if index.kind == GRID:
        return _nearest_in_grid(index, x, y, failures, limit)
    if index.kind == KD_TREE:
        return _nearest_in_kd_tree(index, x, y, stack, failures, limit)
    best, node = math.inf, -1
    for i in range(count):
        dx, dy = index.states[i, 0] - x, index.states[i, 1] - y
        squared = dx * dx + dy * dy
        if squared < best and not is_passed_over(i, failures, limit):
            best, node = squared, i
    return node


@njit(cache=True)
def _gap(offset: float, cell: int, cells: int, size: float) -> float:
    """Distance along one axis from an offset [m] to a cell; the first and the last reach out to infinity."""
    if cell > 0 and offset < cell * size:
        return cell * size - offset
    if cell < cells - 1 and offset > (cell + 1) * size:
        return offset - (cell + 1) * size
    return 0.0


@njit(cache=True)
def _nearest_in_grid(index: Index, x: float, y: float, failures: NDArray[np.int32] | None, limit: float) -> int:
    """Search the cells in square rings around the position, as far as they hold nodes at all."""
    column, row = cell_of(index, x, y)
    rows, columns = index.heads.shape
    left, right, low, high = index.occupied[0], index.occupied[1], index.occupied[2], index.occupied[3]
    ring = max(0, left - column, column - right, low - row, row - high)
    last_ring = max(abs(left - column), abs(right - column), abs(low - row), abs(high - row))
    x_in_cell = x - index.x_min - column * index.cell
    y_in_cell = y - index.y_min - row * index.cell
    to_edge = min(x_in_cell, index.cell - x_in_cell, y_in_cell, index.cell - y_in_cell)
    best, node = math.inf, -1
    while ring <= last_ring:
        reach = to_edge + (ring - 1) * index.cell  # nothing in this ring is nearer
        if node >= 0 and reach > 0.0 and reach * reach >= best:
            break
        first_row, last_row = max(row - ring, low), min(row + ring, high)
        first_column, last_column = max(column - ring, left), min(column + ring, right)
        for r in range(first_row, last_row + 1):
            is_whole = r == row - ring or r == row + ring
            c = first_column if is_whole or column - ring >= left else column + ring
            y_gap = _gap(y - index.y_min, r, rows, index.cell)
            while c <= last_column:
                x_gap = _gap(x - index.x_min, c, columns, index.cell)
                candidate = index.heads[r, c] if x_gap * x_gap + y_gap * y_gap < best else -1
                while candidate >= 0:
                    dx, dy = index.states[candidate, 0] - x, index.states[candidate, 1] - y
                    squared = dx * dx + dy * dy
                    if squared < best and not is_passed_over(candidate, failures, limit):
                        best, node = squared, candidate
                    candidate = index.links[candidate, 0]
                c += 1 if is_whole or c == column + ring else max(column + ring - c, 1)
        ring += 1
    return node


@njit(cache=True)
def _nearest_in_kd_tree(
    index: Index, x: float, y: float, stack: NDArray[np.float64], failures: NDArray[np.int32] | None, limit: float
) -> int:
    """Search depth first, the nearer side first, leaving out what lies beyond the best so far."""
    best, node = math.inf, -1
    stack[0, 0], stack[0, 1], stack[0, 2] = 0.0, 0.0, 0.0  # node, axis, squared distance of its half plane
    depth = 1
    while depth > 0:
        depth -= 1
        i, axis = int(stack[depth, 0]), int(stack[depth, 1])
        if stack[depth, 2] >= best:
            continue
        while i >= 0:
            dx, dy = index.states[i, 0] - x, index.states[i, 1] - y
            squared = dx * dx + dy * dy
            if squared < best and not is_passed_over(i, failures, limit):
                best, node = squared, i
            offset = dx if axis == 0 else dy
            near, far = (0, 1) if offset > 0.0 else (1, 0)
            if index.links[i, far] >= 0 and offset * offset < best:
                stack[depth, 0], stack[depth, 1] = index.links[i, far], 1 - axis
                stack[depth, 2] = offset * offset
                depth += 1
            i, axis = index.links[i, near], 1 - axis
    return node
