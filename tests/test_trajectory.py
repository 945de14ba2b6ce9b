"""Trajectories: their checks, figures of merit, interpolation and files; and the tree beside them."""

from __future__ import annotations

import json
import math
import os
from dataclasses import FrozenInstanceError, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from cbrrt_ompl.errors import InputError, TrajectoryError
from cbrrt_ompl.planning import plan
from cbrrt_ompl.problem.robot import Limits
from cbrrt_ompl.scenario.scenario import load_scenario
from cbrrt_ompl.trajectory.columns import COLUMNS
from cbrrt_ompl.trajectory.displacement import displacement, wrapped
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.trajectory.tree import Tree
from cbrrt_ompl.verification import verify

SUFFIXES = (".csv", ".npz", ".json")


def profile(
    t: list[float], v: list[float], omega: list[float], kinematic: bool = False, theta: list[float] | None = None
) -> Trajectory:
    """A trajectory with given velocity profiles that stays where it is."""
    zero = np.zeros(len(t))
    heading = zero if theta is None else np.array(theta)
    return Trajectory(
        np.array(t),
        zero,
        zero,
        heading,
        np.array(v),
        np.array(omega),
        np.array(v),
        np.array(omega),
        kinematic=kinematic,
    )


def arc(rows: int = 21, radius: float = 2.0, speed: float = 1.0, kinematic: bool = False) -> Trajectory:
    """A circular arc about (0, radius) at constant speed, a row every 0.1 s."""
    t = np.linspace(0.0, 0.1 * (rows - 1), rows)
    angle = speed / radius * t
    v, omega = np.full(rows, speed), np.full(rows, speed / radius)
    return Trajectory(
        t, radius * np.sin(angle), radius * (1 - np.cos(angle)), angle, v, omega, v, omega, kinematic=kinematic
    )


numbers = st.floats(allow_nan=False, allow_infinity=False)


@st.composite
def trajectories(draw: st.DrawFn) -> Trajectory:
    times = sorted(draw(st.lists(numbers, min_size=1, max_size=6, unique=True)))
    rest = draw(hnp.arrays(np.float64, (7, len(times)), elements=numbers))
    return Trajectory(np.array(times), *rest, kinematic=draw(st.booleans()))


@given(trajectory=trajectories(), suffix=st.sampled_from(SUFFIXES))
def test_every_format_gives_back_what_was_saved_to_the_last_bit(
    tmp_path_factory: pytest.TempPathFactory, trajectory: Trajectory, suffix: str
) -> None:
    path = tmp_path_factory.getbasetemp() / f"round_trip{suffix}"
    trajectory.save(path)
    loaded = Trajectory.load(path, kinematic=trajectory.kinematic)
    assert loaded == trajectory
    for name in COLUMNS:
        assert getattr(loaded, name).tobytes() == getattr(trajectory, name).tobytes()


