"""Compiled motion model of a two-wheeled robot: angle wrap, velocity ramp and unicycle step.

Every state of this package comes out of these kernels, be it grown by a sampler, propagated by OMPL or replayed.
"""

from __future__ import annotations

import math

from numba import njit

from cbrrt_ompl.robot import Limits


@njit(cache=True)
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


@njit(cache=True)
def clamp(value: float, low: float, high: float) -> float:
    """The number nearest to value in [low, high]."""
    return low if value < low else high if value > high else value


@njit(cache=True)
def ramp(current: float, command: float, largest_change: float) -> float:
    """Velocity one step later: Eq. (3) and (4) of the paper.

    Args:
        current: present velocity.
        command: velocity asked for.
        largest_change: a or alpha of the paper, the most that the velocity may change in this step.

    Returns:
        The command where it is in reach, else the velocity nearest to it.
    """
    change = command - current
    if change > largest_change:
        return current + largest_change
    if change < -largest_change:
        return current - largest_change
    return command


ONE_TWELFTH, ONE_24TH, ONE_80TH = 1.0 / 12.0, 1.0 / 24.0, 1.0 / 80.0
"""Factors, since a division takes the kernels as long as all the rest of a line."""


@njit(cache=True)
def arc_length(speed: float, turn: float, duration: float) -> float:
    """How far a step leads along the heading in its middle [m]: the chord of the arc, to the fifth order."""
    squared = turn * turn
    return speed * duration * (1.0 - squared * ONE_24TH * (1.0 - squared * ONE_80TH))


@njit(cache=True)
def unicycle_step(
    x: float, y: float, theta: float, v: float, omega: float, v_next: float, omega_next: float, duration: float
) -> tuple[float, float, float]:
    """Pose after a step in which both velocities change linearly.

    The midpoint rule with its next terms: the pose is expanded about the middle of the step, where the heading is known
    exactly, to the third order in the duration (to the fifth in the turning rate, so that an arc of constant velocities
    is exact to rounding at the usual steps). The error of a step is of the fifth order, at the price of one sine and
    one cosine.

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

    Note:
        The paper names no integrator; PAPER readings take the midpoint rule, of which this is the refinement.
    """
    turn = 0.5 * (omega + omega_next) * duration
    middle = theta + 0.125 * duration * (3.0 * omega + omega_next)
    speed = 0.5 * (v + v_next)
    along = arc_length(speed, turn, duration)
    across = duration * ((v_next - v) * turn * ONE_TWELFTH + speed * (omega_next - omega) * duration * ONE_24TH)
    c, s = math.cos(middle), math.sin(middle)
    return x + along * c - across * s, y + along * s + across * c, wrap_angle(theta + turn)


@njit(cache=True)
def dynamic_step(
    x: float, y: float, theta: float, v: float, omega: float, command: tuple[float, float], limits: Limits, dt: float
) -> tuple[float, float, float, float, float]:
    """State one step later, the velocities ramping to a command under the acceleration limits.

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
    v_next = ramp(v, command[0], limits.acceleration * dt)
    omega_next = ramp(omega, command[1], limits.angular_acceleration * dt)
    x, y, theta = unicycle_step(x, y, theta, v, omega, v_next, omega_next, dt)
    return x, y, theta, v_next, omega_next


@njit(cache=True)
def kinematic_step(
    x: float, y: float, theta: float, command: tuple[float, float], dt: float
) -> tuple[float, float, float, float, float]:
    """State one step later, the velocities jumping to a command: the motion model of S-RRT.

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
