"""The compiled loop: Algorithms I and II of the paper over flat arrays.

The robust kind departs from the paper in one line: what is extended is the nearest place that is not passed over, and
the more extensions from a place have failed, the likelier it is passed over (docs/robust.md).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cbrrt_ompl.collision.clearance_map import unpack_view
from cbrrt_ompl.collision.motion_check import ASK, BLOCKED
from cbrrt_ompl.motion.manoeuvres import is_manoeuvre
from cbrrt_ompl.motion.model import CLOSED_LOOP, in_goal, unpack_model
from cbrrt_ompl.planners.extension import EXTENDED, NO_CHILD, REFUSED, UNTRIED, extend
from cbrrt_ompl.planners.nearest import KD_TREE, Index, insert, nearest

REACHED, WANT_ANSWER, WANT_ROOM, WANT_DRAWS, PAUSED = 0, 1, 2, 3, 4
"""Why the loop returns: a node in the goal, a question to FCL, full arrays, no random numbers left, enough for now."""

DRAWS, ROBUST_DRAWS = 4, 5
"""Random numbers of a sample: goal bias, x, y, the choice among nodes at one position; and how many
failures of a place it bears."""

NOT_INDEXED = 2**31 - 1
"""Robust: failures of a node that its place stands for, so that brute force finds no other nodes than the indexes."""

NODES, SAMPLES, DRAWN, REFUSALS, COLLISIONS, MANOEUVRE = 0, 1, 2, 3, 4, 5
"""Counters of a search: nodes, samples, rows of draws used up, extensions refused by line 5, and cut by obstacles; and
the manoeuvre that led to the last node, 0 if none did."""

COUNTERS = 6


class TreeArrays(NamedTuple):
    """All that is stored of a tree: 92 bytes a node (and 24 more for the references of the closed loop)."""

    states: NDArray[np.float64]
    """(x, y, theta, v, omega), shape (n, 5)."""
    commands: NDArray[np.float64]
    """Command (v, omega) that led here first, shape (n, 2)."""
    references: NDArray[np.float64]
    """Closed loop: reference that led here, shape (n, 3); else of shape (0, 3)."""
    links: NDArray[np.int32]
    """Links of the nearest-neighbour index, shape (n, 2)."""
    parents: NDArray[np.int32]
    """Parent, -1 at a root, shape (n,)."""
    steps: NDArray[np.int32]
    """Integration steps of the edge that led here, 0 at a root, shape (n,)."""
    first_child: NDArray[np.int32]
    """Latest child, `NO_CHILD` or `UNTRIED` if there is none, shape (n,)."""
    siblings: NDArray[np.int32]
    """Next older child of the same parent, -1 at the end, shape (n,)."""
    twins: NDArray[np.int32]
    """Next node at exactly the same position, -1 at the end, shape (n,)."""
    places: NDArray[np.int32]
    """The indexed node at the same position: the head of the chain of twins, shape (n,)."""


@njit(cache=True)
def add_node(tree: TreeArrays, index: Index, node: int, parent: int) -> None:
    """Link a node whose state, command and steps are there already.

    A node at exactly the position of its parent or of a sibling becomes a twin of it, all others enter the index.
    """
    tree.parents[node] = parent
    tree.first_child[node] = UNTRIED
    tree.siblings[node] = -1
    tree.twins[node] = -1
    tree.places[node] = node
    if parent >= 0:
        tree.siblings[node] = tree.first_child[parent]
        tree.first_child[parent] = node
        x, y = tree.states[node, 0], tree.states[node, 1]
        near = parent
        sibling = tree.siblings[node]
        while sibling >= 0 and not (tree.states[near, 0] == x and tree.states[near, 1] == y):
            near, sibling = sibling, tree.siblings[sibling]
        if tree.states[near, 0] == x and tree.states[near, 1] == y:
            place = tree.places[near]
            tree.places[node] = place
            tree.twins[node] = tree.twins[place]
            tree.twins[place] = node
            return
    insert(index, node)


@njit(cache=True)
def one_of_twins(tree: TreeArrays, place: int, draw: float) -> int:
    """A node at the position of an indexed one, all equally likely.

    Args:
        tree: the tree.
        place: the indexed node.
        draw: random number in [0, 1).

    Note:
        The paper does not say which of several nearest nodes is extended; this reading is PAPER's.
    """
    count, node = 0, place
    while node >= 0:
        count += 1
        node = tree.twins[node]
    skip, node = int(draw * count), place
    for _ in range(skip):
        node = tree.twins[node]
    return node


@njit(cache=True)
def bearable_failures(draw: float) -> float:
    """Most failures with which a place is not passed over: one with f failures is with the chance f / (1 + f).

    Args:
        draw: random number in [0, 1), the same for all places.
    """
    return 1.0 / draw - 1.0 if draw > 0.0 else math.inf


@njit(cache=True)
def rebuild_index(tree: TreeArrays, index: Index, count: int) -> None:
    """Enter all nodes that stand for their position into an empty index."""
    for node in range(count):
        if tree.places[node] == node:
            insert(index, node)


@njit(cache=True)
def grow(
    states: NDArray[np.float64],
    commands: NDArray[np.float64],
    references: NDArray[np.float64],
    links: NDArray[np.int32],
    parents: NDArray[np.int32],
    steps: NDArray[np.int32],
    first_child: NDArray[np.int32],
    siblings: NDArray[np.int32],
    twins: NDArray[np.int32],
    places: NDArray[np.int32],
    failures: NDArray[np.int32],
    heads: NDArray[np.int32],
    occupied: NDArray[np.int64],
    stack: NDArray[np.float64],
    kind: int,
    cell: float,
    packed_model: NDArray[np.float64],
    goal_bias: float,
    children: NDArray[np.int32],
    clearances: NDArray[np.float64],
    frame: NDArray[np.float64],
    draws: NDArray[np.float64],
    findings: NDArray[np.float64],
    counters: NDArray[np.int64],
    last_sample: int,
    question: NDArray[np.float64],
    scratch: NDArray[np.float64],
) -> int:
    """Draw samples and extend the tree until something is wanted.

    Args:
        states: this and the arrays up to ``places``: see :class:`TreeArrays`.
        commands: see above.
        references: see above.
        links: see above.
        parents: see above.
        steps: see above.
        first_child: see above.
        siblings: see above.
        twins: see above.
        places: see above.
        failures: failed extensions from each place, kept at its indexed node, shape (n,): the tree grows robustly; of
            shape (0,) where it does not.
        heads: this and the next: see :class:`cbrrt_ompl.planners.nearest.Index`.
        occupied: see above.
        stack: room for the k-d tree's search.
        kind: of the index.
        cell: side of a cell of the grid [m].
        packed_model: see :func:`cbrrt_ompl.motion.model.pack_model`.
        goal_bias: share of samples that are the goal.
        children: this and the next two: the clearance map.
        clearances: see above.
        frame: see above.
        draws: random numbers in [0, 1), a sample a row, shape (m, DRAWS), or (m, ROBUST_DRAWS).
        findings: what was found before in the present extension, see :func:`cbrrt_ompl.collision.motion_check.recall`.
        counters: see `NODES`; carried from call to call, shape (COUNTERS,).
        last_sample: number of samples to pause at.
        question: takes the pose that FCL must decide, shape (3,).
        scratch: room for a block of steps, see :mod:`cbrrt_ompl.planners.roll_out`.

    Returns:
        `REACHED` (the last node is in the goal), `WANT_ANSWER`, `WANT_ROOM`, `WANT_DRAWS` or `PAUSED`. After a question
        the same extension is repeated.
    """
    tree = TreeArrays(states, commands, references, links, parents, steps, first_child, siblings, twins, places)
    model = unpack_model(packed_model)
    view = unpack_view(children, clearances, frame)
    index = Index(kind, states, links, heads, occupied, view.x_min, view.y_min, cell)
    is_robust = len(failures) > 0
    width, height = view.x_max - view.x_min, view.y_max - view.y_min
    while counters[SAMPLES] < last_sample:
        if counters[NODES] == len(states) or (kind == KD_TREE and occupied[0] + 2 > len(stack)):
            return WANT_ROOM
        if counters[DRAWN] == len(draws):
            return WANT_DRAWS
        draw = draws[counters[DRAWN]]
        x, y = view.x_min + draw[1] * width, view.y_min + draw[2] * height
        if draw[0] < goal_bias:
            x, y = model.goal.x, model.goal.y
        if is_robust:  # the root where all are passed over
            place = max(nearest(index, x, y, counters[NODES], stack, failures, bearable_failures(draw[4])), 0)
        else:
            place = nearest(index, x, y, counters[NODES], stack, None, 0.0)
        parent = one_of_twins(tree, place, draw[3])
        origin = (
            states[parent, 0],
            states[parent, 1],
            states[parent, 2],
            states[parent, 3],
            states[parent, 4],
        )
        extension = extend(origin, x, y, first_child[parent], siblings, commands, model, view, findings, scratch)
        if extension.outcome == ASK:
            question[0], question[1], question[2] = extension.control
            return WANT_ANSWER
        findings[0] = 0.0
        if first_child[parent] == UNTRIED:
            first_child[parent] = NO_CHILD
        counters[DRAWN] += 1
        counters[SAMPLES] += 1
        if is_robust and extension.outcome != EXTENDED:
            failures[place] += 1
        if extension.outcome == REFUSED:
            counters[REFUSALS] += 1
        elif extension.outcome == BLOCKED:
            counters[COLLISIONS] += 1
        else:
            node = counters[NODES]
            x, y, theta, v, omega = extension.state
            states[node, 0], states[node, 1], states[node, 2], states[node, 3], states[node, 4] = x, y, theta, v, omega
            commands[node, 0], commands[node, 1] = extension.command
            if model.law == CLOSED_LOOP:
                references[node, 0], references[node, 1], references[node, 2] = extension.control
            steps[node] = extension.steps
            add_node(tree, index, node, parent)
            if is_robust:
                failures[node] = 0 if places[node] == node else NOT_INDEXED
            counters[NODES] += 1
            if in_goal(model.goal, x, y, theta, v, omega):
                if is_manoeuvre(extension.control):
                    counters[MANOEUVRE] = int(extension.control[2])
                return REACHED
    return PAUSED
