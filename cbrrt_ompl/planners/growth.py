"""The compiled loop: Algorithms I and II of the paper over arrays of records.

The robust kind departs from the paper in two lines: what is extended is the nearest place that is not passed over; and
the more extensions from a place have failed, the likelier it is passed over, and the shorter is the next one's way in
closed loop (docs/robust.md). A bounded search keeps only what may be in the goal within so many steps
(docs/improve.md).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.collision.scene import Scene
from cbrrt_ompl.kernels import kernel
from cbrrt_ompl.motion.manoeuvres import is_manoeuvre
from cbrrt_ompl.motion.model import CLOSED_LOOP, STEERING, in_goal
from cbrrt_ompl.motion.records import Record, Records
from cbrrt_ompl.planners.extension import EXTENDED, NO_CHILD, REFUSED, UNTRIED, Extension, extend
from cbrrt_ompl.planners.nearest import KD_TREE, Index, insert, leave_out, nearest
from cbrrt_ompl.planners.roll_out import margin_at

GROW_REACHED, GROW_WANTS_ROOM, GROW_WANTS_DRAWS, GROW_PAUSED = 0, 1, 2, 3
"""Why the loop returns: a node in the goal, full arrays, no random numbers left, enough for now."""

DRAWS, ROBUST_DRAWS, BOUNDED_DRAWS = 4, 5, 6
"""Random numbers of a sample: goal bias, x, y, the choice among nodes at one position; and how many failures of a place
are tolerated. Those of a bounded search have a sixth, after how many steps a node may be extended."""

LEAST_SHARE = 0.125
"""Share of the way to its reference that an extension keeps, however many from its place have failed."""

NODE = np.dtype(
    [
        ("x", np.float64),  # state [m, m, rad, m/s, rad/s]
        ("y", np.float64),
        ("theta", np.float64),
        ("v", np.float64),
        ("omega", np.float64),
        ("margin", np.float64),  # see margin_at of roll_out; negative as long as nobody has asked [m]
        ("v_command", np.float64),  # command that led here first [m/s, rad/s]
        ("omega_command", np.float64),
        ("control", np.float64, (3,)),  # that led here, see advance of the model
        ("parent", np.int32),  # -1 at a root
        ("steps", np.int32),  # of the edge that led here, 0 at a root
        ("first_child", np.int32),  # the latest one; NO_CHILD or UNTRIED where there is none
        ("sibling", np.int32),  # next older child of the same parent, -1 at the end
        ("twin", np.int32),  # next node at exactly the same position, -1 at the end
        ("place", np.int32),  # the indexed node at the same position, first of the chain of twins
        ("total_steps", np.int32),  # of the way from the root
        ("any_heading", np.bool_),  # of the margin
    ],
    align=True,
)
"""A node of the tree."""

SEARCH = np.dtype(
    [
        ("goal_bias", np.float64),  # fraction of samples that are the goal
        ("is_robust", np.bool_),
        ("most_steps", np.float64),  # of a way into the goal that is better than what is known; infinite at first
        ("nodes", np.int64),
        ("samples", np.int64),
        ("drawn", np.int64),  # rows of random numbers used up
        ("refusals", np.int64),  # extensions refused by line 5
        ("collisions", np.int64),  # extensions cut off by an obstacle
    ],
    align=True,
)
"""Settings and counters of a search, carried from call to call."""


@kernel
def add_node(tree: Records, index: Index, number: int, parent: int) -> None:
    """Link a node whose state, command, control and steps are there already.

    A node at exactly the position of its parent or of a sibling becomes a twin of it, all others enter the index.
    """
    node = tree[number]
    node.parent, node.first_child, node.sibling, node.twin, node.place = parent, UNTRIED, -1, -1, number
    node.margin, node.any_heading = -1.0, False
    node.total_steps = tree[parent].total_steps + node.steps if parent >= 0 else 0
    if parent >= 0:
        node.sibling = tree[parent].first_child
        tree[parent].first_child = number
        near, sibling = parent, node.sibling
        while sibling >= 0 and not (tree[near].x == node.x and tree[near].y == node.y):
            near, sibling = sibling, tree[sibling].sibling
        if tree[near].x == node.x and tree[near].y == node.y:
            place = tree[near].place
            node.place, node.twin = place, tree[place].twin
            tree[place].twin = number
            leave_out(index, number)
            return
    insert(index, number, node.x, node.y)
    index.places[number].steps = node.total_steps


@kernel
def one_of_twins(tree: Records, place: int, draw: float) -> int:
    """A node at the position of an indexed one, all equally likely.

    Args:
        tree: records of type `NODE`.
        place: the indexed node.
        draw: random number in [0, 1).

    Note:
        The paper does not say which of several nearest nodes is extended; this is our reading.
    """
    count, number = 0, place
    while number >= 0:
        count += 1
        number = tree[number].twin
    skip, number = int(draw * count), place
    for _ in range(skip):
        number = tree[number].twin
    return number


@kernel
def tolerated_failures(draw: float) -> float:
    """Most failures with which a place is not passed over: one with f failures is with the chance f / (1 + f).

    Args:
        draw: random number in [0, 1), the same for all places.
    """
    return 1.0 / draw - 1.0 if draw > 0.0 else math.inf


@kernel
def shortened(sample: tuple[float, float], x: float, y: float, failures: int, look_ahead: float) -> tuple[float, float]:
    """A sample drawn nearer to a place, the more extensions from there have failed.

    Args:
        sample: (x, y) [m].
        x: of the place [m].
        y: of the place [m].
        failures: extensions from there that have failed.
        look_ahead: largest distance of a reference [m].
    """
    if failures == 0:
        return sample
    dx, dy = sample[0] - x, sample[1] - y
    share = max(1.0 / (1.0 + failures), LEAST_SHARE)
    share *= look_ahead / max(math.sqrt(dx * dx + dy * dy), look_ahead)
    return x + share * dx, y + share * dy


@kernel
def steps_left(x: float, y: float, model: Record) -> float:
    """Lower bound of the integration steps from a position into the goal region: straight, at the highest speed."""
    goal, limits = model.goal, model.limits
    distance = math.hypot(x - goal.x, y - goal.y) - goal.tolerance
    return max(distance, 0.0) / (max(limits.v_max, -limits.v_min) * model.dt)


@kernel
def drawn_steps(draw: float, sample: tuple[float, float], most_steps: float, model: Record) -> float:
    """Most steps after which a node may be extended towards a sample: the cost of the sample in the state-cost space.

    Args:
        draw: random number in [0, 1).
        sample: (x, y) [m].
        most_steps: of a way into the goal.
        model: a record of type :data:`cbrrt_ompl.motion.model.MODEL`.

    Returns:
        Uniform in what is left of ``most_steps`` at the sample; 0, which only roots have, where nothing is.
    """
    return draw * max(most_steps - steps_left(sample[0], sample[1], model), 0.0)


@kernel
def is_over_bound(total_steps: int, extension: Extension, most_steps: float, model: Record) -> bool:
    """Whether no way through an extension's end can be in the goal within some steps.

    Args:
        total_steps: of the way from the root to the extended node.
        extension: from that node.
        most_steps: of a way into the goal.
        model: a record of type :data:`cbrrt_ompl.motion.model.MODEL`.
    """
    left = steps_left(extension.state[0], extension.state[1], model)
    return total_steps + extension.steps + left > most_steps


@kernel
def grow(
    tree: Records,
    index: Index,
    searches: Records,
    draws: NDArray[np.float64],
    last_sample: int,
    scene: Scene,
    models: Records,
    blocks: Records,
) -> int:
    """Draw samples and extend the tree until something is wanted.

    Args:
        tree: records of type `NODE`.
        index: of the tree's places.
        searches: one record of type `SEARCH`, which counts on.
        draws: random numbers in [0, 1), a sample a row, shape (m, DRAWS), (m, ROBUST_DRAWS) or (m, BOUNDED_DRAWS).
        last_sample: number of samples to pause at.
        scene: world and footprint.
        models: one record of type :data:`cbrrt_ompl.motion.model.MODEL`.
        blocks: one record of type :data:`cbrrt_ompl.planners.roll_out.STEPS`.

    Returns:
        `GROW_REACHED` (the last node is in the goal), `GROW_WANTS_ROOM`, `GROW_WANTS_DRAWS` or `GROW_PAUSED`.
    """
    search, model, steps, frame = searches[0], models[0], blocks[0], scene.frame[0]
    width, height = frame.x_max - frame.x_min, frame.y_max - frame.y_min
    while search.samples < last_sample:
        if search.nodes == len(tree) or (index.kind == KD_TREE and index.state[0].depth + 2 > len(index.stack)):
            return GROW_WANTS_ROOM
        if search.drawn == len(draws):
            return GROW_WANTS_DRAWS
        draw = draws[search.drawn]
        sample = (frame.x_min + draw[1] * width, frame.y_min + draw[2] * height)
        if draw[0] < search.goal_bias:
            sample = (model.goal.x, model.goal.y)
        most_failures = tolerated_failures(draw[4]) if search.is_robust else math.inf
        is_bounded = search.most_steps < math.inf
        latest = drawn_steps(draw[5], sample, search.most_steps, model) if is_bounded else math.inf
        # the root if all failed
        place = max(nearest(index, sample[0], sample[1], search.nodes, most_failures, latest), 0)
        parent = one_of_twins(tree, place, draw[3])
        node = tree[parent]
        if node.margin < 0.0:
            node.margin, node.any_heading = margin_at(node.x, node.y, node.theta, scene, model.room)
        state = (node.x, node.y, node.theta, node.v, node.omega)
        if search.is_robust and model.law == CLOSED_LOOP:
            sample = shortened(sample, node.x, node.y, index.places[place].failures, model.look_ahead)
        extension = extend(state, (node.margin, node.any_heading), sample, node.first_child, tree, scene, model, steps)
        if node.first_child == UNTRIED:
            node.first_child = NO_CHILD
        search.drawn += 1
        search.samples += 1
        is_late = is_bounded and is_over_bound(node.total_steps, extension, search.most_steps, model)
        if extension.outcome == EXTENDED and not is_late:
            number = search.nodes
            new = tree[number]
            new.x, new.y, new.theta, new.v, new.omega = extension.state
            new.v_command, new.omega_command = extension.command
            new.control[0], new.control[1], new.control[2] = extension.control
            new.steps = extension.steps
            add_node(tree, index, number, parent)
            if model.law != STEERING:  # which drives by several rates and takes one
                new.margin, new.any_heading = steps.margin, steps.any_heading
            search.nodes += 1
            if is_manoeuvre(extension.control) or in_goal(model.goal, new.x, new.y, new.theta, new.v, new.omega):
                return GROW_REACHED
            continue
        index.places[place].failures += 1
        if extension.outcome == REFUSED:
            search.refusals += 1
        else:
            search.collisions += 1
    return GROW_PAUSED
