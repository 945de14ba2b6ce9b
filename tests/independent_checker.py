"""A second opinion on trajectories: plain numbers, NumPy, SciPy and shapely, and not a line of the package.

It reads the values of a scenario file and the columns of a trajectory. Obstacles are shapely polygons, and points with
a radius for discs; the pose is integrated by adaptive Gauss-Kronrod quadrature of the heading's sine and cosine.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.integrate import quad_vec

START_TOLERANCE = 1e-6
"""Largest deviation of the first row from the start, in each value."""

MOTION_TOLERANCE = 1e-3
"""Largest deviation of a row from the motion that its commands lead to, in each value."""

ROUNDING = 1e-9
"""Velocities up to this count as rest [m/s, rad/s]."""

SHORTEST_WAY = 1e-4
"""Way of the robot between two free poses that is not looked at more closely [m]."""

POSES_PER_STEP = 8
"""Poses in every step that are looked at in any case."""

PARTS = 8
"""Parts that an interval is cut into where nothing is proven yet."""

MOST_POSES = 500_000
"""Poses after which a motion counts as not proven."""


def refusals(scenario: Mapping[str, Any], columns: Mapping[str, Sequence[float]], kinematic: bool) -> list[str]:
    """Why a trajectory does not solve a scenario.

    Args:
        scenario: values with the keys of a scenario file, all of them given, angles in radians.
        columns: t, x, y, theta, v, omega, v_command and omega_command.
        kinematic: whether the velocities jump to their commands.

    Returns:
        A line a reason; empty where there is none.
    """
    rows = {name: np.array(values, dtype=float) for name, values in columns.items()}
    limits = scenario["robot"]["limits"]
    poses, velocities = driven(rows, limits, kinematic)
    found = [*_start(scenario["start"], rows), *_limits(limits, rows), *_motion(rows, poses, velocities)]
    if not kinematic:
        found += _accelerations(limits, rows)
    found += _goal(scenario["goal"], rows)
    distance = Surroundings(scenario)
    stored = np.column_stack([rows["x"], rows["y"], rows["theta"]])
    touching = np.flatnonzero(distance(stored) <= 0.0)
    if len(touching):
        found.append(f"collision of row {touching[0]}")
    return found + _collisions(distance, rows["t"], poses, velocities)


def _start(start: Mapping[str, float], rows: Mapping[str, NDArray[np.float64]]) -> Iterator[str]:
    for name in ("x", "y", "theta", "v", "omega"):
        off = rows[name][0] - start.get(name, 0.0)
        if name == "theta":
            off = math.remainder(off, 2.0 * math.pi)
        if not abs(off) <= START_TOLERANCE:
            yield f"start: {name} is off by {off}"


def _goal(goal: Mapping[str, float], rows: Mapping[str, NDArray[np.float64]]) -> Iterator[str]:
    last = {name: float(values[-1]) for name, values in rows.items()}
    distance = math.dist((last["x"], last["y"]), (goal["x"], goal["y"]))
    if not distance < goal["tolerance"]:
        yield f"goal: {distance} m away"
    if "theta" in goal:
        off = math.remainder(last["theta"] - goal["theta"], 2.0 * math.pi)
        if not abs(off) <= goal["heading_tolerance"]:
            yield f"goal: heading off by {off}"
    if "speed_tolerance" in goal:
        for name in ("v", "omega"):
            if not abs(last[name]) <= goal["speed_tolerance"]:
                yield f"goal: arrives with {name} = {last[name]}"


def _limits(limits: Mapping[str, Any], rows: Mapping[str, NDArray[np.float64]]) -> Iterator[str]:
    for name in ("v", "omega"):
        low, high = limits[name]
        for column in (name, f"{name}_command"):
            outside = ~((rows[column] >= low - 1e-9) & (rows[column] <= high + 1e-9))
            if outside.any():
                yield f"limits: {column} = {rows[column][outside][0]} in row {np.flatnonzero(outside)[0]}"

    left, right = _wheels(limits, rows["v"], rows["omega"])
    for name, speeds in (("left", left), ("right", right)):
        too_fast = ~(np.abs(speeds) <= limits.get("wheel_speed", math.inf) * (1.0 + 1e-9))
        if too_fast.any():
            yield f"limits: {name} wheel in row {np.flatnonzero(too_fast)[0]}"


def _wheels(limits: Mapping[str, Any], v: Any, omega: Any) -> tuple[Any, Any]:
    """Speeds of the left and of the right wheel over the ground [m/s]."""
    rim = limits.get("wheel_separation", 0.0) / 2.0 * omega
    return v - rim, v + rim


def _accelerations(limits: Mapping[str, Any], rows: Mapping[str, NDArray[np.float64]]) -> Iterator[str]:
    left, right = _wheels(limits, rows["v"], rows["omega"])
    wheel_acceleration = limits.get("wheel_acceleration", math.inf)
    for name, values, (faster, slower) in (
        ("v", rows["v"], _rates(limits, "")),
        ("omega", rows["omega"], _rates(limits, "angular_")),
        ("left wheel", left, (wheel_acceleration, wheel_acceleration)),
        ("right wheel", right, (wheel_acceleration, wheel_acceleration)),
    ):
        changes, durations = np.abs(np.diff(values)), np.diff(rows["t"]) * (1.0 + 1e-9)
        speeds = np.abs(values)
        turns_round = (values[1:] * values[:-1] < 0.0) & (np.minimum(speeds[1:], speeds[:-1]) > ROUNDING)
        grows, shrinks = (speeds[1:] > speeds[:-1]) | turns_round, (speeds[1:] < speeds[:-1]) | turns_round
        too_fast = grows & ~(changes <= faster * durations + 1e-12)
        too_fast |= shrinks & ~(changes <= slower * durations + 1e-12)
        if too_fast.any():
            yield f"acceleration: {name} in row {np.flatnonzero(too_fast)[0]}"


def _rates(limits: Mapping[str, Any], prefix: str) -> tuple[float, float]:
    """Acceleration and deceleration, which may be left out."""
    acceleration = limits[f"{prefix}acceleration"]
    return acceleration, limits.get(f"{prefix}deceleration", acceleration)


def driven(
    rows: Mapping[str, NDArray[np.float64]], limits: Mapping[str, Any], kinematic: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where the commands lead from the first row.

    Returns:
        Poses at the rows, the heading counted through full turns, shape (n, 3); v, omega at the begin and v, omega at
        the end of each step, shape (n - 1, 4).
    """
    durations = np.diff(rows["t"])
    velocities = np.empty((len(durations), 4))
    v, omega = rows["v"][0], rows["omega"][0]
    for k, duration in enumerate(durations):
        target, target_rate = rows["v_command"][k], rows["omega_command"][k]
        if kinematic:
            velocities[k] = target, target_rate, target, target_rate
            continue
        v_next, omega_next = _ramped(limits, v, omega, target - v, target_rate - omega, duration)
        velocities[k] = v, omega, v_next, omega_next
        v, omega = v_next, omega_next
    turns = durations * (velocities[:, 1] + velocities[:, 3]) / 2.0
    headings = rows["theta"][0] + np.append(0.0, np.cumsum(turns))
    ways = ways_within(headings[:-1], velocities, durations)
    start = np.array([rows["x"][0], rows["y"][0]])
    return np.column_stack([start + np.vstack([np.zeros(2), np.cumsum(ways, axis=0)]), headings]), velocities


