"""What a scenario leaves out is filled by the planner, what it gives always wins, and all parts see the same."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from cbrrt_ompl import (
    Bounds,
    Gains,
    Goal,
    Limits,
    PlanningSettings,
    Robot,
    Scenario,
    State,
    World,
    load_scenario,
    make_setup,
    plan,
    save_scenario,
    trajectory_from_path,
)
from cbrrt_ompl.drive import DriveSettings
from cbrrt_ompl.motion.model import CLOSED_LOOP, OPEN_LOOP
from cbrrt_ompl.planners.registry import PLANNERS, law_of, scenario_for
from cbrrt_ompl.problem.robot import gains_for

FOR_MAPS = ("cb-rrt-robust", "cb-rrt-anytime", "cb-rrt-ao")


@pytest.fixture
def room() -> Scenario:
    world = World(Bounds((0.0, 0.0), (6.0, 4.0)))
    return Scenario(name="room", world=world, start=State(1.0, 1.0, 1.0), goal=Goal(5.0, 3.0, tolerance=0.3))


@pytest.mark.parametrize("planner", PLANNERS)
def test_what_is_left_out_is_filled_by_the_planner(room: Scenario, planner: str) -> None:
    filled = scenario_for(planner, room)
    settings = filled.planning
    found = settings.goal_bias, settings.max_samples, settings.closed_loop, filled.robot.gains
    if planner in FOR_MAPS:
        assert found == (0.2, 500_000, True, gains_for(room.robot.limits))
    else:
        assert found == (0.0, 50_000, False, Gains())
    assert scenario_for(planner, filled) is filled


@pytest.mark.parametrize("planner", PLANNERS)
def test_what_is_given_always_wins(room: Scenario, planner: str) -> None:
    """Also where it is what another planner would take by default."""
    for given in (PlanningSettings(goal_bias=0.0, max_samples=50_000, closed_loop=False),
                  PlanningSettings(goal_bias=0.2, max_samples=500_000, closed_loop=True)):  # fmt: skip
        for gains in (Gains(), gains_for(Limits())):
            scenario = replace(room, planning=given, robot=replace(room.robot, gains=gains))
            filled = scenario_for(planner, scenario)
            assert filled.robot.gains == gains
            assert {name: getattr(filled.planning, name) for name in vars(given)} == vars(given)


@pytest.mark.parametrize("planner", FOR_MAPS)
def test_the_law_follows_from_the_filled_settings(planner: str) -> None:
    assert law_of(planner, PlanningSettings()) == CLOSED_LOOP
    assert law_of(planner, PlanningSettings(closed_loop=False)) == OPEN_LOOP
    assert law_of("cb-rrt", PlanningSettings()) == OPEN_LOOP


@pytest.mark.parametrize("planner", ["cb-rrt-robust", "cb-rrt-compiled"])
def test_a_plan_is_that_of_the_settings_written_out(room: Scenario, planner: str) -> None:
    results = [plan(scenario, planner, seed=3) for scenario in (room, scenario_for(planner, room))]
    assert results[0].solved
    assert np.array_equal(results[0].trajectory.states, results[1].trajectory.states)


@pytest.mark.needs_ompl
@pytest.mark.parametrize("planner", ["cb-rrt-robust", "cb-rrt"])
def test_a_set_up_of_ompl_has_the_same_settings(room: Scenario, planner: str) -> None:
    filled = scenario_for(planner, room)
    setup = make_setup(room, planner)
    model = setup.getSpaceInformation().getStatePropagator().model[0]
    assert model["gains"].tolist() == filled.robot.gains
    assert model["law"] == law_of(planner, room.planning)
    assert setup.solve(10.0)
    trajectory = trajectory_from_path(setup.getSolutionPath(), room)
    assert not room.goal.violations(State(*trajectory.states[-1].tolist()))


@pytest.mark.needs_ompl
def test_the_benchmark_has_the_same_settings(room: Scenario) -> None:
    from cbrrt_ompl.benchmark.entrant import Entrant

    entrants = [Entrant(make_setup(room, name), room, name) for name in ("cb-rrt", "cb-rrt-robust")]
    assert [entrant.max_samples for entrant in entrants] == [50_000, 500_000]


def test_a_drive_takes_the_goal_bias_of_the_scenario_unless_it_has_its_own() -> None:
    given = PlanningSettings(goal_bias=0.3)
    assert DriveSettings().planning(given).goal_bias == 0.3
    assert DriveSettings(goal_bias=0.1).planning(given).goal_bias == 0.1
    assert DriveSettings().planning(PlanningSettings()).goal_bias is None


def test_a_saved_scenario_has_what_was_given_and_no_more(room: Scenario, tmp_path: Path) -> None:
    given = replace(room, planning=PlanningSettings(goal_bias=0.0), robot=Robot(limits=Limits(v_max=0.5)))
    save_scenario(given, tmp_path / "room.yaml")
    data: dict[str, Any] = yaml.safe_load((tmp_path / "room.yaml").read_text())
    assert data["planning"]["goal_bias"] == 0.0
    assert not {"closed_loop", "max_samples"} & data["planning"].keys()
    assert "gains" not in data["robot"]
    assert load_scenario(tmp_path / "room.yaml") == given


def test_gains_that_follow_from_the_limits_are_critically_damped_and_use_the_turning_rate() -> None:
    """An error of a radian asks for as fast a turn as the robot can make within a radian."""
    for limits in (Limits(), Limits(v_max=0.3, omega_max=4.0, angular_acceleration=2.0)):
        gains = gains_for(limits)
        assert gains.k_theta**2 == pytest.approx(4.0 * gains.k_y)
        fastest = min(limits.omega_max, math.sqrt(limits.angular_acceleration))
        assert limits.v_max * gains.k_theta * 1.0 == pytest.approx(fastest)
