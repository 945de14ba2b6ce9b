"""The motion model, held against its laws and a fine integration of the unicycle."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kernels import plain

from cbrrt_ompl.motion.kinematics import clamp, dynamic_step, kinematic_step, ramp, unicycle_step, wrap_angle
from cbrrt_ompl.problem.robot import Limits

Pose = tuple[float, float, float]

coordinates = st.floats(-10.0, 10.0)
headings = st.floats(-math.pi, math.pi, exclude_max=True)
speeds = st.floats(-2.0, 2.0)
rates = st.floats(-1.5, 1.5)
durations = st.floats(0.001, 0.1)
poses = st.tuples(coordinates, coordinates, headings)
motions = st.tuples(speeds, rates, speeds, rates)
LIMITS = Limits()

ACCELERATED = [(0.7, 0.6, 0.5, 0.5), (0.5, -0.6, -1.0, 2.0), (0.1, 3.0, 0.8, -2.5), (1.0, 0.0, 0.0, 3.0)]
"""v, its acceleration, omega and its acceleration in the middle of a step."""


def turn_between(a: float, b: float) -> float:
    """Size of the turn between two headings [rad]."""
    return abs(math.remainder(b - a, math.tau))


def integrate(pose: Pose, motion: tuple[float, float, float, float], duration: float, steps: int = 400) -> Pose:
    """Simpson's rule over the heading in closed form, which for velocities that are linear in time is Runge-Kutta 4."""
    x, y, theta = pose
    v0, omega0, v1, omega1 = motion
    t = np.linspace(0.0, duration, 2 * steps + 1)
    v = v0 + (v1 - v0) * t / duration
    heading = theta + omega0 * t + 0.5 * (omega1 - omega0) * t * t / duration
    weights = np.full(len(t), 2.0)
    weights[1::2] = 4.0
    weights[[0, -1]] = 1.0
    weights *= duration / steps / 6.0
    return x + float(weights @ (v * np.cos(heading))), y + float(weights @ (v * np.sin(heading))), float(heading[-1])


def position_error(a: Pose, b: Pose) -> float:
    return math.hypot(b[0] - a[0], b[1] - a[1])


class TestWrapAngle:
    def test_yaw_wraps_at_pi(self) -> None:
        assert wrap_angle(math.pi) == -math.pi
        assert wrap_angle(-math.pi) == -math.pi
        assert wrap_angle(math.nextafter(math.pi, 0.0)) == math.nextafter(math.pi, 0.0)

    @given(st.floats(allow_nan=False, allow_infinity=False))
    def test_every_finite_angle_ends_in_the_half_open_interval(self, angle: float) -> None:
        assert -math.pi <= wrap_angle(angle) < math.pi

    @pytest.mark.parametrize("turns", [-3, -2, -1, 1, 2, 3])
    @pytest.mark.parametrize("towards", [-math.inf, math.inf])
    def test_angles_beside_odd_multiples_of_pi_stay_in_the_interval(self, turns: int, towards: float) -> None:
        angle = math.nextafter((2 * turns + 1) * math.pi, towards)
        assert -math.pi <= wrap_angle(angle) < math.pi
        assert math.pi - abs(wrap_angle(angle)) < 1e-14

    @given(st.floats(-1e6, 1e6))
    def test_the_direction_stays(self, angle: float) -> None:
        assert turn_between(angle, wrap_angle(angle)) < 1e-9

    @given(headings)
    def test_angles_in_the_interval_come_back_bit_for_bit(self, angle: float) -> None:
        assert wrap_angle(angle) == angle

    @pytest.mark.parametrize("angle", [5e-324, -5e-324, 1e-300, -1e-17])
    def test_tiny_angles_are_not_lost(self, angle: float) -> None:
        assert wrap_angle(angle) == angle


class TestRamp:
    @given(speeds, speeds, st.floats(1e-6, 3.0))
    def test_no_step_changes_more_than_allowed(self, current: float, command: float, most: float) -> None:
        assert abs(ramp(current, command, most, most) - current) <= most + 1e-15

    @given(speeds, speeds, st.floats(1e-6, 3.0))
    def test_every_step_goes_towards_the_command_and_not_past_it(
        self, current: float, command: float, most: float
    ) -> None:
        after = ramp(current, command, most, most)
        assert min(current, command) <= after <= max(current, command)
        assert after != current or current == command

    @given(speeds, speeds, st.floats(0.01, 3.0))
    def test_the_command_is_reached_exactly_and_in_time(self, current: float, command: float, most: float) -> None:
        value = current
        for _ in range(math.ceil(abs(command - current) / most + 1e-9)):
            value = ramp(value, command, most, most)
        assert value == pytest.approx(command, abs=1e-13)
        assert ramp(value, command, most, most) == command
        assert ramp(command, command, most, most) == command

    @given(speeds, speeds, st.floats(0.0, 3.0))
    def test_braking_mirrors_accelerating(self, current: float, command: float, most: float) -> None:
        assert ramp(-current, -command, most, most) == -ramp(current, command, most, most)

    def test_equations_3_and_4_by_hand(self) -> None:
        assert ramp(0.5, 0.52, 0.03, 0.03) == 0.52
        assert ramp(0.5, 1.0, 0.03, 0.03) == 0.53
        assert ramp(0.5, -1.0, 0.03, 0.03) == 0.47


