"""Random worlds, plans in them, and what `verify` and the independent checker think of the trajectories."""

from __future__ import annotations

import math
import traceback
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from independent_checker import refusals

from cbrrt_ompl.errors import ScenarioError
from cbrrt_ompl.optimise.improving import improve
from cbrrt_ompl.planning import plan
from cbrrt_ompl.problem.settings import State
from cbrrt_ompl.scenario.scenario import Scenario, scenario_from_dict, scenario_to_dict
from cbrrt_ompl.trajectory.columns import COLUMNS
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.verification import verify

Generator = np.random.Generator

COMPILED = ("cb-rrt-compiled", "s-rrt-compiled")
"""Planners that plan in every world."""

IN_TURN = ("cb-rrt", "s-rrt", "cb-rrt-robust")
"""Planners of which each world takes the next."""

IMPROVED = "improve"
"""In place of a planner: what `improve` made of a trajectory."""


class Outcome(NamedTuple):
    """What came of one plan in one world."""

    world: int
    planner: str
    solved: bool
    by_checker: list[str]
    """Why the independent checker refuses the trajectory."""
    by_verify: list[str]
    """Why `verify` refuses the trajectory."""
    error: str
    """The traceback of an exception; empty where there was none."""
    gain: float = 0.0
    """Seconds by which an improved trajectory takes less time than what was given."""


def outcomes(
    seed: int, world: int, max_samples: int, time_limit: float = 5.0, improve_for: float | None = None
) -> Iterator[Outcome]:
    """Plan in one random world with several planners, and check what they call solved.

    Args:
        seed: seed of the series.
        world: number of the world in it: each can be made alone.
        max_samples: samples of a plan.
        time_limit: largest time of a plan [s].
        improve_for: time to improve each of them for [s]; the outcomes of that go by ``IMPROVED``.
    """
    scenario = world_of(seed, world, max_samples)
    for planner in (*COMPILED, IN_TURN[world % len(IN_TURN)]):
        name = planner
        try:
            given = plan(scenario, planner, seed=world, time_limit=time_limit).trajectory
            if given is None:
                yield Outcome(world, planner, False, [], [], "")
                continue
            yield Outcome(world, planner, True, *judged(given, scenario), "")
            if improve_for is not None:
                name = IMPROVED
                better = improve(given, scenario, improve_for)
                yield Outcome(world, name, True, *judged(better, scenario), "", given.duration - better.duration)
        except Exception:  # whatever it is, the other worlds go on
            yield Outcome(world, name, False, [], [], traceback.format_exc())


def judged(trajectory: Trajectory, scenario: Scenario) -> tuple[list[str], list[str]]:
    """What the independent checker and `verify` have against a trajectory."""
    columns = {name: getattr(trajectory, name).tolist() for name in COLUMNS}
    by_checker = refusals(scenario_to_dict(scenario), columns, trajectory.kinematic)
    return by_checker, [violation.message for violation in verify(trajectory, scenario).violations]


def world_of(seed: int, world: int, max_samples: int) -> Scenario:
    """A random scenario in which the start is free; in each sixth world it nearly touches something."""
    rng = np.random.default_rng([seed, world])
    while True:
        try:
            scenario = scenario_from_dict(random_scenario(rng, max_samples))
            return replace(scenario, start=_beside_obstacle(rng, scenario)) if world % 6 == 5 else scenario
        except ScenarioError:
            continue


def _beside_obstacle(rng: Generator, scenario: Scenario) -> State:
    """A scenario's start, moved in a random direction until less than a millimetre is left."""
    start, world, footprint = scenario.start, scenario.world, scenario.robot.footprint
    angle, aim = rng.uniform(-math.pi, math.pi), 10.0 ** rng.uniform(-6.0, -3.0)
    for _ in range(1000):
        step = world.clearance(footprint, start[:3]) - 0.5 * aim
        if step < 0.5 * aim:
            break
        start = start._replace(x=start.x + step * math.cos(angle), y=start.y + step * math.sin(angle))
    return start


def random_scenario(rng: Generator, max_samples: int) -> dict[str, Any]:
    """A scenario that may well be impossible: its start may even be in an obstacle.

    Args:
        rng: where the numbers come from.
        max_samples: samples that a plan may take.
    """
    half = rng.uniform(1.5, 6.0, 2)
    centre = rng.uniform(-20.0, 20.0, 2) if rng.random() < 0.3 else np.zeros(2)
    low, high = centre - half, centre + half
    size = float(half.min())
    obstacles = [_obstacle(rng, low, high, size) for _ in range(rng.integers(0, 26))]
    return {
        "name": "random",
        "bounds": {"min": low.tolist(), "max": high.tolist()},
        "obstacles": obstacles,
        "robot": {"footprint": _footprint(rng, size), "limits": _limits(rng), "gains": _gains(rng)},
        "start": _start(rng, low, high),
        "goal": _goal(rng, low, high),
        "planning": {
            "horizon": float(rng.uniform(0.5, 3.0)),
            "step": float(rng.choice([0.02, 0.05, 0.05, 0.05, 0.1])),
            "goal_bias": float(rng.choice([0.0, 0.05, 0.2])),
            "max_samples": max_samples,
            "cut_extension": str(rng.choice(["discard", "keep"])),
            "equal_control_tolerance": float(rng.choice([0.0, 0.1, 0.1])),
            "closed_loop": bool(rng.random() < 0.3),
            "brake_safe": bool(rng.random() < 0.2),
        },
    }


