"""A goal in position alone that asks to stop there."""

from __future__ import annotations

from dataclasses import replace

import pytest

from cbrrt_ompl import Bounds, Box, Goal, Scenario, State, World, improve, plan, verify

SCENARIO = Scenario(
    name="stop",
    world=World(Bounds((0.0, 0.0), (8.0, 6.0)), [Box((3.5, 0.0), (4.0, 3.0))]),
    start=State(1.0, 1.0),
    goal=Goal(7.0, 1.0, tolerance=0.3, speed_tolerance=0.01),
)


@pytest.mark.parametrize("planner", ["cb-rrt", "cb-rrt-compiled", "cb-rrt-robust", "cb-rrt-anytime"])
def test_the_robot_stops_in_the_region(planner: str) -> None:
    result = plan(SCENARIO, planner, seed=2, time_limit=30.0)
    assert result.status == "solved"
    assert abs(result.trajectory.states[-1, 3:]).max() <= 0.01
    assert verify(result.trajectory, SCENARIO).ok


def test_an_improved_trajectory_stops_too_and_a_free_one_drives_through() -> None:
    first = plan(SCENARIO, "cb-rrt-robust", seed=2, time_limit=30.0).trajectory
    better = improve(first, SCENARIO, max_iterations=300)
    assert better.duration < first.duration
    assert abs(better.states[-1, 3:]).max() <= 0.01
    assert verify(better, SCENARIO).ok
    free = replace(SCENARIO, goal=replace(SCENARIO.goal, speed_tolerance=None))
    assert improve(first, free, max_iterations=300).states[-1, 3] > 0.5
