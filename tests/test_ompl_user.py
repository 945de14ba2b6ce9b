"""What an OMPL user sets is obeyed, or refused by name: by our planners as by OMPL's own."""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cbrrt_ompl import (
    FclStateValidityChecker,
    KanayamaDirectedControlSampler,
    SteeringDirectedControlSampler,
    TwoWheelPropagator,
    make_control_space,
    make_setup,
    make_state_space,
    read_state,
    trajectory_from_path,
    verify,
    with_directed_sampler,
    write_state,
)
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import SettingsError, TrajectoryError
from cbrrt_ompl.motion.model import CLOSED_LOOP
from cbrrt_ompl.ompl_plugin.availability import has_ompl
from cbrrt_ompl.planners.registry import PLANNERS, Backend
from cbrrt_ompl.problem.obstacles import Bounds, Box
from cbrrt_ompl.problem.robot import Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.scenario.scenario import Scenario

if has_ompl():
    from ompl_rounds import solve

    from cbrrt_ompl.ompl_plugin.binding import ob, oc, ou
    from cbrrt_ompl.ompl_plugin.setup import make_planner
else:
    pytest.skip("all of it needs OMPL", allow_module_level=True)

pytestmark = pytest.mark.usefixtures("quiet_ompl")

OPEN = Scenario(name="open", world=World(Bounds((-5.0, -5.0), (5.0, 5.0))), start=State(-4.0, 0.0), goal=Goal(4.0, 0.0))
BY_VELOCITIES = replace(OPEN, planning=PlanningSettings(closed_loop=False))
"""The same, with controls that are velocities for every planner."""
OURS = [name for name, planner in PLANNERS.items() if planner.backend is not Backend.OMPL and not planner.is_anytime]
"""Without the anytime one, which goes on until its time is over."""
ALL = list(PLANNERS)
MOST = [*OURS, "rrt", "est"]
"""All of ours, and two of OMPL's for comparison."""

Part = Callable[[Any], Any]


def scoped(setup: Any, *values: float) -> Any:
    state = ob.State(setup.getStateSpace())
    write_state(state, State(*values))
    return state


def dense_states(setup: Any) -> list[State]:
    """The states of the solution at every integration step."""
    path = setup.getSolutionPath()
    path.interpolate()
    return [read_state(path.getState(i)) for i in range(path.getStateCount())]


def last_state(setup: Any) -> Any:
    path = setup.getSolutionPath()
    return path.getState(path.getStateCount() - 1)


# validity checkers


def in_wall(state: State) -> bool:
    """A wall that only the user knows, passable at y > 3."""
    return -1.0 < state.x < 1.0 and state.y < 3.0


class KeepOut(ob.StateValidityChecker):  # type: ignore[misc]
    """A user's own class."""

    def __init__(self, si: Any) -> None:
        super().__init__(si)
        self.space = si.getStateSpace()

    def isValid(self, state: Any) -> bool:
        return bool(self.space.satisfiesBounds(state)) and not in_wall(read_state(state))


def keep_out_function(si: Any) -> Any:
    space = si.getStateSpace()
    return ob.StateValidityCheckerFn(lambda state: space.satisfiesBounds(state) and not in_wall(read_state(state)))


class KeepOutBesides(FclStateValidityChecker):  # type: ignore[misc]
    """Ours, and a wall."""

    def isValid(self, state: Any) -> bool:
        return super().isValid(state) and not in_wall(read_state(state))


MAKERS: dict[str, Part] = {
    "function": keep_out_function,
    "class": KeepOut,
    "derived": lambda si: KeepOutBesides(si, OPEN.robot, OPEN.world),
}


@pytest.mark.parametrize("kind", MAKERS)
@pytest.mark.parametrize("planner", MOST)
def test_no_planner_passes_through_what_only_the_users_checker_forbids(planner: str, kind: str) -> None:
    """cb-rrt and the compiled planners never asked it, and called their solutions exact."""
    setup = make_setup(OPEN, planner)
    setup.setStateValidityChecker(MAKERS[kind](setup.getSpaceInformation()))
    assert solve(setup) == "Exact solution"
    assert setup.getSolutionPath().check()
    assert not any(map(in_wall, dense_states(setup)))


