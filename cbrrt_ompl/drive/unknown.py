"""Obstacles that nobody knows of at first: strewn at random, or read from a file."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from cbrrt_ompl.errors import InputError, Problem, ScenarioError
from cbrrt_ompl.problem.obstacles import Bounds, Disc, Obstacle, OrientedBox, signed_distance
from cbrrt_ompl.scenario.plain_yaml import read_yaml
from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.scenario.scenario_file import obstacle
from cbrrt_ompl.scenario.sections import Key, Report, list_of, read_partial

SIZES = (0.02, 0.06)
"""Smallest and largest radius of a random obstacle, as a share of the longer side of the bounds."""

ATTEMPTS = 1000
"""Random obstacles drawn for one that leaves start and goal alone, before giving up."""


def random_obstacles(
    bounds: Bounds, count: int, rng: np.random.Generator, keep_free: list[tuple[float, float, float]]
) -> list[Obstacle]:
    """Discs and turned boxes, half of each, that may overlap.

    Args:
        bounds: where their centres are.
        count: how many.
        rng: source of the random numbers.
        keep_free: discs (x, y, radius) that none of them touches [m].

    Raises:
        InputError: if there is no room for them.
    """
    made: list[Obstacle] = []
    for _ in range(ATTEMPTS * count):
        if len(made) == count:
            break
        center = float(rng.uniform(bounds.min[0], bounds.max[0])), float(rng.uniform(bounds.min[1], bounds.max[1]))
        a, b = (float(size) for size in rng.uniform(*SIZES, size=2) * max(bounds.size))
        angle = float(rng.uniform(-math.pi, math.pi))
        new = Disc(center, a) if rng.random() < 0.5 else OrientedBox(center, (2.0 * a, 2.0 * b), angle)
        if all(signed_distance(new, np.array([x]), np.array([y]))[0] > radius for x, y, radius in keep_free):
            made.append(new)
    if len(made) < count:
        raise InputError(Problem("unknown", count, f"at most {len(made)} obstacles: there is no room for more"))
    return made


def unknown_obstacles(scenario: Scenario, count: int, seed: int | None, margin: float) -> list[Obstacle]:
    """Random obstacles for a scenario, that leave its start and its goal region alone.

    Args:
        scenario: where they are to stand.
        count: how many.
        seed: of their random numbers; None draws a fresh one.
        margin: distance that the footprint has from them at the start, at least [m].
    """
    size = scenario.robot.footprint.circumscribed_radius + margin
    start, goal = scenario.start, scenario.goal
    keep_free = [(start.x, start.y, 1.5 * size), (goal.x, goal.y, goal.tolerance + size)]
    return random_obstacles(scenario.world.bounds, count, np.random.default_rng(seed), keep_free)


def load_obstacles(path: str | Path) -> list[Obstacle]:
    """Obstacles of a YAML file, under the key ``obstacles`` as in a scenario file.

    Args:
        path: the file.

    Raises:
        ScenarioError: with every mistake in the file, one line each.
    """
    report = Report()
    expected = "a list of obstacles"
    try:
        data = read_yaml(Path(path), report.problems)
    except InputError as error:
        raise ScenarioError(error.problems, str(path)) from None
    keys = {"obstacles": Key(list_of(obstacle, expected), required=expected)}
    found = read_partial(data, "", keys, report)
    if report.problems:
        raise ScenarioError(report.problems, str(path))
    obstacles: list[Obstacle] = found["obstacles"]
    return obstacles
