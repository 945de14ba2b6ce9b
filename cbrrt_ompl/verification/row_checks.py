"""Checks of the rows: the first at the start, the last in the goal region, all where the commands lead."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.problem.settings import State
from cbrrt_ompl.trajectory.displacement import wrapped
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.verification.violation import UNITS, Violation, broken_condition

if TYPE_CHECKING:
    from cbrrt_ompl.scenario.scenario import Scenario

START_TOLERANCE = 1e-6
"""Largest deviation of the first row from the scenario's start, in each value [m, rad, m/s, rad/s]."""


def start_violations(trajectory: Trajectory, scenario: Scenario) -> Iterator[Violation]:
    """Deviations of the first row from the start."""
    found, start = trajectory.states[0], np.array(scenario.start, dtype=float)
    error = found - start
    error[2] = wrapped(error[2])
    for name, value, wanted, off in zip(State._fields, found, start, error, strict=True):
        if not abs(off) <= START_TOLERANCE:
            t, unit = float(trajectory.t[0]), UNITS[name]
            message = (
                f"start: {name} = {value:.9g} {unit} at t = {t:.6g} s, expected {wanted:.9g} {unit} "
                f"to {START_TOLERANCE:g}"
            )
            yield Violation("start", t, message, last_time=t)


def goal_violations(trajectory: Trajectory, scenario: Scenario) -> Iterator[Violation]:
    """What keeps the last row out of the goal region."""
    t = float(trajectory.t[-1])
    for problem in scenario.goal.violations(State(*trajectory.states[-1].tolist())):
        yield Violation("goal", t, f"goal: {problem}, at the end, t = {t:.6g} s", last_time=t)


def motion_violations(trajectory: Trajectory, states: NDArray[np.float64], tolerance: float) -> Iterator[Violation]:
    """Rows that differ from the motion computed again."""
    error = trajectory.states - states  # (n, 5)
    deviations = {
        "position": (np.hypot(error[:, 0], error[:, 1]), "m"),
        "heading": (wrapped(error[:, 2]), "rad"),
        "v": (error[:, 3], "m/s"),
        "omega": (error[:, 4], "rad/s"),
    }
    for name, (off, unit) in deviations.items():
        yield from broken_condition(
            "motion",
            f"{name} differs by {{}} {unit} from what the commands lead to",
            f"tolerance {tolerance:g} {unit}",
            off,
            ~(np.abs(off) <= tolerance),
            trajectory.t,
            "rows",
        )
