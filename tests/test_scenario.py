"""Scenario files: what they mean, what is wrong with them in one line each, and that nothing is lost in saving."""

from __future__ import annotations

import dataclasses
import math
import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import InputError, Problem, ScenarioError
from cbrrt_ompl.problem.obstacles import Bounds, Box, Disc, Obstacle, OrientedBox, Polygon
from cbrrt_ompl.problem.robot import Footprint, Gains, Limits, Robot
from cbrrt_ompl.problem.settings import FilledSettings, Goal, PlanningSettings, State
from cbrrt_ompl.scenario import plain_yaml
from cbrrt_ompl.scenario.plain_yaml import MAX_DEPTH, MAX_FILE_SIZE, parse_yaml, resolve
from cbrrt_ompl.scenario.scenario import (
    MapSource,
    Scenario,
    load_scenario,
    save_scenario,
    scenario_from_dict,
    scenario_to_dict,
)

EXAMPLE = """\
name: two-gaps
bounds: {min: [-5, -5], max: [5, 5]}
obstacles:
  - {type: box, min: [-5, -0.1], max: [-2.1, 0.1]}
  - {type: disc, center: [1.0, 2.0], radius: 0.3}
  - {type: polygon, vertices: [[0, 1], [1, 1], [0.5, 2]]}
robot:
  footprint: {type: disc, radius: 0.25}
  limits: {v: [0.0, 1.0], omega_deg: [-30, 30], acceleration: 0.6, angular_acceleration_deg: 30}
  gains: {k_x: 1.5, k_y: 0.5, k_theta: 0.1}
start: {x: -4, y: -4, theta: 0}
goal: {x: 4, y: 4, tolerance: 0.5}
planning: {horizon: 2.0, step: 0.05, goal_bias: 0.0, max_samples: 50000, cut_extension: discard,
           equal_control_tolerance: 0.1, look_ahead: 2.0}
"""
SMALLEST = """\
name: empty hall
bounds: {min: [0, 0], max: [4, 3]}
start: {x: 1, y: 1}
goal: {x: 3, y: 2}
"""


def load_text(folder: Path, text: str | bytes) -> Scenario:
    path = folder / "scene.yaml"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return load_scenario(path)


def complaints(folder: Path, text: str | bytes) -> list[str]:
    """What loading a text complains about, without the name of the file."""
    with pytest.raises(ScenarioError) as caught:
        load_text(folder, text)
    source = f"{folder / 'scene.yaml'}: "
    lines = str(caught.value).split("\n")
    assert len(lines) == len(caught.value.problems)
    assert all(line.startswith(source) for line in lines)
    return [line.removeprefix(source) for line in lines]


def changed(old: str, new: str, text: str = EXAMPLE) -> str:
    assert text.count(old) == 1
    return text.replace(old, new)


def hall(**parts: Any) -> Scenario:
    """An empty hall of 4 m x 3 m with some parts exchanged."""
    world = World(Bounds((0.0, 0.0), (4.0, 3.0)))
    return Scenario(**{"name": "hall", "world": world, "start": State(1.0, 1.0), "goal": Goal(3.0, 2.0), **parts})


# What a file means


def test_every_key_of_the_format_is_read(tmp_path: Path) -> None:
    scenario = load_text(tmp_path, changed("look_ahead: 2.0", "look_ahead: 1.5, closed_loop: true"))
    assert scenario.name == "two-gaps"
    assert scenario.world.bounds == Bounds((-5.0, -5.0), (5.0, 5.0))
    assert scenario.world.obstacles == (
        Box((-5.0, -0.1), (-2.1, 0.1)),
        Disc((1.0, 2.0), 0.3),
        Polygon(np.array([[0.0, 1.0], [1.0, 1.0], [0.5, 2.0]])),
    )
    turn = math.radians(30)
    assert scenario.robot == Robot(Footprint.disc(0.25), Limits(0.0, 1.0, -turn, turn, 0.6, turn), Gains(1.5, 0.5, 0.1))
    assert scenario.start == State(-4.0, -4.0, 0.0, 0.0, 0.0)
    assert scenario.goal == Goal(4.0, 4.0, 0.5)
    assert scenario.planning == PlanningSettings(2.0, 0.05, 0.0, 50_000, "discard", 0.1, 1.5, True)
    assert scenario.map is None


def test_what_is_left_out_takes_the_defaults_of_the_paper(tmp_path: Path) -> None:
    scenario = load_text(tmp_path, SMALLEST)
    assert scenario.robot == Robot()
    assert scenario.planning == PlanningSettings()
    assert scenario.start == State(1.0, 1.0)
    assert scenario.goal == Goal(3.0, 2.0)
    assert scenario.world.obstacles == ()


def test_parts_of_a_section_may_be_left_out(tmp_path: Path) -> None:
    scenario = load_text(tmp_path, SMALLEST + "robot: {limits: {v: [-0.5, 0.8]}}\nplanning: {horizon: 1.0}\n")
    assert scenario.robot == Robot(limits=Limits(v_min=-0.5, v_max=0.8))
    assert scenario.planning == PlanningSettings(horizon=1.0)


