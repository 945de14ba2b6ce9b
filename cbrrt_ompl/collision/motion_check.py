"""Compiled check of a motion between its states, the same for what planners drive and for motions given as rows.

A kernel decides poses by the clearance map. Where the map cannot, it does not guess: it returns `ASK` with the pose in
question, the caller lets FCL answer it and calls again, and all is repeated, but for what was found before: the map's
``findings``, which the kernel reads again in their order.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cbrrt_ompl.collision.clearance_map import ROOM, UNDECIDED, ClearanceMap, MapView, certify_pose, unpack_view
from cbrrt_ompl.motion.kinematics import unicycle_step

FREE, BLOCKED, ASK = 0, 1, 2
"""What came of a motion: it is free, it meets an obstacle, or FCL must decide a pose of it first."""

MOTION_RESOLUTION = 2.0 * ROOM
"""Largest distance between two checked points of a motion [m]."""


def is_free(states: NDArray[np.float64], dt: float, clearance_map: ClearanceMap) -> bool:
    """Whether a motion is free between its rows as well: every point of it that a planner would look at.

    Args:
        states: rows of (x, y, theta, v, omega), shape (n, 5); between the rows the velocities are linear in time.
        dt: time between two rows [s].
        clearance_map: decides the points.

    Returns:
        False as soon as one of them is not.
    """
    m = clearance_map
    if m.collides(*states[0, :3].tolist()):
        return False
    m.forget_findings()
    while True:
        outcome, x, y, theta = check_rows(states, m.children, m.clearances, m.frame, m.findings, dt)
        if outcome != ASK:
            return bool(outcome == FREE)
        m.answer(x, y, theta)


@njit(cache=True)
def check_rows(
    states: NDArray[np.float64],
    children: NDArray[np.int32],
    clearances: NDArray[np.float64],
    frame: NDArray[np.float64],
    findings: NDArray[np.float64],
    dt: float,
) -> tuple[int, float, float, float]:
    """Check all rows but the first, and the steps between them.

    Args:
        states: rows of (x, y, theta, v, omega), shape (n, 5).
        children: see :class:`cbrrt_ompl.collision.clearance_map.MapView`.
        clearances: see :class:`cbrrt_ompl.collision.clearance_map.MapView`.
        frame: see :class:`cbrrt_ompl.collision.clearance_map.MapView`.
        findings: what was found before, see :func:`recall`.
        dt: time between two rows [s].

    Returns:
        `FREE`, `BLOCKED` or `ASK`, and the pose looked at last.
    """
    view = unpack_view(children, clearances, frame)
    reach = 0.0 if view.is_round else view.outer
    end = (states[0, 0], states[0, 1], states[0, 2], states[0, 3], states[0, 4])
    margin, is_certified = 0.0, False
    for i in range(1, len(states)):
        start, end = end, (states[i, 0], states[i, 1], states[i, 2], states[i, 3], states[i, 4])
        travel, sweep = ways_of_step(start, end, reach, dt)
        used = travel if is_certified else sweep
        if margin >= used:
            margin -= used
        else:
            outcome, margin, is_certified, pose = check_step_motion(
                start, end, travel, sweep, margin, is_certified, view, findings, dt
            )
            if outcome != FREE:
                return outcome, pose[0], pose[1], pose[2]
    return FREE, end[0], end[1], end[2]


@njit(cache=True)
def ways_of_step(
    start: tuple[float, float, float, float, float],
    end: tuple[float, float, float, float, float],
    reach: float,
    dt: float,
) -> tuple[float, float]:
    """Bounds on the ways in one step [m]: of the robot's origin, and of any point within a reach of it.

    Args:
        start: (x, y, theta, v, omega).
        end: the same one step later.
        reach: [m].
        dt: duration of the step [s].
    """
    travel = max(abs(start[3]), abs(end[3])) * dt
    return travel, travel + reach * max(abs(start[4]), abs(end[4])) * dt


@njit(cache=True)
def check_step_motion(
    start: tuple[float, float, float, float, float],
    end: tuple[float, float, float, float, float],
    travel: float,
    sweep: float,
    margin: float,
    is_certified: bool,
    view: MapView,
    findings: NDArray[np.float64],
    dt: float,
) -> tuple[int, float, bool, tuple[float, float, float]]:
    """Check the points of one step, each no more than `MOTION_RESOLUTION` after the one before.

    Every point must be farther than `ROOM` from everything: then no obstacle, however thin, fits between two of them. A
    point that is farther by m proves all points of the next m metres, so few of them are looked at. What is accepted
    depends on the points alone, never on what the map holds.

    Args:
        start: (x, y, theta, v, omega), whose pose has been checked.
        end: the same one step later.
        travel: see :func:`ways_of_step`.
        sweep: see :func:`ways_of_step`.
        margin: distance proven free at the start, beyond `ROOM` [m].
        is_certified: whether the margin holds for every heading; else it does for the heading there.
        view: the clearance map.
        findings: what was found before, see :func:`recall`.
        dt: duration of the step [s].

    Returns:
        `FREE`, `BLOCKED` or `ASK`; margin and ``is_certified`` at the end; and the pose looked at last.

    Note:
        Its callers compare the margin with the way of the step and call this for the few steps that need more of it.
        With that comparison in here an extension attempt took up to twice as long, even where it was inlined.
    """
    points = int(sweep / MOTION_RESOLUTION) + 1
    pose = (end[0], end[1], end[2])
    i = 0
    while i < points:
        spacing = (travel if is_certified else sweep) / points
        proven = int(margin / spacing) if spacing > 1e-12 else points
        if i + proven >= points:
            return FREE, margin - (points - i) * spacing, is_certified, pose
        i += proven + 1
        pose = (end[0], end[1], end[2])
        if i < points:
            share = i / points
            v = start[3] + share * (end[3] - start[3])
            omega = start[4] + share * (end[4] - start[4])
            pose = unicycle_step(start[0], start[1], start[2], start[3], start[4], v, omega, share * dt)
        is_known, margin, is_certified = recall(findings)
        if not is_known:
            margin, is_certified = certify_pose(view, pose[0], pose[1], pose[2], ROOM)
            if margin == UNDECIDED:
                return ASK, margin, is_certified, pose
            note(findings, margin, is_certified)
        if margin <= 0.0:
            return BLOCKED, margin, is_certified, pose
    return FREE, margin, is_certified, pose


@njit(cache=True)
def recall(findings: NDArray[np.float64]) -> tuple[bool, float, bool]:
    """The next of the findings, for a motion that is repeated.

    Args:
        findings: rows of (margin [m], whether it holds for every heading), in the order in which they were looked for,
            behind a row that counts those in use and those read, shape (n, 2).

    Returns:
        Whether there is one, and its two numbers.
    """
    row = int(findings[0, 1]) + 1
    if row > int(findings[0, 0]):
        return False, 0.0, False
    findings[0, 1] = row
    return True, findings[row, 0], findings[row, 1] != 0.0


@njit(cache=True)
def note(findings: NDArray[np.float64], margin: float, is_certified: bool) -> None:
    """Append a finding; where there is no room left, count as many as there are rows: some are lost."""
    row = min(int(findings[0, 0]) + 1, len(findings))
    findings[0, 0] = findings[0, 1] = row
    if row < len(findings):
        findings[row, 0], findings[row, 1] = margin, is_certified


@njit(cache=True)
def sum_up(findings: NDArray[np.float64], row: int) -> None:
    """Put one finding in place of all from a row on: that everything is free."""
    if int(findings[0, 0]) < len(findings):  # else some are lost
        findings[0, 0] = findings[0, 1] = row
        findings[row, 0] = np.inf
