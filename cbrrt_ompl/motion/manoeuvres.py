"""Compiled manoeuvres, which end at rest: the final approach to a goal, and braking.

A final approach brakes, turns to the goal, drives straight onto its centre and turns to its heading. The state alone
tells the next command, so a manoeuvre is replayed like any edge. Turns and the drive are as quick as the limits allow,
by the trapezoidal profile in discrete steps, and end exactly on the spot.
"""

from __future__ import annotations

import math

from cbrrt_ompl.kernels import kernel
from cbrrt_ompl.motion.kinematics import axis_limits, clamp, decelerations, velocity_changes, wrap_angle
from cbrrt_ompl.problem.robot import Limits

FORWARD, REVERSE, BRAKE = 8.0, 9.0, 10.0
"""Third number of a control that asks for a manoeuvre: a final approach, ahead or backwards, or braking to rest.

No heading and no unused number of a control is as large.
"""

REACHED = 1e-6
"""Distance and angle that count as arrived [m, rad]."""

AT_REST = 1e-9
"""Velocities below this are rounding [m/s, rad/s]."""

NO_TURN = -1e-12
"""Turns to the right down to this are rounding to a robot that only turns left [rad]."""


@kernel(inline="always")
def is_manoeuvre(control: tuple[float, float, float]) -> bool:
    """Whether a control asks for a manoeuvre."""
    return control[2] >= FORWARD


@kernel
def next_velocity(
    way: float, velocity: float, low: float, high: float, faster: float, slower: float, dt: float
) -> float:
    """Velocity one step later, on the quickest way to come to rest after exactly a given way.

    Under velocities that are linear in each step, the way from v to rest, with the largest decrease in every step but
    the last, is piecewise linear in v. The velocity returned is the one from which that way ends on the spot, if it is
    within the range and the change.

    Args:
        way: what is left to go, with its sign [m or rad].
        velocity: present velocity [m/s or rad/s].
        low: smallest velocity.
        high: largest velocity.
        faster: the most that the velocity may grow in a step.
        slower: the most that it may shrink.
        dt: duration of a step [s].
    """
    left = way - 0.5 * velocity * dt
    full_steps = math.floor(0.5 * (math.sqrt(1.0 + 8.0 * abs(left) / (slower * dt)) - 1.0))
    rest = abs(left) - 0.5 * slower * dt * full_steps * (full_steps + 1.0)
    wanted = math.copysign(full_steps * slower + rest / ((full_steps + 1.0) * dt), left)
    fall, rise = velocity_changes(velocity, faster, slower)
    found = clamp(clamp(wanted, low, high), velocity - fall, velocity + rise)
    return 0.0 if abs(found) < AT_REST and abs(velocity) <= slower else found


@kernel
def approach_command(
    state: tuple[float, float, float, float, float],
    aim: tuple[float, float, float],
    has_heading: bool,
    is_reverse: bool,
    is_kinematic: bool,
    limits: Limits,
    dt: float,
) -> tuple[float, float]:
    """Velocities at the end of the next step of a final approach.

    Args:
        state: (x, y, theta, v, omega).
        aim: pose to come to rest in, [m, m, rad].
        has_heading: whether its heading counts.
        is_reverse: whether the robot drives backwards.
        is_kinematic: whether the velocities jump.
        limits: limits of the robot.
        dt: duration of the step [s].

    Returns:
        (v, omega), in reach within the step, [m/s, rad/s].
    """
    x, y, theta, v, omega = state
    limits = axis_limits(limits)
    slower, turns_slower = decelerations(limits)
    dx, dy = aim[0] - x, aim[1] - y
    c, s = math.cos(theta), math.sin(theta)
    along, aside = c * dx + s * dy, c * dy - s * dx
    if is_kinematic:
        v = omega = 0.0
    sign = -1.0 if is_reverse else 1.0
    turn = 0.0
    if math.sqrt(dx * dx + dy * dy) > REACHED:
        if omega == 0.0 and abs(aside) <= 0.5 * REACHED and along * sign > 0.0:
            if is_kinematic:
                return clamp(along / dt, limits.v_min, limits.v_max), 0.0
            faster = limits.acceleration
            return next_velocity(along, v, limits.v_min, limits.v_max, faster * dt, slower * dt, dt), 0.0
        turn = math.atan2(aside * sign, along * sign)
    elif has_heading:
        turn = wrap_angle(aim[2] - theta)
    if v != 0.0:
        return 0.0, 0.0
    if turn < NO_TURN and limits.omega_min == 0.0:
        turn += 2.0 * math.pi
    if is_kinematic:
        return 0.0, clamp(turn / dt, limits.omega_min, limits.omega_max)
    faster = limits.angular_acceleration
    return 0.0, next_velocity(turn, omega, limits.omega_min, limits.omega_max, faster * dt, turns_slower * dt, dt)


@kernel
def has_ended(
    manoeuvre: float,
    state: tuple[float, float, float, float, float],
    aim: tuple[float, float, float],
    has_heading: bool,
) -> bool:
    """Whether a manoeuvre is over: at rest, and for an approach on the spot, in the heading if that counts."""
    x, y, theta, v, omega = state
    if v != 0.0 or omega != 0.0:
        return False
    if manoeuvre == BRAKE:
        return True
    if math.hypot(aim[0] - x, aim[1] - y) > REACHED:
        return False
    return not has_heading or abs(wrap_angle(aim[2] - theta)) <= REACHED


@kernel
def most_steps(manoeuvre: float, distance: float, limits: Limits, dt: float) -> int:
    """Steps within which every manoeuvre has ended, an approach over a distance [m] at its start."""
    limits = axis_limits(limits)
    v_range, omega_range = limits.v_max - limits.v_min, limits.omega_max - limits.omega_min
    slower, turns_slower = decelerations(limits)
    rate, turning_rate = min(limits.acceleration, slower), min(limits.angular_acceleration, turns_slower)
    stop = v_range / rate + omega_range / turning_rate
    if manoeuvre == BRAKE:
        return int(stop / dt) + 2
    v_top = -limits.v_min if manoeuvre == REVERSE else limits.v_max
    omega_top = limits.omega_max if limits.omega_min == 0.0 else min(-limits.omega_min, limits.omega_max)
    way = distance + v_range * v_range / rate
    return int((way / v_top + 8.0 * math.pi / omega_top + 8.0 * stop) / dt) + 100
