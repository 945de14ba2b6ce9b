"""A script of raw OMPL calls gives on our classes what it gives on those of OMPL, with a robot in plain Python."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cbrrt_ompl import (
    FclStateValidityChecker,
    TwoWheelPropagator,
    make_control_space,
    make_setup,
    make_state_space,
    trajectory_from_path,
    verify,
)
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import SettingsError
from cbrrt_ompl.ompl_plugin.availability import has_ompl
from cbrrt_ompl.planners.registry import PLANNERS, Backend
from cbrrt_ompl.problem.obstacles import Bounds, Box
from cbrrt_ompl.problem.robot import Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.scenario.scenario import Scenario

if has_ompl():
    from ompl_rounds import solve

    from cbrrt_ompl.ompl_plugin.binding import ob, oc, og, ou
else:
    pytest.skip("all of it needs OMPL", allow_module_level=True)

pytestmark = pytest.mark.usefixtures("quiet_ompl")

ROBOT = Robot()
WORLD = World(Bounds((-5.0, -5.0), (5.0, 5.0)), [Box((-0.5, -5.0), (0.5, 3.0))])
SCENARIO = Scenario(
    name="wall",
    world=WORLD,
    start=State(-4.0, -4.0),
    goal=Goal(4.0, -4.0),
    planning=PlanningSettings(closed_loop=False),
)
COMPILED = [name for name, planner in PLANNERS.items() if planner.backend is Backend.COMPILED]
OF_OMPL = ["RRT", "EST", "KPIECE1", "SST", "PDST"]
NODES = 0.5 - math.sqrt(0.15), 0.5, 0.5 + math.sqrt(0.15)
WEIGHTS = 5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0
"""Gauss-Legendre quadrature on [0, 1]."""


# the stranger's own classes


def bounds(*pairs: tuple[float, float]) -> Any:
    made = ob.RealVectorBounds(len(pairs))
    for i, (low, high) in enumerate(pairs):
        made.setLow(i, low)
        made.setHigh(i, high)
    return made


def values(state: Any) -> tuple[float, ...]:
    return state[0][0], state[0][1], state[1].value, state[2][0], state[2][1]


def put(state: Any, *numbers: float) -> None:
    (state[0][0], state[0][1], state[1].value), (state[2][0], state[2][1]) = numbers[:3], numbers[3:]


class PlainPropagator(oc.StatePropagator):  # type: ignore[misc]
    """Velocities ramp to the control; the pose by quadrature."""

    def propagate(self, state: Any, control: Any, duration: float, result: Any) -> None:
        x, y, theta, v, omega = values(state)
        limits = ROBOT.limits
        dv = max(-limits.acceleration * duration, min(limits.acceleration * duration, control[0] - v))
        most = limits.angular_acceleration * duration
        domega = max(-most, min(most, control[1] - omega))
        for node, weight in zip(NODES, WEIGHTS, strict=True):
            heading = theta + duration * node * (omega + 0.5 * node * domega)
            speed = v + node * dv
            x += weight * duration * speed * math.cos(heading)
            y += weight * duration * speed * math.sin(heading)
        theta += duration * (omega + 0.5 * domega)
        put(result, x, y, (theta + math.pi) % (2.0 * math.pi) - math.pi, v + dv, omega + domega)

    def canPropagateBackward(self) -> bool:
        return False


class PlainChecker(ob.StateValidityChecker):  # type: ignore[misc]
    """A point among one box."""

    def __init__(self, si: Any) -> None:
        super().__init__(si)
        self.space = si.getStateSpace()

    def isValid(self, state: Any) -> bool:
        x, y = state[0][0], state[0][1]
        return bool(self.space.satisfiesBounds(state)) and not (abs(x) <= 0.5 and y <= 3.0)

    def clearance(self, state: Any) -> float:
        x, y = state[0][0], state[0][1]
        return min(5.0 - abs(x), 5.0 - abs(y), math.hypot(max(0.0, abs(x) - 0.5), max(0.0, y - 3.0)))


class SetUp:
    """A simple set-up, of our classes or of OMPL's own, and what the stranger needs of it."""

    def __init__(self, is_ours: bool) -> None:
        limits, self.is_ours = ROBOT.limits, is_ours
        velocities = (limits.v_min, limits.v_max), (limits.omega_min, limits.omega_max)
        if is_ours:
            self.space = make_state_space(WORLD, ROBOT)
            self.controls = make_control_space(self.space, ROBOT)
        else:
            self.space = ob.CompoundStateSpace()
            self.space.addSubspace(ob.RealVectorStateSpace(2), 1.0)
            self.space.addSubspace(ob.SO2StateSpace(), 0.0)
            self.space.addSubspace(ob.RealVectorStateSpace(2), 0.0)
            self.space.getSubspace(0).setBounds(bounds((-5.0, 5.0), (-5.0, 5.0)))
            self.space.getSubspace(2).setBounds(bounds(*velocities))
            self.space.lock()
            self.space.registerDefaultProjection(ob.SubspaceProjectionEvaluator(self.space, 0))
            self.controls = oc.RealVectorControlSpace(self.space, 2)
            self.controls.setBounds(bounds(*velocities))
        self.setup = oc.SimpleSetup(self.controls)
        self.si = self.setup.getSpaceInformation()
        self.setup.setStateValidityChecker(self.checker(self.si))
        self.propagator = TwoWheelPropagator(self.si, ROBOT) if is_ours else PlainPropagator(self.si)
        self.setup.setStatePropagator(self.propagator)
        self.si.setPropagationStepSize(0.05)
        self.si.setMinMaxControlDuration(1, 40)
        self.setup.setStartAndGoalStates(self.state(-4.0, -4.0), self.state(4.0, -4.0), 0.5)

    def checker(self, si: Any) -> Any:
        return FclStateValidityChecker(si, ROBOT, WORLD) if self.is_ours else PlainChecker(si)

    def state(self, *numbers: float) -> Any:
        state = ob.State(self.space)
        put(state(), *numbers, *(5 - len(numbers)) * [0.0])
        return state

    def control(self, v: float, omega: float) -> Any:
        control = self.controls.allocControl()  # the process may keep it
        control[0], control[1] = v, omega
        return control

    def use(self, planner: str) -> None:
        self.setup.setPlanner(getattr(oc, planner)(self.si))
        if planner == "SST":
            objective = ob.PathLengthOptimizationObjective(self.si)
            objective.setCostThreshold(objective.infiniteCost())
            self.setup.setOptimizationObjective(objective)

    def solve(self, rounds: int) -> str:
        return solve(self.setup, rounds, seed=None)

    def path(self) -> list[list[float]]:
        return matrix(self.setup.getSolutionPath())