def test_every_angle_may_be_given_in_degrees(tmp_path: Path) -> None:
    text = """\
name: degrees
bounds: {min: [0, 0], max: [4, 3]}
robot: {limits: {omega_deg: [-90, 45], angular_acceleration_deg: 180}}
start: {x: 1, y: 1, theta_deg: -60, omega_deg: 10}
goal: {x: 3, y: 2, theta_deg: 90, heading_tolerance_deg: 5, speed_tolerance: 0.2}
"""
    scenario = load_text(tmp_path, text)
    limits = scenario.robot.limits
    assert (limits.omega_min, limits.omega_max) == (math.radians(-90), math.radians(45))
    assert limits.angular_acceleration == math.radians(180)
    assert (scenario.start.theta, scenario.start.omega) == (math.radians(-60), math.radians(10))
    assert scenario.goal == Goal(3.0, 2.0, 0.5, math.radians(90), math.radians(5), 0.2)
    assert load_text(tmp_path, text.replace("_deg: 90", f": {math.radians(90)!r}")) == scenario


def test_a_polygon_may_have_holes(tmp_path: Path) -> None:
    ring = "[[1.5, 1], [2.5, 1], [2, 2]]"
    line = f"  - {{type: polygon, vertices: [[0.5, 0.5], [3.5, 0.5], [3.5, 2.5], [0.5, 2.5]], holes: [{ring}]}}\n"
    text = SMALLEST.replace("x: 1, y: 1", "x: 2, y: 1.2").replace("x: 3, y: 2", "x: 2, y: 1.7")
    scenario = load_text(tmp_path, text + "obstacles:\n" + line)
    (obstacle,) = scenario.world.obstacles
    assert isinstance(obstacle, Polygon)
    assert obstacle.holes[0].tolist() == [[1.5, 1.0], [2.5, 1.0], [2.0, 2.0]]


def test_a_box_may_stand_at_an_angle(tmp_path: Path) -> None:
    line = "obstacles: [{type: oriented_box, center: [2, 2.5], size: [0.4, 0.2], angle_deg: 30}]\n"
    scenario = load_text(tmp_path, SMALLEST + line)
    assert scenario.world.obstacles == (OrientedBox((2.0, 2.5), (0.4, 0.2), math.radians(30)),)


def test_a_robot_may_have_corners(tmp_path: Path) -> None:
    text = SMALLEST + "robot: {footprint: {type: polygon, vertices: [[-0.2, -0.1], [0.2, -0.1], [0.2, 0.1]]}}\n"
    assert load_text(tmp_path, text).robot.footprint == Footprint.polygon([[-0.2, -0.1], [0.2, -0.1], [0.2, 0.1]])


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("1e-3", 1e-3),
        ("+.5E+0", 0.5),
        ("2", 2.0),
        ("0010", 10.0),
        ("1.", 1.0),
        ("-.inf", -math.inf),
        ("1" * 30, float("1" * 30)),
    ],
)
def test_numbers_are_those_of_yaml_1_2(written: str, value: float) -> None:
    assert resolve(written) == pytest.approx(value)
    assert not isinstance(resolve(written), (str, bool))


@pytest.mark.parametrize(
    "written", ["1:30", "0x10", "1_000", "no", "on", "2024-01-01", "e5", ".", "-", "inf", "nan", "<<"]
)
def test_what_is_a_number_or_a_truth_value_in_yaml_1_1_alone_stays_a_text(written: str) -> None:
    assert resolve(written) == written


@pytest.mark.parametrize(
    ("written", "value"), [("true", True), ("False", False), ("~", None), ("", None), ("null", None)]
)
def test_words_of_yaml_are_values(written: str, value: object) -> None:
    assert resolve(written) is value


def test_a_number_with_an_exponent_and_no_point_is_a_number(tmp_path: Path) -> None:
    """PyYAML reads 1e-3 as a text."""
    assert load_text(tmp_path, changed("radius: 0.3", "radius: 3e-1")).world.obstacles[1] == Disc((1.0, 2.0), 0.3)
    assert load_text(tmp_path, changed("50000", "5e4")).planning.max_samples == 50_000


def test_a_byte_order_mark_and_windows_line_ends_do_not_matter(tmp_path: Path) -> None:
    plain = load_text(tmp_path, EXAMPLE)
    assert load_text(tmp_path, b"\xef\xbb\xbf" + EXAMPLE.replace("\n", "\r\n").encode()) == plain


# What is wrong with a file

