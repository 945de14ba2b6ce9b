"""Tracks: poses over time without commands, as other programs write and robots record them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cbrrt_ompl.errors import Problem, Remark, TrajectoryError
from cbrrt_ompl.trajectory.displacement import wrapped

POSE_COLUMNS = ("t", "x", "y", "theta")
"""The arrays of a track that must be there."""

VELOCITY_COLUMNS = ("v", "omega")
"""The arrays of a track that may be there, both or none."""

_SMALL_TURN = 1e-6
"""Below this half turn an arc is as long as its chord [rad]."""


@dataclass(frozen=True, eq=False)
class Track:
    """Poses over time, with the velocities or without them.

    Raises:
        TrajectoryError: if the arrays are no finite numbers of equal length, or times do not increase.
    """

    t: NDArray[np.float64]
    """Times, shape (n,) [s]; the numbers of the rows where ``is_timed`` is false."""
    x: NDArray[np.float64]
    """Positions, shape (n,) [m]."""
    y: NDArray[np.float64]
    """Positions, shape (n,) [m]."""
    theta: NDArray[np.float64]
    """Headings, shape (n,) [rad]."""
    v: NDArray[np.float64] | None = None
    """Forward velocities, shape (n,) [m/s]; None where nobody recorded them."""
    omega: NDArray[np.float64] | None = None
    """Turning rates, shape (n,) [rad/s]; None where nobody recorded them."""
    is_timed: bool = field(default=True, kw_only=True)
    """Whether the times mean anything: a path has none."""
    kinematic: bool = field(default=False, kw_only=True)
    """Whether the velocities may jump."""

    def __post_init__(self) -> None:
        """Check, copy and freeze the arrays."""
        if (self.v is None) != (self.omega is None):
            raise TrajectoryError(
                Problem("omega" if self.omega is None else "v", Remark("nothing"), "v and omega both")
            )
        names = POSE_COLUMNS if self.v is None else (*POSE_COLUMNS, *VELOCITY_COLUMNS)
        problems = []
        for name in names:
            array = _numbers(getattr(self, name))
            if array is None or not len(array) or len(array) != len(np.atleast_1d(self.t)):
                problems.append(Problem(name, getattr(self, name), "finite numbers, as many as t and at least one"))
                continue
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if not problems and not (np.diff(self.t) > 0.0).all():
            row = int(np.flatnonzero(~(np.diff(self.t) > 0.0))[0]) + 1
            problems.append(
                Problem(f"t[{row}]", float(self.t[row]), f"a time above {self.t[row - 1]:g}, the one before")
            )
        if problems:
            raise TrajectoryError(problems)

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.t)

    @classmethod
    def through(cls, poses: ArrayLike) -> Track:
        """A path without times.

        Args:
            poses: rows of (x, y, theta), shape (n, 3) [m, m, rad].
        """
        array = np.asarray(poses, dtype=float).reshape(-1, 3)
        return cls(np.arange(len(array), dtype=np.float64), *array.T, is_timed=False)

    @property
    def duration(self) -> float:
        """Time from the first to the last row [s]."""
        return float(self.t[-1] - self.t[0])

    @property
    def poses(self) -> NDArray[np.float64]:
        """Rows of (x, y, theta), shape (n, 3) [m, m, rad]."""
        return np.column_stack([self.x, self.y, self.theta])

    @property
    def step_velocities(self) -> NDArray[np.float64]:
        """Velocities at both ends of each step: v, v at the end, omega, omega at the end, shape (4, n - 1).

        Where they were not recorded, those of the circular arc from row to row.
        """
        if self.v is not None and self.omega is not None:
            return np.array([self.v[:-1], self.v[1:], self.omega[:-1], self.omega[1:]])
        steps, turns = np.diff(self.t), wrapped(np.diff(self.theta))
        dx, dy, half = np.diff(self.x), np.diff(self.y), 0.5 * turns
        middle = self.theta[:-1] + half
        chords = dx * np.cos(middle) + dy * np.sin(middle)  # along the chord of the arc, negative when backing
        curved = np.abs(half) > _SMALL_TURN
        arcs = np.where(curved, chords * half / np.sin(np.where(curved, half, 1.0)), chords)
        v, omega = arcs / steps, turns / steps
        return np.array([v, v, omega, omega])


def stamped_track(times: NDArray[np.float64], poses: NDArray[np.float64]) -> Track:
    """A track of poses with stamps, as a nav_msgs/Path has them.

    Equal rows that follow each other count once. Where the stamps do not increase, the times mean nothing. Where all
    headings are the same, as planners of positions leave them, they are those of the way ahead.

    Args:
        times: shape (n,) [s].
        poses: rows of (x, y, theta), shape (n, 3) [m, m, rad].
    """
    keep = np.concatenate([[True], (np.diff(poses, axis=0) != 0.0).any(axis=1) | (np.diff(times) > 0.0)])
    times, poses = times[keep], poses[keep]
    if len(poses) > 1 and np.ptp(poses[:, 2]) == 0.0:
        headings = np.arctan2(*np.diff(poses[:, :2], axis=0).T[::-1])
        if np.ptp(headings) > 0.0:
            poses = np.column_stack([poses[:, :2], np.append(headings, headings[-1])])
    if len(times) > 1 and (np.diff(times) > 0.0).all():
        return Track(times, *poses.T)
    return Track.through(poses)


def _numbers(values: ArrayLike) -> NDArray[np.float64] | None:
    """A copy of values as floats; None where they are no finite numbers in a row."""
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError):
        return None
    return array if array.ndim == 1 and np.isfinite(array).all() else None