@pytest.mark.parametrize("planner", OURS)
def test_the_users_checker_alone_decides(planner: str) -> None:
    """A world of obstacles, in which the user allows everything within the bounds."""
    wall = replace(OPEN, world=World(OPEN.world.bounds, [Box((-0.5, -4.9), (0.5, 4.9))]))
    setup = make_setup(wall, planner)
    space = setup.getStateSpace()
    setup.setStateValidityChecker(ob.StateValidityCheckerFn(lambda state: space.satisfiesBounds(state)))
    assert solve(setup) == "Exact solution"
    assert any(abs(state.x) < 0.4 for state in dense_states(setup))


@pytest.mark.parametrize("planner", ALL)
def test_where_nothing_is_valid_the_start_is_not(planner: str) -> None:
    setup = make_setup(OPEN, planner)
    setup.setStateValidityChecker(ob.StateValidityCheckerFn(lambda state: False))
    assert solve(setup, 100) == "Invalid start"


@pytest.mark.parametrize("planner", OURS)
def test_a_checker_that_comes_later_begins_a_new_tree(planner: str) -> None:
    setup = make_setup(OPEN, planner)
    assert solve(setup) == "Exact solution"
    setup.setStateValidityChecker(keep_out_function(setup.getSpaceInformation()))
    setup.getProblemDefinition().clearSolutionPaths()
    assert solve(setup) == "Exact solution"
    assert not any(map(in_wall, dense_states(setup)))


@pytest.mark.parametrize("planner", OURS)
def test_braking_is_not_promised_for_the_users_checker(planner: str) -> None:
    setup = make_setup(replace(OPEN, planning=PlanningSettings(brake_safe=True)), planner)
    setup.setStateValidityChecker(KeepOut(setup.getSpaceInformation()))
    with pytest.raises(SettingsError, match=f"{planner}: planning.brake_safe"):
        setup.setup()


# starts


@pytest.mark.parametrize("planner", ALL)
@pytest.mark.parametrize(
    "start", [(-40.0, 0.0), (math.nan, 0.0), (-4.0, 0.0, math.nan), (-4.0, 0.0, 0.0, math.nan), (0.0, 0.0)]
)
def test_an_invalid_start_is_a_status(planner: str, start: tuple[float, ...]) -> None:
    """NaN crashed the compiled planners, and they searched on from outside of the world."""
    setup = make_setup(replace(OPEN, world=World(OPEN.world.bounds, [Box((-0.5, -0.5), (0.5, 0.5))])), planner)
    setup.setStartState(scoped(setup, *start))
    assert solve(setup, 100) == "Invalid start"


@pytest.mark.parametrize("planner", MOST)
def test_of_several_starts_the_valid_ones_are_used(planner: str) -> None:
    setup = make_setup(OPEN, planner)
    setup.clearStartStates()
    for start in ((-40.0, 0.0), (3.0, 3.0), (3.0, -3.0)):
        setup.addStartState(scoped(setup, *start))
    assert solve(setup) == "Exact solution"
    assert dense_states(setup)[0][:2] in ((3.0, 3.0), (3.0, -3.0))


@pytest.mark.parametrize("planner", OURS)
@pytest.mark.parametrize("clears", [True, False], ids=["after clear", "without clear"])
def test_a_new_start_is_started_from(planner: str, clears: bool) -> None:
    setup = make_setup(OPEN, planner)
    assert solve(setup) == "Exact solution"
    if clears:
        setup.clear()
    setup.getProblemDefinition().clearSolutionPaths()
    setup.setStartState(scoped(setup, 0.0, 4.0))
    assert solve(setup) == "Exact solution"
    assert dense_states(setup)[0][:2] == (0.0, 4.0)


@pytest.mark.parametrize("planner", MOST)
def test_a_start_with_a_heading_out_of_bounds_is_no_start(planner: str) -> None:
    """OMPL's headings are below pi; the compiled planners wrapped it, and began elsewhere than they were told."""
    setup = make_setup(OPEN, planner)
    start = scoped(setup, -4.0, 0.0)
    start()[1].value = math.pi
    setup.setStartState(start)
    assert solve(setup, 100) == "Invalid start"


# goals


