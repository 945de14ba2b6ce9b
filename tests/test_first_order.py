"""Robots of first order, whose velocities jump: read, planned, improved, driven and verified as such."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from independent_checker import refusals

from cbrrt_ompl.cli import main
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.drive import DriveSettings, drive
from cbrrt_ompl.errors import CbrrtError, MapError, RobotError, ScenarioError
from cbrrt_ompl.export.following import follow
from cbrrt_ompl.maps import load_dynobench
from cbrrt_ompl.optimise import Objective, improve
from cbrrt_ompl.planners.registry import PLANNERS
from cbrrt_ompl.planning import plan
from cbrrt_ompl.problem.obstacles import Bounds, Box
from cbrrt_ompl.problem.ready_robots import rectangle
from cbrrt_ompl.problem.robot import Limits, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.scenario.scenario import Scenario, save_scenario, scenario_from_dict, scenario_to_dict
from cbrrt_ompl.trajectory.columns import COLUMNS
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.verification import verify

LIMITS = Limits(-0.5, 0.5, -0.5, 0.5, math.inf, math.inf)
GAP = World(Bounds((0.0, 0.0), (6.0, 4.0)), [Box((2.8, 0.0), (3.2, 1.5)), Box((2.8, 2.4), (3.2, 4.0))])
"""A wall with a gap of 0.9 m."""

SCENARIO = Scenario(
    name="gap",
    world=GAP,
    robot=Robot(rectangle(0.5, 0.25), LIMITS),
    start=State(1.0, 1.0, 0.5),
    goal=Goal(5.0, 3.0, tolerance=0.3),
    planning=PlanningSettings(step=0.1),
)
AT_REST = replace(SCENARIO, goal=Goal(5.0, 3.0, tolerance=0.1, theta=1.5, heading_tolerance=0.1, speed_tolerance=0.02))


def planned(scenario: Scenario, planner: str = "cb-rrt-robust") -> Trajectory:
    trajectory = plan(scenario, planner, seed=1, time_limit=30.0).trajectory
    assert trajectory is not None
    return trajectory


def by_independent_code(trajectory: Trajectory, scenario: Scenario) -> list[str]:
    columns = {name: getattr(trajectory, name).tolist() for name in COLUMNS}
    return refusals(scenario_to_dict(scenario), columns, trajectory.kinematic)


# limits and files


def test_unlimited_accelerations_are_read_and_written() -> None:
    data = scenario_to_dict(SCENARIO)
    assert data["robot"]["limits"]["acceleration"] == data["robot"]["limits"]["angular_acceleration"] == "unlimited"
    assert scenario_from_dict(data).robot.limits == LIMITS
    del data["robot"]["limits"]["angular_acceleration"]
    assert scenario_from_dict(data).robot.limits == LIMITS


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        ({"angular_acceleration": "unlimited"}, "angular_acceleration: got inf, expected a limit, as of the accel"),
        ({"acceleration": "unlimited", "angular_acceleration": 0.5}, "got 0.5, expected no limit, as of the accel"),
        ({"acceleration": "none"}, "limits.acceleration: got 'none', expected a finite number, or unlimited"),
        ({"acceleration": None}, "limits.acceleration: got nothing"),
        (
            {"acceleration": "unlimited", "wheel_separation": 0.3, "wheel_acceleration": 1.0},
            "wheel_acceleration: got 1.0, expected no limit for a robot without one of its acceleration",
        ),
    ],
)
def test_limits_that_contradict_each_other_are_refused_by_name(limits: dict[str, object], words: str) -> None:
    data = scenario_to_dict(replace(SCENARIO, robot=Robot()))
    data["robot"]["limits"] |= limits
    with pytest.raises(ScenarioError) as caught:
        scenario_from_dict(data)
    assert words in str(caught.value)


def test_infinite_velocities_are_none() -> None:
    with pytest.raises(RobotError, match="limits.v_max: got inf"):
        Robot(limits=LIMITS._replace(v_max=math.inf))


# planning


@pytest.mark.parametrize("planner", PLANNERS)
def test_every_planner_lets_velocities_jump_and_is_verified(planner: str) -> None:
    scenario = replace(SCENARIO, world=World(GAP.bounds))
    trajectory = planned(scenario, planner)
    assert trajectory.kinematic
    assert np.abs(np.diff(trajectory.v)).max() > 0.2  # in a step of 0.1 s
    assert verify(trajectory, scenario).violations == ()
    assert by_independent_code(trajectory, scenario) == []


@pytest.mark.parametrize("closed_loop", [False, True])
@pytest.mark.parametrize("brake_safe", [False, True])
def test_plans_through_a_gap_are_verified(closed_loop: bool, brake_safe: bool) -> None:
    planning = replace(SCENARIO.planning, closed_loop=closed_loop, brake_safe=brake_safe)
    scenario = replace(AT_REST, planning=planning)
    trajectory = planned(scenario)
    assert trajectory.ends_at_rest
    assert verify(trajectory, scenario).violations == ()
    assert by_independent_code(trajectory, scenario) == []


def test_the_wheels_of_a_robot_of_first_order_keep_their_speed() -> None:
    limits = LIMITS._replace(wheel_separation=0.4, wheel_speed=0.5)
    scenario = replace(SCENARIO, robot=Robot(rectangle(0.5, 0.25), limits))
    for trajectory in (planned(scenario), improve(planned(scenario), scenario, max_iterations=300)):
        assert trajectory.kinematic
        assert verify(trajectory, scenario).violations == ()
        assert by_independent_code(trajectory, scenario) == []


def test_no_ramp_bounds_the_step() -> None:
    """A robot of second order that turns as fast has to take shorter steps: the rate changes within them."""
    planned(replace(SCENARIO, planning=PlanningSettings(step=0.5, horizon=2.0)))
    limits = LIMITS._replace(acceleration=1.0, angular_acceleration=1.0)
    slow = replace(SCENARIO, robot=Robot(limits=limits), planning=PlanningSettings(step=0.5, horizon=2.0))
    with pytest.raises(CbrrtError, match=r"planning\.step: got 0\.5, expected at most"):
        plan(slow, "cb-rrt-robust")


# verification


def test_verify_holds_velocities_to_their_limits_and_poses_to_the_velocities() -> None:
    trajectory = planned(SCENARIO)
    slow = replace(SCENARIO, robot=Robot(SCENARIO.robot.footprint, LIMITS._replace(v_max=0.3)))
    assert {violation.kind for violation in verify(trajectory, slow).violations} == {"velocity", "command"}
    moved = replace(trajectory, x=trajectory.x + np.linspace(0.0, 0.1, len(trajectory)))
    assert "motion" in {violation.kind for violation in verify(moved, SCENARIO).violations}


def test_a_file_that_forgot_to_be_kinematic_is_refused_with_the_hint(tmp_path: Path) -> None:
    planned(SCENARIO).save(tmp_path / "plan.csv")
    found = verify(Trajectory.load(tmp_path / "plan.csv"), SCENARIO)
    assert not found.ok
    assert "kinematic=True" in found.hint
    assert verify(Trajectory.load(tmp_path / "plan.csv", kinematic=True), SCENARIO).ok


def test_the_command_line_takes_a_file_as_kinematic_without_being_told(tmp_path: Path) -> None:
    save_scenario(SCENARIO, tmp_path / "gap.yaml")
    files = [str(tmp_path / "plan.csv"), str(tmp_path / "gap.yaml")]
    planned(SCENARIO).save(files[0])
    assert main(["verify", *files]) == 0
    better = [str(tmp_path / "better.csv"), files[1]]
    assert main(["improve", *files, "--max-iterations", "300", "--output", better[0]]) == 0
    assert main(["verify", *better]) == 0
    assert main(["show", files[1], "--trajectory", better[0], "--figure", str(tmp_path / "show.png")]) == 0


# improvement


@pytest.mark.parametrize("scenario", [SCENARIO, AT_REST], ids=["position", "heading and rest"])
def test_an_improved_trajectory_jumps_and_is_no_slower_than_the_way_at_full_speed(scenario: Scenario) -> None:
    given = planned(scenario)
    better = improve(given, scenario, max_iterations=600)
    assert better.kinematic
    assert better.duration < 0.9 * given.duration
    assert verify(better, scenario).violations == ()
    assert by_independent_code(better, scenario) == []
    way = math.dist(scenario.start[:2], (scenario.goal.x, scenario.goal.y)) - scenario.goal.tolerance
    assert way / 0.5 < better.duration < 1.3 * way / 0.5 + 2.0


def test_to_arrive_at_rest_costs_one_step_alone() -> None:
    """It took an interval of the solver before, in which the robot hardly moved."""
    freely = replace(AT_REST, goal=replace(AT_REST.goal, speed_tolerance=None))
    moving, standing = (improve(planned(scenario), scenario, max_iterations=600) for scenario in (freely, AT_REST))
    assert standing.ends_at_rest
    assert abs(standing.v[-2]) > 0.1
    assert standing.duration <= moving.duration + AT_REST.planning.step


def test_smoothness_is_measured_by_the_range_of_the_velocities() -> None:
    t = np.array([0.0, 1.0, 2.0])
    x = np.array([1.0, 1.5, 1.5])
    v, zero = np.array([0.0, 0.5, 0.0]), np.zeros(3)
    trajectory = Trajectory(t, x, zero + 1.0, zero, v, zero, np.array([0.5, 0.0, 0.0]), zero, kinematic=True)
    assert Objective(smoothness=2.0).cost(trajectory, SCENARIO) == pytest.approx(2.0 + 2.0 * 2 * 0.25)


# driving and following


@pytest.mark.parametrize("iterations", [0, 300])
def test_a_drive_stops_on_the_spot_and_never_collides(iterations: int) -> None:
    settings = DriveSettings(sensor_range=1.5, max_samples=3000, max_iterations=iterations)
    scenario = replace(SCENARIO, planning=PlanningSettings(step=0.05))
    result = drive(scenario, None, settings, seed=1)
    assert result.reached
    assert result.trajectory.kinematic
    assert result.verification.ok
    assert result.smallest_clearance >= settings.margin


def test_a_follower_jumps_with_its_trajectory() -> None:
    trajectory = planned(SCENARIO)
    result = follow(trajectory, rate=10.0)
    assert result.largest_error < 0.02
    assert np.abs(np.diff(result.commands, axis=0)).max() > 0.2


# dynobench

MODEL = """
dynamics: unicycle1
max_vel: 0.5
min_vel: -0.5
max_angular_vel: 0.4
min_angular_vel: -0.4
size: [0.5, 0.25]
distance_weights: [1, 0.5]
shape: box
dt: 0.1
"""
PROBLEM = """
environment: {min: [0, 0], max: [6, 4], obstacles: []}
robots:
  - {type: unicycle1_v0, start: [1, 2, 0], goal: [5.2, 3, 1.55]}
