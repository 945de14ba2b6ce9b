"""A planning problem: world, robot, start, goal and settings, checked together; read from and written to YAML."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from cbrrt_ompl.checks import A_NUMBER, LARGEST, is_number
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import Problem, Remark, ScenarioError
from cbrrt_ompl.files import as_path, write_file
from cbrrt_ompl.problem.robot import Limits, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.scenario.map_layers import MapSource
from cbrrt_ompl.scenario.plain_yaml import dump_line
from cbrrt_ompl.scenario.scenario_file import read_parts, scenario_data
from cbrrt_ompl.scenario.sections import Report
from cbrrt_ompl.scenario.sources import Source, read_source
from cbrrt_ompl.scenario.why_not import why_not
from cbrrt_ompl.shown import Shown

HORIZON_TOLERANCE = 0.01
"""Share of the horizon that rounding it to whole steps may add or take away."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Scenario(Shown):
    """What to plan: the paper's robot and settings unless others are given.

    Raises:
        ScenarioError: with every reason why nobody could plan in it.
    """

    name: str
    """Name in figures and tables: one line of text."""
    world: World
    """Bounds and obstacles."""
    robot: Robot = Robot()
    """Footprint, limits and gains."""
    start: State
    """Where the robot starts, and how fast it is."""
    goal: Goal
    """Where it is to arrive."""
    planning: PlanningSettings = PlanningSettings()
    """Settings of the planners."""
    map: MapSource | None = None
    """The map that the first obstacles of the world came from, if any."""

    def __post_init__(self) -> None:
        """Check that the parts fit each other."""
        _check_types(self)
        problems = find_problems(scenario_parts(self))
        if problems:
            raise ScenarioError(problems)
        object.__setattr__(self, "start", State(*map(float, self.start)))

    def __eq__(self, other: object) -> bool:
        """Equal where all numbers are; worlds count by their bounds and obstacles."""
        if not isinstance(other, Scenario):
            return NotImplemented
        return self._key() == other._key()

    def __repr__(self) -> str:
        """Name, world, and from where to where."""
        start, goal = self.start, self.goal
        way = f"({start.x:.4g}, {start.y:.4g}) to ({goal.x:.4g}, {goal.y:.4g})"
        return f"Scenario({self.name!r}, {self.world!r}, {way})"

    def __hash__(self) -> int:
        """Hash of all parts."""
        return hash(self._key())

    def _key(self) -> tuple[Any, ...]:
        world = (self.world.bounds, self.world.obstacles)
        return self.name, world, self.robot, self.start, self.goal, self.planning, self.map


def scenario_parts(scenario: Scenario) -> dict[str, Any]:
    """The attributes of a scenario by name."""
    return {field.name: getattr(scenario, field.name) for field in fields(scenario)}


def check_scenario(value: object) -> None:
    """Refuse what is no scenario.

    Raises:
        ScenarioError: if it is none.
    """
    if not isinstance(value, Scenario):
        raise ScenarioError(Problem("scenario", value, "a value of type Scenario"))


def load_scenario(path: str | Path) -> Scenario:
    """Scenario from a YAML file.

    Args:
        path: the file; or the name of a scenario that comes with the package, where there is no such file; or a problem
            of a MovingAI benchmark, ``arena.map.scen:12`` for the twelfth.

    Returns:
        The scenario, checked.

    Raises:
        ScenarioError: with every mistake in the file, one line each.
    """
    report = Report()
    return make_scenario(read_source(as_path(path, ScenarioError), report), report)


def save_scenario(scenario: Scenario, path: str | Path) -> None:
    """Write a scenario to a YAML file, from which :func:`load_scenario` makes an equal one.

    Args:
        scenario: what to write.
        path: the file; an old one stays whole until the new one is; a map is referred to relative to its folder.

    Raises:
        ScenarioError: if the file cannot be written.
    """
    check_scenario(scenario)
    lines = []
    path = as_path(path, ScenarioError)
    for key, value in scenario_to_dict(scenario, path.parent).items():
        if key == "obstacles" and value:
            lines += [f"{key}:", *(f"  - {{{dump_line(obstacle)}}}" for obstacle in value)]
        elif key == "robot":
            lines += [f"{key}:", *(f"  {dump_line({part: content})}" for part, content in value.items())]
        else:
            lines.append(dump_line({key: value}))
    write_file(path, "\n".join(lines) + "\n", ScenarioError)


