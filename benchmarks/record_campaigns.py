"""What is run for the page of records: a campaign takes a folder of maps and yields runs of planners in problems.

The folder has the subfolders dynobench, ros and barn: problems and models of github.com/quimortiz/dynobench, maps of
github.com/ros-navigation/navigation2, worlds and paths of github.com/Daffan/the-barn-challenge. Nothing is downloaded.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

from barn import SETTINGS, score, worlds_in
from improve import PLANNER as OURS
from improve import grid_scenarios, plan_for
from lower_bound import shortest_duration
from maps import map_scenarios

from cbrrt_ompl import (
    Bounds,
    Box,
    Footprint,
    Goal,
    Limits,
    Robot,
    Scenario,
    State,
    Trajectory,
    World,
    load_dynobench,
    plan,
    verify,
)

OMPLS = ("rrt", "kpiece1", "sst")
OMPL_TIME = 10.0
"""Time of a run of OMPL's planners [s]."""


class Run(NamedTuple):
    """One run; times and costs of runs that have failed count as infinite."""

    seed: int
    solved: bool
    verified: bool
    time: float
    """CPU time until the first trajectory; of a drive, that of its longest cycle [s]."""
    cost: float
    """What the page tells of the problem: a duration [s], a ratio, or a score."""


class Runs(NamedTuple):
    """The runs of one planner in one problem."""

    problem: str
    """One word."""
    planner: str
    time_limit: float
    """Of a run [s]."""
    runs: list[Run]


FAILED = Run(0, False, False, math.inf, math.inf)


def best_after(scenario: Scenario, seed: int, budget: float, cost: Callable[[Trajectory], float]) -> Run:
    """The best trajectory of the anytime planner after some CPU time [s]."""
    result, rows = plan_for(scenario, seed, budget)
    if result.trajectory is None:
        return FAILED._replace(seed=seed)
    return Run(seed, True, verify(result.trajectory, scenario).ok, rows[0][0], cost(result.trajectory))


def ours(
    problem: str, cases: Sequence[tuple[Scenario, float]], budget: float, cost: Callable[[Trajectory], float]
) -> Runs:
    """Runs of the anytime planner for some CPU time [s], their costs as multiples of references.

    Args:
        problem: one word.
        cases: scenarios, whose numbers are their seeds, and references.
        budget: CPU time of a run [s].
        cost: what a trajectory costs.
    """
    best_after(cases[0][0], 0, 0.05, cost)  # what is made once for a world
    runs = [
        best_after(scenario, seed, budget, partial(_in_terms_of, reference, cost))
        for seed, (scenario, reference) in enumerate(cases)
    ]
    return Runs(problem, OURS, budget, runs)


def first_of(scenario: Scenario, planner: str, seed: int, cost: Callable[[Trajectory], float]) -> Run:
    """The first trajectory of a planner, within `OMPL_TIME` and with any number of samples."""
    scenario = replace(scenario, planning=replace(scenario.planning, max_samples=10**9))
    began = time.process_time()
    result = plan(scenario, planner, seed, OMPL_TIME)
    elapsed = time.process_time() - began
    if result.trajectory is None:
        return FAILED._replace(seed=seed)
    return Run(seed, True, verify(result.trajectory, scenario).ok, elapsed, cost(result.trajectory))


def compared(problem: str, scenario: Scenario, seeds: int) -> Iterator[Runs]:
    """Ours for 200 ms, and the first trajectories of planners of OMPL's."""
    yield ours(problem, [(scenario, 1.0)] * 20, 0.2, duration)
    for planner in OMPLS:
        plan(scenario, planner, 0, 0.01)
        yield Runs(problem, planner, OMPL_TIME, [first_of(scenario, planner, seed, duration) for seed in range(seeds)])


def duration(trajectory: Trajectory) -> float:
    """What a trajectory costs, mostly [s]."""
    return trajectory.duration


def _in_terms_of(reference: float, cost: Callable[[Trajectory], float], trajectory: Trajectory) -> float:
    """A trajectory's cost in terms of a reference."""
    return cost(trajectory) / reference


def length(trajectory: Trajectory) -> float:
    """Its path length [m]."""
    return trajectory.length


def dynobench(data: Path, order: int) -> Iterator[Runs]:
    """Unicycles, with the tolerance for optimisers."""
    model = file_of(data, f"dynobench/unicycle{order}_v0.yaml")
    for name in ("bugtrap", "kink", "parallelpark"):
        problem = file_of(data, f"dynobench/{'' if order == 2 else 'unicycle1_'}{name}_0.yaml")
        scenario = load_dynobench(problem, model, tolerance=0.03)
        yield ours(f"unicycle{order}_{name}", [(scenario, 1.0)] * 20, 0.2, duration)


def dynobench_for_samplers(data: Path) -> Iterator[Runs]:
    """Unicycles of second order with the tolerance for samplers, planners of OMPL's among them."""
    model = file_of(data, "dynobench/unicycle2_v0.yaml")
    for name in ("bugtrap", "kink", "parallelpark"):
        scenario = load_dynobench(file_of(data, f"dynobench/{name}_0.yaml"), model, tolerance=0.2)
        yield from compared(f"unicycle2_{name}_wide", scenario, 5)


