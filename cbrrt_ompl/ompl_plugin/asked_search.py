"""The search of the compiled planners with every extension offered to OMPL's parts between the kernels' calls."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from cbrrt_ompl.motion.model import CLOSED_LOOP
from cbrrt_ompl.ompl_plugin.binding import ob
from cbrrt_ompl.ompl_plugin.extender import Extender
from cbrrt_ompl.ompl_plugin.space import bounds_of, read_state, write_state
from cbrrt_ompl.planners.extension import EXTENDED, NO_CHILD, REFUSED, UNTRIED
from cbrrt_ompl.planners.growth import add_node, one_of_twins, shortened, tolerated_failures
from cbrrt_ompl.planners.nearest import nearest
from cbrrt_ompl.planners.search import Search
from cbrrt_ompl.problem.settings import State
from cbrrt_ompl.scenario.scenario import Scenario


class AskedSearch(Search):
    """A search in which a user's validity checker, propagator or goal has a say.

    It is :func:`cbrrt_ompl.planners.growth.grow` in Python: samples, nearest nodes and failures are the same, and an
    extension is what `Extender` makes of it. Nodes may lie outside of the world, so that they are not indexed.
    """

    def __init__(
        self, extender: Extender, si: Any, goal: Any, scenario: Scenario, starts: Sequence[State], **settings: Any
    ) -> None:
        """Plant the start states.

        Args:
            extender: extends nodes, and has looked at the parts.
            si: the space information.
            goal: OMPL's goal.
            scenario: world and robot.
            starts: states of the roots.
            settings: see :class:`cbrrt_ompl.planners.search.Search`.
        """
        super().__init__(
            extender.model, scenario.world, scenario.robot.footprint, starts, neighbours="brute-force", **settings
        )
        self._extender, self._ompl_goal = extender, goal
        self._source = ob.State(si.getStateSpace())
        self._goal_sample = ob.State(si.getStateSpace())
        self._low_high = bounds_of(si.getStateSpace())[:4]

    def _grow(self, last_sample: int) -> None:
        """Add samples up to a number, or until a node is in the goal."""
        search = self._search
        while self.samples < last_sample and not self.has_reached_goal:
            if self.nodes == len(self._tree):
                self._make_room()
            if search["drawn"][0] == len(self._draws):
                self._draw_more()
            draw = self._draws[search["drawn"][0]].tolist()
            search["drawn"] += 1
            search["samples"] += 1
            self._add_sample(draw)

    def _add_sample(self, draw: list[float]) -> None:
        """Extend the node nearest to a sample."""
        x, y = self._sample(draw)
        most_failures = tolerated_failures(draw[4]) if self._search["is_robust"][0] else math.inf
        place = max(nearest(self._index, x, y, self.nodes, most_failures, math.inf), 0)
        parent = one_of_twins(self._tree, place, draw[3])
        node, state = self._tree[parent], self._state_of(parent)
        if self._search["is_robust"][0] and self.model["law"][0] == CLOSED_LOOP:
            failures = int(self._index.places["failures"][place])
            x, y = shortened((x, y), state.x, state.y, failures, self.model["look_ahead"][0])
        first_child = int(node["first_child"])
        write_state(self._source, state)
        outcome = self._extender.extend(self._source(), np.array(state), x, y, first_child, self._tree)
        if first_child == UNTRIED:
            node["first_child"] = NO_CHILD
        if outcome == EXTENDED:
            self._add_end(parent)
            return
        self._search["refusals" if outcome == REFUSED else "collisions"] += 1
        self._index.places["failures"][place] += 1

    def _sample(self, draw: list[float]) -> tuple[float, float]:
        """The position of a sample, or of a goal."""
        goal = self._ompl_goal
        if draw[0] < self._search["goal_bias"][0] and isinstance(goal, ob.GoalSampleableRegion) and goal.canSample():
            goal.sampleGoal(self._goal_sample())
            return read_state(self._goal_sample)[:2]
        x_low, y_low, x_high, y_high = self._low_high
        return x_low + draw[1] * (x_high - x_low), y_low + draw[2] * (y_high - y_low)

    def _add_end(self, parent: int) -> None:
        """Add the end of the last extension."""
        extender, number = self._extender, self.nodes
        new = self._tree[number]
        for name, value in zip(State._fields, extender.end.tolist(), strict=True):
            new[name] = value
        new["v_command"], new["omega_command"] = extender.command
        new["control"], new["steps"] = extender.control, extender.steps
        add_node(self._tree, self._index, number, parent)
        self._search["nodes"] += 1
        write_state(self._source, self._state_of(number))
        self.has_reached_goal = bool(self._ompl_goal.isSatisfied(self._source()))

    def _state_of(self, number: int) -> State:
        """State of a node."""
        node = self._tree[number]
        return State(*(float(node[name]) for name in State._fields))
