"""Parameters of Nav2 and of ROS 1's navigation: what they are called here, and a robot made of a file of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from dataclasses import fields as fields_of
from typing import Any

import numpy as np

from cbrrt_ompl.checks import is_number
from cbrrt_ompl.errors import InputError, Problem
from cbrrt_ompl.problem.robot import Footprint, Robot
from cbrrt_ompl.problem.settings import PlanningSettings
from cbrrt_ompl.scenario.footprints import footprint
from cbrrt_ompl.scenario.maps.map_files import as_written
from cbrrt_ompl.scenario.plain_yaml import read_yaml
from cbrrt_ompl.scenario.sections import Report, text

FASTEST = ("max_vel_x", "vx_max", "desired_linear_vel", "max_linear_vel", "max_speed_xy", "max_trans_vel")
SLOWEST = ("min_vel_x", "vx_min")
FASTEST_BACKWARDS = ("max_vel_x_backwards",)
FASTEST_TURN = (
    "max_vel_theta",
    "wz_max",
    "max_angular_vel",
    "rotate_to_heading_angular_vel",
    "max_rot_vel",
    "max_rotational_vel",
)
ACCELERATION = ("acc_lim_x", "ax_max", "max_linear_accel")
DECELERATION = ("decel_lim_x", "ax_min", "max_linear_decel")
TURN_ACCELERATION = ("acc_lim_theta", "az_max", "max_angular_accel")
TURN_DECELERATION = ("decel_lim_theta", "max_angular_decel")
"""Names of the same limit, by the controllers of Nav2 and ROS 1: DWB, MPPI, regulated pure pursuit, DWA, TEB."""

_MARGIN = (
    "planning.clearance, the distance to keep [m]"
    if any(f.name == "clearance" for f in fields_of(PlanningSettings))
    else "a larger robot.footprint"
)

FOREIGN_KEYS: dict[str, str] = {
    **dict.fromkeys((*FASTEST, *SLOWEST, *FASTEST_BACKWARDS), "robot.limits.v: [least, largest] [m/s]"),
    **dict.fromkeys(
        (*FASTEST_TURN, "min_vel_theta", "max_speed_theta"), "robot.limits.omega: [least, largest] [rad/s]"
    ),
    **dict.fromkeys(ACCELERATION, "robot.limits.acceleration [m/s^2]"),
    **dict.fromkeys(DECELERATION, "robot.limits.deceleration [m/s^2]"),
    **dict.fromkeys(TURN_ACCELERATION, "robot.limits.angular_acceleration [rad/s^2]"),
    **dict.fromkeys(TURN_DECELERATION, "robot.limits.angular_deceleration [rad/s^2]"),
    **dict.fromkeys(("wheel_track", "wheelbase", "track_width"), "robot.limits.wheel_separation [m]"),
    **dict.fromkeys(("footprint_padding", "padding", "inflation_radius", "inflation"), _MARGIN),
    "xy_goal_tolerance": "goal.tolerance [m]",
    "yaw_goal_tolerance": "goal.heading_tolerance [rad], with goal.theta",
    **dict.fromkeys(("trans_stopped_velocity", "rot_stopped_velocity"), "goal.speed_tolerance [m/s and rad/s]"),
    "sim_time": "planning.horizon [s]",
    **dict.fromkeys(("allow_unknown", "track_unknown_space"), "map: {file: ..., unknown: free or occupied}"),
    **dict.fromkeys(("yaml_filename", "map_file", "image"), "map: the name of a map's file"),
    "yaw": "theta, or theta_deg in degrees",
}
"""What stands in a scenario file for a key of Nav2 or of ROS 1's navigation."""


@dataclass(frozen=True)
class Nav2Robot:
    """What a file of Nav2's parameters says of the robot and of goals."""

    footprint: Footprint | None = None
    """None where the file has none."""
    limits: dict[str, float] = field(default_factory=dict)
    """The limits that it has, by their names in `Limits`."""
    goal: dict[str, float] = field(default_factory=dict)
    """The tolerances of its goal checker, by their names in `Goal`."""

    def over(self, robot: Robot) -> Robot:
        """A robot with what the file says in the place of its own; limits are yet to be checked."""
        shape = robot.footprint if self.footprint is None else self.footprint
        return replace(robot, footprint=shape, limits=robot.limits._replace(**self.limits))


def nav2_robot(value: object, path: str, report: Report) -> Nav2Robot | None:
    """The robot of a parameter file of Nav2, or of ROS 1's navigation.

    Limits are those of the first controller (``controller_plugins``), then of the velocity smoother, then of any
    section; the footprint is the local costmap's, then the global one's, padded by ``footprint_padding`` as Nav2 pads.
    Where there is one of acceleration and deceleration alone, it is both.
    """
    name = text(value, path, report)
    if name is None:
        return None
    file = report.folder / as_written(name)
    inner = Report()
    try:
        data = read_yaml(file, inner.problems)
        found = _robot_of(data, inner)
        found.over(Robot())
    except InputError as error:
        inner.problems += error.problems
    if not inner.problems and not (found.limits or found.footprint):
        inner.add("", data, "parameters of Nav2: limits of a controller (max_vel_x, ...), a footprint or robot_radius")
    report.adopt(
        [Problem(f"{path}: {file}" + (f": {p.field}" if p.field else ""), p.value, p.expected) for p in inner.problems]
    )
    return None if inner.problems else found