# Each mistake: what is replaced in the example, by what, and the complaint.
MISTAKES = {
    "unknown key with a near name": (
        "horizon: 2.0",
        "horizn: 2.0",
        "planning.horizn: got an unknown key, expected horizon",
    ),
    "unknown key with no near name": (
        "k_x: 1.5",
        "zz: 1",
        "robot.gains.zz: got an unknown key, expected one of k_x, k_y, k_theta",
    ),
    "key of another section": (
        "goal_bias: 0.0",
        "k_x: 1.5",
        "planning.k_x: got an unknown key, expected it under robot.gains",
    ),
    "key of the top level": (
        "robot:\n",
        "robot:\n  start: 1\n",
        "robot.start: got an unknown key, expected it under the top level",
    ),
    "key of another obstacle": (
        "max: [-2.1, 0.1]",
        "max: [-2.1, 0.1], radius: 1",
        "obstacles[0].radius: got an unknown key, expected one of type, min, max",
    ),
    "degrees of what is no angle": (
        "k_y: 0.5",
        "k_y_deg: 0.5",
        "robot.gains.k_y_deg: got an unknown key, expected k_y",
    ),
    "key twice": ("x: 4, ", "x: 4, x: 3, ", "goal.x: got 3, expected this key only once"),
    "radians and degrees": (
        "theta: 0}",
        "theta: 0, theta_deg: 0}",
        "start.theta_deg: got 0, expected either theta or theta_deg",
    ),
    "missing name": ("name: two-gaps\n", "", "name: missing, expected one line of text"),
    "missing start": (
        "start: {x: -4, y: -4, theta: 0}\n",
        "",
        "start: missing, expected the state to start in, {x: 0.0, y: 0.0, theta: 0.0} [m, m, rad]",
    ),
    "missing bounds": (
        "bounds: {min: [-5, -5], max: [5, 5]}\n",
        "",
        "bounds: missing, expected the corners {min: [x, y], max: [x, y]} [m], or a map",
    ),
    "missing coordinate": ("x: 4, ", "", "goal.x: missing, expected a number [m]"),
    "missing radius": (
        ", radius: 0.3",
        "",
        "obstacles[1].radius: missing, expected a radius above 0 [m]",
    ),
    "missing type": (
        "type: disc, center",
        "center",
        "obstacles[1].type: missing, expected one of box, oriented_box, disc, polygon",
    ),
    "unknown type": (
        "type: disc, center",
        "type: ball, center",
        "obstacles[1].type: got 'ball', expected one of box, oriented_box, disc, polygon",
    ),
    "type of another kind": (
        "type: disc, center",
        "type: [a], center",
        "obstacles[1].type: got ['a'], expected one of box, oriented_box, disc, polygon",
    ),
    "footprint type": (
        "type: disc, radius: 0.25",
        "type: box, radius: 0.25",
        "robot.footprint.type: got 'box', expected one of disc, polygon",
    ),
    "truth value as number": ("radius: 0.3", "radius: true", "obstacles[1].radius: got True, expected a finite number"),
    "quoted number": ("radius: 0.3", "radius: '0.3'", "obstacles[1].radius: got '0.3', expected a finite number"),
    "text as number": ("x: 4, ", "x: here, ", "goal.x: got 'here', expected a finite number"),
    "not a number": ("x: 4, ", "x: .nan, ", "goal.x: got nan, expected a finite number"),
    "infinite": ("x: -4, ", "x: -.inf, ", "start.x: got -inf, expected a finite number"),
    "number beyond floats": (
        "x: 4, ",
        "x: 1" + 5000 * "0" + ", ",
        "goal.x: got inf, expected a finite number",
    ),
    "number as text": ("two-gaps", "3", "name: got 3, expected one line of text"),
    "name on two lines": ("two-gaps", '"a\\nb"', "name: got 'a\\nb', expected one line of text"),
    "number as truth value": (
        "look_ahead: 2.0",
        "closed_loop: 1",
        "planning.closed_loop: got 1, expected true or false",
    ),
    "half a sample": ("50000", "0.5", "planning.max_samples: got 0.5, expected a whole number"),
    "choice": ("discard", "drop", "planning.cut_extension: got 'drop', expected one of discard, keep"),
    "number instead of range": (
        "v: [0.0, 1.0]",
        "v: 1.0",
        "robot.limits.v: got 1.0, expected a range [low, high] of finite numbers",
    ),
    "three coordinates": (
        "[-2.1, 0.1]",
        "[-2.1, 0.1, 0]",
        "obstacles[0].max: got [-2.1, 0.1, 0], expected a point [x, y] of finite numbers [m]",
    ),
    "list instead of section": (
        "{x: 4, y: 4, tolerance: 0.5}",
        "[4, 4]",
        (
            "goal: got [4, 4], "
            "expected a mapping with the keys x, y, tolerance, theta, heading_tolerance, speed_tolerance"
        ),
    ),
    "section left empty": (
        "{x: 4, y: 4, tolerance: 0.5}",
        "",
        (
            "goal: got nothing, "
            "expected a mapping with the keys x, y, tolerance, theta, heading_tolerance, speed_tolerance"
        ),
    ),
    "obstacle that is a text": (
        "obstacles:\n",
        "obstacles:\n  - wall\n",
        "obstacles[0]: got 'wall', expected a mapping with a type: box, oriented_box, disc, polygon",
    ),
    "corner that is a number": (
        "[1, 1], ",
        "1, ",
        "obstacles[2].vertices[1]: got 1, expected a point [x, y] of finite numbers [m]",
    ),
    "box upside down": (
        "[-2.1, 0.1]",
        "[-2.1, -0.2]",
        "obstacles[0]: got [[-5.0, -0.1], [-2.1, -0.2]], expected min below max in x and in y",
    ),
    "disc without area": (
        "radius: 0.3",
        "radius: 0",
        "obstacles[1].radius: got 0.0, expected a radius above 0, 1e-09 at least [m]",
    ),
    "bounds upside down": (
        "max: [5, 5]",
        "max: [-6, 5]",
        "bounds: got [[-5.0, -5.0], [-6.0, 5.0]], expected min below max in x and in y",
    ),
    "negative footprint": (
        "radius: 0.25",
        "radius: -0.25",
        "robot.footprint.radius: got -0.25, expected a radius of 0 or more [m]",
    ),
    "negative limit": (
        "acceleration: 0.6",
        "acceleration: -0.6",
        "robot.limits.acceleration: got -0.6, expected a number above 0, from 1e-09 to 1e+06",
    ),
    "limit in degrees": (
        "[-30, 30]",
        "[5, 30]",
        "robot.limits.omega_deg: got [5, 30], expected a range [low, high] with low <= 0 < high, high at least 1e-09",
    ),
    "negative gain": (
        "k_y: 0.5",
        "k_y: -0.5",
        "robot.gains.k_y: got -0.5, expected a finite number, 0 or more and at most 1e+06",
    ),
    "negative tolerance": (
        "tolerance: 0.5",
        "tolerance: -0.5",
        "goal.tolerance: got -0.5, expected a number above 0, at most 1e+06",
    ),
    "heading tolerance without heading": (
        "tolerance: 0.5",
        "heading_tolerance_deg: 5",
        "goal.theta: missing, expected the heading that goal.heading_tolerance is about [rad]",
    ),
    "zero step": (
        "step: 0.05",
        "step: 0",
        "planning.step: got 0.0, expected a number above 0, from 1e-09 to 1e+06 [s]",
    ),
    "goal bias": ("goal_bias: 0.0", "goal_bias: 1.5", "planning.goal_bias: got 1.5, expected a number from 0 to 1"),
    "horizon of 6.67 steps": (
        "step: 0.05",
        "step: 0.3",
        "planning.horizon: got 2.0, expected a multiple of planning.step (0.3 s)",
    ),
    "start outside": (
        "x: -4, y: -4",
        "x: -4, y: 5",
        "start: got [-4.0, 5.0], expected a position inside the bounds (-5.0, -5.0), (5.0, 5.0)",
    ),
    "start in an obstacle": (
        "x: -4, y: -4",
        "x: -4, y: 0",
        "start: got [-4.0, 0.0, 0.0], expected a pose where the footprint touches no obstacle and no bound",
    ),
    "start too near to a wall": (
        "x: -4, y: -4",
        "x: -4.75, y: -4",
        "start: got [-4.75, -4.0, 0.0], expected a pose where the footprint touches no obstacle and no bound",
    ),
    "start too fast": ("theta: 0}", "v: 1.5}", "start.v: got 1.5, expected 0 to 1 m/s, robot.limits.v"),
    "start turning too fast": (
        "theta: 0}",
        "omega_deg: 40}",
        "start.omega_deg: got 40, expected -0.523599 to 0.523599 rad/s, robot.limits.omega",
    ),
    "goal outside": (
        "x: 4, y: 4",
        "x: 4, y: 6",
        "goal: got [4.0, 6.0], expected a position inside the bounds (-5.0, -5.0), (5.0, 5.0)",
    ),
    "goal in a wall": (
        "x: 4, y: 4, tolerance: 0.5",
        "x: -4, y: 0, tolerance: 0.3",
        "goal: got [-4.0, 0.0], expected a region with room for the robot: all of it is in collision",
    ),
    "map that is a number": (
        "obstacles:\n",
        "map: 3\nobstacles:\n",
        "map: got 3, expected a mapping with the keys file, unknown, resolution, keepout",
    ),
    "unknown cells": (
        "obstacles:\n",
        "map: {file: a.yaml, unknown: empty}\nobstacles:\n",
        "map.unknown: got 'empty', expected one of occupied, free",
    ),
}


