"""Trajectories with rows at another rate.

Between rows, velocities are linear in time. Samples of the old velocities at a new rate would cut the corners of their
ramps, and pose after pose would drift away. So each new velocity is the mean of the old ones over an interval about its
time: means obey every limit that the old velocities obey (the limits are convex), and their ramps cover the same way
and turn but for an error that does not grow. What is left is taken back slowly, as far as the limits let it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.checks import is_number
from cbrrt_ompl.errors import Problem, Remark, TrajectoryError
from cbrrt_ompl.trajectory.columns import COLUMNS
from cbrrt_ompl.trajectory.displacement import QUADRATURE, wrapped

if TYPE_CHECKING:
    from cbrrt_ompl.problem.robot import Limits
    from cbrrt_ompl.trajectory.trajectory import Trajectory

MOST_ROWS = 1_000_000
"""Rows of a trajectory at most."""

GAIN = 1.0
"""How fast an error is taken back [1/s]: slow enough to need little of the accelerations."""

STEEPEST = 2.0
"""Largest heading against an error to the side, at low speed [rad/m]; critical damping where the robot is faster."""

MOST_STEPS_TO_REST = 100
"""Rows after the old end in which the robot is to stand."""

_QUADRATURE = QUADRATURE.tolist()

_SAME = 1e-9
"""Times nearer than this are the same [s]."""


def resample(trajectory: Trajectory, hz: float, limits: Limits | None) -> Trajectory:
    """See :meth:`cbrrt_ompl.Trajectory.resampled`."""
    if not (is_number(hz) and hz > 0.0):
        raise TrajectoryError(Problem("hz", hz, "a number above 0 [Hz]"))
    step, begin, end = 1.0 / float(hz), float(trajectory.t[0]), float(trajectory.t[-1])
    if (end - begin) * hz > MOST_ROWS:
        raise TrajectoryError(Problem("hz", Remark(f"{(end - begin) * hz:.3g} rows"), f"at most {MOST_ROWS}"))
    count = math.ceil((end - begin) * hz - _SAME * hz)
    times: NDArray[np.float64] = begin + step * np.arange(count + 1, dtype=np.float64)
    if not trajectory.ends_at_rest:
        times[-1] = end
    if _holds_all(times, trajectory.t):
        return _refined(trajectory, times)
    return _followed(trajectory, times, step, limits)


def _holds_all(times: NDArray[np.float64], rows: NDArray[np.float64]) -> bool:
    """Whether some increasing times have all of some others among them."""
    after = (
        np.clip(np.searchsorted(times, rows), 1, len(times) - 1) if len(times) > 1 else np.zeros(len(rows), dtype=int)
    )
    nearest = np.minimum(np.abs(times[after] - rows), np.abs(times[after - 1] - rows))
    return bool((nearest <= _SAME).all())


def _refined(trajectory: Trajectory, times: NDArray[np.float64]) -> Trajectory:
    """The very same motion at more times."""
    near = (
        np.clip(np.searchsorted(trajectory.t, times), 1, max(len(trajectory) - 1, 1)) if len(trajectory) > 1 else None
    )
    if near is not None:  # rounding must not make a row of another one
        near -= np.abs(trajectory.t[near - 1] - times) < np.abs(trajectory.t[near] - times)
        times = np.where(np.abs(trajectory.t[near] - times) <= _SAME, trajectory.t[near], times)
    states = trajectory.at(times)
    if trajectory.kinematic:
        row = np.clip(np.searchsorted(trajectory.t, times, side="right") - 1, 0, max(len(trajectory) - 2, 0))
        commands = np.column_stack([trajectory.v_command, trajectory.omega_command])[row]
        states[1:, 3:] = commands[:-1]
    else:
        commands = np.concatenate([states[1:, 3:], states[-1:, 3:]])
        commands[-1] = commands[-2] if len(commands) > 1 else commands[-1]
    return _with_rows(trajectory, times, states, commands)


def _followed(trajectory: Trajectory, times: NDArray[np.float64], step: float, limits: Limits | None) -> Trajectory:
    """The motion as velocities that ramp at other times follow it."""
    wanted = trajectory.at(np.minimum(times, trajectory.t[-1])).tolist()  # (n, 5)
    means = _means(trajectory, times, step).tolist()  # (n, 2)
    rows, stamps = [wanted[0]], [float(times[0])]

    def drive(target: Sequence[float], mean: Sequence[float], dt: float, gain: float = GAIN) -> None:
        rows.append(_next(rows[-1], target, mean, dt, limits, trajectory.kinematic, gain))
        stamps.append(stamps[-1] + dt)

    for time, target, mean in zip(times[1:].tolist(), wanted[1:], means[1:], strict=True):
        drive(target, mean, time - stamps[-1])
    if not trajectory.ends_at_rest and len(rows) > 1:  # a goal that was just reached is to be reached again
        missed, speed = math.dist(rows[-1][:2], wanted[-1][:2]), abs(rows[-1][3])
        more = min(2.0 * missed / max(speed, 1e-3), 0.5 * step)
        last = stamps.pop() - stamps[-1] + more
        rows.pop()
        drive(wanted[-1], means[-1], last)
    while trajectory.ends_at_rest and not trajectory.kinematic and any(rows[-1][3:]):
        if len(rows) > len(times) + MOST_STEPS_TO_REST:
            raise TrajectoryError(
                Problem("hz", 1.0 / step, "a rate at which the robot comes to rest within its limits")
            )
        drive(wanted[-1], (0.0, 0.0), step, gain=0.0)
    states: NDArray[np.float64] = np.array(rows)
    states[:, 2] = wrapped(states[:, 2])
    commands = np.concatenate([states[1:, 3:], states[-1:, 3:]])
    return _with_rows(trajectory, np.array(stamps), states, commands)


def _with_rows(
    trajectory: Trajectory, times: NDArray[np.float64], states: NDArray[np.float64], commands: NDArray[np.float64]
) -> Trajectory:
    """A trajectory of the same kind with other rows: times (n,), states (n, 5) and commands (n, 2)."""
    return replace(trajectory, **dict(zip(COLUMNS, (times, *states.T, *commands.T), strict=True)))


def _means(trajectory: Trajectory, times: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    """Mean velocities over a step about each time, or before it where velocities jump, shape (n, 2).

    The first is the first velocity itself; a robot that does not come to rest keeps its last velocities.
    """
    v0, v1, w0, w1 = trajectory.step_velocities
    areas = np.concatenate([[[0.0, 0.0]], np.cumsum(0.5 * np.diff(trajectory.t) * [v0 + v1, w0 + w1], axis=1).T])

    def area(at: NDArray[np.float64]) -> NDArray[np.float64]:
        inside = np.clip(at, trajectory.t[0], trajectory.t[-1])
        row = np.clip(np.searchsorted(trajectory.t, inside, side="right") - 1, 0, max(len(trajectory) - 2, 0))
        elapsed, duration = inside - trajectory.t[row], np.diff(trajectory.t)[row]
        part = [elapsed * (a[row] + 0.5 * (b[row] - a[row]) * elapsed / duration) for a, b in ((v0, v1), (w0, w1))]
        beyond = np.maximum(at - trajectory.t[-1], 0.0)[:, None] * trajectory.states[-1, 3:]
        return areas[row] + np.transpose(part) + beyond

    ahead = 0.0 if trajectory.kinematic else 0.5 * step
    means: NDArray[np.float64] = (area(times + ahead) - area(times + ahead - step)) / step
    means[0] = trajectory.states[0, 3:]
    return means


def _next(
    state: Sequence[float],
    target: Sequence[float],
    mean: Sequence[float],
    dt: float,
    limits: Limits | None,
    kinematic: bool,
    gain: float,
) -> list[float]:
    """The state after a step whose velocities end at a mean, corrected towards the pose of a target.

    A row at a time, since each depends on the one before, and in plain numbers: NumPy takes ten times as long for few.
    """
    old = state[3:]
    x, y, theta = _moved(state, mean if kinematic else old, mean, dt)
    c, s = math.cos(target[2]), math.sin(target[2])
    dx, dy = target[0] - x, target[1] - y
    ahead, aside = c * dx + s * dy, -s * dx + c * dy
    turn, speed = math.remainder(target[2] - theta, 2.0 * math.pi), abs(mean[0])
    aim = min(0.25 * GAIN / max(speed, 1e-9), STEEPEST) * aside * math.copysign(min(speed / 0.05, 1.0), mean[0])
    new = (mean[0] + gain * ahead, mean[1] + gain * (turn + aim))
    if limits is not None:
        new = limits.saturated(*new) if kinematic else limits.reachable(old, new, dt)
    return [*_moved(state, new if kinematic else old, new, dt), *new]


def _moved(
    state: Sequence[float], begin: Sequence[float], end: Sequence[float], dt: float
) -> tuple[float, float, float]:
    """Pose (x, y, theta) after a step, as :func:`cbrrt_ompl.trajectory.displacement.displacement` has it."""
    x, y, theta = state[:3]
    for node, weight in _QUADRATURE:
        heading = theta + dt * node * (begin[1] + 0.5 * (end[1] - begin[1]) * node)
        way = dt * weight * (begin[0] + (end[0] - begin[0]) * node)
        x, y = x + way * math.cos(heading), y + way * math.sin(heading)
    return x, y, theta + 0.5 * dt * (begin[1] + end[1])
