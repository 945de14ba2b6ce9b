"""The format of scenario files: which keys they have, what is read from them and what is written."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import MISSING
from cbrrt_ompl.problem.obstacles import Bounds, Box, Disc, Obstacle, OrientedBox, Polygon
from cbrrt_ompl.problem.ready_robots import ROBOTS
from cbrrt_ompl.problem.robot import Gains, Limits, Robot
from cbrrt_ompl.problem.settings import CUT_EXTENSION, NEAREST_NEIGHBOUR, Goal, PlanningSettings, State
from cbrrt_ompl.scenario.footprints import disc, footprint
from cbrrt_ompl.scenario.map_layers import load_layers, map_layers, source_data
from cbrrt_ompl.scenario.nav2 import FOREIGN_KEYS, Nav2Robot, nav2_robot
from cbrrt_ompl.scenario.sections import (
    UNLIMITED,
    Key,
    Report,
    build,
    flag,
    kind_of,
    list_of,
    number,
    number_or_unlimited,
    one_of,
    pair_of,
    read_partial,
    read_section,
    shape_of,
    text,
    whole_number,
)


def read_parts(data: object, folder: Path, report: Report) -> dict[str, Any]:
    """Parts of a scenario as far as they can be read.

    Args:
        data: plain value of a scenario file.
        folder: what the map's file is relative to.
        report: where the mistakes go.

    Returns:
        The attributes of a scenario that were given and right; the world also where single obstacles are wrong.
    """
    report.homes, report.foreign, report.folder = HOMES, FOREIGN_KEYS, folder
    found = read_partial(data, "", SCENARIO, report)
    obstacles: list[Obstacle] = found.pop("obstacles", [])
    bounds: Bounds | None = found.pop("bounds", None)
    if layers := found.pop("map", None):
        loaded = load_layers(layers, folder, report)
        if loaded is not None:
            found["map"], map_bounds, map_obstacles = loaded
            bounds = bounds or map_bounds
            obstacles = map_obstacles + obstacles
    elif isinstance(data, Mapping) and not {"bounds", "map"} & data.keys():
        report.add("bounds", MISSING, "the corners {min: [x, y], max: [x, y]} [m], or a map")
    if bounds is not None:
        found["world"] = build(World, {"bounds": bounds, "obstacles": obstacles}, "obstacles", report)
    return {name: value for name, value in found.items() if value is not None}


def scenario_data(parts: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Plain value of a scenario, from which :func:`read_parts` reads equal parts.

    Args:
        parts: all attributes of the scenario by name.
        folder: what the map's file is to be relative to.

    Returns:
        Mappings, lists, texts and numbers, angles in radians.
    """
    world, source = parts["world"], parts["map"]
    data: dict[str, Any] = {
        "name": parts["name"],
        "bounds": _box_data(world.bounds),
        "obstacles": [_obstacle_data(o) for o in world.obstacles[source.obstacles if source else 0 :]],
    }
    if source is not None:
        data["map"] = source_data(source, folder)
    return data | {
        "robot": robot_data(parts["robot"]),
        "start": {name: float(value) for name, value in parts["start"]._asdict().items()},
        "goal": _goal_data(parts["goal"]),
        "planning": _planning_data(parts["planning"]),
    }


_POINT = "a point [x, y] of finite numbers [m]"
_pair = pair_of(_POINT)
_corners = list_of(_pair, "a list of corners [[x, y], ...] [m]")
_range = pair_of("a range [low, high] of finite numbers")
_x, _y = Key(number, required="a number [m]"), Key(number, required="a number [m]")
_rectangle = {"min": Key(_pair, required=_POINT), "max": Key(_pair, required=_POINT)}


def _bounds(value: object, path: str, report: Report) -> Bounds | None:
    return build(Bounds, read_section(value, path, _rectangle, report), path, report)


def obstacle(value: object, path: str, report: Report) -> Obstacle | None:
    """An obstacle of any type."""
    kinds: dict[str, type] = {"box": Box, "oriented_box": OrientedBox, "disc": Disc, "polygon": Polygon}
    kind = kind_of(value, path, OBSTACLES, report)
    return None if kind is None else build(kinds[kind], shape_of(value, path, OBSTACLES[kind], report), path, report)