@pytest.mark.parametrize(("old", "new", "complaint"), MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_is_one_line_that_names_it(tmp_path: Path, old: str, new: str, complaint: str) -> None:
    (line,) = complaints(tmp_path, changed(old, new))
    if complaint.endswith(("and no bound", "in collision")):
        assert line.startswith(complaint)  # and then comes what is there
    else:
        assert line == complaint


def test_a_polygon_that_crosses_itself_is_named_with_the_reason(tmp_path: Path) -> None:
    (line,) = complaints(tmp_path, changed("[0.5, 2]]", "[0.5, 2], [0.1, 0]]"))
    assert line.startswith("obstacles[2].vertices: got [")
    assert "expected a simple polygon with an area (" in line


UNREADABLE: dict[str, tuple[str | bytes, str]] = {
    "empty": ("", "got nothing, expected a mapping with the keys name, "),
    "only a comment": ("# nothing\n", "got nothing, expected a mapping with the keys name, "),
    "a list": ("- 1\n- 2\n", "got [1, 2], expected a mapping with the keys name, "),
    "a number": ("3", "got 3, expected a mapping with the keys name, "),
    "syntax": ("name: a\nbounds: b: c\n", "line 2, column 10: got 'bounds: b: c', expected valid YAML ("),
    "open bracket": ("name: [a", "line 2, column 1: got 'name: [a', expected valid YAML ("),
    "tab": ("name: a\n\tstart: 1\n", "line 2, column 1: got 'start: 1', expected valid YAML ("),
    "control character": ("name: a\nx: \x01", "line 2, column 4: got '\\x01', expected printable characters"),
    "Latin-1": (b"name: M\xfcnchen", "byte 7: got b'\\xfc', expected text in UTF-8"),
    "two documents": ("--- 1\n--- 2\n", "got a second document, expected a single one: no line ---"),
    "tag": ("name: !!python/object:os.system x", "name: got the tag tag:yaml.org,2002:python/object:os.system, "),
    "alias": ("start: &a {x: 1}\ngoal: *a\n", "goal: got the alias *a, expected the value itself"),
    "alias of itself": ("&a [*a]", "[0]: got the alias *a, expected the value itself"),
    "key that is a list": ("? [1]\n: 2\n", "got a key that is no name, expected names as keys"),
    "deep nesting": ("[" * 100_000, f"{'[0]' * MAX_DEPTH}: got deeper nesting, expected at most {MAX_DEPTH} levels"),
    "deep mappings": ("{a: " * 100_000, f"{'.'.join('a' * MAX_DEPTH)}: got deeper nesting, expected at most "),
}


@pytest.mark.parametrize(("text", "start"), UNREADABLE.values(), ids=UNREADABLE)
def test_what_is_no_scenario_file_is_one_line(tmp_path: Path, text: str | bytes, start: str) -> None:
    (found,) = complaints(tmp_path, text)
    if "column" in start:  # PyYAML with libyaml and without it count the place of an error differently
        assert found.split(", expected ")[1][:10] == start.split(", expected ")[1][:10]
    else:
        assert found.startswith(start)


class _StrictLoader(yaml.SafeLoader):
    """A PyYAML to come that gives up just behind our own limit, while it reads ahead."""

    def fetch_flow_collection_start(self, token: Any) -> None:
        if self.flow_level > MAX_DEPTH:
            raise yaml.scanner.ScannerError("in a list", self.get_mark(), "words of a library", self.get_mark())
        super().fetch_flow_collection_start(token)


class _SilentLoader(yaml.SafeLoader):
    """A PyYAML to come whose errors tell no place."""

    def fetch_flow_collection_start(self, token: Any) -> None:
        raise yaml.YAMLError("words\nof a library")


@pytest.mark.parametrize("loader", [getattr(yaml, "CSafeLoader", yaml.SafeLoader), yaml.SafeLoader, _StrictLoader])
@pytest.mark.parametrize(
    ("start", "path"),
    [
        ("", "[0]" * MAX_DEPTH),
        ("a: 1\nb: ", "b" + "[0]" * (MAX_DEPTH - 1)),
        ("a: [1, [2], '[[''[[', \"[[\\\"[[\", it's, ", "a[5]" + "[0]" * (MAX_DEPTH - 2)),
    ],
)
def test_our_limit_of_nesting_answers_before_one_of_pyyaml(
    monkeypatch: pytest.MonkeyPatch, loader: type, start: str, path: str
) -> None:
    """PyYAML 6.0.4 gave up at 1,000 open brackets in a line before it had reported the first of them."""
    monkeypatch.setattr(plain_yaml, "_LOADER", loader)
    with pytest.raises(InputError) as caught:
        parse_yaml(start + "[" * 5000, [])
    assert str(caught.value) == f"{path}: got deeper nesting, expected at most {MAX_DEPTH} levels"


def test_an_error_of_pyyaml_without_a_place_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plain_yaml, "_LOADER", _SilentLoader)
    with pytest.raises(InputError) as caught:
        parse_yaml("a: [1]", [])
    assert str(caught.value) == "got 'a: [1]', expected valid YAML (words of a library)"