@pytest.mark.parametrize("suffix", [".npz", ".json"])
def test_the_file_knows_better_than_the_caller_whether_it_is_kinematic(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    arc(kinematic=True).save(path)
    assert Trajectory.load(path, kinematic=False).kinematic
    arc().save(path)
    assert not Trajectory.load(path, kinematic=True).kinematic


def test_csv_has_the_documented_header_and_a_row_a_step(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    arc(rows=3).save(path)
    lines = path.read_bytes().decode().split("\n")
    assert lines[0] == "t,x,y,theta,v,omega,v_command,omega_command"
    assert lines[1] == "0.0,0.0,0.0,0.0,1.0,0.5,1.0,0.5"
    assert len(lines) == 5 and lines[-1] == ""


@pytest.mark.parametrize("suffix", [".CSV", ".Npz", ".JSON"])
def test_the_case_of_the_suffix_does_not_matter(tmp_path: Path, suffix: str) -> None:
    arc().save(tmp_path / f"a{suffix}")
    assert Trajectory.load(str(tmp_path / f"a{suffix}")) == arc()


def test_csv_of_other_programs_with_byte_order_mark_and_crlf_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    arc().save(path)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    assert Trajectory.load(path) == arc()


def test_arrays_are_copies_and_read_only() -> None:
    t = np.array([0.0, 1.0])
    trajectory = Trajectory(t, t, t, t, t, t, t, t)
    t[0] = 0.5
    assert trajectory.t[0] == 0.0
    assert not trajectory.x.flags.writeable
    with pytest.raises(FrozenInstanceError):
        trajectory.x = t  # type: ignore[misc]


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        ("x", [0.0], "x: got '1 values', expected 2 values, as many as t"),
        ("y", [0.0, math.nan], r"y\[1\]: got nan, expected a finite number"),
        ("t", [0.0, math.inf], r"t\[1\]: got inf, expected a finite number"),
        ("t", [1.0, 1.0], r"t\[1\]: got 1.0, expected a time above 1.0, the one before"),
        ("v", [[0.0], [1.0]], "v: got .*, expected a one-dimensional array of numbers"),
        ("v", ["0", "1"], "v: got .*, expected a one-dimensional array of numbers"),
        ("v", [[0.0], 1.0], "v: got .*, expected a one-dimensional array of numbers"),
        ("omega", 3.0, "omega: got 3.0, expected a one-dimensional array of numbers"),
        ("theta", [None, 0.0], "theta: got .*, expected a one-dimensional array of numbers"),
    ],
)
def test_arrays_that_are_no_trajectory_are_refused_by_name(column: str, value: object, message: str) -> None:
    with pytest.raises(TrajectoryError, match=message):
        Trajectory(**{**dict.fromkeys(COLUMNS, [0.0, 1.0]), column: value})  # type: ignore[arg-type]


def test_no_rows_are_no_trajectory() -> None:
    with pytest.raises(TrajectoryError, match="at least one row"):
        Trajectory(*([[]] * 8))  # type: ignore[arg-type]


def test_a_single_row_has_no_duration_no_length_and_no_turns() -> None:
    state = Trajectory(*np.arange(8.0)[:, None])
    assert (len(state), state.duration, state.length, state.point_turns) == (1, 0.0, 0.0, [])
    np.testing.assert_array_equal(state.at(0.0), [[1.0, 2.0, 3.0, 4.0, 5.0]])


def test_trajectories_are_equal_where_arrays_and_model_are() -> None:
    assert arc() == arc()
    assert arc() != arc(kinematic=True)
    assert arc() != arc(rows=20)
    assert arc() != "arc"


def test_length_of_an_arc_is_its_radius_times_its_angle() -> None:
    assert arc().length == pytest.approx(2.0)
    assert arc(kinematic=True).length == pytest.approx(2.0)


def test_length_counts_both_ways_where_the_velocity_changes_its_sign() -> None:
    """From 1 to -3 m/s in 1 s: 0.125 m ahead, then 1.125 m back."""
    assert profile([0.0, 1.0], [1.0, -3.0], [0.0, 0.0]).length == pytest.approx(1.25)


@pytest.mark.parametrize("v", [(-1e308, 0.1), (1e308, 1e308), (-1e308, 1e308)])
def test_the_length_of_a_motion_at_the_largest_velocities_is_no_warning(v: tuple[float, float]) -> None:
    assert 4e306 < profile([0.0, 0.1], list(v), [0.0, 0.0]).length < 1.1e307


def test_length_of_a_kinematic_trajectory_follows_the_commands() -> None:
    assert profile([0.0, 2.0, 3.0], [0.5, -1.0, 7.0], [0.0] * 3, kinematic=True).length == pytest.approx(2.0)


@given(
    v=hnp.arrays(np.float64, 5, elements=st.floats(-2, 2)),
    dt=hnp.arrays(np.float64, 4, elements=st.floats(0.01, 1)),
)
def test_length_is_the_integral_of_the_speed(v: NDArray[np.float64], dt: NDArray[np.float64]) -> None:
    t = np.concatenate([[0.0], np.cumsum(dt)])
    fine = np.linspace(0.0, t[-1], 20001)
    speed = np.abs(np.interp(fine, t, v))
    expected = float(np.sum(0.5 * (speed[1:] + speed[:-1])) * (fine[1] - fine[0]))
    assert profile(t.tolist(), v.tolist(), [0.0] * 5).length == pytest.approx(expected, abs=1e-6)


