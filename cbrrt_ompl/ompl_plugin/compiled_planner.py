"""The compiled search as a planner of OMPL: what SimpleSetup, Benchmark and PlannerData take like any other."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.motion.model import STEERING
from cbrrt_ompl.ompl_plugin.asked_search import AskedSearch
from cbrrt_ompl.ompl_plugin.binding import ob, oc, ou
from cbrrt_ompl.ompl_plugin.extender import Extender
from cbrrt_ompl.ompl_plugin.goals import region_of
from cbrrt_ompl.ompl_plugin.space import read_state, write_state
from cbrrt_ompl.ompl_plugin.user_parts import (
    Query,
    check_control_sampler,
    check_parts,
    check_sampling,
    is_same_part,
    query_of,
)
from cbrrt_ompl.ompl_plugin.warm_up import warm_up
from cbrrt_ompl.planners.registry import planner_named, scenario_for
from cbrrt_ompl.planners.search import Search
from cbrrt_ompl.planners.warm_up import warm_up as warm_up_search
from cbrrt_ompl.problem.settings import State
from cbrrt_ompl.scenario.scenario import Scenario


class CompiledPlanner(ob.Planner):  # type: ignore[misc]  # OMPL has no type information
    """CB-RRT or S-RRT as one compiled loop.

    It plans for robot, world and settings of its scenario, from the valid start states of the problem definition to its
    goal, and owns its random numbers, seeded by those of OMPL. Step, longest duration, validity checker, propagator and
    goal are those that are there at ``solve``. As long as they are ours (and the goal one that the kernels know), the
    compiled loop does everything; where a user has put others in their place, the kernels choose samples, nodes and
    controls, and OMPL's parts judge each step between their calls, at a fraction of the speed.

    ``solve`` goes on with the tree that is there, unless ``clear`` was called or starts, goal or parts have changed.

    Attributes:
        search: the search of the present tree; None before the first ``solve``.
    """

    def __init__(self, si: Any, scenario: Scenario, name: str, seed: int | None = None) -> None:
        """Take over the scenario.

        Args:
            si: the space information of the problem.
            scenario: robot, world and settings.
            name: of a compiled planner.
            seed: of the first tree; the next ones go on from there. None takes one of those that OMPL deals out.
        """
        super().__init__(si, name)
        self.search: Search | None = None
        self._scenario, self._seed = scenario_for(name, scenario), seed
        self._kind = name  # the name may be changed
        self._starts: list[State] = []
        self._query: Query | None = None
        self._goal: tuple[Any, Any] = (None, None)

    def setup(self) -> None:
        """Compile, and refuse what this planner cannot take.

        Raises:
            SettingsError: see :func:`cbrrt_ompl.ompl_plugin.user_parts.check_parts`,
                :func:`cbrrt_ompl.ompl_plugin.user_parts.check_control_sampler` and
                :func:`cbrrt_ompl.ompl_plugin.user_parts.check_sampling`.
        """
        warm_up()
        warm_up_search()
        self._check()
        super().setup()

    def clear(self) -> None:
        """Forget the tree."""
        super().clear()
        if self.search is not None:
            self._next_seed()
        self.search = None

    def solve(self, condition: Any, *interval: Any) -> Any:
        """Grow the tree until it reaches the goal, ``max_samples`` more are drawn or the condition holds.

        Args:
            condition: OMPL's condition, a function, or a time [s].
            interval: of looking at a function, as OMPL has it; not needed here.
        """
        self.checkValidity()
        problem = self.getProblemDefinition()
        self._check()
        should_stop = condition if callable(condition) else ob.timedPlannerTerminationCondition(float(condition))
        self._forget_what_has_changed(problem)
        if self.search is None:
            self._starts = self._valid_starts(problem)
            if not self._starts:
                return ob.PlannerStatus(ob.PlannerStatus.INVALID_START)
            self.search = self._new_search(self._starts)
        self.search.run(lambda _: bool(should_stop()), self.search.samples + self._max_samples)
        if not self.search.has_reached_goal:
            return ob.PlannerStatus(ob.PlannerStatus.TIMEOUT)
        self._conclude(problem, lambda: bool(should_stop()))
        return ob.PlannerStatus(ob.PlannerStatus.EXACT_SOLUTION)

    def _check(self) -> None:
        """Refuse what this planner cannot take."""
        si = self.getSpaceInformation()
        check_parts(si, self._scenario, self._kind)
        check_control_sampler(si.getControlSpace(), self._kind)
        check_sampling(si.getStateSpace(), self._kind)

    def _conclude(self, problem: Any, should_stop: Callable[[], bool]) -> None:
        """Hand over the solution; what is left of the time may be used."""
        problem.addSolutionPath(self._path(), False, 0.0, self.getName())

    def _next_seed(self) -> None:
        """Give the next tree another seed."""
        if self._seed is not None:
            self._seed += 1

    @property
    def _max_samples(self) -> int:
        """Samples that a tree may draw at once."""
        return self._scenario.planning.filled().max_samples

    def _forget_what_has_changed(self, problem: Any) -> None:
        """Drop the tree if it was grown for other starts, another goal or other parts."""
        query, goal = query_of(problem), problem.getGoal()
        region = region_of(goal, self.getSpaceInformation().getStateSpace())
        if self.search is not None:
            is_same = self._query is not None and self._query.is_continued_by(query)
            is_same = is_same and self._query is not None and len(self._query.starts) == len(query.starts)
            is_same = is_same and is_same_part(self._goal[0], goal, "ompl::base::Goal") and self._goal[1] == region
            if not is_same or (self.search.has_reached_goal and not self._ends_in(goal)):
                self.clear()
        self._query, self._goal = query, (goal, region)

    def _valid_starts(self, problem: Any) -> list[State]:
        """The starts at which OMPL's planners would begin."""
        si = self.getSpaceInformation()
        starts = (problem.getStartState(i) for i in range(problem.getStartStateCount()))
        return [read_state(start) for start in starts if si.satisfiesBounds(start) and si.isValid(start)]

    def _new_search(self, starts: list[State], most_steps: float = math.inf) -> Search:
        """A search from valid starts: compiled, or with OMPL's parts asked where they are a user's.

        Args:
            starts: at least one.
            most_steps: of a way into the goal, which bounds the compiled search alone: how fast a user's propagator is
                and where a user's goal is, nobody knows.
        """
        si, scenario = self.getSpaceInformation(), self._scenario
        extender = Extender(
            si,
            scenario.robot,
            scenario.world,
            scenario.planning,
            kinematic=planner_named(self._kind).law(scenario.planning) == STEERING,
            ompl_goal=self._goal[0],
        )
        settings: dict[str, Any] = {
            "seed": ou.RNG().getLocalSeed() if self._seed is None else self._seed,
            "goal_bias": scenario.planning.filled().goal_bias,
            "robust": planner_named(self._kind).is_robust,
        }
        if extender.is_compiled:
            neighbours = scenario.planning.nearest_neighbour
            world, footprint = scenario.world, scenario.robot.footprint
            search = Search(extender.model, world, footprint, starts, neighbours=neighbours, **settings)
            search.bound(most_steps)
            return search
        return AskedSearch(extender, si, self._goal[0], scenario, starts, **settings)

    def _ends_in(self, goal: Any) -> bool:
        """Whether the node added last is in a goal."""
        assert self.search is not None
        state = self._state(self.search.edges()[0][-1])  # named, for OMPL sees only what it points to
        return bool(goal.isSatisfied(state()))

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
                duration = float(steps[node] * self.search.model["dt"][0])
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
            path.append(state(), control, float(steps[node] * self.search.model["dt"][0]))
            self.getSpaceInformation().getControlSpace().freeControl(control)
        return path

    def _state(self, values: NDArray[np.float64]) -> Any:
        """A state of OMPL's, shape of the values (5,)."""
        state = ob.State(self.getSpaceInformation().getStateSpace())
        write_state(state(), State(*values.tolist()))
        return state

    def _control(self, values: NDArray[np.float64]) -> Any:
        """A control of OMPL's, to be freed, from (3,) values of which it takes as many as it has."""
        space = self.getSpaceInformation().getControlSpace()
        control = space.allocControl()
        for i in range(space.getDimension()):
            control[i] = float(values[i])
        return control
