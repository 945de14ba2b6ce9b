"""Grids of occupied, free and unknown cells, and the obstacles that they make.

A grid has the shape (rows, columns). Its first row is the lowest, as in a ROS OccupancyGrid: in the frame of the grid's
lower left corner, the cell in row r and column c covers x from c to c + 1 and y from r to r + 1 times the resolution.
The frame of the corner stands at the origin (x, y, yaw) in the world.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cbrrt_ompl.checks import A_POSITIVE_NUMBER, SMALLEST, is_number
from cbrrt_ompl.collision.pieces import Pieces, join, obstacle_pieces, rectangle_pieces
from cbrrt_ompl.errors import MapError, Problem, Remark
from cbrrt_ompl.kernels import inner_kernel, kernel
from cbrrt_ompl.problem.obstacles import MAX_COORDINATE, Bounds, Box, Obstacle, OrientedBox, Polygon

UNKNOWN, FREE, OCCUPIED = -1, 0, 100
"""What a cell may be, in the numbers of ROS."""

UNKNOWN_CELLS = ("occupied", "free")
"""What unknown cells may count as."""

A_SIDE = f"the side of a cell, {A_POSITIVE_NUMBER} [m]"
"""What the resolution of a grid is to be."""

OCCUPIED_THRESHOLD = 0.65
"""A cell that is more likely occupied than this counts as occupied, unless a map says otherwise."""

FREE_THRESHOLD = 0.196
"""A cell that is less likely occupied than this counts as free; just below the 50/255 of map_saver's unknown."""

MAX_CELLS = 100_000_000
"""Largest map that is read, in cells."""

_SLIVER = 1e-6
"""Corners of a rotated map thinner than this are left out [m]: the walls stand behind them."""

_QUARTER_TOLERANCE = 1e-12
"""A yaw nearer than this to a multiple of a quarter turn is one [rad]."""

_MAX_RUN = 65535
"""Longest run of cells that is told from longer ones; rectangles are no larger."""


def cells_from(
    grid: ArrayLike, occupied_thresh: float = OCCUPIED_THRESHOLD, free_thresh: float = FREE_THRESHOLD
) -> NDArray[np.int8]:
    """Cells of an array of truth values, likelihoods or the numbers of ROS.

    Args:
        grid: shape (rows, columns): bool, or whole numbers 0 and 1; likelihoods from 0 to 1, NaN where unknown; or
            whole numbers from -1 to 100 as in a ROS OccupancyGrid (where all are at most 1, 1 is occupied).
        occupied_thresh: cells more likely occupied than this are occupied.
        free_thresh: cells less likely occupied than this are free, all others unknown.

    Returns:
        ``UNKNOWN``, ``FREE`` or ``OCCUPIED``, shape (rows, columns).

    Raises:
        MapError: if these are no such values.
    """
    values = _rows_and_columns(grid, "grid")
    check_thresholds(occupied_thresh, free_thresh)
    check_cell_count(values.shape, "grid")
    if values.dtype == bool:
        return np.where(values, OCCUPIED, FREE).astype(np.int8)
    if values.dtype.kind not in "iuf":
        raise MapError(Problem("grid", Remark(f"values of type {values.dtype}"), "truth values or numbers"))
    is_whole = values.dtype.kind in "iu"
    low, high = (float(f(values)) for f in (np.nanmin, np.nanmax)) if not np.isnan(values).all() else (0.0, 0.0)
    if is_whole and not (-1 <= low and high <= 100):
        raise MapError(Problem("grid", Remark(f"values from {low:g} to {high:g}"), "whole numbers from -1 to 100"))
    if not is_whole and not (0.0 <= low and high <= 1.0):
        raise MapError(Problem("grid", Remark(f"values from {low:g} to {high:g}"), "likelihoods from 0 to 1, or NaN"))
    scale = 100.0 if is_whole and high > 1 else 1.0
    cells = np.full(values.shape, UNKNOWN, dtype=np.int8)
    cells[values > scale * occupied_thresh] = OCCUPIED
    cells[(values < scale * free_thresh) & (values >= 0)] = FREE
    return cells