def _limits(value: object, path: str, report: Report) -> dict[str, Any] | None:
    """The limits that are given, by their names in `Limits`."""
    values = read_section(value, path, LIMITS, report)
    if values is None:
        return None
    if values.get("acceleration") == math.inf:
        values.setdefault("angular_acceleration", math.inf)
    for name in {"v", "omega"} & values.keys():
        values[f"{name}_min"], values[f"{name}_max"] = values.pop(name)
    return values


def _gains(value: object, path: str, report: Report) -> dict[str, Any] | None:
    """The gains that are given."""
    return read_section(value, path, GAINS, report)


def _model(value: object, path: str, report: Report) -> Robot | None:
    name = one_of(list(ROBOTS))(value, path, report)
    return None if name is None else ROBOTS[name]


def _robot(value: object, path: str, report: Report) -> Robot | None:
    """A ready robot by its name; or one described in full, or by what differs from a ready one or from Nav2's."""
    if isinstance(value, str):
        return _model(value, path, report)
    values = read_section(value, path, ROBOT, report)
    if values is None or not isinstance(value, Mapping):
        return None
    model = values.pop("model", Robot())
    nav2: Nav2Robot | None = values.pop("nav2", None)
    if nav2 is not None:
        model = nav2.over(model)
        report.defaults["goal"] = nav2.goal
    if "robot_radius" in values:
        if "footprint" in values:
            report.add(f"{path}.robot_radius", value["robot_radius"], "either footprint or robot_radius")
            return None
        values["footprint"] = values.pop("robot_radius")
    for part in {"limits", "gains"} & values.keys():
        values[part] = (getattr(model, part) or Gains())._replace(**values[part])
    return build(partial(replace, model), values, path, report)


def _start(value: object, path: str, report: Report) -> State | None:
    return build(State, read_section(value, path, START, report), path, report)


def _goal(value: object, path: str, report: Report) -> Goal | None:
    values = read_section(value, path, GOAL, report)
    if values is not None:
        usual = report.defaults.get("goal", {})
        values = {name: usual[name] for name in usual if name == "tolerance" or "theta" in values} | values
    if values is not None and "heading_tolerance" in values and "theta" not in values:
        report.add(f"{path}.theta", MISSING, f"the heading that {path}.heading_tolerance is about [rad]")
        return None
    return build(Goal, values, path, report)


def _planning(value: object, path: str, report: Report) -> PlanningSettings | None:
    return build(PlanningSettings, read_section(value, path, PLANNING, report), path, report)


OBSTACLES: dict[str, dict[str, Key]] = {
    "box": _rectangle,
    "oriented_box": {
        "center": Key(_pair, required=_POINT),
        "size": Key(pair_of("two sides [length, width] [m]"), required="two sides [length, width] [m]"),
        "angle": Key(number, required="the direction of the first side [rad]", is_angle=True),
    },
    "disc": {"center": Key(_pair, required=_POINT), "radius": Key(number, required="a radius above 0 [m]")},
    "polygon": {
        "vertices": Key(_corners, required="a list of corners [[x, y], ...] [m]"),
        "holes": Key(list_of(_corners, "a list of rings, each a list of corners")),
    },
}
LIMITS = {
    "v": Key(_range),
    "omega": Key(_range, is_angle=True),
    "acceleration": Key(number_or_unlimited),
    "angular_acceleration": Key(number_or_unlimited, is_angle=True),
    "deceleration": Key(number),
    "angular_deceleration": Key(number, is_angle=True),
    "wheel_separation": Key(number),
    "wheel_speed": Key(number_or_unlimited),
    "wheel_acceleration": Key(number_or_unlimited),
}
GAINS = {name: Key(number) for name in Gains._fields}
ROBOT = {
    "model": Key(_model),
    "nav2": Key(nav2_robot),
    "footprint": Key(footprint),
    "robot_radius": Key(disc),
    "limits": Key(_limits),
    "gains": Key(_gains),
}
START = {
    "x": _x,
    "y": _y,
    "theta": Key(number, is_angle=True),
    "v": Key(number),
    "omega": Key(number, is_angle=True),
}
GOAL = {
    "x": _x,
    "y": _y,
    "tolerance": Key(number),
    "theta": Key(number, is_angle=True),
    "heading_tolerance": Key(number, is_angle=True),
    "speed_tolerance": Key(number),
}
PLANNING = {
    "horizon": Key(number),
    "step": Key(number),
    "goal_bias": Key(number),
    "max_samples": Key(whole_number),
    "cut_extension": Key(one_of(CUT_EXTENSION)),
    "equal_control_tolerance": Key(number),
    "look_ahead": Key(number),
    "closed_loop": Key(flag),
    "law": Key(text),
    "final_approach": Key(flag),
    "brake_safe": Key(flag),
    "clearance": Key(number),
    "nearest_neighbour": Key(one_of(NEAREST_NEIGHBOUR)),
}
SCENARIO = {
    "name": Key(text, required="one line of text"),
    "bounds": Key(_bounds),
    "obstacles": Key(list_of(obstacle, "a list of obstacles")),
    "map": Key(map_layers),
    "robot": Key(_robot),
    "start": Key(_start, required="the state to start in, {x: 0.0, y: 0.0, theta: 0.0} [m, m, rad]"),
    "goal": Key(_goal, required="the goal region, {x: 0.0, y: 0.0, tolerance: 0.5} [m]"),
    "planning": Key(_planning),
}
HOMES = {
    **dict.fromkeys(("tolerance", "heading_tolerance", "speed_tolerance"), "goal"),
    **dict.fromkeys(PLANNING, "planning"),
    **dict.fromkeys(LIMITS, "robot.limits"),
    **dict.fromkeys(GAINS, "robot.gains"),
    **dict.fromkeys(ROBOT, "robot"),
    **dict.fromkeys(("bounds", "obstacles", "start", "goal", "planning"), "the top level"),
}
"""Where a key belongs that stands in another section."""