def _ramped(
    limits: Mapping[str, Any], v: float, omega: float, dv: float, domega: float, duration: float
) -> tuple[float, float]:
    """Velocities after a time in which they are to change by some amounts, as far as the accelerations allow."""
    shares = {"v": 1.0, "omega": 1.0}
    wheels_rule = bool({"wheel_speed", "wheel_acceleration"} & set(limits))
    for name, value, change, (faster, slower) in (
        ("v", v, dv, _rates(limits, "")),
        ("omega", omega, domega, _rates(limits, "angular_")),
    ):
        slows = value * change < 0.0 and abs(value) > ROUNDING
        most = (slower if slows else faster) * duration
        if slows and abs(change) > abs(value) and (wheels_rule or most > abs(value)):  # through rest
            most = min(faster, slower) * duration if wheels_rule else max(abs(value), min(faster, slower) * duration)
        if abs(change) > most:
            shares[name] = most / abs(change)
    if wheels_rule:  # they then change together, and no wheel too fast
        most = limits.get("wheel_acceleration", math.inf) * duration
        wheels = [most / abs(change) for change in _wheels(limits, dv, domega) if abs(change) > most]
        shares["v"] = shares["omega"] = min(*shares.values(), *wheels)
    return v + shares["v"] * dv, omega + shares["omega"] * domega


