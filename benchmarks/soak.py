"""Whether many plans in one process leave memory behind, for every planner.

A goal out of reach makes every plan draw all its samples. Resident memory is to be flat after the first plans; the
process ends with exit code 1 where it is not.

    python benchmarks/soak.py --plans 200
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

from cbrrt_ompl import Bounds, Box, Goal, PlanningSettings, Scenario, State, World, plan
from cbrrt_ompl.planners.registry import PLANNERS

WARM_UP = 20
"""Plans before memory is to be flat: caches fill, the allocator finds its level."""

LEAKS_IN_OMPL = {"sst"}  # OMPL 1.7.0 frees not all that SST prunes, without any part of ours too

ALLOWED = 1.0  # growth [MB] that is put down to the allocator


def resident_memory() -> float:
    """Resident memory of this process [MB]."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def scenario(samples: int) -> Scenario:
    """A wall to drive around, and a goal that nobody hits."""
    return Scenario(
        name="soak",
        world=World(Bounds((0.0, 0.0), (10.0, 10.0)), [Box((4.8, 0.0), (5.0, 6.0))]),
        start=State(2.0, 2.0),
        goal=Goal(8.0, 8.0, tolerance=1e-9),
        planning=PlanningSettings(max_samples=samples),
    )


def main() -> int:
    """Print one table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--plans", type=int, default=200, help=f"plans of each planner, more than {WARM_UP}")
    parser.add_argument("--samples", type=int, default=200, help="samples of each plan")
    parser.add_argument("--planners", nargs="+", choices=PLANNERS, default=list(PLANNERS))
    arguments = parser.parse_args()
    if arguments.plans <= WARM_UP:
        parser.error(f"--plans: got {arguments.plans}, expected more than {WARM_UP}")
    problem = scenario(arguments.samples)
    heads = (f"plan {WARM_UP}", f"plan {arguments.plans}", "growth", "seconds")
    print(f"{'resident memory [MB]':<24}" + "".join(f"{head:>12}" for head in heads))
    has_grown = False
    for planner in arguments.planners:
        began = time.perf_counter()
        for seed in range(WARM_UP):
            plan(problem, planner, seed=seed, time_limit=60.0)
        before = resident_memory()
        for seed in range(WARM_UP, arguments.plans):
            plan(problem, planner, seed=seed, time_limit=60.0)
        growth = resident_memory() - before
        has_grown |= growth > ALLOWED and planner not in LEAKS_IN_OMPL
        line = f"{planner:<24}{before:>12.1f}{before + growth:>12.1f}{growth:>12.2f}"
        print(f"{line}{time.perf_counter() - began:>12.1f}", flush=True)
    return int(has_grown)


if __name__ == "__main__":
    sys.exit(main())