def _box_data(box: Bounds | Box) -> dict[str, Any]:
    return {"min": _floats(box.min), "max": _floats(box.max)}


def _obstacle_data(obstacle: Obstacle) -> dict[str, Any]:
    if isinstance(obstacle, Box):
        return {"type": "box", **_box_data(obstacle)}
    if isinstance(obstacle, OrientedBox):
        center, size = _floats(obstacle.center), _floats(obstacle.size)
        return {"type": "oriented_box", "center": center, "size": size, "angle": float(obstacle.angle)}
    if isinstance(obstacle, Disc):
        return {"type": "disc", "center": _floats(obstacle.center), "radius": float(obstacle.radius)}
    holes = {"holes": [ring.tolist() for ring in obstacle.holes]} if obstacle.holes else {}
    return {"type": "polygon", "vertices": obstacle.vertices.tolist(), **holes}


def robot_data(robot: Robot) -> dict[str, Any]:
    """Plain value of a robot, without what is left out."""
    footprint, limits = robot.footprint, robot.limits
    return {
        "footprint": {"type": "disc", "radius": float(footprint.radius)}
        if footprint.vertices is None
        else {"type": "polygon", "vertices": footprint.vertices.tolist()},
        "limits": {
            "v": _floats((limits.v_min, limits.v_max)),
            "omega": _floats((limits.omega_min, limits.omega_max)),
            "acceleration": UNLIMITED if limits.is_first_order else float(limits.acceleration),
            "angular_acceleration": UNLIMITED if limits.is_first_order else float(limits.angular_acceleration),
            **_own_limits(limits, "deceleration", "angular_deceleration"),
            **({"wheel_separation": float(limits.wheel_separation)} if limits.wheel_separation else {}),
            **_own_limits(limits, "wheel_speed", "wheel_acceleration"),
        },
        **({} if robot.gains is None else {"gains": {k: float(value) for k, value in robot.gains._asdict().items()}}),
    }


def _own_limits(limits: Limits, *names: str) -> dict[str, float]:
    """Those of some limits that there are."""
    given = {name: float(getattr(limits, name)) for name in names}
    return {name: value for name, value in given.items() if value < math.inf}


def _goal_data(goal: Goal) -> dict[str, Any]:
    """The goal; a heading tolerance without a heading has no meaning and is left out."""
    skipped = {"heading_tolerance"} if goal.theta is None else set()
    return {name: float(value) for name, value in asdict(goal).items() if value is not None and name not in skipped}


def _planning_data(planning: PlanningSettings) -> dict[str, Any]:
    """The settings, numbers of NumPy turned into Python's."""
    given = {name: value for name, value in asdict(planning).items() if value is not None}
    return {name: value.item() if hasattr(value, "item") else value for name, value in given.items()}


def _floats(values: tuple[float, float]) -> list[float]:
    return [float(value) for value in values]
