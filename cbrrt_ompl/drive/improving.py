"""Plans of a drive, improved on the way."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np

from cbrrt_ompl.errors import ScenarioError
from cbrrt_ompl.optimise.guess import guess_from_trajectory
from cbrrt_ompl.optimise.improving import Improver, geodesic_guesses
from cbrrt_ompl.optimise.objective import Objective
from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.trajectory.trajectory import Trajectory, displacement

SLACK = 5e-3
"""More clearance than is asked for [m]: rows at whole steps follow an improved motion to some millimetres."""


def improved(
    plan: Trajectory, scenario: Scenario, max_iterations: int, time_limit: float, last: Trajectory | None
) -> tuple[Trajectory, bool]:
    """A plan made shorter, with rows at whole integration steps.

    Whether it is free is for the caller to check.

    Args:
        plan: from the scenario's start into its goal region.
        scenario: the world as it is known, the robot and where it will be.
        max_iterations: Newton steps at most.
        time_limit: time at most [s].
        last: what is left of the plan before, as another guess (a warm start); None where there is none.

    Returns:
        The plan, the one given where nothing shorter is found; and whether time or steps were used up before the end.
    """
    began, planning = time.perf_counter(), scenario.planning
    here = scenario.world.clearance(scenario.robot.footprint, scenario.start[:3])
    try:
        room = replace(planning, clearance=max(planning.clearance, min(planning.clearance + SLACK, here - 1e-6)))
        roomy = replace(scenario, planning=room)
    except ScenarioError:
        return plan, False
    limits = scenario.robot.limits
    guesses = [guess_from_trajectory(plan, limits, "plan"), *geodesic_guesses(roomy)]
    if last is not None and last.duration > 0.0:
        guesses.append(guess_from_trajectory(last, limits, "last plan"))
    improver = Improver(roomy, Objective(), began + time_limit - time.perf_counter(), max_iterations)
    improver.run(guesses)
    is_cut_short = improver.has_ended()
    if improver.best is None:
        return plan, is_cut_short
    found = on_whole_steps(improver.best, planning.step)
    return (found if found.duration < plan.duration else plan), is_cut_short


def on_whole_steps(trajectory: Trajectory, step: float) -> Trajectory:
    """A trajectory with rows a step apart; one that ends at speed drives on for what is left of its last step."""
    rows = trajectory.resampled(1.0 / step)
    if len(rows) > 1 and rows.duration > step * (len(rows) - 1) + 1e-9:  # its last step may be longer: two of them
        rows = _with_last_step_cut(rows, step)
    left = step * (len(rows) - 1) - rows.duration
    if left > 1e-9 and len(rows) > 1:
        x, y, theta, v, omega = rows.states[-1].tolist()
        moved = displacement(*(np.array([value]) for value in (theta, v, v, omega, omega, left)))[0]
        states, times = rows.states.copy(), rows.t.copy()
        states[-1, :3] += moved
        times[-1] += left
        rows = replace(rows, t=times, x=states[:, 0], y=states[:, 1], theta=states[:, 2])
    assert math.isclose(rows.duration, step * (len(rows) - 1), abs_tol=1e-6)
    return rows


def _with_last_step_cut(rows: Trajectory, step: float) -> Trajectory:
    """Rows a step apart but for a longer last step, with one more row a step after the last but one."""
    t = np.insert(rows.t, len(rows) - 1, rows.t[0] + step * (len(rows) - 1))
    commands = np.column_stack([rows.v_command, rows.omega_command])
    commands = np.concatenate([commands[:-1], commands[-2:]])
    return replace(
        rows,
        t=t,
        **dict(zip(("x", "y", "theta", "v", "omega"), rows.at(t).T, strict=True)),
        v_command=commands[:, 0],
        omega_command=commands[:, 1],
    )
