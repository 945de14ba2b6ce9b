"""Compiled control laws: the reference, the Kanayama law of CB-RRT and the steering rates of S-RRT."""

from __future__ import annotations

import math

from cbrrt_ompl.kernels import kernel
from cbrrt_ompl.motion.kinematics import clamp, saturate, wrap_angle
from cbrrt_ompl.motion.laws import law_command
from cbrrt_ompl.problem.robot import Gains, Limits


@kernel
def reference_pose(
    x: float, y: float, theta: float, x_sample: float, y_sample: float, look_ahead: float
) -> tuple[float, float, float]:
    """Reference for an extension: the point on the way to a sample, and the direction of that way.

    Args:
        x: position of the node [m].
        y: position of the node [m].
        theta: heading of the node, taken where node and sample coincide [rad].
        x_sample: position of the sample [m].
        y_sample: position of the sample [m].
        look_ahead: largest distance of the reference from the node [m].

    Returns:
        (x_r, y_r, theta_r), [m, m, rad].

    Note:
        The paper says only that the reference comes from the sample; this is our reading.
    """
    dx, dy = x_sample - x, y_sample - y
    distance = math.sqrt(dx * dx + dy * dy)
    if distance == 0.0:
        return x, y, theta
    share = min(1.0, look_ahead / distance)
    return x + share * dx, y + share * dy, wrap_angle(math.atan2(dy, dx))


@kernel
def error_posture(
    x: float, y: float, theta: float, reference: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Pose of the reference in the robot's frame: Eq. (1) of the paper.

    Args:
        x: position of the robot [m].
        y: position of the robot [m].
        theta: heading of the robot [rad].
        reference: (x_r, y_r, theta_r), [m, m, rad].

    Returns:
        (x_e, y_e, theta_e), theta_e in [-pi, pi), [m, m, rad].
    """
    dx, dy = reference[0] - x, reference[1] - y
    c, s = math.cos(theta), math.sin(theta)
    return c * dx + s * dy, c * dy - s * dx, wrap_angle(reference[2] - theta)


@kernel
def is_past(x: float, y: float, reference: tuple[float, float, float]) -> bool:
    """Whether a position [m] lies beside the reference (x_r, y_r, theta_r) or beyond it, as seen along its heading."""
    return math.cos(reference[2]) * (x - reference[0]) + math.sin(reference[2]) * (y - reference[1]) >= 0.0


@kernel
def kanayama_command(
    error: tuple[float, float, float], v_reference: float, omega_reference: float, gains: Gains
) -> tuple[float, float]:
    """Velocities that drive the robot onto its reference: Eq. (2) of the paper.

    Args:
        error: pose of the reference in the robot's frame, [m, m, rad].
        v_reference: forward velocity of the reference [m/s].
        omega_reference: turning rate of the reference [rad/s].
        gains: controller gains.

    Returns:
        Command (v, omega) before saturation, [m/s, rad/s].
    """
    x_error, y_error, theta_error = error
    v = v_reference * math.cos(theta_error) + gains.k_x * x_error
    omega = omega_reference + v_reference * (gains.k_y * y_error + gains.k_theta * math.sin(theta_error))
    return v, omega


@kernel
def tracking_command(
    x: float,
    y: float,
    theta: float,
    reference: tuple[float, float, float],
    limits: Limits,
    gains: Gains,
    law_address: int = 0,
) -> tuple[float, float]:
    """Command of CB-RRT: the Kanayama law for a reference at full speed, or another law, clamped to the limits.

    The velocities are clamped to their ranges, each on its own; then both are scaled to what the wheels can do. A
    reference behind a robot that must not reverse gives v = 0: a point turn.

    Args:
        x: position of the robot [m].
        y: position of the robot [m].
        theta: heading of the robot [rad].
        reference: (x_r, y_r, theta_r), [m, m, rad].
        limits: limits of the robot.
        gains: controller gains.
        law_address: of another law, see :mod:`cbrrt_ompl.motion.laws`; 0 for the Kanayama law.

    Returns:
        Command (v, omega) within the limits of the velocities and the wheels, [m/s, rad/s].
    """
    error = error_posture(x, y, theta, reference)
    if law_address == 0:
        v, omega = kanayama_command(error, limits.v_max, 0.0, gains)
    else:
        v, omega = law_command(law_address, error, limits, gains)
    v, omega = clamp(v, limits.v_min, limits.v_max), clamp(omega, limits.omega_min, limits.omega_max)
    return saturate(v, omega, limits)


@kernel
def steering_rate(choice: int, limits: Limits) -> float:
    """Turning rate of S-RRT for a choice of 0, 1 or 2: full right, straight on or full left [rad/s]."""
    if choice == 0:
        return limits.omega_min
    return 0.0 if choice == 1 else limits.omega_max
