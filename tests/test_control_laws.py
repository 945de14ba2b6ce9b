"""The reference, the Kanayama law and the steering rates, held against the paper's equations and their laws."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from kernels import plain

from cbrrt_ompl.motion.control_laws import (
    error_posture,
    kanayama_command,
    reference_pose,
    steering_rate,
    tracking_command,
)
from cbrrt_ompl.motion.kinematics import dynamic_step, kinematic_step
from cbrrt_ompl.problem.robot import Gains, Limits

Pose = tuple[float, float, float]

coordinates = st.floats(-10.0, 10.0)
headings = st.floats(-math.pi, math.pi, exclude_max=True)
poses = st.tuples(coordinates, coordinates, headings)
gains = st.builds(Gains, st.floats(0.0, 5.0), st.floats(0.0, 5.0), st.floats(0.0, 5.0))
PAPER = Gains()
LIMITS = Limits()


def turn_between(a: float, b: float) -> float:
    """Size of the turn between two headings [rad]."""
    return abs(math.remainder(b - a, math.tau))


class TestReference:
    @given(poses, coordinates, coordinates, st.floats(0.01, 5.0))
    def test_it_is_on_the_way_to_the_sample_and_no_further_than_look_ahead(
        self, node: Pose, x_sample: float, y_sample: float, look_ahead: float
    ) -> None:
        x, y, _ = reference_pose(*node, x_sample, y_sample, look_ahead)
        to_reference = math.hypot(x - node[0], y - node[1])
        to_sample = math.hypot(x_sample - node[0], y_sample - node[1])
        assert to_reference == pytest.approx(min(look_ahead, to_sample), abs=1e-12)
        assert to_reference + math.hypot(x_sample - x, y_sample - y) == pytest.approx(to_sample, abs=1e-12)

    @given(poses, coordinates, coordinates, st.floats(0.01, 5.0))
    def test_its_heading_is_the_direction_of_that_way(
        self, node: Pose, x_sample: float, y_sample: float, look_ahead: float
    ) -> None:
        dx, dy = x_sample - node[0], y_sample - node[1]
        assume(math.hypot(dx, dy) > 1e-6)
        theta = reference_pose(*node, x_sample, y_sample, look_ahead)[2]
        assert -math.pi <= theta < math.pi
        assert turn_between(theta, math.atan2(dy, dx)) < 1e-12

    def test_a_sample_due_west_has_the_heading_minus_pi(self) -> None:
        assert reference_pose(1.0, 2.0, 0.0, -5.0, 2.0, 2.0) == (-1.0, 2.0, -math.pi)

    @given(poses)
    def test_a_sample_at_the_node_is_the_node(self, node: Pose) -> None:
        assert reference_pose(*node, node[0], node[1], 2.0) == node

    def test_a_near_sample_is_the_reference(self) -> None:
        assert reference_pose(0.0, 0.0, 1.0, 0.3, 0.4, 2.0)[:2] == (0.3, 0.4)


class TestErrorPosture:
    def test_equation_1_by_hand(self) -> None:
        assert error_posture(1.0, 2.0, math.pi / 2.0, (0.0, 5.0, math.pi)) == pytest.approx((3.0, 1.0, math.pi / 2.0))

    @given(poses)
    def test_a_robot_on_its_reference_has_no_error(self, pose: Pose) -> None:
        assert error_posture(*pose, pose) == (0.0, 0.0, 0.0)

    @given(poses, poses)
    def test_the_error_leads_from_the_robot_to_the_reference(self, robot: Pose, reference: Pose) -> None:
        x_error, y_error, theta_error = error_posture(*robot, reference)
        c, s = math.cos(robot[2]), math.sin(robot[2])
        assert robot[0] + c * x_error - s * y_error == pytest.approx(reference[0], abs=1e-12)
        assert robot[1] + s * x_error + c * y_error == pytest.approx(reference[1], abs=1e-12)
        assert turn_between(robot[2] + theta_error, reference[2]) < 1e-12
        assert -math.pi <= theta_error < math.pi

    @given(poses, poses, coordinates, coordinates, headings)
    def test_the_frame_of_the_plane_makes_no_difference(
        self, robot: Pose, reference: Pose, x_shift: float, y_shift: float, angle: float
    ) -> None:
        c, s = math.cos(angle), math.sin(angle)

        def moved(p: Pose) -> Pose:
            return c * p[0] - s * p[1] + x_shift, s * p[0] + c * p[1] + y_shift, p[2] + angle

        here, there = error_posture(*robot, reference), error_posture(*moved(robot), moved(reference))
        assert here[:2] == pytest.approx(there[:2], abs=1e-12)
        assert turn_between(here[2], there[2]) < 1e-12


class TestKanayamaLaw:
    @given(st.floats(0.0, 2.0), st.floats(-1.0, 1.0), gains)
    def test_zero_error_returns_the_reference_velocity(self, v: float, omega: float, g: Gains) -> None:
        assert kanayama_command((0.0, 0.0, 0.0), v, omega, g) == (v, omega)

    def test_equation_2_by_hand(self) -> None:
        error = (0.2, -0.4, math.pi / 6.0)
        v, omega = kanayama_command(error, 0.8, 0.1, PAPER)
        assert v == pytest.approx(0.8 * math.sqrt(3.0) / 2.0 + 1.5 * 0.2)
        assert omega == pytest.approx(0.1 + 0.8 * (0.5 * -0.4 + 0.1 * 0.5))

    @given(coordinates, coordinates, headings, st.floats(0.0, 2.0), gains)
    def test_a_mirrored_error_turns_the_other_way_at_the_same_speed(
        self, x: float, y: float, theta: float, v: float, g: Gains
    ) -> None:
        left, right = kanayama_command((x, y, theta), v, 0.0, g), kanayama_command((x, -y, -theta), v, 0.0, g)
        assert right == (left[0], -left[1])

    @given(
        st.floats(-1.0, 1.0),
        st.floats(-1.0, 1.0),
        st.floats(-2.0, 2.0),
        st.floats(0.2, 1.0),
        st.floats(-0.5, 0.5),
        st.builds(Gains, st.floats(0.1, 3.0), st.floats(0.2, 3.0), st.floats(0.0, 3.0)),
    )
    def test_it_descends_kanayama_s_lyapunov_function(
        self, x: float, y: float, theta: float, v: float, omega: float, g: Gains
    ) -> None:
        """V = (x_e^2 + y_e^2) / 2 + (1 - cos theta_e) / k_y falls by k_x x_e^2 + v_r k_theta sin^2 theta_e / k_y."""

        def value(error: Pose) -> float:
            return 0.5 * (error[0] ** 2 + error[1] ** 2) + (1.0 - math.cos(error[2])) / g.k_y

        robot, dt = (0.0, 0.0, 0.0), 1e-5
        command = kanayama_command((x, y, theta), v, omega, g)
        before, after = (
            value(
                error_posture(*kinematic_step(*robot, command, t)[:3], kinematic_step(x, y, theta, (v, omega), t)[:3])
            )
            for t in (-dt, dt)
        )
        slope = -g.k_x * x**2 - v * g.k_theta * math.sin(theta) ** 2 / g.k_y
        assert (after - before) / (2.0 * dt) == pytest.approx(slope, abs=1e-5)

    @pytest.mark.parametrize("start", [(0.0, 1.0, 0.0), (-1.0, -0.5, 1.5), (0.5, 0.3, -2.0)])
    def test_the_closed_loop_converges_onto_a_straight_line(self, start: Pose) -> None:
        """Under the acceleration limits, with the paper's gains, towards a reference that moves along the x axis."""
        state, dt, v = (*start, 0.0, 0.0), 0.05, 0.8
        errors = []
        for step in range(6000):
            error = error_posture(*state[:3], (v * step * dt, 0.0, 0.0))
            errors.append(math.hypot(*error))
            command = kanayama_command(error, v, 0.0, PAPER)
            clamped = (
                min(max(command[0], LIMITS.v_min), LIMITS.v_max),
                min(max(command[1], LIMITS.omega_min), LIMITS.omega_max),
            )
            state = dynamic_step(*state, clamped, LIMITS, dt)
        assert max(errors[:400]) > 0.5
        assert max(errors[-400:]) < 0.01
        assert state[3:] == pytest.approx((v, 0.0), abs=0.01)


