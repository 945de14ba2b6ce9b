"""Trajectories called solved, judged by code that shares nothing with the package; and that judge, put to the test."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest
from generated_worlds import COMPILED, IN_TURN, judged, outcomes, world_of
from independent_checker import Surroundings, driven, refusals

from cbrrt_ompl import improve, plan

SEED = 2

SCENE: dict[str, Any] = {
    "bounds": {"min": [-1.0, -1.0], "max": [5.0, 1.0]},
    "obstacles": [],
    "robot": {
        "footprint": {"type": "disc", "radius": 0.0},
        "limits": {"v": [0.0, 1.0], "omega": [-1.0, 1.0], "acceleration": 0.5, "angular_acceleration": 0.5},
    },
    "start": {"x": 0.0, "y": 0.0, "theta": 0.0, "v": 0.0, "omega": 0.0},
    "goal": {"x": 3.0, "y": 0.0, "tolerance": 0.1, "theta": 0.0, "heading_tolerance": 0.1, "speed_tolerance": 1.0},
}
"""A straight way of 3 m."""


def straight() -> dict[str, Any]:
    """Speeding up to 1 m/s in 2 s, then on for 2 s, on rows 0.1 s apart."""
    t = 0.1 * np.arange(41)
    v = np.minimum(0.5 * t, 1.0)
    x = np.where(t < 2.0, 0.25 * t**2, t - 1.0)
    zero = np.zeros(41)
    columns = dict(zip(("t", "x", "y", "theta", "v", "omega"), (t, x, zero, zero, v, zero), strict=True))
    return {**columns, "v_command": np.ones(41), "omega_command": zero}


@pytest.mark.needs_ompl
@pytest.mark.slow
def test_every_trajectory_called_solved_passes_both_checkers() -> None:
    counts: Counter[str] = Counter()
    for world in range(30):
        for one in outcomes(SEED, world, max_samples=300):
            assert (one.by_checker, one.by_verify, one.error) == ([], [], ""), f"world {world}, {one.planner}"
            counts[one.planner] += one.solved
    assert all(counts[planner] >= 2 for planner in (*COMPILED, *IN_TURN)), counts


@pytest.mark.slow
@pytest.mark.parametrize("worlds", [range(12), (29, 125, 239, 305, 10, 12, 99)], ids=["first", "hard"])
def test_nearly_all_of_them_are_improved_and_pass_both_checkers(worlds: Iterable[int]) -> None:
    """Hard are starts within half a millimetre of something, and corners that a point passes between two nodes."""
    given, shorter = 0, 0
    for world in worlds:
        scenario = world_of(3, world, max_samples=2000)
        for planner in ("cb-rrt-robust", "s-rrt-compiled"):
            trajectory = plan(scenario, planner, seed=world, time_limit=60.0).trajectory
            if trajectory is None or trajectory.duration == 0.0:
                continue
            better = improve(trajectory, scenario, max_iterations=400)
            assert judged(better, scenario) == ([], []), f"world {world}, {planner}"
            assert better.duration <= trajectory.duration
            given, shorter = given + 1, shorter + (better.duration < trajectory.duration)
    assert given >= 10
    assert shorter >= 0.9 * given


def test_the_checker_accepts_what_is_right() -> None:
    assert refusals(SCENE, straight(), kinematic=False) == []


@pytest.mark.parametrize(
    ("column", "row", "by", "reason"),
    [
        ("x", 0, 1e-5, "start: x"),
        ("theta", 0, 1e-5, "start: theta"),
        ("y", 20, 2e-3, "motion: y"),
        ("theta", 20, 2e-3, "motion: theta"),
        ("v", 40, 1e-4, "limits: v ="),
        ("v_command", 40, 1e-4, "limits: v_command"),
        ("v", 10, 1e-6, "acceleration: v"),
        ("omega", 10, 0.1, "acceleration: omega"),
        ("omega_command", 5, 0.5, "motion: omega"),
        ("x", 40, 0.2, "goal: 0.2"),
        ("theta", 40, 0.2, "goal: heading"),
        ("v", 40, 0.1, "goal: arrives with v"),
    ],
)
def test_the_checker_finds_what_was_tampered_with(column: str, row: int, by: float, reason: str) -> None:
    columns = straight()
    columns[column] = columns[column].copy()
    columns[column][row] += by
    found = refusals(SCENE, columns, kinematic=False)
    assert any(line.startswith(reason) for line in found), found


@pytest.mark.parametrize(
    ("wheels", "reason"),
    [
        ({"wheel_speed": 1.0, "wheel_acceleration": 0.5}, None),
        ({"wheel_speed": 0.9}, "limits: left wheel in row 19"),
        ({"wheel_acceleration": 0.4}, "acceleration: left wheel in row 0"),
    ],
)
def test_the_checker_knows_limits_of_the_wheels(wheels: dict[str, float], reason: str | None) -> None:
    robot = {**SCENE["robot"], "limits": {**SCENE["robot"]["limits"], "wheel_separation": 0.4, **wheels}}
    found = refusals({**SCENE, "robot": robot}, straight(), kinematic=False)
    assert (reason in found) if reason is not None else found == []


def test_the_checker_ramps_both_velocities_together_where_wheels_limit() -> None:
    """The right wheel is to change by 0.5 + 0.2 * 0.5 = 0.6 m/s, a third of which its limit allows in 0.1 s."""
    limits = {"acceleration": 9.0, "angular_acceleration": 9.0, "wheel_separation": 0.4, "wheel_acceleration": 2.0}
    rows = {name: np.zeros(2) for name in ("x", "y", "theta", "v", "omega")} | {"t": np.array([0.0, 0.1])}
    rows |= {"v_command": np.full(2, 0.5), "omega_command": np.full(2, 0.5)}
    _, velocities = driven(rows, limits, kinematic=False)
    np.testing.assert_allclose(velocities, [[0.0, 0.0, 0.5 / 3.0, 0.5 / 3.0]])


@pytest.mark.parametrize(
    "obstacle",
    [
        {"type": "box", "min": [2.5101, -0.5], "max": [2.5102, 0.5]},
        {"type": "disc", "center": [2.51, 0.0], "radius": 2e-4},
        {"type": "oriented_box", "center": [2.51, 0.0], "size": [2e-4, 1.0], "angle": 0.5},
        {"type": "polygon", "vertices": [[2.51, 0.001], [2.5, -0.5], [2.52, -0.5]]},
    ],
    ids=lambda obstacle: obstacle["type"],
)
def test_the_checker_finds_thin_obstacles_between_the_rows(obstacle: dict[str, Any]) -> None:
    (found,) = refusals({**SCENE, "obstacles": [obstacle]}, straight(), kinematic=False)
    assert float(found.removeprefix("collision at t = ")) == pytest.approx(3.51, abs=1e-2)


def test_the_checker_integrates_a_spiral_as_its_closed_form() -> None:
    """At v = e t and omega = w t the way is a circle's, driven ever faster."""
    t = np.linspace(0.0, 2.0, 21)
    limits = {"acceleration": 0.5, "angular_acceleration": 1.5}
    rows = {"t": t, "x": 0 * t, "y": 0 * t, "theta": 0 * t, "v": 0.5 * t, "omega": 1.5 * t}
    rows |= {"v_command": 9 + 0 * t, "omega_command": 9 + 0 * t}
    poses, _ = driven(rows, limits, kinematic=False)
    heading = 0.75 * t**2
    expected = np.column_stack([np.sin(heading) / 3.0, (1.0 - np.cos(heading)) / 3.0, heading])
    np.testing.assert_allclose(poses, expected, atol=1e-10)


