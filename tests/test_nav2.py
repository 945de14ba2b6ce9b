"""Robots as Nav2 and ROS 1 write them: footprints in their notation, their parameter files, and their names refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cbrrt_ompl.errors import ScenarioError
from cbrrt_ompl.problem.robot import Footprint, Limits, Robot
from cbrrt_ompl.problem.settings import Goal
from cbrrt_ompl.scenario.nav2 import FOREIGN_KEYS
from cbrrt_ompl.scenario.scenario import Scenario, load_scenario, save_scenario, scenario_from_dict

SQUARE = [[0.1, 0.1], [0.1, -0.1], [-0.1, -0.1], [-0.1, 0.1]]

DWB = """\
controller_server:
  ros__parameters:
    controller_plugins: ["FollowPath"]
    general_goal_checker: {xy_goal_tolerance: 0.15, yaw_goal_tolerance: 0.2}
    FollowPath:
      plugin: "dwb_core::DWBLocalPlanner"
      min_vel_x: -0.1
      max_vel_x: 0.26
      max_vel_theta: 1.0
      acc_lim_x: 2.5
      acc_lim_theta: 3.2
      decel_lim_x: -2.0
      decel_lim_theta: -3.2
local_costmap:
  local_costmap:
    ros__parameters: {robot_radius: 0.22, footprint: "[]"}
