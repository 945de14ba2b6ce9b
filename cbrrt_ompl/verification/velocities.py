"""Velocities computed again, from the first row, the commands and the limits."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cbrrt_ompl.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from cbrrt_ompl.problem.robot import Limits


ROUNDING = 1e-9
"""Velocities up to this count as rest [m/s, rad/s]."""


def velocities_again(trajectory: Trajectory, limits: Limits) -> NDArray[np.float64]:
    """The velocities that follow from the first row, the commands and the limits.

    Returns:
        v, v at the end, omega, omega at the end of each step, shape (4, n - 1) [m/s, rad/s].
    """
    steps = np.diff(trajectory.t)
    if limits.has_wheel_limits and not trajectory.kinematic:
        v, omega = _ramp_together(trajectory, limits)
        return np.array([v[:-1], v[1:], omega[:-1], omega[1:]])
    rows: list[NDArray[np.float64]] = []
    for start, commands, rates in zip(
        (trajectory.v[0], trajectory.omega[0]),
        (trajectory.v_command[:-1], trajectory.omega_command[:-1]),
        acceleration_limits(limits),
        strict=True,
    ):
        if trajectory.kinematic:
            rows += [commands, commands]
        else:
            ends = _ramp(start, commands, steps, *rates)
            rows += [np.concatenate([[start], ends])[:-1], ends]
    return np.array(rows)


def acceleration_limits(limits: Limits) -> tuple[tuple[float, float], tuple[float, float]]:
    """Acceleration and deceleration of v and of omega [m/s^2, rad/s^2]."""
    pairs = (limits.acceleration, limits.deceleration), (limits.angular_acceleration, limits.angular_deceleration)
    (v_up, v_down), (w_up, w_down) = pairs
    return (v_up, v_up if v_down == math.inf else v_down), (w_up, w_up if w_down == math.inf else w_down)


def allowed_rates(before: ArrayLike, after: ArrayLike, faster: float, slower: float) -> NDArray[np.float64]:
    """Rate at which velocities may change from some values to others, linearly in time, shape (n,).

    One is for growing magnitudes, one for shrinking ones, and what leads through rest is bound by both.
    """
    v0, v1 = (np.where(np.abs(v) <= ROUNDING, 0.0, v) for v in (before, after))
    is_through_rest = v0 * v1 < 0.0
    return np.where(is_through_rest, min(faster, slower), np.where(np.abs(v1) > np.abs(v0), faster, slower))


def _ramp(
    start: float, commands: NDArray[np.float64], steps: NDArray[np.float64], faster: float, slower: float
) -> NDArray[np.float64]:
    """Velocity at the end of each step, as near to the command as the accelerations allow, shape (n - 1,)."""
    value, ends = float(start), []
    for command, step in zip(commands.tolist(), steps.tolist(), strict=True):
        sign = math.copysign(1.0, command if abs(value) <= ROUNDING else value)
        speed, wanted = sign * value, sign * command  # speed is 0 or more
        if wanted >= speed or abs(value) <= ROUNDING:
            reached = min(wanted, speed + faster * step)
        elif wanted >= 0.0 or speed - slower * step >= 0.0:
            reached = max(wanted, speed - slower * step)
        else:
            reached = max(wanted, min(0.0, speed - min(faster, slower) * step))
        value = sign * reached
        ends.append(value)
    return np.array(ends)


def _ramp_together(trajectory: Trajectory, limits: Limits) -> NDArray[np.float64]:
    """Both velocities at the rows where wheels limit the robot, shape (2, n).

    They approach the command along the straight line between them, as far as v, omega and either wheel get in a step.
    """
    rates, turning_rates = acceleration_limits(limits)
    v, omega = float(trajectory.v[0]), float(trajectory.omega[0])
    ends, half = [(v, omega)], 0.5 * limits.wheel_separation
    commands = np.column_stack([trajectory.v_command, trajectory.omega_command])
    for (v_command, omega_command), step in zip(commands[:-1].tolist(), np.diff(trajectory.t).tolist(), strict=True):
        change, turn = v_command - v, omega_command - omega
        duration = max(
            abs(change) / float(allowed_rates(v, v_command, *rates)),
            abs(turn) / float(allowed_rates(omega, omega_command, *turning_rates)),
            (abs(change) + half * abs(turn)) / limits.wheel_acceleration,
        )
        if duration <= step:
            v, omega = v_command, omega_command
        else:
            v, omega = v + change * (step / duration), omega + turn * (step / duration)
        ends.append((v, omega))
    return np.transpose(ends)


def wheel_speeds(v: ArrayLike, omega: ArrayLike, limits: Limits) -> tuple[Any, Any]:
    """Speeds of the left and the right wheel over the ground [m/s]."""
    turn = np.multiply(omega, 0.5 * limits.wheel_separation)
    return np.subtract(v, turn), np.add(v, turn)