def matrix(path: Any) -> list[list[float]]:
    return [[float(word) for word in line.split()] for line in path.printAsMatrix().splitlines()]


# the script


def the_space(a: SetUp) -> Any:
    space = a.space
    a.setup.setup()
    return (
        [space.getDimension(), space.getMeasure(), space.getMaximumExtent(), space.getSubspaceCount()],
        [space.isCompound(), space.isLocked(), space.isMetricSpace(), space.hasSymmetricDistance(), space.isDiscrete()],
        [space.getLongestValidSegmentLength(), space.getSerializationLength(), space.getValidSegmentCountFactor()],
        [a.si.getStateDimension(), a.si.getSpaceMeasure(), a.si.getMaximumExtent(), a.si.isSetup()],
        [a.controls.getDimension(), a.controls.getSerializationLength(), a.controls.isCompound()],
        space.sanityChecks(),
    )


def states(a: SetUp) -> Any:
    one, other, result = a.state(1.0, 2.0, 0.5, 0.1, 0.1), a.state(-1.0, 1.0, -3.0, 0.2, -0.1), a.state()
    found = [a.space.distance(one(), other()), a.si.distance(one(), other())]
    for fraction in (0.0, 0.3, 1.0):
        a.space.interpolate(one(), other(), fraction, result())
        found += values(result())
    found += [a.space.equalStates(one(), other()), a.space.equalStates(one(), one())]
    a.space.copyState(result(), one())
    one[0] = 4.0  # by index
    clone = a.space.cloneState(result())
    return found, list(one.reals()), values(result()), values(clone), a.space.equalStates(clone, result()), str(result)