def ways_within(
    headings: NDArray[np.float64], velocities: NDArray[np.float64], durations: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(dx, dy) of motions whose velocities change linearly, by quadrature, shape (m, 2)."""
    if not len(durations):
        return np.zeros((0, 2))
    v, omega, v_end, omega_end = velocities.T

    def rates(share: float) -> NDArray[np.float64]:
        heading = headings + durations * (omega * share + (omega_end - omega) * share**2 / 2.0)
        return durations * (v * (1.0 - share) + v_end * share) * np.array([np.cos(heading), np.sin(heading)])

    return quad_vec(rates, 0.0, 1.0, epsabs=1e-11, epsrel=1e-11, norm="max")[0].T


def _motion(
    rows: Mapping[str, NDArray[np.float64]], poses: NDArray[np.float64], velocities: NDArray[np.float64]
) -> Iterator[str]:
    for index, name in enumerate(("x", "y", "theta")):
        off = rows[name] - poses[:, index]
        if name == "theta":
            off = np.arctan2(np.sin(off), np.cos(off))
        if not (np.abs(off) <= MOTION_TOLERANCE).all():
            yield f"motion: {name} off by {np.abs(off).max()}"
    for index, name in ((2, "v"), (3, "omega")):
        off = rows[name][1:] - velocities[:, index]
        if not (np.abs(off) <= MOTION_TOLERANCE).all():
            yield f"motion: {name} off by {np.abs(off).max()}"


class Surroundings:
    """Distances of a robot's footprint from all that it may not touch; 0 or less where it touches."""

    def __init__(self, scenario: Mapping[str, Any]) -> None:
        """Make the shapely geometries."""
        footprint = scenario["robot"]["footprint"]
        self.radius = footprint.get("radius", 0.0)
        self._corners = np.array(footprint["vertices"], dtype=float) if footprint["type"] == "polygon" else None
        self.reach = 0.0 if self._corners is None else float(np.linalg.norm(self._corners, axis=1).max())
        self._low, self._high = (np.array(scenario["bounds"][end], dtype=float) for end in ("min", "max"))
        obstacles = scenario.get("obstacles", [])
        solids = [_area(obstacle) for obstacle in obstacles if obstacle["type"] != "disc"]
        self._solids = shapely.union_all(solids) if solids else None
        self._discs = [
            (shapely.Point(obstacle["center"]), obstacle["radius"])
            for obstacle in obstacles
            if obstacle["type"] == "disc"
        ]

    def __call__(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distances at poses (x, y, theta) of shape (n, 3), shape (n,) [m]."""
        if self._corners is None:
            outline = poses[:, None, :2]  # (n, 1, 2)
            areas = shapely.points(poses[:, :2])
        else:
            c, s = np.cos(poses[:, 2])[:, None], np.sin(poses[:, 2])[:, None]
            x, y = self._corners.T
            outline = poses[:, None, :2] + np.stack([c * x - s * y, s * x + c * y], axis=-1)  # (n, corners, 2)
            areas = shapely.polygons(outline)
        inside = np.concatenate([outline, poses[:, None, :2]], axis=1)  # the origin has to be within the bounds as well
        found = np.minimum(inside - self._low, self._high - inside).min(axis=(1, 2))
        if self._solids is not None:
            found = np.minimum(found, shapely.distance(areas, self._solids))
        for centre, radius in self._discs:
            found = np.minimum(found, shapely.distance(areas, centre) - radius)
        return found - self.radius


def _area(obstacle: Mapping[str, Any]) -> shapely.Geometry:
    """The area of an obstacle other than a disc."""
    if obstacle["type"] == "box":
        return shapely.box(*obstacle["min"], *obstacle["max"])
    if obstacle["type"] == "oriented_box":
        length, width = obstacle["size"]
        flat = shapely.box(-length / 2.0, -width / 2.0, length / 2.0, width / 2.0)
        c, s = math.cos(obstacle["angle"]), math.sin(obstacle["angle"])
        return shapely.transform(flat, lambda xy: xy @ np.array([[c, s], [-s, c]]) + obstacle["center"])
    return shapely.Polygon(obstacle["vertices"], obstacle.get("holes"))


def _collisions(
    distance: Surroundings, times: NDArray[np.float64], poses: NDArray[np.float64], velocities: NDArray[np.float64]
) -> list[str]:
    """A dense sweep, made denser until the distances cover the way between all neighbouring poses."""
    durations = np.diff(times)
    step = np.repeat(np.arange(len(durations)), POSES_PER_STEP)
    begin = np.tile(np.arange(POSES_PER_STEP) / POSES_PER_STEP, len(durations))
    end = begin + 1.0 / POSES_PER_STEP
    asked = 0
    while len(step):
        asked += 2 * len(step)
        if asked > MOST_POSES:
            return [f"collision: not proven free after {asked} poses, at t = {times[step[0]]}"]
        ends = [distance(_within(poses, velocities, durations, step, share)) for share in (begin, end)]
        touching = np.flatnonzero(np.minimum(*ends) <= 0.0)
        if len(touching):
            first = touching[0]
            return [f"collision at t = {times[step[first]] + begin[first] * durations[step[first]]}"]
        v, omega, v_end, omega_end = np.abs(velocities[step]).T
        speed = np.maximum(v, v_end) + distance.reach * np.maximum(omega, omega_end)
        way = speed * durations[step] * (end - begin)
        open_ = (ends[0] + ends[1] <= way) & (way > SHORTEST_WAY)
        size = (end[open_] - begin[open_]) / PARTS
        begin = (begin[open_, None] + size[:, None] * np.arange(PARTS)).ravel()
        step, end = np.repeat(step[open_], PARTS), begin + np.repeat(size, PARTS)
    return []


def _within(
    poses: NDArray[np.float64],
    velocities: NDArray[np.float64],
    durations: NDArray[np.float64],
    step: NDArray[np.int64],
    share: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Poses at a share of some steps, shape (m, 3)."""
    v, omega, v_end, omega_end = velocities[step].T
    there = np.column_stack([v, omega, v + (v_end - v) * share, omega + (omega_end - omega) * share])
    elapsed = durations[step] * share
    ways = ways_within(poses[step, 2], there, elapsed)
    return poses[step] + np.column_stack([ways, elapsed * (there[:, 1] + there[:, 3]) / 2.0])
