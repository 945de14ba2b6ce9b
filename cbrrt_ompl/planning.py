"""plan: from a scenario to a drivable trajectory, the only place that assembles the parts."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from cbrrt_ompl.clearance_map import clearance_map_for
from cbrrt_ompl.errors import Problem, SettingsError, UnknownPlannerError
from cbrrt_ompl.ompl_plugin.binding import ob, ou
from cbrrt_ompl.ompl_plugin.results import trajectory_from_path, tree_from_planner
from cbrrt_ompl.ompl_plugin.setup import make_equipped_setup
from cbrrt_ompl.replay import trajectory_from_controls
from cbrrt_ompl.scenario import Scenario
from cbrrt_ompl.trajectory import Trajectory
from cbrrt_ompl.tree import Tree

PLANNERS: dict[str, str] = {
    "cb-rrt": "CB-RRT of the paper: the Kanayama law in OMPL's control::RRT",
    "s-rrt": "S-RRT, the paper's baseline: full speed, three steering rates; kinematic",
    "rrt": "OMPL's control::RRT with random controls",
    "kpiece1": "OMPL's KPIECE1",
    "est": "OMPL's expansive space trees",
    "sst": "OMPL's stable sparse RRT, ended by its first solution",
    "pdst": "OMPL's path-directed subdivision tree",
    "syclop-rrt": "OMPL's Syclop over a 32 x 32 grid, with RRT",
    "syclop-est": "OMPL's Syclop over a 32 x 32 grid, with EST",
}
"""Known planners: name and description."""

SOLVED, TIME_LIMIT, SAMPLE_LIMIT = "solved", "time limit", "sample limit"
"""How a plan ends."""

PROGRESS_PERIOD = 0.1
"""Time between two reports of progress [s]."""

Progress = Callable[[int, float], None]
"""Takes the samples so far and the time since the start [s]."""


@dataclass(frozen=True, eq=False)
class PlanResult:
    """What came of a plan."""

    planner: str
    """The planner's name."""
    seed: int | None
    """The seed that was asked for."""
    status: str
    """``solved``, ``time limit`` or ``sample limit``."""
    trajectory: Trajectory | None
    """From the start into the goal region; None where not solved."""
    nodes: int
    """Nodes of the tree."""
    samples: int
    """Samples drawn; for OMPL's own planners the rounds of their main loop."""
    planning_time: float
    """Time of the search alone, without set-up and compilation [s]."""
    make_tree: Callable[[], Tree] = field(repr=False)
    """Makes the tree out of the planner's memory."""

    @property
    def solved(self) -> bool:
        """Whether there is a trajectory into the goal region."""
        return self.status == SOLVED

    @cached_property
    def tree(self) -> Tree:
        """All nodes and edges; made when first asked for."""
        return self.make_tree()


def plan(
    scenario: Scenario,
    planner: str = "cb-rrt",
    seed: int | None = None,
    time_limit: float = 5.0,
    progress: Progress | None = None,
) -> PlanResult:
    """Plan a trajectory from the scenario's start into its goal region.

    Args:
        scenario: world, robot, start, goal and settings; its ``max_samples`` ends a plan whatever the time limit.
        planner: a name from `PLANNERS`.
        seed: 0 or more; the same seed gives the same result. None draws a fresh one.
        time_limit: largest planning time [s].
        progress: called about ten times a second with the samples so far and the time since the start [s].

    Returns:
        The result; "not solved" is a status of it and no error.

    Raises:
        UnknownPlannerError: if there is no such planner.
        SettingsError: if the seed, the time limit or the step make no sense.
        KeyboardInterrupt: on Ctrl-C, at once.
    """
    if planner not in PLANNERS:
        raise UnknownPlannerError(planner, list(PLANNERS))
    _check_arguments(seed, time_limit)
    return _plan_in_ompl(scenario, planner, seed, time_limit, progress)


