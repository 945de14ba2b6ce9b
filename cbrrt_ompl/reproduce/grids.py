"""The shortest path on a grid of eight neighbours, as A* finds it, and what it asks of a robot that has to drive it."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from cbrrt_ompl.problem.robot import Limits
from cbrrt_ompl.scenario.scenario import Scenario

CELLS = (0.1, 0.2)
"""Sides of the cells that the paper names [m]."""

CENTRES, WHOLE_CELLS = "centres", "whole cells"
RULES = (CENTRES, WHOLE_CELLS)
"""What must be free of obstacles for a cell to count as free: its centre, or all of it as in an occupancy grid."""

PLACES = 6
"""Places of a grid along each axis, a sixth of a cell apart."""

_STEPS = ((1, 0), (0, 1), (1, 1), (1, -1))


@dataclass(frozen=True, eq=False)
class GridPath:
    """The shortest path on one grid."""

    points: NDArray[np.float64]
    """Corners of the path from the start's cell to the goal's, without those on a straight line, shape (n, 2) [m]."""
    search_time: float
    """Time of the search on the finished grid [s]."""

    @property
    def length(self) -> float:
        """Length [m]."""
        return float(np.hypot(*np.diff(self.points, axis=0).T).sum())

    @property
    def turns(self) -> NDArray[np.float64]:
        """Jumps of the heading at the corners, shape (n - 2,) [rad]."""
        dx, dy = np.diff(self.points, axis=0).T
        return np.asarray(np.diff(np.unwrap(np.arctan2(dy, dx))))

    def driving_time(self, heading: float, limits: Limits) -> float:
        """Time to drive it: at each corner the robot brakes to rest, turns in place and starts again [s].

        Args:
            heading: of the robot at the start [rad].
            limits: of the robot.
        """
        dx, dy = np.diff(self.points, axis=0).T
        first = math.remainder(math.atan2(dy[0], dx[0]) - heading, 2.0 * math.pi)
        turns = np.abs(np.concatenate([[first], self.turns]))
        drives = sum(_rest_to_rest(way, limits.v_max, limits.acceleration) for way in np.hypot(dx, dy))
        rate = min(limits.omega_max, -limits.omega_min)
        return drives + sum(_rest_to_rest(turn, rate, limits.angular_acceleration) for turn in turns)


@dataclass(frozen=True)
class GridStudy:
    """Grids of one side and rule in one scene, at many places."""

    scene: str
    cell: float
    """Side of a cell [m]."""
    rule: str
    """`CENTRES` or `WHOLE_CELLS`."""
    places: int
    """Grids tried, each shifted against the others by a fraction of a cell."""
    paths: tuple[GridPath, ...]
    """The paths found, one a grid at most."""


def study_grids(scene: str, scenario: Scenario, cell: float, rule: str, places: int = PLACES) -> GridStudy:
    """Search grids at ``places`` by ``places`` places.

    Args:
        scene: what the scene is called.
        scenario: scene whose robot is a point.
        cell: side of a cell [m].
        rule: when a cell is free.
        places: along each axis.
    """
    fractions = (np.arange(places) + 0.5) / places
    found = (shortest_path(scenario, cell, rule, (fx * cell, fy * cell)) for fx in fractions for fy in fractions)
    return GridStudy(scene, cell, rule, places * places, tuple(path for path in found if path is not None))


def shortest_path(
    scenario: Scenario, cell: float, rule: str = CENTRES, origin: tuple[float, float] = (0.0, 0.0)
) -> GridPath | None:
    """The shortest path from the cell of the start to any cell whose centre lies in the goal region.

    Two of the eight neighbours are joined where both are free and the straight line between their centres touches no
    obstacle. The search is scipy's Dijkstra, which finds what A* finds.

    Args:
        scenario: scene whose robot is a point; its walls are the bounds.
        cell: side of a cell [m].
        rule: `CENTRES` or `WHOLE_CELLS`.
        origin: by how much the cells are shifted against the lower left corner, 0 to a cell each [m].

    Returns:
        The path; None where there is none.
    """
    bounds = scenario.world.bounds
    counts = [int((size - shift) / cell + 1e-9) for size, shift in zip(bounds.size, origin, strict=True)]
    axes = [low + shift + cell * (np.arange(n) + 0.5) for low, shift, n in zip(bounds.min, origin, counts, strict=True)]
    centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)  # (nx, ny, 2)
    solid = shapely.union_all([obstacle.to_shapely() for obstacle in scenario.world.obstacles])
    shapely.prepare(solid)
    graph = _graph(centres, _free(centres, cell, rule, solid), solid)
    flat = centres.reshape(-1, 2)
    start = int(np.argmin(np.hypot(*(flat - (scenario.start.x, scenario.start.y)).T)))
    goals = np.flatnonzero(np.hypot(*(flat - (scenario.goal.x, scenario.goal.y)).T) <= scenario.goal.tolerance)
    began = time.perf_counter()
    (distances,), (before,) = dijkstra(graph, indices=[start], return_predecessors=True)
    search_time = time.perf_counter() - began
    if not len(goals) or math.isinf(distances[goals].min()):
        return None
    node, nodes = int(goals[np.argmin(distances[goals])]), []
    while node >= 0:
        nodes.append(node)
        node = int(before[node])
    return GridPath(_corners(flat[nodes[::-1]]), search_time)


def _free(centres: NDArray[np.float64], cell: float, rule: str, solid: shapely.Geometry) -> NDArray[np.bool_]:
    """Which cells are free, shape (nx, ny)."""
    x, y = centres[..., 0], centres[..., 1]
    if rule == CENTRES:
        return ~np.asarray(shapely.intersects_xy(solid, x, y))
    half = 0.5 * cell - 1e-9  # cells that only touch an obstacle are free
    return ~np.asarray(shapely.intersects(solid, shapely.box(x - half, y - half, x + half, y + half)))


def _graph(centres: NDArray[np.float64], free: NDArray[np.bool_], solid: shapely.Geometry) -> Any:
    """Which cells are joined, and how far apart their centres are, as a sparse matrix."""
    nx, ny = free.shape
    number = np.arange(nx * ny).reshape(nx, ny)
    rows, columns, lengths = [], [], []
    for i, j in _STEPS:
        one = (slice(0, nx - i), slice(max(0, -j), ny - max(0, j)))
        other = (slice(i, nx), slice(max(0, j), ny - max(0, -j)))
        both = free[one] & free[other]
        a, b = centres[one][both], centres[other][both]
        clear = ~shapely.intersects(solid, shapely.linestrings(np.stack([a, b], axis=1)))
        rows.append(number[one][both][clear])
        columns.append(number[other][both][clear])
        lengths.append(np.hypot(*(b - a)[clear].T))
    row, column, length = map(np.concatenate, (rows, columns, lengths))
    size = nx * ny
    half = csr_array((length, (row, column)), shape=(size, size))
    return half + half.T


def _corners(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The points at which a path changes its direction, with both ends."""
    steps = np.diff(points, axis=0)
    bends = np.flatnonzero(np.abs(np.diff(steps, axis=0)).max(axis=1, initial=0.0) > 1e-9) + 1
    return points[np.concatenate([[0], bends, [len(points) - 1]])]


def _rest_to_rest(way: float, speed: float, acceleration: float) -> float:
    """Time to cover a way from rest to rest under a speed and an acceleration limit."""
    if way * acceleration >= speed * speed:
        return way / speed + speed / acceleration
    return 2.0 * math.sqrt(way / acceleration)
