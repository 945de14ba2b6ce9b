"""A search by the compiled loop: its memory, its questions to FCL, its time."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.collision.clearance_map import ClearanceMap
from cbrrt_ompl.motion.model import CLOSED_LOOP
from cbrrt_ompl.planners.growth import (
    COUNTERS,
    DRAWN,
    DRAWS,
    MANOEUVRE,
    NODES,
    REACHED,
    ROBUST_DRAWS,
    SAMPLES,
    WANT_ANSWER,
    WANT_DRAWS,
    WANT_ROOM,
    TreeArrays,
    add_node,
    grow,
    rebuild_index,
)
from cbrrt_ompl.planners.nearest import GRID, KD_TREE, KINDS, Index
from cbrrt_ompl.planners.roll_out import SCRATCH_SHAPE
from cbrrt_ompl.problem.settings import State
from cbrrt_ompl.trajectory.replay import trajectory_from_controls, tree_from_controls
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.trajectory.tree import Tree

DRAWS_AT_ONCE = 4096
"""Samples whose random numbers are drawn at once, at most."""

PAUSE = 0.002
"""Aim for the time between two looks at the clock [s]."""

FIRST_CAPACITY = 256
"""Nodes that a search has room for at first; doubled when full."""

ROBUST = "cb-rrt-robust"
"""Name of the planner whose search is robust."""

COMPILED_PLANNERS = ("cb-rrt-compiled", "s-rrt-compiled", ROBUST)
"""Planners that are one compiled loop and need no OMPL."""


class Search:
    """One tree, grown by the compiled loop.

    Attributes:
        counters: nodes, samples and more, see :mod:`cbrrt_ompl.planners.growth`.
        failures: robust: failed extensions from each place, see :mod:`cbrrt_ompl.planners.growth`; 4 bytes a node.
        has_reached_goal: whether the last node is in the goal region.
    """

    def __init__(
        self,
        model: NDArray[np.float64],
        clearance_map: ClearanceMap,
        starts: Sequence[State],
        seed: int | None = None,
        *,
        goal_bias: float = 0.0,
        neighbours: str = "grid",
        robust: bool = False,
    ) -> None:
        """Plant the start states.

        Args:
            model: packed model, see :func:`cbrrt_ompl.motion.model.pack_model`.
            clearance_map: decides the states.
            starts: states of the roots.
            seed: of the search's own generator; None draws a fresh one.
            goal_bias: share of samples that are the goal.
            neighbours: `grid`, `kd-tree` or `brute-force`.
            robust: whether places are passed over the likelier, the more extensions from there have failed.
        """
        self.model, self._map = model, clearance_map
        self._rng = np.random.default_rng(seed)
        self._goal_bias = goal_bias
        self._kind = KINDS[neighbours]
        self._is_closed_loop = int(model[0]) == CLOSED_LOOP
        self._draws: NDArray[np.float64] = np.empty((0, ROBUST_DRAWS if robust else DRAWS))
        self._question = np.empty(3)
        self._scratch = np.empty(SCRATCH_SHAPE)
        self.counters = np.zeros(COUNTERS, dtype=np.int64)
        self.has_reached_goal = False
        self._tree = _tree_arrays(FIRST_CAPACITY, self._is_closed_loop)
        self.failures: NDArray[np.int32] = np.zeros(FIRST_CAPACITY if robust else 0, dtype=np.int32)
        self._make_index(FIRST_CAPACITY)
        for node, start in enumerate(starts):
            self._tree.states[node] = start
            self._tree.steps[node] = 0
            add_node(self._tree, self._index, node, -1)
            self.counters[NODES] += 1

    def run(self, should_stop: Callable[[int], bool], max_samples: int) -> None:
        """Grow the tree until a node is in the goal region.

        Args:
            should_stop: asked every few milliseconds with the samples so far.
            max_samples: total of samples to stop at.
        """
        portion = 64
        while not self.has_reached_goal and self.counters[SAMPLES] < max_samples:
            if should_stop(self.samples):
                return
            before, began = self.samples, time.perf_counter()
            self._grow(min(max_samples, before + portion), began + 2.0 * PAUSE, should_stop)
            elapsed = max(time.perf_counter() - began, 1e-6)
            done = self.samples - before
            portion = int(min(max(16, done * PAUSE / elapsed), 4 * portion))

    def _grow(self, last_sample: int, deadline: float, should_stop: Callable[[int], bool]) -> None:
        """Run the loop up to a number of samples, or until the deadline passes while FCL is asked.

        An extension that takes longer goes on, unless the search is to stop; it is then begun anew if that goes on.
        """
        t, m = self._tree, self._map
        asked_at, first_sample = -1, self.samples
        m.forget_findings()
        while True:
            status = grow(
                *t,
                self.failures,
                self._index.heads,
                self._index.occupied,
                self._stack,
                self._kind,
                self._index.cell,
                self.model,
                self._goal_bias,
                m.children,
                m.clearances,
                m.frame,
                self._draws,
                m.findings,
                self.counters,
                last_sample,
                self._question,
                self._scratch,
            )
            if status == WANT_ANSWER:
                is_new = self.samples != asked_at
                if time.perf_counter() > deadline:
                    if (is_new and self.samples > first_sample) or should_stop(self.samples):
                        return
                    deadline = time.perf_counter() + PAUSE
                asked_at = self.samples
                m.answer(*self._question.tolist())
            elif status == WANT_DRAWS:
                rows, columns = self._draws.shape
                self._draws = self._rng.random((min(max(2 * rows, 256), DRAWS_AT_ONCE), columns))
                self.counters[DRAWN] = 0
            elif status == WANT_ROOM:
                self._make_room()
                t = self._tree
            else:
                self.has_reached_goal = status == REACHED
                return

    def _make_room(self) -> None:
        """Double the arrays and enter the nodes into a finer index."""
        count, capacity = int(self.counters[NODES]), 2 * len(self._tree.states)
        larger = _tree_arrays(capacity, self._is_closed_loop)
        for name in TreeArrays._fields:
            old = getattr(self._tree, name)
            getattr(larger, name)[: len(old)] = old
        self.failures = np.concatenate([self.failures, np.zeros_like(self.failures)])
        occupied = self._index.occupied
        self._tree = larger
        self._make_index(capacity, int(occupied[0]))
        if self._kind == GRID:
            rebuild_index(larger, self._index, count)
        else:
            self._index.occupied[:] = occupied  # its links are in the arrays

    def _make_index(self, capacity: int, depth: int = 0) -> None:
        """An empty index with about one cell a node."""
        x0, y0, x1, y1 = self._map.frame[:4].tolist()
        cell = math.sqrt((x1 - x0) * (y1 - y0) / capacity)
        shape = (1, 1)
        if self._kind == GRID:
            shape = (math.ceil((y1 - y0) / cell), math.ceil((x1 - x0) / cell))
        heads = np.full(shape, -1, dtype=np.int32)
        limits = [2**31, -1, 2**31, -1, 0] if self._kind == GRID else [0, 0, 0, 0, 0]
        occupied = np.array(limits, dtype=np.int64)
        t = self._tree
        self._index = Index(self._kind, t.states, t.links, heads, occupied, x0, y0, cell)
        self._stack = np.empty((2 * depth + 64 if self._kind == KD_TREE else 0, 3))

    @property
    def nodes(self) -> int:
        """Nodes of the tree."""
        return int(self.counters[NODES])

    @property
    def samples(self) -> int:
        """Samples drawn so far."""
        return int(self.counters[SAMPLES])

    def edges(self) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
        """States (n, 5), parents (n,), controls (n, 3) and steps (n,) of all nodes."""
        n, t = self.nodes, self._tree
        controls = t.references[:n] if self._is_closed_loop else np.pad(t.commands[:n], ((0, 0), (0, 1)))
        if self.counters[MANOEUVRE]:
            controls[-1] = 0.0, 0.0, self.counters[MANOEUVRE]
        return t.states[:n], t.parents[:n].astype(np.int64), controls, t.steps[:n].astype(np.int64)

    def path_to(self, node: int) -> list[int]:
        """Nodes from a root to a node."""
        path = [node]
        while self._tree.parents[path[-1]] >= 0:
            path.append(int(self._tree.parents[path[-1]]))
        return path[::-1]

    def trajectory(self) -> Trajectory:
        """The way from the root to the node that was added last."""
        path = self.path_to(self.nodes - 1)
        states, _, controls, steps = self.edges()
        return trajectory_from_controls(states[path[0]], controls[path[1:]], steps[path[1:]], self.model)

    def tree(self) -> Tree:
        """All nodes, with the way along every edge."""
        return tree_from_controls(*self.edges(), self.model)


def _tree_arrays(capacity: int, is_closed_loop: bool) -> TreeArrays:
    """Arrays for some nodes; their contents are undefined."""
    return TreeArrays(
        states=np.empty((capacity, 5)),
        commands=np.zeros((capacity, 2)),
        references=np.zeros((capacity if is_closed_loop else 0, 3)),
        links=np.empty((capacity, 2), dtype=np.int32),
        parents=np.empty(capacity, dtype=np.int32),
        steps=np.empty(capacity, dtype=np.int32),
        first_child=np.empty(capacity, dtype=np.int32),
        siblings=np.empty(capacity, dtype=np.int32),
        twins=np.empty(capacity, dtype=np.int32),
        places=np.empty(capacity, dtype=np.int32),
    )
