"""``cbrrt drive``, and ``cbrrt plan --animation``: what is printed and written, and how they end."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from PIL import Image

from cbrrt_ompl.cli import main
from cbrrt_ompl.figures import film
from cbrrt_ompl.trajectory.trajectory import Trajectory

HALL = """
name: hall
bounds: {min: [0, 0], max: [8, 4]}
obstacles:
  - {type: box, min: [4.0, 1.0], max: [4.4, 3.0]}
robot:
  footprint: {type: disc, radius: 0.2}
  limits: {v: [0, 1], omega: [-1, 1], acceleration: 0.6, angular_acceleration: 2}
start: {x: 0.8, y: 2.0}
goal: {x: 7.2, y: 2.0, tolerance: 0.4}
planning: {horizon: 1.5}
"""


@pytest.fixture
def hall(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A scenario file; animations have a frame a second."""
    monkeypatch.setattr(film, "FRAMES_PER_SECOND", 1)
    monkeypatch.setattr(film, "LONGEST", 2.0)
    file = tmp_path / "hall.yaml"
    file.write_text(HALL)
    return str(file)


def test_drive_prints_what_came_of_it_and_writes_its_files(
    hall: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table, picture, gif = (tmp_path / name for name in ("way.csv", "way.png", "way.gif"))
    files = ["--trajectory", str(table), "--figure", str(picture), "--animation", str(gif)]
    assert main(["drive", hall, "--sensor-range", "2.5", "--max-samples", "3000", "--seed", "4", *files]) == 0
    printed = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines() if len(line.split()) == 2)
    assert (printed["status"], printed["seed"], printed["verified"]) == ("reached", "4", "valid")
    assert main(["verify", str(table), hall]) == 0
    for file in (picture, gif):
        with Image.open(file) as image:
            image.load()


def test_drive_with_json_prints_the_figures(hall: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = tmp_path / "way.json"
    arguments = ["--max-samples", "3000", "--seed", "4", "--json", "--trajectory", str(table)]
    assert main(["drive", hall, *arguments]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert (figures["reached"], figures["obstacles_found"], figures["obstacles_hidden"]) == (True, 1, 1)
    assert figures["duration"] == pytest.approx(Trajectory.load(table).duration)
    assert (figures["trajectory"], figures["figure"], figures["animation"]) == (str(table), None, None)
    assert figures["violations"] == []
    assert figures["smallest_clearance"] > 0.0


def test_drive_sees_what_is_in_line_of_sight_alone_when_asked_to(
    hall: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The hidden box is within range of the start, behind that of the scenario."""
    hidden = tmp_path / "hidden.yaml"
    hidden.write_text("obstacles:\n  - {type: box, min: [4.6, 1.8], max: [4.8, 2.2]}\n")
    page = tmp_path / "way.html"
    options = ["--sensor-range", "5", "--max-samples", "3000", "--seed", "4", "--json", "--animation", str(page)]
    seen_first = []
    for more in ([], ["--line-of-sight"]):
        assert main(["drive", hall, "--hidden", str(hidden), *options, *more]) == 0
        assert json.loads(capsys.readouterr().out)["violations"] == []
        numbers = json.loads(page.read_text("utf-8").split('id="numbers" type="application/json">')[1].split("</")[0])[
            "drive"
        ]
        seen_first.append(numbers["seen"][0])
        assert all(len(view) > 2 for view in numbers["views"]) == bool(more)
    assert seen_first == [[0], []]


def test_drive_that_stops_ends_with_one(hall: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    hidden = tmp_path / "hidden.yaml"
    hidden.write_text("obstacles:\n  - {type: box, min: [5, 0], max: [5.2, 4]}\n")
    assert main(["drive", hall, "--hidden", str(hidden), "--max-samples", "100", "--seed", "1"]) == 1
    out = capsys.readouterr().out
    assert "status              stopped\n" in out
    (reason,) = [line for line in out.splitlines() if line.startswith("blocked by")]
    assert "m away; the last search ended by" in reason


def test_drive_with_random_obstacles_is_repeated_by_its_seed(hall: str, capsys: pytest.CaptureFixture[str]) -> None:
    durations = []
    for _ in range(2):
        main(["drive", hall, "--unknown", "3", "--max-samples", "2000", "--seed", "2", "--json"])
        figures = json.loads(capsys.readouterr().out)
        assert figures["obstacles_hidden"] == 3
        durations.append(figures["duration"])
    assert durations[0] == durations[1]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--sensor-range", "1"], "sensor_range: got 1.0, expected more than 1.2"),
        (["--sensor-range", "-1"], "--sensor-range: got '-1', expected a number of metres above 0"),
        (["--cycle", "0.07"], "cycle: got 0.07, expected a multiple of planning.step"),
        (["--planner", "s-rrt"], "planner: got 's-rrt', expected one of"),
        (["--animation", "way.avi"], "--animation: got 'way.avi', expected a file name that ends in .gif, .html, .mp4"),
        (["--hidden", "nowhere.yaml"], "nowhere.yaml"),
        (["--unknown", "0"], "--unknown: got '0', expected a whole number of 1 or more"),
        (["--unknown", "1", "--hidden", "a.yaml"], "--hidden: "),
    ],
)
def test_bad_input_to_drive_is_one_line(
    hall: str, arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        code = main(["drive", hall, *arguments])
    except SystemExit as exit:
        code = exit.code
    error = capsys.readouterr().err
    assert code == 2
    assert message in error
    assert error.startswith("cbrrt: error: ") and error.count("\n") == 1


def test_plan_writes_an_animation(hall: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    gif = tmp_path / "plan.gif"
    assert main(["plan", hall, "--planner", "cb-rrt-compiled", "--seed", "1", "--animation", str(gif), "--json"]) == 0
    with Image.open(gif) as image:
        assert image.n_frames == 3
    printed = json.loads(capsys.readouterr().out)
    assert (printed["trajectory"], printed["animation"]) == (None, str(gif))
