"""Compiled check of a whole motion: the planners' check of an edge, for rows of states instead of a control."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cbrrt_ompl.clearance_map import ClearanceMap, unpack_view
from cbrrt_ompl.extension import ASK, EXTENDED, Step, check_step_motion


def is_free(states: NDArray[np.float64], dt: float, clearance_map: ClearanceMap) -> bool:
    """Whether a motion is free between its rows as well: every point of it that a planner would look at.

    Args:
        states: rows of (x, y, theta, v, omega), shape (n, 5); between the rows the velocities are linear in time.
        dt: time between two rows [s].
        clearance_map: decides the points.

    Returns:
        False as soon as one of them is not.
    """
    m, answered = clearance_map, 0
    if m.collides(*states[0, :3].tolist()):
        return False
    while True:
        outcome, x, y, theta = check_rows(states, m.children, m.clearances, m.frame, m.answers, answered, dt)
        if outcome != ASK:
            return bool(outcome == EXTENDED)
        answered = m.answer(answered, x, y, theta)


@njit(cache=True)
def check_rows(
    states: NDArray[np.float64],
    children: NDArray[np.int32],
    clearances: NDArray[np.float64],
    frame: NDArray[np.float64],
    answers: NDArray[np.float64],
    answered: int,
    dt: float,
) -> tuple[int, float, float, float]:
    """Check all rows but the first, and the steps between them.

    Args:
        states: rows of (x, y, theta, v, omega), shape (n, 5).
        children: see :class:`cbrrt_ompl.clearance_map.MapView`.
        clearances: see :class:`cbrrt_ompl.clearance_map.MapView`.
        frame: see :class:`cbrrt_ompl.clearance_map.MapView`.
        answers: what FCL has said, see :func:`cbrrt_ompl.extension.find_answer`.
        answered: rows of ``answers`` in use.
        dt: time between two rows [s].

    Returns:
        `EXTENDED` (free), `BLOCKED` or `ASK`, and the pose looked at last.
    """
    view = unpack_view(children, clearances, frame)
    reach = 0.0 if view.is_round else view.outer
    x, y, theta = states[0, 0], states[0, 1], states[0, 2]
    margin, is_certified = 0.0, False
    for i in range(len(states) - 1):
        x, y, theta, v, omega = states[i, 0], states[i, 1], states[i, 2], states[i, 3], states[i, 4]
        x1, y1, theta1, v1, omega1 = (
            states[i + 1, 0],
            states[i + 1, 1],
            states[i + 1, 2],
            states[i + 1, 3],
            states[i + 1, 4],
        )
        travel = max(abs(v), abs(v1)) * dt
        sweep = travel + reach * max(abs(omega), abs(omega1)) * dt
        used = travel if is_certified else sweep
        if margin >= used:
            margin -= used
            continue
        step = Step(x, y, theta, v, omega, x1, y1, theta1, v1, omega1, travel, sweep)
        outcome, margin, is_certified, pose = check_step_motion(step, margin, is_certified, view, answers, answered, dt)
        if outcome != EXTENDED:
            return outcome, pose[0], pose[1], pose[2]
    return EXTENDED, x, y, theta