def the_bounds(a: SetUp) -> Any:
    found = []
    for numbers in ((7.0, -8.0, 9.0, 3.0, -3.0), (4.9, 4.9, -math.pi, 1.0, 0.0), (1.0, 1.0, math.pi, 0.0, 0.0)):
        state = a.state(*numbers)
        found.append([a.space.satisfiesBounds(state()), a.si.satisfiesBounds(state()), a.si.isValid(state())])
        a.si.enforceBounds(state())
        found.append([*values(state()), a.space.satisfiesBounds(state())])
    return found


def validity(a: SetUp) -> Any:
    rng = np.random.default_rng(1)
    found = []
    for numbers in rng.uniform(-1.1, 1.1, (300, 5)) * (5.0, 5.0, 3.0, 0.9, 0.5):
        state = a.state(*numbers.tolist())
        found.append(a.si.isValid(state()))
        if found[-1]:
            found.append(a.setup.getStateValidityChecker().clearance(state()))
    assert 10 < found.count(False)
    return found


def samples(a: SetUp) -> Any:
    state, near = a.state(), a.state(-1.0, 1.0, 0.3, 0.2, 0.1)
    found = []
    for sampler in (a.space.allocStateSampler(), a.si.allocValidStateSampler()):
        for _ in range(5):
            (sampler.sampleUniform if hasattr(sampler, "sampleUniform") else sampler.sample)(state())
            found.append(values(state()))
            assert a.si.satisfiesBounds(state())
            sampler.sampleUniformNear(state(), near(), 0.5) if hasattr(sampler, "sampleUniformNear") else None
            found.append(values(state()))
    sampler = a.si.allocControlSampler()
    control = a.control(0.0, 0.0)
    for _ in range(5):
        sampler.sample(control)
        found.append((control[0], control[1], sampler.sampleStepCount(1, 10)))
    return found


def propagations(a: SetUp) -> Any:
    found: list[Any] = [a.si.canPropagateBackward(), a.setup.getStatePropagator().canSteer()]
    control = a.control(0.7, 0.4)
    for start in ((-4.0, -4.0, 0.3), (-0.8, 0.0, 0.0, 0.3, 0.0), (-4.9, 0.0, 3.0, 1.0, 0.1)):
        for steps in (0, 1, 3, 60):
            state, result = a.state(*start), a.state()
            a.si.propagate(state(), control, steps, result())
            found.append(values(result()))
            count = a.si.propagateWhileValid(state(), control, steps, result())
            found.append((count, *values(result())))
            a.si.propagate(state(), control, steps, state())  # in place
            found.append(values(state()))
        rows = ob.vectorState()
        state = a.state(*start)
        found.append(a.si.propagateWhileValid(state(), control, 50, rows, True))
        found += [values(row) for row in rows]
    return found


def the_projection(a: SetUp) -> Any:
    a.setup.setup()
    projection = a.space.getDefaultProjection()
    state, point = a.state(1.5, -2.5, 1.0), np.zeros(2)
    projection.project(state(), point)
    return projection.getDimension(), list(projection.getCellSizes()), point.tolist()


def the_goal(a: SetUp) -> Any:
    goal, state = a.setup.getGoal(), a.state(3.7, -3.8, 2.0)
    found = [goal.getThreshold(), goal.isSatisfied(state()), goal.distanceGoal(state()), goal.maxSampleCount()]
    goal.sampleGoal(state())
    goal.setThreshold(1e-3)
    return found, values(state()), values(goal.getState()), goal.isSatisfied(state()), goal.hasType(ob.GOAL_STATE)


def a_problem(a: SetUp) -> Any:
    problem = a.setup.getProblemDefinition()
    before = [
        problem.hasSolution(),
        problem.hasExactSolution(),
        problem.getSolutionCount(),
        problem.getStartStateCount(),
    ]
    a.use("RRT")
    status = a.solve(1500)
    after = [problem.hasSolution(), problem.hasExactSolution(), problem.hasApproximateSolution()]
    after += [problem.getSolutionDifference(), problem.getSolutionCount(), problem.hasOptimizedSolution()]
    kept = problem.clone()
    problem.clearSolutionPaths()
    return before, status, after, problem.hasSolution(), kept.getStartStateCount()


