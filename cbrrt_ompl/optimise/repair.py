"""Solve, check the exact motion, and solve again with larger margins where it comes too close."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.optimise.clearance import clearances, is_motion_free, least_clearance, unsafe_rows
from cbrrt_ompl.optimise.guess import Guess
from cbrrt_ompl.optimise.transcription import Transcription
from cbrrt_ompl.problem.settings import State
from cbrrt_ompl.trajectory.trajectory import Trajectory

ROUNDS = 6
"""Solutions that are tried for one guess."""

SOLVED_TO = 1e-3
"""Violation of a constraint up to which a solution is worth rolling out."""

FIRST_BARRIER, WARM_BARRIER = 0.03, 1e-3
"""Barrier parameters to start with: from a guess, and from a solution with other margins."""

TARGET = 0.001
"""Room beyond the least clearance that the footprint is to have at all rows [m]."""

SLOWER = 0.8
"""Factor of the velocity limits where the robot could not brake in time."""


class Improvement(NamedTuple):
    """A trajectory that passed all checks, and the solution that it was rolled out from."""

    trajectory: Trajectory
    guess: Guess


def solve_and_repair(
    transcription: Transcription,
    guess: Guess,
    last_barrier: float,
    may_iterate: Callable[[int], int],
    *,
    most_cost: float = math.inf,
    is_warm: bool = False,
) -> Improvement | None:
    """Make a trajectory of a guess.

    Args:
        transcription: the problem.
        guess: states and controls.
        last_barrier: how precisely to solve, see :mod:`cbrrt_ompl.optimise.interior_point`.
        may_iterate: takes the Newton steps so far and says how many more there may be.
        most_cost: a solution that costs as much is of no use.
        is_warm: whether the guess is a solution already.

    Returns:
        A trajectory that is free, within all limits and in the goal region; None where the guess leads to none.
    """
    scenario, n = transcription.scenario, len(guess.controls)
    margins: NDArray[np.float64] = np.full(n + 1, transcription.margin)
    caps = np.ones(n + 1)
    barrier, spent = WARM_BARRIER if is_warm else FIRST_BARRIER, 0
    for _ in range(ROUNDS):
        solution = transcription.solve(
            guess, margins, caps, barrier, last_barrier, partial(_allowed, may_iterate, spent)
        )
        spent += solution.iterations
        if not (solution.infeasibility < SOLVED_TO and solution.cost < most_cost):
            return None
        guess, barrier = solution.guess, WARM_BARRIER
        trajectory = transcription.trajectory(guess)
        if scenario.goal.violations(State(*trajectory.states[-1].tolist())):
            return None
        dt = float(trajectory.t[1] - trajectory.t[0])
        free = is_motion_free(trajectory.states, dt, scenario, is_kinematic=trajectory.kinematic)
        if free and (trajectory.kinematic or not scenario.planning.brake_safe):
            return Improvement(trajectory, guess)
        if free:
            unsafe = by_interval(unsafe_rows(trajectory.states, scenario), n)
            if not unsafe.any():
                return Improvement(trajectory, guess)
            caps *= np.where(at_nodes(unsafe), SLOWER, 1.0)
        else:
            margins = margins + missing_margin(transcription, trajectory, n)
    return None


def _allowed(may_iterate: Callable[[int], int], spent: int, done: int) -> int:
    """Newton steps that are left after some of this solution and those of the ones before."""
    return may_iterate(spent + done)


def missing_margin(transcription: Transcription, trajectory: Trajectory, intervals: int) -> NDArray[np.float64]:
    """What is to be added to the margins at the nodes of a motion that is not free, shape (intervals + 1,) [m]."""
    scenario = transcription.scenario
    nearest = -by_interval(-clearances(trajectory.states, scenario), intervals)
    lack = TARGET + least_clearance(scenario) - nearest
    if lack.max() <= 0.0:  # the rows are far enough from everything, a point between two of them is not
        lack = 0.002 - (nearest - nearest.min())
    return at_nodes(np.where(lack > 0.0, 1.3 * lack + 0.001, 0.0))


def by_interval(rows: NDArray[Any], intervals: int) -> NDArray[Any]:
    """The largest value of the rows of each interval, its first and last included, shape (intervals,).

    What there is after the last interval, where the robot stands, does not count.
    """
    parts = (len(rows) - 1) // intervals
    inner = rows[: intervals * parts].reshape(intervals, parts).max(axis=1)
    return np.maximum(inner, rows[parts::parts][:intervals])


def at_nodes(values: NDArray[Any]) -> NDArray[Any]:
    """The larger value of the two intervals at each node, shape (n,) to (n + 1,)."""
    return np.maximum(np.append(values, values[-1]), np.insert(values, 0, values[0]))
