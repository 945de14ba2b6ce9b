"""The messages of ROS that a trajectory becomes, as plain values with the fields of their types."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cbrrt_ompl.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from cbrrt_ompl.scenario.scenario import Scenario

FRAMES = ("map", "odom", "base_link")
"""From the map over odometry to the robot."""

GRID_RESOLUTION = 0.05
"""Side of the cells of a world that came from no map [m]."""

MOST_CELLS = 4_000_000
"""Of the map in a bag; a larger world gets larger cells."""


class Entry(NamedTuple):
    """One message."""

    time: float
    """When [s]."""
    topic: str
    """Its topic."""
    kind: str
    """Its type."""
    content: dict[str, Any]
    """Its fields."""


def entries_of(trajectory: Trajectory, scenario: Scenario | None = None) -> Iterator[Entry]:
    """All messages of a trajectory in the order of their times; see :func:`cbrrt_ompl.export.ros_bag.write_bag`."""
    begin = float(trajectory.t[0])
    still = _transform(begin, FRAMES[0], FRAMES[1], (0.0, 0.0, 0.0))
    yield Entry(begin, "/tf_static", "tf2_msgs/msg/TFMessage", {"transforms": [still]})
    yield Entry(begin, "/plan", "nav_msgs/msg/Path", path_message(trajectory))
    if scenario is not None:
        yield Entry(begin, "/map", "nav_msgs/msg/OccupancyGrid", _grid(begin, scenario))
        yield Entry(begin, "/footprint", "geometry_msgs/msg/PolygonStamped", _footprint(begin, scenario))
    commands = np.column_stack([trajectory.v_command, trajectory.omega_command])
    commands[-1] = trajectory.states[-1, 3:]  # nothing is commanded after the last row
    for time, pose, (v, omega), command in zip(
        trajectory.t.tolist(),
        trajectory.poses.tolist(),
        trajectory.states[:, 3:].tolist(),
        commands.tolist(),
        strict=True,
    ):
        yield Entry(time, "/tf", "tf2_msgs/msg/TFMessage", {"transforms": [_transform(time, *FRAMES[1:], pose)]})
        yield Entry(time, "/odom", "nav_msgs/msg/Odometry", _odometry(time, pose, (v, omega)))
        yield Entry(time, "/cmd_vel", "geometry_msgs/msg/Twist", _twist(*command))


def path_message(trajectory: Trajectory, frame: str = FRAMES[0]) -> dict[str, Any]:
    """A nav_msgs/Path with a pose a row, each at its time."""
    rows = zip(trajectory.t.tolist(), trajectory.poses.tolist(), strict=True)
    poses = [{"header": header(time, frame), "pose": pose_message(*pose)} for time, pose in rows]
    return {"header": header(float(trajectory.t[0]), frame), "poses": poses}


def header(time: float, frame: str) -> dict[str, Any]:
    """A std_msgs/Header."""
    whole, part = divmod(nanoseconds(time), 1_000_000_000)
    return {"stamp": {"sec": whole, "nanosec": part}, "frame_id": frame}


def nanoseconds(time: float) -> int:
    """A time in whole nanoseconds."""
    return round(1e9 * time)


def pose_message(x: float, y: float, theta: float) -> dict[str, Any]:
    """A geometry_msgs/Pose, the heading as a quaternion about the z axis."""
    return {"position": _point(x, y), "orientation": _quaternion(theta)}


def pose_of(pose: Any) -> tuple[float, float, float]:
    """(x, y, theta) of a geometry_msgs/Pose [m, m, rad]."""
    q = pose.orientation
    yaw = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))
    return float(pose.position.x), float(pose.position.y), yaw


def _point(x: float, y: float) -> dict[str, float]:
    return {"x": x, "y": y, "z": 0.0}


def _quaternion(theta: float) -> dict[str, float]:
    return {"x": 0.0, "y": 0.0, "z": math.sin(0.5 * theta), "w": math.cos(0.5 * theta)}


def _twist(v: float, omega: float) -> dict[str, Any]:
    return {"linear": _point(v, 0.0), "angular": {"x": 0.0, "y": 0.0, "z": omega}}


def _transform(time: float, parent: str, child: str, pose: tuple[float, float, float] | list[float]) -> dict[str, Any]:
    x, y, theta = pose
    transform = {"translation": _point(x, y), "rotation": _quaternion(theta)}
    return {"header": header(time, parent), "child_frame_id": child, "transform": transform}


def _odometry(time: float, pose: list[float], velocities: tuple[float, float]) -> dict[str, Any]:
    certain = np.zeros(36)
    return {
        "header": header(time, FRAMES[1]),
        "child_frame_id": FRAMES[2],
        "pose": {"pose": pose_message(*pose), "covariance": certain},
        "twist": {"twist": _twist(*velocities), "covariance": certain},
    }


def _footprint(time: float, scenario: Scenario) -> dict[str, Any]:
    """The outline of the robot, in its own frame."""
    corners = scenario.robot.footprint.outline_at((0.0, 0.0, 0.0), segments=32)
    return {"header": header(time, FRAMES[2]), "polygon": {"points": [_point(x, y) for x, y in corners.tolist()]}}


def _grid(time: float, scenario: Scenario) -> dict[str, Any]:
    """The world as an OccupancyGrid: obstacles 100, the rest 0."""
    from cbrrt_ompl.scenario.maps.rasterizing import rasterize

    width, height = scenario.world.bounds.size
    grid = rasterize(scenario.world, max(GRID_RESOLUTION, math.sqrt(width * height / MOST_CELLS)))
    x, y, theta = grid.origin
    rows, columns = grid.cells.shape
    info = {
        "map_load_time": header(time, "")["stamp"],
        "resolution": grid.resolution,
        "width": columns,
        "height": rows,
        "origin": pose_message(x, y, theta),
    }
    return {"header": header(time, FRAMES[0]), "info": info, "data": grid.cells.astype(np.int8).ravel()}
