"""Plans that are improved by optimal control: after the first plan, or guess after guess."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

from cbrrt_ompl.motion.model import jumps
from cbrrt_ompl.optimise.anytime import further_guesses, robust_search
from cbrrt_ompl.optimise.guess import Guess
from cbrrt_ompl.optimise.improving import Improver, geodesic_guesses
from cbrrt_ompl.optimise.lattice_plan import STATE_LATTICE, full_speed_guess, lattice_plan
from cbrrt_ompl.optimise.objective import Objective
from cbrrt_ompl.planners.registry import PLANNERS, law_of
from cbrrt_ompl.planning.first import first_plan, seed_or_fresh
from cbrrt_ompl.planning.further import Further
from cbrrt_ompl.planning.result import SOLVED, PlanResult, result_of
from cbrrt_ompl.planning.watch import Watch
from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.trajectory.trajectory import Trajectory

FIRST_SAMPLES = 5_000
"""Samples after which an anytime planner looks for another first plan than that of CB-RRT."""

FEW_NODES = 10_000
"""Nodes of a search over the lattice after which an anytime planner looks along the geodesics, and then goes on."""

ANYTIME_ITERATIONS = 3000
"""Newton steps after which an anytime planner ends where neither they nor the time are given."""


def plan_improved(scenario: Scenario, planner: str, seed: int | None, watch: Watch, further: Further) -> PlanResult:
    """A plan and what optimal control makes of it."""
    is_anytime, max_iterations = PLANNERS[planner].is_anytime, further.max_iterations
    if is_anytime and further.is_open:
        max_iterations = ANYTIME_ITERATIONS
    improver = Improver(
        scenario,
        Objective() if further.objective is None else further.objective,
        math.inf,
        max_iterations,
        further.callback,
        further.should_stop,
        is_kinematic=jumps(law_of(planner, scenario.planning), scenario.robot),
    )
    budget = math.inf if further.improve_for is None else further.improve_for
    if is_anytime:
        return _plan_anytime(scenario, planner, seed, watch, improver, budget)
    result = first_plan(scenario, planner, seed, watch)
    if result.trajectory is not None:
        improver.begin(budget, watch.began)
        improver.improve(result.trajectory, planner)
    return _with_best(result, improver)


def _plan_anytime(
    scenario: Scenario, planner: str, seed: int | None, watch: Watch, improver: Improver, budget: float
) -> PlanResult:
    """The first plan of CB-RRT, or where that takes long of the lattice or the geodesic; then guess after guess."""
    first_seed = seed_or_fresh(seed)
    search, most = robust_search(scenario, first_seed), scenario.planning.filled().max_samples
    watch.start()
    improver.begin(watch.left(), watch.began)
    search.run(watch.should_stop, min(FIRST_SAMPLES, most))
    found, others = None, None
    if not search.has_reached_goal:
        found, others = _without_samples(scenario, improver, lambda: watch.should_stop(search.samples))
        if found is None and improver.best is None:
            search.run(watch.should_stop, most)
    result = result_of(search.first_plan(watch.elapsed()), planner, seed, watch.ended_by)
    improver.begin(budget, watch.began)
    if search.has_reached_goal:
        improver.improve(search.trajectory(), planner, others)
    elif found is not None:
        improver.improve(found, STATE_LATTICE, others)
    if improver.best is not None:
        improver.explore(further_guesses(scenario, search, first_seed, improver.has_ended))
    return _with_best(result, improver)


def _without_samples(
    scenario: Scenario, improver: Improver, should_stop: Callable[[], bool]
) -> tuple[Trajectory | None, list[Guess]]:
    """A plan over the lattice and the guesses to try beside it; or what the improver makes of the geodesics."""
    limits = scenario.robot.limits
    over_lattice = partial(lattice_plan, scenario, should_stop, is_kinematic=limits.is_first_order)
    if not scenario.robot.footprint.is_round:
        found = over_lattice(most_nodes=FEW_NODES)
        if found is not None:
            return found, [full_speed_guess(found, limits), *geodesic_guesses(scenario)]
    improver.run(geodesic_guesses(scenario))
    found = over_lattice() if improver.best is None else None
    return found, [] if found is None else [full_speed_guess(found, limits)]


def _with_best(result: PlanResult, improver: Improver) -> PlanResult:
    """A result with the best trajectory of an improver, if it has one."""
    if improver.best is None:
        return result
    return replace(
        result,
        status=SOLVED,
        trajectory=improver.best,
        planning_time=improver.elapsed(),
        history=tuple(improver.history),
    )