def test_a_billion_laughs_are_refused(tmp_path: Path) -> None:
    levels = [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 10)]
    assert complaints(tmp_path, "a0: &a0 lol\n" + "\n".join(levels)) == [
        "a1[0]: got the alias *a0, expected the value itself"
    ]


def test_nesting_up_to_the_limit_is_read() -> None:
    problems: list[Problem] = []
    assert parse_yaml("[" * MAX_DEPTH + "]" * MAX_DEPTH, problems) is not None
    with pytest.raises(InputError, match="deeper nesting"):
        parse_yaml("[" * (MAX_DEPTH + 1) + "]" * (MAX_DEPTH + 1), problems)


def test_a_file_that_is_too_large_is_not_parsed(tmp_path: Path) -> None:
    assert complaints(tmp_path, b"#" * (MAX_FILE_SIZE + 1)) == [
        f"got a larger file, expected at most {MAX_FILE_SIZE} bytes"
    ]


def test_a_missing_file_and_a_folder_are_one_line(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "none.yaml", str(tmp_path / "no\0ne.yaml")):
        with pytest.raises(ScenarioError, match="^(no such file: |cannot read ).*none.yaml|^cannot read .*: "):
            load_scenario(path)


def test_all_mistakes_of_a_file_are_reported_together(tmp_path: Path) -> None:
    text = EXAMPLE
    for old, new in [
        ("max: [-2.1, 0.1]", "max: [-6, 0.1]"),
        ("radius: 0.3", "radius: -1"),
        ("k_y: 0.5", "k_y: true"),
        ("x: -4, y: -4", "x: -9, y: -4"),
        ("x: 4, y: 4", "x: 4, y: 9"),
        ("horizon: 2.0", "horizon: 2.0, horizont: 3"),
    ]:
        text = changed(old, new, text)
    assert [line.partition(": ")[0] for line in complaints(tmp_path, text)] == [
        "obstacles[0]",
        "obstacles[1].radius",
        "robot.gains.k_y",
        "planning.horizont",
        "start",
        "goal",
    ]


def test_a_key_with_line_breaks_stays_on_one_line(tmp_path: Path) -> None:
    (line,) = complaints(tmp_path, SMALLEST + '"a\\nb": 1\n')
    assert line.startswith("'a\\nb': got an unknown key")


@pytest.mark.parametrize("seed", range(60))
def test_a_file_with_bytes_exchanged_never_raises_anything_else(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    content = bytearray(EXAMPLE.encode())
    for place in rng.integers(len(content), size=rng.integers(1, 6)):
        content[place] = rng.choice(np.frombuffer(b"-:,.[]{}#&*!|>'\"%@` \n\t0exa~\x00\xff", dtype=np.uint8))
    try:
        scenario = load_text(tmp_path, bytes(content))
    except ScenarioError as error:
        assert error.problems
    else:
        assert scenario.goal.tolerance > 0.0


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
    max_leaves=8,
)


@given(st.sampled_from(["name", "bounds", "obstacles", "robot", "start", "goal", "planning"]), json_values)
def test_any_value_in_the_place_of_a_section_is_read_or_reported(key: str, value: object) -> None:
    data = {**yaml.safe_load(EXAMPLE), key: value}
    try:
        scenario = scenario_from_dict(data)
    except ScenarioError as error:
        assert all(problem.field.startswith(key) for problem in error.problems)
    else:
        assert scenario_from_dict(scenario_to_dict(scenario)) == scenario


# A scenario made in Python


def test_a_scenario_made_in_python_is_checked_as_one_from_a_file() -> None:
    with pytest.raises(ScenarioError) as caught:
        hall(name="", start=State(9.0, 1.0, v=-1.0), goal=Goal(3.0, 9.0), planning=PlanningSettings(1.0, 0.3))
    assert [p.field for p in caught.value.problems] == ["name", "start.v", "start", "goal", "planning.horizon"]


