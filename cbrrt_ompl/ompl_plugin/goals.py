"""Goal regions as OMPL's goals: exact where the kernels and OMPL must agree."""

from __future__ import annotations

from typing import Any

from cbrrt_ompl.checks import LARGEST, is_number
from cbrrt_ompl.motion.model import OPEN_LOOP, make_model
from cbrrt_ompl.ompl_plugin.binding import ob
from cbrrt_ompl.ompl_plugin.compiled_methods import use_compiled_methods
from cbrrt_ompl.ompl_plugin.goal_distance import region_distance_of
from cbrrt_ompl.ompl_plugin.native_methods import make_goal_native
from cbrrt_ompl.ompl_plugin.native_space import make_native
from cbrrt_ompl.ompl_plugin.reals import StateReals
from cbrrt_ompl.ompl_plugin.space import STATE_DIMENSION, write_state
from cbrrt_ompl.problem.robot import Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State


def make_goal(si: Any, space: Any, goal: Goal, compiled: bool | None = None) -> Any:
    """The goal region for OMPL.

    A goal in position alone is OMPL's own `GoalState`: its distance is the space's, which is position-only.

    Args:
        si: the space information.
        space: its state space.
        goal: the region.
        compiled: whether OMPL calls compiled code, see :mod:`cbrrt_ompl.ompl_plugin.compiled_methods`.
    """
    if not goal.is_position_only:
        return PoseGoal(si, space, goal, compiled=compiled)
    region = ob.GoalState(si)
    centre = ob.State(space)
    write_state(centre(), centre_state(goal))
    region.setState(centre())
    region.setThreshold(goal.tolerance)
    return make_native(region) if use_compiled_methods(compiled) else region


def region_of(goal: Any, space: Any) -> Goal | None:
    """A goal of OMPL's as a region that the kernels know; None where only the goal itself can tell.

    That is a `PoseGoal`, and OMPL's `GoalState` in a space whose distance looks at positions alone.
    """
    if type(goal) is PoseGoal:
        return goal.goal if goal.getThreshold() == 1.0 else None
    if type(goal) is not ob.GoalState or [space.getSubspaceWeight(i) for i in range(3)] != [1.0, 0.0, 0.0]:
        return None
    centre = goal.getState()
    x, y, tolerance = centre[0][0], centre[0][1], goal.getThreshold()
    if not (is_number(x, LARGEST) and is_number(y, LARGEST) and is_number(tolerance, LARGEST) and tolerance > 0.0):
        return None
    return Goal(x, y, tolerance)


def centre_state(goal: Goal) -> State:
    """The state in the middle of a goal region, at rest."""
    return State(goal.x, goal.y, goal.theta or 0.0)


class PoseGoal(ob.GoalSampleableRegion):  # type: ignore[misc]  # OMPL has no type information
    """A goal region that also restricts the heading, the speed or both.

    OMPL calls a state satisfied where ``distanceGoal`` is below the threshold of 1: it is the largest of the
    deviations, each divided by its tolerance.

    Attributes:
        goal: the region.
    """

    def __init__(self, si: Any, space: Any, goal: Goal, *, compiled: bool | None = None) -> None:
        """Keep the region.

        Args:
            si: the space information.
            space: its state space.
            goal: the region.
            compiled: see :func:`make_goal`.
        """
        super().__init__(si)
        self.setThreshold(1.0)
        self.goal = goal
        self._reals = StateReals(space, STATE_DIMENSION)
        model = make_model(OPEN_LOOP, Robot(), goal, PlanningSettings())  # all but its goal has no meaning
        self._region = model["goal"].copy()
        if type(self).distanceGoal is _DISTANCE_GOAL and use_compiled_methods(compiled):
            make_goal_native(self, self._region)

    def distanceGoal(self, state: Any) -> float:  # noqa: N802  # OMPL's name
        """The largest deviation in units of its tolerance; below 1 exactly where the goal is satisfied."""
        self._reals.read(state)
        return float(region_distance_of(self._reals.values, self._region))

    def sampleGoal(self, state: Any) -> None:  # noqa: N802  # OMPL's name
        """The middle of the region, at rest."""
        write_state(state, centre_state(self.goal))

    def maxSampleCount(self) -> int:  # noqa: N802  # OMPL's name
        """One: the middle."""
        return 1


_DISTANCE_GOAL = PoseGoal.distanceGoal
