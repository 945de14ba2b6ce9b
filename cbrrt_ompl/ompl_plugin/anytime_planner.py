"""cb-rrt-anytime and cb-rrt-ao as planners of OMPL: plan after plan, and the best of them by an objective of OMPL's."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from cbrrt_ompl.ompl_plugin.binding import ob
from cbrrt_ompl.ompl_plugin.compiled_planner import CompiledPlanner
from cbrrt_ompl.ompl_plugin.duration_objective import DurationObjective
from cbrrt_ompl.planners.bounded import TREE_SAMPLES
from cbrrt_ompl.planners.registry import planner_named


class Progress(NamedTuple):
    """When a solution was found."""

    time: float
    """Since the beginning of ``solve`` [s]."""
    cost: float
    """By the objective of the problem definition."""


class AnytimePlanner(CompiledPlanner):
    """CB-RRT that goes on after its first solution, tree after tree, while ``solve``'s time lasts.

    The objective of the problem definition decides which solution is better, and ends the search where its cost
    threshold is met; without one the duration does. Each better solution goes to the problem definition's callback for
    intermediate solutions, the best one into the problem definition. Its tree is the one that is kept.

    Where the planner is bounded and the objective is the duration, a tree keeps only what may be quicker than the best.

    Attributes:
        progress: the solutions of the last ``solve``, each better than the one before.
    """

    def __init__(self, *arguments: Any) -> None:
        """See :class:`CompiledPlanner`."""
        super().__init__(*arguments)
        self.progress: list[Progress] = []

    def solve(self, condition: Any, *interval: Any) -> Any:
        """Look for better and better solutions until the condition holds or the objective is satisfied.

        Args:
            condition: OMPL's condition, a function, or a time [s].
            interval: of looking at a function, as OMPL has it; not needed here.
        """
        self.progress, self._began = [], time.perf_counter()
        return super().solve(condition, *interval)

    def _conclude(self, problem: Any, should_stop: Callable[[], bool]) -> None:
        """Go on from the first solution, and hand over the best."""
        has_objective = problem.hasOptimizationObjective()
        objective = (
            problem.getOptimizationObjective() if has_objective else DurationObjective(self.getSpaceInformation())
        )
        is_bounded = planner_named(self._kind).is_bounded and isinstance(objective, DurationObjective)
        assert self.search is not None
        best, best_path = self.search, self._path()
        best_cost = self._report(problem, objective, best_path)
        while not objective.isSatisfied(best_cost) and not should_stop():
            self._next_seed()
            self.search = self._new_search(self._starts, int(best.total_steps[-1]) - 1 if is_bounded else math.inf)
            self.search.run(lambda _: bool(should_stop()), TREE_SAMPLES if is_bounded else self._max_samples)
            if not self.search.has_reached_goal:
                continue
            path = self._path()
            if objective.isCostBetterThan(cost_of(path, objective), best_cost):
                best, best_path = self.search, path
                best_cost = self._report(problem, objective, path)
        self.search = best
        solution = ob.PlannerSolution(best_path)
        solution.setPlannerName(self.getName())
        solution.setOptimized(objective, best_cost, objective.isSatisfied(best_cost))
        problem.addSolutionPath(solution)

    def _report(self, problem: Any, objective: Any, path: Any) -> Any:
        """Tell of a better solution; its cost."""
        cost = cost_of(path, objective)
        self.progress.append(Progress(time.perf_counter() - self._began, cost.value()))
        states = ob.vectorConstState()
        for i in range(path.getStateCount()):
            states.append(path.getState(i))
        try:
            problem.getIntermediateSolutionCallback()(self, states, cost)
        except RuntimeError as error:  # how an empty std::function answers; Python cannot see that it is empty
            if str(error) != "bad_function_call":
                raise
        return cost


def cost_of(path: Any, objective: Any) -> Any:
    """What a control path costs: the objective's sum over its states, an integration step apart."""
    return path.asGeometric().cost(objective)
