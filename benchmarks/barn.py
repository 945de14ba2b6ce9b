"""The metric of the BARN challenge, for drives with nothing known at first and a sensor that obstacles block.

A drive scores OT / clip(AT, 2 OT, 8 OT) if it reaches the goal and touches nothing, else 0: AT is its time, OT that
of the world's reference path at 2 m/s (D. Perille et al., "Benchmarking metric ground navigation", SSRR 2020, and
the rules of github.com/Daffan/the-barn-challenge). The best score is 0.5. Unlike there, AT begins with the first
plan and not once the robot has moved 0.1 m, and robot and sensor are exact and not simulated. A drive is judged by
FCL in the true world, at points of its motion a millimetre apart.

The folder holds the challenge's worlds, world_N.world or world_N.csv (discs x, y, radius), with their path_N.npy.
Nothing is downloaded.

    python benchmarks/barn.py FOLDER --seeds 2
"""

from __future__ import annotations

import argparse
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from drive_worlds import touches
from maps import BARN_BOUNDS, BARN_PLANNING, JACKAL
from numpy.typing import NDArray

from cbrrt_ompl import Disc, Goal, Scenario, State, World
from cbrrt_ompl.drive import DriveResult, DriveSettings, drive
from cbrrt_ompl.scenario.maps.discs import load_discs

START, GOAL = State(-2.25, 3.0, 1.57), Goal(-2.25, 13.0, tolerance=1.0)
TOP_SPEED = 2.0
"""Of the reference path [m/s]."""

SETTINGS = DriveSettings(sensor_range=5.0, line_of_sight=True, max_samples=2000, max_iterations=600)


class Score(NamedTuple):
    """What came of one drive."""

    world: str
    seed: int
    reached: bool
    collided: bool
    time: float
    """Of the drive [s]."""
    optimal_time: float
    """Of the reference path at top speed [s]."""
    metric: float
    late: float
    """Fraction of the cycles whose computing took longer than the cycle."""
    longest_cycle: float
    """Time of the most computing in a cycle [s]."""


def load_world(path: Path) -> list[Disc]:
    """The cylinders of a world as discs: of a .world file of Gazebo's, or a CSV file."""
    if path.suffix == ".csv":
        return load_discs(path)
    discs = []
    for model in ElementTree.parse(path).getroot().findall("world/model"):
        radius, pose = model.find("link/collision/geometry/cylinder/radius"), model.find("pose")
        if radius is not None and pose is not None and radius.text and pose.text:
            x, y = map(float, pose.text.split()[:2])
            discs.append(Disc((x, y), float(radius.text)))
    return discs


def optimal_time(path: Path) -> float:
    """Time of a reference path, given in cells of 0.15 m, from the start to the goal at top speed [s]."""
    cells = np.load(path)
    points = np.vstack([START[:2], 0.15 * cells + (-4.575, 5.075), (GOAL.x, GOAL.y)])
    return float(np.hypot(*np.diff(points, axis=0).T).sum()) / TOP_SPEED


def metric(reached: bool, time: float, optimal: float) -> float:
    """The challenge's score of a drive, 0 to 0.5."""
    return reached * optimal / min(max(time, 2.0 * optimal), 8.0 * optimal)


def worlds_in(folder: Path) -> list[tuple[Path, Path]]:
    """Worlds of a folder that have a reference path, by number, with these."""
    found = [path for path in folder.iterdir() if re.fullmatch(r"world_\d+\.(world|csv)", path.name)]
    pairs = [(path, folder / f"path_{path.stem[6:]}.npy") for path in sorted(found, key=lambda p: int(p.stem[6:]))]
    return [pair for pair in pairs if pair[1].is_file()]


def barn_drive(world: Path, seed: int, settings: DriveSettings = SETTINGS) -> DriveResult:
    """One drive through a world."""
    scenario = Scenario(
        name=world.stem,
        world=World(BARN_BOUNDS, load_world(world)),
        robot=JACKAL,
        start=START,
        goal=GOAL,
        planning=BARN_PLANNING,
    )
    return drive(scenario, None, settings, seed)


def score(world: Path, path: Path, seed: int, settings: DriveSettings = SETTINGS) -> Score:
    """Drive through a world and judge the drive."""
    result = barn_drive(world, seed, settings)
    collided, time, optimal = touches(result), result.trajectory.duration, optimal_time(path)
    computing = result.computing_times
    return Score(
        world=world.stem,
        seed=seed,
        reached=result.reached,
        collided=collided,
        time=time,
        optimal_time=optimal,
        metric=metric(result.reached and not collided, time, optimal),
        late=float((computing > settings.cycle).mean()),
        longest_cycle=float(computing.max(initial=0.0)),
    )


def mean_interval(values_by_world: Sequence[NDArray[np.float64]]) -> tuple[float, float, float]:
    """Mean over worlds of their means, and its 95 % interval by resampling worlds."""
    means = np.array([values.mean() for values in values_by_world])
    draws = np.random.default_rng(0).choice(means, size=(5000, len(means))).mean(axis=1)
    low, high = np.quantile(draws, (0.025, 0.975))
    return float(means.mean()), float(low), float(high)


def main() -> None:
    """Print one table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="world_N.world or world_N.csv, and path_N.npy")
    parser.add_argument("--seeds", type=int, default=1, help="drives through each world")
    parser.add_argument("--real-time", action="store_true", help="limit plans by the cycle's time, not by samples")
    parser.add_argument("--sees-all", action="store_true", help="obstacles hide nothing")
    arguments = parser.parse_args()
    settings = replace(SETTINGS, line_of_sight=not arguments.sees_all)
    if arguments.real_time:
        settings = replace(settings, max_samples=None)
    worlds = worlds_in(arguments.folder)
    if not worlds:
        parser.error(f"no world_N.world or world_N.csv with its path_N.npy in {arguments.folder}")
    print(f"{'world':<12}{'seed':>5}  {'outcome':<9}{'AT s':>7}{'OT s':>7}{'metric':>8}{'late':>7}")
    scores: dict[str, list[Score]] = {}
    for world, path in worlds:
        for seed in range(arguments.seeds):
            s = score(world, path, seed, settings)
            scores.setdefault(s.world, []).append(s)
            outcome = "collided" if s.collided else "reached" if s.reached else "stopped"
            print(
                f"{s.world:<12}{s.seed:>5}  {outcome:<9}{s.time:>7.2f}{s.optimal_time:>7.2f}{s.metric:>8.4f}"
                f"{s.late:>7.1%}",
                flush=True,
            )
    every = [s for group in scores.values() for s in group]
    times = [s.time for s in every if s.reached]
    print(f"worlds, drives      {len(scores)}, {len(every)}")
    print(f"reached             {sum(s.reached for s in every)}")
    print(f"collisions          {sum(s.collided for s in every)}")
    print(f"time, median, worst {np.median(times):.2f}, {max(times):.2f} s" if times else "time  none")
    for name, column in (("metric", "metric"), ("late cycles", "late")):
        mean, low, high = mean_interval([np.array([getattr(s, column) for s in group]) for group in scores.values()])
        print(f"{name:<20}{mean:.4f} (95 %: {low:.4f} to {high:.4f})")


if __name__ == "__main__":
    main()
