"""Checks of a track, which has no commands: row by row, each to a tolerance."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from cbrrt_ompl.problem.settings import State
from cbrrt_ompl.trajectory.displacement import wrapped
from cbrrt_ompl.trajectory.track import Track
from cbrrt_ompl.verification.motion import Motion
from cbrrt_ompl.verification.velocities import acceleration_limits, allowed_rates, wheel_speeds
from cbrrt_ompl.verification.violation import UNITS, Violation, broken_condition, rates_text

if TYPE_CHECKING:
    from cbrrt_ompl.problem.robot import Limits
    from cbrrt_ompl.scenario.scenario import Scenario


def track_start_violations(track: Track, scenario: Scenario, tolerance: float) -> Iterator[Violation]:
    """Deviations of the first row from the start."""
    t = float(track.t[0])
    error = track.poses[0] - np.array(scenario.start[:3])
    found = {"x": error[0], "y": error[1], "theta": float(wrapped(error[2]))}
    if track.v is not None and track.omega is not None:
        found |= {"v": track.v[0] - scenario.start.v, "omega": track.omega[0] - scenario.start.omega}
    for name, off in found.items():
        if not abs(off) <= tolerance:
            unit, wanted = UNITS[name], getattr(scenario.start, name)
            message = f"start: {name} off by {off:.6g} {unit} at t = {t:.6g} s, expected {wanted:.9g} to {tolerance:g}"
            yield Violation("start", t, message, last_time=t)


def track_goal_violations(track: Track, scenario: Scenario) -> Iterator[Violation]:
    """What keeps the last row out of the goal region; speeds count where they are known."""
    t = float(track.t[-1])
    v, omega = (0.0, 0.0) if track.v is None or track.omega is None else (track.v[-1], track.omega[-1])
    x, y, theta = track.poses[-1].tolist()
    for problem in scenario.goal.violations(State(x, y, theta, float(v), float(omega))):
        yield Violation("goal", t, f"goal: {problem}, at the end, t = {t:.6g} s", last_time=t)


def track_limit_violations(track: Track, limits: Limits, tolerance: float) -> Iterator[Violation]:
    """Velocities, wheels and accelerations beyond the limits; of the steps where the rows have no velocities."""
    if track.v is not None and track.omega is not None:
        times, v, omega = track.t, track.v, track.omega
    else:
        v, _, omega, _ = track.step_velocities
        times = 0.5 * (track.t[:-1] + track.t[1:])
    ranges = {"v": (v, limits.v_min, limits.v_max), "omega": (omega, limits.omega_min, limits.omega_max)}
    for name, (values, low, high) in ranges.items():
        limit, excess = f"limits {low:.6g} to {high:.6g} {UNITS[name]}", np.maximum(low - values, values - high)
        text = f"{name} = {{}} {UNITS[name]}"
        yield from broken_condition("velocity", text, limit, values, ~(excess <= tolerance), times, "rows", excess)
    for side, speeds in zip(("left", "right"), wheel_speeds(v, omega, limits), strict=True):
        broken = ~(np.abs(speeds) <= limits.wheel_speed + tolerance)
        limit = f"limit {limits.wheel_speed:.6g} m/s"
        yield from broken_condition("wheel speed", f"{side} wheel at {{}} m/s", limit, speeds, broken, times, "rows")
    if track.kinematic:
        return
    steps = np.diff(times)
    for name, values, both in zip(("v", "omega"), (v, omega), acceleration_limits(limits), strict=True):
        rates, unit = np.diff(values) / steps, f"{UNITS[name]}^2"
        text, limit = f"{name} changes by {{}} {unit}", f"limit {rates_text(*both)} {unit}"
        broken = ~(np.abs(rates) <= allowed_rates(values[:-1], values[1:], *both) + tolerance)
        yield from broken_condition("acceleration", text, limit, rates, broken, times[:-1], "steps")


def track_motion_violations(track: Track, motion: Motion, tolerance: float) -> Iterator[Violation]:
    """Steps that a two-wheeled robot cannot drive: rows beside where the velocities before them lead."""
    sideways = np.hypot(motion.gaps[:, 0], motion.gaps[:, 1])
    for name, off, unit in (("position", sideways, "m"), ("heading", np.abs(motion.gaps[:, 2]), "rad")):
        yield from broken_condition(
            "motion",
            f"{name} off by {{}} {unit} from where the row before leads",
            f"tolerance {tolerance:g} {unit}",
            off,
            ~(off <= tolerance),
            track.t[:-1],
            "steps",
        )
