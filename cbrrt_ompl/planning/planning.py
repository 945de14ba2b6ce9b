"""plan: from a scenario to a drivable trajectory, the only place that assembles the parts."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from numbers import Integral
from typing import TYPE_CHECKING

from cbrrt_ompl.checks import is_number
from cbrrt_ompl.errors import Problem, SettingsError
from cbrrt_ompl.kernels.beside import compiled_beside
from cbrrt_ompl.motion.model import check_step
from cbrrt_ompl.ompl_plugin.availability import check_ompl, has_ompl
from cbrrt_ompl.planners.registry import PLANNERS, is_compiled, planner_named, scenario_for
from cbrrt_ompl.planners.warm_up import warm_up
from cbrrt_ompl.planning.first import already_there, approachable_goal, first_plan
from cbrrt_ompl.planning.further import Further
from cbrrt_ompl.planning.result import PlanResult
from cbrrt_ompl.planning.watch import Progress, Watch
from cbrrt_ompl.scenario.connectivity import has_no_way
from cbrrt_ompl.scenario.scenario import Scenario, check_scenario

if TYPE_CHECKING:  # a plan that is not improved needs no optimiser
    from cbrrt_ompl.optimise.improving import Found
    from cbrrt_ompl.optimise.objective import Objective


def plan(
    scenario: Scenario,
    planner: str = "cb-rrt",
    seed: int | None = None,
    time_limit: float = 5.0,
    progress: Progress | None = None,
    *,
    improve_for: float | None = None,
    max_iterations: int | None = None,
    objective: Objective | None = None,
    callback: Callable[[Found], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> PlanResult:
    """Plan a trajectory from the scenario's start into its goal region, and improve it if that is asked for.

    Args:
        scenario: world, robot, start, goal and settings; its ``max_samples`` ends a plan whatever the time limit.
        planner: a name from :data:`cbrrt_ompl.planners.registry.PLANNERS`.
        seed: 0 or more; the same seed gives the same result. None draws a fresh one.
        time_limit: largest planning time [s].
        progress: called about ten times a second with the samples so far and the time since the start [s].
        improve_for: time to improve the first trajectory for, from when it is found [s]; see
            :func:`cbrrt_ompl.improve`. None improves nothing, unless ``max_iterations`` is given.
        max_iterations: Newton steps to improve it for: the result is then the same on every run, unless the time ends
            it. ``cb-rrt-anytime`` ends by them where ``improve_for`` is not given. ``cb-rrt-ao`` improves by samples,
            and this is their number; where neither is given, it ends by 50,000, ``max_samples`` or ``time_limit``.
        objective: what to improve; the duration if not given, and the only one that ``cb-rrt-ao`` takes.
        callback: called with each trajectory's time, duration and source, as they are found.
        should_stop: asked every few milliseconds whether to end the improvement with the best so far.

    Returns:
        The result; "not solved" is a status of it and no error.

    Raises:
        ScenarioError: if this is no scenario.
        UnknownPlannerError: if there is no such planner.
        OmplMissingError: if the planner needs OMPL, and there is none; the planners of this package's own do not.
        SettingsError: if the seed, the time limit, the step or what is said of the improvement make no sense.
        KeyboardInterrupt: on Ctrl-C, at once.
    """
    check_scenario(scenario)
    asked, row = scenario, planner_named(planner)
    scenario = scenario_for(planner, scenario)
    _check_arguments(seed, time_limit, progress)
    further = Further(improve_for, max_iterations, objective, callback, should_stop)
    further.check(planner, row)
    check_step(scenario.robot, scenario.planning)
    warm_up_planner(planner)
    is_improved = further.goes_to_optimiser(row)
    if is_improved:
        warm_up_improvement()
    if not scenario.goal.violations(scenario.start):
        return replace(already_there(scenario, planner, seed), scenario=asked)
    if scenario.planning.approaches(scenario.goal):
        scenario = replace(scenario, goal=approachable_goal(scenario))
    is_hopeless = partial(has_no_way, scenario.world, scenario.robot.footprint, scenario.start, scenario.goal)
    watch = Watch(time_limit, progress, is_hopeless)
    if is_improved:
        from cbrrt_ompl.planning.improved import plan_improved

        result = plan_improved(scenario, planner, seed, watch, further)
    elif row.is_bounded:
        from cbrrt_ompl.planning.bounded import plan_bounded

        result = plan_bounded(scenario, planner, seed, watch, further)
    else:
        result = first_plan(scenario, planner, seed, watch)
    return replace(result, scenario=asked)


def available_planners() -> list[str]:
    """Names of the planners that can plan here: all of them, or without OMPL the compiled ones."""
    return [name for name in PLANNERS if has_ompl() or is_compiled(name)]


def warm_up_planner(planner: str) -> None:
    """Load or compile all kernels that a planner needs, before a clock runs.

    Raises:
        UnknownPlannerError: if there is no such planner.
        OmplMissingError: if it needs OMPL, and there is none.
    """
    if not is_compiled(planner):
        check_ompl(f"planner {planner!r}", "s-rrt-compiled" if planner == "s-rrt" else "cb-rrt-compiled")
    if planner_named(planner).optimises:
        from cbrrt_ompl.optimise.interior_point import iterate

        with compiled_beside("cbrrt_ompl.optimise.improving", "warm_up", iterate):
            warm_up()
        warm_up_improvement()
    else:
        warm_up()
    if not is_compiled(planner):
        from cbrrt_ompl.ompl_plugin import warm_up as plugin  # here, so that the compiled planners need no OMPL

        plugin.warm_up()


def warm_up_improvement() -> None:
    """Load or compile all kernels that improve a trajectory."""
    from cbrrt_ompl.optimise.improving import warm_up as warm_up_optimiser

    warm_up_optimiser()


def _check_arguments(seed: object, time_limit: object, progress: object) -> None:
    """Refuse what no plan can start with."""
    problems = []
    if seed is not None and not (is_number(seed) and isinstance(seed, Integral) and 0 <= seed < 2**32 - 1):
        problems.append(Problem("seed", seed, f"a whole number from 0 to {2**32 - 2}"))
    is_infinite = isinstance(time_limit, float) and time_limit == math.inf
    if not (is_infinite or (is_number(time_limit) and time_limit > 0.0)):
        problems.append(Problem("time_limit", time_limit, "a number above 0 [s]"))
    if progress is not None and not callable(progress):
        problems.append(Problem("progress", progress, "something to call, or None"))
    if problems:
        raise SettingsError(problems)
