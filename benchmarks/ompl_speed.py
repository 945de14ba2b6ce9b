"""What a round of a planner costs inside OMPL, with compiled and with Python methods behind OMPL's virtual calls.

A round is one pass of the planner's main loop: one extension attempt of cb-rrt and s-rrt. The goal is out of reach, so
that every run has as many rounds as asked. Printed is the CPU time, in microseconds, of a mean of some seeds, each at
its best of some repetitions; both kinds of methods take turns, and find the same trees. The rounds are counted as
`plan` counts them. Our planners count their samples, and are measured under OMPL's own time limit as well.

    python benchmarks/ompl_speed.py
    python benchmarks/ompl_speed.py --planners cb-rrt rrt --rounds 2000 --robot rectangle
"""

from __future__ import annotations

import argparse
import math
import os
import time
from dataclasses import replace

from cbrrt_ompl import Footprint, Goal, Robot, Scenario, load_scenario
from cbrrt_ompl.ompl_plugin.binding import ou
from cbrrt_ompl.ompl_plugin.compiled_methods import VARIABLE
from cbrrt_ompl.ompl_plugin.rounds import Rounds
from cbrrt_ompl.ompl_plugin.run import count_nodes, quiet_ompl
from cbrrt_ompl.ompl_plugin.setup import make_setup
from cbrrt_ompl.planners.registry import PLANNERS, Backend
from cbrrt_ompl.planning import warm_up_planner

TIME_LIMIT = 0.01
"""Of a run under OMPL's own time limit, some 2,000 attempts [s]."""
OUT_OF_REACH = Goal(0.0, 0.0, tolerance=1e-12)
FOOTPRINTS = {
    "point": Footprint.point(),
    "disc": Footprint.disc(0.15),
    "rectangle": Footprint.polygon([(-0.15, -0.1), (0.15, -0.1), (0.15, 0.1), (-0.15, 0.1)]),
}


def cost(scenario: Scenario, planner: str, rounds: int, seed: int) -> tuple[float, int]:
    """CPU time of some rounds [s], and the nodes they made."""
    with quiet_ompl():
        ou.RNG.setSeed(1 + seed)
        setup = make_setup(scenario, planner)
        setup.setup()
        with Rounds(rounds, lambda _: False).condition() as condition:
            began = time.process_time()
            setup.solve(condition)
            used = time.process_time() - began
        return used, count_nodes(setup.getPlanner(), setup.getSpaceInformation())


def costs(
    scenario: Scenario, planner: str, rounds: int, seeds: int, repetitions: int, python_repetitions: int
) -> tuple[float, float, float]:
    """Microseconds a round with compiled and with Python methods, each seed at its best, and nodes a run."""
    best = {kind: [math.inf] * seeds for kind in ("1", "0")}
    nodes: dict[str, list[int]] = {}
    for repetition in range(repetitions):
        for kind in best:
            if kind == "0" and repetition >= python_repetitions:
                continue
            os.environ[VARIABLE] = kind
            found = [cost(scenario, planner, rounds, seed) for seed in range(seeds)]
            best[kind] = [min(before, seconds) for before, (seconds, _) in zip(best[kind], found, strict=True)]
            nodes[kind] = [count for _, count in found]
    if nodes["0"] != nodes["1"]:
        raise AssertionError(f"{planner}: compiled and Python methods make other trees")
    compiled, python = (1e6 * sum(best[kind]) / (rounds * seeds) for kind in ("1", "0"))
    return compiled, python, sum(nodes["1"]) / seeds


def cost_by_the_clock(scenario: Scenario, planner: str, seeds: int, repetitions: int) -> float:
    """Microseconds an extension attempt under OMPL's own time limit, of the best of some runs, compiled methods."""
    os.environ[VARIABLE] = "1"
    best = math.inf
    with quiet_ompl():
        for seed in seeds * list(range(1, repetitions + 1)):
            ou.RNG.setSeed(seed)
            setup = make_setup(scenario, planner)
            setup.setup()
            began = time.process_time()
            setup.solve(TIME_LIMIT)
            best = min(best, (time.process_time() - began) / max(setup.getPlanner().samples, 1))
    return 1e6 * best


def main() -> None:
    """Print one table."""
    planners = [name for name, planner in PLANNERS.items() if planner.backend is not Backend.COMPILED]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--planners", nargs="+", default=planners)
    parser.add_argument("--rounds", type=int, default=500)
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--repetitions", type=int, default=7)
    parser.add_argument("--python-repetitions", type=int, default=2, help="the Python methods are slow (default 2)")
    parser.add_argument("--robot", nargs="+", choices=list(FOOTPRINTS), default=["point", "rectangle"])
    parser.add_argument("--scenario", default="paper_case1")
    arguments = parser.parse_args()
    base = load_scenario(arguments.scenario)
    base = replace(base, goal=OUT_OF_REACH, planning=replace(base.planning, max_samples=10**9))
    print(f"us of CPU a round, {arguments.rounds} rounds, {arguments.scenario}")
    print(f"{'':24}{'compiled':>10}{'Python':>10}{'ratio':>8}{'nodes':>8}")
    for robot in arguments.robot:
        scenario = replace(base, robot=Robot(FOOTPRINTS[robot], base.robot.limits, base.robot.gains))
        for planner in arguments.planners:
            warm_up_planner(planner)
            cost(scenario, planner, 10, 0)
            compiled, python, nodes = costs(
                scenario,
                planner,
                arguments.rounds,
                arguments.seeds,
                arguments.repetitions,
                arguments.python_repetitions,
            )
            name = f"{robot}: {planner}"
            print(f"{name:24}{compiled:>10.2f}{python:>10.1f}{python / compiled:>8.1f}{nodes:>8.0f}", flush=True)
            if PLANNERS[planner].backend is Backend.PLUGIN:
                by_the_clock = cost_by_the_clock(scenario, planner, arguments.seeds, arguments.repetitions)
                print(f"{'  under a time limit':24}{by_the_clock:>10.2f}", flush=True)


if __name__ == "__main__":
    main()
