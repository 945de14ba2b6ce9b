"""Compiled check of a motion between its states, the same for what planners drive and for motions given as rows.

The distance of a footprint from everything changes by no more than its points move. So a pose that is farther from
everything than it has to be, by a margin, proves all poses before and after it that are reached by moving no further
than that; few poses of a motion are looked at.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.collision.clearance import ENOUGH, clearance
from cbrrt_ompl.collision.scene import Scene
from cbrrt_ompl.kernels import inner_kernel, kernel
from cbrrt_ompl.motion.kinematics import unicycle_step
from cbrrt_ompl.motion.model import ROOM
from cbrrt_ompl.motion.records import Record

MOTION_RESOLUTION = 2.0 * ROOM
"""Largest distance between two checked points of a motion [m]."""


def is_free(
    states: NDArray[np.float64], dt: float, scene: Scene, room: float = ROOM, *, is_kinematic: bool = False
) -> bool:
    """Whether a motion is free between its rows as well: every point of it that a planner would look at.

    Args:
        states: rows of (x, y, theta, v, omega), shape (n, 5); between the rows the velocities are linear in time.
        dt: time between two rows [s].
        scene: world and footprint.
        room: distance that all points but the first keep from everything [m].
        is_kinematic: whether the velocities jump instead, at each row to those of the next one.

    Returns:
        False as soon as one of them is not.
    """
    return bool(_are_rows_free(np.ascontiguousarray(states, dtype=np.float64), dt, scene, room, is_kinematic))


@kernel
def _are_rows_free(states: NDArray[np.float64], dt: float, scene: Scene, room: float, is_kinematic: bool) -> bool:
    """:func:`is_free`, compiled."""
    distance, any_heading = clearance(scene, states[0, 0], states[0, 1], states[0, 2], ENOUGH)
    if distance <= 0.0:
        return False
    margin = max(distance - room, 0.0)
    for i in range(1, len(states)):
        before = i if is_kinematic else i - 1
        start = (states[i - 1, 0], states[i - 1, 1], states[i - 1, 2], states[before, 3], states[before, 4])
        end = (states[i, 0], states[i, 1], states[i, 2], states[i, 3], states[i, 4])
        way = way_of_step(start, end, lever_arm(scene.frame[0], any_heading), dt)
        if margin >= way:
            margin -= way
        else:
            margin, any_heading = check_step_motion(start, end, margin, any_heading, scene, room, dt)
            if margin <= 0.0:
                return False
    return True


@kernel(inline="always")
def lever_arm(frame: Record, any_heading: bool) -> float:
    """How far a turn moves what a margin is about, a radian at most [m].

    Args:
        frame: a record of type :data:`cbrrt_ompl.collision.scene.FRAME`.
        any_heading: whether the margin is that of a disc about the footprint's centre; else it is the footprint's.
    """
    return frame.center_distance if any_heading else frame.reach


@kernel(inline="always")
def way_of_step(
    start: tuple[float, float, float, float, float],
    end: tuple[float, float, float, float, float],
    arm: float,
    dt: float,
) -> float:
    """Bound on the way in one step of any point within an arm of the robot's origin [m].

    Args:
        start: (x, y, theta, v, omega).
        end: the same one step later.
        arm: see :func:`lever_arm` [m].
        dt: duration of the step [s].
    """
    return (max(abs(start[3]), abs(end[3])) + arm * max(abs(start[4]), abs(end[4]))) * dt


@inner_kernel
def check_step_motion(
    start: tuple[float, float, float, float, float],
    end: tuple[float, float, float, float, float],
    margin: float,
    any_heading: bool,
    scene: Scene,
    room: float,
    dt: float,
) -> tuple[float, bool]:
    """Check the points of one step, each no more than `MOTION_RESOLUTION` after the one before.

    Every point must be farther than the room from everything: then no obstacle, however thin, fits between two of them.
    The end is looked at first, since a step that is refused is mostly refused there; what the margins of both ends do
    not prove is looked at from the start on. What is accepted depends on the points alone.

    Args:
        start: (x, y, theta, v, omega), whose pose has been checked.
        end: the same one step later.
        margin: distance proven free at the start, beyond the room [m].
        any_heading: see :func:`lever_arm`.
        scene: world and footprint.
        room: distance to keep [m].
        dt: duration of the step [s].

    Returns:
        The margin at the end, 0 or less where the step is refused; and the ``any_heading`` of that margin.

    Note:
        Its callers compare the margin with the way of the step and call this for the few steps that need more of it.
        With that comparison in here an extension attempt took up to twice as long, even where it was inlined.
    """
    frame = scene.frame[0]
    points = int(way_of_step(start, end, frame.reach, dt) / MOTION_RESOLUTION) + 1
    at_end, any_heading_at_end, proven_from = margin, any_heading, points
    point, reached = points, 0  # what is looked at, and the last point that the start proves
    while True:
        x, y, theta = end[0], end[1], end[2]
        if point < points:
            fraction = point / points
            v = start[3] + fraction * (end[3] - start[3])
            omega = start[4] + fraction * (end[4] - start[4])
            x, y, theta = unicycle_step(start[0], start[1], start[2], start[3], start[4], v, omega, fraction * dt)
        distance, any_heading_here = clearance(scene, x, y, theta, ENOUGH)
        if distance <= room:
            return distance - room, any_heading_here
        proven = _points_proven(
            distance - room, way_of_step(start, end, lever_arm(frame, any_heading_here), dt), points
        )
        if point == points:
            at_end, any_heading_at_end, proven_from = distance - room, any_heading_here, points - proven
            proven = _points_proven(margin, way_of_step(start, end, lever_arm(frame, any_heading), dt), points)
        else:
            reached = point
        point = reached + 1 + proven
        if point >= proven_from:
            return at_end, any_heading_at_end


@kernel(inline="always")
def _points_proven(margin: float, way: float, points: int) -> int:
    """How many points of a step, beside that of the margin, a margin proves to be free."""
    return int(min(margin * points / way, points)) if way > 1e-12 * points else points
