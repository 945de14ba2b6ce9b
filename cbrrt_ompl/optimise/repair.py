"""Solve, check the exact motion, and solve again where it comes too close: with shorter intervals or larger margins."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.optimise.clearance import is_motion_free, least_clearance, signed_clearances, unsafe_rows
from cbrrt_ompl.optimise.guess import Guess, split
from cbrrt_ompl.optimise.program import STEP
from cbrrt_ompl.optimise.transcription import Transcription
from cbrrt_ompl.problem.robot import Footprint
from cbrrt_ompl.problem.settings import State
from cbrrt_ompl.trajectory.trajectory import Trajectory

ROUNDS = 10
"""Solutions that are tried for one guess."""

ITERATIONS_A_SOLUTION, WARM_ITERATIONS = 200, 100
"""Newton steps of each of them at most, and of one from the multipliers of the one before: most take a dozen, and where
one does not converge, it is begun again without them."""

SPLIT_BARRIER = 1e-3
"""Barrier parameter to go on with where intervals were cut: the new states may be deep in something."""

SOLVED_TO = 1e-3
"""Violation of a constraint up to which a solution is worth rolling out."""

DEEPEST = 0.01
"""How much nearer than at both of its nodes an interval may come to something before it is cut in two [m]: larger
margins at its nodes would close narrow passages."""

SMALL_LACK = 0.0025
"""What an interval may lack for which larger margins at its nodes will do [m]."""

SPACING, MOST_PARTS = 0.01, 16
"""Way between the rows that are looked at [m], as far as this many for each row of the trajectory allow it."""

SHORTEST_WAY = 0.05
"""Way of any point of the footprint in an interval that is not cut any more, at most [m]."""

MOST_INTERVALS = 900
"""Intervals of a solution after which none is cut any more."""

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
) -> Improvement | None:
    """Make a trajectory of a guess.

    Args:
        transcription: the problem.
        guess: states and controls.
        last_barrier: how precisely to solve, see :mod:`cbrrt_ompl.optimise.interior_point`.
        may_iterate: takes the Newton steps so far and says how many more there may be.
        most_cost: a solution that costs as much is of no use.

    Returns:
        A trajectory that is free, within all limits and in the goal region; None where the guess leads to none.
    """
    scenario = transcription.scenario
    margins: NDArray[np.float64] = np.full(len(guess.states), transcription.margin)
    caps = np.ones(len(guess.states))
    spent, barrier = 0, last_barrier
    for _ in range(ROUNDS):
        most = ITERATIONS_A_SOLUTION if guess.duals is None else WARM_ITERATIONS
        solution = transcription.solve(
            guess, margins, caps, last_barrier, partial(_allowed, may_iterate, spent, most), barrier
        )
        spent += solution.iterations
        is_solved = solution.infeasibility < SOLVED_TO
        if guess.duals is not None and not is_solved:
            guess = guess._replace(duals=None)
            continue
        if not (solution.iterations and is_solved and solution.cost < most_cost):
            return None
        guess, barrier = solution.guess, last_barrier
        trajectory, rows = transcription.trajectory(guess), transcription.rows(guess)
        if scenario.goal.violations(State(*trajectory.states[-1].tolist())):
            return None
        dt = float(trajectory.t[1] - trajectory.t[0])
        free = is_motion_free(trajectory.states, dt, scenario, is_kinematic=trajectory.kinematic)
        if free and (trajectory.kinematic or not scenario.planning.brake_safe):
            return Improvement(trajectory, guess)
        if free:
            unsafe = by_interval(unsafe_rows(trajectory.states, scenario), rows)
            if not unsafe.any():
                return Improvement(trajectory, guess)
            caps *= np.where(at_nodes(unsafe), SLOWER, 1.0)
            continue
        ways = ways_of(trajectory.states, guess, rows, scenario.robot.footprint)
        finer = rows * int(min(math.ceil((ways / rows).max() / SPACING), MOST_PARTS))
        nearest = signed_clearances(transcription.roll_out(guess, finer), scenario)
        lack = missing_margin(nearest, least_clearance(scenario), finer)
        is_deep = (lack > SMALL_LACK) & (depths(nearest, finer) > DEEPEST) & (ways > SHORTEST_WAY)
        is_deep |= np.append(is_deep[1:], False) | np.append(False, is_deep[:-1])
        is_deep &= len(rows) < MOST_INTERVALS
        margins = margins + at_nodes(np.where(is_deep, 0.0, lack))
        if is_deep.any():
            barrier = max(last_barrier, SPLIT_BARRIER)
            guess = split(guess, is_deep, is_kinematic=transcription.is_kinematic)
            kept = np.append(np.repeat(np.arange(len(rows)), 1 + is_deep), len(rows))
            margins, caps = margins[kept], caps[kept]
    return None


def _allowed(may_iterate: Callable[[int], int], spent: int, most: int, done: int) -> int:
    """Newton steps that are left after some of this solution, and those of the ones before."""
    return min(may_iterate(spent + done), most - done)


def ways_of(
    states: NDArray[np.float64], guess: Guess, rows: NDArray[np.int64], footprint: Footprint
) -> NDArray[np.float64]:
    """Bound on the way of any point of the footprint in each interval, shape (N,) [m].

    Args:
        states: rows of (x, y, theta, v, omega) [m, m, rad, m/s, rad/s].
        guess: whose motion it is.
        rows: of each interval.
        footprint: the robot's area.
    """
    speeds = np.abs(states[:, 3]) + footprint.circumscribed_radius * np.abs(states[:, 4])
    found: NDArray[np.float64] = by_interval(speeds, rows) * guess.states[:-1, STEP]
    return found


def depths(nearest: NDArray[np.float64], rows: NDArray[np.int64]) -> NDArray[np.float64]:
    """How much nearer each interval comes to something than its nodes, shape (N,) [m].

    Args:
        nearest: clearance of each row [m].
        rows: of each interval.
    """
    nodes = np.append(0, np.cumsum(rows))
    found: NDArray[np.float64] = np.minimum(nearest[nodes[:-1]], nearest[nodes[1:]]) + by_interval(-nearest, rows)
    return found


def missing_margin(nearest: NDArray[np.float64], least: float, rows: NDArray[np.int64]) -> NDArray[np.float64]:
    """What is to be added to the margins in the intervals of a motion that is not free, shape (N,) [m].

    Args:
        nearest: clearance of each row [m].
        least: clearance to keep [m].
        rows: of each interval.
    """
    within = -by_interval(-nearest, rows)
    lack = TARGET + least - within
    if lack.max() <= 0.0:  # the rows are far enough from everything, a point between two of them is not
        lack = 0.002 - (within - within.min())
    return np.where(lack > 0.0, 1.3 * lack + 0.001, 0.0)


def by_interval(values: NDArray[Any], rows: NDArray[np.int64]) -> NDArray[Any]:
    """The largest value of the rows of each interval, its first and last included, shape (N,).

    What there is after the last interval, where the robot stands, does not count.

    Args:
        values: one for each row of the trajectory.
        rows: of each interval.
    """
    ends = np.cumsum(rows)
    return np.maximum(np.maximum.reduceat(values[: ends[-1]], ends - rows), values[ends])


def at_nodes(values: NDArray[Any]) -> NDArray[Any]:
    """The larger value of the two intervals at each node, shape (n,) to (n + 1,)."""
    return np.maximum(np.append(values, values[-1]), np.insert(values, 0, values[0]))
