"""How a drive senses and plans again, and how far the sensor must see for it to be safe."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import shapely

from cbrrt_ompl.errors import Problem, SettingsError
from cbrrt_ompl.motion.kinematics import brake
from cbrrt_ompl.planners.registry import PLANNERS, Steering
from cbrrt_ompl.problem.robot import Footprint, Robot
from cbrrt_ompl.problem.settings import MAX_STEPS, PlanningSettings

STEP_TOLERANCE = 1e-6
"""Share of a planning step by which the cycle may differ from whole steps."""


@dataclass(frozen=True)
class DriveSettings:
    """Settings of a drive.

    Raises:
        SettingsError: with every value that makes no sense.
    """

    sensor_range: float = 3.0
    """Obstacles no farther than this from the robot's origin are seen [m]."""
    cycle: float = 0.1
    """Time between two looks, and what a plan may take [s]; whole planning steps."""
    planner: str = "cb-rrt-robust"
    """Name of a planner that keeps the acceleration limits: none of S-RRT."""
    goal_bias: float | None = None
    """Share of samples that are the goal itself, 0 to 1; None is what the scenario or else the planner has."""
    margin: float = 0.01
    """Distance that the footprint keeps from all that is known [m]."""
    max_samples: int | None = None
    """Samples that a plan may take instead of the cycle's time: then a drive is the same on every machine."""
    max_iterations: int = 0
    """Newton steps to improve each plan for, with the plan before as another guess; 0 drives plans as they are."""
    tries: int = 6
    """Plans made while standing, each with twice the time (or samples) of the one before, before the robot gives up."""
    time_limit: float = 600.0
    """Time of driving after which the robot stops [s]."""
    line_of_sight: bool = False
    """Whether obstacles hide what is behind them; else all within the sensor's range is seen."""

    def __post_init__(self) -> None:
        """Check all values together."""
        problems = [
            Problem(name, getattr(self, name), "a number above 0")
            for name in ("sensor_range", "cycle", "time_limit")
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0.0)
        ]
        if self.goal_bias is not None and not 0.0 <= self.goal_bias <= 1.0:
            problems.append(Problem("goal_bias", self.goal_bias, "a number from 0 to 1"))
        if not (math.isfinite(self.margin) and self.margin >= 0.0):
            problems.append(Problem("margin", self.margin, "a number of 0 or more [m]"))
        for name in ("max_samples", "tries"):
            value = getattr(self, name)
            if value is not None and not (isinstance(value, int) and value >= 1):
                problems.append(Problem(name, value, "a whole number of 1 or more"))
        if not (isinstance(self.max_iterations, int) and self.max_iterations >= 0):
            problems.append(Problem("max_iterations", self.max_iterations, "a whole number of 0 or more"))
        if not isinstance(self.line_of_sight, bool):
            problems.append(Problem("line_of_sight", self.line_of_sight, "True or False"))
        known = [name for name, row in PLANNERS.items() if row.steering is not Steering.RATES]
        if self.planner not in known:
            problems.append(Problem("planner", self.planner, f"one of {', '.join(known)}"))
        if problems:
            raise SettingsError(problems)

    def steps(self, planning: PlanningSettings) -> int:
        """Planning steps in a cycle.

        Raises:
            SettingsError: if these are not whole steps.
        """
        steps = round(self.cycle / planning.step)
        if steps < 1 or abs(self.cycle / planning.step - steps) > STEP_TOLERANCE:
            raise SettingsError(Problem("cycle", self.cycle, f"a multiple of planning.step ({planning.step:g} s)"))
        return steps

    def planning(self, planning: PlanningSettings) -> PlanningSettings:
        """Planning settings of a drive: those of its scenario, the goal bias and braking without collision."""
        goal_bias = planning.goal_bias if self.goal_bias is None else self.goal_bias
        return replace(planning, goal_bias=goal_bias, brake_safe=True)


def stopping_distance(robot: Robot, step: float) -> float:
    """Longest way to rest from any velocity that a robot may have [m].

    Args:
        robot: its limits.
        step: integration step [s].
    """
    limits = robot.limits
    ways = []
    for v in (limits.v_min, limits.v_max):
        for omega in (limits.omega_min, 0.0, limits.omega_max):
            speeds = np.abs(brake(0.0, 0.0, 0.0, v, omega, limits, step, MAX_STEPS)[:, 3])
            ways.append(0.5 * step * float((speeds[1:] + speeds[:-1]).sum()))
    return max(ways)


def needed_range(robot: Robot, settings: DriveSettings, step: float) -> float:
    """Range that a sensor must have, so that all the robot is committed to lies within it [m].

    From one look to the next the robot drives on; what it decides upon meanwhile is one more cycle and the braking
    after it.

    Args:
        robot: its footprint and limits.
        settings: cycle and margin.
        step: integration step [s].
    """
    fastest = max(robot.limits.v_max, -robot.limits.v_min)
    size = robot.footprint.circumscribed_radius + settings.margin
    return 2.0 * settings.cycle * fastest + stopping_distance(robot, step) + size


def hides_itself(footprint: Footprint) -> bool:
    """Whether a part of a footprint's border cannot be seen from the robot's origin through the footprint alone."""
    if footprint.vertices is None:
        return False
    a = footprint.vertices
    b = np.roll(a, -1, axis=0)
    return bool((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] <= 0.0).any())


def grown(footprint: Footprint, margin: float) -> Footprint:
    """A footprint with a margin around it.

    Args:
        footprint: the robot's area.
        margin: what every point of its border moves out by, at least [m].
    """
    if footprint.vertices is None:
        return Footprint.disc(footprint.radius + margin)
    if margin == 0.0:
        return footprint
    corners = shapely.Polygon(footprint.vertices).buffer(margin, join_style="mitre").exterior
    return Footprint.polygon(shapely.get_coordinates(corners))
