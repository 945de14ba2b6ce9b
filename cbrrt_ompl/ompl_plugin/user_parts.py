"""What a user has put into a set-up in the place of our parts: whether a tree may go on, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

from cbrrt_ompl.errors import Problem, SettingsError
from cbrrt_ompl.motion.model import CLOSED_LOOP, check_step
from cbrrt_ompl.ompl_plugin.native_layout import LayoutError, object_address
from cbrrt_ompl.ompl_plugin.propagators import TwoWheelPropagator
from cbrrt_ompl.ompl_plugin.space import bounds_of, covers, read_state
from cbrrt_ompl.ompl_plugin.validity import FclStateValidityChecker
from cbrrt_ompl.planners.registry import planner_named
from cbrrt_ompl.problem.settings import State
from cbrrt_ompl.scenario.scenario import Scenario

FREE_PLANNERS = "rrt, kpiece1, est, sst, pdst, syclop-rrt and syclop-est"
"""Planners that draw their controls from the control space."""


DEFAULT_STATE_SAMPLERS = {"CompoundStateSampler", "RealVectorStateSampler", "SO2StateSampler"}
"""What a space of ours and its components allocate if nothing else is set."""


class Query(NamedTuple):
    """What a tree is grown with."""

    starts: tuple[State, ...]
    """Start states of the problem definition."""
    checker: Any
    """Validity checker."""
    propagator: Any
    """State propagator."""
    timing: tuple[float, int, int]
    """Propagation step [s], fewest and most steps of a control."""
    bounds: tuple[float, ...]
    """Bounds of the state space."""

    def is_continued_by(self, other: Query) -> bool:
        """Whether a tree goes on in another query: starts may have been added, and nothing else has changed."""
        n = len(self.starts)
        return (
            _same(self.starts, other.starts[:n])
            and is_same_part(self.checker, other.checker, "ompl::base::StateValidityChecker")
            and is_same_part(self.propagator, other.propagator, "ompl::control::StatePropagator")
            and self.timing == other.timing
            and self.bounds == other.bounds
        )


def query_of(problem: Any) -> Query:
    """The query that a problem definition and its space information make now."""
    si = problem.getSpaceInformation()
    return Query(
        starts=tuple(read_state(problem.getStartState(i)) for i in range(problem.getStartStateCount())),
        checker=si.getStateValidityChecker(),
        propagator=si.getStatePropagator(),
        timing=(si.getPropagationStepSize(), si.getMinControlDuration(), si.getMaxControlDuration()),
        bounds=bounds_of(si.getStateSpace()),
    )


def _same(starts: tuple[State, ...], others: tuple[State, ...]) -> bool:
    """Whether states are the same, with NaN the same as NaN."""
    return repr(starts) == repr(others)


def is_same_part(part: Any, other: Any, class_name: str) -> bool:
    """Whether two Python objects stand for one C++ object.

    An object made in C++, such as the checker of a ``StateValidityCheckerFn``, has another Python object every time.
    Where addresses cannot be found, such objects count as the same.
    """
    if part is other:
        return True
    try:
        return object_address(part, class_name) == object_address(other, class_name)
    except LayoutError:
        return type(part) is type(other) and type(part).__module__.startswith("ompl.")


def check_parts(si: Any, scenario: Scenario, planner: str) -> None:
    """Refuse what cb-rrt, s-rrt and the compiled planners cannot take.

    Args:
        si: the space information.
        scenario: what the set-up was made for.
        planner: the planner's name.

    Raises:
        SettingsError: if the bounds of the velocities or of the controls are no longer those of the robot, or the step
            is too long for it, or ``brake_safe`` is asked for with a validity checker that is not ours, or the loop is
            closed with a propagator that is not.
    """
    problems = []
    limits, space = scenario.robot.limits, si.getStateSpace()
    robot_alone = f"those of scenario.robot.limits, by which {planner} drives; {FREE_PLANNERS} take others"
    low, high = (limits.v_min, limits.omega_min), (limits.v_max, limits.omega_max)
    velocities = bounds_of(space)[4:]
    if not covers(space, None, limits):
        problems.append(Problem("bounds of (v, omega) in the state space", velocities, robot_alone))
    controls = si.getControlSpace().getBounds()
    if planner_named(planner).law(scenario.planning) != CLOSED_LOOP:
        found = (*list(controls.low)[:2], *list(controls.high)[:2])
        if found != (*low, *high):
            problems.append(Problem("bounds of the control space", found, robot_alone))
    elif not isinstance(si.getStatePropagator(), TwoWheelPropagator):
        expected = "False with a state propagator of one's own: in closed loop controls are references, not velocities"
        problems.append(Problem("planning.closed_loop", True, expected))
    step = si.getPropagationStepSize()
    if step > 0.0 and step != scenario.planning.step:
        check_step(scenario.robot, replace(scenario.planning, step=step, horizon=step))
    if scenario.planning.brake_safe and not isinstance(si.getStateValidityChecker(), FclStateValidityChecker):
        expected = (
            f"False with a validity checker of one's own, of which {planner} cannot tell where the robot can brake"
        )
        problems.append(Problem("planning.brake_safe", True, expected))
    if problems:
        raise SettingsError(problems, source=planner)


def check_sampling(space: Any, planner: str) -> None:
    """Refuse a state space by which the compiled planners, with samples and distances of their own, do not go.

    Args:
        space: the state space.
        planner: the planner's name.

    Raises:
        SettingsError: if the space or a component has a state sampler that is not OMPL's, or the weights are others.
    """
    problems = []
    found = [type(part.allocStateSampler()).__name__ for part in (space, *map(space.getSubspace, range(3)))]
    others = [name for name in found if name not in DEFAULT_STATE_SAMPLERS]
    if others:
        expected = f"OMPL's own, since {planner} draws its samples in compiled code; cb-rrt and s-rrt take others"
        problems.append(Problem("state sampler", others[0], expected))
    weights = [space.getSubspaceWeight(i) for i in range(3)]
    if weights != [1.0, 0.0, 0.0]:
        expected = f"[1.0, 0.0, 0.0], by which {planner} finds the nearest node; cb-rrt and s-rrt take others"
        problems.append(Problem("weights of the state space", weights, expected))
    if problems:
        raise SettingsError(problems, source=planner)