def cells_from_costs(costs: ArrayLike, lethal_threshold: int | None = None) -> NDArray[np.int8]:
    """Cells of a Nav2 costmap or of a ROS OccupancyGrid; see :meth:`World.from_costmap`.

    Args:
        costs: whole numbers, shape (rows, columns): 0 to 254 in a costmap, 0 to 100 in an OccupancyGrid; 255 and -1 are
            unknown.
        lethal_threshold: what is occupied, with all above it; 254 or 100 if not given.

    Returns:
        ``UNKNOWN``, ``FREE`` or ``OCCUPIED``, shape (rows, columns).

    Raises:
        MapError: if these are no such values.
    """
    values = _rows_and_columns(costs, "costs")
    if values.dtype.kind not in "iu":
        expected = "whole numbers: a costmap (0 to 254, 255 unknown) or an OccupancyGrid (0 to 100, -1 unknown)"
        raise MapError(Problem("costs", Remark(f"values of type {values.dtype}"), expected))
    check_cell_count(values.shape, "costs")
    low, high = int(values.min()), int(values.max())
    if low < -1 or high > 255:
        expected = "0 to 254 (a costmap) or 0 to 100 (an OccupancyGrid), and 255 or -1 where unknown"
        raise MapError(Problem("costs", Remark(f"values from {low} to {high}"), expected))
    is_costmap = ((values > 100) & (values < 255)).any()
    lethal = 254 if is_costmap else 100
    if lethal_threshold is not None:
        is_whole = isinstance(lethal_threshold, Integral) and not isinstance(lethal_threshold, bool)
        if not is_whole or not 1 <= lethal_threshold <= lethal:
            raise MapError(Problem("lethal_threshold", lethal_threshold, f"a whole number from 1 to {lethal}"))
        lethal = lethal_threshold
    cells = np.where(values >= lethal, OCCUPIED, FREE).astype(np.int8)
    cells[(values == 255) | (values == -1)] = UNKNOWN
    return cells


def _rows_and_columns(values: ArrayLike, name: str) -> NDArray[Any]:
    """Values as an array of two dimensions that is not empty.

    Raises:
        MapError: if they are none, under some name.
    """
    expected = "cells in rows and columns"
    try:
        array: NDArray[Any] = np.asarray(values)
    except ValueError:  # rows of different lengths
        raise MapError(Problem(name, values, expected)) from None
    if array.ndim != 2 or array.size == 0:
        raise MapError(Problem(name, Remark(f"the shape {array.shape}"), expected))
    return array


def blocked_cells(cells: NDArray[np.int8], unknown: str) -> NDArray[np.bool_]:
    """Which cells nobody may enter.

    Args:
        cells: ``UNKNOWN``, ``FREE`` or ``OCCUPIED``, shape (rows, columns).
        unknown: whether unknown cells count as ``occupied`` or ``free``.

    Raises:
        MapError: if ``unknown`` is another word, or no cell is left to be in.
    """
    if not (isinstance(unknown, str) and unknown in UNKNOWN_CELLS):
        raise MapError(Problem("unknown", unknown, f"one of {', '.join(UNKNOWN_CELLS)}"))
    blocked = cells != FREE if unknown == "occupied" else cells == OCCUPIED
    if blocked.all():
        hint = " (unknown cells count as occupied)" if (cells == UNKNOWN).any() else ""
        raise MapError(
            Problem("cells", Remark(f"{cells.shape[1]} x {cells.shape[0]} blocked ones"), f"a free one{hint}")
        )
    return blocked


