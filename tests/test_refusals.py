"""Mistakes that are refused by the field or the file that is wrong, where no other test makes them."""

from __future__ import annotations

import math
import sqlite3
import sys
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cbrrt_ompl.benchmark import job as job_module
from cbrrt_ompl.benchmark.campaign import Campaign
from cbrrt_ompl.benchmark.case import check_log, crash_log
from cbrrt_ompl.benchmark.database import open_database, write_database
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import InputError, MapError, RobotError, SettingsError
from cbrrt_ompl.maps import OccupancyMap, load_map
from cbrrt_ompl.problem.obstacles import Bounds
from cbrrt_ompl.problem.robot import Footprint
from cbrrt_ompl.problem.settings import Goal, State
from cbrrt_ompl.scenario.scenario import Scenario

OPEN = Scenario(
    name="open",
    world=World(Bounds((-2.0, -2.0), (2.0, 2.0))),
    start=State(-1.0, 0.0),
    goal=Goal(1.0, 0.0, tolerance=0.4),
)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"scenarios": {}}, "scenarios"),
        ({"planners": ()}, "planners"),
        ({"runs": 0}, "runs"),
        ({"time_limit": 0.0}, "time_limit"),
        ({"time_limit": math.inf}, "time_limit"),
        ({"time_limit": math.nan}, "time_limit"),
        ({"seed": -1}, "seed"),
    ],
)
def test_a_campaign_without_work_or_end_is_refused(change: dict[str, Any], field: str) -> None:
    with pytest.raises(SettingsError) as caught:
        Campaign(**{"scenarios": {"open": OPEN}, "planners": ("rrt",), "runs": 1, "time_limit": 1.0, **change})
    assert [problem.field for problem in caught.value.problems] == [field]


def test_a_log_that_lacks_runs_of_its_case_is_refused() -> None:
    (case,) = Campaign({"open": OPEN}, ("rrt",), 3, 1.0).cases()
    check_log(crash_log(case), case)
    with pytest.raises(InputError, match=f"{case.name}: runs: got 2, expected 3"):
        check_log(crash_log(replace(case, seeds=case.seeds[:2])), case)


@pytest.mark.parametrize("log", ["", "OMPL version 1.7.0\n"])
def test_a_case_that_ends_well_without_its_whole_log_is_an_error(monkeypatch: pytest.MonkeyPatch, log: str) -> None:
    code = f"import sys; print('ran', file=sys.stderr); open(sys.argv[2], 'w').write({log!r})" if log else "pass"
    monkeypatch.setattr(job_module, "COMMAND", (sys.executable, "-c", code))
    (case,) = Campaign({"open": OPEN}, ("rrt",), 3, 1.0).cases()
    outcome = job_module.execute(case)
    assert outcome.result is None
    assert outcome.error.startswith("no complete result: ")
    assert outcome.error.endswith("\nran\n" if log else "\n")


def test_a_database_of_something_else_is_refused_by_its_tables(tmp_path: Path) -> None:
    with closing(sqlite3.connect(tmp_path / "other.db")) as connection, connection:
        connection.execute("CREATE TABLE runs (id INTEGER)")
    with pytest.raises(InputError, match=r"got \['runs'\], expected the tables of a benchmark database"):
        open_database(tmp_path / "other.db")


def test_a_database_that_cannot_be_written_leaves_nothing_behind(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="a.db") as caught:
        write_database(tmp_path / "missing" / "a.db", [])
    assert caught.value.filename == str(tmp_path / "missing" / "a.db")
    assert list(tmp_path.iterdir()) == []


def test_an_image_name_that_is_no_path_is_refused_as_a_missing_file(tmp_path: Path) -> None:
    (tmp_path / "map.yaml").write_text(
        f"image: {'x' * 5000}.pgm\nresolution: 0.1\norigin: [0, 0, 0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n",
        encoding="utf-8",
    )
    with pytest.raises(MapError, match="image: got .* expected a file that exists"):
        load_map(tmp_path / "map.yaml")


def test_corners_that_are_no_numbers_are_refused() -> None:
    with pytest.raises(RobotError, match="expected a list of"):
        Footprint(vertices=[("a", 0.0), (1.0, 0.0), (0.0, 1.0)])  # type: ignore[arg-type]


def test_equal_maps_have_equal_hashes_and_nothing_else_equals_a_map() -> None:
    cells = np.array([[0, 100], [-1, 0]], dtype=np.int8)
    first, second = (OccupancyMap(cells.copy(), 0.5, (1.0, 2.0, 0.0)) for _ in range(2))
    assert first == second and hash(first) == hash(second)
    assert first != OccupancyMap(cells, 0.5, (1.0, 2.5, 0.0))
    assert first != "a map"
