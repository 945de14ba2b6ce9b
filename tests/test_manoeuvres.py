"""Laws of the manoeuvres: final approaches end exactly on the goal, and a brake-safe tree can always brake."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from cbrrt_ompl import load_scenario, make_setup, plan, verify
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.motion.kinematics import dynamic_step, saturate
from cbrrt_ompl.motion.manoeuvres import BRAKE, FORWARD, REVERSE, has_ended, most_steps, next_velocity
from cbrrt_ompl.motion.model import OPEN_LOOP, STEERING, make_model
from cbrrt_ompl.ompl_plugin.availability import has_ompl
from cbrrt_ompl.problem.obstacles import Bounds, Box
from cbrrt_ompl.problem.robot import Footprint, Limits, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.trajectory.replay import trajectory_from_controls
from cbrrt_ompl.trajectory.trajectory import Trajectory

if has_ompl():
    from cbrrt_ompl.ompl_plugin.binding import ob

DT = 0.05
OURS = ["cb-rrt", "s-rrt", "cb-rrt-compiled", "s-rrt-compiled", "cb-rrt-robust"]
OPEN = World(Bounds((-20.0, -20.0), (20.0, 20.0)))
PARKED = Goal(2.0, 1.0, tolerance=0.01, theta=-2.0, heading_tolerance=0.01, speed_tolerance=0.01)

coordinates = st.floats(-9.0, 9.0)
headings = st.floats(-math.pi, math.pi, exclude_max=True)
wheels = st.sampled_from([(), (0.4, 0.5), (0.3, math.inf, 0.6), (0.6, 0.8, 1.0)])
robots = st.builds(
    lambda wheel_limits, *limits: Robot(limits=Limits(*limits, *wheel_limits)),
    wheels,
    st.sampled_from([0.0, -0.5]),
    st.floats(0.05, 3.0),
    st.sampled_from([0.0, -0.7, -2.0]),
    st.floats(0.1, 3.0),
    st.floats(0.1, 5.0),
    st.floats(0.1, 5.0),
)


def drive(start: State, manoeuvre: float, robot: Robot, goal: Goal, law: int = OPEN_LOOP) -> Trajectory:
    """The way of a manoeuvre, to its own end and not a step further; an error if it does not end in time."""
    model = make_model(law, robot, goal, PlanningSettings(step=DT))
    control = np.array([[0.0, 0.0, manoeuvre]])
    steps = most_steps(manoeuvre, math.hypot(goal.x - start.x, goal.y - start.y), robot.limits, DT)
    states = trajectory_from_controls(np.array(start), control, np.array([steps]), model).states
    aim, has_heading = (goal.x, goal.y, goal.theta or 0.0), goal.theta is not None
    end = next(k for k, state in enumerate(states) if has_ended(manoeuvre, tuple(state), aim, has_heading))
    return trajectory_from_controls(np.array(start), control, np.array([end]), model)


def heading_error(a: float, b: float) -> float:
    return abs(math.remainder(a - b, math.tau))


class TestNextVelocity:
    @given(st.floats(-10.0, 10.0), st.floats(0.0, 1.0), st.floats(0.05, 3.0), st.floats(0.05, 5.0))
    @example(way=0.0, share=0.0, high=1.0, most=1.0)
    @example(way=0.15, share=0.0, high=3.0, most=1.0)  # the speed at which the last step is a full one
    def test_it_comes_to_rest_exactly_at_the_end_of_the_way(
        self, way: float, share: float, high: float, most: float
    ) -> None:
        velocity, at, steps = (2.0 * share - 1.0) * high, 0.0, 0
        while velocity != 0.0 or abs(way - at) > 1e-9 or steps == 0:
            after = next_velocity(way - at, velocity, -high, high, most * DT, most * DT, DT)
            assert abs(after) <= high
            assert abs(after - velocity) <= most * DT * (1.0 + 1e-12)
            at += 0.5 * (velocity + after) * DT
            velocity, steps = after, steps + 1
            assert steps < 100_000
        assert abs(way - at) < 1e-9

    @given(st.floats(0.0, 10.0), st.floats(0.05, 3.0), st.floats(0.05, 5.0))
    def test_it_takes_at_most_two_steps_more_than_the_trapezoid(self, way: float, high: float, most: float) -> None:
        peak = min(high, math.sqrt(most * way))
        quickest = way / peak + peak / most if peak > 0.0 else 0.0
        velocity, at, steps = 0.0, 0.0, 0
        while steps * DT <= quickest + 2.0 * DT:
            after = next_velocity(way - at, velocity, 0.0, high, most * DT, most * DT, DT)
            at, velocity, steps = at + 0.5 * (velocity + after) * DT, after, steps + 1
        assert velocity == 0.0
        assert at == pytest.approx(way, abs=1e-9)


class TestFinalApproach:
    @given(robots, coordinates, coordinates, headings, st.floats(0, 1), st.floats(0, 1), st.one_of(st.none(), headings))
    @example(Robot(), 3.0, 0.0, -math.pi, 0.0, 0.5, 0.0)  # dead ahead from behind, at rest
    @example(Robot(), 0.0, 0.0, 1.0, 0.0, 0.5, 1.0)  # there already
    def test_it_ends_at_rest_on_the_goal_within_all_limits(
        self, robot: Robot, x: float, y: float, theta: float, v: float, omega: float, goal_theta: float | None
    ) -> None:
        low, high = (
            np.array([robot.limits.v_min, robot.limits.omega_min]),
            np.array([robot.limits.v_max, robot.limits.omega_max]),
        )
        velocity = low + np.array([v, omega]) * (high - low)
        start = State(x, y, theta, *saturate(*velocity.tolist(), robot.limits))
        goal = replace(PARKED, x=0.0, y=0.0, theta=goal_theta)
        for manoeuvre in (FORWARD, REVERSE) if robot.limits.v_min < 0.0 else (FORWARD,):
            way = drive(start, manoeuvre, robot, goal)
            assert way.x[-1] == pytest.approx(0.0, abs=1e-6)
            assert way.y[-1] == pytest.approx(0.0, abs=1e-6)
            assert (way.v[-1], way.omega[-1]) == (0.0, 0.0)
            if goal_theta is not None:
                assert heading_error(way.theta[-1], goal_theta) < 1e-6
            scenario = Scenario(name="approach", world=OPEN, robot=robot, start=start, goal=goal)
            assert verify(way, scenario, tolerance=1e-6).violations == ()

    @given(coordinates, coordinates, headings, headings)
    def test_velocities_that_jump_arrive_as_well(self, x: float, y: float, theta: float, goal_theta: float) -> None:
        goal, start = replace(PARKED, theta=goal_theta), State(x, y, theta)
        way = drive(start, FORWARD, Robot(), goal, STEERING)
        assert way.kinematic
        assert goal.violations(State(*way.states[-1].tolist())) == []
        assert verify(way, Scenario(name="approach", world=OPEN, start=start, goal=goal), tolerance=1e-6).ok

    def test_it_brakes_turns_drives_and_turns(self) -> None:
        way = drive(State(-1.0, 0.0, 0.0, 1.0, 0.0), FORWARD, Robot(), PARKED)
        is_turning, is_driving = np.abs(way.omega) > 0.0, np.abs(way.v) > 0.0
        assert not (is_turning & is_driving).any()
        phases = np.where(is_driving, "drive", np.where(is_turning, "turn", "rest"))
        order = [phase for i, phase in enumerate(phases) if phase != "rest" and (i == 0 or phase != phases[i - 1])]
        assert order == ["drive", "turn", "drive", "turn"]

    def test_backwards_it_drives_backwards_alone(self) -> None:
        robot = Robot(limits=Limits(v_min=-0.4))
        way = drive(State(3.0, 1.0, 0.0), REVERSE, robot, replace(PARKED, theta=0.0))
        assert way.v.min() == pytest.approx(-0.4)
        assert way.v.max() == 0.0
        assert way.length == pytest.approx(1.0, abs=1e-6)
        assert way.point_turns == []

    def test_a_robot_that_turns_to_one_side_takes_the_long_way_round(self) -> None:
        robot = Robot(limits=Limits(omega_min=0.0))
        way = drive(State(2.0, 1.0, 0.5), FORWARD, robot, replace(PARKED, theta=0.0))
        assert way.omega.min() == 0.0
        assert [turn.angle for turn in way.point_turns] == pytest.approx([2.0 * math.pi - 0.5])


class TestPlans:
    @pytest.mark.parametrize("planner", OURS)
    @pytest.mark.parametrize("closed_loop", [False, True], ids=["open loop", "closed loop"])
    def test_every_planner_of_ours_parks_exactly(self, planner: str, closed_loop: bool) -> None:
        world = World(Bounds((-5.0, -5.0), (5.0, 5.0)), [Box((-1.0, -5.0), (-0.8, 0.0))])
        robot = Robot(Footprint.polygon([(-0.2, -0.15), (0.3, -0.15), (0.3, 0.15), (-0.2, 0.15)]))
        planning = PlanningSettings(closed_loop=closed_loop)
        scenario = Scenario(
            name="park", world=world, robot=robot, start=State(-3.0, -3.0, 1.5), goal=PARKED, planning=planning
        )
        result = plan(scenario, planner, seed=1, time_limit=30.0)
        assert result.status == "solved"
        assert result.trajectory is not None
        assert verify(result.trajectory, scenario).violations == ()
        end = result.trajectory.states[-1]
        assert np.hypot(*(end[:2] - (PARKED.x, PARKED.y))) < 1e-6
        assert heading_error(end[2], -2.0) < 1e-6
        assert end[3:].tolist() == [0.0, 0.0]
        assert np.abs(result.tree.states - end).max(axis=1).min() < 1e-9

    @pytest.mark.needs_ompl
    @pytest.mark.parametrize("planner", ["cb-rrt", "cb-rrt-compiled"])
    def test_the_last_edge_is_one_control_that_ompl_replays(self, planner: str) -> None:
        scenario = Scenario(name="park", world=OPEN, start=State(-3.0, -3.0), goal=PARKED)
        setup = make_setup(scenario, planner)
        assert setup.solve(30.0)
        path, si = setup.getSolutionPath(), setup.getSpaceInformation()
        assert path.check()
        last = path.getControlCount() - 1
        assert path.getControl(last)[2] in {FORWARD, REVERSE}
        result = ob.State(setup.getStateSpace())
        steps = round(path.getControlDuration(last) / scenario.planning.step)
        si.propagate(path.getState(last), path.getControl(last), steps, result())
        assert setup.getGoal().isSatisfied(result())

    @pytest.mark.parametrize("planner", ["cb-rrt", "cb-rrt-compiled"])
    def test_no_approach_passes_through_a_wall(self, planner: str) -> None:
        world = World(Bounds((-5.0, -5.0), (5.0, 5.0)), [Box((0.0, -5.0), (0.001, 5.0))])
        planning = PlanningSettings(max_samples=300)
        scenario = Scenario(name="wall", world=world, start=State(-3.0, 0.0), goal=PARKED, planning=planning)
        result = plan(scenario, planner, seed=1, time_limit=30.0)
        assert result.status == "sample limit"
        assert result.tree.states[:, 0].max() < 0.0

    def test_without_it_such_a_goal_is_a_matter_of_chance(self) -> None:
        planning = PlanningSettings(max_samples=300, final_approach=False)
        scenario = Scenario(name="park", world=OPEN, start=State(-3.0, -3.0), goal=PARKED, planning=planning)
        assert plan(scenario, "cb-rrt-compiled", seed=1, time_limit=30.0).status == "sample limit"

    @pytest.mark.needs_ompl
    def test_goals_in_position_alone_are_planned_as_in_the_paper(self, scenarios: Path) -> None:
        scenario = load_scenario(scenarios / "paper_case1.yaml")
        without = replace(scenario, planning=replace(scenario.planning, final_approach=False))
        for planner in OURS:
            found, expected = plan(scenario, planner, seed=3), plan(without, planner, seed=3)
            assert found.trajectory == expected.trajectory is not None


def stopping_states(state: np.ndarray, limits: Limits) -> list[tuple[float, ...]]:
    """States while the robot brakes to rest from a state."""
    states = [tuple(state.tolist())]
    while states[-1][3:] != (0.0, 0.0):
        states.append(dynamic_step(*states[-1], (0.0, 0.0), limits, DT))
    return states


def cannot_brake(trajectory: Trajectory, scenario: Scenario) -> list[int]:
    """Rows from which braking to rest ends in an obstacle."""
    collides = scenario.world.referee(scenario.robot.footprint).collides
    limits = scenario.robot.limits
    return [
        k
        for k, state in enumerate(trajectory.states)
        if any(collides(*there[:3]) for there in stopping_states(state, limits))
    ]


class TestBrakeSafe:
    @pytest.mark.parametrize("cut", ["discard", "keep"])
    @pytest.mark.parametrize("planner", ["cb-rrt", "cb-rrt-compiled", "cb-rrt-robust"])
    def test_every_state_of_a_plan_can_brake(self, scenarios: Path, planner: str, cut: str) -> None:
        scenario = load_scenario(scenarios / "paper_case1.yaml")
        robot = replace(scenario.robot, footprint=Footprint.polygon([(-0.05, -0.03), (0.08, -0.03), (0.0, 0.05)]))
        planning = replace(scenario.planning, cut_extension=cut)
        scenario = replace(scenario, robot=robot, planning=planning)
        safe = replace(scenario, planning=replace(planning, brake_safe=True))
        for seed in range(3):
            result = plan(safe, planner, seed=seed, time_limit=30.0)
            assert result.status == "solved"
            assert result.trajectory is not None
            assert cannot_brake(result.trajectory, safe) == []

    def test_unless_asked_for_some_cannot(self, scenarios: Path) -> None:
        scenario = load_scenario(scenarios / "paper_case1.yaml")
        found = [plan(scenario, "cb-rrt-compiled", seed=seed).trajectory for seed in range(20)]
        assert sum(len(cannot_brake(trajectory, scenario)) for trajectory in found if trajectory is not None) > 0

    def test_every_node_of_the_tree_can_brake(self, scenarios: Path) -> None:
        scenario = load_scenario(scenarios / "paper_case2.yaml")
        safe = replace(scenario, planning=replace(scenario.planning, brake_safe=True, max_samples=2000))
        states = plan(safe, "cb-rrt-compiled", seed=1, time_limit=30.0).tree.states
        collides = safe.world.referee(safe.robot.footprint).collides
        assert len(states) > 100
        for state in states:
            assert not any(collides(*there[:3]) for there in stopping_states(state, safe.robot.limits))

    def test_braking_lasts_no_longer_than_its_bound(self) -> None:
        limits = Limits(v_min=-1.0, v_max=2.0)
        way = drive(State(0.0, 0.0, 0.0, 2.0, -0.5), BRAKE, Robot(limits=limits), PARKED)
        assert way.states[-1, 3:].tolist() == [0.0, 0.0]
        assert way.duration == pytest.approx(2.0 / 0.6, abs=DT)