@pytest.mark.parametrize(
    ("footprint", "distance"),
    [
        ({"type": "disc", "radius": 0.0}, 0.5),
        ({"type": "disc", "radius": 0.2}, 0.3),
        ({"type": "polygon", "vertices": [[0.1, -0.3], [0.1, 0.3], [-0.1, 0.3], [-0.1, -0.3]]}, 0.2),
    ],
)
def test_the_distances_of_the_checker_are_those_of_the_footprint(footprint: dict[str, Any], distance: float) -> None:
    robot = {"footprint": footprint}
    pose = np.array([[0.0, 0.0, math.pi / 2.0]])
    for obstacle in (
        {"type": "box", "min": [0.5, -1.0], "max": [0.6, 1.0]},
        {"type": "disc", "center": [0.8, 0.0], "radius": 0.3},
        {"type": "oriented_box", "center": [1.0, 0.0], "size": [0.2, 1.0], "angle": math.pi / 2.0},
        {"type": "polygon", "vertices": [[0.5, -1.0], [0.5, 1.0], [2.0, 0.0]]},
    ):
        scene = {"bounds": {"min": [-9.0, -9.0], "max": [9.0, 9.0]}, "obstacles": [obstacle], "robot": robot}
        assert Surroundings(scene)(pose) == pytest.approx([distance])
    walls = {"bounds": {"min": [-9.0, -9.0], "max": [0.5, 9.0]}, "robot": robot}
    assert Surroundings(walls)(pose) == pytest.approx([distance])
