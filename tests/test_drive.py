"""Drives through half-known worlds: what is seen, when the robot plans again, and that it never touches anything."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from cbrrt_ompl.collision.clearance_map import ClearanceMap, clearance_map_for, extend_map
from hypothesis import given
from hypothesis import strategies as st

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.drive import Drive, DriveResult, DriveSettings, drive
from cbrrt_ompl.drive.knowledge import Knowledge
from cbrrt_ompl.drive.settings import grown, needed_range, stopping_distance
from cbrrt_ompl.drive.unknown import load_obstacles, random_obstacles, unknown_obstacles
from cbrrt_ompl.errors import InputError, ScenarioError, SettingsError
from cbrrt_ompl.planning import PlanResult, plan
from cbrrt_ompl.problem.obstacles import Bounds, Box, Disc, Obstacle, OrientedBox, Polygon, signed_distance
from cbrrt_ompl.problem.robot import Footprint, Limits, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.trajectory.trajectory import Trajectory

START = State(0.8, 2.0)
HALL = Bounds((0.0, 0.0), (8.0, 4.0))
ROUND = Robot(Footprint.disc(0.2), Limits(0.0, 1.0, -1.0, 1.0, 0.6, 2.0))
OBLONG = Robot(Footprint.polygon([[-0.3, -0.2], [0.3, -0.2], [0.3, 0.2], [-0.3, 0.2]]), ROUND.limits)
REPEATABLE = DriveSettings(sensor_range=2.5, max_samples=3000)
BOX_AHEAD = Box((4.0, 1.0), (4.4, 3.0))
WALL_WITH_GAP = (Box((4.0, 0.0), (4.2, 1.6)), Box((4.0, 2.4), (4.2, 4.0)))
PLUG = Box((3.9, 1.5), (4.3, 2.5))


def hall(*obstacles: Obstacle, robot: Robot = ROUND, start: State = START, **changes: object) -> Scenario:
    """A hall of 8 m x 4 m, to be driven through from left to right."""
    parts = {
        "name": "hall",
        "world": World(HALL, obstacles),
        "robot": robot,
        "start": start,
        "goal": Goal(7.2, 2.0, tolerance=0.4),
        "planning": PlanningSettings(horizon=1.5, step=0.05),
    }
    return Scenario(**{**parts, **changes})


def assert_sound(result: DriveResult) -> None:
    """The way driven is one trajectory that keeps all limits and touches nothing, and could be ended at rest."""
    assert result.verification.violations == ()
    np.testing.assert_array_equal(result.braking.states[: len(result.trajectory)], result.trajectory.states)
    np.testing.assert_array_equal(result.braking.states[-1, 3:], 0.0)
    collides = result.world.checker(result.scenario.robot.footprint).collides
    fine = np.linspace(result.braking.t[0], result.braking.t[-1], 20 * len(result.braking))
    assert not any(collides(*pose) for pose in result.braking.at(fine)[:, :3].tolist())


def test_a_drive_with_nothing_hidden_is_its_first_plan() -> None:
    result = drive(hall(), [], REPEATABLE, seed=1)
    assert (result.status, len(result.replans)) == ("reached", 1)
    assert_sound(result)
    first = result.replans[0]
    assert (first.time, first.start_time, first.status) == (0.0, 0.1, "solved")
    driven = result.trajectory
    np.testing.assert_array_equal(driven.states[2:], first.trajectory.states)
    np.testing.assert_array_equal(driven.states[:3], np.tile(driven.states[0], (3, 1)))


@pytest.mark.parametrize("robot", [ROUND, OBLONG], ids=["round", "oblong"])
def test_a_box_on_the_way_is_seen_in_time_and_driven_around_without_a_stop(robot: Robot) -> None:
    result = drive(hall(robot=robot), [BOX_AHEAD], REPEATABLE, seed=4)
    assert result.status == "reached"
    assert_sound(result)
    sighting = next(cycle for cycle in result.cycles if cycle.seen)
    assert sighting.seen == (BOX_AHEAD,)
    x, y = result.trajectory.at(sighting.time)[0, :2]
    assert 2.3 < signed_distance(BOX_AHEAD, np.array([x]), np.array([y]))[0] <= 2.5
    assert sighting.replan is not None
    assert sighting.replan.start.v > 0.5, "planned from standing"
    assert len(result.replans) >= 2


def test_a_gap_that_turns_out_closed_stops_the_robot_safely() -> None:
    settings = replace(REPEATABLE, max_samples=300, tries=3)
    result = drive(hall(*WALL_WITH_GAP), [PLUG], settings, seed=1)
    assert result.status == "stopped"
    assert_sound(result)
    assert result.trajectory.x.max() < 3.9 - 0.2
    np.testing.assert_array_equal(result.trajectory.states[-1, 3:], 0.0)
    assert [replan.samples for replan in result.replans[-3:]] == [300, 600, 1200]


def test_a_goal_that_turns_out_covered_stops_the_robot_safely() -> None:
    result = drive(hall(), [Disc((7.2, 2.0), 0.7)], replace(REPEATABLE, tries=1), seed=1)
    assert (result.status, result.replans[-1].status) == ("stopped", "no room")
    assert_sound(result)


def test_no_obstacle_of_the_scenario_is_known_unless_others_are_hidden() -> None:
    scenario = hall(BOX_AHEAD)
    result = drive(scenario, None, REPEATABLE, seed=2)
    assert (result.scenario.world.obstacles, result.hidden) == ((), (BOX_AHEAD,))
    assert result.world is scenario.world
    assert (result.status, sum(len(cycle.seen) for cycle in result.cycles)) == ("reached", 1)
    assert_sound(result)


def test_one_seed_is_one_drive_when_samples_limit_the_plans() -> None:
    first, second, other = (drive(hall(), [BOX_AHEAD], REPEATABLE, seed=seed) for seed in (5, 5, 6))
    assert first.trajectory == second.trajectory
    assert [r.samples for r in first.replans] == [r.samples for r in second.replans]
    assert other.trajectory != first.trajectory


def test_the_time_limit_ends_a_drive_at_rest() -> None:
    result = drive(hall(), [], replace(REPEATABLE, time_limit=2.0), seed=1)
    assert result.status == "stopped"
    assert 2.0 <= result.trajectory.duration < 2.0 + 1.0 / 0.6 + 0.3
    np.testing.assert_array_equal(result.trajectory.states[-1, 3:], 0.0)
    assert_sound(result)


def test_a_drive_begins_at_the_speed_of_its_start() -> None:
    result = drive(hall(start=State(0.8, 2.0, v=0.9, omega=0.3)), [], REPEATABLE, seed=1)
    assert result.status == "reached"
    assert result.trajectory.states[0].tolist() == [0.8, 2.0, 0.0, 0.9, 0.3]
    assert_sound(result)


def test_a_start_that_cannot_be_braked_from_is_refused() -> None:
    scenario = hall(start=State(0.8, 2.0, v=1.0))
    with pytest.raises(ScenarioError, match=r"start: got .* expected a state with 0\.01 m of room"):
        Drive(scenario, [Box((1.5, 1.5), (1.6, 2.5))], REPEATABLE)


def test_a_start_nearer_to_an_obstacle_than_the_margin_is_refused() -> None:
    with pytest.raises(ScenarioError, match="margin"):
        Drive(hall(start=State(0.205, 2.0)), [], REPEATABLE)


def test_a_start_in_the_goal_region_has_reached_it() -> None:
    result = drive(hall(start=State(7.0, 2.0)), [], REPEATABLE)
    assert (result.status, result.trajectory.duration, result.cycles) == ("reached", 0.0, ())


def test_a_sensor_that_sees_less_far_than_the_robot_is_committed_is_refused() -> None:
    needed = needed_range(ROUND, REPEATABLE, 0.05)
    assert needed == pytest.approx(2 * 0.1 * 1.0 + 1.0 / (2 * 0.6) + 0.2 + 0.01, abs=1e-3)
    Drive(hall(), [], replace(REPEATABLE, sensor_range=needed + 1e-6))
    with pytest.raises(SettingsError, match=r"^sensor_range: got 1\.0, expected more than 1\.24\d m"):
        Drive(hall(), [], replace(REPEATABLE, sensor_range=1.0))


def test_the_stopping_distance_is_that_of_the_hardest_braking() -> None:
    assert stopping_distance(ROUND, 0.001) == pytest.approx(1.0 / (2 * 0.6), rel=1e-3)


def test_a_cycle_is_whole_planning_steps() -> None:
    with pytest.raises(SettingsError, match=r"^cycle: got 0\.12, expected a multiple of planning\.step"):
        Drive(hall(), [], replace(REPEATABLE, cycle=0.12))


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("sensor_range", 0.0),
        ("cycle", math.nan),
        ("time_limit", -1.0),
        ("goal_bias", 1.5),
        ("margin", -0.1),
        ("max_samples", 0),
        ("tries", 1.5),
        ("planner", "s-rrt"),
        ("planner", "nobody"),
    ],
)
def test_settings_that_make_no_sense_are_refused(field: str, value: object) -> None:
    with pytest.raises(SettingsError, match=f"^{field}: got"):
        DriveSettings(**{field: value})


def test_planning_in_ompl_drives_as_well() -> None:
    result = drive(hall(), [BOX_AHEAD], replace(REPEATABLE, planner="cb-rrt"), seed=1)
    assert result.status == "reached"
    assert_sound(result)


def test_plans_take_no_longer_than_a_cycle_where_time_limits_them() -> None:
    settings = DriveSettings(sensor_range=2.5, tries=2)
    result = drive(hall(*WALL_WITH_GAP, PLUG), [], settings, seed=1)
    assert result.status == "stopped"
    assert [replan.status for replan in result.replans] == ["time limit", "time limit"]
    assert [replan.start_time - replan.time for replan in result.replans] == pytest.approx([0.1, 0.2])
    assert (result.planning_times >= np.array([0.03, 0.09])).all()


def test_a_plan_that_comes_late_is_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a clock that goes on by a second with each look at it."""
    clock = SimpleNamespace(perf_counter=iter(range(10**6)).__next__)
    monkeypatch.setattr("cbrrt_ompl.drive.simulation.time", clock)
    monkeypatch.setattr("cbrrt_ompl.drive.simulation.SHORTEST_SEARCH", 60.0)  # the search has another clock
    result = drive(hall(), [], DriveSettings(sensor_range=2.5, tries=2), seed=1)
    assert (result.status, [replan.status for replan in result.replans]) == ("stopped", ["late"] * 2)
    assert len(np.unique(result.trajectory.states, axis=0)) == 1


