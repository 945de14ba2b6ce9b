"""Which pieces can be nearest to a footprint, by where it is: quadtrees whose leaves hold short lists.

The distance of a point from a piece is 1-Lipschitz. In a cell whose corners are r away from its centre, and where the
nearest piece is d away from the centre, a piece further than d + 2 r + outer - inner cannot be the one nearest to a
footprint that lies in a disc of radius outer and holds one of radius inner about the same point of the cell.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.collision.distances import point_piece
from cbrrt_ompl.collision.pieces import Pieces
from cbrrt_ompl.kernels import inner_kernel, kernel
from cbrrt_ompl.motion.records import Record, Records, as_records, copied_records, record_array

CELL = np.dtype(
    [
        ("x", np.float64),  # centre [m]
        ("y", np.float64),
        ("clearance", np.float64),  # distance of the centre from the nearest piece, negative inside one [m]
        ("child", np.int32),  # row of the first of its four children; 0 at a leaf
        ("first", np.int32),  # leaf: the first entry of its list
        ("count", np.int32),  # leaf: how many pieces it has
    ],
    align=True,
)
"""A square; its children follow each other: left below, right below, left above, right above."""

SQUARE = np.dtype(
    [
        ("x", np.float64),  # middle [m]
        ("y", np.float64),
        ("clearance", np.float64),  # distance of the middle of the square around it from the nearest piece [m]
        ("level", np.int64),  # how often the whole was halved
        ("column", np.int64),  # in the level's grid; below the root cells the row of its cell
        ("row", np.int64),
        ("first", np.int64),  # candidates: its first
        ("count", np.int64),  # how many it has
    ],
    align=True,
)
"""A square that waits to be made a leaf or split."""

MOST_SQUARES = 512
"""Squares that wait at once: three for every level, of which doubles have no more than these."""

LONG_LIST, LONG_LIST_OF_MANY = 4, 8
"""Lists up to this length are not worth shortening: among few pieces, and among many, whose index takes its time."""

MANY = 500
"""More pieces than these are many."""

FINEST = 0.08
"""Cells are split while a circle around their children is larger than this [m]."""

FINEST_OF_SLACK = 0.25
"""The same as a fraction of what the footprint's discs differ by: finer cells have the same lists."""

COARSEST = 0.4
"""Cells far from everything are split while a circle around them is larger than this [m]..."""

GOOD_BOUND = 0.5
"""... and than this fraction of the distance of their centre from everything."""

SLACK = 1e-9
"""What covers the rounding of distances, as a fraction of the size of the world."""

MOST_LISTED = 1_000_000
"""Entries of all lists together, and eight for every piece, after which nothing is split any more: 64 MB."""

MOST_ROOTS = 8
"""Levels of root cells at most: 256 x 256."""


def build_index(world: Pieces, frame: Record) -> tuple[Records, NDArray[np.int32], int]:
    """Quadtrees over a square that holds the bounds.

    Args:
        world: pieces of the footprint, then those of the obstacles.
        frame: bounds and footprint, a record of type :data:`cbrrt_ompl.collision.scene.FRAME` without the roots.

    Returns:
        The cells, records of type `CELL`; the rows of the pieces in the lists of the leaves; and the number of root
        cells along a side of the square.
    """
    obstacles = len(world.pieces) - frame["parts"]
    is_large = obstacles > MANY
    levels = min(MOST_ROOTS, (1 if is_large else 2) + math.ceil(0.5 * math.log2(obstacles + 1.0)))
    side = side_of(frame)
    middle = 0.5 * (frame["x_min"] + frame["x_min"] + side), 0.5 * (frame["y_min"] + frame["y_min"] + side)
    room = 4 * (4**levels + 4 * obstacles)
    while True:
        cells, listed = record_array(room, CELL), np.empty(room, dtype=np.int32)
        candidates, distances = np.empty(room, dtype=np.int32), np.empty(room)
        candidates[:obstacles], distances[:obstacles] = np.arange(frame["parts"], len(world.pieces)), -math.inf
        squares = record_array(MOST_SQUARES, SQUARE)
        squares[0] = (*middle, math.inf, 0, 0, 0, 0, obstacles)
        used, count = _build(
            as_records(world.pieces),
            as_records(world.corners),
            frame,
            side,
            levels,
            LONG_LIST_OF_MANY if is_large else LONG_LIST,
            cells,
            listed,
            squares,
            candidates,
            distances,
        )
        if used > 0:
            return copied_records(cells[:used]), listed[:count].copy(), 2**levels
        room *= 4


def side_of(frame: Record) -> float:
    """Side of the square over the bounds [m]."""
    return float(max(frame["x_max"] - frame["x_min"], frame["y_max"] - frame["y_min"]))