def test_a_start_that_is_no_number_is_refused() -> None:
    with pytest.raises(ScenarioError) as caught:
        hall(start=State(1.0, math.nan, math.inf))
    assert [p.field for p in caught.value.problems] == ["start.y", "start.theta"]


def test_a_start_is_judged_with_its_heading() -> None:
    long_nose = Robot(Footprint.polygon([(-0.1, -0.1), (0.9, -0.1), (0.9, 0.1), (-0.1, 0.1)]))
    assert hall(robot=long_nose, start=State(0.5, 1.0, 0.0)).start.x == 0.5
    with pytest.raises(ScenarioError, match="touches no obstacle and no bound"):
        hall(robot=long_nose, start=State(0.5, 1.0, math.pi))


def test_a_goal_in_a_corner_is_refused_only_where_no_part_of_it_is_free() -> None:
    robot = Robot(Footprint.disc(0.3))
    assert hall(robot=robot, goal=Goal(3.9, 2.0, tolerance=0.3)).goal.x == 3.9
    with pytest.raises(ScenarioError, match="room for the robot"):
        hall(robot=robot, goal=Goal(3.9, 2.0, tolerance=0.1))


def test_a_horizon_may_miss_whole_steps_by_rounding() -> None:
    assert hall(planning=PlanningSettings(1.0, 0.333)).planning.steps == 3
    assert hall(planning=PlanningSettings(0.3, 0.1)).planning.steps == 3


def test_plain_values_are_read_like_a_file() -> None:
    scenario = scenario_from_dict(yaml.safe_load(EXAMPLE))
    assert scenario.world.obstacles[1] == Disc((1.0, 2.0), 0.3)
    with pytest.raises(ScenarioError, match=r"^my call: goal\.x: got nothing, expected a finite number$"):
        scenario_from_dict({**yaml.safe_load(EXAMPLE), "goal": {"x": None, "y": 1}}, source="my call")


def test_plain_values_that_are_no_mapping_are_refused() -> None:
    with pytest.raises(ScenarioError, match="^scenario: got 3, expected a mapping"):
        scenario_from_dict(3)  # type: ignore[arg-type]


def test_numbers_beyond_floats_are_refused_from_python_too() -> None:
    with pytest.raises(ScenarioError, match="goal.x: got 1000"):
        scenario_from_dict({**yaml.safe_load(EXAMPLE), "goal": {"x": 10**400, "y": 1}})


def test_scenarios_are_equal_where_all_their_parts_are() -> None:
    assert hall() == hall()
    assert hash(hall()) == hash(hall())
    assert hall() != hall(name="other")
    assert hall() != hall(world=World(Bounds((0.0, 0.0), (4.0, 3.0)), [Disc((2.0, 2.0), 0.1)]))
    assert hall() != 0


# Saving

numbers = st.floats(-1.5, 1.5, allow_nan=False)
sizes = st.floats(0.05, 1.0)


@st.composite
def obstacles(draw: st.DrawFn) -> Obstacle:
    x, y, a, b = 5.0 + draw(numbers), 5.0 + draw(numbers), draw(sizes), draw(sizes)
    square = np.array([(x, y), (x + a, y), (x + a, y + b), (x, y + b)])
    hole = square.mean(axis=0) + 0.3 * (square - square.mean(axis=0))
    kinds: list[Obstacle] = [
        Box((x, y), (x + a, y + b)),
        OrientedBox((x, y), (a, b), 10.0 * draw(numbers)),
        Disc((x, y), a),
        Polygon(square[::-1]),
        Polygon(square, (hole,)),
    ]
    return draw(st.sampled_from(kinds))


@st.composite
def scenarios_of_any_kind(draw: st.DrawFn) -> Scenario:
    a, b = draw(sizes), draw(sizes)
    wheels = draw(st.sampled_from([(), (a,), (a, 1.0 + a + b), (b, math.inf, a), (b, 1.0 + a + b, b)]))
    limits = Limits(-draw(sizes), 0.5 + a, -draw(sizes), 0.5 + b, draw(sizes), draw(sizes), *wheels)
    footprint = draw(
        st.sampled_from(
            [Footprint.point(), Footprint.disc(a / 3), Footprint.polygon([(-a, -b / 3), (a / 2, 0.0), (-a, b / 3)])]
        )
    )
    step = draw(sizes) / 10
    planning = PlanningSettings(
        horizon=step * draw(st.integers(1, 200)),
        step=step,
        goal_bias=draw(st.floats(0, 1)),
        max_samples=draw(st.integers(1, 10**9)),
        cut_extension=draw(st.sampled_from(["discard", "keep"])),
        equal_control_tolerance=draw(numbers),
        look_ahead=draw(st.none() | sizes),
        closed_loop=draw(st.booleans()),
    )
    heading = {"theta": draw(numbers), "heading_tolerance": draw(sizes)} if draw(st.booleans()) else {}
    return Scenario(
        name=draw(st.text(min_size=1, max_size=12).filter(lambda s: s.strip() and s.isprintable())),
        world=World(Bounds((-2.0 - a, -2.0 - b), (8.0 + a, 8.0)), draw(st.lists(obstacles(), max_size=4))),
        robot=Robot(footprint, limits, Gains(draw(sizes), draw(sizes), draw(sizes))),
        start=State(
            draw(sizes), draw(sizes), draw(st.floats(-1e3, 1e3)), draw(st.floats(0, 0.5)), draw(st.floats(0, 0.5))
        ),
        goal=Goal(draw(sizes), draw(sizes), draw(sizes), **heading, speed_tolerance=draw(st.none() | sizes)),
        planning=planning,
    )


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(scenarios_of_any_kind())
def test_saving_and_loading_gives_the_same_scenario_to_the_last_digit(tmp_path: Path, scenario: Scenario) -> None:
    path = tmp_path / "saved.yaml"
    save_scenario(scenario, path)
    again = load_scenario(path)
    assert again == scenario
    assert scenario_to_dict(again) == scenario_to_dict(scenario)
    assert scenario_from_dict(scenario_to_dict(scenario)) == scenario


