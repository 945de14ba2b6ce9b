"""The numbers that a player draws a trajectory or a drive from, rounded to what can be seen."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from cbrrt_ompl.figures.drive_history import braking_ahead, view_at
from cbrrt_ompl.problem.obstacles import Bounds, Box, Disc, Obstacle
from cbrrt_ompl.problem.robot import Footprint
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.trajectory.tree import Tree

if TYPE_CHECKING:
    from cbrrt_ompl.drive.result import DriveResult
    from cbrrt_ompl.scenario.scenario import Scenario

STEPS = 65_000
"""Steps of packed coordinates over the bounds; what is left of 16 bits is beyond the bounds, or a gap."""

GAP = 65_535
"""Between two packed lines."""

VIEW_TOLERANCE = 0.02
"""By how much the outline of a view may be simplified [m]."""

MOST_ROWS, MOST_TREE_POINTS, MOST_BRAKING_POINTS = 2_000, 60_000, 8
"""Of a trajectory, of a tree and of each braking, so that a page stays below a megabyte."""


def plan_numbers(trajectory: Trajectory, scenario: Scenario, tree: Tree | None = None) -> dict[str, Any]:
    """What a player draws of a trajectory.

    Args:
        trajectory: what is driven.
        scenario: where.
        tree: what a planner grew.

    Returns:
        Plain values: SI units, angles in radians but for turning rates in degrees a second; packed coordinates are
        16 bits each, x and y in turn, from 0 at the lower bounds to `STEPS` at the larger side.
    """
    bounds = scenario.world.bounds
    return {
        **_scene(scenario),
        "rows": _rows(trajectory, bounds),
        "tree": "" if tree is None else _packed_tree(tree, bounds),
    }


def drive_numbers(result: DriveResult) -> dict[str, Any]:
    """What a player draws of a drive: as of a trajectory, and what was known and meant at each look.

    Args:
        result: what :func:`cbrrt_ompl.drive.drive` returned.

    Returns:
        As :func:`plan_numbers`, and ``drive``.
    """
    bounds = result.scenario.world.bounds
    digits = _digits(bounds)
    looks = np.array([cycle.time for cycle in result.cycles])
    place = {id(obstacle): index for index, obstacle in enumerate(result.hidden)}
    taken = [replan for replan in result.replans if replan.trajectory is not None]
    plans = [_line(replan.start_time, replan.trajectory, digits) for replan in taken if replan.trajectory is not None]
    braking = []
    for look, time in enumerate(looks):
        points = braking_ahead(result, looks, look, float(time))
        chosen = np.unique(np.linspace(0, len(points) - 1, MOST_BRAKING_POINTS).round().astype(int))
        braking.append(_rounded(points[chosen], digits))
    return {
        **plan_numbers(result.trajectory, result.scenario),
        "drive": {
            "hidden": [_outline(obstacle, digits) for obstacle in result.hidden],
            "sensor_range": result.settings.sensor_range,
            "cycle": result.settings.cycle,
            "looks": _rounded(looks, 4),
            "views": [_view(result, float(time), digits) for time in looks],
            "seen": [[place[id(one)] for one in cycle.seen if id(one) in place] for cycle in result.cycles],
            "is_braking": [int(cycle.is_braking) for cycle in result.cycles],
            "computing": _rounded(result.computing_times, 6),
            "plans": plans,
            "braking": braking,
        },
    }


def _scene(scenario: Scenario) -> dict[str, Any]:
    """Bounds, obstacles, robot, start and goal."""
    bounds, limits, goal = scenario.world.bounds, scenario.robot.limits, scenario.goal
    obstacles = scenario.world.obstacles
    boxes = np.array([(*one.min, *one.max) for one in obstacles if isinstance(one, Box)]).reshape(-1, 2)
    digits = _digits(bounds)
    return {
        "name": scenario.name,
        "bounds": [*bounds.min, *bounds.max],
        "boxes": _packed(boxes, bounds),
        "shapes": [_outline(one, digits) for one in obstacles if not isinstance(one, Box)],
        "robot": _robot(scenario.robot.footprint, bounds),
        "start": list(scenario.start[:3]),
        "goal": {
            "center": [goal.x, goal.y],
            "radius": min(goal.tolerance, 2.0 * max(bounds.size)),
            "theta": goal.theta,
            "heading_tolerance": min(goal.heading_tolerance, math.pi),
        },
        "limits": {
            "v": [limits.v_min, limits.v_max],
            "omega": [math.degrees(limits.omega_min), math.degrees(limits.omega_max)],
        },
    }


def _robot(footprint: Footprint, bounds: Bounds) -> list[list[float]]:
    """Outline of the footprint at the origin; an arrow head for a point."""
    if footprint.kind == "point":
        return _rounded(0.03 * max(bounds.size) * np.array([(1.0, 0.0), (-0.7, 0.6), (-0.7, -0.6)]), 6)
    return _rounded(footprint.outline_at((0.0, 0.0, 0.0)), 6)


def _rows(trajectory: Trajectory, bounds: Bounds) -> dict[str, Any]:
    """Columns of the trajectory, of its own rows or of as many evenly spaced ones as a player needs."""
    digits = _digits(bounds)
    times = trajectory.t
    if len(times) > MOST_ROWS:
        times = np.linspace(times[0], times[-1], MOST_ROWS)
    x, y, theta, v, omega = trajectory.at(times).T
    command = np.clip(np.searchsorted(trajectory.t, times, side="right") - 1, 0, len(trajectory) - 1)
    return {
        "t": _rounded(times, 4),
        "x": _rounded(x, digits),
        "y": _rounded(y, digits),
        "theta": _rounded(theta, 4),
        "v": _rounded(v, 4),
        "omega": _rounded(np.degrees(omega), 2),
        "v_command": _rounded(trajectory.v_command[command], 4),
        "omega_command": _rounded(np.degrees(trajectory.omega_command[command]), 2),
        "kinematic": trajectory.kinematic,
    }


def _line(start: float, trajectory: Trajectory, digits: int) -> dict[str, Any]:
    """A plan of a drive, thinned out, from when it is followed."""
    rows = np.unique(np.linspace(0, len(trajectory) - 1, min(len(trajectory), 200)).round().astype(int))
    columns = {"t": _rounded(trajectory.t[rows], 3)}
    return {"from": start, **columns, **{name: _rounded(getattr(trajectory, name)[rows], digits) for name in "xy"}}


def _view(result: DriveResult, t: float, digits: int) -> list[list[float]]:
    """Outline of what is in line of sight at a time, none where obstacles hid nothing."""
    outline = view_at(result, t)
    if outline is None:
        return []
    ring = shapely.simplify(shapely.Polygon(outline), VIEW_TOLERANCE, preserve_topology=False)
    return _rounded(shapely.get_coordinates(ring), digits)


def _outline(obstacle: Obstacle, digits: int) -> dict[str, Any]:
    """A disc, or the rings of any other obstacle."""
    if isinstance(obstacle, Disc):
        return {"center": list(obstacle.center), "radius": obstacle.radius}
    if isinstance(obstacle, Box):
        (x0, y0), (x1, y1) = obstacle.min, obstacle.max
        return {"rings": [[[x0, y0], [x1, y0], [x1, y1], [x0, y1]]]}
    return {"rings": [_rounded(ring, digits) for ring in (obstacle.vertices, *obstacle.holes)]}


def _packed_tree(tree: Tree, bounds: Bounds) -> str:
    """The edges of a tree, packed: of large ones every n-th point of an edge, of huge ones every n-th edge."""
    ends = np.flatnonzero(np.isnan(tree.polyline[:, 0]))
    starts = np.concatenate([[0], ends[:-1] + 1]).astype(int)
    every = max(math.ceil(3 * len(ends) / MOST_TREE_POINTS), 1)
    starts, ends = starts[::every], ends[::every]
    most = max(MOST_TREE_POINTS // max(len(ends), 1) - 1, 2)
    lines = [tree.polyline[_spread(a, b, most)] for a, b in zip(starts.tolist(), ends.tolist(), strict=True) if b > a]
    gap = np.full((1, 2), np.nan)
    return _packed(np.vstack([part for line in lines for part in (line, gap)]) if lines else np.empty((0, 2)), bounds)


def _spread(start: int, end: int, most: int) -> NDArray[np.int64]:
    """Rows from a start to before an end, both ends of the line among them, shape (n,)."""
    return np.linspace(start, end - 1, min(most, end - start)).round().astype(np.int64)


def _packed(points: NDArray[np.float64], bounds: Bounds) -> str:
    """Points, shape (n, 2), as 16 bits a coordinate in base 64; NaN is a gap, and what lies outside is moved inside."""
    scaled = (points - np.array(bounds.min)) * (STEPS / max(bounds.size))
    whole = np.where(np.isnan(scaled), GAP, np.clip(np.nan_to_num(scaled).round(), 0, STEPS))
    return base64.b64encode(whole.astype("<u2").tobytes()).decode()


def _digits(bounds: Bounds) -> int:
    """Decimals of a position: a twenty-thousandth of the bounds."""
    return max(math.ceil(-math.log10(max(bounds.size) / 20_000.0)), 0)


def _rounded(values: ArrayLike | Iterable[float] | Sequence[float], digits: int) -> Any:
    """Plain numbers with so many decimals."""
    return (np.round(np.asarray(values, dtype=float), digits) + 0.0).tolist()
