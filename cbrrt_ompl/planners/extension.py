"""Compiled EXTEND_TRAJECTORY of the paper (Algorithm II), for the plugin and the compiled planners alike."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cbrrt_ompl.collision.scene import Scene
from cbrrt_ompl.kernels import kernel
from cbrrt_ompl.motion.control_laws import reference_pose
from cbrrt_ompl.motion.manoeuvres import FORWARD, REVERSE
from cbrrt_ompl.motion.model import CANDIDATES, STEERING, candidate, in_goal
from cbrrt_ompl.motion.records import Record, Records
from cbrrt_ompl.planners.roll_out import MOTION_BLOCKED, MOTION_FREE, roll_out_brake_safe

EXTENDED, REFUSED, BLOCKED = 0, 1, 2
"""Outcomes of an extension: a new node; line 5 of Algorithm II; an obstacle in the way."""

NO_CHILD, UNTRIED = -1, -2
"""In place of a node's latest child: it has none; it has none, and no final approach was tried from it."""

CHILD = np.dtype(
    [
        ("v_command", np.float64),  # that made it [m/s, rad/s]
        ("omega_command", np.float64),
        ("sibling", np.int32),  # the next older child of the same node, -1 at the end
        ("unused", np.int32),
    ],
    align=True,
)
"""What line 5 of Algorithm II has to know of a node's child."""


class Extension(NamedTuple):
    """An extension and its outcome."""

    outcome: int
    """`EXTENDED`, `REFUSED` or `BLOCKED`."""
    steps: int
    """Integration steps."""
    state: tuple[float, float, float, float, float]
    """(x, y, theta, v, omega) at the end."""
    command: tuple[float, float]
    """Command (v, omega) that line 5 compares."""
    control: tuple[float, float, float]
    """Control for :func:`cbrrt_ompl.motion.model.advance`."""


@kernel(inline="always")  # as a function of its own it would be optimised again in each caller
def extend(
    node: tuple[float, float, float, float, float],
    margin: tuple[float, bool],
    sample: tuple[float, float],
    first_child: int,
    children: Records,
    scene: Scene,
    model: Record,
    steps: Record,
) -> Extension:
    """EXTEND_TRAJECTORY of the paper: from a node towards a sample, or by a final approach to the goal.

    CB-RRT has one candidate. S-RRT tries its three steering rates, leaves out those that the node has used or that
    collide, and takes the one that ends nearest to the reference.

    Args:
        node: (x, y, theta, v, omega) of the node.
        margin: of the node's pose, see :func:`cbrrt_ompl.planners.roll_out.margin_at`.
        sample: (x, y) to drive towards [m].
        first_child: latest child of the node, `NO_CHILD` or `UNTRIED`.
        children: records with the fields of `CHILD`, see :func:`is_refused`.
        scene: world and footprint.
        model: all settings, a record of type :data:`cbrrt_ompl.motion.model.MODEL`.
        steps: room for a block, a record of type :data:`cbrrt_ompl.planners.roll_out.STEPS`.
    """
    if first_child == UNTRIED and model.approaches:
        best = approach(node, margin, scene, model, steps)
        if best.outcome != BLOCKED:
            return best
    reference = reference_pose(node[0], node[1], node[2], sample[0], sample[1], model.look_ahead)
    best = Extension(REFUSED, 0, node, (0.0, 0.0), (0.0, 0.0, 0.0))
    nearest = math.inf
    for c in range(CANDIDATES if model.law == STEERING else 1):
        v, omega, control = candidate(c, node, reference, model)
        if is_refused(first_child, children, v, omega, model.equal_control_tolerance):
            continue
        driven, outcome, state = roll_out_brake_safe(node, control, margin[0], margin[1], scene, model, steps)
        if driven == 0 or (outcome == MOTION_BLOCKED and not model.keep_cut):
            if best.outcome == REFUSED:
                best = Extension(BLOCKED, 0, node, (v, omega), control)
            continue
        dx, dy = state[0] - reference[0], state[1] - reference[1]
        distance = dx * dx + dy * dy
        if distance < nearest:
            nearest = distance
            best = Extension(EXTENDED, driven, state, (v, omega), control)
    return best


@kernel
def is_refused(first_child: int, children: Records, v: float, omega: float, tolerance: float) -> bool:
    """Line 5 of Algorithm II: whether a node has a child by (nearly) the same command.

    Args:
        first_child: index of the node's latest child, negative if it has none.
        children: records with the fields of `CHILD`.
        v: forward velocity of the new command [m/s].
        omega: turning rate of the new command [rad/s].
        tolerance: eps_u [m/s and rad/s].
    """
    child = first_child
    while child >= 0:
        other = children[child]
        if abs(other.v_command - v) <= tolerance and abs(other.omega_command - omega) <= tolerance:
            return True
        child = other.sibling
    return False


@kernel(inline="always")
def approach(
    node: tuple[float, float, float, float, float],
    margin: tuple[float, bool],
    scene: Scene,
    model: Record,
    steps: Record,
) -> Extension:
    """The final approach from a node to the goal, ahead or backwards, whichever is free and takes the smaller turn.

    Args:
        node: (x, y, theta, v, omega) of the node.
        margin: see :func:`extend`.
        scene: see :func:`extend`.
        model: see :func:`extend`.
        steps: see :func:`extend`.

    Returns:
        `EXTENDED` into the goal, or `BLOCKED`.
    """
    goal = model.goal
    ahead = math.cos(node[2]) * (goal.x - node[0]) + math.sin(node[2]) * (goal.y - node[1]) >= 0.0
    for first in (True, False):
        manoeuvre = FORWARD if first == ahead else REVERSE
        if manoeuvre == REVERSE and model.limits.v_min == 0.0:
            continue
        control = (0.0, 0.0, manoeuvre)
        driven, outcome, state = roll_out_brake_safe(node, control, margin[0], margin[1], scene, model, steps)
        if outcome == MOTION_FREE and in_goal(goal, state[0], state[1], state[2], state[3], state[4]):
            return Extension(EXTENDED, driven, state, (0.0, 0.0), control)
    return Extension(BLOCKED, 0, node, (0.0, 0.0), (0.0, 0.0, 0.0))