def a_path(a: SetUp) -> Any:
    a.use("EST")
    status = a.solve(2500)
    path = a.setup.getSolutionPath()
    found = [path.length(), path.getStateCount(), path.getControlCount(), path.check(), *path.getControlDurations()]
    controls = [(path.getControl(i)[0], path.getControl(i)[1]) for i in range(path.getControlCount())]
    states = path.asGeometric()
    costs = [
        states.cost(objective(a.si)).value()
        for objective in (ob.PathLengthOptimizationObjective, ob.MaximizeMinClearanceObjective)
    ]
    geometric = [states.getStateCount(), states.length(), states.check(), states.smoothness(), states.clearance()]
    path.interpolate()
    return status, found, controls, geometric, costs, [path.getStateCount(), path.check()], matrix(path)


def the_planner_data(a: SetUp) -> Any:
    a.use("RRT")
    a.solve(300)
    data = oc.PlannerData(a.si)
    a.setup.getPlannerData(data)
    count = data.numVertices()
    assert count > 20
    found = [count, data.numEdges(), data.numStartVertices(), data.numGoalVertices(), data.hasControls()]
    vertices = [values(data.getVertex(i).getState()) for i in range(count)]
    children = ou.vectorUint()
    edges = []
    for parent in range(count):
        data.getEdges(parent, children)
        for child in children:
            edge = data.getEdge(parent, child)
            edges.append((parent, child, edge.getDuration(), edge.getControl()[0], edge.getControl()[1]))
    data.decoupleFromPlanner()
    a.setup.clear()
    return found, sorted(vertices), len(data.printGraphviz()), values(data.getVertex(count - 1).getState()), edges


def several_starts(a: SetUp) -> Any:
    a.setup.clearStartStates()
    for x in (-40.0, -3.0, 3.0):
        a.setup.addStartState(a.state(x, -4.0))
    a.use("RRT")
    return a.solve(400), values(a.setup.getSolutionPath().getState(0)), a.path()


def another_planner_after_a_solve(a: SetUp) -> Any:
    found = []
    for planner in ("RRT", "KPIECE1", "EST"):
        a.use(planner)
        found.append((a.solve(600), a.setup.getPlanner().getName()))
        found.append((a.setup.getProblemDefinition().getSolutionCount(), a.path()))
    a.setup.clear()
    return found, a.setup.haveSolutionPath(), a.solve(600)


def a_second_solve(a: SetUp) -> Any:
    a.use("RRT")
    return a.solve(100), a.solve(1500), a.setup.haveExactSolutionPath(), a.path(), a.solve(10)


def conditions(a: SetUp) -> Any:
    a.use("RRT")
    exact = ob.exactSolnPlannerTerminationCondition(a.setup.getProblemDefinition())
    found = [a.setup.solve(seconds).asString() for seconds in (0.0, -1.0)]
    a.setup.clear()
    either = ob.plannerOrTerminationCondition(exact, ob.timedPlannerTerminationCondition(60.0))
    return found, a.setup.solve(either).asString()


def other_goals(a: SetUp) -> Any:
    class Right(ob.GoalRegion):  # type: ignore[misc]
        def distanceGoal(self, state: Any) -> float:
            return max(0.0, 2.0 - float(state[0][0]))

    class Fast(ob.Goal):  # type: ignore[misc]
        def isSatisfied(self, state: Any, *_: Any) -> bool:
            return bool(state[2][0] > 0.9)

    several = ob.GoalStates(a.si)
    several.addState(a.state(-4.0, 4.0))
    several.addState(a.state(4.0, 4.0))
    several.setThreshold(0.6)
    region = Right(a.si)
    region.setThreshold(0.1)
    found = []
    for goal in (several, region, Fast(a.si)):
        a.setup.clear()
        a.setup.setGoal(goal)
        a.use("RRT")
        found.append((a.solve(1500), a.path()))
    return found