def nav2(data: Path) -> Iterator[Runs]:
    """A Jackal that arrives with a heading and at rest in Nav2's map of 100 m x 100 m, 10 % occupied."""
    cases = [pair for pair in grid_scenarios(file_of(data, "ros/100by100_10.yaml"), 30) if pair[1] > 1.0]
    yield ours("100by100_10", cases, 0.15, length)


def ros_maps(data: Path) -> Iterator[Runs]:
    """A TurtleBot3 Waffle Pi between random free poses of maps, against a lower bound on the duration."""
    for name in ("ros/depot.yaml", "ros/tb3_sandbox.yaml", "ros/small_warehouse/map.yaml"):
        scenarios = map_scenarios(file_of(data, name), 30)
        cases = [(scenario, bound) for scenario in scenarios if (bound := shortest_duration(scenario)) > 0.0]
        problem = name.removeprefix("ros/").removesuffix(".yaml").replace("/map", "")
        yield ours(problem, cases, 0.1, duration)


def barn(data: Path) -> Iterator[Runs]:
    """The BARN challenge's metric of one drive through each world; the number of a run is the world's.

    Once with plans that are limited by samples, and once by the clock.
    """
    worlds = worlds_in(data / "barn") if (data / "barn").is_dir() else []
    if not worlds:
        raise FileNotFoundError("barn/world_N.world or world_N.csv, with path_N.npy")
    for problem, settings in (("BARN", SETTINGS), ("BARN_by_the_clock", replace(SETTINGS, max_samples=None))):
        scores = [score(world, path, 0, settings) for world, path in worlds]
        numbers = [int(world.stem[6:]) for world, _ in worlds]
        runs = [
            Run(number, s.reached, not s.collided, s.longest_cycle, s.metric)
            for number, s in zip(numbers, scores, strict=True)
        ]
        yield Runs(problem, "drive", math.inf, runs)


def aisle(data: Path) -> Iterator[Runs]:
    """From one aisle of 1.1 m into the next, around the end of the rack: a robot of 0.62 m x 0.9 m."""
    yield from compared("aisle", aisle_scenario(), 5)


def aisle_scenario() -> Scenario:
    """Two aisles of 1.1 m, and one of 1.1 m between them; the robot's diagonal is 1.093 m."""
    outline = [(-0.45, -0.31), (0.45, -0.31), (0.45, 0.31), (-0.45, 0.31)]
    return Scenario(
        name="aisle",
        world=World(Bounds((0.0, 0.0), (8.0, 3.2)), [Box((0.0, 1.1), (6.9, 2.1))]),
        robot=Robot(Footprint.polygon(outline), Limits(-0.3, 1.0, -1.0, 1.0, 0.6, 2.0)),
        start=State(1.0, 0.55),
        goal=Goal(1.0, 2.65, tolerance=0.2, theta=math.pi, heading_tolerance=0.1),
    )


def movingai(data: Path) -> Iterator[Runs]:
    """City maps of the MovingAI benchmarks: a point robot's paths against the published lengths over the cells."""
    found: Sequence[Path] = sorted((data / "movingai").glob("*.scen")) if (data / "movingai").is_dir() else ()
    if not found:
        raise FileNotFoundError("movingai/NAME.map.scen with NAME.map")
    for scen in found:
        yield Runs(scen.name.split(".")[0], OURS, 0.2, list(_movingai_runs(scen)))


def _movingai_runs(scen: Path) -> Iterator[Run]:
    """A run for each twentieth of the longest problems of a file; cells have a side of 1 m."""
    from cbrrt_ompl import load_map

    rows = [line.split("\t") for line in scen.read_text(encoding="utf-8").splitlines()[1:] if line.strip()]
    world, height = load_map(scen.with_suffix("")).to_world(), int(rows[0][3])
    robot = Robot(Footprint.disc(0.4), Limits(0.0, 2.0, -2.0, 2.0, 1.0, 4.0))
    for seed, row in enumerate(rows[:: max(len(rows) // 20, 1)]):
        (x0, y0, x1, y1), shortest = map(int, row[4:8]), max(float(row[8]), 1.0)
        scenario = Scenario(
            name=scen.stem,
            world=world,
            robot=robot,
            start=State(x0 + 0.5, height - y0 - 0.5),
            goal=Goal(x1 + 0.5, height - y1 - 0.5, tolerance=0.5),
        )
        yield best_after(scenario, seed, 0.2, partial(_in_terms_of, shortest, length))


def file_of(data: Path, name: str) -> Path:
    """A file of the folder.

    Raises:
        FileNotFoundError: with its name, if it is not there.
    """
    if not (data / name).is_file():
        raise FileNotFoundError(name)
    return data / name


CAMPAIGNS: dict[str, Callable[[Path], Iterator[Runs]]] = {
    "dynobench2": lambda data: dynobench(data, 2),
    "dynobench1": lambda data: dynobench(data, 1),
    "samplers": dynobench_for_samplers,
    "nav2": nav2,
    "maps": ros_maps,
    "aisle": aisle,
    "barn": barn,
    "movingai": movingai,
}
"""Campaigns by name."""
