"""Guesses that need no planner: along the geodesic, the robot driving ahead or backwards."""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.optimise.clearance import least_clearance
from cbrrt_ompl.optimise.field import field_of
from cbrrt_ompl.optimise.geodesic import cell_costs, shortest_path
from cbrrt_ompl.optimise.guess import Guess, guess_from_path
from cbrrt_ompl.problem.obstacles import Bounds
from cbrrt_ompl.problem.robot import Footprint
from cbrrt_ompl.scenario.scenario import Scenario

MOST_CELLS = 400_000
"""Cells of the grid for the geodesic, at most."""

LARGEST_CELL, SMALLEST_CELL = 0.1, 0.05
"""Range of the side of a cell [m], as far as `MOST_CELLS` allows."""

LEAST_ROOM = 1.15
"""Room beside a path in cells, at least: the longest step, sqrt(5) cells, does not lead through a thin wall then."""

SPACING = 0.1
"""Distance of the points of a path before it is smoothed [m]."""

MOST_POINTS = 20_000
"""Points of a smoothed path at most: they are farther apart along one of more than 2 km."""

SMOOTHINGS = 10
"""Times that each point is replaced by a mean with its neighbours."""

AVOIDANCE = 3.0
"""How much more a metre costs near a path that is to be avoided."""

AHEAD, BACKWARDS = 1, -1
"""Gears."""


def geodesic(scenario: Scenario, avoid: Sequence[NDArray[np.float64]] = ()) -> NDArray[np.float64] | None:
    """A short path from the start to the goal for the robot's origin.

    Cells nearer to anything than the robot is wide to either side are avoided, and where that leaves no path, those
    nearer than its inscribed radius.

    Args:
        scenario: world, robot, start and goal.
        avoid: paths of former calls: near them, but for their ends, a metre costs `AVOIDANCE` times as much for each.

    Returns:
        Points of the path, shape (n, 2) [m]; None where the grid has none.
    """
    footprint, margin = scenario.robot.footprint, least_clearance(scenario)
    for inner in dict.fromkeys((lateral_extent(footprint), footprint.inscribed_radius)):
        path = _shortest_path(scenario, inner + margin, footprint.circumscribed_radius + margin + 0.02, avoid)
        if path is not None:
            return path
    return None


def lateral_extent(footprint: Footprint) -> float:
    """How far the footprint reaches to either side of a line that it drives along [m]."""
    return footprint.radius if footprint.vertices is None else float(np.abs(footprint.vertices[:, 1]).max())