class UpperLeft(ob.GoalRegion):  # type: ignore[misc]
    """A user's own region, which no planner can sample."""

    def __init__(self, si: Any) -> None:
        super().__init__(si)
        self.setThreshold(0.1)

    def distanceGoal(self, state: Any) -> float:
        x, y = read_state(state)[:2]
        return max(0.0, 3.0 - y, 3.0 + x)


def goal_states(si: Any) -> Any:
    goal = ob.GoalStates(si)
    goal.setThreshold(0.4)
    for x in (-3.0, 3.0):
        state = ob.State(si.getStateSpace())
        write_state(state, State(x, 4.0))
        goal.addState(state)
    return goal


def goal_state(si: Any) -> Any:
    goal = ob.GoalState(si)
    state = ob.State(si.getStateSpace())
    write_state(state, State(-4.0, 4.0))
    goal.setState(state)
    goal.setThreshold(0.5)
    return goal


@pytest.mark.parametrize("clears", [True, False], ids=["after clear", "without clear"])
@pytest.mark.parametrize("make", [UpperLeft, goal_states, goal_state])
@pytest.mark.parametrize("planner", MOST)
def test_a_new_goal_is_planned_for(planner: str, make: Part, clears: bool) -> None:
    """The compiled planners went to the goal of the scenario, and called that exact."""
    setup = make_setup(OPEN, planner)
    assert solve(setup) == "Exact solution"
    goal = make(setup.getSpaceInformation())
    if clears:
        setup.clear()
    setup.getProblemDefinition().clearSolutionPaths()
    setup.setGoal(goal)
    assert solve(setup) == "Exact solution"
    assert goal.isSatisfied(last_state(setup))
    assert setup.getSolutionPath().check()


@pytest.mark.parametrize("planner", OURS)
def test_an_extension_ends_at_the_first_state_in_the_users_goal(planner: str) -> None:
    setup = make_setup(OPEN, planner)
    goal = UpperLeft(setup.getSpaceInformation())
    setup.setGoal(goal)
    assert solve(setup) == "Exact solution"
    path = setup.getSolutionPath()
    path.interpolate()
    assert not any(goal.isSatisfied(path.getState(i)) for i in range(path.getStateCount() - 1))


@pytest.mark.parametrize("planner", MOST)
def test_start_and_goal_are_replaced_together(planner: str) -> None:
    setup = make_setup(OPEN, planner)
    assert solve(setup) == "Exact solution"
    setup.clear()
    setup.setStartAndGoalStates(scoped(setup, 4.0, 4.0, -3.0), scoped(setup, -4.0, 4.0), 0.5)
    assert solve(setup) == "Exact solution"
    states = dense_states(setup)
    assert states[0][:2] == (4.0, 4.0)
    assert math.dist(states[-1][:2], (-4.0, 4.0)) < 0.5


@pytest.mark.parametrize("planner", MOST)
def test_a_second_solve_goes_on_with_the_tree(planner: str) -> None:
    setup = make_setup(replace(OPEN, goal=Goal(3.3, 1.7, tolerance=1e-9)), planner)
    counts = []
    for _ in range(2):
        assert solve(setup, 50) != "Exact solution"
        data = ob.PlannerData(setup.getSpaceInformation())
        setup.getPlannerData(data)
        counts.append(data.numVertices())
    assert counts[1] > counts[0] > 1


@pytest.mark.parametrize("planner", OURS)
def test_a_goal_without_end_ends_no_extension_early(planner: str) -> None:
    """A threshold of 0, as no state is nearer than that."""
    setup = make_setup(OPEN, planner)
    setup.getGoal().setThreshold(0.0)
    assert solve(setup, 30) != "Exact solution"


# steps, durations, bounds


@pytest.mark.parametrize("planner", OURS)
def test_step_and_longest_duration_are_those_of_the_space_information(planner: str) -> None:
    setup = make_setup(OPEN, planner)
    si = setup.getSpaceInformation()
    si.setPropagationStepSize(0.025)
    si.setMinMaxControlDuration(1, 30)
    assert solve(setup) == "Exact solution"
    path = setup.getSolutionPath()
    steps = np.array([path.getControlDuration(i) for i in range(path.getControlCount())]) / 0.025
    assert np.allclose(steps, np.rint(steps))
    assert steps.max() == pytest.approx(30.0)
    assert path.check()


