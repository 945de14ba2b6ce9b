"""From a map to a plan without a scenario file: what is typed first, and what it answers."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from matplotlib.figure import Figure
from PIL import Image

from cbrrt_ompl.cli import main
from cbrrt_ompl.cli.problem import REST_SPEED, map_planner
from cbrrt_ompl.errors import ScenarioError
from cbrrt_ompl.figures.maps import WRONG_COLOR, draw_draft, draw_map
from cbrrt_ompl.maps import load_map
from cbrrt_ompl.planners.registry import PLANNERS
from cbrrt_ompl.scenario.draft import load_draft
from cbrrt_ompl.scenario.maps.free_places import places_apart
from cbrrt_ompl.scenario.scenario import load_scenario
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.verification import verify

ASK = ["--robot", "turtlebot3_burger", "--start", "0.7", "1.5", "-90deg", "--goal", "3.2", "1.5"]


@pytest.fixture
def room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A room of 4 m x 3 m with a wall that leaves a metre below, and unknown cells in a corner."""
    greys = np.full((60, 80), 254, dtype=np.uint8)
    greys[:40, 38:42] = 0
    greys[:4, :4] = 205
    Image.fromarray(greys).save(tmp_path / "room.pgm")
    (tmp_path / "room.yaml").write_text("image: room.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, list[str]]:
    """Exit code, output, and the lines on stderr."""
    code = main(arguments)
    captured = capsys.readouterr()
    return code, captured.out, captured.err.splitlines()


def test_a_map_a_robot_a_start_and_a_goal_make_a_plan(room: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, errors = run(capsys, "plan", "room.yaml", *ASK, "--seed", "1", "--json", "--trajectory", "t.csv")
    assert (code, errors) == (0, [])
    assert json.loads(out)["planner"] == map_planner()
    trajectory = Trajectory.load("t.csv")
    np.testing.assert_allclose(trajectory.states[0], [0.7, 1.5, -np.pi / 2, 0.0, 0.0])
    assert np.hypot(trajectory.x[-1] - 3.2, trajectory.y[-1] - 1.5) < 0.25


def test_the_planner_for_maps_is_the_anytime_one_as_soon_as_there_is_one() -> None:
    assert map_planner() == ("cb-rrt-anytime" if "cb-rrt-anytime" in PLANNERS else "cb-rrt-robust")


def test_a_heading_and_rest_are_arrived_with(room: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ask = [*ASK, "90deg", "--rest", "--seed", "1", "--trajectory", "t.csv"]
    assert run(capsys, "plan", "room.yaml", *ask)[0] == 0
    last = Trajectory.load("t.csv").states[-1]
    assert abs(last[2] - np.pi / 2) <= 0.25
    assert np.abs(last[3:]).max() <= REST_SPEED


def test_what_a_map_lacks_to_be_planned_in_is_asked_for_at_once(room: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, errors = run(capsys, "plan", "room.yaml")
    assert (code, out) == (2, "")
    assert [line.split(": ")[3] for line in errors] == ["--robot", "--start", "--goal"]
    assert "turtlebot3_burger" in errors[0] and "cbrrt show room.yaml" in errors[1]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (["--robot", "jakal"], "robot: got 'jakal', expected one of tetra_ds_ii"),
        (["--robot", "nav2.yaml"], "nav2.yaml: no such file"),
        (["--start", "x", "1", "0"], "--start: got 'x', expected numbers X Y THETA [m, m, rad]; an angle may be 90deg"),
        (["--start", "1", "1deg", "0"], "--start: got '1deg'"),
        (["--goal", "3"], "--goal: got '3', expected numbers X Y, or X Y THETA"),
        (["--goal", "3", "1", "nan"], "--goal: got 'nan'"),
        (["--goal", "3", "1", "0", "0"], "--goal: got '3 1 0 0'"),
        (["--set", "horizon"], "--set: got 'horizon', expected KEY=VALUE"),
        (["--set", "planning.horizon=x"], "planning.horizon: got 'x', expected a finite number"),
        (["--set", "planning.horizn=1"], "planning.horizn: got an unknown key, expected horizon"),
        (["--set", "planning.horizon=["], "--set: got '[', expected a value in YAML"),
        (["--start", "2.0", "2.0", "0"], "start: got [2.0, 2.0, 0.0], expected"),
        (["--unknown", "maybe"], "--unknown: got 'maybe', expected one of occupied, free"),
        (["--clearance", "-1"], "--clearance: got '-1', expected a number of metres, 0 or more"),
        (["--resolution", "0"], "--resolution: got '0', expected a number of metres above 0"),
    ],
)
def test_a_wrong_option_is_one_line(
    room: Path, capsys: pytest.CaptureFixture[str], changes: list[str], words: str
) -> None:
    try:
        code = main(["plan", "room.yaml", *ASK, *changes])
    except SystemExit as stop:
        code = int(str(stop.code))
    captured = capsys.readouterr()
    (line,) = captured.err.splitlines()
    assert (code, captured.out) == (2, "")
    assert words in line


def test_an_image_takes_its_resolution_from_the_command_line(room: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "plan", "room.pgm", *ASK, "--seed", "1", "--resolution", "0.05")[0] == 0
    code, _, errors = run(capsys, "plan", "room.pgm", *ASK)
    assert code == 2
    assert "resolution: missing, expected the side of a cell" in errors[0]


@pytest.mark.needs_ompl
def test_options_take_the_place_of_what_a_scenario_says(room: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (room / "tour.yaml").write_text(
        "name: tour\nmap: room.yaml\nrobot: jackal\nstart: {x: 2, y: 2, theta_deg: 20}\n"
        "goal: {x: 9, y: 9, tolerance: 0.3}\n"
    )
    change = [*ASK, "--set", "robot.limits.v=[0.0, 0.1]", "--set", "name=other", "--set", "planning.max_samples=9"]
    code, out, errors = run(capsys, "plan", "tour.yaml", *change, "--json")
    assert (code in (0, 1), errors) == (True, [])
    assert json.loads(out)["scenario"] == "other"
    assert json.loads(out)["planner"] == "cb-rrt"
    assert json.loads(out)["samples"] <= 9


def test_an_image_from_another_machine_is_remarked_on_once(room: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (room / "room.yaml").write_text("image: /home/anna/room.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n")
    code, _, errors = run(capsys, "plan", "room.yaml", *ASK, "--seed", "1")
    assert (code, errors) == (0, ["cbrrt: room.yaml: image: there is no /home/anna/room.pgm, room.pgm is taken"])


@pytest.mark.parametrize("name", ["room.yaml", "room.pgm", "arena.map"])
def test_anything_that_is_a_map_can_be_looked_at(room: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    (room / "arena.map").write_text("type octile\nheight 2\nwidth 3\nmap\n@..\n..T\n")
    code, out, errors = run(capsys, "show", name, "--figure", "look.png")
    assert (code, out) == (0, "")
    assert (room / "look.png").read_bytes().startswith(b"\x89PNG")
    assert [line for line in errors if "--resolution" not in line] == []
    assert len(errors) == (name != "room.yaml")


def test_a_scenario_that_is_not_right_yet_is_drawn_with_its_mistakes_told(
    room: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (room / "bare.yaml").write_text("name: bare\nmap: room.yaml\n")
    (room / "guess.yaml").write_text(
        "name: guess\nmap: room.yaml\nrobot: jackal\nstart: {x: 0, y: 0}\ngoal: {x: 3, y: 1, tolerance: -1}\n"
    )
    for name, fields in (("bare.yaml", ["start", "goal"]), ("guess.yaml", ["goal.tolerance", "start"])):
        code, _, errors = run(capsys, "show", name, "--figure", f"{name}.png")
        assert code == 0
        assert [line.split(": ")[2] for line in errors] == fields
        assert (room / f"{name}.png").exists()
    assert run(capsys, "plan", "guess.yaml")[0] == 2


def test_other_mistakes_of_a_scenario_are_refused_as_ever(room: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (room / "wrong.yaml").write_text("name: wrong\nmap: room.yaml\nrobt: jackal\nstart: {x: 0, y: 0}\n")
    code, _, errors = run(capsys, "show", "wrong.yaml", "--figure", "look.png")
    assert code == 2
    assert "wrong.yaml: robt: got an unknown key, expected robot" in errors[0]
    assert not (room / "look.png").exists()


def test_a_map_is_drawn_cell_by_cell_where_it_lies(room: Path) -> None:
    (room / "room.yaml").write_text("image: room.pgm\nresolution: 0.05\norigin: [1, -2, 0.5]\n")
    ax = draw_map(Figure().subplots(), load_map("room.yaml"))
    (cells,) = ax.images
    corner = (cells.get_transform() - ax.transData).transform((4.0, 3.0))
    c, s = np.cos(0.5), np.sin(0.5)
    np.testing.assert_allclose(corner, (1 + 4 * c - 3 * s, -2 + 4 * s + 3 * c))
    assert {"free", "unknown", "occupied"} == set(ax.get_legend_handles_labels()[1])
    colors = np.asarray(cells.get_array())[[0, 59, 59], [0, 0, 39]]
    assert len({tuple(color) for color in colors.tolist()}) == 3  # free, unknown and occupied
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x [m]", "y [m]")
    ticks = {*ax.get_xticks().tolist(), *ax.get_xticks(minor=True).tolist()}
    assert {0.0, 1.0, 2.0, 3.0, 4.0} <= ticks


def test_the_wrong_one_of_start_and_goal_is_red(room: Path) -> None:
    (room / "guess.yaml").write_text("name: guess\nmap: room.yaml\nstart: {x: 0, y: 0}\ngoal: {x: 3, y: 1}\n")
    draft = load_draft("guess.yaml")
    ax = draw_draft(Figure().subplots(), draft, load_map("room.yaml"))
    colors = {line.get_label(): line.get_color() for line in ax.get_lines()}
    assert (colors["start"], colors["goal"]) == (WRONG_COLOR, "black")


def test_a_new_scenario_can_be_planned_in_as_it_is(room: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (room / "sub").mkdir()
    code, out, _ = run(capsys, "new", "room.yaml", "--robot", "turtlebot3_burger", "--output", "sub/tour.yaml")
    assert (code, out) == (0, "sub/tour.yaml\n")
    text = (room / "sub" / "tour.yaml").read_text()
    assert "map: ../room.yaml" in text and text.count("#") > 5
    assert run(capsys, "plan", "sub/tour.yaml", "--planner", "cb-rrt-robust", "--seed", "1")[0] == 0
    assert run(capsys, "new", "room.yaml", "--robot", "turtlebot3_burger")[1].count("map: room.yaml") == 1


def test_a_new_scenario_has_what_was_asked_for(room: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ask = [*ASK, "90deg", "--rest", "--unknown", "free", "--set", "planning.horizon=1.5"]
    code, out, _ = run(capsys, "new", "room.yaml", *ask)
    assert code == 0
    data: dict[str, Any] = yaml.safe_load(out)
    assert data["start"] == {"x": 0.7, "y": 1.5, "theta_deg": -90.0}
    assert data["goal"].items() >= {"x": 3.2, "y": 1.5, "theta_deg": 90.0, "speed_tolerance": REST_SPEED}.items()
    assert data["map"] == {"file": "room.yaml", "unknown": "free"}
    assert data["planning"].items() >= {"clearance": 0.05, "horizon": 1.5}.items()
    (room / "again.yaml").write_text(out)
    assert load_scenario("again.yaml").planning.horizon == 1.5


def test_a_new_scenario_never_takes_the_place_of_a_file(room: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (room / "mine.yaml").write_text("precious\n")
    code, _, errors = run(capsys, "new", "room.yaml", "--robot", "jackal", "--output", "mine.yaml")
    assert code == 2
    assert "none is overwritten" in errors[0]
    assert (room / "mine.yaml").read_text() == "precious\n"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["room.yaml"], "--robot: missing, expected a ready robot"),
        (["office", "--robot", "jackal"], "office: got no map, expected a map"),
        (["room.yaml", *ASK, "--start", "2", "2", "0"], "start: got [2.0, 2.0, 0.0]"),
        (["room.yaml", "--robot", "jackal", "--output", "gone/a.yaml"], "no such folder to write in: gone/a.yaml"),
        (["room.yaml", "--robot", "jackal", "--set", "robot.footprint=3.0"], "expected a free place for a disc of 3"),
    ],
)
def test_a_new_scenario_that_cannot_be_made_is_refused(
    room: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], words: str
) -> None:
    code, out, errors = run(capsys, "new", *arguments)
    assert (code, out) == (2, "")
    assert words in errors[0]


def test_free_places_lie_in_one_part_of_the_map_far_apart(room: Path) -> None:
    greys = np.full((40, 60), 254, dtype=np.uint8)
    greys[:, 20] = 0  # a small room on the left, closed
    Image.fromarray(greys).save(room / "two.pgm")
    grid = load_map("two.pgm", resolution=0.1, origin=(1.0, 2.0, 0.0))
    (x, y), (far_x, far_y) = places_apart(grid, 0.3)
    assert 3.4 <= x <= 6.7 and 3.4 <= far_x <= 6.7
    assert np.hypot(far_x - x, far_y - y) > 1.5
    assert 2.3 <= far_y <= 5.7


def test_robots_and_scenarios_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "robots")
    assert code == 0
    assert "jackal                2 m/s, 229 deg/s, 0.508 m x 0.43 m" in out.splitlines()
    assert "jackal" in json.loads(run(capsys, "robots", "--json")[1])
    code, out, _ = run(capsys, "scenarios")
    assert code == 0
    assert max(map(len, out.splitlines())) <= 80
    found = json.loads(run(capsys, "scenarios", "--json")[1])
    assert load_scenario(found["office"]["file"]).name == "office"
    assert found["dock"]["about"] == "A hall that is no rectangle: a solid with a hole in it"


def test_a_draft_without_a_world_is_refused(tmp_path: Path) -> None:
    (tmp_path / "draft.yaml").write_text("name: x\n")
    with pytest.raises(ScenarioError, match="bounds: missing"):
        load_draft(tmp_path / "draft.yaml")


def test_a_trajectory_is_drawn_over_a_map_alone(room: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "plan", "room.yaml", *ASK, "--seed", "1", "--trajectory", "t.csv")[0] == 0
    assert run(capsys, "show", "room.yaml", "--trajectory", "t.csv", "--figure", "t.png")[0] == 0
    scenario = load_draft_of_plan(room, capsys)
    assert verify(Trajectory.load("t.csv"), scenario).ok


def load_draft_of_plan(room: Path, capsys: pytest.CaptureFixture[str]) -> Any:
    """The scenario that a plan in the map is verified against: that of ``cbrrt new`` with the same options."""
    (room / "same.yaml").write_text(run(capsys, "new", "room.yaml", *ASK)[1])
    return load_scenario("same.yaml")


def test_a_goal_in_position_alone_is_arrived_at_at_rest_where_asked_for(
    room: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(capsys, "plan", "room.yaml", *ASK, "--rest", "--seed", "1", "--trajectory", "t.csv")[0] == 0
    end = Trajectory.load("t.csv").states[-1]
    assert abs(end[3:]).max() <= REST_SPEED
    assert math.hypot(end[0] - 3.2, end[1] - 1.5) < 0.25


def test_a_map_that_is_not_there_is_no_map_of_another_kind(room: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, errors = run(capsys, "new", "nothere.yaml", "--robot", "jackal")
    assert (code, errors) == (2, ["cbrrt: error: no such file: nothere.yaml"])


def test_the_places_that_are_picked_lie_on_one_side_of_a_keepout_mask(room: Path) -> None:
    """They were those of the map alone, and there was no way."""
    grid = np.full((60, 80), 254, dtype=np.uint8)
    grid[40:, 38:42] = 0  # closes the gap below the wall
    Image.fromarray(grid).save("mask.png")
    Path("mask.yaml").write_text("image: mask.png\nresolution: 0.05\norigin: [0, 0, 0]\n")
    ask = ["--robot", "turtlebot3_burger", "--output", "tour.yaml"]
    assert main(["new", "room.yaml", *ask, "--set", "map.keepout=mask.yaml"]) == 0
    scenario = load_scenario("tour.yaml")
    assert (scenario.start.x < 2.0) == (scenario.goal.x < 2.0)
