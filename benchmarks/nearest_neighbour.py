"""What a nearest-neighbour query costs: grid, k-d tree and brute force, by the number of nodes.

Nodes and queries are drawn uniformly; with --spread, the nodes from a part of the world in its lower left corner, as
where a tree has not left its room. Every figure is the median of some repetitions, each on other nodes.

    python benchmarks/nearest_neighbour.py --sizes 100 1000 10000 100000 1000000
    python benchmarks/nearest_neighbour.py --spread 0.1
"""

from __future__ import annotations

import argparse

import numpy as np

from cbrrt_ompl.planners.nearest import KINDS
from cbrrt_ompl.reproduce.neighbours import query_cost


def main() -> None:
    """Print one table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", type=int, nargs="+", default=[10**2, 10**3, 10**4, 10**5, 10**6])
    parser.add_argument("--queries", type=int, default=100_000, help="queries of a repetition, at most")
    parser.add_argument("--repetitions", type=int, default=5)
    parser.add_argument("--spread", type=float, default=1.0, help="side of the nodes' area, as a share of the world's")
    arguments = parser.parse_args()
    print(f"{'ns per query':>12}" + "".join(f"{name:>24}" for name in KINDS))
    for size in arguments.sizes:
        costs = {
            name: np.median(
                [
                    query_cost(kind, size, arguments.spread, arguments.queries, seed)
                    for seed in range(arguments.repetitions)
                ]
            )
            for name, kind in KINDS.items()
        }
        cells = (f"{1e9 * value:>13,.0f} ({value / costs['grid']:>7.1f}x)" for value in costs.values())
        print(f"{size:>12,}" + "".join(f"{cell:>24}" for cell in cells), flush=True)


if __name__ == "__main__":
    main()
