"""Ready robots: what was published of them, and how scenario files refer to them."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cbrrt_ompl import ROBOTS, Robot, Scenario, load_scenario, plan, save_scenario, verify
from cbrrt_ompl.errors import ScenarioError
from cbrrt_ompl.motion.model import check_step
from cbrrt_ompl.problem.robot import Footprint, Gains
from cbrrt_ompl.problem.settings import PlanningSettings
from cbrrt_ompl.scenario.scenario import scenario_from_dict

BURGER = ROBOTS["turtlebot3_burger"]


def field_with(robot: object) -> Scenario:
    return scenario_from_dict(
        {
            "name": "field",
            "bounds": {"min": [0.0, 0.0], "max": [10.0, 10.0]},
            "robot": robot,
            "start": {"x": 2.0, "y": 2.0},
            "goal": {"x": 5.0, "y": 4.0, "tolerance": 0.4},
        }
    )


def test_the_robot_of_the_paper_is_among_them() -> None:
    assert ROBOTS["tetra_ds_ii"] == Robot()


@pytest.mark.parametrize(
    ("name", "length", "width", "behind", "v", "omega"),
    [
        ("turtlebot3_burger", 0.138, 0.178, 0.032, 0.22, 2.84),
        ("turtlebot3_waffle_pi", 0.281, 0.306, 0.064, 0.26, 1.82),
        ("jackal", 0.508, 0.430, 0.0, 2.0, 4.0),
        ("pioneer_3dx", 0.455, 0.381, 0.04465, 1.2, math.radians(300.0)),
    ],
)
def test_a_robot_has_the_size_and_the_speeds_that_were_published(
    name: str, length: float, width: float, behind: float, v: float, omega: float
) -> None:
    robot = ROBOTS[name]
    assert robot.footprint.vertices is not None
    low, high = robot.footprint.vertices.min(axis=0), robot.footprint.vertices.max(axis=0)
    assert high - low == pytest.approx([length, width])
    assert 0.5 * (low + high) == pytest.approx([-behind, 0.0], abs=1e-15)
    assert robot.limits[:4] == (0.0, v, -omega, omega)


@pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
def test_both_top_speeds_can_be_driven_and_the_default_step_is_short_enough(robot: Robot) -> None:
    limits = robot.limits
    assert limits.v_max <= limits.wheel_speed
    assert 0.5 * limits.wheel_separation * limits.omega_max <= limits.wheel_speed
    assert limits.wheel_separation <= 2.0 * robot.footprint.circumscribed_radius
    check_step(robot, PlanningSettings())


@pytest.mark.parametrize("name", ROBOTS)
def test_a_plan_of_it_is_valid(name: str) -> None:
    scenario = field_with(name)
    result = plan(scenario, "cb-rrt-compiled", seed=1, time_limit=20.0)
    assert result.trajectory is not None
    assert verify(result.trajectory, scenario, tolerance=1e-6).violations == ()


@pytest.mark.parametrize("robot", ["turtlebot3_burger", {"model": "turtlebot3_burger"}])
def test_a_scenario_names_its_robot(robot: object) -> None:
    assert field_with(robot).robot == BURGER


def test_what_a_scenario_gives_besides_the_model_replaces_that_alone() -> None:
    scenario = field_with(
        {
            "model": "turtlebot3_burger",
            "limits": {"v": [-0.1, 0.2], "wheel_acceleration": 0.5},
            "gains": {"k_x": 1.0},
            "footprint": {"type": "disc", "radius": 0.12},
        }
    )
    assert scenario.robot.limits == BURGER.limits._replace(v_min=-0.1, v_max=0.2, wheel_acceleration=0.5)
    assert scenario.robot.gains == Gains(1.0, *BURGER.gains[1:])
    assert scenario.robot.footprint == Footprint.disc(0.12)
    assert ROBOTS["turtlebot3_burger"] is BURGER


def test_a_robot_without_a_model_starts_from_that_of_the_paper() -> None:
    limits = {"wheel_separation": 0.4, "wheel_speed": 1.0}
    assert field_with({"limits": limits}).robot == Robot(limits=Robot().limits._replace(**limits))


@pytest.mark.parametrize(("robot", "path"), [("jackel", "robot"), ({"model": "jackel"}, "robot.model")])
def test_an_unknown_robot_is_told_the_known_ones_in_one_line(robot: object, path: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        field_with(robot)
    assert str(caught.value) == f"scenario: {path}: got 'jackel', expected one of {', '.join(ROBOTS)}"


def test_a_wrong_limit_beside_a_model_is_named_where_it_stands() -> None:
    with pytest.raises(ScenarioError, match=r"robot\.limits\.wheel_speed: got -1\.0, expected a number above 0"):
        field_with({"model": "jackal", "limits": {"wheel_speed": -1.0}})


@pytest.mark.parametrize("name", ROBOTS)
def test_a_saved_scenario_holds_plain_values(name: str, tmp_path: Path) -> None:
    scenario = replace(field_with(name), planning=PlanningSettings(horizon=1.0))
    path = tmp_path / "saved.yaml"
    save_scenario(scenario, path)
    assert load_scenario(path) == scenario
    text = path.read_text(encoding="utf-8")
    assert name not in text
    assert "inf" not in text
    assert ("wheel" in text) == bool(np.isfinite(scenario.robot.limits.wheel_speed))
