"""Inside OMPL: what is stored replays, what is handed over is obeyed, and no planner runs with another one's parts."""

from __future__ import annotations

import gc
import math
import os
import random
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from cbrrt_ompl import load_scenario, make_setup, plan
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import UnknownPlannerError
from cbrrt_ompl.motion.model import OPEN_LOOP, in_goal, make_model
from cbrrt_ompl.ompl_plugin.availability import has_ompl
from cbrrt_ompl.planners.registry import PLANNERS, Backend
from cbrrt_ompl.problem.obstacles import Bounds, Box
from cbrrt_ompl.problem.robot import Limits, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.scenario.scenario import Scenario

if has_ompl():
    from ompl_rounds import solve

    from cbrrt_ompl.ompl_plugin.binding import ob, oc, ou
    from cbrrt_ompl.ompl_plugin.goals import PoseGoal, make_goal
    from cbrrt_ompl.ompl_plugin.propagators import TwoWheelPropagator
    from cbrrt_ompl.ompl_plugin.reals import StateReals, vector_memory
    from cbrrt_ompl.ompl_plugin.results import trajectory_from_path
    from cbrrt_ompl.ompl_plugin.samplers import (
        ExtensionSampler,
        KanayamaDirectedControlSampler,
        SteeringDirectedControlSampler,
    )
    from cbrrt_ompl.ompl_plugin.setup import (
        equip,
        make_planner,
    )
    from cbrrt_ompl.ompl_plugin.space import make_state_space, write_state
    from cbrrt_ompl.ompl_plugin.validity import FclStateValidityChecker
else:
    pytest.skip("all of it needs OMPL", allow_module_level=True)

pytestmark = pytest.mark.usefixtures("quiet_ompl")

BOUNDS = Bounds((0.0, 0.0), (10.0, 10.0))
EASY = Scenario(
    name="easy",
    world=World(BOUNDS, [Box((4.8, 0.0), (5.0, 6.0))]),
    start=State(2.0, 2.0),
    goal=Goal(8.0, 8.0, tolerance=0.8),
)
"""A wall to drive around: every planner solves it in a fraction of a second."""

PAPER_PLANNERS = [name for name, planner in PLANNERS.items() if planner.backend is Backend.PLUGIN]
OTHER_PLANNERS = [name for name, planner in PLANNERS.items() if planner.backend is not Backend.PLUGIN]
ALL_PLANNERS = list(PLANNERS)


@pytest.fixture
def sampler_calls(monkeypatch: pytest.MonkeyPatch) -> Counter[type]:
    """Counts the calls of our directed samplers, by class."""
    calls: Counter[type] = Counter()
    original = ExtensionSampler.sampleTo

    def counted(self: ExtensionSampler, control: Any, *states: Any) -> int:
        calls[type(self)] += 1
        return original(self, control, *states)

    monkeypatch.setattr(ExtensionSampler, "sampleTo", counted)
    return calls


def ompl_state(space: Any, *values: float) -> Any:
    """A scoped state of (x, y, theta, v, omega)."""
    state = ob.State(space)
    write_state(state, State(*values))
    return state


def reals(space: Any, state: Any) -> NDArray[np.float64]:
    """The numbers of a state by OMPL's own means, shape (5,)."""
    numbers = ou.vectorDouble()
    space.copyToReals(numbers, state)
    return np.array(list(numbers))


def deviation(space: Any, state: Any, other: Any) -> float:
    """Largest difference of two states, the headings compared on the circle."""
    difference = reals(space, state) - reals(space, other)
    difference[2] = math.remainder(difference[2], math.tau)
    return float(np.abs(difference).max())


# what OMPL stores replays


@pytest.mark.parametrize("closed_loop", [False, True], ids=["open loop", "closed loop"])
@pytest.mark.parametrize("planner", PAPER_PLANNERS)
@pytest.mark.parametrize("scene", ["paper_case1", "paper_case2", "office"])
def test_the_path_that_ompl_stores_is_valid_by_its_own_check(
    scenarios: Path, scene: str, planner: str, closed_loop: bool
) -> None:
    """Where the rounds do not suffice, it is the approximate path that is checked: each edge counts."""
    scenario = load_scenario(scenarios / f"{scene}.yaml")
    scenario = replace(scenario, planning=replace(scenario.planning, closed_loop=closed_loop))
    setup = make_setup(scenario, planner)
    solve(setup, 1500)
    path = setup.getSolutionPath()
    assert path.check()
    si, space = setup.getSpaceInformation(), setup.getStateSpace()
    result = ob.State(space)
    for i in range(path.getControlCount()):
        steps = path.getControlDuration(i) / scenario.planning.step
        assert steps == pytest.approx(round(steps), abs=1e-9)
        si.propagate(path.getState(i), path.getControl(i), round(steps), result())
        assert deviation(space, result(), path.getState(i + 1)) < 1e-9
    assert path.getControlCount() >= 1