def test_a_point_turn_is_the_whole_stretch_of_turning_on_the_spot() -> None:
    theta = [0.0, 0.0, 0.3, 0.6, 0.6]
    trajectory = profile([0.0, 1.0, 2.0, 3.0, 4.0], [1.0, 0.0, 0.0, 0.0, 1.0], [0.0] * 5, theta=theta)
    (turn,) = trajectory.point_turns
    assert turn == pytest.approx((1.0, 3.0, 0.0, 0.0, 0.6))


def test_a_point_turn_is_counted_through_the_wrap_of_the_heading() -> None:
    (turn,) = profile([0.0, 1.0, 2.0], [0.0] * 3, [0.5] * 3, theta=[3.0, -3.0, -2.5]).point_turns
    assert turn.angle == pytest.approx(2 * math.pi - 5.5)


def test_waiting_with_less_than_a_degree_of_turning_is_no_point_turn() -> None:
    still = profile([0.0, 1.0, 2.0], [0.0] * 3, [0.0] * 3, theta=[0.0, 0.008, 0.016])
    assert still.point_turns == []
    assert len(profile([0.0, 1.0, 2.0], [0.0] * 3, [0.0] * 3, theta=[0.0, 0.009, 0.018]).point_turns) == 1


def test_two_turns_with_a_drive_between_them_are_two() -> None:
    v = [0.0, 0.0, 1.0, 0.0, 0.0]
    turns = profile([0.0, 1.0, 2.0, 3.0, 4.0], v, [0.0] * 5, theta=[0.0, 1.0, 1.0, 1.0, 0.5]).point_turns
    assert [(turn.start, turn.end, turn.angle) for turn in turns] == [(0.0, 1.0, 1.0), (3.0, 4.0, -0.5)]


def test_a_kinematic_point_turn_follows_the_command_not_the_row_before() -> None:
    """Row 1 still holds the velocity of the step before it, though the robot stands from there on."""
    command = np.array([1.0, 0.0, 0.0])
    zero, t = np.zeros(3), np.arange(3.0)
    theta = np.array([0.0, 0.0, 0.7])
    trajectory = Trajectory(t, zero, zero, theta, np.array([0.0, 1.0, 0.0]), zero, command, zero, kinematic=True)
    (turn,) = trajectory.point_turns
    assert (turn.start, turn.end) == (1.0, 2.0)


def test_states_at_the_rows_are_the_rows() -> None:
    trajectory = arc()
    np.testing.assert_array_equal(trajectory.at(trajectory.t), trajectory.states)
    np.testing.assert_array_equal(trajectory.poses, trajectory.states[:, :3])


@pytest.mark.parametrize("kinematic", [False, True])
def test_states_between_the_rows_of_an_arc_lie_on_it(kinematic: bool) -> None:
    times = np.array([0.03, 0.1, 1.234, 1.999])
    x, y, theta, v, omega = arc(kinematic=kinematic).at(times).T
    np.testing.assert_allclose(x, 2.0 * np.sin(times / 2), atol=1e-14)
    np.testing.assert_allclose(y, 2.0 * (1 - np.cos(times / 2)), atol=1e-14)
    np.testing.assert_allclose(theta, times / 2, atol=1e-14)
    np.testing.assert_array_equal([v, omega], [[1.0] * 4, [0.5] * 4])


def test_velocities_between_the_rows_are_linear_or_the_command() -> None:
    t, v, omega = [0.0, 1.0], [0.0, 1.0], [0.0, -2.0]
    np.testing.assert_allclose(profile(t, v, omega).at(0.25)[0, 3:], [0.25, -0.5])
    command = np.array([3.0, 3.0])
    zero = np.zeros(2)
    jumps = Trajectory(np.array(t), zero, zero, zero, np.array(v), zero, command, command, kinematic=True)
    np.testing.assert_allclose(jumps.at([0.0, 0.25, 1.0])[:, 3], [0.0, 3.0, 1.0])


def test_headings_between_the_rows_are_wrapped() -> None:
    assert profile([0.0, 1.0], [0.0, 0.0], [1.0, 1.0], theta=[3.0, wrapped(4.0).item()]).at(0.5)[0, 2] == pytest.approx(
        3.5 - 2 * math.pi
    )


