"""Worlds and settings that are extreme: each is planned in, or refused in a line, and soon."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cbrrt_ompl import (
    Bounds,
    Box,
    Disc,
    Footprint,
    Gains,
    Goal,
    InputError,
    Limits,
    OrientedBox,
    PlanningSettings,
    Polygon,
    Robot,
    Scenario,
    State,
    World,
    load_scenario,
    plan,
    save_scenario,
    verify,
)
from cbrrt_ompl.collision.world import Obstacle
from cbrrt_ompl.figures import draw_plan
from cbrrt_ompl.planners.registry import is_compiled
from cbrrt_ompl.planning import available_planners, warm_up_planner
from cbrrt_ompl.trajectory.replay import MAX_EDGE_POINTS

PLANNERS = [name for name in available_planners() if is_compiled(name) or name in ("cb-rrt", "rrt", "pdst")]


def scene(size: float = 10.0, corner: float = 0.0, obstacles: list[Obstacle] | None = None, **parts: Any) -> Scenario:
    """A square world, to be crossed along its diagonal."""
    return Scenario(
        **{
            "name": "extreme",
            "world": World(Bounds((corner, corner), (corner + size, corner + size)), obstacles or []),
            "start": State(corner + 0.1 * size, corner + 0.1 * size),
            "goal": Goal(corner + 0.9 * size, corner + 0.9 * size, tolerance=0.05 * size),
            "planning": PlanningSettings(max_samples=500),
            **parts,
        }
    )


def fast(v_min: float = 0.0) -> Robot:
    return Robot(Footprint.disc(0.1), Limits(v_min=v_min, v_max=1e6, acceleration=1e6))


ACCEPTED: dict[str, dict[str, Any]] = {
    "a world of a millimetre": {"size": 1e-3},
    "a world of 400 km": {"size": 4e5},
    "a world of 400 km and a robot of 1,000 km/s": {"size": 4e5, "robot": fast()},
    "a robot of 1,000 km/s in a room": {"robot": fast(-1e6)},
    "what is free of it kept": {
        "robot": fast(-1e6),
        "planning": PlanningSettings(max_samples=20, cut_extension="keep"),
    },
    "the slowest robot": {"robot": Robot(limits=Limits(0.0, 1e-9, -1e-9, 1e-9, 1e-9, 1e-9))},
    "gains of a million": {"robot": Robot(gains=Gains(1e6, 1e6, 1e6))},
    "a heading of a million": {"start": State(1.0, 1.0, 1e6)},
    "an extension of 100,000 steps": {"planning": PlanningSettings(horizon=5000.0, max_samples=5)},
    "a step of a nanosecond": {"planning": PlanningSettings(horizon=1e-9, step=1e-9, max_samples=50)},
    "a goal without size": {"goal": Goal(9.0, 9.0, tolerance=1e-300)},
    "a goal that is everywhere": {"goal": Goal(9.0, 9.0, tolerance=1e6)},
    "a look-ahead of a nanometre": {"planning": PlanningSettings(look_ahead=1e-9, max_samples=500)},
    "a start as near as can be": {"start": State(1.0 - 2e-6, 5.0), "obstacles": [Box((1.0, 4.0), (2.0, 6.0))]},
    "a goal behind walls": {"obstacles": [Box((8.0, 7.0), (10.0, 7.2)), Box((7.0, 7.0), (7.2, 10.0))]},
    "obstacles of a nanometre": {
        "obstacles": [
            Box((5.0, 5.0), (5.0 + 1e-9, 5.1)),
            Disc((5.0, 6.0), 1e-9),
            OrientedBox((6.0, 6.0), (1e-9, 1), 1.0),
        ]
    },
    "5,000 discs at one place": {"obstacles": [Disc((5.0, 5.0), 1.0)] * 5000},
    "5,000 polygons at one place": {"obstacles": [Polygon([(4.0, 4.0), (6.0, 4.0), (5.0, 6.0)])] * 5000},
    "2,000 discs in each other": {"obstacles": [Disc((5.0 + 1e-4 * i, 5.0), 1.0 + 1e-4 * i) for i in range(2000)]},
    "2,000 turned boxes in each other": {
        "obstacles": [OrientedBox((5.0, 5.0), (1.0 + 1e-4 * i, 2.0), 0.3) for i in range(2000)]
    },
    "a footprint that is a line, nearly": {"robot": Robot(Footprint.polygon([(0.0, 0.0), (1.0, 0.0), (0.5, 1e-12)]))},
}

REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "a world of a micrometre": ({"size": 1e-6}, "expected a pose where the footprint touches no obstacle and no bound"),
    "a world without size": ({"size": 0.0}, "bounds: .* expected min below max in x and in y"),
    "a world at 10^9 m": ({"corner": 1e9}, "bounds: .* expected finite coordinates of at most 1e.06 m"),
    "a world of 1,000 km": ({"size": 1e6}, "bounds: .* expected bounds whose walls, as thick as they are wide, stay"),
    "a start on the border": ({"start": State(0.0, 5.0)}, "start: .* expected a position inside the bounds"),
    "a start at an obstacle": (
        {"start": State(1.0, 5.0), "obstacles": [Box((1.0, 4.0), (2.0, 6.0))]},
        "start: .* expected a pose where the footprint touches no obstacle",
    ),
    "a start that is no number": ({"start": State(float("nan"), 5.0)}, "start.x: got nan, expected a finite number"),
    "an infinite start": ({"start": State(1.0, 1.0, 0.0, float("inf"))}, "start.v: got inf, expected a finite number"),
    "a goal in an obstacle": ({"obstacles": [Box((8.0, 8.0), (10.0, 10.0))]}, "goal: .* all of it is in collision"),
    "a footprint behind the walls": (
        {"robot": Robot(Footprint.polygon([(1e5, 1e5), (1e5 + 1.0, 1e5), (1e5, 1e5 + 1.0)]))},
        "robot.footprint: got one 141421 m away, expected a footprint nearer to the robot's origin than .*10 m",
    ),
    "a robot as large as a country": ({"robot": Robot(Footprint.disc(1e6))}, "start: .* expected a pose where"),
}


@pytest.mark.parametrize("name", ACCEPTED)
def test_an_extreme_scene_is_planned_in_and_drawn(name: str) -> None:
    for planner in PLANNERS:
        warm_up_planner(planner)
    began = time.perf_counter()
    scenario = scene(**ACCEPTED[name])
    for planner in PLANNERS:
        result = plan(scenario, planner, 1, 0.1)
        assert np.isfinite(result.tree.states).all()
        if result.trajectory is not None and planner.startswith(("cb", "s-")) and len(result.trajectory) < 10_000:
            tolerance = max(1e-3, 1e-6 * scenario.robot.limits.v_max)
            assert verify(result.trajectory, scenario, tolerance=tolerance).ok, planner
    draw_plan(result, scenario).canvas.draw()
    assert time.perf_counter() - began < 20.0


@pytest.mark.parametrize("name", REFUSED)
def test_an_impossible_scene_is_refused_in_a_line(name: str) -> None:
    parts, complaint = REFUSED[name]
    with pytest.raises(InputError, match=complaint):
        scene(**parts)


@pytest.mark.parametrize("limits", [Limits(0.0, 0.0), Limits(omega_min=0.0, omega_max=0.0), Limits(acceleration=0.0)])
def test_a_robot_that_cannot_move_is_refused(limits: Limits) -> None:
    with pytest.raises(InputError, match=r"robot\.limits\.\w+: got .*, expected .*"):
        Robot(limits=limits)


@pytest.mark.slow
def test_a_hundred_thousand_obstacles_are_planned_among_in_seconds() -> None:
    """Turned boxes used to be searched one by one, for seconds a question: FCL took each for 400 m wide."""
    rng = np.random.default_rng(1)
    centers = rng.uniform(0.0, 100.0, (100_000, 2))
    ends = np.array([(10.0, 10.0), (90.0, 90.0)])
    is_clear = (np.linalg.norm(centers[:, None] - ends, axis=2) > 1.0).all(axis=1)
    makers = (
        lambda x, y: Disc((x, y), 0.02),
        lambda x, y: Box((x - 0.02, y - 0.02), (x + 0.02, y + 0.02)),
        lambda x, y: OrientedBox((x, y), (0.04, 0.02), x),
    )
    obstacles = [makers[i % 3](x, y) for i, (x, y) in enumerate(centers[is_clear].tolist())]
    assert len(obstacles) > 99_000
    began = time.perf_counter()
    scenario = scene(100.0, obstacles=obstacles, planning=PlanningSettings())
    result = plan(scenario, "cb-rrt-robust", 1, 1.0)
    assert result.nodes > 100
    assert time.perf_counter() - began < 20.0


def test_ten_thousand_obstacles_are_saved_and_loaded_in_seconds(tmp_path: Path) -> None:
    """PyYAML used to take a quarter of a millisecond a line."""
    rng = np.random.default_rng(1)
    centers = rng.uniform(1.0, 9.0, (10_000, 2)).tolist()
    scenario = scene(obstacles=[Disc((x, y), 1e-3) for x, y in centers], start=State(0.5, 0.5))
    began = time.perf_counter()
    save_scenario(scenario, tmp_path / "many.yaml")
    assert time.perf_counter() - began < 2.0
    assert load_scenario(tmp_path / "many.yaml") == scenario
    assert time.perf_counter() - began < 10.0


def test_a_long_edge_has_fewer_points_than_steps() -> None:
    result = plan(scene(planning=PlanningSettings(horizon=5000.0, max_samples=100)), "cb-rrt-compiled", 1, 5.0)
    separators = np.flatnonzero(np.isnan(result.tree.polyline[:, 0]))
    assert len(separators) == result.nodes - 1
    assert np.diff(separators).max(initial=separators[0]) <= MAX_EDGE_POINTS + 3
    ends = result.tree.polyline[separators - 1]
    assert np.array_equal(np.unique(ends, axis=0), np.unique(result.tree.states[1:, :2], axis=0))
