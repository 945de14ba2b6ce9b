"""Which pieces can be nearest to a footprint, by where it is: quadtrees whose leaves hold short lists.

The distance of a point from a piece is 1-Lipschitz. In a cell whose corners are r away from its centre, and where the
nearest piece is d away from the centre, a piece further than d + 2 r + outer - inner cannot be the one nearest to a
footprint that lies in a disc of radius outer and holds one of radius inner about the same point of the cell.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cbrrt_ompl.collision.distances import point_piece
from cbrrt_ompl.collision.pieces import Pieces
from cbrrt_ompl.motion.records import Records, as_records, record_allocator
from cbrrt_ompl.problem.obstacles import Bounds

CELL = np.dtype(
    [
        ("x", np.float64),  # centre [m]
        ("y", np.float64),
        ("clearance", np.float64),  # distance of the centre from the nearest piece, negative inside one [m]
        ("child", np.int32),  # row of the first of its four children; 0 at a leaf
        ("first", np.int32),  # leaf: its first piece
        ("count", np.int32),  # leaf: how many pieces it has
        ("unused", np.int32),
    ],
    align=True,
)
"""A square; its children follow each other: left below, right below, left above, right above."""

LONG_LIST = 3
"""Lists up to this length are not worth shortening."""

FINEST = 0.08
"""Cells are split while a circle around their children is larger than this [m]."""

FINEST_OF_SLACK = 0.25
"""The same as a fraction of what the footprint's discs differ by: finer cells have the same lists."""

COARSEST = 0.25
"""Cells far from everything are split while a circle around them is larger than this [m]..."""

GOOD_BOUND = 0.5
"""... and than this fraction of the distance of their centre from everything."""

SLACK = 1e-9
"""What covers the rounding of distances, as a fraction of the size of the world."""

MOST_LISTED = 1_000_000
"""Entries of all lists together, and eight for every piece, after which nothing is split any more: 64 MB."""

MOST_ROOTS = 8
"""Levels of root cells at most: 256 x 256."""


def build_index(
    world: Pieces,
    parts: int,
    bounds: Bounds,
    middle: tuple[float, float],
    side: float,
    outer: float,
    inner: float,
) -> tuple[Records, Records, int]:
    """Quadtrees over a square that holds the bounds.

    Args:
        world: pieces of the footprint, then those of the obstacles.
        parts: how many of the pieces belong to the footprint.
        bounds: the walls.
        middle: centre of the square [m].
        side: of the square [m].
        outer: radius of a disc that holds the footprint [m].
        inner: radius of a disc about the same centre that the footprint holds [m].

    Returns:
        The cells, records of type `CELL`; the pieces of the footprint and then those of the leaves; and the number of
        root cells along a side of the square.
    """
    obstacles = len(world.pieces) - parts
    levels = min(MOST_ROOTS, 2 + math.ceil(0.5 * math.log2(obstacles + 1.0)))
    finest = max(FINEST, FINEST_OF_SLACK * (outer - inner))
    box = (*bounds.min, *bounds.max)
    cells, listed = _build(
        as_records(world.pieces),
        as_records(world.corners),
        parts,
        (*middle, side),
        box,
        levels,
        outer,
        inner,
        finest,
        SLACK * side,
    )
    return cells, np.concatenate([world.pieces[:parts], world.pieces[listed]]), 2**levels


_new_cells = record_allocator(CELL)