@pytest.mark.parametrize("time", [-0.001, 2.5, math.nan])
def test_a_time_outside_the_trajectory_is_an_error(time: float) -> None:
    with pytest.raises(TrajectoryError, match="times from 0 to 2 s"):
        arc().at([1.0, time])


@given(angle=st.floats(-1e6, 1e6))
def test_wrapped_angles_are_the_same_direction_in_the_half_open_interval(angle: float) -> None:
    result = float(wrapped(angle))
    assert -math.pi <= result < math.pi
    assert abs(math.remainder(result - angle, math.tau)) < 1e-9


def test_pi_wraps_to_minus_pi_however_rounding_falls() -> None:
    assert wrapped(math.pi) == wrapped(-math.pi) == -math.pi
    assert wrapped(-math.pi - 4e-16) < math.pi


@given(
    theta=st.floats(-3, 3),
    v=st.tuples(st.floats(-1, 1), st.floats(-1, 1)),
    omega=st.tuples(st.floats(-2, 2), st.floats(-2, 2)),
    dt=st.floats(0.01, 0.5),
)
def test_displacement_agrees_with_a_fine_integration(
    theta: float, v: tuple[float, float], omega: tuple[float, float], dt: float
) -> None:
    parts = 2000
    s = (np.arange(parts) + 0.5) / parts
    heading = theta + dt * s * (omega[0] + 0.5 * (omega[1] - omega[0]) * s)
    speed = v[0] + (v[1] - v[0]) * s
    expected = dt / parts * np.array([np.sum(speed * np.cos(heading)), np.sum(speed * np.sin(heading))])
    dx, dy, turn = displacement(*(np.array([value]) for value in (theta, *v, *omega, dt)))[0]
    np.testing.assert_allclose([dx, dy], expected, atol=1e-7)
    assert turn == pytest.approx(dt * sum(omega) / 2)


