"""The columns that we add to OMPL's for each run."""

from __future__ import annotations

import math
from collections.abc import Sequence

from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.verification import verify

TRAJECTORY_COLUMNS = (
    "trajectory duration REAL",
    "trajectory length REAL",
    "point turns INTEGER",
    "verified BOOLEAN",
    "final heading error REAL",
    "final speed error REAL",
    "final turning rate error REAL",
)
"""Columns that a run without a trajectory leaves empty: [s], [m], number, whether valid, [rad], [m/s], [rad/s]."""


def search_columns(
    seed: int, planning_time: float, samples: int, extension_attempts: int, max_samples: int
) -> dict[str, str]:
    """What the search of a run took, by name and type of the column.

    Args:
        seed: seed of the run: ``cbrrt plan --seed`` repeats it.
        planning_time: time of the search alone [s]; OMPL's ``time`` has up to some milliseconds of its own threads.
        samples: samples drawn; for OMPL's own planners the rounds of their main loop.
        extension_attempts: extensions driven.
        max_samples: limit of the scenario.
    """
    return {
        "seed INTEGER": str(seed),
        "planning time REAL": f"{planning_time:.9f}",
        "samples INTEGER": str(samples),
        "extension attempts INTEGER": str(extension_attempts),
        "within max samples BOOLEAN": str(int(samples <= max_samples)),
    }


def trajectory_columns(trajectory: Trajectory | None, scenario: Scenario) -> dict[str, str]:
    """What came out of a run, by name and type of the column.

    The errors are those of the last state: of its heading from the goal's (empty where the goal leaves it free), and of
    its velocities from rest.

    Args:
        trajectory: into the goal region; None where the run has none.
        scenario: what it was planned in.
    """
    if trajectory is None:
        return dict.fromkeys(TRAJECTORY_COLUMNS, "")
    heading_error = None
    if scenario.goal.theta is not None:
        heading_error = abs(math.remainder(float(trajectory.theta[-1]) - scenario.goal.theta, math.tau))
    values = (
        repr(float(trajectory.duration)),
        repr(float(trajectory.length)),
        str(len(trajectory.point_turns)),
        str(int(verify(trajectory, scenario).ok)),
        "" if heading_error is None else repr(heading_error),
        repr(abs(float(trajectory.v[-1]))),
        repr(abs(float(trajectory.omega[-1]))),
    )
    return dict(zip(TRAJECTORY_COLUMNS, values, strict=True))


PROGRESS_ROWS = 50
"""Rows of progress in the time limit of a run, at equal distances: Planner Arena fits curves to them."""


def progress_rows(solutions: Sequence[tuple[float, float]], end: float, interval: float) -> tuple[tuple[str, ...], ...]:
    """The best cost so far, whenever it got better and at equal distances in between, as OMPL's planners report it.

    Args:
        solutions: time [s] and cost of each, better and better.
        end: when the run was over [s].
        interval: between the rows [s].
    """
    rows = dict(solutions)
    for time, cost in rows.copy().items():
        for i in range(math.ceil(time / interval), math.floor(end / interval) + 1):
            rows[i * interval] = cost
    return tuple((f"{time:.6f}", f"{rows[time]:.9g}") for time in sorted(rows))
