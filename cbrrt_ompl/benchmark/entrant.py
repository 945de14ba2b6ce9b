"""A planner of ours or of OMPL's as OMPL's Benchmark runs it: afresh from a seed, and counted."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

from cbrrt_ompl.ompl_plugin.anytime_planner import AnytimePlanner, Progress
from cbrrt_ompl.ompl_plugin.binding import ob, ou
from cbrrt_ompl.ompl_plugin.compiled_planner import CompiledPlanner
from cbrrt_ompl.ompl_plugin.paper_planner import PaperPlanner
from cbrrt_ompl.ompl_plugin.setup import equip, first_solution_objective, make_planner
from cbrrt_ompl.ompl_plugin.space import register_projection
from cbrrt_ompl.planners.registry import is_compiled, scenario_for
from cbrrt_ompl.scenario.scenario import Scenario


class Entrant(ob.Planner):  # type: ignore[misc]  # OMPL has no type information
    """Takes part in a Benchmark for another planner, of which it makes a new one for every run.

    OMPL's Benchmark keeps one planner for all of its runs. The state of that planner's random numbers then depends on
    the runs before, and Syclop's ``clear`` drops its edge costs for good. A new planner a run, made from the run's seed
    as :func:`cbrrt_ompl.plan` makes it, repeats ``plan`` with that seed, and samples can be counted and limited.

    Attributes:
        time_limit: time that a run may take [s]; OMPL's own condition looks at the clock ten times a second only.
        planner: the planner of the present run; None before the first.
        planning_time: time of the last search alone [s].
    """

    def __init__(self, setup: Any, scenario: Scenario, name: str) -> None:
        """Enter a planner.

        Args:
            setup: the ``SimpleSetup`` that all planners of the Benchmark share.
            scenario: world, robot, start, goal and settings.
            name: the planner's name.
        """
        super().__init__(setup.getSpaceInformation(), name)
        self.time_limit = math.inf
        self.planner: Any = None
        self.planning_time = 0.0
        self._setup, self._scenario = setup, scenario_for(name, scenario)
        self._rounds = 0

    def equip(self) -> None:
        """Give the shared space information this planner's propagator and sampler, and take away all others."""
        equip(self.getSpaceInformation(), self._scenario, self.getName())
        if self.getName() == "sst":
            self._setup.setOptimizationObjective(first_solution_objective(self.getSpaceInformation()))

    def prepare(self, seed: int) -> None:
        """Make the planner of a run, after :meth:`equip`; outside of the measured time."""
        ou.RNG.setSeed(seed + 1)
        self.planner = self._make(seed)
        space = self._setup.getStateSpace()
        register_projection(space)  # the old one knows random bounds
        self.getSpaceInformation().setup()
        self.planner.setProblemDefinition(self._setup.getProblemDefinition())
        self.planner.setup()

    def clear(self) -> None:
        """Forget the run."""
        super().clear()
        self.planner = None

    def solve(self, condition: Any) -> Any:
        """Run the planner until it ends, the condition holds, or ``max_samples`` are drawn."""
        self._rounds = 0
        began = time.perf_counter()
        end = began + self.time_limit
        inner = ob.PlannerTerminationCondition(ob.PlannerTerminationConditionFn(self._stop_condition(condition, end)))
        status = self.planner.solve(inner)
        self.planning_time = time.perf_counter() - began
        return status

    def getPlannerData(self, data: Any) -> None:  # noqa: N802  # OMPL's name
        """Nodes and edges of the run's planner."""
        if self.planner is not None:
            self.planner.getPlannerData(data)

    @property
    def max_samples(self) -> int:
        """Samples that a run may draw."""
        return self._scenario.planning.filled().max_samples

    @property
    def samples(self) -> int:
        """Samples drawn for this run's tree; for OMPL's own planners the rounds of their main loop."""
        if isinstance(self.planner, CompiledPlanner):
            return self.planner.search.samples if self.planner.search is not None else 0
        return self.planner.samples if isinstance(self.planner, PaperPlanner) else self._rounds

    @property
    def progress(self) -> list[Progress] | None:
        """The solutions of this run, each better than the one before; None for planners that end with their first."""
        return self.planner.progress if isinstance(self.planner, AnytimePlanner) else None

    @property
    def extension_attempts(self) -> int:
        """Extensions that were driven: the samples of this run but those refused by line 5 of Algorithm II."""
        if isinstance(self.planner, CompiledPlanner):
            return self.samples - self.planner.search.refusals if self.planner.search is not None else 0
        return self.planner.extension_attempts if isinstance(self.planner, PaperPlanner) else self._rounds

    def _make(self, seed: int) -> Any:
        """A new planner."""
        si, name = self.getSpaceInformation(), self.getName()
        made = make_planner(si, self._scenario, name, seed=seed)
        if isinstance(made, PaperPlanner):
            made.looks_around = False
        return made

    def _stop_condition(self, condition: Any, end: float) -> Callable[[], bool]:
        """OMPL's condition, the end of the time and, where OMPL does the sampling, the limit of samples."""
        limit = math.inf if is_compiled(self.getName()) else self.max_samples

        def should_stop() -> bool:
            if self._rounds >= limit or time.perf_counter() >= end or condition():
                return True
            self._rounds += 1
            return False

        return should_stop
