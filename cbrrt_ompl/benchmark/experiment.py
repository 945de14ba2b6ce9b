"""OMPL's Benchmark in one scenario: planners side by side, columns of our own for each run."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from cbrrt_ompl.benchmark.account import describe_problem
from cbrrt_ompl.benchmark.columns import PROGRESS_ROWS, progress_rows, search_columns, trajectory_columns
from cbrrt_ompl.benchmark.entrant import Entrant
from cbrrt_ompl.benchmark.log import Log, PlannerLog, Row, read_log
from cbrrt_ompl.errors import InputError, Problem, SettingsError
from cbrrt_ompl.motion.model import CLOSED_LOOP
from cbrrt_ompl.ompl_plugin.binding import ot, ou
from cbrrt_ompl.ompl_plugin.results import trajectory_from_path
from cbrrt_ompl.ompl_plugin.run import quiet_ompl
from cbrrt_ompl.ompl_plugin.setup import make_setup
from cbrrt_ompl.planners.registry import law_of, planner_named
from cbrrt_ompl.planning import plan
from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.trajectory.trajectory import Trajectory

MEMORY_LIMIT = 4096.0
"""Memory that a run may take [MB]."""

WARM_UP = 0.01
"""Planning time of a run before the measured ones, so that none of them waits for the compiler [s]."""

PREFIX = "control_"
"""What OMPL's Benchmark puts before the names of control planners."""

PROGRESS = ("time REAL", "best cost REAL")
"""Columns of an anytime planner's progress: OMPL itself would ask for it in a thread without Python's lock."""

PROPERTIES = "Properties of benchmarked planners:\n"
"""Line in OMPL's account of the set-up after which the planners follow."""


class Experiment:
    """Planners in one scenario, all in one ``ot.Benchmark`` and on one space information.

    At the switch to a planner the space information gets that planner's propagator and directed sampler and loses all
    others; before each run a new planner is made from the run's seed.

    Attributes:
        entrants: the planners by name, in the order in which they run.
    """

    def __init__(self, scenario: Scenario, seeds: Mapping[str, Sequence[int]], name: str = "experiment") -> None:
        """Enter the planners.

        Args:
            scenario: world, robot, start, goal and settings.
            seeds: for each planner the seeds of its runs, as many for all.
            name: of the experiment, without spaces.

        Raises:
            UnknownPlannerError: if a planner is not known.
            InputError: if the planners cannot share a Benchmark.
        """
        check_entries(scenario, seeds)
        self._scenario, self._seeds, self._name = scenario, seeds, name
        with quiet_ompl():
            self._setup = make_setup(scenario, next(iter(seeds)))
            self._setup.getSpaceInformation().clearDirectedSamplerAllocator()
            self._setup.setup()
        self.entrants = {planner: Entrant(self._setup, scenario, planner) for planner in seeds}
        self._active = next(iter(self.entrants.values()))
        self._run = 0
        self._settings: dict[str, set[str]] = {}
        self._properties: dict[str, str] = {}
        self._progress: dict[str, list[tuple[Row, ...]]] = {}

    def run(self, time_limit: float, memory_limit: float = MEMORY_LIMIT) -> Log:
        """Run all planners, one after the other.

        Args:
            time_limit: time that a run may take [s].
            memory_limit: memory that a run may take [MB].

        Returns:
            OMPL's log, with settings and properties of the planners themselves instead of those of their entrants.
        """
        for name in self.entrants:
            plan(self._scenario, name, seed=0, time_limit=WARM_UP)
        benchmark = ot.Benchmark(self._setup, self._name)
        for entrant in self.entrants.values():
            entrant.time_limit = time_limit
            benchmark.addPlanner(entrant)
        benchmark.setPlannerSwitchEvent(ot.PreSetupEvent(self._switch))
        benchmark.setPreRunEvent(ot.PreSetupEvent(self._prepare))
        benchmark.setPostRunEvent(ot.PostSetupEvent(self._note))
        request = ot.Benchmark.Request(
            maxTime=time_limit,
            maxMem=memory_limit,
            runCount=len(next(iter(self._seeds.values()))),
            displayProgress=False,
            saveConsoleOutput=False,
            simplify=False,
        )
        with quiet_ompl(), tempfile.TemporaryDirectory() as folder:
            benchmark.benchmark(request)
            path = Path(folder, "benchmark.log")
            benchmark.saveResultsToFile(str(path))
            return self._completed(read_log(path))

    def _switch(self, planner: Any) -> None:
        """OMPL turns to another planner."""
        self._active, self._run = self.entrants[planner.getName()], 0
        self._active.equip()

    def _prepare(self, planner: Any) -> None:
        """OMPL is about to start a run."""
        name = planner.getName()
        self._active.prepare(self._seeds[name][self._run])
        settings = ou.mapStringToString()
        self._active.planner.params().getParams(settings)
        self._settings[name] = {f"{item.key()} = {item.data()}" for item in settings}
        self._properties[name] = self._active.planner.properties()

    def _note(self, planner: Any, run: Any) -> None:
        """OMPL has ended a run: add our columns."""
        entrant, seed = self._active, self._seeds[planner.getName()][self._run]
        columns = search_columns(
            seed, entrant.planning_time, entrant.samples, entrant.extension_attempts, entrant.max_samples
        ) | trajectory_columns(self._trajectory(), self._scenario)
        for column, value in columns.items():
            run[column] = value
        if entrant.progress is not None:
            rows = progress_rows(entrant.progress, entrant.planning_time, entrant.time_limit / PROGRESS_ROWS)
            self._progress.setdefault(entrant.getName(), []).append(rows)
        self._run += 1

    def _trajectory(self) -> Trajectory | None:
        """What the present run has found."""
        if not self._setup.haveExactSolutionPath():
            return None
        return trajectory_from_path(self._setup.getSolutionPath(), self._scenario)

    def _completed(self, log: Log) -> Log:
        """The log with what the entrants hide."""
        limits = {entrant.max_samples for entrant in self.entrants.values()}
        head = describe_problem(self._scenario.name, limits.pop() if len(limits) == 1 else None)
        setup = head + log.setup.partition(PROPERTIES)[0] + PROPERTIES + "".join(self._properties.values())
        return replace(log, setup=setup, planners=tuple(self._with_settings(planner) for planner in log.planners))

    def _with_settings(self, planner: PlannerLog) -> PlannerLog:
        name = planner.name.removeprefix(PREFIX)
        planner = replace(planner, settings=tuple(sorted({*planner.settings, *self._settings[name]})))
        if name not in self._progress:
            return planner
        return replace(planner, progress_columns=PROGRESS, progress=tuple(self._progress[name]))


def check_entries(scenario: Scenario, seeds: Mapping[str, Sequence[int]]) -> None:
    """Refuse planners that cannot share a Benchmark.

    Raises:
        UnknownPlannerError: if a planner is not known.
        InputError: if there is none, if they differ in their number of runs, or in what steers them.
    """
    for name in seeds:
        planner_named(name)
    if len({len(runs) for runs in seeds.values()}) != 1 or not all(seeds.values()):
        raise InputError(Problem("seeds", {name: len(runs) for name, runs in seeds.items()}, "as many runs for all"))
    closed = [name for name in seeds if law_of(name, scenario.planning) == CLOSED_LOOP]
    if 0 < len(closed) < len(seeds):
        expected = (
            f"planners of one kind: the controls of {', '.join(closed)} are references, those of others velocities, "
            "and an Experiment has one control space; set planning.closed_loop to False, or give each kind its own"
        )
        raise SettingsError(Problem("planners", ", ".join(seeds), expected))
