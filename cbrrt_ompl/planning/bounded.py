"""Plans by tree after tree, each bounded by the best."""

from __future__ import annotations

import math
from dataclasses import replace

from cbrrt_ompl.optimise.improving import Found
from cbrrt_ompl.planners.bounded import BoundedTrees
from cbrrt_ompl.planners.registry import PLANNERS
from cbrrt_ompl.planners.search import search_in
from cbrrt_ompl.planning.first import seed_or_fresh
from cbrrt_ompl.planning.further import Further
from cbrrt_ompl.planning.result import SOLVED, PlanResult, result_of
from cbrrt_ompl.planning.watch import Watch
from cbrrt_ompl.scenario.scenario import Scenario

BOUNDED_SAMPLES = 50_000
"""Samples after the first plan after which a bounded planner ends where neither they nor the time are given."""


def plan_bounded(scenario: Scenario, planner: str, seed: int | None, watch: Watch, further: Further) -> PlanResult:
    """The first plan, and then those of trees that are bounded by the best."""
    row, most = PLANNERS[planner], scenario.planning.filled().max_samples
    first_seed = seed_or_fresh(seed)
    search = search_in(scenario, row.law(scenario.planning), first_seed, robust=row.is_robust)
    watch.start()
    search.run(watch.should_stop, most)
    if not search.has_reached_goal:
        return result_of(search.first_plan(watch.elapsed()), planner, seed, watch.ended_by)
    history = list[Found]()

    def note(source: str) -> None:
        dt = float(search.model["dt"][0])
        history.append(Found(watch.elapsed(), dt * int(trees.best.total_steps[-1]), source))
        if further.callback is not None:
            further.callback(history[-1])

    def should_stop(samples: int) -> bool:
        return watch.should_stop(samples) or (further.should_stop is not None and bool(further.should_stop()))

    trees = BoundedTrees(search, first_seed)
    note(planner)
    if further.improve_for is not None:
        watch.go_on(further.improve_for)
    if further.max_iterations is not None:
        most_samples: float = search.samples + further.max_iterations
    else:
        most_samples = min(most, search.samples + BOUNDED_SAMPLES) if further.improve_for is None else math.inf
    while trees.find_quicker(should_stop, most_samples):
        note(f"tree {trees.trees}")
    found = trees.best.first_plan(watch.elapsed())._replace(samples=trees.samples)
    return replace(result_of(found, planner, seed, SOLVED), history=tuple(history))