GOOD_ROW = "0.0,0.0,0.0,0.0,1.0,0.5,1.0,0.5"
HEADER = ",".join(COLUMNS)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1: got '', expected the header t,x,y"),
        ("t,x,y\n0,0,0\n", "line 1: got 't,x,y', expected the header t,x,y,theta"),
        (HEADER + "\n", "at least one row"),
        (f"{HEADER}\n{GOOD_ROW}\n1.0,2.0\n", "line 3: got '2 values', expected 8 values"),
        (f"{HEADER}\n{GOOD_ROW},9\n", "line 2: got '9 values', expected 8 values"),
        (f"{HEADER}\n\n{GOOD_ROW}\n", "line 2: got '1 values', expected 8 values"),
        (f"{HEADER}\n{GOOD_ROW}\n1,0,zero,0,0,0,0,0\n", "line 3, y: got 'zero', expected a number"),
        (f"{HEADER}\n{GOOD_ROW}\n1,0,,0,0,0,0,0\n", "line 3, y: got '', expected a number"),
        (f"{HEADER}\n{GOOD_ROW}\n1,0,0,0,nan,0,0,0\n", "line 3, v: got nan, expected a finite number"),
        (f"{HEADER}\n{GOOD_ROW}\n{GOOD_ROW}\n", "line 3, t: got 0.0, expected a time above 0.0"),
    ],
)
def test_a_bad_csv_file_is_refused_with_file_and_line(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(TrajectoryError, match=message) as caught:
        Trajectory.load(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert len(str(caught.value).splitlines()) == 1


def json_without(name: str, **others: object) -> str:
    values = {"kinematic": False, **dict.fromkeys(COLUMNS, [0.0]), **others}
    return json.dumps({key: value for key, value in values.items() if key != name})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"t": [0.0, 1', r"line 1, column \d+: got .*, expected whole and valid JSON"),
        ("[1, 2]", r"got \[1, 2\], expected an object with t, x"),
        ("[" * 100_000, "expected .*JSON"),
        (json_without("omega"), "omega: missing, expected the entries t, x"),
        (json_without("kinematic"), "kinematic: missing"),
        (json_without("", speed=[0.0]), "got 'speed', expected the entries t, x"),
        (json_without("", kinematic=0), "kinematic: got 0, expected true or false"),
        (json_without("", x=["0"]), "x: got .*, expected a one-dimensional array of numbers"),
        (json_without("", x=[10**400]), "x: got .*, expected a one-dimensional array of numbers"),
        (json_without("", x=[math.nan]), r"x\[0\]: got nan, expected a finite number"),
        (json_without("", x=[0.0, 1.0]), "x: got '2 values', expected 1 values"),
    ],
)
def test_a_bad_json_file_is_refused_with_file_and_place(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "bad.json"
    path.write_text(text)
    with pytest.raises(TrajectoryError, match=message) as caught:
        Trajectory.load(path)
    assert all(line.startswith(f"{path}: ") for line in str(caught.value).splitlines())


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("content", [b"", b"\xff\xfe\x00", b"PK\x03\x04 no archive", b"\x93NUMPY\x01\x00"])
def test_bytes_of_something_else_are_refused(tmp_path: Path, suffix: str, content: bytes) -> None:
    path = tmp_path / f"bad{suffix}"
    path.write_bytes(content)
    with pytest.raises(TrajectoryError, match="expected"):
        Trajectory.load(path)


@given(cut=st.floats(0.0, 1.0, exclude_max=True))
def test_a_truncated_npz_file_is_refused(tmp_path_factory: pytest.TempPathFactory, cut: float) -> None:
    path = tmp_path_factory.getbasetemp() / "cut.npz"
    arc(rows=3).save(path)
    content = path.read_bytes()
    path.write_bytes(content[: int(cut * len(content))])
    with pytest.raises(TrajectoryError, match="cut.npz: .*expected"):
        Trajectory.load(path)


@given(place=st.floats(0.0, 1.0, exclude_max=True), value=st.integers(0, 255))
def test_a_damaged_npz_file_raises_nothing_else(
    tmp_path_factory: pytest.TempPathFactory, place: float, value: int
) -> None:
    path = tmp_path_factory.getbasetemp() / "damaged.npz"
    arc(rows=3).save(path)
    content = bytearray(path.read_bytes())
    content[int(place * len(content))] = value
    path.write_bytes(content)
    try:
        loaded = Trajectory.load(path)
    except TrajectoryError as error:
        assert "damaged.npz: " in str(error)
    else:
        assert loaded == arc(rows=3)


def test_an_npz_file_with_pickled_objects_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "pickled.npz"
    values = {**dict.fromkeys(COLUMNS, np.zeros(1)), "kinematic": np.array(False), "x": np.array([{}], dtype=object)}
    np.savez(path, allow_pickle=True, **values)
    with pytest.raises(TrajectoryError, match="an undamaged NPZ archive"):
        Trajectory.load(path)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(TrajectoryError, match="^no such file: .*none.csv"):
        Trajectory.load(tmp_path / "none.csv")


@pytest.mark.parametrize("name", ["a.txt", "a", "a.csv.gz"])
def test_an_unknown_suffix_is_refused_with_the_known_ones(tmp_path: Path, name: str) -> None:
    for act in (arc().save, Trajectory.load):
        with pytest.raises(TrajectoryError, match="expected one of .csv, .json, .npz"):
            act(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_and_a_folder_as_file_cannot_be_written_or_read(tmp_path: Path) -> None:
    with pytest.raises(TrajectoryError, match="no such folder to write in: .*a.csv"):
        arc().save(tmp_path / "none" / "a.csv")
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(TrajectoryError, match="cannot write .*folder.csv: is a directory"):
        arc().save(tmp_path / "folder.csv")
    with pytest.raises(TrajectoryError, match="cannot read .*folder.csv: is a directory"):
        Trajectory.load(tmp_path / "folder.csv")
    assert [path.name for path in tmp_path.iterdir()] == ["folder.csv"]


def test_a_save_that_is_interrupted_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.csv"
    arc().save(path)

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupt)
    with pytest.raises(KeyboardInterrupt):
        arc(rows=5).save(path)
    assert [file.name for file in tmp_path.iterdir()] == ["a.csv"]
    assert Trajectory.load(path) == arc()


def test_a_tree_counts_its_nodes_and_keeps_read_only_copies() -> None:
    states = np.zeros((2, 5))
    tree = Tree(states, np.array([-1, 0]), np.full((3, 2), np.nan))
    states[0, 0] = 1.0
    assert len(tree) == 2 and tree.states[0, 0] == 0.0 and tree.parents.dtype == np.int64
    for array in (tree.states, tree.parents, tree.polyline):
        assert not array.flags.writeable
    assert len(Tree(np.empty((0, 5)), np.empty(0, dtype=np.int64), np.empty((0, 2)))) == 0


@pytest.mark.parametrize(
    ("states", "parents", "polyline", "message"),
    [
        (np.zeros((2, 3)), [-1, 0], np.zeros((1, 2)), r"tree.states: got 'shape \(2, 3\)'"),
        (np.zeros((2, 5)), [-1], np.zeros((1, 2)), r"tree.parents: got 'shape \(1,\)'"),
        (np.zeros((2, 5)), [-1, 0], np.zeros((1, 3)), r"tree.polyline: got 'shape \(1, 3\)'"),
        (np.zeros((2, 5)), [-1, 2], np.zeros((1, 2)), r"tree.parents: got .*, expected -1 to 1"),
        (np.zeros((2, 5)), [-2, 0], np.zeros((1, 2)), r"tree.parents: got .*, expected -1 to 1"),
        (np.zeros((2, 5)), [-1.0, 0.5], np.zeros((1, 2)), r"tree.parents: got 'float64', expected whole numbers"),
    ],
)
def test_arrays_that_are_no_tree_are_refused_by_name(
    states: NDArray[np.float64], parents: list[int], polyline: NDArray[np.float64], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        Tree(states, np.array(parents), polyline)


velocities = st.tuples(st.floats(-1.0, 2.0), st.floats(-2.0, 2.0))
braking_limits = st.builds(
    lambda a, alpha: Limits(-1.0, 2.0, -2.0, 2.0, acceleration=a, angular_acceleration=alpha),
    st.floats(0.1, 5.0),
    st.floats(0.1, 10.0),
)


@given(velocities, braking_limits, st.floats(0.01, 0.2))
def test_braking_is_as_hard_as_the_limits_allow_and_ends_at_rest(
    velocity: tuple[float, float], limits: Limits, step: float
) -> None:
    row = [np.array([value]) for value in (3.0, 1.0, -2.0, 0.5, *velocity, *velocity)]
    stop = Trajectory(*row).stopping_at(3.0, limits, step)
    np.testing.assert_array_equal(stop.states[-1, 3:], 0.0)
    np.testing.assert_allclose(np.diff(stop.t), step)
    for speed, rate in ((np.abs(stop.v), limits.acceleration), (np.abs(stop.omega), limits.angular_acceleration)):
        np.testing.assert_allclose(speed, np.maximum(speed[0] - rate * step * np.arange(len(stop)), 0.0), atol=1e-9)
    if len(stop) > 1:
        np.testing.assert_array_equal([stop.v_command, stop.omega_command], 0.0)
        slowest = max(abs(velocity[0]) / limits.acceleration, abs(velocity[1]) / limits.angular_acceleration)
        assert stop.duration < slowest + step * (1.0 + 1e-9)


@given(velocities, braking_limits)
def test_braking_moves_as_its_velocities_say(velocity: tuple[float, float], limits: Limits) -> None:
    row = [np.array([value]) for value in (0.0, 1.0, -2.0, 0.5, *velocity, *velocity)]
    stop = Trajectory(*row).stopping_at(0.0, limits, 0.05)
    moved = displacement(stop.theta[:-1], stop.v[:-1], stop.v[1:], stop.omega[:-1], stop.omega[1:], np.diff(stop.t))
    np.testing.assert_allclose(np.diff(stop.x), moved[:, 0], atol=1e-6)
    np.testing.assert_allclose(np.diff(stop.y), moved[:, 1], atol=1e-6)
    np.testing.assert_allclose(wrapped(np.diff(stop.theta) - moved[:, 2]), 0.0, atol=1e-12)


@given(velocities)
def test_braking_obeys_the_limits_of_the_wheels(velocity: tuple[float, float]) -> None:
    limits = Limits(
        -1.0, 2.0, -2.0, 2.0, 1.0, 3.0, wheel_separation=0.4, wheel_speed=3.0, wheel_acceleration=0.8
    )  # fmt: skip
    row = [np.array([value]) for value in (0.0, 1.0, -2.0, 0.5, *velocity, *velocity)]
    stop = Trajectory(*row).stopping_at(0.0, limits, 0.05)
    np.testing.assert_array_equal(stop.states[-1, 3:], 0.0)
    for side in (-0.2, 0.2):
        assert (np.abs(np.diff(stop.v + side * stop.omega)) <= 0.8 * 0.05 + 1e-9).all()


def test_a_plan_is_driven_up_to_the_row_where_braking_begins(scenarios: Path) -> None:
    scenario = load_scenario(scenarios / "paper_case1.yaml")
    found = plan(scenario, "cb-rrt-compiled", seed=1).trajectory
    assert found is not None
    assert found.limits == scenario.robot.limits
    for t in (0.0, 2.0, 2.01, found.t[-1]):
        row = int(np.searchsorted(found.t, t))
        stop = found.stopping_at(t)
        for name in ("t", "x", "y", "theta", "v", "omega"):
            np.testing.assert_array_equal(getattr(stop, name)[: row + 1], getattr(found, name)[: row + 1])
        np.testing.assert_array_equal(stop.v_command[:row], found.v_command[:row])
        np.testing.assert_array_equal(stop.states[-1, 3:], 0.0)
        assert {violation.kind for violation in verify(stop, scenario).violations} <= {"goal", "collision"}


def test_a_trajectory_at_rest_is_not_braked() -> None:
    stop = profile([0.0, 1.0, 2.0], [1.0, 0.5, 0.0], [0.0, 0.0, 0.0]).stopping_at(2.0)
    assert stop == profile([0.0, 1.0, 2.0], [1.0, 0.5, 0.0], [0.0, 0.0, 0.0]).stopping_at(1.5)
    assert (len(stop), stop.v_command.tolist()) == (3, [1.0, 0.5, 0.5])


def test_a_kinematic_trajectory_stops_at_once() -> None:
    stop = arc(kinematic=True).stopping_at(0.5)
    assert (len(stop), stop.kinematic, stop.t[-1]) == (7, True, pytest.approx(0.6))
    np.testing.assert_array_equal(stop.states[-1], [*stop.poses[-2], 0.0, 0.0])
    np.testing.assert_array_equal(stop.step_velocities[:, -1], 0.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"t": -0.1}, r"t: got -0\.1, expected a time from 0 to 2 s"),
        ({"t": math.nan}, "t: got nan"),
        ({"t": 1.0, "limits": None}, "limits: missing, expected the limits of the robot"),
        ({"t": 1.0, "limits": Limits(acceleration=-1.0)}, "limits.acceleration: got -1.0"),
        ({"t": 1.0, "step": 0.0}, r"step: got 0\.0, expected an integration step above 0"),
        ({"t": 1.0, "step": 1e-9}, "step: got 1e-09, expected a step in which 100000 of them bring the robot to rest"),
    ],
)
def test_braking_that_makes_no_sense_is_refused(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(TrajectoryError, match=f"^{message}"):
        arc().stopping_at(**{"limits": Limits(), **arguments})


def test_a_single_row_is_braked_with_a_step_alone() -> None:
    row = Trajectory(*(np.array([value]) for value in (0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0)))
    with pytest.raises(TrajectoryError, match="^step: missing, expected an integration step"):
        row.stopping_at(0.0, Limits())
    assert row.stopping_at(0.0, Limits(), 0.1).duration == pytest.approx(1.7)


def test_limits_are_no_part_of_equality_nor_of_files(tmp_path: Path) -> None:
    limited = replace(arc(), limits=Limits())
    assert limited == arc()
    for suffix in SUFFIXES:
        limited.save(tmp_path / f"a{suffix}")
        arc().save(tmp_path / f"b{suffix}")
        assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()
        assert Trajectory.load(tmp_path / f"a{suffix}").limits is None
