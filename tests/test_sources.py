"""What stands where a scenario belongs: MovingAI's problems are read, and maps are told apart from scenarios."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cbrrt_ompl.errors import ScenarioError
from cbrrt_ompl.planning import plan
from cbrrt_ompl.problem.obstacles import Bounds
from cbrrt_ompl.problem.settings import Goal, State
from cbrrt_ompl.scenario.scenario import load_scenario, save_scenario
from cbrrt_ompl.scenario.sources import is_map
from cbrrt_ompl.verification import verify

ARENA = "type octile\nheight 3\nwidth 4\nmap\n@...\n..TW\n....\n"
SCEN = "version 1\n0\tmaps/dao/arena.map\t4\t3\t1\t0\t0\t2\t2.41421356\n1 arena.map 4 3 3 0 3 2 9.0\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "arena.map").write_text(ARENA)
    (tmp_path / "arena.map.scen").write_text(SCEN)
    return tmp_path


def test_a_movingai_problem_goes_from_the_middle_of_a_cell_into_another(folder: Path) -> None:
    first = load_scenario(folder / "arena.map.scen")
    assert first.name == "arena 1"
    assert first.world.bounds == Bounds((0.0, 0.0), (4.0, 3.0))
    assert (first.start, first.goal) == (State(1.5, 2.5), Goal(0.5, 0.5, 0.5))  # row 0 is the upper one
    second = load_scenario(f"{folder}/arena.map.scen:2")
    assert (second.name, second.start, second.goal) == ("arena 2", State(3.5, 2.5), Goal(3.5, 0.5, 0.5))


def test_a_movingai_problem_is_planned_and_saved_as_any_scenario(folder: Path) -> None:
    scenario = load_scenario(folder / "arena.map.scen:1")
    result = plan(scenario, planner="cb-rrt-robust", seed=1)
    assert result.status == "solved"
    assert result.trajectory is not None and verify(result.trajectory, scenario).ok
    save_scenario(scenario, folder / "saved.yaml")
    assert load_scenario(folder / "saved.yaml") == scenario


def test_problems_without_a_version_line_are_counted_from_the_first(folder: Path) -> None:
    (folder / "old.scen").write_text(SCEN.partition("\n")[2])
    assert load_scenario(folder / "old.scen").start == State(1.5, 2.5)


@pytest.mark.parametrize(
    ("text", "number", "words"),
    [
        (SCEN, 3, "arena.map.scen: got problem 3, expected one from 1 to 2"),
        ("version 1\n", 1, "got problem 1, expected one from 1 to 0"),
        (SCEN.replace("arena.map", "gone.map"), 1, "line 2: got 'maps/dao/gone.map', expected a map that exists"),
        (
            SCEN.replace("\t4\t3", "\t8\t6"),
            1,
            "line 2: {folder}/arena.map: got a map of 4 x 3 cells, expected one of 8 x 6",
        ),
        (
            SCEN.replace("\t4\t3", "\tx\t3"),
            1,
            "line 2: got '0 maps/dao/arena.map x 3 1 0 0 2 2.41421356', expected bucket",
        ),
        ("0 arena.map 4\n", 1, "line 1: got '0 arena.map 4', expected bucket, map, width"),
        (SCEN.replace("1\t0\t0\t2", "0\t0\t0\t2"), 1, "arena.map.scen:1: start: got"),
    ],
)
def test_a_broken_movingai_problem_is_refused_by_line(folder: Path, text: str, number: int, words: str) -> None:
    (folder / "arena.map.scen").write_text(text)
    with pytest.raises(ScenarioError) as caught:
        load_scenario(f"{folder}/arena.map.scen:{number}")
    assert words.format(folder=folder) in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_a_missing_file_of_problems_is_named(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"no such file: .*gone.scen"):
        load_scenario(tmp_path / "gone.scen:4")


def test_a_map_where_a_scenario_belongs_is_answered_with_what_to_type(folder: Path) -> None:
    Image.fromarray(np.full((3, 4), 255, dtype=np.uint8)).save(folder / "room.png")
    (folder / "room.yaml").write_text("image: room.png\nresolution: 0.1\norigin: [0, 0, 0]\n")
    for name in ("room.yaml", "room.png", "arena.map"):
        assert is_map(folder / name)
        with pytest.raises(ScenarioError) as caught:
            load_scenario(folder / name)
        text = str(caught.value)
        assert text.startswith(f"{folder / name}: got a map, expected a scenario; 'cbrrt show {folder / name}' draws")
        assert f"'cbrrt plan {folder / name} --robot NAME --start X Y THETA --goal X Y'" in text


@pytest.mark.parametrize("text", ["name: x\nmap: room.yaml\n", "image: a.png\n", "- 1\n", "a: [", ""])
def test_other_yaml_files_are_no_maps(tmp_path: Path, text: str) -> None:
    (tmp_path / "other.yaml").write_text(text)
    assert not is_map(tmp_path / "other.yaml")
    assert not is_map(tmp_path / "gone.yaml")
