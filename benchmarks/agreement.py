"""Whether exact distances and FCL agree about poses, and with shapely about distances.

Half of the poses are uniform in the bounds, half are within 1 cm of contact. Poses whose answers differ are listed with
the distance that shapely gives, which tells who is right. Within `CONTACT_BAND` FCL decides, so those are left out.

    python benchmarks/agreement.py --poses 200000 --seed 1
"""

from __future__ import annotations

import argparse
import math
import time

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl import Bounds, Box, Disc, Footprint, OrientedBox, Polygon, World
from cbrrt_ompl.collision.clearance import clearances_at
from cbrrt_ompl.collision.world import CONTACT_BAND
from cbrrt_ompl.verification.distances import Distances

SIDE = 10.0
FOOTPRINTS = {
    "point": Footprint.point(),
    "disc": Footprint.disc(0.2),
    "rectangle": Footprint.polygon([(-0.2, -0.15), (0.2, -0.15), (0.2, 0.15), (-0.2, 0.15)]),
    "rectangle off the origin": Footprint.polygon([(-0.1, -0.15), (0.5, -0.15), (0.5, 0.15), (-0.1, 0.15)]),
    "arrow": Footprint.polygon([(-0.3, -0.25), (0.4, 0.0), (-0.3, 0.25), (-0.1, 0.0)]),
    "beside the origin": Footprint.polygon([(0.2, 0.1), (0.5, 0.1), (0.4, 0.4), (0.25, 0.3)]),
}


def worlds(rng: np.random.Generator) -> dict[str, World]:
    """Worlds of all kinds of obstacles, by name."""

    def at(offset: float = 0.0) -> Bounds:
        return Bounds((offset, offset), (offset + SIDE, offset + SIDE))

    def place(offset: float = 0.0) -> tuple[float, float]:
        x, y = (offset + rng.uniform(0.0, SIDE, 2)).tolist()
        return x, y

    def boxes(count: int, offset: float = 0.0) -> list[Box]:
        lows = [place(offset) for _ in range(count)]
        return [Box((x, y), (x + rng.uniform(0.01, 0.8), y + rng.uniform(0.01, 0.8))) for x, y in lows]

    def turned(count: int) -> list[OrientedBox]:
        sizes = rng.uniform(0.001, 0.8, (count, 2)).tolist()
        return [OrientedBox(place(), (w, h), float(rng.uniform(-math.pi, math.pi))) for w, h in sizes]

    def discs(count: int) -> list[Disc]:
        return [Disc(place(), float(rng.uniform(0.01, 0.4))) for _ in range(count)]

    def polygons(count: int) -> list[Polygon]:
        found = []
        for _ in range(count):
            corners = int(rng.integers(3, 12))
            angles = 2.0 * math.pi / corners * (np.arange(corners) + rng.uniform(0.0, 0.9, corners))
            radii = rng.uniform(0.1, 0.7, (corners, 1))
            found.append(Polygon(place() + radii * np.column_stack([np.cos(angles), np.sin(angles)])))
        return found

    grid = rng.random((100, 100)) < 0.1
    return {
        "100 boxes": World(at(), boxes(100)),
        "100 turned boxes": World(at(), turned(100)),
        "100 discs": World(at(), discs(100)),
        "60 polygons": World(at(), polygons(60)),
        "all together": World(at(), [*boxes(20), *turned(20), *discs(20), *polygons(20)]),
        "grid": World.from_grid(grid, 0.1),
        "turned grid": World.from_grid(grid, 0.1, (1.0, -2.0, 0.7)),
        "700 km away": World(at(4e5), boxes(40, 4e5)),
    }


def poses_in(world: World, footprint: Footprint, count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Poses, the second half of them moved to within 1 cm of contact, shape (count, 3)."""
    low, high = (*world.bounds.min, -math.pi), (*world.bounds.max, math.pi)
    poses = rng.uniform(low, high, (count, 3))
    scene, near = world.scene(footprint), poses[count // 2 :]
    directions = rng.uniform(-math.pi, math.pi, len(near))
    steps = np.column_stack([np.cos(directions), np.sin(directions), np.zeros(len(near))])
    a, b = near.copy(), near + 2.0 * steps  # on one side and the other of a border, if there is one between them
    sign = clearances_at(scene, a) > 0.0
    for _ in range(9):
        middle = 0.5 * (a + b)
        same = (clearances_at(scene, middle) > 0.0) == sign
        a[same], b[~same] = middle[same], middle[~same]
    near[:] = a + rng.uniform(-1.0, 1.0, (len(near), 1)) * rng.choice([1e-2, 1e-3, 1e-5], (len(near), 1)) * steps
    return poses


def main() -> None:
    """Print a row a world and footprint, and every pose about which the answers differ."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--poses", type=int, default=20_000, help="for each world and footprint")
    parser.add_argument("--distances", type=int, default=2_000, help="of them, whose distances shapely computes again")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    total = differing = 0
    print(f"{'world':<18}{'footprint':<26}{'poses':>9}{'in band':>9}{'differ':>8}", end="")
    print(f"{'distance':>11}{'ours':>9}{'FCL':>10}")
    for name, world in worlds(rng).items():
        for shape, footprint in FOOTPRINTS.items():
            poses = poses_in(world, footprint, arguments.poses, rng)
            began = time.process_time()
            found = clearances_at(world.scene(footprint), poses)
            ours = (time.process_time() - began) / len(poses)
            judged = np.flatnonzero(np.abs(found) > CONTACT_BAND)
            began = time.process_time()
            referee = world.referee(footprint)
            hits = np.array([referee.collides(*pose) for pose in poses[judged].tolist()])
            fcl = (time.process_time() - began) / max(len(judged), 1)
            wrong = judged[hits != (found[judged] < 0.0)]
            distances = Distances(world, footprint)
            some = rng.choice(len(poses), min(arguments.distances, len(poses)), replace=False)
            exact = distances.at(poses[some])
            free = exact > 0.0
            error = float(np.abs(found[some] - exact)[free].max(initial=0.0)) / max(world.bounds.size)
            total, differing = total + len(judged), differing + len(wrong)
            print(
                f"{name:<18}{shape:<26}{len(poses):>9,}{len(poses) - len(judged):>9,}{len(wrong):>8}{error:>11.1e}"
                f"{1e9 * ours:>6.0f} ns{1e6 * fcl:>7.1f} us",
                flush=True,
            )
            for i in wrong:
                print(f"    {poses[i].tolist()}: ours {found[i]:.9g}, shapely {distances.at(poses[[i]])[0]:.9g}")
    print(f"{total:,} poses judged by both, {differing} answers differ")


if __name__ == "__main__":
    main()
