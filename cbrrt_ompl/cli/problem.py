"""Arguments that make a scenario out of a map, or change one that was read."""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cbrrt_ompl.cli.arguments import metres
from cbrrt_ompl.errors import MISSING, InputError, Problem

if TYPE_CHECKING:
    from cbrrt_ompl.scenario.map_layers import MapSource
    from cbrrt_ompl.scenario.maps.occupancy_map import OccupancyMap
    from cbrrt_ompl.scenario.scenario import Scenario
    from cbrrt_ompl.scenario.sections import Report
    from cbrrt_ompl.scenario.sources import Source

REST_SPEED = 0.01
"""Speed to arrive with under ``--rest``, of v [m/s] and of omega [rad/s]."""

GOAL = {"tolerance": 0.25, "heading_tolerance": 0.25}
"""Tolerances of a goal in a map [m, rad], those of Nav2's goal checker."""

CLEARANCE = 0.05
"""Distance to keep in a map [m]."""

MAP_PLANNERS = ("cb-rrt-anytime", "cb-rrt-robust")
"""Planners for maps: the first one that there is."""


def map_planner() -> str:
    """The planner for maps where none is named."""
    from cbrrt_ompl.planners.registry import PLANNERS

    return next(name for name in MAP_PLANNERS if name in PLANNERS)


def add_problem(parser: argparse.ArgumentParser) -> None:
    """``--robot``, ``--start``, ``--goal`` and what else makes a scenario out of a map, or changes a scenario."""
    group = parser.add_argument_group("in a map, or instead of what the scenario says")
    add_robot(group)
    group.add_argument("--start", nargs=3, metavar=("X", "Y", "THETA"), help="start [m, m, rad]; 90deg is an angle too")
    group.add_argument(
        "--goal", nargs="+", metavar="X Y THETA", help="goal X Y [m], or X Y THETA to arrive in a heading"
    )
    group.add_argument("--rest", action="store_true", help="arrive at rest")
    text = f"distance to keep from all that is around (default in a map: {CLEARANCE})"
    group.add_argument("--clearance", type=clearance, metavar="M", help=text)
    text = "any key of a scenario, as planning.horizon=1 or goal.tolerance=0.1; may be repeated"
    group.add_argument("--set", action="append", metavar="KEY=VALUE", help=text)
    add_map_options(group)


def add_robot(parser: argparse._ActionsContainer) -> None:
    """``--robot``."""
    text = "a ready robot (see 'cbrrt robots'), or a file of Nav2's parameters"
    parser.add_argument("--robot", metavar="NAME", help=text)


def add_map_options(parser: argparse._ActionsContainer) -> None:
    """``--resolution`` and ``--unknown``, which are about the map."""
    parser.add_argument("--resolution", type=metres, metavar="M", help="side of a cell of an image or a MovingAI map")
    text = "what unknown cells count as: occupied (the default) or free"
    parser.add_argument("--unknown", choices=("occupied", "free"), metavar="WHAT", help=text)


def given_scenario(arguments: argparse.Namespace, before_kernels: Callable[[], None]) -> Scenario:
    """The scenario of a command line, checked; remarks on its map go to stderr.

    Args:
        arguments: the command line.
        before_kernels: called before anything is asked of compiled code.

    Raises:
        InputError: with every mistake in it.
    """
    from cbrrt_ompl.scenario.scenario import make_scenario

    scenario = make_scenario(*given_source(arguments), before_kernels)
    print_remarks(scenario.map)
    return scenario


def given_source(arguments: argparse.Namespace, may_lack: bool = False) -> tuple[Source, Report]:
    """Plain values of the scenario of a command line, and what was wrong with reading them.

    Args:
        arguments: the command line.
        may_lack: whether a map may come without a robot, a start or a goal.

    Raises:
        InputError: if they cannot be read, or an argument is wrong or missing.
    """
    from cbrrt_ompl.scenario.sections import Report
    from cbrrt_ompl.scenario.sources import Source, is_map, read_source

    report = Report()
    if is_map(arguments.scenario):
        if not may_lack:
            _check_given(arguments)
        source = Source(map_data(arguments.scenario, arguments), str(arguments.scenario), Path())
    else:
        source = read_source(arguments.scenario, report)
    changes = _changes(arguments)
    if not changes or not isinstance(source.data, dict):
        return source, report
    data = dict(source.data)
    for path, value in changes:
        _put(data, path, value)
    return source._replace(data=data), report


def map_data(path: Path, arguments: argparse.Namespace) -> dict[str, Any]:
    """The scenario of a map, without its robot, start and goal."""
    return {
        "name": path.stem,
        "map": {"file": os.fspath(path)},
        "goal": dict(GOAL) if arguments.goal and len(arguments.goal) > 2 else {"tolerance": GOAL["tolerance"]},
        "planning": {"clearance": CLEARANCE},
    }


