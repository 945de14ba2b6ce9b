"""What an extension attempt costs: plugin and compiled loop, by tree size.

The goal is out of reach, so that trees grow as large as asked. Measured are the attempts in which a tree grows from
half its size to its size (from its root for 300 nodes), the best of five trees.

    python benchmarks/extension_cost.py --sizes 300 3000 30000
    python benchmarks/extension_cost.py --planners cb-rrt-compiled --sizes 300 1000000
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from cbrrt_ompl import Bounds, Disc, Goal, Scenario, State, World, load_scenario
from cbrrt_ompl.ompl_plugin.run import run
from cbrrt_ompl.planners.registry import is_compiled, law_of
from cbrrt_ompl.planners.search import search_in

SCENARIOS = Path(__file__).parents[1] / "scenarios"
OUT_OF_REACH = Goal(0.0, 0.0, tolerance=1e-12)
REPETITIONS = 5
TIME_LIMIT = 20.0
"""Time after which a tree that does not reach its size is given up [s]."""


def worlds() -> dict[str, Scenario]:
    """The scenes to measure in, by name."""
    bounds = Bounds((-5.0, -5.0), (5.0, 5.0))
    rng = np.random.default_rng(7)
    discs = [Disc(tuple(rng.uniform(-4.8, 4.8, 2)), float(rng.uniform(0.05, 0.25))) for _ in range(130)]
    discs = [d for d in discs if np.hypot(d.center[0] + 4, d.center[1] + 4) > d.radius + 0.2][:100]
    start = State(-4.0, -4.0)
    made = {
        "empty": Scenario(name="empty", world=World(bounds), start=start, goal=OUT_OF_REACH),
        "100 discs": Scenario(name="100 discs", world=World(bounds, discs), start=start, goal=OUT_OF_REACH),
    }
    for name in ("paper_case1", "paper_case2"):
        made[name] = replace(load_scenario(SCENARIOS / f"{name}.yaml"), goal=OUT_OF_REACH)
    return {name: replace(s, planning=replace(s.planning, max_samples=10**9)) for name, s in made.items()}


def cost_in_plugin(scenario: Scenario, planner: str, size: int, seed: int) -> float:
    """Seconds per attempt in control::RRT; the sampler's time and everything that OMPL does around it."""
    began: list[tuple[float, int]] = []
    ended: list[tuple[float, int]] = []

    def should_stop(samples: int) -> bool:
        nodes = sampler_of().children if sampler_of() else 0
        if nodes >= size:
            ended.append((time.perf_counter(), samples))
            return True
        if not began and (nodes >= size // 2 or size <= 300):
            began.append((time.perf_counter(), samples))
        return time.perf_counter() - started > TIME_LIMIT

    equipment: list = []
    sampler_of = lambda: equipment[0].sampler if equipment else None  # noqa: E731
    started = time.perf_counter()
    run(scenario, planner, seed, lambda: None, should_stop, equipment.append)
    if not ended:
        return float("nan")
    return (ended[0][0] - began[0][0]) / (ended[0][1] - began[0][1])


def cost_in_loop(scenario: Scenario, planner: str, size: int, seed: int) -> float:
    """Seconds per attempt in the compiled loop."""
    elapsed, attempts = 0.0, 0
    started = time.perf_counter()
    for repetition in range(max(1, 3000 // size)):
        search = search_in(scenario, law_of(planner, scenario.planning), 1000 * seed + repetition, goal_bias=0.0)
        portion = max(50, size // 50)
        while search.nodes < size:
            is_counted = size <= 300 or search.nodes >= size // 2
            before, began = search.samples, time.perf_counter()
            search.run(lambda _: False, before + portion)
            if is_counted:
                elapsed += time.perf_counter() - began
                attempts += search.samples - before
            if time.perf_counter() - started > TIME_LIMIT:
                return float("nan")
    return elapsed / attempts


def main() -> None:
    """Print one table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", type=int, nargs="+", default=[300, 3000, 30000])
    parser.add_argument("--planners", nargs="+", default=["cb-rrt", "s-rrt", "cb-rrt-compiled", "s-rrt-compiled"])
    parser.add_argument("--worlds", nargs="+", default=list(worlds()))
    arguments = parser.parse_args()
    print(f"{'microseconds per attempt':<42}" + "".join(f"{size:>11,}" for size in arguments.sizes))
    for name, scenario in worlds().items():
        if name not in arguments.worlds:
            continue
        for planner in arguments.planners:
            measure = cost_in_loop if is_compiled(planner) else cost_in_plugin
            print(f"{name + ': ' + planner:<42}", end="", flush=True)
            for size in arguments.sizes:
                repetitions = REPETITIONS if size < 10**6 else 1
                costs = [measure(scenario, planner, size, 0)]
                if not np.isnan(costs[0]):
                    costs += [measure(scenario, planner, size, seed) for seed in range(1, repetitions)]
                cost = 1e6 * np.nanmin(costs) if not np.isnan(costs).all() else np.nan
                print(f"{cost:>11.2f}", end="", flush=True)
            print(flush=True)


if __name__ == "__main__":
    main()
