"""A search by the compiled loop: its memory, its random numbers, its time."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from copy import copy

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.motion.laws import raise_errors
from cbrrt_ompl.motion.model import make_model
from cbrrt_ompl.motion.records import Records, put_records, record_array
from cbrrt_ompl.planners.first_plan import FirstPlan
from cbrrt_ompl.planners.growth import (
    BOUNDED_DRAWS,
    DRAWS,
    GROW_REACHED,
    GROW_WANTS_DRAWS,
    GROW_WANTS_ROOM,
    NODE,
    ROBUST_DRAWS,
    SEARCH,
    add_node,
    grow,
)
from cbrrt_ompl.planners.nearest import KINDS, enlarged, make_index
from cbrrt_ompl.planners.reachable import reachable_cells
from cbrrt_ompl.planners.roll_out import STEPS
from cbrrt_ompl.problem.robot import Footprint
from cbrrt_ompl.problem.settings import State
from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.trajectory.replay import trajectory_from_controls, tree_from_controls
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.trajectory.tree import Tree

DRAWS_AT_ONCE = 4096
"""Samples whose random numbers are drawn at once, at most."""

PAUSE = 0.002
"""Aim for the time between two looks at the clock [s]."""

FIRST_CAPACITY = 1024
"""Nodes that a search has room for at first; doubled when full."""


class Search:
    """One tree, grown by the compiled loop.

    Attributes:
        model: see :func:`cbrrt_ompl.motion.model.make_model`.
        has_reached_goal: whether the last node is in the goal region.
    """

    def __init__(
        self,
        model: Records,
        world: World,
        footprint: Footprint,
        starts: Sequence[State],
        seed: int | None = None,
        *,
        goal_bias: float = 0.0,
        neighbours: str = "grid",
        robust: bool = False,
    ) -> None:
        """Plant the start states.

        Args:
            model: one record, see :func:`cbrrt_ompl.motion.model.make_model`.
            world: where the robot may be.
            footprint: its area.
            starts: states of the roots.
            seed: of the search's own generator; None draws a fresh one.
            goal_bias: fraction of samples that are the goal.
            neighbours: `grid`, `kd-tree` or `brute-force`.
            robust: whether places are passed over the likelier, the more extensions from there have failed, and samples
                are drawn only where the robot may get to.
        """
        self.model = model
        self._scene, self._bounds, self._starts = world.scene(footprint), world.bounds, starts
        self._goal_bias, self._neighbours, self._is_robust = goal_bias, neighbours, robust
        self._cells = reachable_cells(self._scene, starts) if robust else None
        self._steps = record_array(1, STEPS)
        self._plant(seed)

    def again(self, seed: int, most_steps: float = math.inf) -> Search:
        """A search like this one from another seed, before its first sample; what is known of the world is shared.

        Args:
            seed: of the other one's own generator.
            most_steps: see :meth:`bound`.
        """
        other = copy(self)
        other._plant(seed)
        other.bound(most_steps)
        return other

    def _plant(self, seed: int | None) -> None:
        """Begin a tree of its own."""
        self.has_reached_goal = False
        self._rng = np.random.default_rng(seed)
        self._draws: NDArray[np.float64] = np.empty((0, ROBUST_DRAWS if self._is_robust else DRAWS))
        self._search = record_array(1, SEARCH)
        self._search["goal_bias"], self._search["is_robust"] = self._goal_bias, self._is_robust
        self._search["most_steps"] = math.inf
        capacity = max(FIRST_CAPACITY, 2 * len(self._starts))
        self._tree = record_array(capacity, NODE)
        self._index = make_index(KINDS[self._neighbours], self._bounds, capacity)
        for number, start in enumerate(self._starts):
            for name, value in zip(State._fields, start, strict=True):
                self._tree[name][number] = value
            add_node(self._tree, self._index, number, -1)
            self._search["nodes"] += 1

    def bound(self, most_steps: float) -> None:
        """Keep only nodes that may be in the goal within so many steps from a root; before the first sample."""
        self._search["most_steps"] = most_steps
        if most_steps < math.inf:
            self._draws = np.empty((0, BOUNDED_DRAWS))

    def run(self, should_stop: Callable[[int], bool], max_samples: float) -> None:
        """Grow the tree until a node is in the goal region.

        Args:
            should_stop: asked every few milliseconds with the samples so far.
            max_samples: total of samples to stop at.
        """
        portion = 64
        while not self.has_reached_goal and self.samples < max_samples:
            if should_stop(self.samples):
                return
            before, began = self.samples, time.perf_counter()
            self._grow(int(min(max_samples, before + portion)))
            elapsed = max(time.perf_counter() - began, 1e-6)
            done = self.samples - before
            portion = int(min(max(16, done * PAUSE / elapsed), 4 * portion))

    def _grow(self, last_sample: int) -> None:
        """Run the loop up to a number of samples."""
        while True:
            status = grow(
                self._tree,
                self._index,
                self._search,
                self._draws,
                last_sample,
                self._scene,
                self.model,
                self._steps,
            )
            if status == GROW_WANTS_DRAWS:
                self._draw_more()
            elif status == GROW_WANTS_ROOM:
                self._make_room()
            else:
                raise_errors()
                self.has_reached_goal = status == GROW_REACHED
                return

    def _draw_more(self) -> None:
        """Draw the next random numbers, more at once each time."""
        rows, columns = self._draws.shape
        self._draws = self._rng.random((min(max(2 * rows, 256), DRAWS_AT_ONCE), columns))
        if self._cells is not None:
            self._draws[:, 1:3] = self._cells.place(self._draws[:, 1:3])
        self._search["drawn"] = 0

    def _make_room(self) -> None:
        """Double the arrays."""
        larger = record_array(2 * len(self._tree), NODE)
        put_records(larger, self._tree[: self.nodes])
        self._tree = larger
        self._index = enlarged(self._index, self._bounds, self.nodes)

    @property
    def nodes(self) -> int:
        """Nodes of the tree."""
        return int(self._search["nodes"][0])

    @property
    def samples(self) -> int:
        """Samples drawn so far."""
        return int(self._search["samples"][0])

    @property
    def total_steps(self) -> NDArray[np.int32]:
        """Integration steps of the way from a root to each node, shape (n,)."""
        steps: NDArray[np.int32] = self._tree["total_steps"][: self.nodes]
        return steps

    @property
    def refusals(self) -> int:
        """Extensions refused by line 5 of Algorithm II so far."""
        return int(self._search["refusals"][0])

    @property
    def collisions(self) -> int:
        """Extensions cut off by an obstacle so far."""
        return int(self._search["collisions"][0])

    @property
    def failures(self) -> NDArray[np.int32]:
        """Failed extensions from each node's place, shape (n,); without meaning for nodes that have none."""
        failures: NDArray[np.int32] = self._index.places["failures"][: self.nodes]
        return failures

    def edges(self) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
        """States (n, 5), parents (n,), controls (n, 3) and steps (n,) of all nodes."""
        nodes = self._tree[: self.nodes]
        states = np.column_stack([nodes[name] for name in State._fields])
        return states, nodes["parent"].astype(np.int64), nodes["control"].copy(), nodes["steps"].astype(np.int64)

    def path_to(self, node: int) -> list[int]:
        """Nodes from a root to a node."""
        path, parents = [node], self._tree["parent"]
        while parents[path[-1]] >= 0:
            path.append(int(parents[path[-1]]))
        return path[::-1]

    def trajectory(self) -> Trajectory:
        """The way from the root to the node that was added last."""
        path = self.path_to(self.nodes - 1)
        states, _, controls, steps = self.edges()
        return trajectory_from_controls(states[path[0]], controls[path[1:]], steps[path[1:]], self.model)

    def tree(self) -> Tree:
        """All nodes, with the way along every edge."""
        return tree_from_controls(*self.edges(), self.model)

    def first_plan(self, planning_time: float) -> FirstPlan:
        """The result of the search so far, in some time [s]."""
        trajectory = self.trajectory() if self.has_reached_goal else None
        return FirstPlan(trajectory, lambda: self.nodes, self.samples, planning_time, self.tree)


def search_in(
    scenario: Scenario, law: int, seed: int | None = None, *, goal_bias: float | None = None, robust: bool = False
) -> Search:
    """A search through a scenario, before its first sample.

    Args:
        scenario: world, robot, start, goal and settings.
        law: how the robot is driven, see :func:`cbrrt_ompl.motion.model.make_model`.
        seed: see :class:`Search`.
        goal_bias: see :class:`Search`; that of the scenario if not given.
        robust: see :class:`Search`.
    """
    planning, robot = scenario.planning.filled(), scenario.robot
    return Search(
        make_model(law, robot, scenario.goal, planning),
        scenario.world,
        robot.footprint,
        [scenario.start],
        seed,
        goal_bias=planning.goal_bias if goal_bias is None else goal_bias,
        neighbours=planning.nearest_neighbour,
        robust=robust,
    )
