"""A motion between the rows of a trajectory, and how far it moves the footprint."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.trajectory.displacement import displacement, wrapped

LONGEST_TURN = 2.0 * math.pi
"""Largest turn from one row to the next that can be checked [rad]: a stored heading says nothing of full turns."""

LONGEST_WAY = 1e6
"""Largest way from one row to the next that can be checked [m]."""


@dataclass(frozen=True)
class Motion:
    """A motion through n poses; places on it are counted in rows, 2.5 is halfway through the step from row 2.

    Each step follows its velocities, linear in time; what they miss the next pose by is added evenly along the step.
    """

    times: NDArray[np.float64]
    """When the robot is at each pose, shape (n,) [s]."""
    poses: NDArray[np.float64]
    """The poses, shape (n, 3) [m, m, rad]."""
    steps: NDArray[np.float64]
    """Durations from pose to pose, 0 for steps that are left out, shape (n - 1,) [s]."""
    velocities: NDArray[np.float64]
    """v, v at the end, omega, omega at the end of each step, shape (4, n - 1) [m/s, rad/s]."""
    gaps: NDArray[np.float64]
    """What the velocities miss the next pose by, shape (n - 1, 3) [m, m, rad]."""
    gap_ways: NDArray[np.float64]
    """How far that moves a point of the footprint at most, shape (n - 1,) [m]."""
    reach: float
    """Distance from the origin that turning moves the footprint at [m]: 0 where turning makes no difference."""
    ways: NDArray[np.float64]
    """Bound on the way of any point of the footprint up to each pose, shape (n,) [m]."""
    left_out: NDArray[np.bool_]
    """Steps that are too long to be checked, shape (n - 1,)."""

    @classmethod
    def through(
        cls, times: NDArray[np.float64], poses: NDArray[np.float64], velocities: NDArray[np.float64], reach: float
    ) -> Motion:
        """The motion through poses by the velocities of the steps between them."""
        steps = np.diff(times)
        v0, v1, w0, w1 = velocities
        gaps = np.diff(poses, axis=0) - displacement(poses[:-1, 2], v0, v1, w0, w1, steps)
        gaps[:, 2] = wrapped(gaps[:, 2])
        gap_ways = np.hypot(gaps[:, 0], gaps[:, 1]) + reach * np.abs(gaps[:, 2])
        checkable = is_checkable(velocities, steps) & (gap_ways <= LONGEST_WAY)
        steps, velocities = np.where(checkable, steps, 0.0), np.where(checkable, velocities, 0.0)
        gaps, gap_ways = np.where(checkable[:, None], gaps, 0.0), np.where(checkable, gap_ways, 0.0)
        v0, v1, w0, w1 = np.abs(velocities)
        ways = 0.5 * steps * (v0 + v1 + reach * (w0 + w1)) + gap_ways
        ways = np.concatenate([[0.0], np.cumsum(ways)])
        return cls(times, poses, steps, velocities, gaps, gap_ways, reach, ways, ~checkable)

    def _split(self, places: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Row before each place, and the share of the step from there that is behind it."""
        rows = np.minimum(places.astype(np.int64), len(self.times) - 2)
        return rows, places - rows

    def times_at(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """When the robot is at each place, shape (m,) [s]."""
        return np.interp(places, np.arange(len(self.times)), self.times)

    def poses_at(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Poses at places, the heading not wrapped, shape (m, 3)."""
        if len(self.times) == 1:
            return np.repeat(self.poses, len(places), axis=0)
        rows, share = self._split(places)
        v0, v1, w0, w1 = self.velocities[:, rows]
        v, omega = v0 + (v1 - v0) * share, w0 + (w1 - w0) * share
        elapsed = share * self.steps[rows]
        moved = displacement(self.poses[rows, 2], v0, v, w0, omega, elapsed) + share[:, None] * self.gaps[rows]
        return self.poses[rows] + moved

    def ways_between(self, begin: NDArray[np.float64], end: NDArray[np.float64]) -> NDArray[np.float64]:
        """Bound on the way of any point of the footprint in each interval: whole rows or a part of one step [m].

        The speeds are convex functions of the time within a step, so their mean at two times is not below that between.
        """
        rows, a = self._split(begin)
        b = end - rows
        v0, v1, w0, w1 = self.velocities[:, rows]
        speeds = [
            np.abs(v0 + (v1 - v0) * share) + self.reach * np.abs(w0 + (w1 - w0) * share) for share in (a, b)
        ]  # (2, m)
        parts = (b - a) * (0.5 * self.steps[rows] * (speeds[0] + speeds[1]) + self.gap_ways[rows])
        whole = self.ways[end.astype(np.int64)] - self.ways[begin.astype(np.int64)]
        return np.where(end - begin > 1.0, whole, parts)


def is_checkable(velocities: NDArray[np.float64], steps: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether each step is short enough to be integrated and checked, shape (n - 1,)."""
    v0, v1, w0, w1 = np.abs(velocities)
    return (np.maximum(v0, v1) * steps <= LONGEST_WAY) & (np.maximum(w0, w1) * steps <= LONGEST_TURN)