@pytest.mark.parametrize("planner", MOST)
def test_no_control_is_shorter_than_the_user_wants(planner: str) -> None:
    setup = make_setup(OPEN, planner)
    setup.getSpaceInformation().setMinMaxControlDuration(15, 30)
    assert solve(setup) == "Exact solution"
    path = setup.getSolutionPath()
    durations = [path.getControlDuration(i) for i in range(path.getControlCount())]
    assert min(durations) >= 15 * OPEN.planning.step - 1e-9
    assert path.check()


@pytest.mark.parametrize("planner", OURS)
def test_a_step_that_is_too_long_for_the_robot_is_refused(planner: str) -> None:
    setup = make_setup(OPEN, planner)
    setup.getSpaceInformation().setPropagationStepSize(5.0)
    with pytest.raises(SettingsError, match="step"):
        setup.setup()


@pytest.mark.parametrize("step", [math.nan, math.inf, 1e-12])
@pytest.mark.parametrize("planner", OURS)
def test_a_step_that_is_no_time_is_refused(planner: str, step: float) -> None:
    """OMPL lets NaN pass; our planners drove by another step, and called paths exact whose durations were NaN."""
    setup = make_setup(OPEN, planner)
    setup.getSpaceInformation().setPropagationStepSize(step)
    with pytest.raises(
        SettingsError, match=f"^{planner}: propagation step size: got {step}, expected a number above 0.*$"
    ):
        setup.setup()


@pytest.mark.parametrize("durations", [(30, 5), (0, 5), (1, 2**31 - 1)])
@pytest.mark.parametrize("planner", OURS)
def test_durations_that_are_no_range_are_refused(planner: str, durations: tuple[int, int]) -> None:
    """OMPL looks at them in the first set-up alone; two thousand million steps could not be interrupted."""
    setup = make_setup(OPEN, planner)
    setup.setup()
    setup.getSpaceInformation().setMinMaxControlDuration(*durations)
    with pytest.raises((SettingsError, RuntimeError), match="control durations: got|number of steps"):
        solve(setup, 10)


def bounds(*pairs: tuple[float, float]) -> Any:
    made = ob.RealVectorBounds(len(pairs))
    for i, (low, high) in enumerate(pairs):
        made.setLow(i, low)
        made.setHigh(i, high)
    return made


@pytest.mark.parametrize("planner", MOST)
def test_narrower_bounds_of_the_positions_are_kept(planner: str) -> None:
    setup = make_setup(OPEN, planner)
    setup.getStateSpace().getSubspace(0).setBounds(bounds((-4.5, 4.5), (-0.6, 0.6)))
    assert solve(setup, 50_000) == "Exact solution"
    assert all(abs(state.y) <= 0.6 + 1e-9 for state in dense_states(setup))


@pytest.mark.parametrize("planner", OURS)
def test_other_bounds_of_velocities_and_controls_are_refused_by_name(planner: str) -> None:
    for change in (
        lambda setup: setup.getStateSpace().getSubspace(2).setBounds(bounds((0.0, 0.1), (-0.1, 0.1))),
        lambda setup: setup.getControlSpace().setBounds(bounds((0.0, 0.1), (-0.1, 0.1))),
    ):
        setup = make_setup(BY_VELOCITIES, planner)
        change(setup)
        with pytest.raises(SettingsError, match=f"{planner}: bounds .*scenario.robot.limits.*rrt"):
            setup.setup()


@pytest.mark.parametrize("planner", OURS)
def test_other_bounds_of_references_are_refused_by_name(planner: str) -> None:
    """In closed loop, bounds of the control space were ignored."""
    if PLANNERS[planner].law(PlanningSettings(closed_loop=True)) != CLOSED_LOOP:
        pytest.skip("no closed loop")
    setup = make_setup(replace(OPEN, planning=PlanningSettings(closed_loop=True)), planner)
    setup.getControlSpace().setBounds(bounds((0.0, 1.0), (0.0, 1.0), (-1.0, 1.0)))
    with pytest.raises(SettingsError, match=f"{planner}: bounds of the control space: .*those of the world.*rrt"):
        setup.setup()


