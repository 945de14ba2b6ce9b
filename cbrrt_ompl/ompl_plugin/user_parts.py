"""What a user has put into a set-up in the place of our parts: whether a tree may go on, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

from cbrrt_ompl.checks import A_POSITIVE_NUMBER, LARGEST, SMALLEST, is_number
from cbrrt_ompl.errors import Problem, SettingsError
from cbrrt_ompl.motion.model import CLOSED_LOOP, check_step
from cbrrt_ompl.ompl_plugin.native_layout import LayoutError, object_address
from cbrrt_ompl.ompl_plugin.propagators import TwoWheelPropagator
from cbrrt_ompl.ompl_plugin.space import bounds_of, covers, read_state
from cbrrt_ompl.ompl_plugin.validity import FclStateValidityChecker
from cbrrt_ompl.planners.registry import planner_named
from cbrrt_ompl.problem.settings import MAX_STEPS, State
from cbrrt_ompl.scenario.scenario import Scenario

FREE_PLANNERS = "rrt, kpiece1, est, sst, pdst, syclop-rrt and syclop-est"
"""Planners that draw their controls from the control space."""


DEFAULT_STATE_SAMPLERS = {"CompoundStateSampler", "RealVectorStateSampler", "SO2StateSampler"}
"""What a space of ours and its components allocate if nothing else is set."""

DEFAULT_CONTROL_SAMPLER = "RealVectorControlUniformSampler"
"""What a control space of ours allocates if nothing else is set."""


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
        SettingsError: if the bounds of the velocities or of the controls are no longer those that the set-up was made
            with, or the step is no time or too long for the robot, or the durations are no range, or ``brake_safe`` is
            asked for with a validity checker that is not ours, or the controls of planner and propagator differ:
            references in closed loop, velocities elsewhere.
    """
    closed_loop = planner_named(planner).law(scenario.planning) == CLOSED_LOOP
    problems = [
        *_bounds_problems(si, scenario, planner, closed_loop),
        *loop_problems(si.getStatePropagator(), closed_loop),
        *_timing_problems(si),
    ]
    if scenario.planning.brake_safe and not isinstance(si.getStateValidityChecker(), FclStateValidityChecker):
        expected = (
            f"False with a validity checker of one's own, of which {planner} cannot tell where the robot can brake"
        )
        problems.append(Problem("planning.brake_safe", True, expected))
    if problems:
        raise SettingsError(problems, source=planner)
    step = si.getPropagationStepSize()
    if step != scenario.planning.step:
        check_step(scenario.robot, replace(scenario.planning, step=step, horizon=step))


def _bounds_problems(si: Any, scenario: Scenario, planner: str, closed_loop: bool) -> list[Problem]:
    """What is wrong with the bounds of velocities and controls."""
    limits, bounds, space = scenario.robot.limits, scenario.world.bounds, si.getStateSpace()
    robot_alone = f"those of scenario.robot.limits, by which {planner} drives; {FREE_PLANNERS} take others"
    problems = []
    if not covers(space, None, limits):
        problems.append(Problem("bounds of (v, omega) in the state space", bounds_of(space)[4:], robot_alone))
    low, high = (limits.v_min, limits.omega_min), (limits.v_max, limits.omega_max)
    expected = robot_alone
    if closed_loop:
        low, high = bounds.min, bounds.max
        expected = f"those of the world: controls are references, which {planner} chooses; {FREE_PLANNERS} take others"
    controls = si.getControlSpace().getBounds()
    found = (controls.low[0], controls.low[1], controls.high[0], controls.high[1])
    if found != (*low, *high):
        problems.append(Problem("bounds of the control space", found, expected))
    return problems


def loop_problems(propagator: Any, closed_loop: bool) -> list[Problem]:
    """What is wrong where a propagator takes other controls than the planner makes."""
    takes_references = isinstance(propagator, TwoWheelPropagator) and propagator.model["law"][0] == CLOSED_LOOP
    if takes_references == closed_loop:
        return []
    expected = "True with a propagator in closed loop, whose controls are references"
    if closed_loop:
        expected = "False with a state propagator of one's own: in closed loop controls are references, not velocities"
    return [Problem("planning.closed_loop", closed_loop, expected)]


def _timing_problems(si: Any) -> list[Problem]:
    """What is wrong with the step and the durations, all of which OMPL takes after its ``setup``."""
    problems = step_problems(si.getPropagationStepSize())
    durations = si.getMinControlDuration(), si.getMaxControlDuration()
    if not 1 <= durations[0] <= durations[1] <= MAX_STEPS:
        expected = f"the smaller one first, from 1 to {MAX_STEPS} steps"
        problems.append(Problem("control durations", durations, expected))
    return problems


def step_problems(step: float) -> list[Problem]:
    """What is wrong with a propagation step [s]; OMPL lets NaN pass."""
    if is_number(step, LARGEST) and step >= SMALLEST:
        return []
    return [Problem("propagation step size", step, f"{A_POSITIVE_NUMBER} [s]")]


def check_control_sampler(controls: Any, planner: str) -> None:
    """Refuse a control sampler of a user's own, which a planner that steers by a law would never ask.

    Args:
        controls: the control space. The look takes one of the seeds that OMPL deals out.
        planner: the planner's name.

    Raises:
        SettingsError: if there is one.
    """
    found = type(controls.allocControlSampler()).__name__
    if found != DEFAULT_CONTROL_SAMPLER:
        expected = f"OMPL's own, since {planner} chooses its controls by a law; {FREE_PLANNERS} take others"
        raise SettingsError(Problem("control sampler", found, expected), source=planner)


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
