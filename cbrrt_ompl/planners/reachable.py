"""Where samples are worth drawing: cells that the robot may get to from where it starts."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.collision.clearance import leaf_at, wall_distance
from cbrrt_ompl.collision.distances import point_piece
from cbrrt_ompl.collision.scene import Scene
from cbrrt_ompl.kernels import inner_kernel, kernel
from cbrrt_ompl.motion.records import Record
from cbrrt_ompl.problem.settings import State

COARSE = 8
"""Places a side at which a cell is looked at, at first; halved while there are few cells."""

MOST_CELLS = 4_000
"""Where more cells than these are reached, samples are drawn everywhere: a millisecond's work."""

MOST_IN_GRID = 4_000_000
"""Cells of the whole grid at most."""

WORTH_IT = 0.5
"""Fraction of the bounds above which samples are drawn everywhere."""

REACHED, CLOSED = 1, 2
"""States of cells that have been looked at."""


class ReachableCells:
    """The cells of a grid over the bounds that are connected to the starts by cells without certain collision."""

    def __init__(self, reached: NDArray[np.bool_]) -> None:
        """The cells that are true, of an array of shape (rows, columns)."""
        self._rows, self._columns = np.nonzero(reached)
        self._shape = reached.shape

    def place(self, draws: NDArray[np.float64]) -> NDArray[np.float64]:
        """Random positions in the cells from random numbers.

        Args:
            draws: independent, uniform in [0, 1), shape (n, 2).

        Returns:
            Uniform over the cells, as fractions of the sides of the bounds (x, y), shape (n, 2).
        """
        scaled = draws[:, 0] * len(self._rows)
        cells = scaled.astype(np.int64)
        x = (self._columns[cells] + (scaled - cells)) / self._shape[1]
        return np.column_stack([x, (self._rows[cells] + draws[:, 1]) / self._shape[0]])


def reachable_cells(scene: Scene, starts: Sequence[State]) -> ReachableCells | None:
    """The cells that a robot may reach; None where that would not be worth it.

    The disc inside the footprint, about its centre, gets from cell to cell unless it is in collision wherever in a cell
    it may be; the robot's origin gets as far around it as it is away from that centre. A point gets anywhere.

    Args:
        scene: world and footprint.
        starts: where the robot is.
    """
    frame = scene.frame[0]
    if not frame["inner"] > 0.0:
        return None
    corner, far = np.array([frame["y_min"], frame["x_min"]]), np.array([frame["y_max"], frame["x_max"]])
    centers = np.array([_center(frame, start)[::-1] for start in starts])  # (n, 2)
    places, found, reached = COARSE, 0, None
    while places > 0 and 16 * found <= MOST_CELLS:
        shape = np.ceil((far - corner) / (frame["inner"] * places))
        if shape.prod() > MOST_IN_GRID:
            break
        cells = np.clip((centers - corner) / (far - corner) * shape, 0, shape - 1).astype(np.int64)
        states = np.zeros(shape.astype(int), dtype=np.int8)
        if not spread(scene, places, cells, states, np.empty((MOST_CELLS, 2), dtype=np.int64)):
            break
        reached = _widened(states == REACHED, math.ceil(frame["center_distance"] / ((far - corner) / shape).min()))
        found = int(np.count_nonzero(reached))
        if found > WORTH_IT * reached.size:
            return None
        places //= 2
    return None if reached is None else ReachableCells(reached)


def _center(frame: Record, state: State) -> tuple[float, float]:
    """Where the centre of the footprint is [m]."""
    c, s = math.cos(state.theta), math.sin(state.theta)
    x, y = frame["center_x"], frame["center_y"]
    return state.x + (c * x - s * y), state.y + (s * x + c * y)


def _widened(cells: NDArray[np.bool_], width: int) -> NDArray[np.bool_]:
    """Cells, and those up to some rows and columns away."""
    for axis in (0, 1):
        padded = np.pad(cells, [(width, width) if axis == a else (0, 0) for a in (0, 1)])
        cells = np.any(np.lib.stride_tricks.sliding_window_view(padded, 2 * width + 1, axis=axis), axis=-1)
    return cells


@kernel
def spread(
    scene: Scene,
    places: int,
    starts: NDArray[np.int64],
    states: NDArray[np.int8],
    waiting: NDArray[np.int64],
) -> bool:
    """Reach cells from their eight neighbours, beginning with those of the starts.

    Args:
        scene: world and footprint.
        places: so many times so many in a cell are looked at, the radius of the disc inside the footprint apart.
        starts: rows and columns, shape (n, 2).
        states: zeros; afterwards `REACHED`, `CLOSED` or 0, shape (rows, columns).
        waiting: room for the rows and columns of the most cells that are to be reached.

    Returns:
        Whether there was room.
    """
    rows, columns = states.shape
    if len(starts) > len(waiting):
        return False
    count = 0
    for k in range(len(starts)):
        if states[starts[k, 0], starts[k, 1]] != REACHED:
            states[starts[k, 0], starts[k, 1]] = REACHED
            waiting[count, 0], waiting[count, 1] = starts[k, 0], starts[k, 1]
            count += 1
    done = 0
    while done < count:
        row, column = waiting[done, 0], waiting[done, 1]
        done += 1
        for r in range(max(row - 1, 0), min(row + 2, rows)):
            for c in range(max(column - 1, 0), min(column + 2, columns)):
                if states[r, c] != 0:
                    continue
                states[r, c] = CLOSED
                if _has_room(scene, places, c / columns, r / rows, rows, columns):
                    if count == len(waiting):
                        return False
                    states[r, c] = REACHED
                    waiting[count, 0], waiting[count, 1] = r, c
                    count += 1
    return True


@inner_kernel
def _has_room(scene: Scene, places: int, across: float, up: float, rows: int, columns: int) -> bool:
    """Whether the disc inside the footprint may have room with its centre in a cell.

    Args:
        scene: world and footprint.
        places: see :func:`spread`.
        across: where the cell begins, as a fraction of the bounds.
        up: see above.
        rows: of the grid.
        columns: of the grid.
    """
    frame = scene.frame[0]
    width, height = frame.x_max - frame.x_min, frame.y_max - frame.y_min
    step_x, step_y = width / (columns * places), height / (rows * places)
    needed = frame.inner - 0.5 * math.hypot(step_x, step_y)  # at the middle of the square around a place
    for i in range(places):
        y = frame.y_min + up * height + (i + 0.5) * step_y
        for j in range(places):
            x = frame.x_min + across * width + (j + 0.5) * step_x
            if wall_distance(frame, x, y) < needed:
                continue
            cell = scene.cells[leaf_at(scene, x, y)]
            is_free = True
            for k in range(cell.first, cell.first + cell.count):
                if point_piece(x, y, scene.pieces[scene.lists[k]], scene.corners) < needed:
                    is_free = False
                    break
            if is_free:
                return True
    return False
