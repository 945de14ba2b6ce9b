"""Out to the robot: bags that are read back, paths in YAML, and rows at a controller's rate."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cbrrt_ompl.cli import main
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import TrajectoryError
from cbrrt_ompl.export import ros_bag
from cbrrt_ompl.planning import plan
from cbrrt_ompl.problem.obstacles import Bounds, Box
from cbrrt_ompl.problem.robot import Footprint, Limits, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.scenario.scenario import Scenario, load_scenario, save_scenario
from cbrrt_ompl.trajectory.foreign import load_track
from cbrrt_ompl.trajectory.track import Track
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.verification import verify

ROOM = Scenario(
    name="room",
    world=World(Bounds((0.0, 0.0), (4.0, 3.0)), [Box((1.9, 1.0), (2.1, 3.0))]),
    robot=Robot(Footprint.polygon([(0.2, 0.1), (-0.1, 0.1), (-0.1, -0.1), (0.2, -0.1)]), Limits(0.0, 0.5, -1.5, 1.5)),
    start=State(0.7, 1.5, 1.0),
    goal=Goal(3.2, 1.5, 0.2, speed_tolerance=0.05),
    planning=PlanningSettings(closed_loop=True, goal_bias=0.05),
)


@pytest.fixture(scope="module")
def trajectory() -> Trajectory:
    result = plan(ROOM, planner="cb-rrt-robust", seed=1)
    assert result.trajectory is not None
    return result.trajectory


def messages(path: Path) -> dict[str, list[Any]]:
    """All messages of a bag by their topics, with their times [s]."""
    pytest.importorskip("rosbags", reason="the extra ros is not installed")
    from rosbags.highlevel import AnyReader

    found: dict[str, list[Any]] = {}
    with AnyReader([path]) as reader:
        for connection, stamp, data in reader.messages():
            entry = (1e-9 * stamp, reader.deserialize(data, connection.msgtype))
            found.setdefault(connection.topic, []).append(entry)
    return found


def test_a_bag_read_back_holds_the_trajectory_the_map_and_the_footprint(tmp_path: Path, trajectory: Trajectory) -> None:
    pytest.importorskip("rosbags", reason="the extra ros is not installed")
    trajectory.save(tmp_path / "x.mcap", ROOM)
    assert [file.name for file in tmp_path.iterdir()] == ["x.mcap"]
    found = messages(tmp_path / "x.mcap")
    assert set(found) == {"/plan", "/cmd_vel", "/odom", "/map", "/tf", "/tf_static", "/footprint"}

    ((_, path),) = found["/plan"]
    assert path.header.frame_id == "map"
    stamps = [p.header.stamp.sec + 1e-9 * p.header.stamp.nanosec for p in path.poses]
    np.testing.assert_allclose(stamps, trajectory.t, atol=1e-9)
    for stamped, (x, y, theta) in zip(path.poses, trajectory.poses, strict=True):
        q = stamped.pose.orientation
        assert (stamped.pose.position.x, stamped.pose.position.y) == (x, y)
        assert math.hypot(q.z, q.w) == pytest.approx(1.0)
        assert math.remainder(2.0 * math.atan2(q.z, q.w) - theta, math.tau) == pytest.approx(0.0, abs=1e-12)

    commands = np.array([(time, twist.linear.x, twist.angular.z) for time, twist in found["/cmd_vel"]])
    np.testing.assert_allclose(commands[:, 0], trajectory.t, atol=1e-9)
    np.testing.assert_array_equal(
        commands[:-1, 1:], np.column_stack([trajectory.v_command, trajectory.omega_command])[:-1]
    )
    odometry = [(m.pose.pose.position.x, m.twist.twist.linear.x, m.twist.twist.angular.z) for _, m in found["/odom"]]
    np.testing.assert_array_equal(odometry, trajectory.states[:, [0, 3, 4]])
    assert len(found["/tf"]) == len(trajectory)
    assert found["/tf"][0][1].transforms[0].child_frame_id == "base_link"

    ((_, grid),) = found["/map"]
    cells = np.array(grid.data).reshape(grid.info.height, grid.info.width)
    assert (grid.info.width * grid.info.resolution, grid.info.height * grid.info.resolution) == pytest.approx(
        (4.0, 3.0)
    )
    assert cells[45, 40] == 100 and cells[10, 40] == 0  # in the wall, and in the gap below it
    ((_, footprint),) = found["/footprint"]
    corners = [(p.x, p.y) for p in footprint.polygon.points]
    np.testing.assert_allclose(corners, ROOM.robot.footprint.vertices, rtol=1e-6)


def test_a_bag_without_a_scenario_has_neither_map_nor_footprint(tmp_path: Path, trajectory: Trajectory) -> None:
    pytest.importorskip("rosbags", reason="the extra ros is not installed")
    trajectory.save(tmp_path / "x.mcap")
    assert set(messages(tmp_path / "x.mcap")) == {"/plan", "/cmd_vel", "/odom", "/tf", "/tf_static"}


def test_a_path_out_of_a_bag_is_verified(
    tmp_path: Path, trajectory: Trajectory, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("rosbags", reason="the extra ros is not installed")
    trajectory.save(tmp_path / "x.mcap", ROOM)
    save_scenario(ROOM, tmp_path / "room.yaml")
    track = ros_bag.read_track(tmp_path / "x.mcap")
    np.testing.assert_allclose(track.poses, trajectory.poses, atol=1e-12)
    assert main(["verify", str(tmp_path / "x.mcap"), str(tmp_path / "room.yaml"), "--tolerance", "0.1"]) == 0
    assert main(["verify", str(tmp_path / "x.mcap"), str(tmp_path / "room.yaml"), "--topic", "/path"]) == 2
    assert "expected a path on the topic /path" in capsys.readouterr().err
    (tmp_path / "broken.mcap").write_bytes((tmp_path / "x.mcap").read_bytes()[:999])
    assert main(["verify", str(tmp_path / "broken.mcap"), str(tmp_path / "room.yaml")]) == 2
    assert "broken.mcap: got" in capsys.readouterr().err


def test_a_path_without_stamps_or_headings_becomes_one_along_its_way(tmp_path: Path) -> None:
    zeros = "header: {stamp: {sec: 0, nanosec: 0}}"
    pose = "pose: {position: {x: %s, y: %s}, orientation: {x: 0, y: 0, z: 0, w: 1}}"
    lines = [f"  - {{{zeros}, {pose % xy}}}" for xy in ((0, 0), (1, 0), (1, 1), (1, 1))]
    (tmp_path / "path.yaml").write_text("\n".join([f"{zeros}", "poses:", *lines, "---"]) + "\n")
    track = load_track(tmp_path / "path.yaml")
    assert isinstance(track, Track) and not track.is_timed
    np.testing.assert_allclose(track.theta, [0.0, math.pi / 2, math.pi / 2])


def test_a_path_in_yaml_is_read_back(tmp_path: Path, trajectory: Trajectory) -> None:
    trajectory.save(tmp_path / "path.yaml")
    track = load_track(tmp_path / "path.yaml")
    np.testing.assert_allclose(track.poses, trajectory.poses, atol=1e-12)
    np.testing.assert_allclose(track.t, trajectory.t, atol=1e-9)


def test_a_bag_without_the_library_says_what_to_install(
    tmp_path: Path, trajectory: Trajectory, monkeypatch: pytest.MonkeyPatch
) -> None:

    for name in [name for name in sys.modules if name.startswith("rosbags")] + ["rosbags", "rosbags.interfaces"]:
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(TrajectoryError, match=r"expected the library rosbags: pip install 'cbrrt-ompl\[ros\]'"):
        trajectory.save(tmp_path / "x.mcap")


def test_another_suffix_is_refused_with_those_that_there_are(tmp_path: Path, trajectory: Trajectory) -> None:
    with pytest.raises(TrajectoryError, match=r"one of .csv, .json, .npz, .mcap, .yaml, .yml"):
        trajectory.save(tmp_path / "x.bag2")
    with pytest.raises(TrajectoryError, match=r"one of .csv, .json, .npz$"):
        Trajectory.load(tmp_path / "x.mcap")


@pytest.mark.parametrize("hz", [5.0, 10.0, 20.0, 30.0, 50.0, 7.3])
def test_rows_at_another_rate_are_valid_and_near_the_old_ones(trajectory: Trajectory, hz: float) -> None:
    other = trajectory.resampled(hz)
    np.testing.assert_allclose(np.diff(other.t), 1.0 / hz)
    assert verify(other, ROOM).ok
    at_rest = trajectory.ends_at_rest
    assert other.ends_at_rest == at_rest
    common = other.t <= trajectory.t[-1]
    off = other.states[common] - trajectory.at(other.t[common])
    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.02


@pytest.mark.parametrize("hz", [20.0, 40.0, 100.0])
def test_a_rate_that_has_all_rows_is_the_very_same_motion(trajectory: Trajectory, hz: float) -> None:
    other = trajectory.resampled(hz)
    np.testing.assert_allclose(other.states, trajectory.at(other.t), atol=1e-12)
    assert verify(other, ROOM).ok
    every = round(hz / 20.0)
    np.testing.assert_array_equal(other.states[::every], trajectory.states)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["paper_case1", "office", "dock"])
@pytest.mark.parametrize("planner", ["cb-rrt-robust", "s-rrt-compiled"])
def test_resampled_plans_pass_verification(name: str, planner: str) -> None:
    scenario = load_scenario(name)
    for seed in range(3):
        found = plan(scenario, planner=planner, seed=seed).trajectory
        if found is None or not verify(found, scenario).ok:
            continue
        for hz in (10.0, 25.0, 100.0):
            result = verify(found.resampled(hz), scenario)
            assert result.ok, (seed, hz, result.summary())


def test_a_rate_that_is_none_is_refused(trajectory: Trajectory) -> None:
    for hz in (0.0, -1.0, math.nan, "20"):
        with pytest.raises(TrajectoryError, match="hz: got"):
            trajectory.resampled(hz)  # type: ignore[arg-type]
    with pytest.raises(TrajectoryError, match="at most 1000000"):
        trajectory.resampled(1e7)


def test_a_trajectory_of_one_row_stays_one() -> None:
    one = Trajectory(*([[0.0]] * 8))
    assert one.resampled(20.0) == one


def test_past_its_end_a_trajectory_at_rest_rests_and_another_says_how_to_brake() -> None:
    t = np.array([0.0, 1.0])
    zeros = np.zeros(2)
    moving = Trajectory(t, t, zeros, zeros, np.ones(2), zeros, np.ones(2), zeros)
    with pytest.raises(TrajectoryError, match=r"the robot still moves: stopping_at\(1\) brakes it"):
        moving.at(1.5)
    slowing = Trajectory(t, 0.5 * t, zeros, zeros, np.array([1.0, 0.0]), zeros, zeros, zeros)
    np.testing.assert_array_equal(slowing.at([1.0, 7.0]), np.repeat(slowing.states[-1:], 2, axis=0))
    with pytest.raises(TrajectoryError, match="times from 0 to 1 s"):
        slowing.at(-1.0)


def test_the_command_line_writes_bags_and_paths(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    save_scenario(ROOM, "room.yaml")
    command = ["plan", "room.yaml", "--planner", "cb-rrt-robust", "--seed", "1", "--trajectory"]
    assert main([*command, "way.yaml"]) == 0
    assert verify(load_track(tmp_path / "way.yaml"), ROOM, collisions_only=True).ok
    pytest.importorskip("rosbags", reason="the extra ros is not installed")
    assert main([*command, "way.mcap"]) == 0
    assert "/map" in messages(tmp_path / "way.mcap")
    capsys.readouterr()


def test_a_bag_without_its_library_is_refused_before_any_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rosbags.interfaces", None)
    monkeypatch.setattr("cbrrt_ompl.planning.plan", lambda *_, **__: pytest.fail("planned"))
    assert main(["plan", "office", "--trajectory", str(tmp_path / "way.mcap")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith("expected the library rosbags: pip install 'cbrrt-ompl[ros]'")