class TestTrackingCommand:
    @given(poses, poses, gains, st.floats(-1.0, 0.0), st.floats(0.1, 2.0))
    def test_it_stays_in_the_velocity_ranges(
        self, robot: Pose, reference: Pose, g: Gains, lowest: float, highest: float
    ) -> None:
        limits = Limits(lowest, highest, 2.0 * lowest, highest, 0.6, 0.5)
        v, omega = tracking_command(*robot, reference, limits, g)
        assert limits.v_min <= v <= limits.v_max
        assert limits.omega_min <= omega <= limits.omega_max

    @given(poses, poses, gains)
    def test_it_is_the_law_at_full_speed_where_that_is_within_the_ranges(
        self, robot: Pose, reference: Pose, g: Gains
    ) -> None:
        v, omega = kanayama_command(error_posture(*robot, reference), LIMITS.v_max, 0.0, g)
        assert tracking_command(*robot, reference, LIMITS, g) == (
            float(np.clip(v, LIMITS.v_min, LIMITS.v_max)),
            float(np.clip(omega, LIMITS.omega_min, LIMITS.omega_max)),
        )

    @given(poses, st.floats(0.1, 5.0), st.floats(0.6 * math.pi, 0.98 * math.pi), st.sampled_from([-1.0, 1.0]))
    def test_a_target_behind_makes_it_stand_and_turn_to_that_side(
        self, robot: Pose, distance: float, bearing: float, side: float
    ) -> None:
        x, y, theta = robot
        direction = theta + side * bearing
        sample = x + distance * math.cos(direction), y + distance * math.sin(direction)
        v, omega = tracking_command(*robot, reference_pose(*robot, *sample, 2.0), LIMITS, PAPER)
        assert v == 0.0
        assert side * omega > 0.0

    @given(poses, st.floats(0.7, 5.0))
    def test_a_target_straight_ahead_is_driven_to_at_full_speed(self, robot: Pose, distance: float) -> None:
        x, y, theta = robot
        sample = x + distance * math.cos(theta), y + distance * math.sin(theta)
        v, omega = tracking_command(*robot, reference_pose(*robot, *sample, 2.0), LIMITS, PAPER)
        assert v == LIMITS.v_max
        assert omega == pytest.approx(0.0, abs=1e-12)

    def test_a_robot_that_may_reverse_backs_up_to_a_target_behind(self) -> None:
        limits = LIMITS._replace(v_min=-0.3)
        assert tracking_command(0.0, 0.0, 0.0, (-1.0, 0.5, math.pi - 0.4), limits, PAPER)[0] == -0.3


def test_the_steering_rates_are_full_right_straight_on_and_full_left() -> None:
    limits = LIMITS._replace(omega_min=-0.4, omega_max=0.6)
    assert [steering_rate(choice, limits) for choice in range(3)] == [-0.4, 0.0, 0.6]


@given(poses, poses, gains)
def test_compiled_and_plain_kernels_agree(robot: Pose, other: Pose, g: Gains) -> None:
    close = {"rel": 1e-14, "abs": 1e-14}
    for kernel, arguments in (
        (reference_pose, (*robot, other[0], other[1], 2.0)),
        (error_posture, (*robot, other)),
        (kanayama_command, (other, 0.8, 0.1, g)),
        (tracking_command, (*robot, other, LIMITS, g)),
        (steering_rate, (2, LIMITS)),
    ):
        assert kernel(*arguments) == pytest.approx(plain(kernel)(*arguments), **close)
