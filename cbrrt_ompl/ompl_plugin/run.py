"""One plan by a planner that OMPL runs."""

from __future__ import annotations

import secrets
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from cbrrt_ompl.ompl_plugin.binding import ob, ou
from cbrrt_ompl.ompl_plugin.compiled_methods import use_compiled_methods
from cbrrt_ompl.ompl_plugin.paper_planner import PaperPlanner
from cbrrt_ompl.ompl_plugin.results import trajectory_from_path, tree_from_planner
from cbrrt_ompl.ompl_plugin.rounds import Rounds
from cbrrt_ompl.ompl_plugin.setup import make_setup
from cbrrt_ompl.planners.first_plan import FirstPlan
from cbrrt_ompl.scenario.scenario import Scenario

_ompl = threading.RLock()
"""Held by the plan that OMPL is busy with: its seed and its log level are those of the process."""


def run(
    scenario: Scenario,
    planner: str,
    seed: int | None,
    on_start: Callable[[], None],
    should_stop: Callable[[int], bool],
    prepare: Callable[[Any], None] = lambda _: None,
) -> FirstPlan:
    """Set a planner up and let it solve the scenario; other threads wait, and their clocks with them.

    Args:
        scenario: world, robot, start, goal and settings; its ``max_samples`` is obeyed.
        planner: a name that :func:`cbrrt_ompl.ompl_plugin.setup.make_setup` knows.
        seed: 0 or more, or None for a fresh one.
        on_start: called when the search begins.
        should_stop: called about every millisecond, with the rounds of the planner's main loop so far.
        prepare: takes the ``SimpleSetup`` before it is set up, to change it.
    """
    use_compiled_methods()  # their check compiles, and no seed may depend on it
    with _ompl, quiet_ompl():
        # OMPL complains about a second seed in a process; yet all that is random below is allocated from here on
        ou.RNG.setSeed(1 + (secrets.randbits(31) if seed is None else int(seed)))
        setup = make_setup(scenario, planner)
        si = setup.getSpaceInformation()
        model = si.getStatePropagator().model
        prepare(setup)
        solver = setup.getPlanner()
        if isinstance(solver, PaperPlanner):
            solver.looks_around = False
        setup.setup()
        rounds = Rounds(scenario.planning.filled().max_samples, should_stop)
        with rounds.condition() as condition:
            on_start()
            began = time.perf_counter()
            setup.solve(condition)
            planning_time = time.perf_counter() - began
        trajectory = None
        if setup.haveExactSolutionPath():
            trajectory = trajectory_from_path(setup.getSolutionPath(), scenario)
    return FirstPlan(
        trajectory,
        count_nodes=lambda: count_nodes(setup.getPlanner(), si),
        samples=solver.samples if isinstance(solver, PaperPlanner) else rounds.count,
        planning_time=planning_time,
        make_tree=lambda: tree_from_planner(setup.getPlanner(), si, model),
    )


def count_nodes(planner: Any, si: Any) -> int:
    """Nodes that a planner of OMPL holds."""
    data = ob.PlannerData(si)
    planner.getPlannerData(data)
    return int(data.numVertices())


@contextmanager
def quiet_ompl() -> Iterator[Any]:
    """Keep OMPL's log off the caller's terminal."""
    level = ou.getLogLevel()
    ou.setLogLevel(ou.LOG_NONE)
    try:
        yield
    finally:
        ou.setLogLevel(level)