def scenario_from_dict(data: Mapping[str, Any], source: str = "scenario", folder: Path | None = None) -> Scenario:
    """Scenario from plain values with the keys of a scenario file.

    Args:
        data: the values.
        source: what messages call them.
        folder: what the file of a map is relative to; the current one if not given.

    Returns:
        The scenario, checked.

    Raises:
        ScenarioError: with every mistake in the values, one line each.
    """
    where = Path() if folder is None else as_path(folder, ScenarioError)
    return make_scenario(Source(data, source, where), Report())


def scenario_to_dict(scenario: Scenario, folder: Path | None = None) -> dict[str, Any]:
    """Plain values with the keys of a scenario file, angles in radians.

    Args:
        scenario: what to describe.
        folder: what the file of a map is to be relative to; the current one if not given.

    Returns:
        Mappings, lists, texts and numbers that :func:`scenario_from_dict` makes an equal scenario of.
    """
    check_scenario(scenario)
    where = Path() if folder is None else as_path(folder, ScenarioError)
    return scenario_data(scenario_parts(scenario), where.resolve())


def find_problems(parts: Mapping[str, Any]) -> list[Problem]:
    """Why nobody could plan with some parts of a scenario.

    Args:
        parts: the attributes of a scenario by name; those that are missing are not checked.

    Returns:
        One entry a reason.
    """
    robot, start, goal, planning = (parts.get(name) for name in ("robot", "start", "goal", "planning"))
    world = parts.get("world")
    found = list(_name_problems(parts["name"])) if "name" in parts else []
    if robot is not None and world is not None:
        found += _footprint_problems(robot, world)
    clearance = 0.0 if planning is None else planning.clearance
    if start is not None:
        found += _start_problems(start, world, robot, parts.get("map"), clearance)
    if goal is not None and world is not None:
        found += _goal_problems(goal, world, robot, parts.get("map"), clearance)
    if planning is not None:
        found += _horizon_problems(planning)
    return found


def make_scenario(source: Source, report: Report, before_kernels: Callable[[], None] = lambda: None) -> Scenario:
    """Scenario from plain values.

    Args:
        source: what was read.
        report: with the mistakes of reading it.
        before_kernels: called when all values are well, before anything is asked of compiled code.

    Raises:
        ScenarioError: with every mistake in the values and in what they add up to.
    """
    parts = read_checked(source, report, before_kernels)
    if report.problems:
        raise ScenarioError(report.problems, source.name)
    return Scenario(**parts)


def read_checked(source: Source, report: Report, before_kernels: Callable[[], None] = lambda: None) -> dict[str, Any]:
    """Parts of a scenario as far as they can be read, and in the report every mistake in them and in their sum.

    Args:
        source: what was read.
        report: with the mistakes of reading it.
        before_kernels: called when all values are well, before anything is asked of compiled code.
    """
    parts = read_parts(source.data, source.folder, report)
    if not report.problems:
        before_kernels()
    if isinstance(source.data, Mapping):
        defaults = {"robot": Robot(), "planning": PlanningSettings()}
        report.adopt(find_problems({**{k: v for k, v in defaults.items() if k not in source.data}, **parts}))
    return parts


def _check_types(scenario: Scenario) -> None:
    """Refuse parts of the wrong type, all together."""
    kinds = {"world": World, "robot": Robot, "start": State, "goal": Goal, "planning": PlanningSettings}
    problems = [
        Problem(name, getattr(scenario, name), f"a value of type {kind.__name__}")
        for name, kind in kinds.items()
        if not isinstance(getattr(scenario, name), kind)
    ]
    if not isinstance(scenario.map, MapSource | None):
        problems.append(Problem("map", scenario.map, "a value of type MapSource, or None"))
    if problems:
        raise ScenarioError(problems)


def _name_problems(name: str) -> Iterator[Problem]:
    if not (isinstance(name, str) and name.strip() and name.isprintable()):
        yield Problem("name", name, "one line of text")


def _footprint_problems(robot: Robot, world: World) -> Iterator[Problem]:
    """Whether the footprint would stand behind the walls, which are as thick as the bounds are wide."""
    distance, reach = robot.footprint.distance_from_origin, max(world.bounds.size)
    if distance >= reach:
        expected = f"a footprint nearer to the robot's origin than the bounds are wide ({reach:g} m)"
        yield Problem("robot.footprint", Remark(f"one {distance:g} m away"), expected)


