"""Checks of velocities, commands, accelerations and wheels against the limits of the robot."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.verification.velocities import acceleration_limits, allowed_rates, wheel_speeds
from cbrrt_ompl.verification.violation import UNITS, Violation, broken_condition, rates_text

if TYPE_CHECKING:
    from cbrrt_ompl.problem.robot import Limits

_SLACK = 1e-9
"""Relative excess over a limit that is rounding."""


def limit_violations(trajectory: Trajectory, limits: Limits) -> Iterator[Violation]:
    """Velocities and commands out of their ranges."""
    ranges = {"v": (limits.v_min, limits.v_max), "omega": (limits.omega_min, limits.omega_max)}
    for kind, suffix in (("velocity", ""), ("command", "_command")):
        for name, (low, high) in ranges.items():
            values = getattr(trajectory, name + suffix)
            slack = _SLACK * max(-low, high)
            broken = ~((values >= low - slack) & (values <= high + slack))
            limit = f"limits {low:.6g} to {high:.6g} {UNITS[name]}"
            text, excess = f"{name + suffix} = {{}} {UNITS[name]}", np.maximum(low - values, values - high)
            yield from broken_condition(kind, text, limit, values, broken, trajectory.t, "rows", excess)


def acceleration_violations(trajectory: Trajectory, limits: Limits) -> Iterator[Violation]:
    """Velocities that change faster than the limits allow."""
    steps = np.diff(trajectory.t)
    for name, rates in zip(("v", "omega"), acceleration_limits(limits), strict=True):
        values = getattr(trajectory, name)
        changes = np.diff(values)
        most = allowed_rates(values[:-1], values[1:], *rates)
        rounding = 4.0 * np.spacing(np.maximum(np.abs(values[1:]), np.abs(values[:-1])))
        rounding += 4.0 * most * np.spacing(np.abs(trajectory.t[1:]))
        broken = ~(np.abs(changes) <= most * steps * (1.0 + _SLACK) + rounding)
        unit = f"{UNITS[name]}^2"
        yield from broken_condition(
            "acceleration",
            f"{name} changes by {{}} {unit}",
            f"limit {rates_text(*rates)} {unit}",
            changes / steps,
            broken,
            trajectory.t[:-1],
            "steps",
        )


def wheel_speed_violations(trajectory: Trajectory, limits: Limits) -> Iterator[Violation]:
    """Wheels that are too fast, or would be by the command."""
    for text, v, omega in (
        ("", trajectory.v, trajectory.omega),
        (" by command", trajectory.v_command, trajectory.omega_command),
    ):
        for side, speeds in zip(("left", "right"), wheel_speeds(v, omega, limits), strict=True):
            broken = ~(np.abs(speeds) <= limits.wheel_speed * (1.0 + _SLACK))
            text_of_side, limit = f"{side} wheel at {{}} m/s{text}", f"limit {limits.wheel_speed:.6g} m/s"
            yield from broken_condition("wheel speed", text_of_side, limit, speeds, broken, trajectory.t, "rows")


def wheel_acceleration_violations(trajectory: Trajectory, limits: Limits) -> Iterator[Violation]:
    """Wheels whose speed changes faster than the limit allows."""
    steps, most = np.diff(trajectory.t), limits.wheel_acceleration
    size = np.abs(trajectory.v) + np.abs(trajectory.omega) * limits.wheel_separation
    rounding = 8.0 * np.spacing(np.maximum(size[1:], size[:-1]))
    if math.isfinite(most):
        rounding += 4.0 * most * np.spacing(np.abs(trajectory.t[1:]))
    for side, speeds in zip(("left", "right"), wheel_speeds(trajectory.v, trajectory.omega, limits), strict=True):
        changes = np.diff(speeds)
        yield from broken_condition(
            "wheel acceleration",
            f"speed of the {side} wheel changes by {{}} m/s^2",
            f"limit {most:.6g} m/s^2",
            changes / steps,
            ~(np.abs(changes) <= most * steps * (1.0 + _SLACK) + rounding),
            trajectory.t[:-1],
            "steps",
        )