def _check_arguments(seed: int | None, time_limit: float) -> None:
    """Refuse what no plan can start with."""
    problems = []
    if seed is not None and not (isinstance(seed, (int, np.integer)) and 0 <= seed < 2**32 - 1):
        problems.append(Problem("seed", seed, f"a whole number from 0 to {2**32 - 2}"))
    if not (isinstance(time_limit, (int, float)) and not math.isnan(time_limit) and time_limit > 0.0):
        problems.append(Problem("time_limit", time_limit, "a number above 0 [s]"))
    if problems:
        raise SettingsError(problems)


def _plan_in_ompl(
    scenario: Scenario, planner: str, seed: int | None, time_limit: float, progress: Progress | None
) -> PlanResult:
    """Plan with a planner that OMPL runs."""
    with _quiet_ompl():
        if seed is not None:
            # OMPL complains about a second seed in a process; yet all that is random below is allocated from here on
            ou.RNG.setSeed(seed + 1)
        setup, equipment = make_equipped_setup(
            scenario, planner, clearance_map_for(scenario.world, scenario.robot.footprint)
        )
        setup.setup()
        watch = _Watch(scenario.planning.max_samples, time_limit, progress)
        if not scenario.goal.violations(scenario.start):
            return _already_there(scenario, planner, seed, equipment.model)
        began = time.perf_counter()
        condition = ob.PlannerTerminationCondition(ob.PlannerTerminationConditionFn(watch))
        setup.solve(condition)
        planning_time = time.perf_counter() - began
        space, si = setup.getStateSpace(), setup.getSpaceInformation()
        solved = setup.haveExactSolutionPath()
        trajectory = trajectory_from_path(setup.getSolutionPath(), space, equipment.model) if solved else None
        data = ob.PlannerData(si)
        setup.getPlanner().getPlannerData(data)
    return PlanResult(
        planner=planner,
        seed=seed,
        status=SOLVED if solved else watch.ended_by,
        trajectory=trajectory,
        nodes=data.numVertices(),
        samples=equipment.sampler.samples if equipment.sampler is not None else watch.rounds,
        planning_time=planning_time,
        make_tree=lambda: tree_from_planner(setup.getPlanner(), si, space, equipment.model),
    )


def _already_there(scenario: Scenario, planner: str, seed: int | None, model: Any) -> PlanResult:
    """The plan of a robot that starts in its goal region: stay."""
    start = np.array([scenario.start], dtype=float)
    stay = trajectory_from_controls(start[0], np.empty((0, 3)), np.empty(0, dtype=np.int64), model)
    tree = Tree(start, np.array([-1]), np.empty((0, 2)))
    return PlanResult(planner, seed, SOLVED, stay, 1, 0, 0.0, lambda: tree)


class _Watch:
    """OMPL's termination condition: called once a round, it counts, keeps the time and reports.

    Being Python code, it also lets a Ctrl-C through to the planner.
    """

    def __init__(self, max_rounds: int, time_limit: float, progress: Progress | None) -> None:
        self.rounds = 0
        self.ended_by = SAMPLE_LIMIT
        self._max_rounds = max_rounds
        self._began = time.perf_counter()
        self._deadline = self._began + time_limit
        self._progress = progress
        self._next_report = self._began + PROGRESS_PERIOD

    def __call__(self) -> bool:
        """Whether the planner must stop."""
        if self.rounds >= self._max_rounds:
            return True
        now = time.perf_counter()
        if now >= self._deadline:
            self.ended_by = TIME_LIMIT
            return True
        self.rounds += 1
        if self._progress is not None and now >= self._next_report:
            self._next_report = now + PROGRESS_PERIOD
            self._progress(self.rounds, now - self._began)
        return False


@contextmanager
def _quiet_ompl() -> Iterator[None]:
    """Keep OMPL's log off the caller's terminal."""
    level = ou.getLogLevel()
    ou.setLogLevel(ou.LOG_NONE)
    try:
        yield
    finally:
        ou.setLogLevel(level)