@pytest.mark.parametrize(
    "name", ["1e-3", "no", "null", "1:30", "a: b", "# x", "'", '"', "[x]", "München", " x ", "日本", "-"]
)
def test_any_name_survives_saving(tmp_path: Path, name: str) -> None:
    save_scenario(hall(name=name), tmp_path / "saved.yaml")
    assert load_scenario(tmp_path / "saved.yaml").name == name


def test_a_saved_file_means_the_same_to_other_readers_of_yaml(tmp_path: Path) -> None:
    scenario = hall(planning=PlanningSettings(equal_control_tolerance=1e-7))
    save_scenario(scenario, tmp_path / "saved.yaml")
    assert yaml.safe_load((tmp_path / "saved.yaml").read_text(encoding="utf-8")) == scenario_to_dict(scenario)


def test_settings_that_are_numbers_of_numpy_are_saved(tmp_path: Path) -> None:
    scenario = hall(planning=PlanningSettings(horizon=np.float64(1.5)))
    save_scenario(scenario, tmp_path / "saved.yaml")
    assert load_scenario(tmp_path / "saved.yaml") == scenario


def test_saving_where_nothing_can_be_written_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="^(no such folder to write in: |cannot write )"):
        save_scenario(hall(), tmp_path / "none" / "saved.yaml")


# Maps


class FakeMap:
    remarks = ()

    """A map of one wall, and one cell that nobody has seen."""

    remarks = ()

    def bounds(self) -> Bounds:
        return Bounds((0.0, 0.0), (4.0, 3.0))

    def obstacles(self, unknown: str | None = None) -> list[Obstacle]:
        wall, unseen = Box((1.9, 1.5), (2.1, 3.0)), Box((0.0, 2.5), (0.5, 3.0))
        return [wall, unseen] if unknown == "occupied" else [wall]


