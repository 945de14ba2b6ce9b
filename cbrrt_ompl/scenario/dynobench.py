"""Problems of the dynobench collection for unicycles of first and second order, read as scenarios."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cbrrt_ompl.checks import is_number
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import InputError, MapError, Problem, Remark, SettingsError
from cbrrt_ompl.files import as_path
from cbrrt_ompl.problem.obstacles import Bounds, Box
from cbrrt_ompl.problem.robot import Footprint, Limits, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.scenario.plain_yaml import read_yaml
from cbrrt_ompl.scenario.sections import (
    Converter,
    Key,
    Report,
    build,
    list_of,
    number,
    one_of,
    pair_of,
    read_section,
    text,
)

if TYPE_CHECKING:
    from cbrrt_ompl.scenario.scenario import Scenario

FIRST_ORDER, SECOND_ORDER = "unicycle1", "unicycle2"
"""The robots that are read, by dynobench's names."""

KINDS = f"{SECOND_ORDER}, the second-order unicycle, or {FIRST_ORDER}, that of first order"

PUBLISHED_TOLERANCE = 0.2
"""Goal tolerance published for planners that sample, in dynobench's metric."""


def load_dynobench(
    problem_path: str | Path,
    model_path: str | Path,
    *,
    forward_only: bool = False,
    tolerance: float = PUBLISHED_TOLERANCE,
) -> Scenario:
    """Scenario of a dynobench problem for one unicycle with a box as its footprint.

    Velocities of a second-order unicycle (``unicycle2``) ramp, those of one of first order (``unicycle1``) jump.

    dynobench measures the distance to the goal as a weighted sum of the errors in position, heading, v and omega. Half
    of the tolerance goes to the position, a quarter to the heading and an eighth to each velocity (to the one with the
    larger weight); of a robot of first order, whose velocities do not count, half to the heading. So whoever arrives in
    the goal region of the scenario is within the tolerance there.

    Args:
        problem_path: YAML file of the problem: environment, start and goal.
        model_path: YAML file of the model: limits, size, weights and time step.
        forward_only: forbid the robot to reverse, which the published model may.
        tolerance: distance to the goal that counts as arrived, in dynobench's metric.

    Returns:
        The scenario, with the model's time step as its integration step.

    Raises:
        MapError: with every mistake in one of the files.
        SettingsError: if the tolerance is not above 0.
        ScenarioError: if the problem has no room for the robot.
    """
    from cbrrt_ompl.scenario.scenario import Scenario

    if not (is_number(tolerance) and tolerance > 0.0):
        raise SettingsError(Problem("tolerance", tolerance, "a number above 0"))
    kind = _kind_of(as_path(model_path, MapError))
    model = _read(as_path(model_path, MapError), _model_keys(kind))
    problem = _read(as_path(problem_path, MapError), _problem_keys(kind))
    unlimited = {} if kind.name == SECOND_ORDER else dict.fromkeys(_ACCELERATIONS, math.inf)
    limits = Limits(**{ours: model[theirs] for ours, theirs in kind.limits.items()}, **unlimited)
    length, width = model["size"]
    corners = [(-length, -width), (length, -width), (length, width), (-length, width)]
    footprint = Footprint.polygon([(0.5 * x, 0.5 * y) for x, y in corners])
    environment, driver = problem["environment"], problem["robots"][0]
    return Scenario(
        name=problem.get("name", Path(problem_path).stem),
        world=World(Bounds(environment["min"], environment["max"]), environment.get("obstacles", [])),
        robot=Robot(footprint, limits._replace(v_min=0.0) if forward_only else limits),
        start=State(*driver["start"]),
        goal=_goal(driver["goal"], model["distance_weights"], tolerance),
        planning=PlanningSettings(step=model["dt"]),
    )


@dataclass(frozen=True)
class _Kind:
    """What the files of one kind of robot hold."""

    name: str
    """Beginning of dynobench's name."""
    state: str
    """Numbers of a state."""
    weights: str
    """What is weighted in the distance to the goal."""
    limits: Mapping[str, str]
    """dynobench's names of the limits, by those in `Limits`."""


def _kind_of(path: Path) -> _Kind:
    """The kind of a model; others are refused by the name that their file gives them, not by the keys that they lack.

    A file without a name is taken for one of second order.
    """
    try:
        data = read_yaml(path, [])
    except InputError as error:
        raise MapError(error.problems, str(path)) from None
    if not isinstance(data, Mapping):
        return _KINDS[SECOND_ORDER]
    slowest, kind = data.get("min_vel"), data.get("dynamics")
    if is_number(slowest) and slowest > 0.0:
        expected = "0 or less: a robot that cannot stand still is not planned for"
        raise MapError(Problem("min_vel", slowest, expected), str(path))
    if not isinstance(kind, str):
        return _KINDS[SECOND_ORDER]
    found = next((known for name, known in _KINDS.items() if kind.startswith(name)), None)
    if found is None:
        raise MapError(Problem("dynamics", Remark(f"the robot {kind}"), KINDS), str(path))
    return found


def _goal(state: list[float], weights: list[float], tolerance: float) -> Goal:
    """Goal region inside the ball about a state in dynobench's metric."""
    position, heading, *velocities = weights
    return Goal(
        x=state[0],
        y=state[1],
        tolerance=tolerance / (2.0 * position),
        theta=state[2],
        heading_tolerance=tolerance / ((4.0 if velocities else 2.0) * heading),
        speed_tolerance=tolerance / (8.0 * max(velocities)) if velocities else None,
    )


