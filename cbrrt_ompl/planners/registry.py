"""All planners: a row each, and what follows from it.

To add a planner of OMPL, add its row, see docs/contributing.md.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum

from cbrrt_ompl.errors import UnknownPlannerError
from cbrrt_ompl.motion.model import CLOSED_LOOP, OPEN_LOOP, STEERING
from cbrrt_ompl.problem.robot import Gains, Limits, Robot, gains_for
from cbrrt_ompl.problem.settings import FOR_MAPS, FilledSettings, PlanningSettings
from cbrrt_ompl.scenario.scenario import Scenario


class Backend(Enum):
    """Who runs a planner."""

    COMPILED = "compiled"
    """One compiled loop, without OMPL."""
    PLUGIN = "plugin"
    """OMPL's control::RRT with a directed sampler of ours."""
    OMPL = "ompl"
    """OMPL alone, with its own samplers and settings, on the dynamic motion model."""


class Steering(Enum):
    """What steers an extension."""

    KANAYAMA = "Kanayama law"
    RATES = "three steering rates"
    RANDOM = "random controls"


@dataclass(frozen=True)
class Planner:
    """What there is to know of a planner before it runs."""

    description: str
    """One line of text."""
    backend: Backend
    steering: Steering
    is_robust: bool = False
    """Whether places are passed over the likelier, the more extensions from there have failed."""
    is_anytime: bool = False
    """Whether it goes on after its first plan."""
    is_bounded: bool = False
    """Whether it goes on by trees that keep only what may be quicker than its best plan, not by optimal control."""
    ompl_class: str = "RRT"
    """Name of its class in ``ompl.control``, or of one of ours with its module; made of a SpaceInformation."""
    defaults: FilledSettings = FilledSettings()
    """What stands for settings that are left out."""
    default_gains: Callable[[Limits], Gains] = lambda _: Gains()
    """What stands for gains that are left out, by the limits of the robot."""

    @property
    def optimises(self) -> bool:
        """Whether it goes on by optimal control without being asked."""
        return self.is_anytime and not self.is_bounded

    def law(self, planning: PlanningSettings) -> int:
        """How it drives: `STEERING`, `CLOSED_LOOP` or `OPEN_LOOP` (as OMPL's own planners do)."""
        if self.steering is Steering.RATES:
            return STEERING
        is_closed = self.steering is Steering.KANAYAMA and self.settings(planning).closed_loop
        return CLOSED_LOOP if is_closed else OPEN_LOOP

    def settings(self, planning: PlanningSettings) -> FilledSettings:
        """Settings with this planner's defaults for what is left out."""
        return planning.filled(self.defaults)

    def robot(self, robot: Robot) -> Robot:
        """A robot with this planner's default gains, where none are given."""
        return robot if robot.gains is not None else replace(robot, gains=self.default_gains(robot.limits))


_COMPILED, _PLUGIN, _OMPL = Backend.COMPILED, Backend.PLUGIN, Backend.OMPL
_KANAYAMA, _RATES, _RANDOM = Steering.KANAYAMA, Steering.RATES, Steering.RANDOM

PLANNERS: dict[str, Planner] = {
    "cb-rrt": Planner("CB-RRT of the paper: the Kanayama law in OMPL's control::RRT", _PLUGIN, _KANAYAMA),
    "s-rrt": Planner("S-RRT, the paper's baseline: full speed, three steering rates; kinematic", _PLUGIN, _RATES),
    "cb-rrt-compiled": Planner(
        "CB-RRT as one compiled loop: the same kernels, many times as fast", _COMPILED, _KANAYAMA
    ),
    "s-rrt-compiled": Planner("S-RRT as one compiled loop", _COMPILED, _RATES),
    "cb-rrt-robust": Planner(
        "cb-rrt-compiled that passes over nodes extended in vain: for real maps",
        _COMPILED,
        _KANAYAMA,
        is_robust=True,
        defaults=FOR_MAPS,
        default_gains=gains_for,
    ),
    "cb-rrt-anytime": Planner(
        "cb-rrt-robust, and then better and better by optimal control",
        _COMPILED,
        _KANAYAMA,
        is_robust=True,
        is_anytime=True,
        defaults=FOR_MAPS,
        default_gains=gains_for,
    ),
    "cb-rrt-ao": Planner(
        "cb-rrt-robust, and then better and better by sampling: AO-RRT, a baseline",
        _COMPILED,
        _KANAYAMA,
        is_robust=True,
        is_anytime=True,
        is_bounded=True,
        defaults=FOR_MAPS,
        default_gains=gains_for,
    ),
    "rrt": Planner("OMPL's control::RRT with random controls", _OMPL, _RANDOM),
    "kpiece1": Planner("OMPL's KPIECE1", _OMPL, _RANDOM, ompl_class="KPIECE1"),
    "est": Planner("OMPL's expansive space trees", _OMPL, _RANDOM, ompl_class="EST"),
    "sst": Planner("OMPL's stable sparse RRT, ended by its first solution", _OMPL, _RANDOM, ompl_class="SST"),
    "pdst": Planner("OMPL's path-directed subdivision tree", _OMPL, _RANDOM, ompl_class="PDST"),
    "syclop-rrt": Planner("OMPL's Syclop over a 32 x 32 grid, with RRT", _OMPL, _RANDOM, ompl_class="SyclopRRT"),
    "syclop-est": Planner("OMPL's Syclop over a 32 x 32 grid, with EST", _OMPL, _RANDOM, ompl_class="SyclopEST"),
}
"""Known planners by name."""


def planner_named(name: object) -> Planner:
    """The row of a planner.

    Raises:
        UnknownPlannerError: if there is none of this name.
    """
    if not (isinstance(name, str) and name in PLANNERS):
        raise UnknownPlannerError(name, list(PLANNERS))  # type: ignore[arg-type]  # whatever it is
    return PLANNERS[name]


def scenario_for(planner: str, scenario: Scenario) -> Scenario:
    """A scenario with a planner's defaults for what is left out; what is given stays.

    Whatever runs a planner begins with this, so that all its parts see the same settings.
    """
    row = planner_named(planner)
    robot, planning = row.robot(scenario.robot), row.settings(scenario.planning)
    if robot is scenario.robot and planning is scenario.planning:
        return scenario
    return replace(scenario, robot=robot, planning=planning)


def law_of(name: str, planning: PlanningSettings) -> int:
    """How a planner drives, see :meth:`Planner.law`."""
    return planner_named(name).law(planning)


def is_compiled(name: str) -> bool:
    """Whether a planner is one compiled loop, and needs no OMPL."""
    return planner_named(name).backend is Backend.COMPILED
