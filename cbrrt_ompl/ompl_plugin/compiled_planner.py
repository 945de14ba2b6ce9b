"""The compiled search as a planner of OMPL: what SimpleSetup, Benchmark and PlannerData take like any other."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.motion.model import make_model
from cbrrt_ompl.ompl_plugin.binding import ob, oc
from cbrrt_ompl.ompl_plugin.reals import StateReals
from cbrrt_ompl.ompl_plugin.space import STATE_DIMENSION, set_state
from cbrrt_ompl.planners.registry import planner_named
from cbrrt_ompl.planners.search import Search
from cbrrt_ompl.problem.settings import State
from cbrrt_ompl.scenario.scenario import Scenario


class CompiledPlanner(ob.Planner):  # type: ignore[misc]  # OMPL has no type information
    """CB-RRT or S-RRT as one compiled loop.

    It plans for the robot, the goal and the settings of its scenario, from the start states of the problem definition,
    and owns its random numbers: OMPL's seed means nothing to it. It keeps its tree from one ``solve`` to the next,
    until ``clear``.

    Attributes:
        search: the search of the present tree; None before the first ``solve``.
    """

    def __init__(self, si: Any, scenario: Scenario, name: str, seed: int | None = None) -> None:
        """Take over the scenario.

        Args:
            si: the space information of the problem.
            scenario: robot, goal and settings.
            name: `cb-rrt-compiled`, `cb-rrt-robust` or `s-rrt-compiled`.
            seed: of the first tree; the next ones go on from there. None draws a fresh one.
        """
        super().__init__(si, name)
        self.search: Search | None = None
        self._scenario = scenario
        row = planner_named(name)
        self._model = make_model(row.law(scenario.planning), scenario.robot, scenario.goal, scenario.planning)
        self._is_robust = row.is_robust
        self._seed = seed

    def clear(self) -> None:
        """Forget the tree."""
        super().clear()
        if self.search is not None and self._seed is not None:
            self._seed += 1
        self.search = None

    def solve(self, condition: Any) -> Any:
        """Grow the tree until it reaches the goal, ``max_samples`` are drawn or the condition holds."""
        self.checkValidity()
        problem = self.getProblemDefinition()
        if self.search is None:
            reals = StateReals(self.getSpaceInformation().getStateSpace(), STATE_DIMENSION)
            starts = []
            for i in range(problem.getStartStateCount()):
                reals.read(problem.getStartState(i))
                starts.append(State(*reals.values.tolist()))
            if not starts:
                return ob.PlannerStatus(ob.PlannerStatus.INVALID_START)
            planning = self._scenario.planning
            self.search = Search(
                self._model,
                self._scenario.world,
                self._scenario.robot.footprint,
                starts,
                self._seed,
                goal_bias=planning.goal_bias,
                neighbours=planning.nearest_neighbour,
                robust=self._is_robust,
            )
        self.search.run(lambda _: bool(condition()), self._scenario.planning.max_samples)
        if not self.search.has_reached_goal:
            return ob.PlannerStatus(ob.PlannerStatus.TIMEOUT)
        problem.addSolutionPath(self._path(), False, 0.0, self.getName())
        return ob.PlannerStatus(ob.PlannerStatus.EXACT_SOLUTION)

    def getPlannerData(self, data: Any) -> None:  # noqa: N802  # OMPL's name
        """Give copies of all nodes and edges away."""
        if self.search is None:
            return
        states, parents, controls, steps = self.search.edges()
        vertices = [self._state(row) for row in states]  # OMPL keeps pointers to these until the data is decoupled
        edges = [self._control(row) for row in controls]
        for node, parent in enumerate(parents.tolist()):
            vertex = ob.PlannerDataVertex(vertices[node]())
            if parent < 0:
                data.addStartVertex(vertex)
                continue
            data.addVertex(vertex)
            if data.hasControls():
                duration = float(steps[node] * self._model["dt"][0])
                data.addEdge(parent, node, oc.PlannerDataEdgeControl(edges[node], duration))
            else:
                data.addEdge(parent, node)
        if self.search.has_reached_goal:
            data.markGoalState(vertices[-1]())
        data.decoupleFromPlanner()
        for control in edges:
            self.getSpaceInformation().getControlSpace().freeControl(control)

    def _path(self) -> Any:
        """The way to the node added last, as OMPL's path."""
        assert self.search is not None
        path = oc.PathControl(self.getSpaceInformation())
        nodes = self.search.path_to(self.search.nodes - 1)
        states, _, controls, steps = self.search.edges()
        state = self._state(states[nodes[0]])  # named, for OMPL sees only what it points to
        path.append(state())
        for node in nodes[1:]:
            state, control = self._state(states[node]), self._control(controls[node])
            path.append(state(), control, float(steps[node] * self._model["dt"][0]))
            self.getSpaceInformation().getControlSpace().freeControl(control)
        return path

    def _state(self, values: NDArray[np.float64]) -> Any:
        """A state of OMPL's, shape of the values (5,)."""
        state = ob.State(self.getSpaceInformation().getStateSpace())
        set_state(state(), State(*values.tolist()))
        return state

    def _control(self, values: NDArray[np.float64]) -> Any:
        """A control of OMPL's, to be freed, from (3,) values of which it takes as many as it has."""
        space = self.getSpaceInformation().getControlSpace()
        control = space.allocControl()
        for i in range(space.getDimension()):
            control[i] = float(values[i])
        return control
