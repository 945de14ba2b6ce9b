"""What others planned or recorded: rows without commands, dynobench's results and paths, verified to a tolerance."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cbrrt_ompl.cli import main
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import TrajectoryError
from cbrrt_ompl.maps import load_dynobench
from cbrrt_ompl.problem.obstacles import Bounds, Disc
from cbrrt_ompl.problem.robot import Footprint, Limits, Robot
from cbrrt_ompl.problem.settings import Goal, State
from cbrrt_ompl.scenario.scenario import Scenario, save_scenario
from cbrrt_ompl.trajectory.foreign import load_track
from cbrrt_ompl.trajectory.track import Track
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.verification import verify

REAL_MAPS = Path(__file__).resolve().parents[2] / "shared" / "maps"
needs_real_maps = pytest.mark.skipif(not REAL_MAPS.is_dir(), reason="the maps of others are not beside this checkout")

HALL = Scenario(
    name="hall",
    world=World(Bounds((-1.0, -2.0), (5.0, 2.0)), [Disc((2.0, 1.0), 0.3)]),
    robot=Robot(Footprint.disc(0.2), Limits(v_max=1.0, acceleration=0.5)),
    start=State(0.0, 0.0),
    goal=Goal(4.0, 0.0, 0.2, speed_tolerance=0.1),
)


def straight(rows: int = 41) -> Track:
    """From rest to rest along the x axis in 8 s: 2 s of speeding up to 2/3 m/s, and of slowing down."""
    t = np.linspace(0.0, 8.0, rows)
    a, v = 1.0 / 3.0, 2.0 / 3.0
    speed = np.minimum(np.minimum(a * t, v), a * (8.0 - t))
    x = np.select([t < 2.0, t < 6.0], [0.5 * a * t**2, v * (t - 1.0)], 4.0 - 0.5 * a * (8.0 - t) ** 2)
    zeros = np.zeros(rows)
    return Track(t, x, zeros, zeros, speed, zeros)


def kinds(track: Track, **settings: Any) -> list[str]:
    return [violation.kind for violation in verify(track, HALL, **settings).violations]


def without_velocities(track: Track) -> Track:
    return Track(track.t, track.x, track.y, track.theta)


def test_rows_without_commands_are_valid_where_the_robot_can_drive_them() -> None:
    result = verify(straight(), HALL)
    assert result.ok, result.summary()
    assert "every row where the one before leads, to 0.001 (m, rad)" in result.summary()
    assert result.clearance_bound > 0.0
    assert kinds(without_velocities(straight()), tolerance=1e-6) == []


@pytest.mark.parametrize(
    ("change", "kind"),
    [
        ({"x": 0.01}, "start"),
        ({"y": 0.01}, "start"),
        ({"v": 0.5}, "velocity"),
        ({"theta": 0.05}, "start"),
    ],
)
def test_what_is_off_by_more_than_the_tolerance_is_told_and_by_less_is_not(change: dict[str, float], kind: str) -> None:
    track = straight()
    moved = Track(**{n: getattr(track, n) + change.get(n, 0.0) for n in ("t", "x", "y", "theta", "v", "omega")})
    assert kind in kinds(moved)
    if kind == "start":
        assert kinds(moved, tolerance=0.06) == []


def test_a_step_sideways_is_no_motion_of_a_two_wheeled_robot() -> None:
    t = np.array([0.0, 1.0, 2.0, 12.0])
    track = Track(t, [0.0, 0.0, 0.0, 4.0], [0.0, 0.3, 0.0, 0.0], np.zeros(4))
    assert "motion" in kinds(track)
    assert "motion" not in kinds(track, tolerance=0.35)


def test_velocities_that_jump_are_accepted_of_a_kinematic_robot_alone() -> None:
    t = np.linspace(0.0, 8.0, 9)
    track = Track(t, 0.5 * t, 0.0 * t, 0.0 * t)
    assert kinds(track) == []  # the mean speeds between rows do not change
    jump = Track(t, np.array([0.0, 0.9, 1.0, 1.9, 2.0, 2.5, 3.0, 3.5, 4.0]), 0.0 * t, 0.0 * t)
    assert kinds(jump) == ["acceleration"]
    kinematic = Track(jump.t, jump.x, jump.y, jump.theta, kinematic=True)
    assert kinds(kinematic) == []


def test_collisions_alone_are_told_whatever_else_is_wrong() -> None:
    path = Track.through([(0.0, 1.9, 0.0), (2.0, 1.0, 0.0), (9.0, 0.0, 0.0)])
    result = verify(path, HALL, collisions_only=True)
    assert {violation.kind for violation in result.violations} == {"collision"}
    aside = Track.through([(-0.5, -1.5, 3.0), (4.5, -1.5, 1.0)])
    result = verify(aside, HALL, collisions_only=True)
    assert result.ok, result.summary()
    assert "goal region" not in result.summary()


def test_a_trajectory_of_ours_is_checked_for_collisions_alone_as_well() -> None:
    track = straight()
    trajectory = Trajectory(track.t, track.x, track.y, track.theta, track.v, track.omega, 9.0 * track.v, track.omega)
    assert not verify(trajectory, HALL).ok
    assert verify(trajectory, HALL, collisions_only=True).ok


def test_a_path_without_times_has_its_ends_and_collisions_checked() -> None:
    assert kinds(Track.through([(0.0, 0.0, 0.0), (4.1, 0.0, 0.0)])) == []
    assert kinds(Track.through([(0.1, 0.0, 0.0), (3.0, 0.0, 0.0)])) == ["start", "goal"]
    assert kinds(Track.through([(0.0, 0.0, 0.0), (2.0, 1.0, 0.0), (4.0, 0.0, 0.0)])) == ["collision"]


CSV = "t,x,y,theta\n0,1,2,0.5\n0.5,1.5,2,0.5\n"


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.csv", CSV),
        ("a.csv", "0,1,2,0.5\n0.5,1.5,2,0.5\n"),
        ("a.csv", "Time;Pos_X;pos_y;YAW\n0;1;2;0.5\n0.5;1.5;2;0.5\n"),
        ("a.txt", "# t x y theta\n0 1 2 0.5\n0.5 1.5 2 0.5\n"),
        ("a.csv", "name,t [s],x [m],y [m],theta [rad]\nstart,0,1,2,0.5\nend,0.5,1.5,2,0.5\n"),
        ("a.json", "[[0, 1, 2, 0.5], [0.5, 1.5, 2, 0.5]]"),
        ("a.json", '{"t": [0, 0.5], "x": [1, 1.5], "y": [2, 2], "yaw": [0.5, 0.5]}'),
    ],
)
def test_rows_of_time_and_pose_are_read_in_many_notations(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text)
    track = load_track(tmp_path / name)
    assert isinstance(track, Track)
    np.testing.assert_array_equal(np.column_stack([track.t, track.poses]), [[0, 1, 2, 0.5], [0.5, 1.5, 2, 0.5]])
    assert track.v is None


def test_velocities_are_read_where_they_are_there(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t,x,y,theta,v,omega\n0,0,0,0,0.1,0.2\n1,1,0,0,0.3,0.4\n")
    track = load_track(tmp_path / "a.csv")
    assert isinstance(track, Track)
    assert (track.v is not None and track.v.tolist()) == [0.1, 0.3]
    np.savez(tmp_path / "a.npz", t=[0.0], x=[0.0], y=[0.0], theta=[0.0], v=[1.0], omega=[2.0])
    assert isinstance(load_track(tmp_path / "a.npz"), Track)


@pytest.mark.parametrize("suffix", [".csv", ".json", ".npz"])
def test_trajectories_of_ours_are_read_as_such(tmp_path: Path, suffix: str) -> None:
    track = straight()
    trajectory = Trajectory(*(getattr(track, n) for n in ("t", "x", "y", "theta", "v", "omega", "v", "omega")))
    trajectory.save(tmp_path / f"a{suffix}")
    assert load_track(tmp_path / f"a{suffix}") == trajectory


RESULT = (
    "cost: 0.2\nstates:\n  - [0, 0, 0, 0, 0]\n  - [0, 0, 0, 0.02, 0]\n  - [0.002, 0, 0, 0.04, 0]\nactions: [[0.2, 0]]\n"
)


@pytest.mark.parametrize(
    ("text", "step", "has_velocities"),
    [
        (RESULT, 0.1, True),
        (RESULT.replace("cost: 0.2", "cost: 0.5"), 0.25, True),
        (RESULT.replace("cost: 0.2", "dt: 0.3"), 0.3, True),
        ("result:\n - states: [[0, 0, 0], [1, 0, 0]]\n", 0.1, False),
    ],
)
def test_results_of_dynobench_are_tracks(tmp_path: Path, text: str, step: float, has_velocities: bool) -> None:
    (tmp_path / "result.yaml").write_text(text)
    track = load_track(tmp_path / "result.yaml")
    assert isinstance(track, Track)
    np.testing.assert_allclose(np.diff(track.t), step)
    assert (track.v is not None) == has_velocities


@needs_real_maps
@pytest.mark.parametrize("name", ["bugtrap_0", "kink_0", "parallelpark_0"])
def test_the_published_results_of_dynobench_are_valid_to_half_a_centimetre(name: str) -> None:
    """Their integrator is Euler's, which errs by 1.25 mm in a step."""
    folder = REAL_MAPS / "dynobench"
    scenario = load_dynobench(folder / f"{name}.yaml", folder / "unicycle2_v0.yaml")
    track = load_track(folder / f"{name}_reference.yaml")
    assert verify(track, scenario, tolerance=5e-3).ok
    assert {violation.kind for violation in verify(track, scenario).violations} == {"motion"}


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.csv", "", "got no rows, expected columns t, x, y, theta"),
        ("a.csv", "a,b\n1,2\n", "t: missing, expected columns"),
        ("a.csv", "t,x,y,theta\n0,1,2\n", "line 2: got '3 values', expected 4 values"),
        ("a.csv", "t,x,y,theta\n0,1,2,left\n", "line 2, theta: got 'left', expected a number"),
        ("a.csv", "t,x,y,theta\n0,1,2,nan\n", "theta: got"),
        ("a.csv", "0,1,2,0\n0,2,2,0\n", "t[1]: got 0.0, expected a time above 0"),
        ("a.json", '{"t": [0]}', "x: missing"),
        ("a.json", "{", "expected whole and valid JSON"),
        ("a.yaml", "states: [[1, 2]]", "states: got [[1, 2]], expected rows [x, y, theta] or"),
        ("a.yaml", "cost: 3", "states: missing"),
        ("a.yaml", "result: [{}, {}]", "result: got 2 robots, expected the result of one"),
        ("a.yaml", "a: [", "expected a YAML file"),
        ("a.yaml", "poses: [{pose: 1}]", "poses[0]: got"),
        ("a.xyz", "", "suffix: got '.xyz'"),
        ("a.npz", "broken", "expected an undamaged NPZ archive"),
    ],
)
def test_what_is_no_track_is_refused_in_one_line(tmp_path: Path, name: str, text: str, words: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(TrajectoryError) as caught:
        load_track(tmp_path / name)
    first = str(caught.value).splitlines()[0]
    assert first.startswith(str(tmp_path / name))
    assert words in first


def test_the_command_line_judges_others(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    save_scenario(HALL, tmp_path / "hall.yaml")
    track = straight()
    rows = np.column_stack([track.t, track.x, track.y + 0.01, track.theta])
    np.savetxt(tmp_path / "other.csv", rows, delimiter=",")
    arguments = ["verify", str(tmp_path / "other.csv"), str(tmp_path / "hall.yaml")]
    assert main(arguments) == 1
    assert "start: y off by 0.01 m" in capsys.readouterr().out
    assert main([*arguments, "--tolerance", "0.02"]) == 0
    assert main([*arguments, "--collisions-only", "--json"]) == 0
    found = json.loads(capsys.readouterr().out.partition("{")[2].join(["{", ""]))
    assert found["scope"] == "collisions"
