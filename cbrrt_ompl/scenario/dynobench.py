"""Problems of the dynobench collection for second-order unicycles, read as scenarios."""

from __future__ import annotations

from collections.abc import Mapping
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

MODEL = "unicycle2"
"""The robot that is read, by dynobench's name."""

PUBLISHED_TOLERANCE = 0.2
"""Goal tolerance published for planners that sample, in dynobench's metric."""


def load_dynobench(
    problem_path: str | Path,
    model_path: str | Path,
    *,
    forward_only: bool = False,
    tolerance: float = PUBLISHED_TOLERANCE,
) -> Scenario:
    """Scenario of a dynobench problem for one second-order unicycle with a box as its footprint.

    dynobench measures the distance to the goal as a weighted sum of the errors in position, heading, v and omega. Half
    of the tolerance goes to the position, a quarter to the heading and an eighth to each velocity (to the one with the
    larger weight), so that whoever arrives in the goal region of the scenario is within the tolerance there.

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
    _refuse_other_kinds(as_path(model_path, MapError))
    model = _read(as_path(model_path, MapError), _MODEL)
    problem = _read(as_path(problem_path, MapError), _PROBLEM)
    limits = Limits(**{ours: model[theirs] for ours, theirs in _LIMITS.items()})
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


def _refuse_other_kinds(path: Path) -> None:
    """Refuse models of other robots by the name that their file gives them, and not by the keys that they lack."""
    try:
        data = read_yaml(path, [])
    except InputError as error:
        raise MapError(error.problems, str(path)) from None
    if not isinstance(data, Mapping):
        return
    slowest, kind = data.get("min_vel"), data.get("dynamics")
    if is_number(slowest) and slowest > 0.0:
        expected = "0 or less: a robot that cannot stand still is not planned for"
        raise MapError(Problem("min_vel", slowest, expected), str(path))
    if isinstance(kind, str) and not kind.startswith(MODEL):
        expected = f"{MODEL}, the second-order unicycle"
        raise MapError(Problem("dynamics", Remark(f"the robot {kind}"), expected), str(path))


def _goal(state: list[float], weights: list[float], tolerance: float) -> Goal:
    """Goal region inside the ball about a state in dynobench's metric."""
    position, heading, v, omega = weights
    return Goal(
        x=state[0],
        y=state[1],
        tolerance=tolerance / (2.0 * position),
        theta=state[2],
        heading_tolerance=tolerance / (4.0 * heading),
        speed_tolerance=tolerance / (8.0 * max(v, omega)),
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


def _weights(value: object, path: str, report: Report) -> list[float] | None:
    values: list[float] | None = _numbers("position, theta, v, omega")(value, path, report)
    if values is not None and min(values) <= 0.0:
        report.add(path, value, "four weights above 0")
        return None
    return values


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


def _rest(value: object, path: str, report: Report) -> list[float] | None:
    values: list[float] | None = _numbers(_STATE)(value, path, report)
    if values is not None and values[3:] != [0.0, 0.0]:
        report.add(path, value, "a state at rest: v and omega 0")
        return None
    return values


def _driver(value: object, path: str, report: Report) -> dict[str, Any] | None:
    return _known(value, path, _DRIVER, report)


def _drivers(value: object, path: str, report: Report) -> list[Any] | None:
    if not isinstance(value, list) or len(value) != 1:
        several = isinstance(value, list) and len(value) > 1
        found = Remark(f"{len(value)} robots") if several else value  # type: ignore[arg-type]  # a list
        report.add(path, found, f"a list of one robot{': problems of several are not planned for' * several}")
        return None
    kind = value[0].get("type") if isinstance(value[0], Mapping) else None
    if isinstance(kind, str) and not kind.startswith(MODEL):
        report.add(f"{path}[0].type", Remark(f"the robot {kind}"), f"{MODEL}, the second-order unicycle")
        return None
    found_robots: list[Any] = list_of(_driver, "")(value, path, report)
    return found_robots


_STATE = "x, y, theta, v, omega"
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
_DRIVER = {
    "type": Key(text),
    "start": Key(_numbers(_STATE), required=f"the state to start in [{_STATE}]"),
    "goal": Key(_rest, required=f"the state to arrive in [{_STATE}]"),
}
_PROBLEM = {
    "name": Key(text),
    "environment": Key(_environment, required="min, max and obstacles"),
    "robots": Key(_drivers, required="a list of one robot"),
}
_LIMITS = {
    "v_min": "min_vel",
    "v_max": "max_vel",
    "omega_min": "min_angular_vel",
    "omega_max": "max_angular_vel",
    "acceleration": "max_acc_abs",
    "angular_acceleration": "max_angular_acc",
}
_MODEL = {
    **{name: Key(number, required="a number") for name in _LIMITS.values()},
    "size": Key(_pair, required="length and width of the footprint [m]"),
    "distance_weights": Key(_weights, required="four weights above 0"),
    "dt": Key(_positive, required="the time step [s]"),
}