@given(st.floats(-5.0, 5.0), st.floats(-5.0, 0.0), st.floats(0.0, 5.0))
def test_clamp_is_the_nearest_number_of_the_range(value: float, low: float, high: float) -> None:
    assert clamp(value, low, high) == sorted([low, value, high])[1]


class TestUnicycleStep:
    @given(poses, motions, durations)
    def test_a_step_agrees_with_a_fine_integration(
        self, pose: Pose, motion: tuple[float, float, float, float], duration: float
    ) -> None:
        v0, omega0, v1, omega1 = motion
        end, fine = unicycle_step(*pose, *motion, duration), integrate(pose, motion, duration)
        turn = duration * max(abs(omega0), abs(omega1))
        assert position_error(end, fine) <= 0.01 * duration * max(abs(v0), abs(v1)) * turn**2 + 1e-13
        assert turn_between(end[2], fine[2]) < 1e-12
        assert -math.pi <= end[2] < math.pi

    @pytest.mark.parametrize(("v", "acceleration", "omega", "angular_acceleration"), ACCELERATED)
    def test_halving_the_time_divides_the_error_by_32(
        self, v: float, acceleration: float, omega: float, angular_acceleration: float
    ) -> None:
        errors = []
        for duration in (0.2, 0.1, 0.05):
            dv, domega = 0.5 * duration * acceleration, 0.5 * duration * angular_acceleration
            motion = (v - dv, omega - domega, v + dv, omega + domega)
            pose = (0.3, -0.2, 0.7)
            errors.append(position_error(unicycle_step(*pose, *motion, duration), integrate(pose, motion, duration)))
        assert errors[2] > 1e-12  # not yet rounding
        assert errors[0] / errors[1] == pytest.approx(32.0, rel=0.05)
        assert errors[1] / errors[2] == pytest.approx(32.0, rel=0.05)

    @given(poses, speeds, st.floats(0.01, 1.0), st.sampled_from([-1.0, 1.0]), durations)
    def test_constant_velocities_give_an_exact_arc(
        self, pose: Pose, v: float, rate: float, side: float, duration: float
    ) -> None:
        x, y, theta = pose
        omega = side * rate
        radius, end = v / omega, theta + omega * duration
        exact = (
            x + radius * (math.sin(end) - math.sin(theta)),
            y - radius * (math.cos(end) - math.cos(theta)),
            end,
        )
        found = unicycle_step(*pose, v, omega, v, omega, duration)
        assert position_error(found, exact) < 1e-12
        assert turn_between(found[2], exact[2]) < 1e-14

    @given(poses, speeds, speeds, durations)
    def test_without_turning_the_way_is_straight_at_the_mean_speed(
        self, pose: Pose, v: float, v_next: float, duration: float
    ) -> None:
        x, y, theta = pose
        way = 0.5 * (v + v_next) * duration
        found = unicycle_step(*pose, v, 0.0, v_next, 0.0, duration)
        assert found[2] == theta
        assert found[0] == pytest.approx(x + way * math.cos(theta), abs=1e-14)
        assert found[1] == pytest.approx(y + way * math.sin(theta), abs=1e-14)

    @given(poses, rates, rates, durations)
    def test_a_turn_on_the_spot_leaves_the_position_bit_for_bit(
        self, pose: Pose, omega: float, omega_next: float, duration: float
    ) -> None:
        x, y, theta = pose
        found = unicycle_step(*pose, 0.0, omega, 0.0, omega_next, duration)
        assert found[:2] == (x, y)
        assert turn_between(found[2], theta + 0.5 * (omega + omega_next) * duration) < 1e-14

    @given(poses, motions, durations)
    def test_two_half_steps_are_one_step(
        self, pose: Pose, motion: tuple[float, float, float, float], duration: float
    ) -> None:
        v0, omega0, v1, omega1 = motion
        v, omega = 0.5 * (v0 + v1), 0.5 * (omega0 + omega1)
        middle = unicycle_step(*pose, v0, omega0, v, omega, 0.5 * duration)
        composed = unicycle_step(*middle, v, omega, v1, omega1, 0.5 * duration)
        whole = unicycle_step(*pose, *motion, duration)
        turn = duration * max(abs(omega0), abs(omega1))
        assert position_error(composed, whole) <= 0.01 * duration * max(abs(v0), abs(v1)) * turn**2 + 1e-13
        assert turn_between(composed[2], whole[2]) < 1e-13

    @given(poses, motions, durations)
    def test_time_can_be_turned_back(
        self, pose: Pose, motion: tuple[float, float, float, float], duration: float
    ) -> None:
        """Driving the same velocities backwards leads to where the step began: the expansion is about the middle."""
        v0, omega0, v1, omega1 = motion
        end = unicycle_step(*pose, *motion, duration)
        back = unicycle_step(*end, -v1, -omega1, -v0, -omega0, duration)
        assert position_error(back, pose) < 1e-13
        assert turn_between(back[2], pose[2]) < 1e-13

    @given(poses, motions, durations, coordinates, coordinates, headings)
    def test_the_frame_of_the_plane_makes_no_difference(
        self,
        pose: Pose,
        motion: tuple[float, float, float, float],
        duration: float,
        x_shift: float,
        y_shift: float,
        angle: float,
    ) -> None:
        c, s = math.cos(angle), math.sin(angle)

        def moved(p: Pose) -> Pose:
            return c * p[0] - s * p[1] + x_shift, s * p[0] + c * p[1] + y_shift, p[2] + angle

        then_moved = moved(unicycle_step(*pose, *motion, duration))
        moved_then = unicycle_step(*moved(pose), *motion, duration)
        assert position_error(then_moved, moved_then) < 1e-13
        assert turn_between(then_moved[2], moved_then[2]) < 1e-13

    @given(poses, motions, durations)
    def test_left_mirrors_right(self, pose: Pose, motion: tuple[float, float, float, float], duration: float) -> None:
        x, y, theta = pose
        v0, omega0, v1, omega1 = motion
        end = unicycle_step(*pose, *motion, duration)
        mirrored = unicycle_step(x, -y, -theta, v0, -omega0, v1, -omega1, duration)
        assert position_error((end[0], -end[1], 0.0), mirrored) < 1e-14
        assert turn_between(-end[2], mirrored[2]) < 1e-14

    @given(poses, motions, durations)
    def test_no_step_is_longer_than_its_largest_speed_allows(
        self, pose: Pose, motion: tuple[float, float, float, float], duration: float
    ) -> None:
        """But for the error of the step itself: the check between the steps relies on it."""
        v0, omega0, v1, omega1 = motion
        bound = duration * max(abs(v0), abs(v1))
        turn = duration * max(abs(omega0), abs(omega1))
        length = position_error(unicycle_step(*pose, *motion, duration), pose)
        assert length <= bound * (1.0 + 0.01 * turn**2) + 1e-14


