"""What an extension attempt costs: plugin and compiled loop, by tree size.

The goal is out of reach, so that trees grow as large as asked. Measured is the CPU time of the attempts in which a tree
grows from half its size to its size (from its root for 300 nodes), the best of five trees; with ``--attempts``, of so
many attempts from the root, the best of ten trees of the compiled loop.

    python benchmarks/extension_cost.py --sizes 300 3000 30000
    python benchmarks/extension_cost.py --planners cb-rrt-compiled --sizes 300 1000000
    python benchmarks/extension_cost.py --planners cb-rrt-compiled --attempts 6500 --worlds "office boxes"
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from cbrrt_ompl import (
    Bounds,
    Box,
    Disc,
    Footprint,
    Goal,
    PlanningSettings,
    Robot,
    Scenario,
    State,
    World,
    load_scenario,
)
from cbrrt_ompl.ompl_plugin.run import run
from cbrrt_ompl.planners.registry import is_compiled, law_of
from cbrrt_ompl.planners.search import search_in

SCENARIOS = Path(__file__).parents[1] / "scenarios"
OFFICE = (
    (0.0, 3.2, 2.6, 3.3), (3.6, 3.2, 5.5, 3.3), (6.5, 3.2, 9.3, 3.3), (10.3, 3.2, 12.0, 3.3), (0.0, 5.1, 0.8, 5.2),
    (1.8, 5.1, 6.2, 5.2), (7.2, 5.1, 8.7, 5.2), (9.7, 5.1, 12.0, 5.2), (3.95, 0.0, 4.05, 3.2), (7.95, 0.0, 8.05, 3.2),
    (3.95, 5.2, 4.05, 8.4), (7.95, 5.2, 8.05, 6.6), (7.95, 7.6, 8.05, 8.4), (0.0, 1.8, 0.6, 3.2), (0.6, 2.6, 1.4, 3.2),
    (5.5, 0.8, 6.5, 1.8), (8.05, 0.0, 9.45, 0.7), (10.6, 0.0, 12.0, 0.7), (7.5, 3.3, 8.5, 3.6), (0.0, 8.0, 3.95, 8.4),
    (3.3, 5.9, 3.95, 7.3), (4.5, 7.0, 5.9, 8.0), (11.5, 5.2, 12.0, 6.9), (10.5, 5.2, 11.5, 5.7), (9.9, 6.7, 10.5, 7.3),
)  # fmt: skip
"""Walls and furniture of an office: x_min, y_min, x_max, y_max [m]."""
OUT_OF_REACH = Goal(4.0, 4.0, tolerance=1e-12)
REPETITIONS = 5
TIME_LIMIT = 20.0
"""Time after which a tree that does not reach its size is given up [s]."""


def worlds() -> dict[str, Scenario]:
    """The scenes to measure in, by name."""
    bounds, start = Bounds((-5.0, -5.0), (5.0, 5.0)), State(-4.0, -4.0)
    rectangle = Robot(footprint=Footprint.polygon([(-0.2, -0.15), (0.2, -0.15), (0.2, 0.15), (-0.2, 0.15)]))
    empty = Scenario(name="empty", world=World(bounds), start=start, goal=OUT_OF_REACH)
    # Extensions are cut where they become invalid, nodes are extended twice by one command: RRT in its usual form.
    usual = PlanningSettings(cut_extension="keep", equal_control_tolerance=0.0, look_ahead=1000.0)
    among = replace(empty, planning=usual, robot=rectangle)
    rng = np.random.default_rng(7)
    discs = [Disc(tuple(rng.uniform(-4.8, 4.8, 2)), float(rng.uniform(0.05, 0.25))) for _ in range(130)]
    corners = [
        c for c in rng.uniform(-4.9, 4.5, (150, 2)) if all(np.abs(c + 0.2 - at).max() > 0.5 for at in (-4.0, 4.0))
    ][:100]
    boxes = World(bounds, [Box((x, y), (x + 0.4, y + 0.4)) for x, y in np.array(corners).tolist()])
    wall = World(bounds, [Box((x0, -0.1), (x1, 0.1)) for x0, x1 in ((-5.0, -2.1), (-1.9, 1.9), (2.1, 5.0))])
    office = World(Bounds((0.0, 0.0), (12.0, 8.4)), [Box((x0, y0), (x1, y1)) for x0, y0, x1, y1 in OFFICE])
    made = {
        "empty": empty,
        "100 discs": replace(empty, world=World(bounds, [d for d in discs if _is_clear_of(start, d)][:100])),
        "two gaps, keep": replace(among, world=wall, robot=Robot()),
        "two gaps, discard": replace(among, world=wall, robot=Robot(), planning=PlanningSettings()),
        "100 boxes": replace(among, world=boxes),
        "100 boxes, disc": replace(among, world=boxes, robot=Robot(footprint=Footprint.disc(0.2))),
        "office boxes": replace(among, world=office, start=State(1.0, 0.8), goal=replace(OUT_OF_REACH, x=11.3, y=7.7)),
    }
    for name in ("paper_case1", "paper_case2", "dock", "office", "maze"):
        scenario = load_scenario(SCENARIOS / f"{name}.yaml")
        made[name] = replace(scenario, goal=replace(OUT_OF_REACH, x=scenario.goal.x, y=scenario.goal.y))
    return {name: replace(s, planning=replace(s.planning, max_samples=10**9)) for name, s in made.items()}


def _is_clear_of(start: State, disc: Disc) -> bool:
    """Whether a disc leaves room about the start."""
    return bool(np.hypot(disc.center[0] - start.x, disc.center[1] - start.y) > disc.radius + 0.2)


def cost_in_plugin(scenario: Scenario, planner: str, size: int, seed: int) -> float:
    """Seconds per attempt in control::RRT; the sampler's time and everything that OMPL does around it."""
    began: list[tuple[float, int]] = []
    ended: list[tuple[float, int]] = []

    def should_stop(samples: int) -> bool:
        sampler = setups[0].getPlanner().sampler
        nodes = sampler.children if sampler else 0
        if nodes >= size:
            ended.append((time.process_time(), samples))
            return True
        if not began and (nodes >= size // 2 or size <= 300):
            began.append((time.process_time(), samples))
        return time.perf_counter() - started > TIME_LIMIT

    setups: list = []
    started = time.perf_counter()
    run(scenario, planner, seed, lambda: None, should_stop, prepare=setups.append)
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
            before, began = search.samples, time.process_time()
            search.run(lambda _: False, before + portion)
            if is_counted:
                elapsed += time.process_time() - began
                attempts += search.samples - before
            if time.perf_counter() - started > TIME_LIMIT:
                return float("nan")
    return elapsed / attempts


def cost_of_attempts(scenario: Scenario, planner: str, attempts: int) -> float:
    """Seconds per attempt in the compiled loop, from the root on; the best of ten trees."""
    costs = []
    for seed in range(10):
        search = search_in(scenario, law_of(planner, scenario.planning), seed)
        began = time.process_time()
        search.run(lambda _: False, attempts)
        costs.append((time.process_time() - began) / search.samples)
    return min(costs)


def main() -> None:
    """Print one table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", type=int, nargs="+", default=[300, 3000, 30000])
    parser.add_argument("--planners", nargs="+", default=["cb-rrt", "s-rrt", "cb-rrt-compiled", "s-rrt-compiled"])
    parser.add_argument("--worlds", nargs="+", default=list(worlds()))
    parser.add_argument("--attempts", type=int, help="grow trees of so many attempts instead")
    arguments = parser.parse_args()
    if arguments.attempts:
        for name in arguments.worlds:
            for planner in filter(is_compiled, arguments.planners):
                cost = 1e6 * cost_of_attempts(worlds()[name], planner, arguments.attempts)
                print(f"{name + ': ' + planner:<42}{cost:>11.2f}", flush=True)
        return
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
