"""The price of keeping only what the robot can brake from (planning.brake_safe): nodes, time, duration, success.

python benchmarks/brake_safe.py --runs 200
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from cbrrt_ompl import PlanResult, load_scenario, plan

SCENARIOS = Path(__file__).parents[1] / "scenarios"


def middle(values: list[float]) -> float:
    """Median, failures being infinite."""
    return float(np.quantile(values, 0.5, method="inverted_cdf"))


def figures(results: list[PlanResult]) -> tuple[float, float, float, int]:
    """Median nodes, planning time [ms] and duration [s], and how many were solved."""
    solved = [r for r in results if r.trajectory is not None]
    return (
        middle([r.nodes if r.solved else np.inf for r in results]),
        1e3 * middle([r.planning_time if r.solved else np.inf for r in results]),
        middle([r.trajectory.duration for r in solved if r.trajectory is not None]) if solved else np.inf,
        len(solved),
    )


def main() -> None:
    """Print one table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--planner", default="cb-rrt-compiled")
    parser.add_argument(
        "--scenes", nargs="+", default=["paper_case1", "paper_case2", "office", "maze", "slalom", "dock"]
    )
    parser.add_argument("--time-limit", type=float, default=10.0, help="[s]")
    arguments = parser.parse_args()
    print(f"{'scene':<14}{'brake-safe':>11}{'nodes':>9}{'ms':>9}{'duration s':>12}{'solved':>9}")
    for scene in arguments.scenes:
        scenario = load_scenario(SCENARIOS / f"{scene}.yaml")
        variants = {
            safe: replace(scenario, planning=replace(scenario.planning, brake_safe=safe)) for safe in (False, True)
        }
        found: dict[bool, list[PlanResult]] = {False: [], True: []}
        for seed in range(-5, arguments.runs):  # in turn, so that both have the same machine; the first warm up
            for safe, variant in variants.items():
                result = plan(variant, arguments.planner, seed=abs(seed), time_limit=arguments.time_limit)
                if seed >= 0:
                    found[safe].append(result)
        for safe, results in found.items():
            nodes, ms, duration, solved = figures(results)
            word = "yes" if safe else "no"
            print(
                f"{scene:<14}{word:>11}{nodes:>9.0f}{ms:>9.1f}{duration:>12.1f}{solved:>5}/{len(results)}", flush=True
            )


if __name__ == "__main__":
    main()
