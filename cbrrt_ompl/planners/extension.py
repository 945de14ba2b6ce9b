"""Compiled EXTEND_TRAJECTORY of the paper (Algorithm II), for the plugin and the compiled planners alike."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cbrrt_ompl.collision.clearance_map import MapView
from cbrrt_ompl.collision.motion_check import ASK, BLOCKED, FREE
from cbrrt_ompl.motion.control_laws import reference_pose
from cbrrt_ompl.motion.manoeuvres import FORWARD, REVERSE
from cbrrt_ompl.motion.model import CANDIDATES, STEERING, Model, candidate, in_goal
from cbrrt_ompl.planners.roll_out import drive_safely

EXTENDED, REFUSED = 3, 4
"""What came of an extension: a new node, or line 5 of Algorithm II; or `BLOCKED` or `ASK`, as of a motion."""

NO_CHILD, UNTRIED = -1, -2
"""In place of a node's latest child: it has none; it has none, and no final approach was tried from it."""


class Extension(NamedTuple):
    """What came of an extension."""

    outcome: int
    """`EXTENDED`, `REFUSED`, `BLOCKED` or `ASK`."""
    steps: int
    """Integration steps."""
    state: tuple[float, float, float, float, float]
    """(x, y, theta, v, omega) at the end."""
    command: tuple[float, float]
    """Command (v, omega) that line 5 compares."""
    control: tuple[float, float, float]
    """Control for :func:`cbrrt_ompl.motion.model.advance`; for `ASK` the pose in question instead."""


@njit(cache=True)
def extend(
    node: tuple[float, float, float, float, float],
    x_sample: float,
    y_sample: float,
    first: int,
    following: NDArray[np.int32],
    commands: NDArray[np.float64],
    model: Model,
    view: MapView,
    findings: NDArray[np.float64],
    scratch: NDArray[np.float64],
) -> Extension:
    """EXTEND_TRAJECTORY of the paper: from a node towards a sample, or by a final approach to the goal.

    CB-RRT has one candidate. S-RRT tries its three steering rates, leaves out those that the node has used or that
    collide, and takes the one that ends nearest to the reference.

    Args:
        node: (x, y, theta, v, omega) of the node.
        x_sample: the sample [m].
        y_sample: the sample [m].
        first: latest child of the node, see :func:`is_refused`, or `UNTRIED`.
        following: next older sibling of each child.
        commands: command of each child, shape (n, 2).
        model: all settings.
        view: the clearance map.
        findings: what was found before in this extension, see :func:`cbrrt_ompl.collision.motion_check.recall`.
        scratch: room for a block, of shape :data:`cbrrt_ompl.planners.roll_out.SCRATCH_SHAPE`.
    """
    if first == UNTRIED and model.approaches:
        best = approach(node, model, view, findings, scratch)
        if best.outcome != BLOCKED:
            return best
    reference = reference_pose(node[0], node[1], node[2], x_sample, y_sample, model.look_ahead)
    best = Extension(REFUSED, 0, node, (0.0, 0.0), (0.0, 0.0, 0.0))
    nearest = math.inf
    for c in range(CANDIDATES if model.law == STEERING else 1):
        v, omega, control = candidate(c, node, reference, model)
        if is_refused(first, following, commands, v, omega, model.equal_control_tolerance):
            continue
        steps, outcome, state, pose = drive_safely(node, control, model, view, findings, scratch)
        if outcome == ASK:
            return Extension(ASK, 0, node, (v, omega), pose)
        if steps == 0 or (outcome == BLOCKED and not model.keep_cut):
            if best.outcome == REFUSED:
                best = Extension(BLOCKED, 0, node, (v, omega), control)
            continue
        dx, dy = state[0] - reference[0], state[1] - reference[1]
        distance = dx * dx + dy * dy
        if distance < nearest:
            nearest = distance
            best = Extension(EXTENDED, steps, state, (v, omega), control)
    return best


@njit(cache=True)
def is_refused(
    first: int,
    following: NDArray[np.int32],
    commands: NDArray[np.float64],
    v: float,
    omega: float,
    tolerance: float,
) -> bool:
    """Line 5 of Algorithm II: whether a node has a child by (nearly) the same command.

    Args:
        first: index of the node's latest child, -1 if it has none.
        following: the next older sibling of each child, -1 at the end.
        commands: command (v, omega) that made each child, shape (n, 2), [m/s, rad/s].
        v: forward velocity of the new command [m/s].
        omega: turning rate of the new command [rad/s].
        tolerance: eps_u [m/s and rad/s].
    """
    child = first
    while child >= 0:
        if abs(commands[child, 0] - v) <= tolerance and abs(commands[child, 1] - omega) <= tolerance:
            return True
        child = following[child]
    return False


@njit(cache=True)
def approach(
    node: tuple[float, float, float, float, float],
    model: Model,
    view: MapView,
    findings: NDArray[np.float64],
    scratch: NDArray[np.float64],
) -> Extension:
    """The final approach from a node to the goal, ahead or backwards, whichever is free and takes the smaller turn.

    Args:
        node: (x, y, theta, v, omega) of the node.
        model: all settings.
        view: the clearance map.
        findings: what was found before, see :func:`cbrrt_ompl.collision.motion_check.recall`.
        scratch: room for a block, of shape :data:`cbrrt_ompl.planners.roll_out.SCRATCH_SHAPE`.

    Returns:
        `EXTENDED` into the goal, `BLOCKED` or `ASK`.
    """
    goal = model.goal
    ahead = math.cos(node[2]) * (goal.x - node[0]) + math.sin(node[2]) * (goal.y - node[1]) >= 0.0
    for first in (True, False):
        manoeuvre = FORWARD if first == ahead else REVERSE
        if manoeuvre == REVERSE and model.limits.v_min == 0.0:
            continue
        control = (0.0, 0.0, manoeuvre)
        steps, outcome, state, pose = drive_safely(node, control, model, view, findings, scratch)
        if outcome == ASK:
            return Extension(ASK, 0, node, (0.0, 0.0), pose)
        if outcome == FREE and in_goal(goal, state[0], state[1], state[2], state[3], state[4]):
            return Extension(EXTENDED, steps, state, (0.0, 0.0), control)
    return Extension(BLOCKED, 0, node, (0.0, 0.0), (0.0, 0.0, 0.0))
