"""A scenario on the way to being one: to be looked at while its start and its goal are not right yet."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import Problem, ScenarioError
from cbrrt_ompl.files import as_path
from cbrrt_ompl.problem.robot import Robot
from cbrrt_ompl.problem.settings import Goal, State
from cbrrt_ompl.scenario.map_layers import MapSource
from cbrrt_ompl.scenario.scenario import read_checked
from cbrrt_ompl.scenario.sections import Report
from cbrrt_ompl.scenario.sources import Source, read_source

FORGIVEN = ("start", "goal")
"""Parts of a scenario that may be missing or wrong in a draft."""


@dataclass(frozen=True, eq=False)
class Draft:
    """A scenario as far as it goes.

    Attributes:
        name: name of the scenario.
        world: bounds and obstacles.
        robot: footprint, limits and gains.
        start: None where it is missing or no state at all.
        goal: None where it is missing or no region at all.
        map: the map that the world came from, if any.
        problems: what is wrong with start and goal.
    """

    name: str
    world: World
    robot: Robot
    start: State | None = None
    goal: Goal | None = None
    map: MapSource | None = None
    problems: tuple[Problem, ...] = ()

    def is_wrong(self, part: str) -> bool:
        """Whether anything is wrong with ``start`` or ``goal``."""
        return any(_part(problem) == part for problem in self.problems)


def load_draft(path: str | Path) -> Draft:
    """Draft from what :func:`cbrrt_ompl.load_scenario` reads.

    Raises:
        ScenarioError: with every mistake in it that is none of its start and goal.
    """
    report = Report()
    return make_draft(read_source(as_path(path, ScenarioError), report), report)


def make_draft(source: Source, report: Report) -> Draft:
    """Draft of plain values.

    Args:
        source: what was read.
        report: with the mistakes of reading it.

    Raises:
        ScenarioError: as :func:`load_draft`.
    """
    parts = read_checked(source, report)
    forgiven = tuple(problem for problem in report.problems if _part(problem) in FORGIVEN)
    if len(forgiven) < len(report.problems):
        raise ScenarioError([p for p in report.problems if p not in forgiven], source.name)
    known = {name: parts[name] for name in ("start", "goal", "map") if name in parts}
    return Draft(parts["name"], parts["world"], parts.get("robot", Robot()), problems=forgiven, **known)


def _part(problem: Problem) -> str:
    """The key at the top level that a problem is about."""
    return problem.field.partition(".")[0]
