"""The result of a drive, and of each of its cycles."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.drive.settings import DriveSettings
from cbrrt_ompl.drive.sight import Sight
from cbrrt_ompl.planning import SOLVED
from cbrrt_ompl.problem.obstacles import Obstacle
from cbrrt_ompl.problem.settings import Goal, State
from cbrrt_ompl.scenario.connectivity import has_no_way
from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.scenario.why_not import nearest_thing
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.verification import Verification, verify

REACHED, STOPPED = "reached", "stopped"
"""How a drive ends."""

LATE, UNSAFE, NO_ROOM = "late", "unsafe", "no room"
"""Why a plan was not taken, besides the reasons of a planner."""

IMPROVED = "improved"
"""Status of a plan that comes of the one before and not of a search."""


@dataclass(frozen=True, eq=False)
class Replan:
    """One plan made on the way."""

    time: float
    """When it was begun [s]."""
    start: State
    """The state that it starts from: where the robot is to be when the plan is ready."""
    start_time: float
    """When the robot is there [s]."""
    status: str
    """``solved``, ``improved`` (what was left of the plan before, made shorter), ``time limit``, ``sample limit``,
    ``late`` (solved when its time was over), ``unsafe`` (its first cycle cannot be braked from) or ``no room`` (what is
    known covers the goal)."""
    samples: int
    """Samples drawn."""
    planning_time: float
    """Time of the search alone [s]."""
    trajectory: Trajectory | None
    """The plan in the drive's time, if it was taken."""


@dataclass(frozen=True, eq=False)
class Cycle:
    """One look around and what followed from it."""

    time: float
    """When the robot looked [s]."""
    seen: tuple[Obstacle, ...]
    """Obstacles seen for the first time."""
    replan: Replan | None
    """The plan made, if one was needed."""
    computing_time: float
    """Time of all its computing: knowledge, checks and planning [s]."""
    is_braking: bool
    """Whether the robot brakes or stands when the cycle is over."""


@dataclass(frozen=True, eq=False)
class DriveResult:
    """The result of a drive."""

    status: str
    """``reached`` or ``stopped``."""
    trajectory: Trajectory
    """The way driven, on the planning steps."""
    braking: Trajectory
    """The way driven and the braking that was ready at its end."""
    cycles: tuple[Cycle, ...]
    """Everything that was seen and decided, in order."""
    scenario: Scenario
    """What was driven, in the world as it was known at the start."""
    hidden: tuple[Obstacle, ...]
    """The obstacles that were not known at the start."""
    world: World
    """The true world."""
    settings: DriveSettings
    """How it was driven."""

    @property
    def reached(self) -> bool:
        """Whether the robot is in the goal region."""
        return self.status == REACHED

    @property
    def replans(self) -> list[Replan]:
        """The plans made, the first one among them."""
        return [cycle.replan for cycle in self.cycles if cycle.replan is not None]

    @property
    def searches(self) -> list[Replan]:
        """The plans that a search was made for: all but those improved on the way."""
        return [replan for replan in self.replans if replan.status != IMPROVED]

    @property
    def planning_times(self) -> NDArray[np.float64]:
        """Times of the searches, shape (n,) [s]."""
        return np.array([replan.planning_time for replan in self.searches])

    @property
    def computing_times(self) -> NDArray[np.float64]:
        """Times of all computing in the cycles, shape (m,) [s]."""
        return np.array([cycle.computing_time for cycle in self.cycles])

    @cached_property
    def sight(self) -> Sight | None:
        """What blocks the sight in the true world; None where nothing did."""
        return Sight(self.world.obstacles) if self.settings.line_of_sight else None

    @cached_property
    def blocked_by(self) -> str:
        """Why the robot has stopped: what is nearest, the last plan's status, and whether there is a way at all."""
        if self.reached:
            return ""
        last, robot = self.trajectory.states[-1], self.scenario.robot
        nearest = nearest_thing(self.world, robot.footprint, last[:3].tolist(), len(self.scenario.world.obstacles))
        statuses = [replan.status for replan in self.searches]
        searched = f"; the last search ended by {statuses[-1]}" if statuses and statuses[-1] != SOLVED else ""
        here = State(*last.tolist())
        closed = "; there is no way on for this footprint"
        return (
            f"{nearest}{searched}{closed if has_no_way(self.world, robot.footprint, here, self.scenario.goal) else ''}"
        )

    @cached_property
    def verification(self) -> Verification:
        """The way driven, verified in the true world; where the robot stopped, its end takes the place of the goal."""
        x, y = self.trajectory.poses[-1, :2].tolist()
        goal = self.scenario.goal if self.reached else Goal(x, y)
        return verify(self.trajectory, replace(self.scenario, world=self.world, goal=goal))

    @property
    def smallest_clearance(self) -> float:
        """Smallest distance of the footprint from obstacles and walls of the true world [m]."""
        return self.verification.smallest_clearance