@pytest.mark.parametrize("planner", ["syclop-rrt", "syclop-est"])
def test_syclop_grows_outside_of_the_world_where_the_user_allows_it(planner: str) -> None:
    """Its grid is that of the world; a state beyond had no cell, and the process ended by a signal."""
    setup = make_setup(OPEN, planner)
    space = setup.getStateSpace()
    space.getSubspace(0).setBounds(bounds((-30.0, 30.0), (-30.0, 30.0)))
    setup.setStateValidityChecker(ob.StateValidityCheckerFn(lambda state: space.satisfiesBounds(state)))
    setup.setStartAndGoalStates(scoped(setup, -25.0, -25.0), scoped(setup, -21.0, -25.0), 1.5)
    assert solve(setup, 300) in ("Exact solution", "Approximate solution")
    assert setup.getSolutionPath().check()


@pytest.mark.parametrize("planner", ["syclop-rrt", "syclop-est"])
def test_an_approximate_solution_of_syclop_is_called_so(planner: str) -> None:
    """OMPL's Syclop planners call every solution exact."""
    setup = make_setup(replace(OPEN, goal=Goal(3.3, 1.7, tolerance=1e-9)), planner)
    assert solve(setup, 50) == "Approximate solution"
    assert not setup.haveExactSolutionPath()


# control samplers


class Slow(oc.ControlSampler):  # type: ignore[misc]
    """A user's own choice of controls."""

    def sample(self, control: Any, *_: Any) -> None:
        control[0], control[1] = 0.3, 0.1


@pytest.mark.parametrize("planner", OURS)
def test_a_control_sampler_of_ones_own_is_refused_where_a_law_chooses(planner: str) -> None:
    """It was never asked, and nobody said so."""
    setup = make_setup(OPEN, planner)
    setup.getControlSpace().setControlSamplerAllocator(oc.ControlSamplerAllocator(Slow))
    with pytest.raises(SettingsError, match=f"{planner}: control sampler: got 'Slow', expected OMPL's own.*rrt"):
        setup.setup()


@pytest.mark.parametrize("planner", ["rrt", "est", "sst"])
def test_a_control_sampler_of_ones_own_is_obeyed_by_planners_of_ompl(planner: str) -> None:
    setup = make_setup(OPEN, planner)
    setup.getControlSpace().setControlSamplerAllocator(oc.ControlSamplerAllocator(Slow))
    solve(setup, 50)
    data = oc.PlannerData(setup.getSpaceInformation())
    setup.getPlannerData(data)
    children = ou.vectorUint()
    edges = [(i, j) for i in range(data.numVertices()) for j in (data.getEdges(i, children), *children)[1:]]
    controls = [data.getEdge(i, j).getControl() for i, j in edges]
    assert {(control[0], control[1]) for control in controls} == {(0.3, 0.1)}


# propagators


def half_speed(state: Any, control: Any, duration: float, result: Any) -> None:
    """A user's robot: its velocities jump to half of what is asked for."""
    x, y, theta, _, _ = read_state(state)
    v, omega = 0.5 * control[0], 0.5 * control[1]
    x, y = x + v * math.cos(theta) * duration, y + v * math.sin(theta) * duration
    write_state(result, State(x, y, theta + omega * duration, v, omega))


@pytest.mark.parametrize("planner", MOST)
def test_the_users_propagator_moves_the_robot(planner: str) -> None:
    setup = make_setup(BY_VELOCITIES, planner)
    setup.setStatePropagator(oc.StatePropagatorFn(half_speed))
    assert solve(setup) == "Exact solution"
    assert setup.getSolutionPath().check()
    limits = OPEN.robot.limits
    assert max(state.v for state in dense_states(setup)) <= 0.5 * limits.v_max + 1e-12
    trajectory = trajectory_from_path(setup.getSolutionPath(), OPEN)
    assert trajectory.states[-1] == pytest.approx(np.array(read_state(last_state(setup))), abs=1e-9)


@pytest.mark.parametrize("planner", ["cb-rrt-robust", "cb-rrt"])
def test_a_users_propagator_is_refused_in_closed_loop(planner: str) -> None:
    """It would take references for velocities."""
    setup = make_setup(replace(OPEN, planning=PlanningSettings(closed_loop=True)), planner)
    setup.setStatePropagator(oc.StatePropagatorFn(half_speed))
    with pytest.raises(SettingsError, match=f"{planner}: planning.closed_loop: got True, expected False with a state"):
        setup.setup()


