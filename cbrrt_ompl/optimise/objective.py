"""What a trajectory is optimised for."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from cbrrt_ompl.checks import LARGEST, SMALLEST, is_number
from cbrrt_ompl.errors import Problem, SettingsError
from cbrrt_ompl.optimise.clearance import disc_distances
from cbrrt_ompl.problem.robot import Limits
from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.trajectory.trajectory import Trajectory


@dataclass(frozen=True)
class Objective:
    """The cost of a trajectory, in seconds: the duration, unless other weights are given.

        cost = duration T + length L + int_0^T (room r(t) + smoothness (a^2 / a_max^2 + alpha^2 / alpha_max^2)) dt

    L is the path length. r is 0 where the robot is farther than ``room_distance`` from everything and rises to 1 as it
    comes to touch something: the mean over the discs that stand for its footprint of max(0, 1 - d / room_distance)^2,
    d being a disc's distance. Each weight says what a thing is worth in seconds: a robot with ``room=0.5`` takes up to
    half a second more to be spared a second in contact. For a robot without acceleration limits, full acceleration is
    the whole range of a velocity in a second.

    Raises:
        SettingsError: with every weight that makes no sense.
    """

    duration: float = 1.0
    """Weight of the duration."""
    length: float = 0.0
    """What a metre of path is worth [s/m]."""
    room: float = 0.0
    """What being spared a second in contact is worth."""
    room_distance: float = 0.3
    """Distance beyond which more room is worth nothing [m]."""
    smoothness: float = 0.0
    """What being spared a second under full acceleration is worth."""

    def __post_init__(self) -> None:
        """Check all weights together."""
        problems = []
        for field in fields(self):
            value, least = getattr(self, field.name), SMALLEST if field.name == "room_distance" else 0.0
            if not (is_number(value, LARGEST) and value >= least):
                problems.append(Problem(f"objective.{field.name}", value, f"a number from {least:g} to {LARGEST:g}"))
        if not problems and self.duration + self.length <= 0.0:
            problems.append(Problem("objective.duration", self.duration, "a weight above 0, of the duration or length"))
        if problems:
            raise SettingsError(problems)

    def cost(self, trajectory: Trajectory, scenario: Scenario) -> float:
        """The cost of a trajectory of a scenario's robot in its world [s]."""
        total = self.duration * trajectory.duration
        if self.length > 0.0:
            total += self.length * trajectory.length
        if len(trajectory) < 2:
            return total
        steps = np.diff(trajectory.t)
        if self.room > 0.0:
            lack = np.maximum(0.0, 1.0 - disc_distances(trajectory.poses, scenario) / self.room_distance)  # (n, discs)
            tight = np.mean(lack * lack, axis=1)
            total += self.room * float(np.sum(0.5 * (tight[:-1] + tight[1:]) * steps))
        if self.smoothness > 0.0:
            most, most_angular = full_accelerations(scenario.robot.limits)
            a, alpha = np.diff(trajectory.v) / most, np.diff(trajectory.omega) / most_angular
            total += self.smoothness * float(np.sum((a * a + alpha * alpha) / steps))
        return total


def full_accelerations(limits: Limits) -> tuple[float, float]:
    """What counts as full acceleration [m/s^2, rad/s^2]: the limits, or a velocity's whole range in a second."""
    if limits.is_first_order:
        return limits.v_max - limits.v_min, limits.omega_max - limits.omega_min
    return limits.acceleration, limits.angular_acceleration
