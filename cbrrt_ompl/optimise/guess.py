"""A guess for the solver: states and controls of N intervals, which need not fit together."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cbrrt_ompl.optimise.program import OMEGA, STEP, THETA, V
from cbrrt_ompl.problem.robot import REST, Limits
from cbrrt_ompl.trajectory.trajectory import Trajectory

INTERVAL = 0.55
"""Duration of an interval of a guess at most, as far as the number of intervals allows [s]."""

TURN = 1.0
"""Turn in an interval at most, for the same [rad]: the rule that integrates it is then good to 3e-4 of its way."""

LONGEST = 0.6
"""Way in an interval at most, for the same [m]: constraints hold at its ends."""

FEWEST, MOST = 45, 300
"""Range of the number of intervals."""

EXPECTED_FRACTION = 0.6
"""What an optimisation makes of the duration of a plan: its intervals are to have the usual duration then."""


class Duals(NamedTuple):
    """What a solution tells of its constraints: a like problem is solved from there in a few steps (a warm start)."""

    multipliers: NDArray[np.float64]
    """Of the inequalities of each state, shape (N + 1, ROWS)."""
    costates: NDArray[np.float64]
    """Multipliers of the dynamics that end at each state, shape (N + 1, STATES)."""


class Guess(NamedTuple):
    """States and controls for the solver to start from."""

    states: NDArray[np.float64]
    """Rows of (x, y, theta, v, omega, h), theta without jumps, shape (N + 1, 6); h is the duration of the interval that
    begins there, a whole multiple of the shortest one's."""
    controls: NDArray[np.float64]
    """Rows of (a, alpha), shape (N, 2); in a solution for a kinematic robot the velocities (v, omega)."""
    source: str
    """Where it comes from."""
    duals: Duals | None = None
    """Where it is a solution, or one whose intervals were cut: what is known of its constraints."""

    @property
    def duration(self) -> float:
        """Of all intervals [s]."""
        return float(self.states[:-1, STEP].sum())

    @property
    def multiples(self) -> NDArray[np.int64]:
        """Durations of the intervals, in terms of the shortest one, shape (N,)."""
        h = self.states[:-1, STEP]
        return np.round(h / h.min()).astype(np.int64)


def interval_count(duration: float, limits: Limits) -> int:
    """Intervals for a motion of some seconds."""
    interval = min(
        INTERVAL, TURN / max(limits.omega_max, -limits.omega_min), LONGEST / max(limits.v_max, -limits.v_min)
    )
    return int(min(max(math.ceil(duration / interval), FEWEST), MOST))


def guess_from_trajectory(trajectory: Trajectory, limits: Limits, source: str) -> Guess:
    """The states of a trajectory, evenly in time, and the velocities' mean changes between them."""
    n = interval_count(EXPECTED_FRACTION * trajectory.duration, limits)
    times = np.linspace(trajectory.t[0], trajectory.t[-1], n + 1)
    states = trajectory.at(times)
    states[:, THETA] = np.unwrap(states[:, THETA])
    return with_controls(states, trajectory.duration / n, source)


def guess_at_full_speed(trajectory: Trajectory, limits: Limits, source: str) -> Guess:
    """The poses of a trajectory, each as soon after the one before as the velocities allow: without its stops."""
    poses, v_top = trajectory.poses.copy(), np.where(trajectory.v_command < 0.0, -limits.v_min, limits.v_max)[:-1]
    poses[:, THETA] = np.unwrap(poses[:, THETA])
    moved, turned = np.hypot(*np.diff(poses[:, :THETA], axis=0).T), np.diff(poses[:, THETA])
    omega_top = np.where(turned < 0.0, -limits.omega_min, limits.omega_max)
    spans = np.maximum(moved / np.maximum(v_top, REST), np.abs(turned) / np.maximum(omega_top, REST)) + 1e-5
    path = np.column_stack([np.append(0.0, np.cumsum(spans)), poses])
    return guess_from_path(path, trajectory.states[0], limits, source)


def guess_from_path(path: NDArray[np.float64], start: ArrayLike, limits: Limits, source: str) -> Guess:
    """A guess along timed poses.

    Args:
        path: rows of (time, x, y, theta), the times increasing from 0, theta without jumps, shape (n, 4).
        start: state to begin with, shape (5,).
        limits: of the robot.
        source: name of the guess.
    """
    duration = path[-1, 0]
    n = interval_count(duration, limits)
    h = duration / n
    times = np.linspace(0.0, duration, n + 1)
    x, y, theta = (np.interp(times, path[:, 0], path[:, i]) for i in (1, 2, 3))
    v = np.gradient(x, h) * np.cos(theta) + np.gradient(y, h) * np.sin(theta)
    states = np.column_stack([x, y, theta, smoothed(v), smoothed(np.gradient(theta, h))])
    states[0] = start
    return with_controls(states, h, source)


def with_controls(states: NDArray[np.float64], h: float, source: str) -> Guess:
    """A guess of states, shape (N + 1, 5), that follow each other by h seconds."""
    controls = np.diff(states[:, 3:5], axis=0) / h
    return Guess(np.column_stack([states, np.full(len(states), h)]), controls, source)


def refined(guess: Guess, *, is_kinematic: bool) -> Guess:
    """The same motion in twice as many intervals."""
    return split(guess, np.ones(len(guess.controls), dtype=np.bool_), is_kinematic=is_kinematic)


def split(guess: Guess, chosen: NDArray[np.bool_], *, is_kinematic: bool) -> Guess:
    """The same motion with some of its intervals, chosen by an array of shape (N,), cut in two."""
    index = np.repeat(np.arange(len(chosen)), 1 + chosen)  # the interval that a new one is of
    is_second = np.append(False, index[1:] == index[:-1])
    before, after, a = guess.states[:-1], guess.states[1:], guess.controls
    h = np.where(chosen, 0.5, 1.0) * before[:, STEP]
    middle = 0.5 * (after + before)
    if is_kinematic:
        middle[:, V : OMEGA + 1] = a
    middle[:, THETA] = before[:, THETA] + h * (a[:, 1] if is_kinematic else before[:, OMEGA] + 0.5 * h * a[:, 1])
    states = np.where(is_second[:, None], middle[index], before[index])
    states[:, STEP] = h[index]
    last = np.append(after[-1, :STEP], states[-1, STEP])
    duals = None if guess.duals is None else _split_duals(guess.duals, chosen, index, is_second)
    return Guess(np.vstack([states, last]), a[index], guess.source, duals)


def _split_duals(
    duals: Duals, chosen: NDArray[np.bool_], index: NDArray[np.int64], is_second: NDArray[np.bool_]
) -> Duals:
    """Those of :func:`split`: what a constraint weighs is shared by both halves of an interval."""
    node, is_halved = np.append(index, len(chosen)), np.append(chosen[index], False)
    costates = duals.costates[node]
    costates[:-1][is_second] = 0.5 * (costates[:-1] + duals.costates[index + 1])[is_second]
    costates[is_halved, STEP] *= 2.0
    node[:-1][is_second & (index == 0)] = 1  # the start has other inequalities than all states after it
    return Duals(duals.multipliers[node] * np.where(is_halved, 0.5, 1.0)[:, None], costates)


def smoothed(values: NDArray[np.float64], width: int = 5) -> NDArray[np.float64]:
    """Means over some neighbours, shape (n,)."""
    padded = np.pad(values, width // 2, mode="edge")
    return np.convolve(padded, np.full(width, 1.0 / width), "valid")
