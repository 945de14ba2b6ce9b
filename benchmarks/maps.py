"""Plan in real maps and in the BARN worlds: success, planning time and duration of the compiled planners.

Maps: a TurtleBot3 Waffle Pi between random free poses of the largest free part of each map. Worlds of discs: a Jackal
from the start to the goal that all BARN worlds share. Nothing is downloaded; name the files.

    python benchmarks/maps.py --maps depot.yaml tb3_sandbox.yaml --pairs 100
    python benchmarks/maps.py --barn world_0.csv --seeds 100
    python benchmarks/maps.py --dynobench bugtrap_0.yaml kink_0.yaml --model unicycle2_v0.yaml --seeds 20
"""

from __future__ import annotations

import argparse
import math
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl import (
    ROBOTS,
    Bounds,
    Goal,
    PlanningSettings,
    Scenario,
    State,
    World,
    plan,
    verify,
)
from cbrrt_ompl.scenario.dynobench import load_dynobench
from cbrrt_ompl.scenario.maps.discs import load_discs
from cbrrt_ompl.scenario.maps.loading import load_map
from cbrrt_ompl.scenario.maps.occupancy_map import OccupancyMap

WAFFLE_PI, JACKAL = ROBOTS["turtlebot3_waffle_pi"], ROBOTS["jackal"]
MAP_PLANNING = PlanningSettings(max_samples=10**9)
BARN_PLANNING = PlanningSettings(horizon=1.0, max_samples=10**9)
BARN_BOUNDS = Bounds((-4.575, 0.0), (0.075, 14.5))


def largest_free_part(grid: OccupancyMap, radius: float) -> NDArray[np.int64]:
    """Cells in whose centres a disc is free, of the largest connected part, as rows of (row, column)."""
    blocked = np.pad(grid.blocked(), 1, constant_values=True)
    reach = math.ceil(radius / grid.resolution) + 1
    taken = np.pad(blocked, reach, constant_values=True)
    free = ~blocked
    rows, columns = blocked.shape
    for i in range(-reach, reach + 1):
        for j in range(-reach, reach + 1):
            if math.hypot(max(abs(i) - 0.5, 0.0), max(abs(j) - 0.5, 0.0)) * grid.resolution <= radius + 1e-3:
                free &= ~taken[reach + i : reach + i + rows, reach + j : reach + j + columns]
    best: list[tuple[int, int]] = []
    while len(seeds := np.argwhere(free)):
        part, queue = [], deque([(int(seeds[0, 0]), int(seeds[0, 1]))])
        free[queue[0]] = False
        while queue:
            r, c = queue.popleft()
            part.append((r - 1, c - 1))
            for cell in ((r + 1, c), (r - 1, c), (r, c + 1), (r, c - 1)):
                if free[cell]:
                    free[cell] = False
                    queue.append(cell)
        best = max(best, part, key=len)
    return np.array(best)


def map_scenarios(path: Path, pairs: int) -> Iterator[Scenario]:
    """Random pairs of free poses in a map, all in one world."""
    grid = load_map(path)
    world = grid.to_world()
    cells = largest_free_part(grid, WAFFLE_PI.footprint.circumscribed_radius)
    rng = np.random.default_rng(0)
    x0, y0, yaw = grid.origin
    for _ in range(pairs):
        (r0, c0), (r1, c1) = cells[rng.integers(len(cells), size=2)] + 0.5
        ends = [
            (
                x0 + grid.resolution * (c * math.cos(yaw) - r * math.sin(yaw)),
                y0 + grid.resolution * (c * math.sin(yaw) + r * math.cos(yaw)),
            )
            for r, c in ((r0, c0), (r1, c1))
        ]
        yield Scenario(
            name=path.stem,
            world=world,
            robot=WAFFLE_PI,
            start=State(*ends[0], rng.uniform(-math.pi, math.pi)),
            goal=Goal(*ends[1], tolerance=0.25),
            planning=MAP_PLANNING,
        )


def barn_scenarios(path: Path, seeds: int) -> Iterator[Scenario]:
    """The same scenario again and again."""
    scenario = Scenario(
        name=path.stem,
        world=World(BARN_BOUNDS, load_discs(path)),
        robot=JACKAL,
        start=State(-2.25, 3.0, 1.57),
        goal=Goal(-2.25, 13.0, tolerance=1.0),
        planning=BARN_PLANNING,
    )
    for _ in range(seeds):
        yield scenario


