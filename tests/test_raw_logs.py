"""Logs as OMPL's Benchmark writes them, reported without a database."""

from __future__ import annotations

from pathlib import Path

import pytest

from cbrrt_ompl.benchmark.results import read_experiments
from cbrrt_ompl.cli import main

RAW_LOG = """\
OMPL version 1.6.0
Experiment cubicles
0 experiment properties
Running on somewhere
Starting at 2026-05-01 12:00:00
<<<|
Settings for the state space 'SE3CompoundSpace'
|>>>
<<<|
Architecture: x86_64
|>>>
3246 is the random seed
10 seconds per run
1000 MB per run
3 runs per planner
12.5 seconds spent to collect the data
1 enum type
status|Unknown|Invalid start|Invalid goal|Unrecognized goal|Timeout|Approximate solution|Exact solution|Crash
2 planners
geometric_RRT
2 common properties
goal_bias = 0.05
range = 10
6 properties for each run
approximate solution BOOLEAN
graph states INTEGER
solution length REAL
solved BOOLEAN
status ENUM
time REAL
3 runs
0; 120; 31.5; 1; 6; 0.25;
0; 80; 29.5; 1; 6; 0.75;
1; 900; inf; 0; 5; 10.0;
.
geometric_PRM
1 common properties
max_nearest_neighbors = 8
4 properties for each run
graph states INTEGER
solved BOOLEAN
status ENUM
time REAL
3 runs
10; 1; 6; 0.1;
20; 1; 6; 0.2;
30; 1; 6; 0.3;
.
""".replace(";\n", "; \n")


def test_a_raw_log_is_read_like_a_database(tmp_path: Path) -> None:
    (tmp_path / "raw.log").write_text(RAW_LOG)
    (experiment,) = read_experiments(tmp_path / "raw.log")
    assert (experiment.title, experiment.time_limit, experiment.version) == ("cubicles", 10.0, "OMPL 1.6.0")
    rrt, prm = experiment.series
    assert (rrt.planner, prm.planner) == ("RRT", "PRM")
    assert rrt.success.tolist() == [True, True, False]
    assert prm.time.tolist() == [0.1, 0.2, 0.3]
    assert list(tmp_path.iterdir()) == [tmp_path / "raw.log"]


def test_a_raw_log_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "raw.log").write_text(RAW_LOG)
    assert main(["report", str(tmp_path / "raw.log"), "--output", str(tmp_path / "report")]) == 0
    assert "2 of 3" in capsys.readouterr().out
    text = (tmp_path / "report" / "report.md").read_text()
    assert "cubicles" in text and "5 of 5 exact solutions were not verified" in text


def test_a_raw_log_that_was_cut_off_is_refused_by_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "raw.log").write_text(RAW_LOG[:900])
    assert main(["report", str(tmp_path / "raw.log"), "--output", str(tmp_path / "report")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "raw.log: line" in line
