"""Compare the planners with the figures of the prototype that fixed our readings of the paper.

The prototype's quartiles cut its runs into four equal parts. If our runs come from the same distribution, they fall
into these parts in equal numbers but for chance: a chi-squared statistic over the four counts, scaled for the fact
that the cuts themselves come from a sample (400 runs of the prototype), gives the p-value. Failures count as infinite.

    python benchmarks/paper_statistics.py --runs 200
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np

from cbrrt_ompl import load_scenario, plan, verify

PROTOTYPE_RUNS = 400
PROTOTYPE = {  # nodes: quartiles; share solved; duration of the trajectory [s] (PAPER: readings)
    ("paper_case1", "cb-rrt"): ((131, 228, 368), 1.0, 23.3),
    ("paper_case1", "s-rrt"): ((495, 674, 908), 1.0, 28.8),
    ("paper_case2", "cb-rrt"): ((644, 1178, 2054), 1.0, 35.3),
    ("paper_case2_rooms", "cb-rrt"): ((702, 1390, 2532), 0.993, 31.4),
    ("paper_case2", "s-rrt"): (None, 0.0, None),
    ("paper_case2_rooms", "s-rrt"): (None, 0.0, None),
}
SCENARIOS = Path(__file__).parents[1] / "scenarios"


def p_value_of_quartiles(values: np.ndarray, cuts: tuple[float, ...]) -> float:
    """Probability of counts as uneven as these between the cuts, were the distributions equal."""
    counts = np.histogram(values, bins=[-math.inf, *cuts, math.inf])[0].astype(float)
    counts[-1] += len(values) - counts.sum()  # infinite values
    expected = len(values) / 4.0
    chi_squared = ((counts - expected) ** 2 / expected).sum() / (1.0 + len(values) / PROTOTYPE_RUNS)
    # survival function of the chi-squared distribution with 3 degrees of freedom
    x = math.sqrt(chi_squared)
    return math.erfc(x / math.sqrt(2.0)) + math.sqrt(2.0 / math.pi) * x * math.exp(-chi_squared / 2.0)


def main() -> None:
    """Run all pairs of scene and planner."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--suffix", default="", help="planner variant, such as -compiled")
    parser.add_argument("--failing-runs", type=int, default=20, help="runs where every run draws all samples")
    arguments = parser.parse_args()
    print(
        "scene             planner           solved  nodes: quartiles     prototype         p     samples"
        "  duration  verified  time [ms]: quartiles"
    )
    for (scene, planner), (cuts, share, duration) in PROTOTYPE.items():
        scenario = load_scenario(SCENARIOS / f"{scene}.yaml")
        runs = arguments.runs if cuts else arguments.failing_runs
        results = [plan(scenario, planner + arguments.suffix, seed=seed, time_limit=60.0) for seed in range(runs)]
        nodes = np.array([r.nodes if r.solved else math.inf for r in results])
        found = [r.trajectory for r in results if r.trajectory is not None]
        verified = sum(verify(trajectory, scenario).ok for trajectory in found)
        line = f"{scene:<17} {planner + arguments.suffix:<16} {len(found):>4}/{runs:<4}"
        if cuts is not None:
            quartiles = np.quantile(nodes, (0.25, 0.5, 0.75), method="inverted_cdf")
            p = p_value_of_quartiles(nodes, cuts)
            samples = np.median([r.samples for r in results])
            seconds = np.median([trajectory.duration for trajectory in found])
            milliseconds = 1e3 * np.quantile([r.planning_time for r in results], (0.25, 0.5, 0.75))
            line += f" {quartiles.tolist()!s:<20} {list(cuts)!s:<17} {p:5.3f} {samples:>7.0f}"
            line += f" {seconds:5.1f} ({duration}) {verified}/{len(found)} {milliseconds.round(2).tolist()}"
        print(line + (f"   expected {share:.1%} solved" if cuts is None else ""), flush=True)


if __name__ == "__main__":
    main()
