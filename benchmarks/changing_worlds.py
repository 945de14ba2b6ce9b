"""What it costs that a world changes: `World.updated` among many boxes, and cycles of planning on a changing costmap.

A costmap of 400 x 400 cells of 5 cm holds 60 rectangles, up to 1.2 m long, and single cells; in each cycle five squares
of 0.5 m appear elsewhere, the world is updated, and a robot of 0.5 m x 0.4 m plans from one corner to the other, 23 m
away. Times are CPU times, of boxes the best of several.

    python benchmarks/changing_worlds.py
    python benchmarks/changing_worlds.py --cycles 200 --cells 0.004 --planner cb-rrt-anytime
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from cbrrt_ompl import Bounds, Box, Footprint, Goal, Robot, Scenario, State, World, plan

ROBOT = Robot(footprint=Footprint.polygon([(-0.25, -0.2), (0.25, -0.2), (0.25, 0.2), (-0.25, 0.2)]))
RESOLUTION, SIDE = 0.05, 400
"""Of the costmap [m], and its cells a side."""
REPETITIONS = 15


def boxes(count: int, side: float) -> list[Box]:
    """Random boxes of 0.2 m to 0.8 m a side in a square of some side [m]."""
    rng = np.random.default_rng(1)
    centers, halves = rng.uniform(0.0, side, (count, 2)), rng.uniform(0.1, 0.4, (count, 2))
    return [
        Box(tuple(low), tuple(high))
        for low, high in zip((centers - halves).tolist(), (centers + halves).tolist(), strict=True)
    ]


def best_cpu_time(do: Callable[[], object]) -> float:
    """CPU time of a call, the best of several [ms]."""
    do()
    times = []
    for _ in range(REPETITIONS):
        began = time.process_time()
        do()
        times.append(time.process_time() - began)
    return 1e3 * min(times)


def update_costs(count: int, side: float) -> str:
    """What one more box costs in a world of boxes."""
    all_of_them = boxes(count, side)
    world = World(Bounds((0.0, 0.0), (side, side)), all_of_them[:-1])
    world.scene(ROBOT.footprint)
    updated = best_cpu_time(lambda: world.updated(obstacles=all_of_them).scene(ROBOT.footprint))
    return f"{count} boxes in {side:g} m x {side:g} m, one more: {updated:.1f} ms until the next plan can begin"


def costmap(rng: np.random.Generator, single: float) -> np.ndarray:
    """Occupied cells, with room about both ends."""
    cells = np.zeros((SIDE, SIDE), dtype=bool)
    for _ in range(60):
        (row, column), (height, width) = rng.integers(5, SIDE - 20, 2), rng.integers(2, 25, 2)
        cells[row : row + height, column : column + width] = True
    cells |= rng.random(cells.shape) < single
    cells[20:60, 20:60] = cells[340:380, 340:380] = False
    return cells


def cycle_costs(cycles: int, single: float, planner: str, max_iterations: int | None) -> str:
    """What a whole cycle costs, from the new costmap to the plan."""
    rng = np.random.default_rng(0)
    still = costmap(rng, single)
    scenario = Scenario(
        name="costmap",
        world=World.from_grid(still, RESOLUTION),
        robot=ROBOT,
        start=State(2.0, 2.0),
        goal=Goal(18.0, 18.0, tolerance=0.5),
    )
    plan(scenario, planner, seed=0, time_limit=1.0, max_iterations=max_iterations)
    times, solved = [], 0
    for cycle in range(cycles):
        cells = still.copy()
        for _ in range(5):
            row, column = rng.integers(70, 330, 2)
            cells[row : row + 10, column : column + 10] = True
        began = time.process_time()
        world = scenario.world.updated(grid=cells)
        result = plan(replace(scenario, world=world), planner, cycle, 1.0, max_iterations=max_iterations)
        times.append(time.process_time() - began)
        solved += result.solved
    median, high = np.quantile(1e3 * np.array(times), (0.5, 0.95))
    return f"costmap, {planner}: {solved} of {cycles} solved, a cycle {median:.1f} ms (median), {high:.1f} ms (95 %)"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cycles", type=int, default=100, help="cycles of planning on the costmap")
    parser.add_argument("--cells", type=float, default=0.0005, help="fraction of single cells that are occupied")
    parser.add_argument("--planner", default="cb-rrt-robust", help="planner of the cycles")
    parser.add_argument("--max-iterations", type=int, help="improve each plan by so many iterations")
    arguments = parser.parse_args()
    for count, side in ((1_000, 50.0), (6_000, 100.0)):
        print(update_costs(count, side), flush=True)
    print(cycle_costs(arguments.cycles, arguments.cells, arguments.planner, arguments.max_iterations))


if __name__ == "__main__":
    main()