def test_a_plan_that_cannot_be_braked_from_is_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a planner that does not know of the wall in front of the robot."""

    def blind(scenario: Scenario, *arguments: object) -> PlanResult:
        return plan(replace(scenario, world=World(HALL)), *arguments)

    monkeypatch.setattr("cbrrt_ompl.drive.simulation.plan", blind)
    wall = Box((1.05, 0.0), (1.15, 4.0))
    result = drive(hall(wall), [], replace(REPEATABLE, tries=2), seed=1)
    assert result.status == "stopped"
    assert [replan.status for replan in result.replans[-2:]] == ["unsafe"] * 2
    assert_sound(result)


def test_progress_is_told_after_every_cycle() -> None:
    told = []
    result = drive(hall(), [], REPEATABLE, seed=1, progress=lambda *seen: told.append(seen))
    assert len(told) == len(result.cycles)
    assert told[-1][0] == pytest.approx(result.trajectory.duration)
    assert told[-1][1] < 0.4


def test_an_obstacle_is_seen_when_its_nearest_point_comes_into_range() -> None:
    disc, box = Disc((5.0, 2.0), 1.0), OrientedBox((1.0, 3.5), (0.4, 0.4), 0.3)
    knowledge = Knowledge(World(HALL, [BOX_AHEAD]), [disc, box], Footprint.point())
    assert knowledge.look(1.999, 2.0, 2.0) == [box]
    assert knowledge.look(1.9999, 2.0, 2.0) == []
    assert knowledge.look(2.0, 2.0, 2.0) == [disc]
    assert (knowledge.world.obstacles, knowledge.hidden) == ((BOX_AHEAD, box, disc), [])


coordinate = st.floats(0.5, 3.5)
obstacles = st.one_of(
    st.builds(Disc, st.tuples(coordinate, coordinate), st.floats(0.05, 0.8)),
    st.builds(OrientedBox, st.tuples(coordinate, coordinate), st.tuples(coordinate, coordinate), st.floats(-3.0, 3.0)),
    st.builds(lambda x, y, d: Box((x, y), (x + d, y + 0.5)), coordinate, coordinate, coordinate),
    st.builds(lambda x, y, d: Polygon(np.array([(x, y), (x + d, y), (x, y + d)])), coordinate, coordinate, coordinate),
)
poses = st.tuples(st.floats(-0.1, 8.1), st.floats(-0.1, 4.1), st.floats(-3.0, 3.0))


@given(st.lists(obstacles, max_size=3), st.lists(obstacles, min_size=1, max_size=3), st.lists(poses, min_size=5))
def test_a_map_that_learns_obstacles_answers_as_one_made_anew(
    known: list[Obstacle], added: list[Obstacle], asked: list[tuple[float, float, float]]
) -> None:
    before, after = World(HALL, known), World(HALL, [*known, *added])
    learned = clearance_map_for(before, OBLONG.footprint)
    for pose in asked:
        learned.collides(*pose)
    learned = extend_map(before, after, OBLONG.footprint)
    anew = ClearanceMap(after, OBLONG.footprint)
    for pose in asked:
        assert learned.collides(*pose) == anew.collides(*pose) == after.collides(OBLONG.footprint, pose)


@given(obstacles, st.lists(st.tuples(st.floats(0.1, 7.9), st.floats(0.1, 3.9)), min_size=1, max_size=10))
def test_signed_distances_are_those_of_fcl(obstacle: Obstacle, points: list[tuple[float, float]]) -> None:
    far = World(Bounds((-100.0, -100.0), (100.0, 100.0)), [obstacle])
    x, y = np.array(points).T
    found = signed_distance(obstacle, x, y)
    for distance, point in zip(found.tolist(), points, strict=True):
        if distance >= 0.0:
            assert distance == pytest.approx(far.signed_clearance(*point), abs=1e-6)
        else:
            assert far.signed_clearance(*point) <= 1e-6
            assert far.collides(Footprint.point(), (*point, 0.0))


def test_a_grown_footprint_keeps_the_margin() -> None:
    assert grown(Footprint.disc(0.2), 0.05).radius == pytest.approx(0.25)
    assert grown(OBLONG.footprint, 0.0) == OBLONG.footprint
    corners = grown(OBLONG.footprint, 0.05).vertices
    assert np.abs(corners).max(axis=0) == pytest.approx([0.35, 0.25])


def test_random_obstacles_leave_start_and_goal_alone() -> None:
    scenario = hall()
    made = unknown_obstacles(scenario, 30, 1, 0.05)
    assert made == unknown_obstacles(scenario, 30, 1, 0.05)
    assert {type(obstacle) for obstacle in made} == {Disc, OrientedBox}
    for place, room in (((0.8, 2.0), 0.25), ((7.2, 2.0), 0.4 + 0.2)):
        x, y = (np.array([value]) for value in place)
        assert min(signed_distance(obstacle, x, y)[0] for obstacle in made) > room


def test_more_random_obstacles_than_there_is_room_for_are_refused() -> None:
    with pytest.raises(InputError, match="there is no room for more"):
        random_obstacles(HALL, 1, np.random.default_rng(0), [(4.0, 2.0, 10.0)])


def test_hidden_obstacles_are_read_from_a_file(tmp_path: Path) -> None:
    file = tmp_path / "hidden.yaml"
    file.write_text("obstacles:\n  - {type: disc, center: [1, 2], radius: 0.5}\n")
    assert load_obstacles(file) == [Disc((1.0, 2.0), 0.5)]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("obstacles: [{type: disc, center: [1, 2]}]", r"obstacles\[0\]\.radius: missing"),
        ("bounds: 3", "bounds: got an unknown key"),
        ("{}", "obstacles: missing, expected a list of obstacles"),
        ("a: [", "hidden.yaml"),
    ],
)
def test_mistakes_in_a_file_of_hidden_obstacles_are_named(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "hidden.yaml"
    file.write_text(text)
    with pytest.raises(ScenarioError, match=message):
        load_obstacles(file)


def test_the_plans_of_a_drive_are_in_its_time() -> None:
    result = drive(hall(), [BOX_AHEAD], REPEATABLE, seed=4)
    last = [replan for replan in result.replans if replan.trajectory is not None][-1]
    assert isinstance(last.trajectory, Trajectory)
    assert last.trajectory.t[0] == pytest.approx(last.start_time)
    np.testing.assert_allclose(last.trajectory.states[0], result.trajectory.at(last.start_time)[0], atol=1e-12)