def _start_problems(
    start: State, world: World | None, robot: Robot | None, source: MapSource | None, clearance: float
) -> Iterator[Problem]:
    """Why the robot cannot start from a state."""
    infinite = [name for name, value in start._asdict().items() if not is_number(value, LARGEST)]
    yield from (Problem(f"start.{name}", getattr(start, name), A_NUMBER) for name in infinite)
    if infinite:
        return
    if robot is not None:
        yield from _velocity_problems(start, robot.limits)
    if world is None:
        return
    if not world.bounds.contains(start.x, start.y):
        yield Problem("start", [start.x, start.y], _inside(world))
    elif robot is not None and world.collides(robot.footprint, start[:3]):
        reason = why_not(world, robot.footprint, start[:3], source)
        expected = f"a pose where the footprint touches no obstacle and no bound: {reason}"
        yield Problem("start", list(start[:3]), expected)
    elif robot is not None and clearance > 0.0:
        found = world.clearance(robot.footprint, start[:3])
        if found < clearance:
            expected = f"a pose {clearance:g} m from everything (planning.clearance); it is {found:.4g} m"
            yield Problem("start", list(start[:3]), expected)


def _inside(world: World) -> str:
    """What is expected of a position."""
    low, high = (tuple(round(float(value), 6) for value in corner) for corner in (world.bounds.min, world.bounds.max))
    return f"a position inside the bounds {low}, {high}"


def _velocity_problems(start: State, limits: Limits) -> Iterator[Problem]:
    """Which start velocities the robot cannot have."""
    for name, unit in (("v", "m/s"), ("omega", "rad/s")):
        low, high = getattr(limits, f"{name}_min"), getattr(limits, f"{name}_max")
        if not low <= getattr(start, name) <= high:
            expected = f"{low:.6g} to {high:.6g} {unit}, robot.limits.{name}"
            yield Problem(f"start.{name}", getattr(start, name), expected)
    rim = abs(start.v) + 0.5 * limits.wheel_separation * abs(start.omega)
    if rim > limits.wheel_speed * (1.0 + 1e-9):
        expected = f"wheels no faster than {limits.wheel_speed:.6g} m/s, robot.limits.wheel_speed (here {rim:.6g} m/s)"
        yield Problem("start", {"v": start.v, "omega": start.omega}, expected)


def _goal_problems(
    goal: Goal, world: World, robot: Robot | None, source: MapSource | None, clearance: float
) -> Iterator[Problem]:
    """Why no state of the goal region can be reached."""
    if not world.bounds.contains(goal.x, goal.y):
        yield Problem("goal", [goal.x, goal.y], _inside(world))
    elif robot is not None and not _may_be_free(goal, world, robot):
        reason = why_not(world, robot.footprint, (goal.x, goal.y, goal.theta or 0.0), source)
        expected = f"a region with room for the robot: all of it is in collision; at its centre {reason}"
        yield Problem("goal", [goal.x, goal.y], expected)
    elif robot is not None and clearance > 0.0 and not _may_be_free(goal, world, robot, clearance):
        found = world.clearance(robot.footprint, (goal.x, goal.y, goal.theta or 0.0))
        expected = f"a region with a pose {clearance:g} m from everything (planning.clearance); at its centre it is"
        yield Problem("goal", [goal.x, goal.y], f"{expected} {found:.4g} m")


def _may_be_free(goal: Goal, world: World, robot: Robot, room: float = 0.0) -> bool:
    """Whether the goal region may hold a position with more room than so much; False only where certainly none is."""
    if world.clearance(robot.footprint, (goal.x, goal.y, goal.theta or 0.0)) > room:
        return True  # asked first, since a plan needs the index of this footprint anyway
    radius = robot.footprint.inscribed_radius
    if radius == 0.0 and robot.footprint.vertices is not None:
        return True  # the robot's origin may stand in an obstacle that the footprint passes beside
    return world.signed_clearance(goal.x, goal.y) + goal.tolerance > radius + room


def _horizon_problems(planning: PlanningSettings) -> Iterator[Problem]:
    """Whether rounding to whole steps changes the horizon by more than is fair."""
    duration = planning.steps * planning.step
    if abs(duration - planning.horizon) > HORIZON_TOLERANCE * planning.horizon:
        expected = f"a multiple of planning.step ({planning.step:g} s)"
        yield Problem("planning.horizon", planning.horizon, expected)
