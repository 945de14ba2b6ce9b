"""How far a state is from a goal region, as one number: what OMPL's goals are asked for."""

from __future__ import annotations

import math

from numpy.typing import NDArray

from cbrrt_ompl.kernels import kernel
from cbrrt_ompl.motion.model import in_goal
from cbrrt_ompl.motion.records import Record, Records
from cbrrt_ompl.problem.settings import goal_distance, heading_error

_JUST_BELOW_ONE = math.nextafter(1.0, 0.0)
_distance, _heading_error = kernel(goal_distance), kernel(heading_error)


@kernel
def region_distance(goal: Record, x: float, y: float, theta: float, v: float, omega: float) -> float:
    """The largest deviation in units of its tolerance; below 1 exactly where the goal is satisfied.

    Args:
        goal: a record of type :data:`cbrrt_ompl.motion.model.GOAL_REGION`.
        x: position [m].
        y: position [m].
        theta: heading [rad].
        v: forward velocity [m/s].
        omega: turning rate [rad/s].
    """
    farthest = _distance(goal, x, y) / goal.tolerance
    if goal.heading_tolerance < math.inf:
        farthest = max(farthest, _heading_error(goal, theta) / goal.heading_tolerance)
    if goal.speed_tolerance < math.inf:
        farthest = max(farthest, max(abs(v), abs(omega)) / goal.speed_tolerance)
    return min(farthest, _JUST_BELOW_ONE) if in_goal(goal, x, y, theta, v, omega) else max(farthest, 1.0)


@kernel
def region_distance_of(values: NDArray, goals: Records) -> float:
    """:func:`region_distance` for a caller in Python; values of shape (5,)."""
    return region_distance(goals[0], values[0], values[1], values[2], values[3], values[4])