@pytest.mark.parametrize("closed_loop", [False, True])
@pytest.mark.parametrize("planner", ["cb-rrt", "cb-rrt-compiled", "cb-rrt-robust"])
def test_a_propagator_that_takes_other_controls_is_refused(planner: str, closed_loop: bool) -> None:
    """A propagator of ours in open loop was taken in closed loop, and drove references as velocities."""
    planning = PlanningSettings(closed_loop=closed_loop)
    setup = make_setup(replace(OPEN, planning=planning, goal=Goal(4.0, 0.0, theta=0.5, heading_tolerance=0.5)), planner)
    si, other = setup.getSpaceInformation(), PlanningSettings(closed_loop=not closed_loop)
    setup.setStatePropagator(TwoWheelPropagator(si, OPEN.robot, other))
    with pytest.raises(SettingsError, match=f"{planner}: planning.closed_loop: got {closed_loop}, expected"):
        setup.setup()


@pytest.mark.parametrize("part", ["checker", "propagator", "goal"])
@pytest.mark.parametrize("planner", MOST)
def test_an_exception_of_a_users_part_reaches_the_caller(planner: str, part: str) -> None:
    calls = itertools.count()

    def fail_later(*_: Any) -> bool:
        if next(calls) > 40:
            raise LookupError("on purpose")
        return True

    class Failing(ob.GoalRegion):  # type: ignore[misc]
        def distanceGoal(self, state: Any) -> float:
            fail_later()
            return 1.0

    setup = make_setup(BY_VELOCITIES if part == "propagator" else OPEN, planner)
    if part == "checker":
        setup.setStateValidityChecker(ob.StateValidityCheckerFn(fail_later))
    elif part == "propagator":
        setup.setStatePropagator(oc.StatePropagatorFn(lambda *_: fail_later() and None))
    else:
        setup.setGoal(Failing(setup.getSpaceInformation()))
    with pytest.raises(LookupError, match="on purpose"):
        solve(setup)


# which planner uses which directed sampler


def allocations(sampler: type, calls: list[str]) -> Callable[[Any], Any]:
    def allocate(si: Any) -> Any:
        calls.append(sampler.__name__)
        return sampler(si, OPEN.robot, OPEN.world)

    return allocate


def test_a_planner_made_by_hand_beside_ours_keeps_the_sampler_of_ompl() -> None:
    """oc.RRT(si) took the Kanayama sampler, so that CB-RRT was compared with itself."""
    setup = make_setup(replace(OPEN, goal=Goal(4.0, 0.0, tolerance=1e-9)), "cb-rrt")
    si = setup.getSpaceInformation()
    solve(setup, 50)
    ours = setup.getPlanner()
    assert type(ours.sampler) is KanayamaDirectedControlSampler
    setup.setPlanner(oc.RRT(si))
    solve(setup, 50)
    assert type(si.allocDirectedControlSampler()) is oc.SimpleDirectedControlSampler
    assert ours.sampler.samples == 50


def test_a_sampler_that_a_user_puts_into_the_space_information_is_obeyed_with_a_warning() -> None:
    setup = make_setup(OPEN, "cb-rrt")
    calls: list[str] = []
    setup.getSpaceInformation().setDirectedControlSamplerAllocator(
        oc.DirectedControlSamplerAllocator(allocations(SteeringDirectedControlSampler, calls))
    )
    with pytest.warns(UserWarning, match="cb-rrt extends by SteeringDirectedControlSampler"):
        solve(setup, 50)
    assert set(calls) == {"SteeringDirectedControlSampler"}