def _robot_of(data: object, report: Report) -> Nav2Robot:
    """What a parameter file says."""
    sections = list(_sections(data, ""))
    names: list[object] = next(
        (s["controller_plugins"] for _, s in sections if isinstance(s.get("controller_plugins"), list)), []
    )
    order = {f".{name}": rank for rank, name in enumerate(reversed(names), start=1)}
    controllers = sorted(sections, key=lambda entry: -_rank(entry[0], order))
    costmaps = sorted(sections, key=lambda entry: ("global_costmap" in entry[0]) - ("local_costmap" in entry[0]))
    checkers = [section for _, section in sections]
    goal = {
        "tolerance": _first(checkers, ["xy_goal_tolerance"], report),
        "heading_tolerance": _first(checkers, ["yaw_goal_tolerance"], report),
    }
    return Nav2Robot(
        _footprint_of(costmaps, report),
        _limits_of([section for _, section in controllers], report),
        {name: value for name, value in goal.items() if value is not None},
    )


def _rank(path: str, controllers: Mapping[str, int]) -> int:
    """How much a section has to say on limits: controllers by their order, then the velocity smoother."""
    return max((2 + rank for end, rank in controllers.items() if path.endswith(end)), default=2 * ("smoother" in path))


def _sections(data: object, path: str) -> Iterator[tuple[str, Mapping[Any, Any]]]:
    """All mappings of a file with their dotted paths, outer ones first."""
    if isinstance(data, Mapping):
        yield path, data
        for name, value in data.items():
            yield from _sections(value, f"{path}.{name}")


def _first(sections: list[Mapping[Any, Any]], names: list[str] | tuple[str, ...], report: Report) -> float | None:
    """The first value that sections have under one of some names; what is no number is reported."""
    for section in sections:
        for name in names:
            value = section.get(name)
            if is_number(value):
                return float(value)
            if value is not None:
                report.add(name, value, "a finite number")
                return None
    return None


def _limits_of(sections: list[Mapping[Any, Any]], report: Report) -> dict[str, float]:
    """The limits of a file, by their names in `Limits`."""
    sections = [section | _smoother(section) for section in map(dict, sections)]
    fastest, slowest, back = (_first(sections, names, report) for names in (FASTEST, SLOWEST, FASTEST_BACKWARDS))
    turn = _first(sections, FASTEST_TURN, report)
    if back is not None:
        slowest = -abs(back)
    found = {
        "v_max": fastest,
        "v_min": None if fastest is None else min(slowest or 0.0, 0.0),
        "omega_max": None if turn is None else abs(turn),
        "omega_min": None if turn is None else -abs(turn),
        **_changes(sections, "acceleration", ACCELERATION, "deceleration", DECELERATION, report),
        **_changes(
            sections, "angular_acceleration", TURN_ACCELERATION, "angular_deceleration", TURN_DECELERATION, report
        ),
    }
    return {name: value for name, value in found.items() if value is not None}


def _changes(
    sections: list[Mapping[Any, Any]],
    faster: str,
    up: tuple[str, ...],
    slower: str,
    down: tuple[str, ...],
    report: Report,
) -> dict[str, float]:
    """Acceleration and deceleration of the first section that has one, under two names, the latter if it differs.

    The sign is a matter of taste, and 0 is taken for none.
    """
    for section in sections:
        gain, loss = (abs(_first([section], names, report) or 0.0) for names in (up, down))
        if gain or loss:
            return {faster: gain or loss} | ({slower: loss} if gain and loss and gain != loss else {})
    return {}


def _smoother(section: Mapping[Any, Any]) -> dict[str, Any]:
    """Limits of Nav2's velocity smoother, lists of [x, y, theta], under the names of a controller."""
    names = {
        "max_velocity": ("max_vel_x", "max_vel_theta"),
        "min_velocity": ("min_vel_x", "min_vel_theta"),
        "max_accel": ("acc_lim_x", "acc_lim_theta"),
        "max_decel": ("decel_lim_x", "decel_lim_theta"),
    }
    lists = {name: section.get(name) for name in names}
    return {
        ours: values[index]
        for name, values in lists.items()
        if isinstance(values, list) and len(values) in (3, 6)
        for ours, index in zip(names[name], (0, -1), strict=True)
    }


def _footprint_of(sections: list[tuple[str, Mapping[Any, Any]]], report: Report) -> Footprint | None:
    """The footprint of the first costmap that has one; a polygon before a radius, as Nav2 takes them."""
    for key in ("footprint", "robot_radius"):
        for path, section in sections:
            value = section.get(key)
            if value in (None, "", "[]", []) or isinstance(value, Mapping):
                continue
            shape = footprint(value, f"{path}.{key}".lstrip("."), report)
            padding = section.get("footprint_padding", 0.0)
            if shape is not None and is_number(padding) and padding > 0.0:
                return _padded(shape, padding)
            return shape
    return None


def _padded(shape: Footprint, padding: float) -> Footprint:
    """A footprint whose corners are moved outwards along both axes, as Nav2 pads it."""
    if shape.vertices is None:
        return Footprint.disc(shape.radius + padding)
    return Footprint.polygon(shape.vertices + padding * np.sign(shape.vertices))