@kernel
def _build(
    pieces: Records,
    corners: Records,
    frame: Record,
    side_of_all: float,
    levels: int,
    long_list: int,
    cells: Records,
    listed: NDArray[np.int32],
    squares: Records,
    candidates: NDArray[np.int32],
    distances: NDArray[np.float64],
) -> tuple[int, int]:
    """Split squares depth first; the candidates of each lie behind those of the square which it is a part of.

    Args:
        pieces: all pieces.
        corners: what polygons among them refer to.
        frame: see :func:`build_index`.
        side_of_all: of the whole [m].
        levels: above the root cells.
        long_list: length up to which lists are not worth shortening.
        cells: room for the cells, zeros.
        listed: room for the numbers of the pieces in the lists of the leaves.
        squares: room for squares that wait, the first of which is the whole; records of type `SQUARE`.
        candidates: room for the numbers of pieces, the first of which are those that are near the whole.
        distances: as much room for their distances from the middles of their squares [m].

    Returns:
        How many cells and entries of lists there are; (0, 0) where they need more room.
    """
    roots, slack = 1 << levels, SLACK * side_of_all
    finest = max(FINEST, FINEST_OF_SLACK * (frame.outer - frame.inner))
    used, count = roots * roots, 0
    waiting = 1
    while waiting > 0:
        waiting -= 1
        square = squares[waiting]
        level, column, row, x, y = square.level, square.column, square.row, square.x, square.y
        side = side_of_all / (1 << level)
        radius = math.sqrt(0.5) * side
        if x + radius < frame.x_min or x - radius > frame.x_max or y + radius < frame.y_min or y - radius > frame.y_max:
            continue
        first, start = square.first, square.first + square.count
        if start + square.count > len(candidates) or count + square.count > len(listed) or used + 4 > len(cells):
            return 0, 0
        # A piece is as far from here as from the middle of the square around, give or take the radius.
        spread = 2.0 * radius + frame.outer - frame.inner + slack
        limit = square.clearance + radius + spread
        nearest = math.inf
        found = best = start
        for k in range(first, start):
            if distances[k] - radius <= limit:
                distance = point_piece(x, y, pieces[candidates[k]], corners)
                if distance < nearest:
                    nearest, best = distance, found
                    limit = min(limit, nearest + spread)
                if distance <= limit:
                    candidates[found], distances[found] = candidates[k], distance
                    found += 1
        if start < best < found:  # to the front, where it soon rules out others in the parts of the square
            candidates[start], candidates[best] = candidates[best], candidates[start]
            distances[start], distances[best] = distances[best], distances[start]
        if nearest + radius + slack < frame.inner:  # all of the square is in collision with the nearest
            limit = nearest
        end = start
        for k in range(start, found):
            if distances[k] <= limit:
                candidates[end], distances[end] = candidates[k], distances[k]
                end += 1
        is_full = count > MOST_LISTED + 8 * len(pieces)
        if is_full or not _is_worth_splitting(frame, finest, long_list, nearest, radius, end - start):
            for k in range(start, end):
                listed[count + k - start] = candidates[k]
            width = 1 << max(levels - level, 0)  # root cells that this leaf stands for
            for above in range(width):
                for right in range(width):
                    cell = column if level > levels else (row * width + above) * roots + column * width + right
                    cells[cell].x, cells[cell].y, cells[cell].clearance = x, y, nearest
                    cells[cell].first, cells[cell].count = count, end - start
            count += end - start
            continue
        child = 0
        if level >= levels:
            cell = row * roots + column if level == levels else column
            cells[cell].x, cells[cell].y, cells[cell].clearance, cells[cell].child = x, y, nearest, used
            child = used
            used += 4
        for quarter in range(4):
            right, above = quarter & 1, quarter >> 1
            part = squares[waiting]
            part.level, part.first, part.count, part.clearance = level + 1, start, end - start, nearest
            part.column, part.row = (child + quarter, 0) if child > 0 else (2 * column + right, 2 * row + above)
            part.x, part.y = x + (0.5 * right - 0.25) * side, y + (0.5 * above - 0.25) * side
            waiting += 1
    return used, count


@inner_kernel
def _is_worth_splitting(
    frame: Record, finest: float, long_list: int, clearance: float, radius: float, length: int
) -> bool:
    """Whether the children of a cell answer faster than the cell.

    Args:
        frame: see :func:`build_index`.
        finest: radius down to which cells are split [m].
        long_list: see :func:`_build`.
        clearance: distance of its centre from everything [m].
        radius: of the circle around it [m].
        length: pieces in its list.
    """
    if length == 0 or clearance + radius < frame.inner:
        return False
    room = clearance - frame.outer
    if radius > room:  # somewhere in the cell pieces have to be looked at
        return length > long_list and 0.5 * radius > finest
    return radius > GOOD_BOUND * room and radius > COARSEST