def print_remarks(source: MapSource | OccupancyMap | None) -> None:
    """Print what was not taken as the files of a map say."""
    for remark in source.remarks if source is not None else ():
        print(f"cbrrt: {remark}", file=sys.stderr)


def _check_given(arguments: argparse.Namespace) -> None:
    """Ask for what a map lacks to be a scenario, all at once."""
    from cbrrt_ompl.problem.ready_robots import ROBOTS

    axes = f"('cbrrt show {arguments.scenario}' draws the map with its axes)"
    wanted = {
        "robot": f"one of {', '.join(ROBOTS)}, or a file of Nav2's parameters",
        "start": f"X Y THETA in the map [m, m, rad] {axes}",
        "goal": f"X Y in the map [m], or X Y THETA {axes}",
    }
    missing = [Problem(f"--{name}", MISSING, text) for name, text in wanted.items() if getattr(arguments, name) is None]
    if missing:
        raise InputError(missing, str(arguments.scenario))


def _changes(arguments: argparse.Namespace) -> list[tuple[tuple[str, ...], object]]:
    """What the options change in a scenario: paths of keys and their values, later ones over earlier ones."""
    problems: list[Problem] = []
    changes: list[tuple[tuple[str, ...], object]] = []
    if arguments.robot is not None:
        changes.append((("robot",), robot_value(arguments.robot)))
    for name in ("start", "goal"):
        words = getattr(arguments, name)
        if words is not None:
            changes += [((name, key), value) for key, value in pose(name, words, problems).items()]
    changes += [
        (path, value)
        for path, value in (
            (("goal", "speed_tolerance"), REST_SPEED if arguments.rest else None),
            (("planning", "clearance"), arguments.clearance),
            (("map", "resolution"), arguments.resolution),
            (("map", "unknown"), arguments.unknown),
        )
        if value is not None
    ]
    for text in arguments.set or ():
        key, separator, value = text.partition("=")
        path = tuple(key.strip().split("."))
        if not separator or not all(path):
            problems.append(Problem("--set", text, "KEY=VALUE, as planning.horizon=1"))
        else:
            changes.append((path, _value(value, problems)))
    if problems:
        raise InputError(problems)
    return changes


def robot_value(name: str) -> object:
    """What stands under ``robot`` for a ready robot or for a file of Nav2's parameters."""
    is_file = Path(name).suffix.lower() in (".yaml", ".yml") or os.sep in name
    return {"nav2": os.path.abspath(name)} if is_file else name


def pose(name: str, words: Sequence[str], problems: list[Problem]) -> dict[str, float]:
    """The keys of a start or a goal from the words of its option."""
    keys = ("x", "y", "theta")
    values = [_angle(word) if key == "theta" else _number(word) for key, word in zip(keys, words, strict=False)]
    if len(words) not in (2, 3) or None in values:
        wrong = next((word for word, value in zip(words, values, strict=False) if value is None), " ".join(words))
        expected = "X Y THETA" if name == "start" else "X Y, or X Y THETA"
        problems.append(Problem(f"--{name}", wrong, f"numbers {expected} [m, m, rad]; an angle may be 90deg"))
        return {}
    return {key: value for key, value in zip(keys, values, strict=False) if value is not None}


def clearance(text: str) -> float:
    """A distance of 0 or more from the command line [m]."""
    value = _number(text)
    if value is None or value < 0.0:
        raise argparse.ArgumentTypeError(str(Problem("", text, "a number of metres, 0 or more")))
    return value


def _angle(text: str) -> float | None:
    """An angle in radians, or in degrees with the unit behind it [rad]."""
    number = text.removesuffix("deg")
    value = _number(number)
    return value if value is None or number == text else math.radians(value)


def _number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _value(text: str, problems: list[Problem]) -> object:
    """A value as a scenario file would have it."""
    from cbrrt_ompl.scenario.plain_yaml import parse_yaml

    try:
        return parse_yaml(text, problems)
    except InputError as error:
        problems.append(Problem("--set", text, f"a value in {error.problems[0].expected.removeprefix('valid ')}"))
        return None


_SHORT = {"robot": "model", "map": "file"}
"""Sections that a text alone stands for, and the key that it is then."""


def _put(data: dict[str, Any], path: Sequence[str], value: object) -> None:
    """Put a value at a path of plain values, which are copied on the way; degrees give way to radians and back."""
    name, *rest = path
    if rest:
        inner = data.get(name)
        if isinstance(inner, str) and name in _SHORT:
            inner = {_SHORT[name]: inner}
        inner = dict(inner) if isinstance(inner, dict) else {}
        _put(inner, rest, value)
        value = inner
    data.pop(name.removesuffix("_deg") if name.endswith("_deg") else f"{name}_deg", None)
    data[name] = value
