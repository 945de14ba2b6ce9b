"""Compiled motion model of a two-wheeled robot: angle wrap, velocity ramp and unicycle step.

Every state of this package comes out of these kernels, be it grown by a sampler, propagated by OMPL or replayed.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.kernels import kernel
from cbrrt_ompl.problem.robot import REST, Limits
from cbrrt_ompl.problem.robot import decelerations as _decelerations
from cbrrt_ompl.problem.robot import velocity_changes as _velocity_changes


@kernel
def wrap_angle(angle: float) -> float:
    """Angle in [-pi, pi), the half-open interval of OMPL's SO(2).

    Args:
        angle: any finite angle [rad].

    Returns:
        The same direction in [-pi, pi) [rad].
    """
    if -math.pi <= angle < math.pi:
        return angle
    wrapped = angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))
    return wrapped if -math.pi <= wrapped < math.pi else -math.pi


@kernel
def clamp(value: float, low: float, high: float) -> float:
    """The number nearest to value in [low, high]."""
    return low if value < low else high if value > high else value


decelerations, velocity_changes = kernel(_decelerations), kernel(_velocity_changes)


@kernel
def ramp(current: float, command: float, faster: float, slower: float) -> float:
    """Velocity one step later: Eq. (3) and (4) of the paper.

    Args:
        current: present velocity.
        command: velocity asked for.
        faster: a or alpha of the paper, the most that the velocity may grow in this step.
        slower: the most that it may shrink.

    Returns:
        The command where it is in reach, else the velocity nearest to it.

    Note:
        The paper has one limit for both.
    """
    change = command - current
    fall, rise = velocity_changes(current, faster, slower)
    if change > rise:
        return current + rise
    if change < -fall:
        return current - fall
    return command


@kernel
def has_wheel_limits(limits: Limits) -> bool:
    """:attr:`cbrrt_ompl.problem.robot.Limits.has_wheel_limits`, for kernels."""
    return limits.wheel_speed < math.inf or limits.wheel_acceleration < math.inf


@kernel
def velocities_jump(limits: Limits) -> bool:
    """:attr:`cbrrt_ompl.problem.robot.Limits.is_first_order`, for kernels."""
    return limits.acceleration == math.inf


INSIDE = 1.0 - 1e-15
"""Leaves room for the rounding of a product, so that a scaled command is within its limit and not scaled again."""

WITHIN = 1.0 + 1e-12
"""Rounding by which a command may be out of reach and be reached, as one that was computed to be just in reach."""


@kernel
def saturate(v: float, omega: float, limits: Limits) -> tuple[float, float]:
    """The fastest command on the same arc, no faster than asked for, that the wheels can drive.

    Args:
        v: forward velocity asked for [m/s].
        omega: turning rate asked for [rad/s].
        limits: limits of the robot.

    Returns:
        (v, omega), both scaled by one factor where |v| + |omega| wheel_separation / 2 exceeds the wheels' speed, else
        as they came.
    """
    rim = abs(v) + 0.5 * limits.wheel_separation * abs(omega)
    if rim <= limits.wheel_speed:
        return v, omega
    share = INSIDE * limits.wheel_speed / rim
    return v * share, omega * share


@kernel
def axis_limits(limits: Limits) -> Limits:
    """Limits that hold for driving straight on and for turning on the spot, those of the wheels included."""
    if not has_wheel_limits(limits):
        return Limits(
            limits.v_min,
            limits.v_max,
            limits.omega_min,
            limits.omega_max,
            limits.acceleration,
            limits.angular_acceleration,
            limits.wheel_separation,
            limits.wheel_speed,
            limits.wheel_acceleration,
            limits.deceleration,
            limits.angular_deceleration,
        )
    slower, turns_slower = decelerations(limits)
    arm = 0.5 * limits.wheel_separation
    v_top, omega_top = limits.wheel_speed, INSIDE * limits.wheel_speed / arm
    return Limits(
        max(limits.v_min, -v_top),
        min(limits.v_max, v_top),
        max(limits.omega_min, -omega_top),
        min(limits.omega_max, omega_top),
        min(limits.acceleration, limits.wheel_acceleration),
        min(limits.angular_acceleration, limits.wheel_acceleration / arm),
        limits.wheel_separation,
        limits.wheel_speed,
        limits.wheel_acceleration,
        min(slower, limits.wheel_acceleration),
        min(turns_slower, limits.wheel_acceleration / arm),
    )


@kernel
def ramp_rate(velocity: float, change: float, faster: float, slower: float) -> float:
    """Rate at which a velocity changes by an amount: the lesser of both where that leads through rest."""
    if velocity * change >= 0.0 or abs(velocity) <= REST:
        return faster
    return slower if abs(change) <= abs(velocity) else min(faster, slower)


@kernel
def joint_ramp_time(v: float, omega: float, v_command: float, omega_command: float, limits: Limits) -> float:
    """Time in which both velocities change at once from some values to others [s]."""
    dv, domega = v_command - v, omega_command - omega
    slower, turns_slower = decelerations(limits)
    size, turn = abs(dv), abs(domega)
    time = max(
        size / ramp_rate(v, dv, limits.acceleration, slower),
        turn / ramp_rate(omega, domega, limits.angular_acceleration, turns_slower),
    )
    return max(time, (size + 0.5 * limits.wheel_separation * turn) / limits.wheel_acceleration)


@kernel
def stopping_time(v: float, omega: float, limits: Limits) -> float:
    """Time in which a robot that brakes no longer drives, though it may still turn [s]."""
    if has_wheel_limits(limits):
        return joint_ramp_time(v, omega, 0.0, 0.0, limits)
    return abs(v) / decelerations(limits)[0]


@kernel
def stopping_time_of_turn(v: float, omega: float, limits: Limits) -> float:
    """Time in which a robot that brakes no longer turns, though it may still drive [s]."""
    if has_wheel_limits(limits):
        return joint_ramp_time(v, omega, 0.0, 0.0, limits)
    return abs(omega) / decelerations(limits)[1]


@kernel
def joint_ramp(
    v: float, omega: float, v_command: float, omega_command: float, limits: Limits, dt: float
) -> tuple[float, float]:
    """Velocities one step later on the straight line to a command: the ramp of a robot with wheel limits.

    Both changes are scaled by one factor, so that v, omega and either wheel all keep their accelerations; on the line
    between two velocities that keep all limits, all velocities do.

    Args:
        v: present forward velocity [m/s].
        omega: present turning rate [rad/s].
        v_command: forward velocity asked for [m/s].
        omega_command: turning rate asked for [rad/s].
        limits: limits of the robot.
        dt: duration of the step [s].

    Returns:
        (v, omega) at the end of the step: the command where it is in reach.

    Note:
        The paper ramps v and omega independently of each other: :func:`ramp`, for robots without wheel limits.
    """
    dv, domega = v_command - v, omega_command - omega
    needed = joint_ramp_time(v, omega, v_command, omega_command, limits)
    if needed <= dt * WITHIN:
        return v_command, omega_command
    share = dt / needed
    return (
        clamp(v + share * dv, min(v, v_command), max(v, v_command)),
        clamp(omega + share * domega, min(omega, omega_command), max(omega, omega_command)),
    )


ONE_TWELFTH, ONE_24TH, ONE_80TH = 1.0 / 12.0, 1.0 / 24.0, 1.0 / 80.0
"""Factors, since a division takes the kernels as long as all the rest of a line."""


@kernel(inline="always")
def sine_cosine(angle: float) -> tuple[float, float]:
    """Sine and cosine without a branch, so that a loop over an array runs on vector registers.

    The angle is reduced by multiples of a quarter turn, in two parts, and the minimax polynomials of the Cephes library
    (Moshier) do the rest, to 1.2e-16 for the angles that occur here. That libm has no part in it makes a plan the same
    on every processor.

    Args:
        angle: an angle of at most a few turns [rad].

    Returns:
        (sine, cosine).
    """
    quarters = np.floor(angle * 0.6366197723675814 + 0.5)
    r = (angle - quarters * 1.5707963267341256) - quarters * 6.077100506506192e-11
    z = r * r
    p = -2.50507477628578072866e-8 + z * 1.58962301576546568060e-10
    p = -1.98412698295895385996e-4 + z * (2.75573136213857245213e-6 + z * p)
    sine = r + r * z * (-1.66666666666666307295e-1 + z * (8.33333333332211858878e-3 + z * p))
    p = 2.08757008419747316778e-9 - z * 1.13585365213876817300e-11
    p = 2.48015872888517045348e-5 + z * (-2.75573141792967388112e-7 + z * p)
    cosine = 1.0 - 0.5 * z + z * z * (4.16666666666665929218e-2 + z * (-1.38888888888730564116e-3 + z * p))
    half = 0.5 * quarters
    is_odd = half != np.floor(half)
    halves = 0.5 * np.floor(half)
    sign = 1.0 if halves == np.floor(halves) else -1.0
    return (cosine if is_odd else sine) * sign, (-sine if is_odd else cosine) * sign


@kernel(inline="always")
def middle_heading(theta: float, omega: float, omega_next: float, duration: float) -> float:
    """Heading in the middle of a step in which the turning rate changes linearly [rad]."""
    return theta + 0.125 * duration * (3.0 * omega + omega_next)


@kernel(inline="always")
def displacement(
    middle: float, v: float, omega: float, v_next: float, omega_next: float, duration: float
) -> tuple[float, float]:
    """Way of the robot in a step in which both velocities change linearly.

    The pose is expanded about the middle of the step, where the heading is known exactly, to the third order in the
    duration (to the fifth in the turning rate, so that an arc of constant velocities is exact to rounding at the usual
    steps). The error of a step is of the fifth order, at the price of one sine and one cosine.

    Args:
        middle: heading in the middle of the step [rad].
        v: forward velocity at the start [m/s].
        omega: turning rate at the start [rad/s].
        v_next: forward velocity at the end [m/s].
        omega_next: turning rate at the end [rad/s].
        duration: duration of the step [s].

    Returns:
        (dx, dy) [m].

    Note:
        The paper names no integrator; our reading is the midpoint rule, of which this is the refinement.
    """
    turn = 0.5 * (omega + omega_next) * duration
    speed = 0.5 * (v + v_next)
    squared = turn * turn
    along = speed * duration * (1.0 - squared * ONE_24TH * (1.0 - squared * ONE_80TH))
    across = duration * ((v_next - v) * turn * ONE_TWELFTH + speed * (omega_next - omega) * duration * ONE_24TH)
    s, c = sine_cosine(middle)
    return along * c - across * s, along * s + across * c


@kernel
def unicycle_step(
    x: float, y: float, theta: float, v: float, omega: float, v_next: float, omega_next: float, duration: float
) -> tuple[float, float, float]:
    """Pose after a step in which both velocities change linearly; see :func:`displacement`.

    Args:
        x: position [m].
        y: position [m].
        theta: heading [rad].
        v: forward velocity at the start [m/s].
        omega: turning rate at the start [rad/s].
        v_next: forward velocity at the end [m/s].
        omega_next: turning rate at the end [rad/s].
        duration: duration of the step [s].

    Returns:
        (x, y, theta) at the end, theta in [-pi, pi), [m, m, rad].
    """
    middle = middle_heading(theta, omega, omega_next, duration)
    dx, dy = displacement(middle, v, omega, v_next, omega_next, duration)
    return x + dx, y + dy, wrap_angle(theta + 0.5 * (omega + omega_next) * duration)


@kernel
def dynamic_step(
    x: float, y: float, theta: float, v: float, omega: float, command: tuple[float, float], limits: Limits, dt: float
) -> tuple[float, float, float, float, float]:
    """State one step later, the velocities ramping to a command under the acceleration limits.

    Robots with wheel limits ramp by :func:`joint_ramp`, all others by :func:`ramp`; the velocities of a robot without
    acceleration limits jump, see :func:`kinematic_step`.

    Args:
        x: position [m].
        y: position [m].
        theta: heading [rad].
        v: forward velocity [m/s].
        omega: turning rate [rad/s].
        command: (v, omega) asked for, [m/s, rad/s].
        limits: limits of the robot.
        dt: duration of the step [s].

    Returns:
        (x, y, theta, v, omega) at the end of the step.
    """
    if velocities_jump(limits):
        return kinematic_step(x, y, theta, command, dt)
    if has_wheel_limits(limits):
        v_next, omega_next = joint_ramp(v, omega, command[0], command[1], limits, dt)
    else:
        slower, turns_slower = decelerations(limits)
        v_next = ramp(v, command[0], limits.acceleration * dt, slower * dt)
        omega_next = ramp(omega, command[1], limits.angular_acceleration * dt, turns_slower * dt)
    x, y, theta = unicycle_step(x, y, theta, v, omega, v_next, omega_next, dt)
    return x, y, theta, v_next, omega_next


@kernel
def kinematic_step(
    x: float, y: float, theta: float, command: tuple[float, float], dt: float
) -> tuple[float, float, float, float, float]:
    """State one step later, the velocities jumping to a command: that of S-RRT and robots of first order.

    Args:
        x: position [m].
        y: position [m].
        theta: heading [rad].
        command: (v, omega) of the whole step, [m/s, rad/s].
        dt: duration of the step [s].

    Returns:
        (x, y, theta, v, omega) at the end of the step.
    """
    v, omega = command
    x, y, theta = unicycle_step(x, y, theta, v, omega, v, omega, dt)
    return x, y, theta, v, omega


@kernel
def brake(
    x: float, y: float, theta: float, v: float, omega: float, limits: Limits, dt: float, most_steps: int
) -> NDArray[np.float64]:
    """States from a given one to rest, both velocities braked as hard as the limits allow.

    Args:
        x: position [m].
        y: position [m].
        theta: heading [rad].
        v: forward velocity [m/s].
        omega: turning rate [rad/s].
        limits: limits of the robot.
        dt: duration of a step [s].
        most_steps: steps after which to give up.

    Returns:
        The given state and one a step, shape (n, 5); the last one at rest, unless n is ``most_steps + 1``.
    """
    states: NDArray[np.float64] = np.empty((64, 5))
    n = 0
    while True:
        states[n, 0], states[n, 1], states[n, 2], states[n, 3], states[n, 4] = x, y, theta, v, omega
        if n == most_steps or (v == 0.0 and omega == 0.0):
            return states[: n + 1].copy()
        n += 1
        if n == len(states):
            states = np.concatenate((states, np.empty_like(states)))
        x, y, theta, v, omega = dynamic_step(x, y, theta, v, omega, (0.0, 0.0), limits, dt)
