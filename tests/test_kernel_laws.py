"""Laws of single kernels that other tests see only in what is built on them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import SHARES, WHEELED

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.motion.kinematics import (
    axis_limits,
    dynamic_step,
    joint_ramp,
    joint_ramp_time,
    saturate,
    sine_cosine,
    stopping_time,
    unicycle_step,
)
from cbrrt_ompl.motion.manoeuvres import BRAKE, FORWARD, REVERSE, approach_command, has_ended, is_manoeuvre, most_steps
from cbrrt_ompl.motion.model import OPEN_LOOP, make_model
from cbrrt_ompl.planners.search import Search
from cbrrt_ompl.problem.obstacles import Bounds, Box
from cbrrt_ompl.problem.robot import Footprint, Limits, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State

DT = 0.05
EITHER = Limits(-0.6, 1.0, -2.0, 3.0, 0.9, 2.5, wheel_separation=0.4, wheel_speed=0.5, wheel_acceleration=0.7)
"""The wheels are what limits driving straight on and, to the left alone, turning on the spot."""


class TestSineAndCosine:
    @given(st.floats(-20.0, 20.0))
    def test_they_are_those_of_the_library_to_rounding(self, angle: float) -> None:
        assert sine_cosine(angle) == pytest.approx((math.sin(angle), math.cos(angle)), rel=0.0, abs=2.3e-16)

    @pytest.mark.parametrize("quarters", range(-9, 10))
    def test_every_quarter_turn_has_its_signs(self, quarters: int) -> None:
        s, c = sine_cosine(0.5 * math.pi * quarters)
        assert (round(s), round(c)) == ((0, 1, 0, -1)[quarters % 4], (1, 0, -1, 0)[quarters % 4])


class TestAxisLimits:
    def test_by_hand(self) -> None:
        found = axis_limits(EITHER)
        assert found == pytest.approx((-0.5, 0.5, -2.0, 2.5, 0.7, 2.5, 0.4, 0.5, 0.7, 0.7, 2.5), rel=1e-14)
        assert axis_limits(EITHER._replace(angular_acceleration=9.0)).angular_acceleration == pytest.approx(3.5)

    def test_a_robot_without_wheel_limits_has_its_own(self) -> None:
        limits = Limits(-0.3, 1.0, -0.4, 0.6, 0.9, 2.5, wheel_separation=0.4)
        assert axis_limits(limits) == limits

    @given(WHEELED)
    def test_the_wheels_can_drive_straight_on_and_turn_on_the_spot_as_fast(self, limits: Limits) -> None:
        pure = axis_limits(limits)
        for command in [(pure.v_min, 0.0), (pure.v_max, 0.0), (0.0, pure.omega_min), (0.0, pure.omega_max)]:
            assert saturate(*command, limits) == command

    @given(WHEELED)
    def test_nothing_faster_would_do(self, limits: Limits) -> None:
        pure, arm = axis_limits(limits), 0.5 * limits.wheel_separation
        assert pure.v_max == min(limits.v_max, limits.wheel_speed)
        assert pure.v_min == max(limits.v_min, -limits.wheel_speed)
        assert pure.omega_max == pytest.approx(min(limits.omega_max, limits.wheel_speed / arm), rel=1e-14)
        assert pure.omega_min == pytest.approx(max(limits.omega_min, -limits.wheel_speed / arm), rel=1e-14)

    @given(WHEELED)
    def test_a_pure_ramp_takes_a_second_to_its_acceleration(self, limits: Limits) -> None:
        pure = axis_limits(limits)
        assert joint_ramp_time(0.0, 0.0, pure.acceleration, 0.0, limits) == pytest.approx(1.0, rel=1e-14)
        assert joint_ramp_time(0.0, 0.0, 0.0, -pure.angular_acceleration, limits) == pytest.approx(1.0, rel=1e-14)


class TestStoppingTime:
    @given(WHEELED, SHARES, SHARES)
    def test_a_robot_with_wheel_limits_brakes_for_so_long(self, limits: Limits, v_share: float, turn: float) -> None:
        v = limits.v_min + v_share * (limits.v_max - limits.v_min)
        omega = limits.omega_min + turn * (limits.omega_max - limits.omega_min)
        expected = stopping_time(v, omega, limits)
        dt = expected / 7.5 if expected > 0.0 else DT
        velocity = v, omega
        for _ in range(7 if expected > 0.0 else 0):
            velocity = joint_ramp(*velocity, 0.0, 0.0, limits, dt)
            assert velocity != (0.0, 0.0)
        assert joint_ramp(*velocity, 0.0, 0.0, limits, dt) == (0.0, 0.0)

    def test_without_wheel_limits_turning_does_not_count(self) -> None:
        limits = Limits(-2.0, 2.0, -3.0, 3.0, 0.5, 0.1, wheel_separation=0.4)
        assert stopping_time(-1.5, 3.0, limits) == 3.0
        assert stopping_time(0.0, 3.0, limits) == 0.0


class TestJointSteps:
    @pytest.mark.parametrize(
        ("command", "time"),
        [((0.3, 0.0), 0.3 / 0.7), ((-0.3, 0.5), 0.4 / 0.7), ((0.0, -1.5), 0.6), ((0.05, -1.0), 0.4)],
    )
    def test_ramp_times_by_hand(self, command: tuple[float, float], time: float) -> None:
        assert joint_ramp_time(0.0, 0.0, *command, EITHER) == pytest.approx(time, rel=1e-14)

    @given(WHEELED, SHARES, SHARES, st.floats(-2.0, 2.0), st.floats(-3.0, 3.0))
    def test_a_dynamic_step_of_a_robot_with_wheel_limits_ramps_both_velocities_jointly(
        self, limits: Limits, v_share: float, turn: float, v_command: float, omega_command: float
    ) -> None:
        v, omega = 2.0 * v_share - 1.0, 2.0 * turn - 1.0
        state = dynamic_step(0.3, -0.2, 0.7, v, omega, (v_command, omega_command), limits, DT)
        assert state[3:] == joint_ramp(v, omega, v_command, omega_command, limits, DT)
        assert state[:3] == unicycle_step(0.3, -0.2, 0.7, v, omega, *state[3:], DT)

    def test_a_command_within_rounding_of_the_reach_is_reached(self) -> None:
        """Else a rest of 1e-17 would take a step of its own."""
        just = np.nextafter(EITHER.wheel_acceleration * DT, 1.0)
        assert joint_ramp(0.0, 0.0, float(just), 0.0, EITHER, DT) == (just, 0.0)
        beyond = EITHER.wheel_acceleration * DT * (1.0 + 1e-10)
        assert joint_ramp(0.0, 0.0, beyond, 0.0, EITHER, DT)[0] < beyond


class TestManoeuvres:
    @pytest.mark.parametrize("manoeuvre", [FORWARD, REVERSE, BRAKE])
    def test_no_heading_is_taken_for_a_manoeuvre_nor_one_for_another(self, manoeuvre: float) -> None:
        assert is_manoeuvre((0.0, 0.0, manoeuvre))
        assert not any(is_manoeuvre((1.0, 1.0, theta)) for theta in (-math.pi, 0.0, math.pi, 2.0 * math.pi))
        assert [FORWARD, REVERSE, BRAKE].count(manoeuvre) == 1

    @pytest.mark.parametrize(
        "limits",
        [
            Limits(-2.0, 2.0, -3.0, 3.0, 0.05, 9.0),
            Limits(-0.1, 0.1, -2.0, 2.0, 9.0, 0.05),
            Limits(-1.0, 1.0, -0.02, 3.0, 9.0, 9.0),
            Limits(-1.0, 0.01, -3.0, 3.0, 9.0, 9.0),
            Limits(-0.01, 1.0, -3.0, 3.0, 9.0, 9.0),
        ],
        ids=["slow to brake", "slow to end a turn", "slow to the right", "slow ahead", "slow backwards"],
    )
    @pytest.mark.parametrize("manoeuvre", [FORWARD, REVERSE, BRAKE])
    def test_even_slow_robots_have_steps_enough(self, limits: Limits, manoeuvre: float) -> None:
        dt, aim = 0.1, (4.0, -0.5, -2.0)
        state = (0.0, 0.0, 0.0, limits.v_max, limits.omega_max)
        for _ in range(most_steps(manoeuvre, math.hypot(*aim[:2]), limits, dt)):
            x, y, theta, v, omega = state
            if manoeuvre == BRAKE:
                state = dynamic_step(*state, (0.0, 0.0), limits, dt)
            else:
                after = approach_command(state, aim, True, manoeuvre == REVERSE, False, limits, dt)
                state = (*unicycle_step(x, y, theta, v, omega, *after, dt), *after)
            if has_ended(manoeuvre, state, aim, True):
                break
        assert has_ended(manoeuvre, state, aim, True)


class TestBraking:
    @pytest.mark.parametrize("cut", ["discard", "keep"])
    def test_every_node_of_a_small_tree_can_brake(self, cut: str) -> None:
        """From full speed, 0.83 m from a wall, this robot could not."""
        world = World(Bounds((-2.0, -2.0), (2.0, 2.0)), [Box((0.8, -2.0), (1.0, 1.5))])
        planning = PlanningSettings(brake_safe=True, cut_extension=cut)
        model = make_model(OPEN_LOOP, Robot(), Goal(1.7, -1.7, tolerance=0.1), planning)
        search = Search(model, world, Footprint.point(), [State(0.0, 0.0)], seed=1)
        search.run(lambda _: False, 120)
        states = search.edges()[0]
        assert len(states) > 20
        for state in states.tolist():
            while state[3] != 0.0 or state[4] != 0.0:
                assert not world.collides(Footprint.point(), state[:3])
                state = dynamic_step(*state, (0.0, 0.0), Limits(), DT)
