"""Whether the clearance map ever differs from FCL: the worlds and footprints of its tests, with many more states.

For every pair there are two lines: states drawn uniformly, and states within 1 cm of the boundary of validity. Each
state is asked of FCL, of the map as a whole, and of the certificate that the map holds for it afterwards. Building the
map is timed by the first 1,000 states of a kind; the second kind goes on with the map of the first.

    python benchmarks/certificates.py --states 100000
    python benchmarks/certificates.py --states 1000000 --worlds boxes discs
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from test_clearance_map import FOOTPRINTS, WORLDS, border_poses, compare, uniform_poses  # noqa: E402

from cbrrt_ompl.collision.clearance_map import ClearanceMap  # noqa: E402

FIRST_STATES = 1000
"""States that the map is grown for while the clock runs."""


def main() -> int:
    """Print one table; the exit code is 1 where any answer differed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--states", type=int, default=10_000, help="states of each kind, for each world and footprint")
    parser.add_argument("--worlds", nargs="+", default=list(WORLDS), choices=list(WORLDS))
    parser.add_argument("--footprints", nargs="+", default=list(FOOTPRINTS), choices=list(FOOTPRINTS))
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    print(
        f"{'world':<29}{'footprint':<19}{'states':<9}{'number':>10}{'differ':>8}{'collide':>9}{'by map':>9}"
        f"{'cells':>9}{'by FCL':>9}{'built in':>10}"
    )
    total = differing = 0
    for name in arguments.worlds:
        world = WORLDS[name]()
        for kind in arguments.footprints:
            footprint = FOOTPRINTS[kind]
            clearance_map, collides = ClearanceMap(world, footprint), world.checker(footprint).collides
            rng = np.random.default_rng(arguments.seed)
            border = border_poses(world, footprint, rng)
            for where, poses in (("anywhere", uniform_poses(world, rng)), ("border", border)):
                clearance_map.exact_queries = 0
                first = [next(poses) for _ in range(FIRST_STATES)]
                began = time.perf_counter()
                for pose in first:
                    clearance_map.collides(*pose)
                elapsed = time.perf_counter() - began
                found = compare(clearance_map, collides, poses, arguments.states)
                total, differing = total + found.states, differing + found.disagreements
                print(
                    f"{name:<29}{kind:<19}{where:<9}{found.states:>10,}{found.disagreements:>8}"
                    f"{found.in_collision / found.states:>9.1%}{found.certified / found.states:>9.1%}"
                    f"{clearance_map.cells:>9,}{clearance_map.exact_queries:>9,}{elapsed:>8.3f} s",
                    flush=True,
                )
    print(f"{total:,} states, {differing} answered differently")
    return int(differing > 0)


if __name__ == "__main__":
    sys.exit(main())