@njit(cache=True)
def _build(
    pieces: Records,
    corners: Records,
    parts: int,
    square: tuple[float, float, float],
    box: tuple[float, float, float, float],
    levels: int,
    outer: float,
    inner: float,
    finest: float,
    slack: float,
) -> tuple[Records, NDArray[np.int32]]:
    """Split squares depth first; the list of each lies behind that of the square which it is a part of.

    Args:
        pieces: all pieces.
        corners: what polygons among them refer to.
        parts: pieces of the footprint, which are in no list.
        square: centre and side of the whole [m].
        box: bounds; squares outside of them are left empty [m].
        levels: levels above the root cells.
        outer: see :func:`build_index`.
        inner: see :func:`build_index`.
        finest: radius down to which cells are split [m].
        slack: added to all distances for rounding [m].

    Returns:
        The cells, and the numbers of the pieces in their lists.
    """
    roots = 1 << levels
    cells = _new_cells(max(2 * roots * roots, 64))
    used = roots * roots
    waiting = np.empty((4 * (levels + 64), 7))  # level, column and row or cell, centre, the list of its parent
    candidates: NDArray[np.int32] = np.empty(max(64, 8 * len(pieces)), dtype=np.int32)
    distances = np.empty(len(pieces))
    listed: NDArray[np.int32] = np.empty(max(64, 4 * len(pieces)), dtype=np.int32)
    count = 0
    for i in range(parts, len(pieces)):
        candidates[i - parts] = i
    waiting[0, 0], waiting[0, 1], waiting[0, 2] = 0.0, 0.0, 0.0
    waiting[0, 3], waiting[0, 4], waiting[0, 5], waiting[0, 6] = square[0], square[1], 0.0, len(pieces) - parts
    depth = 1
    while depth > 0:
        depth -= 1
        level, x, y = int(waiting[depth, 0]), waiting[depth, 3], waiting[depth, 4]
        column, row = int(waiting[depth, 1]), int(waiting[depth, 2])
        first, length = int(waiting[depth, 5]), int(waiting[depth, 6])
        side = square[2] / 2.0**level
        radius = math.sqrt(0.5) * side
        if x + radius < box[0] or x - radius > box[2] or y + radius < box[1] or y - radius > box[3]:
            continue
        nearest = math.inf
        for k in range(length):
            distances[k] = point_piece(x, y, pieces[candidates[first + k]], corners)
            nearest = min(nearest, distances[k])
        limit = nearest + 2.0 * radius + outer - inner + slack
        if nearest + radius + slack < inner:  # all of the cell is in collision with the nearest
            limit = nearest
        kept, start = 0, first + length
        if start + length > len(candidates):
            candidates = np.concatenate((candidates, np.empty(len(candidates) + length, dtype=np.int32)))
        for k in range(length):
            if distances[k] <= limit:
                candidates[start + kept] = candidates[first + k]
                kept += 1
        is_full = count > MOST_LISTED + 8 * len(pieces)
        if is_full or not _is_worth_splitting(nearest, radius, kept, outer, inner, finest):
            if count + kept > len(listed):
                listed = np.concatenate((listed, np.empty(len(listed) + kept, dtype=np.int32)))
            for k in range(kept):
                listed[count + k] = candidates[start + k]
            width = 1 << max(levels - level, 0)  # root cells that this leaf stands for
            for above in range(width):
                for right in range(width):
                    cell = column if level > levels else (row * width + above) * roots + column * width + right
                    cells[cell].x, cells[cell].y, cells[cell].clearance = x, y, nearest
                    cells[cell].first, cells[cell].count = parts + count, kept
            count += kept
            continue
        children = -1
        if level >= levels:
            cell = row * roots + column if level == levels else column
            cells[cell].x, cells[cell].y, cells[cell].clearance = x, y, nearest
            if used + 4 > len(cells):
                more = _new_cells(2 * len(cells))
                more[: len(cells)] = cells
                cells = more
            children = cells[cell].child = used
            used += 4
        for child in range(4):
            right, above = child & 1, child >> 1
            if level < levels:
                waiting[depth, 1], waiting[depth, 2] = 2 * column + right, 2 * row + above
            else:
                waiting[depth, 1], waiting[depth, 2] = children + child, 0
            waiting[depth, 0] = level + 1
            waiting[depth, 3] = x + (0.25 if right else -0.25) * side
            waiting[depth, 4] = y + (0.25 if above else -0.25) * side
            waiting[depth, 5], waiting[depth, 6] = start, kept
            depth += 1
    return cells[:used].copy(), listed[:count].copy()


@njit(cache=True)
def _is_worth_splitting(
    clearance: float, radius: float, length: int, outer: float, inner: float, finest: float
) -> bool:
    """Whether the children of a cell answer faster than the cell.

    Args:
        clearance: distance of its centre from everything [m].
        radius: of the circle around it [m].
        length: pieces in its list.
        outer: see :func:`build_index`.
        inner: see :func:`build_index`.
        finest: see :func:`_build`.
    """
    if length == 0 or clearance + radius < inner:
        return False
    room = clearance - outer
    if radius > room:  # somewhere in the cell pieces have to be looked at
        return length > LONG_LIST and 0.5 * radius > finest
    return radius > GOOD_BOUND * room and radius > COARSEST