@pytest.fixture
def maps_read(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """The files that were read, with a reader of maps that gives a fake one."""
    read: list[Path] = []

    def load_map(path: Path, *, resolution: float | None = None) -> FakeMap:
        read.append(path)
        if path.name == "broken.yaml":
            raise InputError(Problem("resolution", 0, "a number above 0"), source=str(path))
        return FakeMap()

    module = types.ModuleType("cbrrt_ompl.scenario.maps.loading")
    vars(module)["load_map"] = load_map
    monkeypatch.setitem(sys.modules, "cbrrt_ompl.scenario.maps.loading", module)
    return read


MAPPED = "name: depot\nmap: maps/depot.yaml\nstart: {x: 1, y: 1}\ngoal: {x: 3, y: 1}\n"


def test_a_map_gives_bounds_and_obstacles(tmp_path: Path, maps_read: list[Path]) -> None:
    scenario = load_text(tmp_path, MAPPED)
    assert maps_read == [tmp_path / "maps/depot.yaml"]
    assert scenario.world.bounds == Bounds((0.0, 0.0), (4.0, 3.0))
    assert len(scenario.world.obstacles) == 2
    assert scenario.map == MapSource((tmp_path / "maps/depot.yaml").resolve(), 2, "occupied")


def test_bounds_and_obstacles_of_the_file_come_on_top_of_the_map(tmp_path: Path, maps_read: list[Path]) -> None:
    text = MAPPED + "bounds: {min: [0, 0], max: [3.9, 2]}\nobstacles: [{type: disc, center: [2, 0.2], radius: 0.1}]\n"
    scenario = load_text(tmp_path, text)
    assert len(maps_read) == 1
    assert scenario.world.bounds == Bounds((0.0, 0.0), (3.9, 2.0))
    assert scenario.world.obstacles[-1] == Disc((2.0, 0.2), 0.1)
    assert len(scenario.world.obstacles) == 3


def test_unknown_cells_of_a_map_may_count_as_free(tmp_path: Path, maps_read: list[Path]) -> None:
    scenario = load_text(tmp_path, changed("maps/depot.yaml", "{file: maps/depot.yaml, unknown: free}", MAPPED))
    assert len(maps_read) == 1
    assert len(scenario.world.obstacles) == 1


@pytest.mark.parametrize("unknown", ["occupied", "free"])
def test_a_map_is_saved_by_its_name_as_seen_from_the_new_file(
    tmp_path: Path, maps_read: list[Path], unknown: str
) -> None:
    text = changed("maps/depot.yaml", f"{{file: maps/depot.yaml, unknown: {unknown}}}", MAPPED)
    scenario = load_text(tmp_path, text + "obstacles: [{type: disc, center: [2, 0.2], radius: 0.1}]\n")
    (tmp_path / "copies").mkdir()
    copy = tmp_path / "copies" / "copy.yaml"
    save_scenario(scenario, copy)
    written = yaml.safe_load(copy.read_text(encoding="utf-8"))
    assert written["map"] == {"file": "../maps/depot.yaml", "unknown": unknown}
    assert len(written["obstacles"]) == 1
    assert load_scenario(copy) == scenario
    assert len(maps_read) == 2


def test_a_mistake_in_a_map_names_both_files(tmp_path: Path, maps_read: list[Path]) -> None:
    (line,) = complaints(tmp_path, changed("depot.yaml", "broken.yaml", MAPPED))
    assert line == f"map: {maps_read[0]}: resolution: got 0, expected a number above 0"


def test_a_map_from_disk_is_read_and_comes_back_after_saving(tmp_path: Path) -> None:
    (tmp_path / "depot.yaml").write_text(
        "image: depot.pgm\nresolution: 0.5\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    rows = np.full((6, 8), 254, dtype=np.uint8)
    rows[:4, 4] = 0
    rows[0, 0] = 205
    (tmp_path / "depot.pgm").write_bytes(b"P5\n8 6\n255\n" + rows.tobytes())
    scenario = load_text(tmp_path, MAPPED.replace("maps/", ""))
    assert scenario.world.bounds == Bounds((0.0, 0.0), (4.0, 3.0))
    point = Footprint.point()
    assert scenario.world.collides(point, (2.25, 2.5, 0.0))
    assert scenario.world.collides(point, (0.25, 2.75, 0.0))
    assert not scenario.world.collides(point, (2.25, 0.5, 0.0))
    save_scenario(scenario, tmp_path / "saved.yaml")
    assert load_scenario(tmp_path / "saved.yaml") == scenario


def test_the_resolution_of_a_map_that_is_only_an_image_stands_in_the_scenario(tmp_path: Path) -> None:
    (tmp_path / "hall.pgm").write_bytes(b"P5\n8 6\n255\n" + bytes([255] * 47 + [0]))
    text = MAPPED.replace("maps/depot.yaml", "{file: hall.pgm, resolution: 0.5}")
    scenario = load_text(tmp_path, text)
    assert scenario.world.bounds == Bounds((0.0, 0.0), (4.0, 3.0))
    save_scenario(scenario, tmp_path / "saved.yaml")
    assert load_scenario(tmp_path / "saved.yaml") == scenario
    (line,) = complaints(tmp_path, text.replace(", resolution: 0.5", ""))
    assert line.startswith(f"map: {tmp_path / 'hall.pgm'}: resolution: missing, expected ")


def test_a_map_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    (line,) = complaints(tmp_path, MAPPED)
    assert line.startswith("map: ")
    assert "depot.yaml" in line


# The scenarios that come with the package

SHIPPED = sorted((Path(__file__).parent.parent / "scenarios").glob("*.yaml"))


def test_the_scenes_of_the_paper_and_three_of_our_own_are_there() -> None:
    names = {path.stem for path in SHIPPED}
    assert {"paper_case1", "paper_case2", "paper_case2_rooms", "office", "maze", "slalom"} <= names


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_start_and_goal_of_a_shipped_scenario_are_connected_for_the_whole_robot(path: Path) -> None:
    scenario = load_scenario(path)
    world, radius = scenario.world, max(scenario.robot.footprint.circumscribed_radius, 1e-3)
    solids = shapely.union_all([obstacle.to_shapely() for obstacle in world.obstacles]).buffer(radius)
    free = shapely.box(*world.bounds.min, *world.bounds.max).buffer(-radius).difference(solids)
    start, goal = shapely.Point(scenario.start[:2]), shapely.Point(scenario.goal.x, scenario.goal.y)
    assert any(room.contains(start) and room.contains(goal) for room in shapely.get_parts(free))


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_a_shipped_scenario_survives_saving(path: Path, tmp_path: Path) -> None:
    scenario = load_scenario(path)
    save_scenario(scenario, tmp_path / path.name)
    assert load_scenario(tmp_path / path.name) == scenario


@pytest.mark.parametrize("name", ["paper_case1", "paper_case2", "paper_case2_rooms"])
def test_the_scenes_of_the_paper_have_its_robot_and_settings(scenarios: Path, name: str) -> None:
    scenario = load_scenario(scenarios / f"{name}.yaml")
    assert scenario.world.bounds == Bounds((-5.0, -5.0), (5.0, 5.0))
    assert (scenario.start, scenario.goal) == (State(-4.0, -4.0), Goal(4.0, 4.0, 0.5))
    assert dataclasses.replace(scenario.robot, gains=scenario.robot.gains or Gains()) == Robot(gains=Gains())
    assert dataclasses.replace(scenario.planning, look_ahead=None).filled() == FilledSettings()
    assert scenario.planning.look_ahead == scenario.robot.limits.v_max * scenario.planning.horizon
    assert "reconstruction" in (scenarios / f"{name}.yaml").read_text(encoding="utf-8").split("name:")[0]


def gaps_at(world: World, y: float) -> list[tuple[float, float]]:
    """Where a level line through a world is free."""
    line = shapely.LineString([(world.bounds.min[0], y), (world.bounds.max[0], y)])
    free = line.difference(shapely.union_all([obstacle.to_shapely() for obstacle in world.obstacles]))
    return [(part.bounds[0], part.bounds[2]) for part in shapely.get_parts(free)]


@pytest.mark.parametrize(
    ("name", "y", "centres"),
    [
        ("paper_case1", 2.0, [k + 0.27 for k in range(-5, 5)]),
        ("paper_case2", -1.1, [-2.0, 2.0]),
        ("paper_case2", 1.1, [-4.0, 0.0, 4.0]),
    ],
)
def test_the_walls_of_the_paper_have_their_gaps_of_20_centimetres(
    scenarios: Path, name: str, y: float, centres: list[float]
) -> None:
    gaps = gaps_at(load_scenario(scenarios / f"{name}.yaml").world, y)
    assert gaps == [pytest.approx((centre - 0.1, centre + 0.1)) for centre in centres]
