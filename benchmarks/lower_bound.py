"""A duration that no trajectory can be below: of the shortest path of a disc inside the robot, at full speed.

The disc is the largest one about the robot's origin inside its footprint. A cell of a fine grid is blocked where the
disc certainly touches something with its centre anywhere in the cell: where the distance of the cell's centre from
everything is below the disc's radius less half the cell's diagonal. All else counts as free, cells within the goal's
tolerance included. The shortest path through the free cells runs along straight lines between corners of blocked ones,
so that a search on their visibility graph (A*) finds it exactly; no path of the robot into the goal region is shorter
than that path less the goal's tolerance. The time for its length takes the largest speed and acceleration, without any
turn: from the start's speed, and to rest where the goal asks for it.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cbrrt_ompl import Scenario, World
from cbrrt_ompl.optimise.field import distance_at, field_of

ROUNDING = 1e-6
"""Fraction of a cell by which a line of sight may run inside a blocked one."""


def shortest_duration(scenario: Scenario, cell: float = 0.05) -> float:
    """A true lower bound on the duration of any trajectory of a scenario [s].

    Args:
        scenario: what to plan.
        cell: side of the grid's cells [m].
    """
    limits, goal = scenario.robot.limits, scenario.goal
    v_top = min(max(limits.v_max, -limits.v_min), limits.wheel_speed)
    a = min(limits.acceleration, limits.wheel_acceleration)
    end = None if goal.speed_tolerance is None else min(goal.speed_tolerance, v_top)
    return shortest_time(shortest_length(scenario, cell), abs(scenario.start.v), end, v_top, a)


def shortest_time(length: float, v_start: float, v_end: float | None, v_top: float, a: float) -> float:
    """Least time for a straight way, from one speed to another at most (None: any), [m, m/s, m/s^2] to [s]."""
    last = v_top if v_end is None else v_end
    peak = math.sqrt(max(a * length + 0.5 * (v_start**2 + last**2), 0.0)) if v_end is not None else math.inf
    peak = min(v_top, peak, math.sqrt(v_start**2 + 2.0 * a * length))
    last = peak if v_end is None else min(last, peak)
    ramps = max(peak**2 - v_start**2, 0.0) / (2.0 * a) + (peak**2 - last**2) / (2.0 * a)
    times = max(peak - v_start, 0.0) / a + (peak - last) / a
    return times + max(length - ramps, 0.0) / v_top


def shortest_length(scenario: Scenario, cell: float = 0.05) -> float:
    """A true lower bound on the path length of any trajectory of a scenario [m].

    Args:
        scenario: what to plan.
        cell: side of the grid's cells [m].
    """
    start, goal = scenario.start, scenario.goal
    blocked = certainly_blocked(scenario.world, scenario.robot.footprint.inscribed_radius, cell)
    (x_min, y_min), (rows, columns) = scenario.world.bounds.min, blocked.shape
    x, y = x_min + cell * (np.arange(columns) + 0.5), y_min + cell * (np.arange(rows) + 0.5)
    near = np.hypot(x - goal.x, (y - goal.y)[:, None]) <= goal.tolerance + cell
    near |= np.hypot(x - start.x, (y - start.y)[:, None]) <= cell
    blocked[near] = False
    ends = (np.array([(start.x, start.y), (goal.x, goal.y)]) - (x_min, y_min)) / cell  # (2, 2) in cells
    points = np.concatenate([ends, convex_corners(blocked)])
    return max(0.0, cell * visibility_distance(points, blocked) - goal.tolerance)


def certainly_blocked(world: World, radius: float, cell: float) -> NDArray[np.bool_]:
    """Cells in which no point is a free centre of a disc, shape (rows, columns)."""
    width, height = world.bounds.size
    shape = math.ceil(height / cell), math.ceil(width / cell)
    return _blocked(*field_of(world), world.bounds.min, cell, shape, radius - cell * math.sqrt(0.5))


def convex_corners(blocked: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Corners of blocked cells that a path may bend around, rows of (column, row), shape (n, 2)."""
    padded = np.pad(blocked, 1)
    a, b, c, d = padded[:-1, :-1], padded[:-1, 1:], padded[1:, :-1], padded[1:, 1:]
    count = a.astype(int) + b + c + d
    rows, columns = np.nonzero((count == 1) | ((count == 2) & (a == d)))
    return np.column_stack([columns, rows]).astype(float)


@njit(cache=True)
def _blocked(grid, distances, corner, cell, shape, least):  # type: ignore[no-untyped-def]
    blocked = np.zeros(shape, dtype=np.bool_)
    for j in range(shape[0]):
        for i in range(shape[1]):
            x, y = corner[0] + (i + 0.5) * cell, corner[1] + (j + 0.5) * cell
            blocked[j, i] = distance_at(grid, distances, x, y) < least - 1e-3  # what the field may be wrong by
    return blocked


@njit(cache=True)
def sees(blocked, x0, y0, x1, y1):  # type: ignore[no-untyped-def]
    """Whether a straight line passes through the inside of no blocked cell, all in cells."""
    if x1 < x0:
        x0, y0, x1, y1 = x1, y1, x0, y0
    rows, columns = blocked.shape
    slope = (y1 - y0) / (x1 - x0) if x1 > x0 else 0.0
    first, last = int(math.floor(x0 + ROUNDING)), int(math.ceil(x1 - ROUNDING))
    for i in range(max(first, 0), min(last, columns)):
        left, right = max(float(i), x0), min(float(i + 1), x1)
        ya, yb = y0 + slope * (left - x0), y0 + slope * (right - x0)
        low, high = min(ya, yb), max(ya, yb)
        for j in range(max(int(math.floor(low + ROUNDING)), 0), min(int(math.ceil(high - ROUNDING)), rows)):
            if blocked[j, i]:
                return False
    return True


@njit(cache=True)
def visibility_distance(points, blocked):  # type: ignore[no-untyped-def]
    """Shortest way from the first point to the second over points that see each other, in cells; infinite if none."""
    count = len(points)
    best, is_done = np.full(count, np.inf), np.zeros(count, dtype=np.bool_)
    best[0] = 0.0
    while True:
        here, least = -1, np.inf
        for k in range(count):
            if not is_done[k]:
                bound = best[k] + math.hypot(points[k, 0] - points[1, 0], points[k, 1] - points[1, 1])
                if bound < least:
                    here, least = k, bound
        if here < 0 or here == 1:
            return best[1]
        is_done[here] = True
        for k in range(count):
            if is_done[k]:
                continue
            reached = best[here] + math.hypot(points[k, 0] - points[here, 0], points[k, 1] - points[here, 1])
            left = math.hypot(points[k, 0] - points[1, 0], points[k, 1] - points[1, 1])
            if reached < best[k] and reached + left < best[1]:
                if sees(blocked, points[here, 0], points[here, 1], points[k, 0], points[k, 1]):
                    best[k] = reached