def dynobench_scenarios(path: Path, model: Path, seeds: int) -> Iterator[tuple[str, list[Scenario]]]:
    """A problem of dynobench's, forward only and not, with the tolerance for samplers and for optimizers."""
    for forward_only, ways in ((True, "ahead"), (False, "both")):
        for tolerance in (0.2, 0.03):
            scenario = load_dynobench(path, model, forward_only=forward_only, tolerance=tolerance)
            yield f"{path.stem} {ways} {tolerance}", [scenario] * seeds


def measure(scenarios: list[Scenario], planner: str, time_limit: float, verified: bool) -> str:
    """Plan them all, the number of a scenario being its seed, and say what came of it."""
    results = [plan(s, planner, seed=seed, time_limit=time_limit) for seed, s in enumerate(scenarios)]
    solved = [(r.trajectory, s) for r, s in zip(results, scenarios, strict=True) if r.trajectory is not None]
    times = 1e3 * np.array([r.planning_time if r.solved else np.inf for r in results])
    nodes = np.array([r.nodes if r.solved else np.inf for r in results])
    median, high = np.quantile(times, (0.5, 0.95), method="inverted_cdf")
    duration = np.median([t.duration for t, _ in solved]) if solved else np.nan
    line = (
        f"{len(solved):>4}/{len(results):<4} {median:>9.1f} {high:>9.1f} {duration:>9.1f}"
        f" {np.quantile(nodes, 0.5, method='inverted_cdf'):>7.0f}"
    )
    return line + (f"  {sum(verify(t, s).ok for t, s in solved)}/{len(solved)} verified" if verified else "")


def main() -> None:
    """Print one table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--maps", type=Path, nargs="*", default=[], help="maps in which the TurtleBot3 plans")
    parser.add_argument("--barn", type=Path, nargs="*", default=[], help="CSV files of discs in which the Jackal plans")
    parser.add_argument("--dynobench", type=Path, nargs="*", default=[], help="problems of dynobench's")
    parser.add_argument("--model", type=Path, help="the model of dynobench's robot")
    parser.add_argument("--pairs", type=int, default=100, help="random pairs of poses in a map")
    parser.add_argument("--seeds", type=int, default=100, help="plans in a world of BARN's or dynobench's")
    parser.add_argument("--planners", nargs="+", default=["cb-rrt-compiled", "cb-rrt-robust"])
    parser.add_argument("--time-limit", type=float, default=1.0, help="[s]")
    parser.add_argument("--cold", action="store_true", help="do not make the clearance maps beforehand")
    parser.add_argument("--closed-loop", action="store_true", help="evaluate the law at every step")
    parser.add_argument("--verify", action="store_true", help="verify every trajectory (slow)")
    arguments = parser.parse_args()
    print(f"{'world':<26}{'planner':<16} solved   median ms  95 % ms  duration s  nodes")
    for name, scenarios in groups(arguments):
        if arguments.closed_loop:
            scenarios = [replace(s, planning=replace(s.planning, closed_loop=True)) for s in scenarios]
        if not arguments.cold:
            for seed, scenario in enumerate(scenarios):
                plan(scenario, "cb-rrt-robust", seed=1000 + seed, time_limit=arguments.time_limit)
        for planner in arguments.planners:
            found = measure(scenarios, planner, arguments.time_limit, arguments.verify)
            print(f"{name:<26}{planner:<16}{found}", flush=True)


def groups(arguments: argparse.Namespace) -> Iterator[tuple[str, list[Scenario]]]:
    """Scenarios that make one line of the table, with its name."""
    for path in arguments.maps:
        began = time.perf_counter()
        scenarios = list(map_scenarios(path, arguments.pairs))
        print(
            f"{path.stem}: {len(scenarios[0].world.obstacles)} obstacles, {time.perf_counter() - began:.2f} s to load"
        )
        yield path.stem, scenarios
    for path in arguments.barn:
        yield path.stem, list(barn_scenarios(path, arguments.seeds))
    for path in arguments.dynobench:
        yield from dynobench_scenarios(path, arguments.model, arguments.seeds)


if __name__ == "__main__":
    main()
