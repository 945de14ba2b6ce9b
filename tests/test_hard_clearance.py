"""`planning.clearance`: motions keep a distance from everything, by exact distances."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cbrrt_ompl import Bounds, Box, Disc, Footprint, Goal, PlanningSettings, Robot, Scenario, State, World, plan, verify
from cbrrt_ompl.errors import ScenarioError, SettingsError

WORLD = World(Bounds((0.0, 0.0), (6.0, 4.0)), [Box((2.0, 0.0), (2.2, 2.4)), Disc((4.0, 2.6), 0.5)])
RECTANGLE = Footprint.polygon([(-0.2, -0.15), (0.25, -0.15), (0.25, 0.15), (-0.2, 0.15)])
CLEARANCE = 0.1


def scenario(footprint: Footprint, clearance: float = CLEARANCE) -> Scenario:
    """A wall and a disc to drive around."""
    return Scenario(
        name="clearance",
        world=WORLD,
        robot=Robot(footprint),
        start=State(0.8, 0.8),
        goal=Goal(5.2, 0.8, tolerance=0.4),
        planning=PlanningSettings(clearance=clearance, goal_bias=0.1),
    )


@pytest.mark.parametrize("footprint", [Footprint.point(), Footprint.disc(0.2), RECTANGLE], ids=["point", "disc", "box"])
@pytest.mark.parametrize("planner", ["cb-rrt", "cb-rrt-compiled", "cb-rrt-robust"])
def test_every_pose_of_a_plan_keeps_the_clearance(planner: str, footprint: Footprint) -> None:
    problem = scenario(footprint)
    for seed in range(4):
        result = plan(problem, planner, seed=seed)
        assert result.status == "solved"
        assert result.trajectory is not None
        assert verify(result.trajectory, problem).ok
        times = np.linspace(0.0, result.trajectory.duration, 3000)
        found = [WORLD.clearance(footprint, state[:3]) for state in result.trajectory.at(times)]
        assert min(found) >= CLEARANCE


def test_verify_refuses_a_motion_that_comes_nearer() -> None:
    near = scenario(Footprint.disc(0.2), 0.0)
    found = next(r for s in range(20) if (r := plan(near, "cb-rrt-compiled", seed=s)).trajectory is not None)
    assert found.trajectory is not None
    wide = replace(near, planning=replace(near.planning, clearance=0.3))
    verdict = verify(found.trajectory, wide)
    assert {violation.kind for violation in verdict.violations} == {"clearance"}


def test_a_start_within_the_clearance_is_refused_with_its_distance() -> None:
    with pytest.raises(ScenarioError, match=r"start: .*a pose 0.1 m from everything .*; it is 0.05 m"):
        replace(scenario(Footprint.point()), start=State(0.05, 2.0))


def test_a_goal_within_the_clearance_is_refused_with_its_distance() -> None:
    """All of the region is too near; it was searched for in vain."""
    near = Goal(2.5, 0.8, tolerance=0.05)
    with pytest.raises(ScenarioError, match=r"goal: .*a pose 0.2 m from everything .*; at its centre it is 0.1 m"):
        replace(scenario(Footprint.disc(0.2), 0.2), goal=near)
    assert replace(scenario(Footprint.disc(0.2), 0.12), goal=near).goal == near, "a part of the region is free"


@pytest.mark.parametrize("wrong", [-0.1, float("nan"), "wide"])
def test_what_is_no_distance_is_refused(wrong: object) -> None:
    with pytest.raises(SettingsError, match="planning.clearance"):
        PlanningSettings(clearance=wrong)  # type: ignore[arg-type]
