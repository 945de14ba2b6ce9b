"""How good trajectories are after some milliseconds of CPU time: the anytime planner against what was published.

dynobench: unicycles of first or second order, with the tolerance for optimisers, at the limits of the file, at 0.45 m/s
and rad/s (which the published solutions of second order keep), and forward only. Maps: a TurtleBot3 Waffle Pi between
random free poses, against a true lower bound on the duration (benchmarks/lower_bound.py). BARN: a Jackal. Grid: a
Jackal that arrives with a heading and at rest, its path against the shortest one over the cells and their eight
neighbours. Kernels are warm and worlds known: the time of compilation and of a world's distance field is not in the
table. Nothing is downloaded. With ``--scenes``, durations of both planners that go on after their first plan, after
0.1, 1 and 10 s of CPU time: by optimal control, and by sampling.

    python benchmarks/improve.py --dynobench bugtrap_0.yaml kink_0.yaml --model unicycle2_v0.yaml --seeds 100
    python benchmarks/improve.py --dynobench unicycle1_kink_0.yaml --model unicycle1_v0.yaml
    python benchmarks/improve.py --dynobench kink_0.yaml --model unicycle2_v0.yaml --clearance 0.029
    python benchmarks/improve.py --maps depot.yaml tb3_sandbox.yaml --pairs 100 --budget 100
    python benchmarks/improve.py --maps depot.yaml --pairs 100 --budget 100 --facing
    python benchmarks/improve.py --barn world_0.csv --seeds 10 --budget 200
    python benchmarks/improve.py --grid 100by100_10.yaml --pairs 50 --budget 150
    python benchmarks/improve.py --scenes paper_case1 office maze kink_0.yaml --model unicycle2_v0.yaml --seeds 10
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from lower_bound import shortest_duration
from maps import JACKAL, MAP_PLANNING, barn_scenarios, largest_free_part, map_scenarios
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from cbrrt_ompl import Goal, Scenario, State, load_dynobench, load_map, load_scenario, plan, verify
from cbrrt_ompl.optimise.improving import Found
from cbrrt_ompl.planners.registry import PLANNERS
from cbrrt_ompl.planning import PlanResult

PLANNER = next(name for name, row in PLANNERS.items() if row.optimises)

MARKS = (0.1, 1.0, 10.0)
"""CPU times after which planners are compared [s]."""

PUBLISHED = {
    "bugtrap_0": 25.1,
    "kink_0": 17.7,
    "parallelpark_0": 5.8,
    "unicycle1_bugtrap_0": 20.7,
    "unicycle1_kink_0": 13.2,
    "unicycle1_parallelpark_0": 3.1,
}
"""Durations of iDb-A* (Ortiz-Haro et al., "iDb-A*: iterative search and optimization for optimal kinodynamic motion
planning", IEEE Transactions on Robotics, 2024) [s]."""

PUBLISHED_SPEED = 0.45
"""What the published solutions use of 0.5 m/s and 0.5 rad/s."""

FIRST_WAY = 0.3
"""Way that a start faces along with ``--facing`` [m]."""

ITERATIONS = 10_000
"""Newton steps at most: the CPU time ends a plan."""


class Outcome(NamedTuple):
    """The outcome of one plan."""

    first: float
    """CPU time of the first trajectory [s]."""
    improved: float
    """Cost of the first improved trajectory, in terms of the reference."""
    improved_after: float
    """Its CPU time [s]."""
    final: float
    """Cost of the last trajectory, in terms of the reference."""
    is_verified: bool


def plan_for(
    scenario: Scenario,
    seed: int,
    budget: float,
    planner: str = PLANNER,
    time_limit: float = 10.0,
    max_iterations: int | None = ITERATIONS,
) -> tuple[PlanResult, list[tuple[float, Found]]]:
    """Plan for some CPU time [s]; the result, and what was found after which CPU time [s]."""
    rows: list[tuple[float, Found]] = []
    began = time.process_time()

    def elapsed() -> float:
        return time.process_time() - began

    result = plan(
        scenario,
        planner,
        seed,
        time_limit=time_limit,
        improve_for=math.inf if max_iterations is None else None,
        max_iterations=max_iterations,
        callback=lambda found: rows.append((elapsed(), found)),
        should_stop=lambda: elapsed() > budget,
    )
    return result, rows


def outcome(scenario: Scenario, seed: int, budget: float, reference: float, by_length: bool) -> Outcome | None:
    """Plan for some CPU time [s]; None where that finds nothing."""
    result, rows = plan_for(scenario, seed, budget)
    trajectory = result.trajectory
    if trajectory is None:
        return None
    after, improved = rows[min(1, len(rows) - 1)]
    final = trajectory.length if by_length else trajectory.duration
    is_verified = verify(trajectory, scenario).ok
    return Outcome(rows[0][0], improved.duration / reference, after, final / reference, is_verified)


def report(
    name: str, scenarios: list[Scenario], budget: float, references: list[float], by_length: bool = False
) -> None:
    """Print a line of the table; the scenarios' numbers are their seeds."""
    outcome(scenarios[0], 0, 0.0, 1.0, by_length)  # field and index of the world
    found = [outcome(s, i, budget, r, by_length) for i, (s, r) in enumerate(zip(scenarios, references, strict=True))]
    done = [o for o in found if o is not None]
    final, first = np.array([o.final for o in done]), 1e3 * np.array([o.first for o in done])
    improved, after = np.array([o.improved for o in done]), 1e3 * np.array([o.improved_after for o in done])
    print(
        f"{name:<30}{len(done):>4}/{len(found):<4}{sum(o.is_verified for o in done):>4} verified"
        f"  first {np.median(first):6.1f} ms, improved {np.median(improved):7.3f} (worst {improved.max():7.3f}) after"
        f" {np.median(after):6.1f} ms (95 %: {np.quantile(after, 0.95):6.1f}); in {1e3 * budget:.0f} ms: median"
        f" {np.median(final):7.3f}, 90 % {np.quantile(final, 0.9):7.3f}, 95 % {np.quantile(final, 0.95):7.3f},"
        f" worst {final.max():7.3f}",
        flush=True,
    )


def durations_after(scenario: Scenario, planner: str, seed: int) -> tuple[list[float], bool]:
    """Durations of the best trajectories after some CPU times, infinite where there is none; whether the last is sound.

    Args:
        scenario: what to plan.
        planner: an anytime planner.
        seed: of the plan.
    """
    result, rows = plan_for(scenario, seed, MARKS[-1], planner, time_limit=1e3, max_iterations=None)
    best = [min((found.duration for after, found in rows if after <= mark), default=math.inf) for mark in MARKS]
    return best, result.trajectory is not None and verify(result.trajectory, scenario).ok


def report_scene(name: str, scenario: Scenario, seeds: int) -> None:
    """Print a line a planner: median and worst durations after each time [s]."""
    for planner in (name for name, row in PLANNERS.items() if row.is_anytime):
        plan(scenario, planner, 0, improve_for=0.1)  # field and index of the world
        found = [durations_after(scenario, planner, seed) for seed in range(seeds)]
        durations = np.array([best for best, _ in found])  # (seeds, marks)
        cells = zip(MARKS, np.median(durations, axis=0), durations.max(axis=0), strict=True)
        texts = [f"{mark:g} s: {middle:6.2f} (worst {worst:6.2f})" for mark, middle, worst in cells]
        verified = f"{sum(is_sound for _, is_sound in found)}/{seeds} verified"
        print(f"{name:<16}{planner:<16}{'  '.join(texts)}  {verified}", flush=True)


def facing_its_way(scenario: Scenario, seed: int) -> Scenario:
    """The same problem with a start that faces along the way, so that a bound that knows nothing of turning is near."""
    trajectory = plan(scenario, PLANNER, seed, max_iterations=2000).trajectory
    assert trajectory is not None
    away = np.hypot(trajectory.x - scenario.start.x, trajectory.y - scenario.start.y)
    row = int(np.argmax(away > min(FIRST_WAY, 0.5 * away.max())))
    dx, dy = trajectory.poses[row, :2] - scenario.start[:2]
    return replace(scenario, start=scenario.start._replace(theta=math.atan2(dy, dx)))


def dynobench_cases(path: Path, model: Path, clearance: float) -> Iterator[tuple[str, Scenario]]:
    """A problem at the limits of the model, at those that the published solutions keep, and forward only.

    Args:
        path: file of the problem.
        model: file of the robot.
        clearance: distance to keep [m].
    """
    scenario, forward_only = (
        replace(found, planning=replace(found.planning, clearance=clearance))
        for found in (load_dynobench(path, model, forward_only=way, tolerance=0.03) for way in (False, True))
    )
    top = PUBLISHED_SPEED
    slower = scenario.robot.limits._replace(v_min=-top, v_max=top, omega_min=-top, omega_max=top)
    yield path.stem, scenario
    yield f"{path.stem} at {top}", replace(scenario, robot=replace(scenario.robot, limits=slower))
    yield f"{path.stem} forward only", forward_only


def grid_scenarios(path: Path, pairs: int) -> Iterator[tuple[Scenario, float]]:
    """A Jackal between random free poses of a map, arriving with a heading and at rest, and the grid's path [m]."""
    grid = load_map(path)
    world, resolution = grid.to_world(), grid.resolution
    cells = largest_free_part(grid, JACKAL.footprint.circumscribed_radius)
    numbers = {tuple(cell): i for i, cell in enumerate(cells.tolist())}
    edges = []
    for move in ((0, 1), (1, 0), (1, 1), (1, -1)):
        for (r, c), i in numbers.items():
            j = numbers.get((r + move[0], c + move[1]))
            if j is not None:
                edges.append((i, j, resolution * math.hypot(*move)))
    rows, columns, lengths = zip(*edges, strict=True)
    graph = csr_matrix((lengths, (rows, columns)), shape=(len(cells), len(cells)))
    rng, (x0, y0, _) = np.random.default_rng(0), grid.origin
    for _ in range(pairs):
        a, b = rng.integers(len(cells), size=2).tolist()
        (ra, ca), (rb, cb) = cells[[a, b]] + 0.5
        scenario = Scenario(
            name=path.stem,
            world=world,
            robot=JACKAL,
            start=State(x0 + resolution * ca, y0 + resolution * ra, rng.uniform(-math.pi, math.pi)),
            goal=Goal(
                x0 + resolution * cb,
                y0 + resolution * rb,
                tolerance=0.25,
                theta=rng.uniform(-math.pi, math.pi),
                speed_tolerance=0.05,
            ),
            planning=MAP_PLANNING,
        )
        yield scenario, float(dijkstra(graph, directed=False, indices=a)[b])


def main() -> None:
    """Print one table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--dynobench", type=Path, nargs="*", default=[], help="problems of dynobench's")
    parser.add_argument("--model", type=Path, help="the model of dynobench's robot")
    parser.add_argument("--clearance", type=float, default=0.0, help="distance to keep in dynobench's problems [m]")
    parser.add_argument("--maps", type=Path, nargs="*", default=[], help="maps in which the TurtleBot3 plans")
    parser.add_argument("--facing", action="store_true", help="turn the starts of --maps along the way")
    parser.add_argument("--barn", type=Path, nargs="*", default=[], help="CSV files of discs in which the Jackal plans")
    parser.add_argument("--grid", type=Path, nargs="*", default=[], help="maps in which the Jackal arrives at rest")
    parser.add_argument("--scenes", nargs="*", default=[], help="scenarios, or problems of dynobench's, to compare in")
    parser.add_argument("--pairs", type=int, default=100, help="random pairs of poses in a map")
    parser.add_argument("--seeds", type=int, default=100, help="plans of one problem")
    parser.add_argument("--budget", type=float, default=200.0, help="CPU time of a plan [ms]")
    arguments = parser.parse_args()
    budget = 1e-3 * arguments.budget
    for scene in arguments.scenes:
        is_dynobench = scene.endswith(".yaml") and arguments.model is not None
        scenario = load_dynobench(scene, arguments.model, tolerance=0.03) if is_dynobench else load_scenario(scene)
        report_scene(Path(scene).stem, scenario, arguments.seeds)
    for path in arguments.dynobench:
        for name, scenario in dynobench_cases(path, arguments.model, arguments.clearance):
            report(f"{name} [s]", [scenario] * arguments.seeds, budget, [1.0] * arguments.seeds)
        print(f"{path.stem} published: {PUBLISHED.get(path.stem, math.nan)} s")
    for path in arguments.maps:
        scenarios = [s for s in map_scenarios(path, arguments.pairs) if shortest_duration(s) > 0.0]
        if arguments.facing:
            scenarios = [facing_its_way(scenario, seed) for seed, scenario in enumerate(scenarios)]
        report(f"{path.stem} / bound", scenarios, budget, [shortest_duration(s) for s in scenarios])
    for path in arguments.barn:
        scenarios = list(barn_scenarios(path, arguments.seeds))
        report(f"{path.stem} / bound", scenarios, budget, [shortest_duration(scenarios[0])] * len(scenarios))
    for path in arguments.grid:
        pairs = [pair for pair in grid_scenarios(path, arguments.pairs) if pair[1] > 1.0]
        report(f"{path.stem} length / grid path", [s for s, _ in pairs], budget, [r for _, r in pairs], by_length=True)


if __name__ == "__main__":
    main()