"""

PURE_PURSUIT = """\
/**:
  controller_server:
    ros__parameters:
      controller_plugins: [Fast, Slow]
      Slow: {desired_linear_vel: 0.1}
      Fast: {desired_linear_vel: 0.5, rotate_to_heading_angular_vel: 1.8, max_angular_accel: 3.2}
  velocity_smoother:
    ros__parameters:
      max_velocity: [0.9, 0.0, 2.0]
      min_velocity: [-0.3, 0.0, -2.0]
      max_accel: [1.5, 0.0, 9.0]
      max_decel: [-1.2, 0.0, -9.0]
  global_costmap:
    global_costmap: {ros__parameters: {robot_radius: 9.0}}
  local_costmap:
    local_costmap:
      ros__parameters: {footprint: "[[0.2, 0.1], [0.2, -0.1], [-0.2, -0.1], [-0.2, 0.1]]", footprint_padding: 0.05}
"""

TEB = """\
TebLocalPlannerROS: {max_vel_x: 0.4, max_vel_x_backwards: 0.2, max_vel_theta: 0.3, acc_lim_x: 0.5}
AnotherOne: {xy_goal_tolerance: 0.2}
"""


def scenario(robot: Any, folder: Path | None = None, **goal: Any) -> Scenario:
    data = {"name": "n", "bounds": {"min": [0, 0], "max": [9, 9]}, "robot": robot, "start": {"x": 1, "y": 1}}
    return scenario_from_dict({**data, "goal": {"x": 8, "y": 8, **goal}}, folder=folder)


@pytest.mark.parametrize(
    "notation", [SQUARE, str(SQUARE), "[ [.1, .1], [.1, -.1],\n  [-.1, -.1], [-0.1, 1e-1] ]", {"vertices": SQUARE}]
)
def test_a_list_of_corners_is_a_polygon_in_a_text_too(notation: Any) -> None:
    assert scenario({"footprint": notation}).robot.footprint == Footprint.polygon(SQUARE)


@pytest.mark.parametrize("robot", [{"footprint": 0.1}, {"footprint": {"radius": 0.1}}, {"robot_radius": 0.1}])
def test_a_number_is_the_radius_of_a_disc(robot: Any) -> None:
    assert scenario(robot).robot.footprint == Footprint.disc(0.1)


@pytest.mark.parametrize(
    ("robot", "words"),
    [
        ({"footprint": "a square"}, "robot.footprint: got 'a square', expected a mapping with a type"),
        ({"footprint": [[0.1, 0.1], [0.1]]}, "robot.footprint.vertices[1]: got [0.1], expected a point"),
        ({"footprint": 0.1, "robot_radius": 0.1}, "robot.robot_radius: got 0.1, expected either footprint or"),
        ({"robot_radius": -1}, "robot.robot_radius: got -1, expected a radius of 0 or more"),
        ({"max_vel_x": 0.2}, "robot.max_vel_x: got an unknown key, expected robot.limits.v: [least, largest]"),
        ({"limits": {"acc_lim_theta": 1}}, "robot.limits.acc_lim_theta: got an unknown key, expected robot.limits.ang"),
    ],
)
def test_what_is_no_robot_is_answered_with_what_to_write(robot: Any, words: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        scenario(robot)
    assert words in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(("key", "words"), FOREIGN_KEYS.items())
def test_keys_of_other_programs_are_answered_with_ours(key: str, words: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        scenario({key: 1.0})
    assert str(caught.value) == f"scenario: robot.{key}: got an unknown key, expected {words}"


def test_a_parameter_file_of_nav2_makes_a_robot_and_the_tolerances_of_the_goal(tmp_path: Path) -> None:
    (tmp_path / "nav2.yaml").write_text(DWB)
    found = scenario({"nav2": "nav2.yaml"}, tmp_path, theta=1.0)
    assert found.robot == Robot(Footprint.disc(0.22), Limits(-0.1, 0.26, -1.0, 1.0, 2.5, 3.2, deceleration=2.0))
    assert found.goal == Goal(8.0, 8.0, 0.15, 1.0, 0.2)
    assert scenario({"nav2": "nav2.yaml"}, tmp_path).goal == Goal(8.0, 8.0, 0.15)


def test_what_the_scenario_says_itself_comes_before_the_parameter_file(tmp_path: Path) -> None:
    (tmp_path / "nav2.yaml").write_text(DWB)
    robot = {"model": "jackal", "nav2": "nav2.yaml", "robot_radius": 0.3, "limits": {"acceleration": 0.5}}
    found = scenario(robot, tmp_path, tolerance=0.4)
    assert found.robot.footprint == Footprint.disc(0.3)
    assert (found.robot.limits.acceleration, found.robot.limits.v_max) == (0.5, 0.26)
    assert found.robot.limits.wheel_speed == 2.0  # the model's
    assert found.goal.tolerance == 0.4


def test_the_first_controller_comes_before_the_velocity_smoother_and_the_local_costmap_first(tmp_path: Path) -> None:
    (tmp_path / "nav2.yaml").write_text(PURE_PURSUIT)
    robot = scenario({"nav2": "nav2.yaml"}, tmp_path).robot
    assert robot.limits == Limits(-0.3, 0.5, -1.8, 1.8, 1.5, 3.2, deceleration=1.2)
    assert robot.footprint.vertices is not None
    np.testing.assert_allclose(np.abs(robot.footprint.vertices), [[0.25, 0.15]] * 4)


def test_parameters_of_ros_1_are_read_as_well(tmp_path: Path) -> None:
    (tmp_path / "teb.yaml").write_text(TEB)
    found = scenario({"nav2": "teb.yaml"}, tmp_path)
    assert found.robot.limits == Limits(-0.2, 0.4, -0.3, 0.3, 0.5)
    assert found.goal.tolerance == 0.2


def test_a_scenario_with_a_parameter_file_is_saved_with_its_values(tmp_path: Path) -> None:
    (tmp_path / "nav2.yaml").write_text(DWB)
    found = scenario({"nav2": "nav2.yaml"}, tmp_path, theta=1.0)
    save_scenario(found, tmp_path / "saved.yaml")
    assert load_scenario(tmp_path / "saved.yaml") == found


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, "nav2.yaml: no such file"),
        ("amcl: {ros__parameters: {z_hit: 0.5}}", "expected parameters of Nav2: limits of a controller"),
        ("just words", "expected parameters of Nav2"),
        ("a: {max_vel_x: -2.0}", "robot.limits.v: got [0.0, -2.0]"),
        (
            "a: {footprint: '[[0, 0]]', max_vel_x: 1.0}",
            "a.footprint.vertices: got [(0.0, 0.0)], expected at least three",
        ),
        ("a: [", "expected valid YAML"),
    ],
)
def test_a_file_without_a_robot_is_refused_by_its_name(tmp_path: Path, text: str | None, words: str) -> None:
    if text is not None:
        (tmp_path / "nav2.yaml").write_text(text)
    with pytest.raises(ScenarioError) as caught:
        scenario({"nav2": "nav2.yaml"}, tmp_path)
    assert words in str(caught.value)
    assert f"robot.nav2: {tmp_path / 'nav2.yaml'}: " in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize("value", ["fast", '"0.26"', ".inf", "[0.26]"])
def test_a_limit_that_is_no_number_is_refused_and_not_passed_over(tmp_path: Path, value: str) -> None:
    """The robot got the paper's limit in its place, 1 m/s."""
    (tmp_path / "nav2.yaml").write_text(DWB.replace("max_vel_x: 0.26", f"max_vel_x: {value}"))
    with pytest.raises(ScenarioError, match=r"nav2\.yaml: max_vel_x: got .*, expected a finite number"):
        scenario({"nav2": "nav2.yaml"}, tmp_path)
