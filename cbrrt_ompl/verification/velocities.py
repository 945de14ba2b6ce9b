"""Velocities computed again, from the first row, the commands and the limits."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cbrrt_ompl.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from cbrrt_ompl.problem.robot import Limits


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
    for start, commands, most in (
        (trajectory.v[0], trajectory.v_command[:-1], limits.acceleration * steps),
        (trajectory.omega[0], trajectory.omega_command[:-1], limits.angular_acceleration * steps),
    ):
        if trajectory.kinematic:
            rows += [commands, commands]
        else:
            ends = _ramp(start, commands, most)
            rows += [np.concatenate([[start], ends])[:-1], ends]
    return np.array(rows)


def _ramp(start: float, commands: NDArray[np.float64], most: NDArray[np.float64]) -> NDArray[np.float64]:
    """Velocity at the end of each step, which approaches the command by ``most`` at most, shape (n - 1,)."""
    value, ends = float(start), []
    for command, change in zip(commands.tolist(), most.tolist(), strict=True):
        value += min(max(command - value, -change), change)
        ends.append(value)
    return np.array(ends)


def _ramp_together(trajectory: Trajectory, limits: Limits) -> NDArray[np.float64]:
    """Both velocities at the rows where wheels limit the robot, shape (2, n).

    They approach the command along the straight line between them, as far as v, omega and either wheel get in a step.
    """
    v, omega = float(trajectory.v[0]), float(trajectory.omega[0])
    ends, half = [(v, omega)], 0.5 * limits.wheel_separation
    commands = np.column_stack([trajectory.v_command, trajectory.omega_command])
    for (v_command, omega_command), step in zip(commands[:-1].tolist(), np.diff(trajectory.t).tolist(), strict=True):
        change, turn = v_command - v, omega_command - omega
        duration = max(
            abs(change) / limits.acceleration,
            abs(turn) / limits.angular_acceleration,
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