@pytest.mark.parametrize("closed_loop", [False, True], ids=["open loop", "closed loop"])
@pytest.mark.parametrize("planner", PAPER_PLANNERS)
@pytest.mark.parametrize("scene", ["paper_case1", "paper_case2", "office"])
def test_every_edge_of_the_tree_replays_to_the_stored_states(
    scenarios: Path, scene: str, planner: str, closed_loop: bool
) -> None:
    scenario = load_scenario(scenarios / f"{scene}.yaml")
    scenario = replace(scenario, planning=replace(scenario.planning, closed_loop=closed_loop))
    setup = make_setup(scenario, planner)
    solve(setup, 1000)
    si, space = setup.getSpaceInformation(), setup.getStateSpace()
    data = oc.PlannerData(si)
    setup.getPlannerData(data)
    result, children, edges = ob.State(space), ou.vectorUint(), 0
    for parent in range(data.numVertices()):
        data.getEdges(parent, children)
        for child in children:
            edge = data.getEdge(parent, child)
            steps = round(edge.getDuration() / scenario.planning.step)
            si.propagate(data.getVertex(parent).getState(), edge.getControl(), steps, result())
            assert deviation(space, result(), data.getVertex(child).getState()) < 1e-9
            assert si.isValid(data.getVertex(child).getState())
            edges += 1
    assert edges == data.numVertices() - 1 >= 1


@pytest.mark.parametrize("planner", PAPER_PLANNERS)
def test_a_trajectory_passes_through_the_states_of_its_path(planner: str) -> None:
    setup = make_setup(EASY, planner)
    solve(setup, 5000)
    assert setup.haveExactSolutionPath()
    path, space = setup.getSolutionPath(), setup.getStateSpace()
    trajectory = trajectory_from_path(path, EASY)
    durations = [path.getControlDuration(i) for i in range(path.getControlCount())]
    rows = np.rint(np.cumsum([0.0, *durations]) / EASY.planning.step).astype(int)
    stored = np.array([reals(space, path.getState(i)) for i in range(path.getStateCount())])
    assert rows[-1] == len(trajectory) - 1
    assert np.abs(trajectory.states[rows] - stored).max() < 1e-9


# an ordinary SimpleSetup


@pytest.mark.parametrize("planner", ALL_PLANNERS)
def test_every_planner_solves_an_easy_scenario_through_simple_setup(planner: str) -> None:
    setup = make_setup(EASY, planner)
    assert isinstance(setup, oc.SimpleSetup)
    solve(setup, 500 if PLANNERS[planner].is_anytime else 50_000)  # those go on as long as they are let
    assert setup.haveExactSolutionPath()
    assert setup.getSolutionPath().check()
    assert setup.getPlanner().getName() == planner