def _shortest_path(
    scenario: Scenario, inner: float, outer: float, avoid: Sequence[NDArray[np.float64]]
) -> NDArray[np.float64] | None:
    bounds = scenario.world.bounds
    cell = cell_side(bounds, inner)
    inner, outer = max(inner, LEAST_ROOM * cell), max(outer, LEAST_ROOM * cell)
    costs, ends = cells_of(scenario, cell, inner, outer)
    reach = math.ceil(outer / cell)
    for path in avoid:
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
        inside = path[(along > 0.2 * along[-1]) & (along < 0.8 * along[-1])]
        marked = np.zeros(costs.shape, dtype=np.bool_)
        for i, j in np.floor((inside - bounds.min) / cell).astype(int).tolist():
            marked[max(j - reach, 0) : j + reach + 1, max(i - reach, 0) : i + reach + 1] = True
        costs[marked] *= AVOIDANCE
    columns = costs.shape[1]
    cells = shortest_path(costs.ravel(), columns, *ends)
    if not len(cells):
        return None
    (x_min, y_min), start, goal = bounds.min, scenario.start, scenario.goal
    points = np.column_stack([x_min + (cells % columns + 0.5) * cell, y_min + (cells // columns + 0.5) * cell])
    return np.concatenate([[(start.x, start.y)], points[1:-1], [(goal.x, goal.y)]])


def cell_side(bounds: Bounds, inner: float) -> float:
    """Side of the cells of a grid for a disc of some radius [m]."""
    width, height = bounds.size
    return max(math.sqrt(width * height / MOST_CELLS), min(LARGEST_CELL, max(inner / LEAST_ROOM, SMALLEST_CELL)))


def cells_of(scenario: Scenario, cell: float, inner: float, outer: float) -> tuple[NDArray[np.float32], list[int]]:
    """What a metre costs in each cell of a grid over the bounds, and which cells the start and the goal are in.

    Args:
        scenario: world, start and goal.
        cell: side of a cell [m].
        inner: see :func:`cbrrt_ompl.optimise.geodesic.cell_costs` [m].
        outer: see above [m].

    Returns:
        Costs, shape (rows, columns), and indices into all cells, a row after the other.
    """
    bounds = scenario.world.bounds
    (width, height), (x_min, y_min) = bounds.size, bounds.min
    columns, rows = math.ceil(width / cell), math.ceil(height / cell)
    costs = _known_costs(scenario.world, cell, (rows, columns), inner, outer).reshape(rows, columns).copy()
    ends, reach = [], math.ceil(outer / cell)
    for x, y in ((scenario.start.x, scenario.start.y), (scenario.goal.x, scenario.goal.y)):
        i, j = min(int((x - x_min) / cell), columns - 1), min(int((y - y_min) / cell), rows - 1)
        around = costs[max(j - reach, 0) : j + reach + 1, max(i - reach, 0) : i + reach + 1]
        around[np.isinf(around)] = 10.0  # the ends are free, however the grid sees them
        ends.append(j * columns + i)
    return costs, ends


_costs: WeakKeyDictionary[World, tuple[tuple[float, ...], NDArray[np.float32]]] = WeakKeyDictionary()
_lock = threading.Lock()


def _known_costs(world: World, cell: float, shape: tuple[int, int], inner: float, outer: float) -> NDArray[np.float32]:
    """:func:`cbrrt_ompl.optimise.geodesic.cell_costs` of a world, kept for the robot that asked last."""
    with _lock:
        known, costs = _costs.get(world, ((), np.empty(0, dtype=np.float32)))
        if known != (cell, inner, outer):
            costs = cell_costs(*field_of(world), world.bounds.min, cell, shape, inner, outer)
            _costs[world] = (cell, inner, outer), costs
        return costs


def guess_along(path: NDArray[np.float64], scenario: Scenario, gear: int, source: str) -> Guess:
    """Drive along a path at full speed, after a turn on the spot and before another one.

    Args:
        path: points, shape (n, 2) [m].
        scenario: start, goal and limits.
        gear: `AHEAD` or `BACKWARDS`.
        source: name of the guess.
    """
    x, y = smooth(path)
    limits, start = scenario.robot.limits, scenario.start
    v_top = limits.v_max if gear == AHEAD else -limits.v_min
    omega_top = min(limits.omega_max, -limits.omega_min) or max(limits.omega_max, -limits.omega_min)
    heading = np.unwrap(np.arctan2(np.gradient(y), np.gradient(x))) + (0.0 if gear == AHEAD else math.pi)
    heading += math.tau * round((start.theta - heading[0]) / math.tau)
    poses = [turn(x[0], y[0], start.theta, heading[0]), np.column_stack([x, y, heading])]
    if scenario.goal.theta is not None:
        error = math.remainder(scenario.goal.theta - heading[-1], math.tau)
        poses.append(turn(x[-1], y[-1], heading[-1] + error, heading[-1])[::-1])
    rows = np.concatenate(poses)
    moved, turned = np.hypot(*np.diff(rows[:, :2], axis=0).T), np.abs(np.diff(rows[:, 2]))
    times = np.concatenate([[0.0], np.cumsum(np.maximum(moved / v_top, turned / omega_top) + 1e-5)])
    return guess_from_path(np.column_stack([times, rows]), start, limits, source)


def smooth(path: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points evenly along a path, its corners rounded off, shape (2, m)."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    places = np.linspace(0.0, along[-1], min(max(10, int(along[-1] / SPACING)), MOST_POINTS))
    points = np.array([np.interp(places, along, path[:, i]) for i in (0, 1)])
    for _ in range(SMOOTHINGS):
        points[:, 1:-1] = 0.25 * points[:, :-2] + 0.5 * points[:, 1:-1] + 0.25 * points[:, 2:]
    return points


def turn(x: float, y: float, theta: float, towards: float) -> NDArray[np.float64]:
    """Poses of a turn on the spot in steps of a tenth of a radian, without its last one, shape (n, 3)."""
    headings = np.linspace(theta, towards, max(1, int(abs(towards - theta) / 0.1)), endpoint=False)
    return np.column_stack([np.full(len(headings), x), np.full(len(headings), y), headings])
