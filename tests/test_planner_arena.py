"""Planner Arena (PyPI: plannerarena) opens a database of ours and draws it."""

from __future__ import annotations

import os
import sqlite3
import subprocess
from contextlib import closing
from pathlib import Path

import pytest

from cbrrt_ompl.benchmark.account import describe_problem, max_samples_of, name_of
from cbrrt_ompl.benchmark.columns import progress_rows
from cbrrt_ompl.benchmark.database import write_database
from cbrrt_ompl.benchmark.log import Log, merge_logs
from cbrrt_ompl.benchmark.results import read_experiments
from cbrrt_ompl.ompl_plugin.availability import has_ompl
from cbrrt_ompl.problem.settings import Goal, State
from cbrrt_ompl.scenario.scenario import Scenario

DRAW = """
import sys
import plotnine as p9
from plannerarena.database import load_database
from plannerarena.performance import boxplot, ecdf_plot, enums_plot
from plannerarena.widgets import problem_parameter_filter

data = load_database(sys.argv[1])
assert data["problem_names"] == ["open"], data["problem_names"]
runs, chosen = data["runs"], {name: data["experiments"][name][0] for name in data["parameters"]}
for number, attribute in enumerate(("time", "trajectory duration", "planning time")):
    boxplot(runs, attribute, [], "o", False).save(f"{sys.argv[2]}/box{number}.png", verbose=False)
    ecdf_plot(runs, attribute, []).save(f"{sys.argv[2]}/ecdf{number}.png", verbose=False)
statuses = data["enums"].filter(data["enums"]["name"] == "status")
enums_plot(runs, statuses, []).save(f"{sys.argv[2]}/status.png", verbose=False)
progress = data["progress"].join(runs.select(["id", "planner"]), left_on="runid", right_on="id")
progress = problem_parameter_filter(progress, chosen)
plot = p9.ggplot(progress, p9.aes(x="time", y="best cost", color="planner", fill="planner"))
plot = plot + p9.geom_smooth(na_rm=True, method="loess", span=0.1, se=False)
plot.save(f"{sys.argv[2]}/progress.png", verbose=False)
print(data["progress"].columns, set(progress["planner"].to_list()))
"""
"""What the app does for its pages on performance and on progress, with one problem chosen."""


@pytest.fixture(scope="module")
def log() -> Log:
    """Two planners, one of which reports progress."""
    if not has_ompl():
        pytest.skip("OMPL's Benchmark needs OMPL")
    from cbrrt_ompl import Bounds, World
    from cbrrt_ompl.benchmark.experiment import Experiment

    world = World(Bounds((-2.0, -2.0), (2.0, 2.0)))
    scenario = Scenario(name="Open field", world=world, start=State(-1.0, 0.0), goal=Goal(1.0, 0.0))
    seeds = {"cb-rrt-compiled": [1, 2], "cb-rrt-anytime": [1, 2]}
    logs = [Experiment(scenario, {name: runs}, "open").run(0.3) for name, runs in seeds.items()]
    return merge_logs(logs, "open", seed=1, run_count=2)


def columns(path: Path, table: str) -> list[str]:
    with closing(sqlite3.connect(path)) as connection:
        return [row[1] for row in connection.execute(f"PRAGMA table_info({table})")]


def test_the_tables_are_those_that_the_app_selects_from(log: Log, tmp_path: Path) -> None:
    """It reads ``SELECT * from`` experiments, plannerConfigs, enums, runs, progress, some of it by position.

    A thirteenth column of the experiments is a parameter for it, by which it filters a table of the progress that has
    no such column: the page on progress showed an error alone.
    """
    path = tmp_path / "bench.db"
    write_database(path, [log])
    assert columns(path, "experiments") == [
        "id", "name", "totaltime", "timelimit", "memorylimit", "runcount", "version", "hostname", "cpuinfo", "date",
        "seed", "setup",
    ]  # fmt: skip
    assert columns(path, "plannerConfigs") == ["id", "name", "settings"]
    assert columns(path, "enums") == ["name", "value", "description"]
    assert columns(path, "runs")[:3] == ["id", "experimentid", "plannerid"]
    assert columns(path, "progress") == ["runid", "time", "best_cost"]


def test_the_report_still_knows_name_and_limit(log: Log, tmp_path: Path) -> None:
    write_database(tmp_path / "bench.db", [log])
    (experiment,) = read_experiments(tmp_path / "bench.db")
    assert experiment.title == "Open field"
    assert log.setup.count("Scenario: Open field") == 2  # a part a planner


def test_progress_goes_on_between_the_solutions() -> None:
    """With a row a solution, a dozen rows of three runs, the app's fit of a curve failed."""
    rows = progress_rows([(0.15, 9.0), (0.31, 7.5)], 0.55, 0.1)
    expected = [(0.15, 9.0), (0.2, 9.0), (0.3, 9.0), (0.31, 7.5), (0.4, 7.5), (0.5, 7.5)]
    assert [tuple(map(float, row)) for row in rows] == expected
    assert progress_rows([], 0.55, 0.1) == ()


def test_what_an_account_tells_is_found_again() -> None:
    account = describe_problem("a\nname = x", 300) + "Settings for the state space\n"
    assert (name_of(account), max_samples_of(account)) == ("a name = x", 300)
    assert max_samples_of(account + describe_problem("other", 400)) is None
    assert (name_of("Settings\n"), max_samples_of(describe_problem("a", None))) == (None, None)


def test_planner_arena_draws_it(log: Log, tmp_path: Path) -> None:
    python = os.environ.get("PLANNER_ARENA_PYTHON")
    if not python:
        pytest.skip("PLANNER_ARENA_PYTHON names no Python with plannerarena, best in an environment of its own")
    write_database(tmp_path / "bench.db", [log])
    command = [python, "-c", DRAW, str(tmp_path / "bench.db"), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "['runid', 'time', 'best cost'] {'cb-rrt-anytime'}\n"
    assert len(list(tmp_path.glob("*.png"))) == 8