@pytest.mark.parametrize("planner", [oc.RRT, oc.EST])
def test_one_planner_alone_is_given_a_directed_sampler(planner: type) -> None:
    setup = make_setup(OPEN, "rrt")
    si, calls = setup.getSpaceInformation(), []
    setup.setPlanner(with_directed_sampler(planner, si, allocations(KanayamaDirectedControlSampler, calls)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert solve(setup) == "Exact solution"
    assert calls == ["KanayamaDirectedControlSampler"]
    assert setup.getSolutionPath().check()
    assert type(si.allocDirectedControlSampler()) is oc.SimpleDirectedControlSampler


@pytest.mark.parametrize("planner", [oc.SST, oc.KPIECE1, oc.SyclopEST])
def test_a_planner_that_never_asks_for_a_directed_sampler_is_given_none(planner: type) -> None:
    """The sampler was ignored."""
    si = make_setup(OPEN, "rrt").getSpaceInformation()
    with pytest.raises(
        SettingsError, match=f"planner: got {planner.__name__}, expected one that extends by a directed"
    ):
        with_directed_sampler(planner, si, allocations(KanayamaDirectedControlSampler, []))


def test_an_allocator_that_makes_no_directed_sampler_is_told_so() -> None:
    """OMPL called a method of None, which ended the process."""
    setup = make_setup(OPEN, "rrt")
    setup.setPlanner(with_directed_sampler(oc.RRT, setup.getSpaceInformation(), lambda si: None))
    with pytest.raises(SettingsError, match="directed sampler: got None, expected an ompl.control"):
        solve(setup, 10)


# names, problems and seeds


@pytest.mark.parametrize("compiled", [True, False])
def test_a_set_up_is_printed_before_it_is_set_up(compiled: bool) -> None:
    """The projection was not set up then, and the process ended by a signal."""
    setup = make_setup(OPEN, "cb-rrt", compiled)
    for part in (setup, setup.getProblemDefinition(), setup.getPlanner()):
        assert str(part)
    assert "Projection of dimension 2" in setup.getStateSpace().settings()
    assert "SE2xR2" in setup.getSpaceInformation().settings()


def test_weights_without_a_distance_are_an_error() -> None:
    """OMPL refuses them, and printed the projection that was not set up."""
    setup = make_setup(OPEN, "cb-rrt")
    setup.getStateSpace().setSubspaceWeight(0, 0.0)
    with pytest.raises(RuntimeError, match="longest valid segment"):
        setup.setup()


@pytest.mark.parametrize("planner", MOST)
def test_a_planner_may_have_another_name(planner: str) -> None:
    """Under a name of the user's choice, our planners no longer knew themselves."""
    setup = make_setup(OPEN, planner)
    setup.getPlanner().setName("mine")
    assert solve(setup) == "Exact solution"
    assert setup.getProblemDefinition().getSolutions()[0].plannerName_ == "mine"


@pytest.mark.parametrize("planner", OURS)
def test_a_planner_without_a_problem_says_so(planner: str) -> None:
    alone = make_planner(make_setup(OPEN, planner).getSpaceInformation(), OPEN, planner)
    with pytest.raises(RuntimeError, match=f"{planner}: Problem definition not specified"):
        alone.solve(0.1)


@pytest.mark.parametrize("planner", OURS)
def test_the_seed_of_ompl_makes_plans_repeatable(planner: str) -> None:
    """The compiled planners drew a fresh seed all the same."""

    def path(seed: int) -> str:
        setup = make_setup(OPEN, planner)
        assert solve(setup, seed=seed) == "Exact solution"
        found: str = setup.getSolutionPath().printAsMatrix()
        return found

    assert path(7) == path(7) != path(8)


# our parts in a user's own set-up

WORLD = World(Bounds((-5.0, -5.0), (5.0, 5.0)), [Box((-0.5, -5.0), (0.5, 2.0))])
ROBOT = Robot()


def by_hand(kinematic: bool = False) -> tuple[Any, Any]:
    """A space information and a problem of a user's own."""
    space = make_state_space(WORLD, ROBOT)
    si = oc.SpaceInformation(space, make_control_space(space, ROBOT))
    si.setStateValidityChecker(FclStateValidityChecker(si, ROBOT, WORLD))
    si.setStatePropagator(TwoWheelPropagator(si, ROBOT, kinematic=kinematic))
    si.setPropagationStepSize(0.05)
    si.setMinMaxControlDuration(1, 40)
    si.setup()
    problem = ob.ProblemDefinition(si)
    start, goal = ob.State(space), ob.State(space)
    write_state(start, State(-4.0, -4.0))
    write_state(goal, State(4.0, -4.0))
    problem.setStartAndGoalStates(start, goal, 0.5)
    return si, problem


@pytest.mark.parametrize("planner", [oc.RRT, oc.EST])
@pytest.mark.parametrize("sampler", [KanayamaDirectedControlSampler, SteeringDirectedControlSampler])
def test_our_parts_work_by_hand_and_their_paths_verify(sampler: Any, planner: Any) -> None:
    si, problem = by_hand(kinematic=sampler is SteeringDirectedControlSampler)
    si.setDirectedControlSamplerAllocator(
        oc.DirectedControlSamplerAllocator(lambda owner: sampler(owner, ROBOT, WORLD))
    )
    ou.RNG.setSeed(1)
    made = planner(si)
    made.setProblemDefinition(problem)
    made.setup()
    assert made.solve(20.0).asString() == "Exact solution"
    path = problem.getSolutionPath()
    assert path.check()
    scenario = Scenario(name="by hand", world=WORLD, robot=ROBOT, start=State(-4.0, -4.0), goal=Goal(4.0, -4.0))
    trajectory = trajectory_from_path(path, scenario)
    assert trajectory.kinematic == (sampler is SteeringDirectedControlSampler)
    assert verify(trajectory, scenario).ok
    assert path.asGeometric().getStateCount() == len(trajectory)


def test_a_checker_that_comes_later_is_asked_before_the_first_extension() -> None:
    """A sampler of ours in a planner of OMPL's went by the old one for up to 4096 extensions."""
    setup = make_setup(replace(OPEN, goal=Goal(4.0, 0.0, tolerance=1e-9)), "rrt")
    si = setup.getSpaceInformation()
    setup.setPlanner(with_directed_sampler(oc.RRT, si, allocations(KanayamaDirectedControlSampler, [])))

    def nodes_above() -> int:
        data = ob.PlannerData(si)
        setup.getPlannerData(data)
        return sum(data.getVertex(i).getState()[0][1] >= 0.5 for i in range(data.numVertices()))

    solve(setup, 60)
    before = nodes_above()
    setup.setStateValidityChecker(ob.StateValidityCheckerFn(lambda state: state[0][1] < 0.5))
    solve(setup, 300)
    assert nodes_above() == before > 0


def test_world_and_robot_of_a_part_cannot_be_replaced() -> None:
    """Compiled code went on with the old ones."""
    si = by_hand()[0]
    for part, name in ((FclStateValidityChecker(si, ROBOT, WORLD), "world"), (TwoWheelPropagator(si, ROBOT), "robot")):
        with pytest.raises(AttributeError, match=f"'{name}'|no setter|can't set"):
            setattr(part, name, None)


def test_a_control_space_of_another_layout_is_refused() -> None:
    """Compiled code would read a number of the control that is not there."""
    space = make_state_space(WORLD, ROBOT)
    for controls, closed_loop in (
        (oc.RealVectorControlSpace(space, 1), False),
        (oc.RealVectorControlSpace(space, 4), False),
        (oc.DiscreteControlSpace(space, 0, 3), False),
        (make_control_space(space, ROBOT), True),
    ):
        si = oc.SpaceInformation(space, controls)
        with pytest.raises(SettingsError, match="control space: got "):
            TwoWheelPropagator(si, ROBOT, PlanningSettings(closed_loop=closed_loop))


@pytest.mark.parametrize("make", [TwoWheelPropagator, lambda si, robot: FclStateValidityChecker(si, robot, WORLD)])
def test_a_space_of_another_layout_is_refused(make: Any) -> None:
    space = ob.SE2StateSpace()
    si = oc.SpaceInformation(space, oc.RealVectorControlSpace(space, 2))
    with pytest.raises(SettingsError, match="make_state_space"):
        make(si, ROBOT)


def test_a_state_is_read_and_written_by_name() -> None:
    space = make_state_space(WORLD, ROBOT)
    state = ob.State(space)
    write_state(state, State(x=1.0, y=2.0, theta=0.5 + math.tau, v=0.25, omega=-0.125))
    assert read_state(state) == pytest.approx((1.0, 2.0, 0.5, 0.25, -0.125))
    assert read_state(state()).v == 0.25


def test_what_is_no_path_makes_no_trajectory() -> None:
    with pytest.raises(TrajectoryError, match="PathControl"):
        trajectory_from_path("path", OPEN)
    with pytest.raises(TrajectoryError, match="at least one state"):
        trajectory_from_path(oc.PathControl(by_hand()[0]), OPEN)