def test_a_user_goes_on_with_the_calls_of_simple_setup() -> None:
    setup = make_setup(EASY)
    start = ompl_state(setup.getStateSpace(), 3.0, 7.0, 1.0, 0.0, 0.0)
    setup.setStartState(start)
    assert setup.solve(5.0)
    path = setup.getSolutionPath()
    rows = np.array([[float(number) for number in line.split()] for line in path.printAsMatrix().splitlines() if line])
    assert rows.shape == (path.getStateCount(), 5 + 2 + 1)
    assert rows[0] == pytest.approx([3.0, 7.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    data = ob.PlannerData(setup.getSpaceInformation())
    setup.getPlannerData(data)
    assert data.numVertices() >= path.getStateCount()
    assert data.numStartVertices() == 1
    setup.clear()
    assert setup.solve(5.0)


def test_a_setup_outlives_the_function_that_made_it() -> None:
    def made_elsewhere() -> Any:
        return make_setup(replace(EASY, world=World(BOUNDS, EASY.world.obstacles)), "cb-rrt")

    setup = made_elsewhere()
    gc.collect()
    solve(setup, 5000)
    assert setup.haveExactSolutionPath()


def test_an_unknown_planner_is_told_the_known_ones() -> None:
    with pytest.raises(UnknownPlannerError, match="'rtt'.*cb-rrt.*syclop-rrt"):
        make_setup(EASY, "rtt")


# space, metric, projection


SPACE = make_state_space(Bounds((-5.0, -5.0), (5.0, 5.0)), Limits())
SPACE.setup()
SPACE_INFORMATION = ob.SpaceInformation(SPACE)


@given(st.lists(st.floats(-5.0, 5.0), min_size=10, max_size=10))
def test_the_metric_looks_at_positions_alone(numbers: list[float]) -> None:
    first, second = ompl_state(SPACE, *numbers[:5]), ompl_state(SPACE, *numbers[5:])
    expected = math.hypot(numbers[0] - numbers[5], numbers[1] - numbers[6])
    assert SPACE.distance(first(), second()) == pytest.approx(expected, rel=1e-12, abs=1e-15)


def test_the_projection_to_the_plane_is_registered() -> None:
    setup = make_setup(EASY)
    setup.setup()
    space = setup.getStateSpace()
    assert space.hasDefaultProjection()
    assert space.getDefaultProjection().getDimension() == 2


def test_a_heading_of_pi_at_the_start_is_wrapped() -> None:
    """OMPL's SO(2) is half open: a heading of exactly pi is out of bounds."""
    scenario = replace(EASY, start=State(2.0, 2.0, math.pi))
    setup = make_setup(scenario)
    start = setup.getProblemDefinition().getStartState(0)
    assert start[1].value == -math.pi
    assert setup.getSpaceInformation().satisfiesBounds(start)
    result = plan(scenario, "rrt", seed=1)
    assert result.trajectory is not None
    assert result.trajectory.theta[0] == -math.pi


@given(st.tuples(*[st.floats(-4.9, 4.9)] * 2, st.floats(-3.1, 3.1), st.floats(0.0, 1.0), st.floats(-0.5, 0.5)))
def test_the_reals_of_a_state_are_its_elements(numbers: tuple[float, ...]) -> None:
    scoped, buffer = ompl_state(SPACE, *numbers), StateReals(SPACE, 5)
    state = scoped()  # dies with its ScopedState
    buffer.read(state)
    elements = [state[0][0], state[0][1], state[1].value, state[2][0], state[2][1]]
    assert buffer.values.tolist() == elements
    buffer.values[:] = buffer.values[::-1].copy()
    buffer.write(state)
    assert [state[0][0], state[0][1], state[1].value, state[2][0], state[2][1]] == elements[::-1]


@pytest.mark.parametrize("make", [ou.vectorInt, ou.vectorUint])
def test_a_vector_of_another_layout_is_refused(make: Any) -> None:
    vector = make()
    vector.extend([1, 2, 3])
    with pytest.raises(ImportError, match=r"wheel of ompl 1\.7\.0"):
        vector_memory(vector)


def test_a_vector_whose_memory_is_not_there_is_refused() -> None:
    with pytest.raises(ImportError, match=r"wheel of ompl 1\.7\.0"):
        vector_memory(ou.vectorDouble())


# goals


@given(st.floats(0.0, math.tau), st.integers(-3, 3))
def test_kernel_and_goal_state_agree_on_the_rim_of_the_goal(angle: float, ulps: int) -> None:
    goal = Goal(1.0, 2.0, tolerance=0.5)
    distance = goal.tolerance
    for _ in range(abs(ulps)):
        distance = math.nextafter(distance, math.copysign(math.inf, ulps))
    x, y = goal.x + distance * math.cos(angle), goal.y + distance * math.sin(angle)
    region = make_goal(SPACE_INFORMATION, SPACE, goal)
    kernel = make_model(OPEN_LOOP, Robot(), goal, PlanningSettings())["goal"][0]
    state = ompl_state(SPACE, x, y, 0.3, 0.1, 0.1)
    assert in_goal(kernel, x, y, 0.3, 0.1, 0.1) == region.isSatisfied(state())


@given(st.floats(0.0, 1.0), st.floats(0.0, math.tau), st.floats(-3.1, 3.1), st.floats(0.0, 0.4), st.floats(-0.4, 0.4))
def test_a_goal_with_heading_and_speed_is_satisfied_where_nothing_is_violated(
    distance: float, angle: float, theta: float, v: float, omega: float
) -> None:
    goal = Goal(1.0, 2.0, tolerance=0.5, theta=2.8, heading_tolerance=1.5, speed_tolerance=0.2)
    state = State(goal.x + distance * math.cos(angle), goal.y + distance * math.sin(angle), theta, v, omega)
    region = make_goal(SPACE_INFORMATION, SPACE, goal)
    assert isinstance(region, PoseGoal)
    scoped = ompl_state(SPACE, *state)
    assert region.isSatisfied(scoped()) == (not goal.violations(state))


@pytest.mark.parametrize("planner", ["cb-rrt", "rrt", "kpiece1"])
def test_heading_and_speed_at_the_goal_are_obeyed(planner: str) -> None:
    goal = Goal(7.0, 5.0, tolerance=1.0, theta=math.pi / 2, heading_tolerance=0.6, speed_tolerance=0.5)
    scenario = Scenario(name="arrive", world=World(BOUNDS), start=State(3.0, 5.0), goal=goal)
    setup = make_setup(scenario, planner)
    solve(setup, 50_000)
    assert setup.haveExactSolutionPath()
    path = setup.getSolutionPath()
    end = State(*reals(setup.getStateSpace(), path.getState(path.getStateCount() - 1)).tolist())
    assert goal.violations(end) == []


# directed samplers


def allocated(scenario: Scenario, planner: str, checker: Any = None) -> tuple[Any, ExtensionSampler]:
    """A set-up, to be kept, and the directed sampler of its planner; by a validity checker if one is given."""
    setup = make_setup(scenario, planner)
    if checker is not None:
        setup.setStateValidityChecker(ob.StateValidityCheckerFn(checker))
    solve(setup, 0)
    sampler = setup.getPlanner().sampler
    assert isinstance(sampler, ExtensionSampler)
    return setup, sampler


def extend(setup: Any, sampler: ExtensionSampler, node: tuple[float, ...], x: float, y: float) -> int:
    """Number of steps of an extension of a node towards a sample."""
    space = setup.getStateSpace()
    control = setup.getControlSpace().allocControl()
    source, dest = ompl_state(space, *node), ompl_state(space, x, y)
    before = reals(space, source())
    steps = sampler.sampleTo(control, source(), dest())
    assert reals(space, source()).tolist() == before.tolist()  # a node is only read
    setup.getControlSpace().freeControl(control)
    return steps


def with_tolerance(tolerance: float) -> Scenario:
    """An empty world in which commands count as equal within a tolerance."""
    planning = PlanningSettings(equal_control_tolerance=tolerance)
    return Scenario(name="empty", world=World(BOUNDS), start=EASY.start, goal=EASY.goal, planning=planning)


NODE = (2.0, 2.0, 0.5, 0.3, 0.1)


@pytest.mark.parametrize("tolerance", [0.0, 0.1])
def test_an_equal_control_from_the_same_node_is_refused(tolerance: float) -> None:
    setup, sampler = allocated(with_tolerance(tolerance), "cb-rrt")
    assert extend(setup, sampler, NODE, 5.0, 4.0) == 40
    assert extend(setup, sampler, NODE, 5.0, 4.0) == 0
    assert (sampler.samples, sampler.refused, sampler.children) == (2, 1, 1)


@pytest.mark.parametrize(("tolerance", "steps"), [(0.0, 40), (0.1, 0)])
def test_a_nearly_equal_control_is_refused_within_the_tolerance(tolerance: float, steps: int) -> None:
    setup, sampler = allocated(with_tolerance(tolerance), "cb-rrt")
    assert extend(setup, sampler, NODE, 5.0, 4.0) == 40
    assert extend(setup, sampler, NODE, 5.0, 4.01) == steps


def test_a_negative_tolerance_refuses_nothing() -> None:
    setup, sampler = allocated(with_tolerance(-1.0), "cb-rrt")
    assert [extend(setup, sampler, NODE, 5.0, 4.0) for _ in range(3)] == [40, 40, 40]
    assert sampler.refused == 0


def test_an_equal_control_from_another_node_is_taken() -> None:
    setup, sampler = allocated(with_tolerance(0.1), "cb-rrt")
    assert extend(setup, sampler, NODE, 5.0, 4.0) == 40
    assert extend(setup, sampler, (3.0, 2.0, *NODE[2:]), 6.0, 4.0) == 40


def test_s_rrt_has_three_controls_a_node() -> None:
    setup, sampler = allocated(with_tolerance(0.1), "s-rrt")
    assert [extend(setup, sampler, NODE, 5.0, 4.0) for _ in range(4)] == [40, 40, 40, 0]


def test_an_extension_ends_at_the_first_state_in_the_goal() -> None:
    setup, sampler = allocated(with_tolerance(0.1), "cb-rrt")
    steps = extend(setup, sampler, (7.0, 7.0, math.pi / 4, 1.0, 0.0), 9.0, 9.0)
    assert steps == math.ceil((math.sqrt(2.0) - EASY.goal.tolerance) / EASY.planning.step)


@pytest.mark.parametrize(("sample", "steps"), [((2.59, 2.0), 12), ((4.0, 2.0), 40), ((1.0, 2.0), 40)])
@pytest.mark.parametrize("checker", [None, lambda _: True], ids=["compiled", "asked"])
def test_a_closed_loop_ends_where_it_passes_its_reference(
    checker: Any, sample: tuple[float, float], steps: int
) -> None:
    """It went on at full speed, and in a small room into the next wall."""
    scenario = replace(EASY, planning=PlanningSettings(closed_loop=True))
    setup, sampler = allocated(scenario, "cb-rrt", checker)
    assert extend(setup, sampler, (2.0, 2.0, 0.0, 1.0, 0.0), *sample) == steps


@pytest.mark.parametrize(("cut", "steps"), [("discard", 0), ("keep", 35)])
def test_a_cut_extension_is_discarded_or_kept_up_to_the_obstacle(cut: str, steps: int) -> None:
    scenario = replace(EASY, planning=PlanningSettings(cut_extension=cut))
    setup, sampler = allocated(scenario, "cb-rrt")
    assert extend(setup, sampler, (3.01, 3.0, 0.0, 1.0, 0.0), 4.7, 3.0) == steps


# one planner's parts


@pytest.mark.parametrize("planner", OTHER_PLANNERS)
def test_no_other_planner_calls_a_directed_sampler_of_ours(planner: str, sampler_calls: Counter[type]) -> None:
    solve(make_setup(EASY, planner), 300)
    assert sampler_calls == {}


@pytest.mark.parametrize("planner", PAPER_PLANNERS)
def test_a_planner_of_the_paper_calls_its_own_sampler_once_a_round(planner: str, sampler_calls: Counter[type]) -> None:
    unreachable = replace(EASY, goal=Goal(8.0, 8.0, tolerance=1e-9))
    solve(make_setup(unreachable, planner), 300)
    expected = {"cb-rrt": KanayamaDirectedControlSampler, "s-rrt": SteeringDirectedControlSampler}
    assert sampler_calls == {expected[planner]: 300}


@pytest.mark.parametrize("planner", OTHER_PLANNERS)
def test_equipping_another_planner_takes_the_directed_sampler_away(planner: str, sampler_calls: Counter[type]) -> None:
    """As in OMPL's Benchmark: all planners share one space information."""
    setup = make_setup(replace(EASY, goal=Goal(8.0, 8.0, tolerance=1e-9)), "cb-rrt")
    solve(setup, 10)
    assert sampler_calls.pop(KanayamaDirectedControlSampler) == 10
    si, by_velocities = setup.getSpaceInformation(), replace(EASY, planning=PlanningSettings(closed_loop=False))
    equip(si, by_velocities, planner)
    setup.setPlanner(make_planner(si, by_velocities, planner))
    solve(setup, 100)
    assert sampler_calls == {}


# exceptions, memory


@pytest.mark.parametrize(
    ("owner", "method", "planner"),
    [
        (ExtensionSampler, "sampleTo", "cb-rrt"),
        (ExtensionSampler, "sampleTo", "s-rrt"),
        (FclStateValidityChecker, "isValid", "rrt"),
        (FclStateValidityChecker, "isValid", "syclop-est"),
        (TwoWheelPropagator, "propagate", "sst"),
        (PoseGoal, "distanceGoal", "cb-rrt"),
    ],
)
def test_an_exception_in_a_callback_reaches_the_caller(
    owner: type, method: str, planner: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any) -> None:
        raise LookupError("on purpose")

    scenario = replace(EASY, goal=replace(EASY.goal, speed_tolerance=0.5))
    monkeypatch.setattr(owner, method, fail)
    with pytest.raises(LookupError, match="on purpose"):
        plan(scenario, planner, seed=1)
    monkeypatch.undo()
    assert plan(EASY, planner, seed=1).solved


def resident_memory() -> int:
    """Resident memory of this process [bytes]."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="reads the resident memory from /proc")
@pytest.mark.parametrize("planner", ["cb-rrt", "s-rrt", "rrt"])
def test_plans_leave_no_memory_behind(planner: str) -> None:
    """A sampler that held its space information made a cycle that Python could not see."""
    scenario = replace(EASY, planning=PlanningSettings(max_samples=300), goal=Goal(8.0, 8.0, tolerance=1e-9))
    for seed in range(10):
        plan(scenario, planner, seed=seed)
    before = resident_memory()
    for seed in range(30):
        plan(scenario, planner, seed=seed)
    assert resident_memory() - before < 1_000_000


def test_the_random_numbers_of_python_are_left_alone() -> None:
    random.seed(5)
    expected = random.random()
    random.seed(5)
    plan(EASY, "cb-rrt", seed=1)
    assert random.random() == expected