def _read(path: Path, keys: Mapping[str, Key]) -> dict[str, Any]:
    """Values of a YAML file; keys of no interest are skipped."""
    report = Report()
    try:
        values = _known(read_yaml(path, report.problems), "", keys, report)
    except InputError as error:
        raise MapError(error.problems, str(path)) from None
    if values is None or report.problems:
        raise MapError(report.problems, str(path))
    return values


def _known(value: object, path: str, keys: Mapping[str, Key], report: Report) -> dict[str, Any] | None:
    """Values of the keys of a section, others skipped."""
    if isinstance(value, Mapping):
        value = {key: entry for key, entry in value.items() if key in keys}
    return read_section(value, path, keys, report)


def _numbers(names: str) -> Converter:
    """Reader of a list of as many finite numbers as there are names."""
    count = len(names.split(", "))

    def read(value: object, path: str, report: Report) -> list[float] | None:
        silent = Report()
        values = [number(entry, path, silent) for entry in value] if isinstance(value, list) else []
        if len(values) == count and not silent.problems:
            return [entry for entry in values if entry is not None]
        report.add(path, value, f"{count} finite numbers [{names}]")
        return None

    return read


def _positive(value: object, path: str, report: Report) -> float | None:
    found = number(value, path, report)
    if found is not None and found <= 0.0:
        report.add(path, value, "a number above 0")
        return None
    return found


def _weights(names: str) -> Converter:
    """Reader of a weight for each of some names."""

    def read(value: object, path: str, report: Report) -> list[float] | None:
        values: list[float] | None = _numbers(names)(value, path, report)
        if values is not None and min(values) <= 0.0:
            report.add(path, value, f"{len(values)} weights above 0")
            return None
        return values

    return read


def _environment(value: object, path: str, report: Report) -> dict[str, Any] | None:
    values = _known(value, path, _ENVIRONMENT, report)
    corners = values and {name: values[name] for name in ("min", "max")}
    return values if build(Bounds, corners, path, report) else None


def _box(value: object, path: str, report: Report) -> Box | None:
    values = read_section(value, path, _BOX, report)
    if values is None:
        return None
    (x, y), (w, h) = values["center"], values["size"]
    corners = {"min": (x - 0.5 * w, y - 0.5 * h), "max": (x + 0.5 * w, y + 0.5 * h)}
    return build(Box, corners, path, report)


def _rest(names: str) -> Converter:
    """Reader of a state at rest."""

    def read(value: object, path: str, report: Report) -> list[float] | None:
        values: list[float] | None = _numbers(names)(value, path, report)
        if values is not None and any(values[3:]):
            report.add(path, value, "a state at rest: v and omega 0")
            return None
        return values

    return read


def _drivers(kind: _Kind) -> Converter:
    """Reader of a list of one robot of a kind."""
    keys = {
        "type": Key(text),
        "start": Key(_numbers(kind.state), required=f"the state to start in [{kind.state}]"),
        "goal": Key(_rest(kind.state), required=f"the state to arrive in [{kind.state}]"),
    }

    def driver(value: object, path: str, report: Report) -> dict[str, Any] | None:
        return _known(value, path, keys, report)

    def read(value: object, path: str, report: Report) -> list[Any] | None:
        if not isinstance(value, list) or len(value) != 1:
            several = isinstance(value, list) and len(value) > 1
            found = Remark(f"{len(value)} robots") if several else value  # type: ignore[arg-type]  # a list
            report.add(path, found, f"a list of one robot{': problems of several are not planned for' * several}")
            return None
        name = value[0].get("type") if isinstance(value[0], Mapping) else None
        if isinstance(name, str) and not name.startswith(kind.name):
            report.add(f"{path}[0].type", Remark(f"the robot {name}"), f"{kind.name}, which the model describes")
            return None
        found_robots: list[Any] = list_of(driver, "")(value, path, report)
        return found_robots

    return read


_pair = pair_of("two finite numbers [x, y] [m]")
_BOX = {
    "type": Key(one_of(["box"]), required="box"),
    "center": Key(_pair, required="the centre [x, y] [m]"),
    "size": Key(_pair, required="the sides [width, height] [m]"),
}
_ENVIRONMENT = {
    "min": Key(_pair, required="the lower left corner [x, y] [m]"),
    "max": Key(_pair, required="the upper right corner [x, y] [m]"),
    "obstacles": Key(list_of(_box, "a list of boxes")),
}
_VELOCITIES = {"v_min": "min_vel", "v_max": "max_vel", "omega_min": "min_angular_vel", "omega_max": "max_angular_vel"}
_ACCELERATIONS = {"acceleration": "max_acc_abs", "angular_acceleration": "max_angular_acc"}
_KINDS = {
    FIRST_ORDER: _Kind(FIRST_ORDER, "x, y, theta", "position, theta", _VELOCITIES),
    SECOND_ORDER: _Kind(
        SECOND_ORDER, "x, y, theta, v, omega", "position, theta, v, omega", _VELOCITIES | _ACCELERATIONS
    ),
}


def _problem_keys(kind: _Kind) -> dict[str, Key]:
    """Keys of the problems of a kind."""
    return {
        "name": Key(text),
        "environment": Key(_environment, required="min, max and obstacles"),
        "robots": Key(_drivers(kind), required="a list of one robot"),
    }


def _model_keys(kind: _Kind) -> dict[str, Key]:
    """Keys of the models of a kind."""
    return {
        **{name: Key(number, required="a number") for name in kind.limits.values()},
        "size": Key(_pair, required="length and width of the footprint [m]"),
        "distance_weights": Key(_weights(kind.weights), required=f"the weights [{kind.weights}] above 0"),
        "dt": Key(_positive, required="the time step [s]"),
    }