def _obstacle(rng: Generator, low: Any, high: Any, size: float) -> dict[str, Any]:
    """An obstacle of any kind, some of them thin, some of them partly outside of the bounds."""
    centre = rng.uniform(low, high)
    sides = size * rng.uniform(0.02, 0.35, 2)
    if rng.random() < 0.15:
        sides[0] = 1e-3
    kind = rng.choice(["box", "disc", "polygon", "oriented_box"])
    if kind == "box":
        return {"type": "box", "min": (centre - sides / 2).tolist(), "max": (centre + sides / 2).tolist()}
    if kind == "disc":
        return {"type": "disc", "center": centre.tolist(), "radius": float(0.5 * sides[1])}
    if kind == "oriented_box":
        angle = float(rng.uniform(-math.pi, math.pi))
        return {"type": "oriented_box", "center": centre.tolist(), "size": sides.tolist(), "angle": angle}
    polygon: dict[str, Any] = {"type": "polygon", "vertices": (centre + _star(rng, 0.6 * sides[1])).tolist()}
    if rng.random() < 0.2:
        hole = 0.15 * sides[1] * np.array([(1.0, 0.0), (0.0, 1.0), (-1.0, -1.0)])
        polygon = {
            "type": "polygon",
            "vertices": (centre + 0.6 * sides[1] * np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)])).tolist(),
            "holes": [(centre + hole).tolist()],
        }
    return polygon


def _star(rng: Generator, radius: float) -> Any:
    """Corners of a polygon about the origin, convex or not, shape (n, 2)."""
    count = int(rng.integers(3, 9))
    angles = 2.0 * math.pi * (np.arange(count) + rng.uniform(0.1, 0.9, count)) / count
    return (radius * rng.uniform(0.4, 1.0, count))[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])


def _footprint(rng: Generator, size: float) -> dict[str, Any]:
    """A point, a disc or a polygon, whose origin may lie anywhere in it or beside it."""
    kind = rng.choice(["point", "disc", "rectangle", "star"])
    radius = float(size * rng.uniform(0.01, 0.1))
    if kind in ("point", "disc"):
        return {"type": "disc", "radius": radius if kind == "disc" else 0.0}
    if kind == "star":
        return {"type": "polygon", "vertices": (_star(rng, radius) + rng.uniform(-1, 1, 2) * radius).tolist()}
    length, width, shift = radius * rng.uniform(0.5, 2.0), radius * rng.uniform(0.3, 1.0), radius * rng.uniform(-1, 1)
    corners = [(shift - length, -width), (shift + length, -width), (shift + length, width), (shift - length, width)]
    return {"type": "polygon", "vertices": np.array(corners).tolist()}


def _limits(rng: Generator) -> dict[str, Any]:
    v_min = 0.0 if rng.random() < 0.6 else -float(rng.uniform(0.05, 1.0))
    left, right = (float(rng.uniform(0.3, 2.0)) for _ in range(2))
    return {
        "v": [v_min, float(rng.uniform(0.3, 2.0))],
        "omega": [-left, left if rng.random() < 0.7 else right],
        "acceleration": float(rng.uniform(0.2, 3.0)),
        "angular_acceleration": float(rng.uniform(0.3, 4.0)),
        **(_wheels(rng) if rng.random() < 0.2 else {}),
    }


def _wheels(rng: Generator) -> dict[str, float]:
    """Limits of the wheels, of which the other limits may well leave little."""
    return {
        "wheel_separation": float(rng.uniform(0.1, 0.6)),
        "wheel_speed": float(rng.uniform(0.2, 2.0)),
        "wheel_acceleration": float(rng.uniform(0.3, 3.0)),
    }


def _gains(rng: Generator) -> dict[str, float]:
    if rng.random() < 0.5:
        return {"k_x": 1.5, "k_y": 0.5, "k_theta": 0.1}
    return {name: float(rng.uniform(0.0, high)) for name, high in (("k_x", 3.0), ("k_y", 10.0), ("k_theta", 3.0))}


def _start(rng: Generator, low: Any, high: Any) -> dict[str, float]:
    x, y = rng.uniform(low, high).tolist()
    start = {"x": x, "y": y, "theta": float(rng.uniform(-math.pi, math.pi))}
    if rng.random() < 0.3:
        start |= {"v": float(rng.uniform(0.0, 0.3)), "omega": float(rng.uniform(-0.3, 0.3))}
    return start


def _goal(rng: Generator, low: Any, high: Any) -> dict[str, float]:
    x, y = rng.uniform(low, high).tolist()
    goal = {"x": x, "y": y, "tolerance": float(rng.uniform(0.1, 0.8))}
    if rng.random() < 0.25:
        goal |= {"theta": float(rng.uniform(-math.pi, math.pi)), "heading_tolerance": float(rng.uniform(0.1, 1.0))}
    if rng.random() < 0.15:
        goal["speed_tolerance"] = float(rng.uniform(0.1, 0.5))
    return goal