"""


def dynobench_files(folder: Path, problem: str = PROBLEM, model: str = MODEL) -> tuple[Path, Path]:
    (folder / "wall.yaml").write_text(problem)
    (folder / "model.yaml").write_text(model)
    return folder / "wall.yaml", folder / "model.yaml"


def test_a_first_order_problem_of_dynobench_is_a_scenario(tmp_path: Path) -> None:
    found = load_dynobench(*dynobench_files(tmp_path), tolerance=0.4)
    assert found.robot.limits == Limits(-0.5, 0.5, -0.4, 0.4, math.inf, math.inf)
    assert found.start == (1.0, 2.0, 0.0, 0.0, 0.0)
    assert found.goal == Goal(5.2, 3.0, tolerance=0.2, theta=1.55, heading_tolerance=0.4)
    worst = found.goal.tolerance + 0.5 * found.goal.heading_tolerance
    assert worst <= 0.4 + 1e-9


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("type: unicycle1_v0", "type: unicycle2_v0", "robots[0].type: got the robot unicycle2_v0, expected unicycle1,"),
        ("min_vel: -0.5", "min_vel: 0.25", "min_vel: got 0.25, expected 0 or less: a robot that cannot stand still"),
        ("[1, 2, 0]", "[1, 2, 0, 0, 0]", "robots[0].start: got [1, 2, 0, 0, 0], expected 3 finite numbers [x, y, th"),
        ("[1, 0.5]", "[1, 0.5, 0.25, 0.25]", "distance_weights: got [1, 0.5, 0.25, 0.25], expected 2 finite numbers"),
        ("[1, 0.5]", "[1, 0]", "distance_weights: got [1, 0], expected 2 weights above 0"),
        ("robots:", "robots: [{}, {}]\nothers:", "robots: got 2 robots, expected a list of one robot"),
    ],
)
def test_what_first_order_problems_lack_is_refused_by_key(tmp_path: Path, old: str, new: str, words: str) -> None:
    with pytest.raises(MapError) as caught:
        load_dynobench(*dynobench_files(tmp_path, PROBLEM.replace(old, new), MODEL.replace(old, new)))
    assert words in str(caught.value)


PUBLISHED = Path(__file__).resolve().parents[2] / "shared" / "maps" / "dynobench"
"""The collection's own files, where somebody has put them beside this checkout."""


@pytest.mark.skipif(not PUBLISHED.is_dir(), reason="dynobench's files are not beside this checkout")
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("name", "seconds"), [("bugtrap", 20.7), ("kink", 13.2), ("parallelpark", 3.1)])
def test_published_costs_of_first_order_are_met(name: str, seconds: float, seed: int) -> None:
    scenario = load_dynobench(PUBLISHED / f"unicycle1_{name}_0.yaml", PUBLISHED / "unicycle1_v0.yaml", tolerance=0.03)
    trajectory = plan(scenario, "cb-rrt-anytime", seed=seed, max_iterations=1000).trajectory
    assert trajectory is not None
    assert trajectory.duration <= seconds
    assert verify(trajectory, scenario).violations == ()
    assert by_independent_code(trajectory, scenario) == []
