"""What all kernels know of robot, goal and settings, and where the goal begins."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kernels import LAWS, coordinates, model_of, plain, record_of

from cbrrt_ompl.errors import SettingsError
from cbrrt_ompl.motion.kinematics import unicycle_step
from cbrrt_ompl.motion.model import (
    CLOSED_LOOP,
    GOAL_REGION,
    OPEN_LOOP,
    ROOM,
    STEERING,
    check_step,
    in_goal,
    make_model,
    motion_room,
)
from cbrrt_ompl.motion.records import record_array
from cbrrt_ompl.planners.registry import law_of
from cbrrt_ompl.problem.robot import Gains, Limits, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State


class TestModel:
    @pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
    def test_it_holds_robot_goal_and_settings(self, law: int) -> None:
        limits = Limits(-0.1, 1.1, -0.2, 1.2, 0.3, 1.3, 0.4, 1.4, 0.5)
        robot = Robot(limits=limits, gains=Gains(1.0, 2.0, 3.0))
        goal = Goal(1.5, 2.5, 0.4, theta=0.7, heading_tolerance=0.2, speed_tolerance=0.1)
        planning = PlanningSettings(
            horizon=1.2, step=0.04, cut_extension="keep", equal_control_tolerance=0.07, look_ahead=1.7
        )
        model = record_of(make_model(law, robot, goal, planning))
        assert (model.law, model.dt, model.steps, model.look_ahead) == (law, 0.04, 30, 1.7)
        assert (model.equal_control_tolerance, model.keep_cut) == (0.07, True)
        assert (model.limits.tolist(), model.gains.tolist()) == (limits, robot.gains)
        assert model.goal.tolist() == (1.5, 2.5, 0.4, 0.7, 0.2, 0.1)

    def test_what_the_goal_leaves_free_has_an_infinite_tolerance(self) -> None:
        model = record_of(model_of(goal=Goal(1.0, 2.0)))
        assert (model.goal.heading_tolerance, model.goal.speed_tolerance) == (math.inf, math.inf)
        assert not model.keep_cut
        assert model.look_ahead == 2.0

    @pytest.mark.parametrize("clearance", [0.0, 1e-4, ROOM, 0.05, 1.0])
    def test_motions_keep_the_clearance_and_half_a_millimetre_at_least(self, clearance: float) -> None:
        room = model_of(clearance=clearance)["room"][0]
        assert room == motion_room(clearance)
        assert max(clearance, ROOM) <= room <= max(clearance, ROOM) + 1e-5

    @pytest.mark.parametrize(
        ("planner", "closed_loop", "law"),
        [
            ("cb-rrt", False, OPEN_LOOP),
            ("cb-rrt", True, CLOSED_LOOP),
            ("cb-rrt-compiled", True, CLOSED_LOOP),
            ("s-rrt", False, STEERING),
            ("s-rrt-compiled", True, STEERING),
            ("kpiece1", True, OPEN_LOOP),
        ],
    )
    def test_every_planner_has_its_law(self, planner: str, closed_loop: bool, law: int) -> None:
        assert law_of(planner, PlanningSettings(closed_loop=closed_loop)) == law

    def test_a_step_in_which_the_robot_could_turn_too_far_is_refused(self) -> None:
        robot = Robot(limits=Limits(omega_min=-4.0, omega_max=1.0))
        check_step(robot, PlanningSettings(step=0.125))
        with pytest.raises(SettingsError, match=r"planning\.step: got 0\.13, expected at most 0\.125 s") as error:
            check_step(robot, PlanningSettings(step=0.13))
        assert [problem.field for problem in error.value.problems] == ["planning.step"]

    def test_a_step_that_is_accepted_has_an_error_below_a_hundred_thousandth_of_its_length(self) -> None:
        """From full right to full left in one step: the worst that a robot of such an acceleration can do."""
        omega, dt = 0.8, 0.05
        limits = Limits(omega_min=-omega, omega_max=omega, angular_acceleration=2.0 * omega / dt)
        with pytest.raises(SettingsError, match=r"planning\.step: got 0\.06, expected at most 0\.05 s"):
            check_step(Robot(limits=limits), PlanningSettings(step=0.06, horizon=0.6))
        check_step(Robot(limits=limits), PlanningSettings(step=dt))
        x, y, _ = unicycle_step(0.0, 0.0, 0.0, 1.0, -omega, 1.0, omega, dt)
        t = (np.arange(10_000) + 0.5) / 10_000 * dt
        heading = -omega * t + omega * t * t / dt
        assert math.hypot(x - dt * np.cos(heading).mean(), y - dt * np.sin(heading).mean()) < 1e-5 * dt


class TestGoalRegion:
    goals = st.builds(
        Goal,
        coordinates,
        coordinates,
        st.floats(0.1, 1.0),
        st.none() | st.floats(-10.0, 10.0),
        st.floats(0.01, 4.0),
        st.none() | st.floats(0.01, 1.0),
    )

    @given(goals, st.data())
    def test_it_is_that_of_the_goal_with_its_border(self, goal: Goal, data: st.DataObject) -> None:
        direction = data.draw(st.floats(0.0, 6.0))
        distance = goal.tolerance * data.draw(st.floats(0.0, 0.999999) | st.floats(1.000001, 2.0))
        turns = st.sampled_from([-1.0, 0.0, 1.0]).map(lambda k: k * goal.heading_tolerance) | st.floats(-20.0, 20.0)
        most = goal.speed_tolerance or 0.3
        speeds = st.sampled_from([-most, most, math.nextafter(most, 2.0)]) | st.floats(-0.5, 0.5)
        state = State(
            goal.x + distance * math.cos(direction),
            goal.y + distance * math.sin(direction),
            (goal.theta or 0.0) + data.draw(turns),
            data.draw(speeds),
            data.draw(speeds),
        )
        region = record_of(model_of(goal=goal)).goal
        assert in_goal(region, *state) == (not goal.violations(state))
        assert plain(in_goal)(region, *state) == in_goal(region, *state)

    @pytest.mark.parametrize("direction", [(1.0, 0.0), (0.0, -1.0)])
    def test_the_rim_of_the_disc_is_outside(self, direction: tuple[float, float]) -> None:
        regions = record_array(1, GOAL_REGION)
        regions[0] = (0.0, 0.0, 0.5, 0.0, math.inf, math.inf)
        region = record_of(regions)
        for radius, is_inside in ((0.5, False), (math.nextafter(0.5, 0.0), True)):
            assert in_goal(region, radius * direction[0], radius * direction[1], 3.0, 1.0, 1.0) == is_inside

    def test_the_rim_is_the_same_to_the_last_bit(self) -> None:
        rng = np.random.default_rng(0)
        for x, y in rng.uniform(-1.0, 1.0, (2000, 2)).tolist():
            for radius in (math.hypot(x, y), math.sqrt(x * x + y * y)):
                goal = Goal(0.0, 0.0, radius)
                assert in_goal(record_of(model_of(goal=goal)).goal, x, y, 0.0, 0.0, 0.0) == (
                    not goal.violations(State(x, y))
                )