def covering_rectangles(blocked: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Few rectangles that cover the true cells of a grid and no other; they may overlap.

    Row by row, the first cell not yet covered gets the largest rectangle that has it as a corner and lies above.

    Args:
        blocked: shape (rows, columns).

    Returns:
        First row, first column, last row and last column of each, the last ones exclusive, shape (n, 4).
    """
    blocked = np.ascontiguousarray(blocked, dtype=np.bool_)
    along_row, along_column = _runs(blocked)
    found = np.empty((1 << 16, 4), dtype=np.int32)
    count = _cover(blocked, along_row, along_column, np.zeros_like(blocked), found)
    if count > len(found):
        found = np.empty((count, 4), dtype=np.int32)
        _cover(blocked, along_row, along_column, np.zeros_like(blocked), found)
    return found[:count].copy()


@dataclass(frozen=True, eq=False)
class GridLayer:
    """The obstacles of a grid: boxes that cover its true cells, and what lies outside of it but inside its bounds."""

    blocked: NDArray[np.bool_]
    """Cells that nobody may enter, shape (rows, columns)."""
    resolution: float
    """Side of a cell [m]."""
    origin: tuple[float, float, float]
    """Pose (x, y, yaw) of the lower left corner of the grid, [m, m, rad]."""

    def __post_init__(self) -> None:
        """Check that the grid has a place in the world, and freeze it."""
        check_frame(self.blocked.shape, self.resolution, self.origin)
        blocked = np.array(self.blocked, dtype=np.bool_)
        blocked.setflags(write=False)
        x, y, yaw = (float(value) for value in self.origin)
        object.__setattr__(self, "blocked", blocked)
        object.__setattr__(self, "resolution", float(self.resolution))
        object.__setattr__(self, "origin", (x, y, yaw))

    @property
    def bounds(self) -> Bounds:
        """Smallest bounds that hold the grid."""
        return grid_bounds(self.blocked.shape, self.resolution, self.origin)

    @cached_property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """Boxes where the grid lies along the axes; else oriented boxes and a triangle in each corner of the bounds."""
        is_straight = _quarter_turns(self.origin[2]) is not None
        outer = () if is_straight else _outer_corners(self.blocked.shape, self.resolution, self.origin)
        return (*self.boxes, *outer)

    @property
    def boxes(self) -> tuple[Obstacle, ...]:
        """The obstacles that cover the cells, without what lies outside of the grid."""
        lows, highs = self._rectangles
        if _quarter_turns(self.origin[2]) is not None:
            return tuple(
                Box((x0, y0), (x1, y1)) for (x0, y0), (x1, y1) in zip(lows.tolist(), highs.tolist(), strict=True)
            )
        centers, sizes, yaw = 0.5 * (lows + highs), (highs - lows).tolist(), self.origin[2]
        placed = _in_world(centers, self.origin).tolist()
        return tuple(OrientedBox((x, y), (w, h), yaw) for (x, y), (w, h) in zip(placed, sizes, strict=True))

    @cached_property
    def pieces(self) -> Pieces:
        """The convex pieces of the obstacles, made without them."""
        lows, highs = self._rectangles
        if _quarter_turns(self.origin[2]) is not None:
            return rectangle_pieces(0.5 * (lows + highs), highs - lows)
        rectangles = rectangle_pieces(_in_world(0.5 * (lows + highs), self.origin), highs - lows, self.origin[2])
        corners = obstacle_pieces(_outer_corners(self.blocked.shape, self.resolution, self.origin))
        return join((rectangles, corners))

    @cached_property
    def _rectangles(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lower left and upper right corners, each of shape (n, 2) [m]: in the world, or in a tilted grid."""
        rectangles = covering_rectangles(self.blocked).astype(np.float64) * self.resolution  # (n, 4)
        lows, highs = rectangles[:, 1::-1], rectangles[:, :1:-1]
        if _quarter_turns(self.origin[2]) is None:
            return lows, highs
        a, b = _in_world(lows, self.origin), _in_world(highs, self.origin)
        return np.minimum(a, b), np.maximum(a, b)


def grid_bounds(shape: tuple[int, ...], resolution: float, origin: Sequence[float] = (0.0, 0.0, 0.0)) -> Bounds:
    """Smallest bounds that hold a grid.

    Args:
        shape: rows and columns.
        resolution: side of a cell [m].
        origin: pose (x, y, yaw) of the lower left corner of the grid, [m, m, rad].
    """
    check_frame(shape, resolution, origin)
    corners = grid_corners(shape, resolution, origin)
    (x0, y0), (x1, y1) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    return Bounds((x0, y0), (x1, y1))


def grid_corners(shape: tuple[int, ...], resolution: float, origin: Sequence[float]) -> NDArray[np.float64]:
    """Corners of a grid in the world, counter-clockwise from its origin, shape (4, 2) [m]."""
    width, height = shape[1] * resolution, shape[0] * resolution
    return _in_world(np.array([(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)]), origin)


def check_frame(shape: tuple[int, ...], resolution: float, origin: Sequence[float]) -> None:
    """Check that a grid has a place in the world.

    Raises:
        MapError: with what is wrong with the resolution and the origin.
    """
    problems = []
    if not (is_number(resolution, MAX_COORDINATE) and resolution >= SMALLEST):
        problems.append(Problem("resolution", resolution, A_SIDE))
    pose = origin.tolist() if isinstance(origin, np.ndarray) else origin
    values = list(pose) if isinstance(pose, Sequence) and not isinstance(pose, str) else []
    if len(values) != 3 or not all(is_number(value, MAX_COORDINATE) for value in values):
        problems.append(Problem("origin", origin, "three finite numbers [x, y, yaw] [m, m, rad]"))
    if not problems and np.abs(grid_corners(shape, resolution, values)).max() > MAX_COORDINATE:
        found = Remark(f"{shape[1]} x {shape[0]} cells of {resolution:g} m at {values[:2]}")
        problems.append(Problem("resolution", found, f"a map within {MAX_COORDINATE:g} m of zero"))
    if problems:
        raise MapError(problems)


def check_thresholds(occupied_thresh: float, free_thresh: float) -> None:
    """Check that likelihoods can be told apart by two thresholds.

    Raises:
        MapError: if they are no likelihoods or out of order.
    """
    if not (is_number(occupied_thresh) and is_number(free_thresh) and 0.0 <= free_thresh <= occupied_thresh <= 1.0):
        found = {"free_thresh": free_thresh, "occupied_thresh": occupied_thresh}
        raise MapError(Problem("thresholds", found, "0 <= free_thresh <= occupied_thresh <= 1"))


def check_cell_count(shape: tuple[int, ...], field: str) -> None:
    """Check that a map is not too large to be read.

    Raises:
        MapError: if it has more than ``MAX_CELLS`` cells.
    """
    if shape[0] * shape[1] > MAX_CELLS:
        raise MapError(Problem(field, Remark(f"{shape[1]} x {shape[0]} cells"), f"at most {MAX_CELLS} cells"))


def _quarter_turns(yaw: float) -> int | None:
    """How many quarter turns a yaw is, if it is any whole number of them."""
    turns = round(yaw / (0.5 * math.pi))
    return turns if abs(yaw - turns * 0.5 * math.pi) <= _QUARTER_TOLERANCE else None


def _in_world(points: NDArray[np.float64], origin: Sequence[float]) -> NDArray[np.float64]:
    """Points of a grid's frame in the world, exact for quarter turns, shape (n, 2) [m]."""
    x, y, yaw = (float(value) for value in origin)
    turns = _quarter_turns(yaw)
    c, s = (math.cos(yaw), math.sin(yaw)) if turns is None else [(1, 0), (0, 1), (-1, 0), (0, -1)][turns % 4]
    u, v = points[:, 0], points[:, 1]
    return np.column_stack([x + (c * u - s * v), y + (s * u + c * v)])


def _outer_corners(shape: tuple[int, ...], resolution: float, origin: Sequence[float]) -> list[Polygon]:
    """Triangles between a rotated grid and its bounds, one a side of the grid."""
    corners = grid_corners(shape, resolution, origin)
    triangles = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        along, outward = b - a, np.array([b[1] - a[1], a[0] - b[0]])
        tips = np.array([(a[0], b[1]), (b[0], a[1])])
        tip = tips[np.argmax((tips - a) @ outward)]
        if abs(float(along[0] * along[1])) > _SLIVER * float(np.hypot(*along)):
            triangles.append(Polygon(np.array([b, a, tip])))
    return triangles


@kernel
def _runs(blocked: NDArray[np.bool_]) -> tuple[NDArray[np.uint16], NDArray[np.uint16]]:
    """How many true cells follow each other from every cell on: along its row, and along its column."""
    rows, columns = blocked.shape
    along_row = np.zeros((rows, columns), dtype=np.uint16)
    along_column = np.zeros((rows, columns), dtype=np.uint16)
    for r in range(rows - 1, -1, -1):
        for c in range(columns - 1, -1, -1):
            if blocked[r, c]:
                after = along_row[r, c + 1] if c + 1 < columns else 0
                above = along_column[r + 1, c] if r + 1 < rows else 0
                along_row[r, c] = min(after + 1, _MAX_RUN)
                along_column[r, c] = min(above + 1, _MAX_RUN)
    return along_row, along_column


@kernel
def _cover(
    blocked: NDArray[np.bool_],
    along_row: NDArray[np.uint16],
    along_column: NDArray[np.uint16],
    covered: NDArray[np.bool_],
    found: NDArray[np.int32],
) -> int:
    """Greedy cover of the true cells, see :func:`covering_rectangles`; loops only, which compile in half a second.

    Args:
        blocked: shape (rows, columns).
        along_row: runs of true cells, as from :func:`_runs`.
        along_column: runs of true cells, as from :func:`_runs`.
        covered: all false; which cells the rectangles cover afterwards.
        found: filled with the rectangles as far as there is room, shape (n, 4).

    Returns:
        How many rectangles there are.
    """
    rows, columns = blocked.shape
    n = 0
    for r in range(rows):
        for c in range(columns):
            if not blocked[r, c] or covered[r, c]:
                continue
            height, width = _largest_above(along_row, along_column, r, c)
            for row in range(r, r + height):  # all rows below are covered already
                for column in range(c, c + width):
                    covered[row, column] = True
            if n < len(found):
                found[n, 0], found[n, 1], found[n, 2], found[n, 3] = r, c, r + height, c + width
            n += 1
    return n


@inner_kernel
def _largest_above(along_row: NDArray[np.uint16], along_column: NDArray[np.uint16], r: int, c: int) -> tuple[int, int]:
    """Height and width of the largest rectangle of true cells with its lower left corner in a cell."""
    tallest = int(along_column[r, c])
    width = int(along_row[r, c])
    best_height, best_width = 1, width
    for h in range(2, tallest + 1):
        width = min(width, int(along_row[r + h - 1, c]))
        if width * h > best_height * best_width:
            best_height, best_width = h, width
        if width * tallest <= best_height * best_width:
            break
    return best_height, best_width