def an_objective(a: SetUp) -> Any:
    class Low(ob.OptimizationObjective):  # type: ignore[misc]
        def stateCost(self, state: Any) -> Any:
            return ob.Cost(abs(state[0][1]))

        def motionCost(self, one: Any, other: Any) -> Any:
            return ob.Cost(math.dist(values(one)[:2], values(other)[:2]) * (6.0 + other[0][1]))

    objective = Low(a.si)
    a.use("SST")
    a.setup.setOptimizationObjective(objective)
    return a.solve(300), a.setup.getSolutionPath().asGeometric().cost(objective).value(), a.path()


def an_ode(a: SetUp) -> Any:
    def rates(q: Any, u: Any, result: Any) -> None:
        result[0], result[1], result[2] = q[3] * math.cos(q[2]), q[3] * math.sin(q[2]), q[4]
        result[3], result[4] = u[0] - q[3], u[1] - q[4]

    solver = oc.ODEBasicSolver(a.si, oc.ODE(rates))
    a.setup.setStatePropagator(oc.ODESolver.getStatePropagator(solver, oc.PostPropagationEvent(lambda *_: None)))
    a.use("RRT")
    return a.solve(100), a.path()


def a_projection_of_their_own(a: SetUp) -> Any:
    class Rows(ob.ProjectionEvaluator):  # type: ignore[misc]
        def getDimension(self) -> int:
            return 1

        def defaultCellSizes(self) -> None:
            self.cellSizes_ = ou.vectorDouble()
            self.cellSizes_.append(0.5)

        def project(self, state: Any, point: Any) -> None:
            point[0] = state[0][1]

    projection = Rows(a.space)
    a.space.registerProjection("rows", projection)
    planner = oc.KPIECE1(a.si)
    planner.setProjectionEvaluator("rows")
    a.setup.setPlanner(planner)
    return a.solve(400), a.path()


def without_controls(a: SetUp) -> Any:
    setup = og.SimpleSetup(a.space)
    setup.setStateValidityChecker(a.checker(setup.getSpaceInformation()))
    setup.setStartAndGoalStates(a.state(-4.0, -4.0), a.state(4.0, -4.0), 0.05)
    setup.setPlanner(og.RRTConnect(setup.getSpaceInformation()))
    return solve(setup, 3000, seed=None), matrix(setup.getSolutionPath()), setup.getSolutionPath().check()


SCRIPT: list[Callable[[SetUp], Any]] = [
    the_space,
    states,
    the_bounds,
    validity,
    samples,
    propagations,
    the_projection,
    the_goal,
    a_problem,
    a_path,
    the_planner_data,
    several_starts,
    another_planner_after_a_solve,
    a_second_solve,
    conditions,
    other_goals,
    an_objective,
    an_ode,
    a_projection_of_their_own,
    without_controls,
]


def assert_same(found: Any, expected: Any) -> None:
    """Numbers to a millionth, everything else exactly."""
    assert type(found) is type(expected)
    if isinstance(found, (list, tuple)):
        assert len(found) == len(expected)
        for one, other in zip(found, expected, strict=True):
            assert_same(one, other)
    else:
        assert found == (pytest.approx(expected, abs=1e-6, rel=1e-5) if isinstance(expected, float) else expected)


@pytest.mark.parametrize("step", SCRIPT, ids=lambda step: step.__name__)
def test_a_script_gives_what_it_gives_on_the_classes_of_ompl(step: Callable[[SetUp], Any]) -> None:
    found = []
    for is_ours in (True, False):
        ou.RNG.setSeed(5)
        found.append(step(SetUp(is_ours)))
    assert_same(*found)


@pytest.mark.parametrize("planner", OF_OMPL)
def test_a_planner_finds_the_path_that_it_finds_on_the_classes_of_ompl(planner: str) -> None:
    found = []
    for is_ours in (True, False):
        ou.RNG.setSeed(3)
        its = SetUp(is_ours)
        its.use(planner)
        found.append((its.solve(1000), its.path()))
    assert len(found[0][1]) > 2
    assert_same(*found)