class TestWholeSteps:
    @given(poses, st.floats(0.0, 1.0), st.floats(-0.5, 0.5), st.floats(0.0, 1.0), st.floats(-0.5, 0.5), durations)
    def test_a_dynamic_step_ramps_both_velocities_and_drives_the_mean(
        self, pose: Pose, v: float, omega: float, v_command: float, omega_command: float, dt: float
    ) -> None:
        state = dynamic_step(*pose, v, omega, (v_command, omega_command), LIMITS, dt)
        assert state[3] == ramp(v, v_command, LIMITS.acceleration * dt, LIMITS.acceleration * dt)
        assert state[4] == ramp(omega, omega_command, *2 * (LIMITS.angular_acceleration * dt,))
        assert state[:3] == unicycle_step(*pose, v, omega, state[3], state[4], dt)

    @given(poses, speeds, rates, durations)
    def test_a_kinematic_step_drives_its_command_from_the_first_moment(
        self, pose: Pose, v: float, omega: float, dt: float
    ) -> None:
        state = kinematic_step(*pose, (v, omega), dt)
        assert state[3:] == (v, omega)
        assert state[:3] == unicycle_step(*pose, v, omega, v, omega, dt)

    def test_full_speed_from_rest_takes_the_time_and_the_way_of_the_acceleration(self) -> None:
        state = (0.0, 0.0, 0.0, 0.0, 0.0)
        for _ in range(40):
            state = dynamic_step(*state, (1.0, 0.0), LIMITS, 0.05)
        ramp_time = 1.0 / 0.6
        assert state[3] == 1.0
        assert state[0] == pytest.approx(0.5 * ramp_time + (2.0 - ramp_time), abs=1e-3)  # the last step of it is cut
        assert state[1:3] == (0.0, 0.0)


@given(poses, motions, durations)
def test_compiled_and_plain_kernels_agree(
    pose: Pose, motion: tuple[float, float, float, float], duration: float
) -> None:
    v0, omega0, v1, omega1 = motion
    close = {"rel": 1e-15, "abs": 1e-15}
    assert wrap_angle(4.0 * pose[0]) == plain(wrap_angle)(4.0 * pose[0])
    assert clamp(v0, -1.0, 1.0) == plain(clamp)(v0, -1.0, 1.0)
    assert ramp(v0, v1, 0.1, 0.1) == plain(ramp)(v0, v1, 0.1, 0.1)
    assert unicycle_step(*pose, *motion, duration) == pytest.approx(
        plain(unicycle_step)(*pose, *motion, duration), **close
    )
    assert dynamic_step(*pose, v0, omega0, (v1, omega1), LIMITS, duration) == pytest.approx(
        plain(dynamic_step)(*pose, v0, omega0, (v1, omega1), LIMITS, duration), **close
    )
    assert kinematic_step(*pose, (v1, omega1), duration) == pytest.approx(
        plain(kinematic_step)(*pose, (v1, omega1), duration), **close
    )
