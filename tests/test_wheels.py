"""Wheels that limit a robot: no step, plan or planner exceeds them, and the verification finds what does."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kernels import record_of
from numpy.typing import NDArray
from strategies import LIMITS, SHARES, WHEELED

from cbrrt_ompl import ROBOTS, plan, verify
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import RobotError, ScenarioError
from cbrrt_ompl.motion.control_laws import tracking_command
from cbrrt_ompl.motion.kinematics import dynamic_step, has_wheel_limits, joint_ramp, ramp, saturate
from cbrrt_ompl.motion.model import CLOSED_LOOP, OPEN_LOOP, STEERING, advance, make_model
from cbrrt_ompl.motion.records import record_array
from cbrrt_ompl.planners.roll_out import BLOCK, STEPS, integrate_block, state_at
from cbrrt_ompl.problem.obstacles import Bounds, Box
from cbrrt_ompl.problem.robot import Gains, Limits, Robot, decelerations
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.verification.velocities import acceleration_limits, allowed_rates

DT = 0.05
velocities = st.tuples(st.floats(-6.0, 6.0), st.floats(-6.0, 6.0))

SLOW_WHEELS = Limits(0.0, 0.5, -2.0, 2.0, 0.8, 3.0, wheel_separation=0.4, wheel_speed=0.5, wheel_acceleration=0.7)
"""Full speed leaves nothing to turn with, and v and omega cannot both change as fast as each of them can."""


def rim(v: float, omega: float, limits: Limits) -> float:
    """Speed of the faster wheel [m/s]."""
    return max(abs(v - 0.5 * limits.wheel_separation * omega), abs(v + 0.5 * limits.wheel_separation * omega))


def inside(limits: Limits, v_share: float, omega_share: float) -> tuple[float, float]:
    """Velocities that the robot can have."""
    v = min(limits.v_min + v_share * (limits.v_max - limits.v_min), limits.v_max)  # which rounding may exceed
    omega = min(limits.omega_min + omega_share * (limits.omega_max - limits.omega_min), limits.omega_max)
    return saturate(v, omega, limits)


def hall(limits: Limits = SLOW_WHEELS, **changes: object) -> Scenario:
    """A wall with a wide passage."""
    parts: dict = {
        "name": "hall",
        "world": World(Bounds((0.0, 0.0), (6.0, 6.0)), [Box((0.0, 2.9), (3.5, 3.1))]),
        "robot": Robot(limits=limits, gains=Gains(1.5, 4.0, 1.0)),
        "start": State(1.0, 1.0),
        "goal": Goal(1.0, 5.0, tolerance=0.4),
        "planning": PlanningSettings(horizon=1.5, step=DT, goal_bias=0.1, max_samples=10**7),
    }
    return Scenario(**(parts | changes))


@pytest.mark.parametrize(
    ("limits", "field"),
    [
        (Limits(wheel_speed=1.0), "robot.limits.wheel_separation"),
        (Limits(wheel_acceleration=1.0), "robot.limits.wheel_separation"),
        (Limits(wheel_separation=-0.1), "robot.limits.wheel_separation"),
        (Limits(wheel_separation=math.inf), "robot.limits.wheel_separation"),
        (Limits(wheel_separation=0.3, wheel_speed=0.0), "robot.limits.wheel_speed"),
        (Limits(wheel_separation=0.3, wheel_acceleration=-1.0), "robot.limits.wheel_acceleration"),
        (Limits(wheel_separation=0.3, wheel_speed=math.nan), "robot.limits.wheel_speed"),
        (Limits(wheel_separation=0.3, wheel_speed=-math.inf), "robot.limits.wheel_speed"),
    ],
)
def test_a_wrong_wheel_is_named(limits: Limits, field: str) -> None:
    with pytest.raises(RobotError) as caught:
        Robot(limits=limits)
    assert [problem.field for problem in caught.value.problems] == [field]


def test_a_separation_alone_limits_nothing() -> None:
    limits = Robot(limits=Limits(wheel_separation=0.3)).limits
    assert not limits.has_wheel_limits
    assert not has_wheel_limits(limits)
    for limited in (limits._replace(wheel_speed=1.0), limits._replace(wheel_acceleration=1.0)):
        assert limited.has_wheel_limits
        assert has_wheel_limits(limited)


class TestSaturation:
    @given(WHEELED, velocities)
    def test_no_wheel_is_asked_for_more_than_it_can(self, limits: Limits, command: tuple[float, float]) -> None:
        assert rim(*saturate(*command, limits), limits) <= limits.wheel_speed * (1.0 + 1e-14)

    @given(WHEELED, velocities)
    def test_it_leaves_the_arc_as_it_is(self, limits: Limits, command: tuple[float, float]) -> None:
        v, omega = saturate(*command, limits)
        assert v * command[1] == pytest.approx(omega * command[0], rel=1e-14)
        assert v * command[0] >= 0.0 and omega * command[1] >= 0.0

    @given(WHEELED, velocities)
    def test_a_second_time_changes_nothing(self, limits: Limits, command: tuple[float, float]) -> None:
        once = saturate(*command, limits)
        assert saturate(*once, limits) == once

    @given(WHEELED, velocities)
    def test_what_the_wheels_can_do_is_left_alone_and_what_not_is_done_as_fast_as_they_can(
        self, limits: Limits, command: tuple[float, float]
    ) -> None:
        wanted, found = rim(*command, limits), saturate(*command, limits)
        if wanted < limits.wheel_speed * (1.0 - 1e-14):
            assert found == command
        else:
            assert rim(*found, limits) == pytest.approx(limits.wheel_speed, rel=1e-14)

    @given(WHEELED, st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
    def test_commands_of_the_tracking_law_are_saturated(self, limits: Limits, x: float, y: float) -> None:
        v, omega = tracking_command(0.0, 0.0, 0.3, (x, y, math.atan2(y, x)), limits, Gains(1.5, 10.0, 3.0))
        assert rim(v, omega, limits) <= limits.wheel_speed * (1.0 + 1e-14)
        assert limits.v_min <= v <= limits.v_max and limits.omega_min <= omega <= limits.omega_max


def rates_between(before: tuple[float, float], after: tuple[float, float], limits: Limits) -> NDArray[np.float64]:
    """Rates at which v and omega may change, by the rule that verify has for itself, shape (2,)."""
    both = acceleration_limits(limits)
    return np.array([allowed_rates(a, b, *rates) for a, b, rates in zip(before, after, both, strict=True)])


class TestJointRamp:
    @given(WHEELED, SHARES, SHARES, SHARES, SHARES)
    def test_it_keeps_all_limits_and_reaches_the_command(
        self, limits: Limits, a: float, b: float, c: float, d: float
    ) -> None:
        velocity, command = inside(limits, a, b), inside(limits, c, d)
        most = 12.0 / min(*limits[4:6], *limits[8:], 1.0) / DT
        for _ in range(int(3.0 * most * max(1.0, limits.wheel_separation))):
            if velocity == command:
                break
            before, velocity = velocity, joint_ramp(*velocity, *command, limits, DT)
            dv, domega = velocity[0] - before[0], velocity[1] - before[1]
            slack = 2e-11 * DT + 1e-14
            rates = (
                allowed_rates(*pair, *both)
                for *pair, both in zip(before, velocity, acceleration_limits(limits), strict=True)
            )
            assert (np.abs([dv, domega]) <= np.array(list(rates)) * DT + slack).all()
            assert rim(dv, domega, limits) <= limits.wheel_acceleration * DT + slack
            assert limits.v_min <= velocity[0] <= limits.v_max
            assert limits.omega_min <= velocity[1] <= limits.omega_max
            assert rim(*velocity, limits) <= limits.wheel_speed * (1.0 + 1e-14)
        assert velocity == command

    @given(WHEELED, velocities, velocities)
    def test_both_velocities_change_by_the_same_share(
        self, limits: Limits, velocity: tuple[float, float], command: tuple[float, float]
    ) -> None:
        v, omega = joint_ramp(*velocity, *command, limits, DT)
        done = (v - velocity[0]) * (command[1] - velocity[1])
        assert done == pytest.approx((omega - velocity[1]) * (command[0] - velocity[0]), rel=1e-9, abs=1e-12)

    @given(WHEELED, velocities, velocities)
    def test_one_of_the_limits_is_used_up_until_the_command_is_reached(
        self, limits: Limits, velocity: tuple[float, float], command: tuple[float, float]
    ) -> None:
        found = joint_ramp(*velocity, *command, limits, DT)
        dv, domega = abs(found[0] - velocity[0]), abs(found[1] - velocity[1])
        rates = [
            allowed_rates(a, b, *both)
            for a, b, both in zip(velocity, command, acceleration_limits(limits), strict=True)
        ]
        used = (dv / rates[0], domega / rates[1])
        most = max(*used, (dv + 0.5 * limits.wheel_separation * domega) / limits.wheel_acceleration)
        assert found == command or most == pytest.approx(DT, rel=1e-9)

    @given(LIMITS, velocities, velocities)
    def test_a_step_of_a_robot_without_wheel_limits_ramps_as_in_the_paper(
        self, limits: Limits, velocity: tuple[float, float], command: tuple[float, float]
    ) -> None:
        free = limits._replace(wheel_speed=math.inf, wheel_acceleration=math.inf)
        state = dynamic_step(0.0, 0.0, 0.0, *velocity, command, free, DT)
        assert state[3] == ramp(velocity[0], command[0], free.acceleration * DT, decelerations(free)[0] * DT)
        assert state[4] == ramp(velocity[1], command[1], free.angular_acceleration * DT, decelerations(free)[1] * DT)


@pytest.mark.parametrize("law", [OPEN_LOOP, STEERING])
@given(limits=LIMITS, start=st.tuples(SHARES, SHARES), command=velocities, theta=st.floats(-3.0, 3.0))
@settings(max_examples=60)
def test_a_block_is_its_single_steps_bit_for_bit(
    law: int, limits: Limits, start: tuple[float, float], command: tuple[float, float], theta: float
) -> None:
    model = record_of(make_model(law, Robot(limits=limits), Goal(90.0, 90.0), PlanningSettings(step=DT)))
    steps = record_of(record_array(1, STEPS))
    state = (0.0, 0.0, theta, *inside(limits, *start))
    steps.x[0], steps.y[0], steps.theta[0], steps.v[0], steps.omega[0] = state
    integrate_block(steps, *command, BLOCK, model)
    for i in range(BLOCK):
        *state, v_command, omega_command = advance(*state, (*command, 0.0), model, model.dt)
        assert state_at(steps, i + 1) == tuple(state)
        assert (v_command, omega_command) == saturate(*command, limits)


def wheel_speeds(trajectory: Trajectory, limits: Limits) -> NDArray[np.float64]:
    """Speeds of both wheels, shape (2, n) [m/s]."""
    turn = 0.5 * limits.wheel_separation * trajectory.omega
    return np.array([trajectory.v - turn, trajectory.v + turn])


@pytest.mark.parametrize(
    ("planner", "closed_loop"),
    [
        ("cb-rrt-compiled", False),
        ("cb-rrt-compiled", True),
        ("cb-rrt-robust", False),
        ("s-rrt-compiled", False),
        ("cb-rrt", False),
        ("cb-rrt", True),
        ("s-rrt", False),
        ("rrt", False),
    ],
)
def test_plans_of_a_robot_with_wheel_limits_keep_them(planner: str, closed_loop: bool) -> None:
    scenario = hall()
    scenario = replace(scenario, planning=replace(scenario.planning, closed_loop=closed_loop))
    result = plan(scenario, planner, seed=1, time_limit=20.0)
    assert result.solved
    assert result.trajectory is not None
    assert verify(result.trajectory, scenario, tolerance=1e-6).violations == ()
    speeds = wheel_speeds(result.trajectory, SLOW_WHEELS)
    assert np.abs(speeds).max() == pytest.approx(0.5, rel=1e-9)
    if not result.trajectory.kinematic:
        assert np.abs(np.diff(speeds)).max() == pytest.approx(0.7 * DT, rel=1e-9)


@pytest.fixture(scope="module")
def honest() -> Trajectory:
    result = plan(hall(), "cb-rrt-compiled", seed=3, time_limit=20.0)
    assert result.trajectory is not None
    return result.trajectory


def kinds(trajectory: Trajectory, limits: Limits) -> set[str]:
    return {violation.kind for violation in verify(trajectory, hall(limits)).violations}


class TestVerification:
    def test_a_wheel_that_is_too_fast_is_found_in_velocities_and_commands(self, honest: Trajectory) -> None:
        slower = SLOW_WHEELS._replace(wheel_speed=0.45)
        found = [v.message for v in verify(honest, hall(slower)).violations if v.kind == "wheel speed"]
        assert len(found) == 4
        assert [" by command" in message for message in found] == [False, False, True, True]
        assert all("limit 0.45 m/s" in message for message in found)

    def test_a_wheel_that_speeds_up_too_fast_is_found(self, honest: Trajectory) -> None:
        found = kinds(honest, SLOW_WHEELS._replace(wheel_acceleration=0.6))
        assert {"wheel acceleration", "motion"} <= found

    def test_ramps_that_are_independent_of_each_other_are_no_motion_of_such_a_robot(self) -> None:
        limits = SLOW_WHEELS._replace(wheel_acceleration=math.inf)
        free = limits._replace(wheel_speed=math.inf)
        state, rows = (1.0, 1.0, 0.0, 0.0, 0.0), []
        for i in range(12):
            rows.append([i * DT, *state, 0.4, 0.5])
            state = dynamic_step(*state, (0.4, 0.5), free, DT)
        trajectory = Trajectory(*np.array(rows).T)
        goal = Goal(float(trajectory.x[-1]), float(trajectory.y[-1]), tolerance=0.1)
        assert verify(trajectory, hall(free, goal=goal), tolerance=1e-6).ok
        found = verify(trajectory, hall(limits, goal=goal), tolerance=1e-6).violations
        assert {violation.kind for violation in found} == {"motion"}

    def test_velocities_that_jump_have_wheels_that_must_not_be_too_fast(self) -> None:
        t = np.array([0.0, DT])
        zero, one = np.zeros(2), np.ones(2)
        jump = Trajectory(t, one + 0.4 * t, one, zero, 0.4 * one, zero, 0.4 * one, 2.0 * one, kinematic=True)
        assert "wheel speed" in kinds(jump, SLOW_WHEELS)
        assert "wheel acceleration" not in kinds(jump, SLOW_WHEELS)


def test_every_node_of_a_brake_safe_tree_can_brake_as_slowly_as_its_wheels_do() -> None:
    limits = SLOW_WHEELS._replace(wheel_acceleration=0.2)
    scenario = hall(limits, planning=PlanningSettings(step=DT, max_samples=1000, brake_safe=True))
    scenario = replace(scenario, goal=Goal(1.0, 5.0, tolerance=1e-9))
    states = plan(scenario, "cb-rrt-compiled", seed=1, time_limit=20.0).tree.states
    assert len(states) > 100
    collides = scenario.world.referee(scenario.robot.footprint).collides
    for state in states.tolist():
        while state[3:] != [0.0, 0.0]:
            assert not collides(*state[:3])
            state = list(dynamic_step(*state, (0.0, 0.0), limits, DT))
        assert not collides(*state[:3])


def test_a_start_that_is_too_fast_for_a_wheel_is_refused() -> None:
    assert hall(start=State(1.0, 1.0, 0.0, 0.3, 1.0)).start.omega == 1.0
    with pytest.raises(ScenarioError, match=r"robot\.limits\.wheel_speed \(here 0\.6 m/s\)"):
        hall(start=State(1.0, 1.0, 0.0, 0.4, 1.0))


@pytest.mark.parametrize("law", [OPEN_LOOP, CLOSED_LOOP, STEERING])
def test_a_model_keeps_the_limits_of_the_wheels(law: int) -> None:
    limits = ROBOTS["jackal"].limits
    model = record_of(make_model(law, ROBOTS["jackal"], Goal(1.0, 2.0), PlanningSettings()))
    assert model.limits.tolist() == limits
    assert (model.goal.x, model.goal.y) == (1.0, 2.0)