def test_states_that_ours_stores_are_read_by_the_space_of_ompl(tmp_path: Path) -> None:
    ours, theirs = SetUp(True), SetUp(False)
    stored, read = ob.StateStorage(ours.space), ob.StateStorage(theirs.space)
    for i in range(5):
        state = ours.state(0.1 * i, 0.2, 0.3, 0.4, 0.5)
        stored.addState(ours.space.cloneState(state()))
    stored.store(str(tmp_path / "states"))
    read.load(str(tmp_path / "states"))
    assert [values(read.getState(i)) for i in range(read.size())] == [(0.1 * i, 0.2, 0.3, 0.4, 0.5) for i in range(5)]


# what our planners make of such calls


@pytest.mark.parametrize("planner", COMPILED)
def test_a_solved_problem_is_solved_again_without_clear(planner: str) -> None:
    """The last state was given to the goal after it had been freed, which now and then ended the process."""
    setup = make_setup(SCENARIO, planner)
    for count in (1, 2, 3):
        assert setup.solve(0.5).asString() == "Exact solution"
        assert setup.getProblemDefinition().getSolutionCount() == count
    assert setup.getSolutionPath().check()


@pytest.mark.parametrize("planner", ["cb-rrt", "s-rrt", *COMPILED])
def test_a_planner_forgets_its_query(planner: str) -> None:
    """OMPL's clearQuery called itself without end for planners that are derived from control::RRT."""
    setup = make_setup(SCENARIO, planner)
    assert setup.solve(0.5).asString() == "Exact solution"
    setup.getPlanner().clearQuery()
    data = oc.PlannerData(setup.getSpaceInformation())
    setup.getPlannerData(data)
    assert data.numVertices() == 0
    assert setup.solve(0.5).asString() == "Exact solution"


class Corner(ob.StateSampler):  # type: ignore[misc]
    """Samples nothing but a corner."""

    def sampleUniform(self, state: Any) -> None:
        put(state, 4.9, 4.9, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("component", [None, 0])
@pytest.mark.parametrize("planner", COMPILED)
def test_a_state_sampler_of_ones_own_is_refused_by_the_compiled_planners(planner: str, component: int | None) -> None:
    """They drew samples of their own all the same."""
    setup = make_setup(SCENARIO, planner)
    space = setup.getStateSpace() if component is None else setup.getStateSpace().getSubspace(component)
    space.setStateSamplerAllocator(ob.StateSamplerAllocator(Corner))
    with pytest.raises(SettingsError, match=f"{planner}: state sampler: got 'Corner', expected OMPL's own"):
        setup.setup()


@pytest.mark.parametrize("planner", ["rrt", "cb-rrt", "s-rrt"])
def test_a_state_sampler_of_ones_own_is_obeyed_by_the_others(planner: str) -> None:
    setup = make_setup(SCENARIO, planner)
    setup.getStateSpace().setStateSamplerAllocator(ob.StateSamplerAllocator(Corner))
    setup.getPlanner().setGoalBias(0.0)
    solve(setup, 60, seed=None)
    path = setup.getSolutionPath()
    assert path.getState(path.getStateCount() - 1)[0][0] < 0.0  # towards the corner the wall is in the way


@pytest.mark.parametrize("planner", COMPILED)
def test_other_weights_are_refused_by_the_compiled_planners(planner: str) -> None:
    setup = make_setup(SCENARIO, planner)
    setup.getStateSpace().setSubspaceWeight(1, 0.5)
    with pytest.raises(SettingsError, match=rf"{planner}: weights of the state space: got \[1.0, 0.5, 0.0\]"):
        setup.setup()


@pytest.mark.parametrize("planner", ["cb-rrt", "s-rrt"])
def test_intermediate_states_may_be_nodes(planner: str) -> None:
    ou.RNG.setSeed(3)
    setup = make_setup(SCENARIO, planner)
    setup.getPlanner().setIntermediateStates(True)
    assert solve(setup, 5000, seed=None) == "Exact solution"
    path = setup.getSolutionPath()
    assert path.check() and set(path.getControlDurations()) == {SCENARIO.planning.step}
    trajectory = trajectory_from_path(path, SCENARIO)
    assert verify(trajectory, SCENARIO).ok
