"""The benchmark: OMPL's harness with our planners, logs and their database, campaigns that crash and go on."""

from __future__ import annotations

import importlib.util
import json
import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from cbrrt_ompl import Scenario, load_scenario, plan
from cbrrt_ompl.benchmark import campaign as campaign_module
from cbrrt_ompl.benchmark import cluster
from cbrrt_ompl.benchmark import job as job_module
from cbrrt_ompl.benchmark.campaign import Campaign, load_scenarios, run_campaign, run_seeds
from cbrrt_ompl.benchmark.case import Case
from cbrrt_ompl.benchmark.cluster import run_on_cluster
from cbrrt_ompl.benchmark.columns import trajectory_columns
from cbrrt_ompl.benchmark.database import write_database
from cbrrt_ompl.benchmark.local import run_locally
from cbrrt_ompl.benchmark.log import Log, PlannerLog, format_log, merge_logs, parse_log, read_log
from cbrrt_ompl.cli import main
from cbrrt_ompl.errors import CbrrtError, InputError, SettingsError, UnknownPlannerError
from cbrrt_ompl.motion.model import OPEN_LOOP, STEERING
from cbrrt_ompl.ompl_plugin.availability import has_ompl
from cbrrt_ompl.planners.registry import PLANNERS

if has_ompl():
    from cbrrt_ompl.benchmark import experiment as experiment_module
    from cbrrt_ompl.benchmark.experiment import Experiment
    from cbrrt_ompl.ompl_plugin.propagators import TwoWheelPropagator
    from cbrrt_ompl.ompl_plugin.samplers import ExtensionSampler

OPEN = """
name: Open field
bounds: {min: [-2, -2], max: [2, 2]}
start: {x: -1, y: 0}
goal: {x: 1, y: 0, tolerance: 0.4}
planning: {max_samples: 3000}
"""

SMALL_LOG = """\
OMPL version 1.7.0
Experiment gaps
2 experiment properties
max_samples INTEGER = 50000
scenario VARCHAR(512) = Two gaps
Running on here
Starting at 2026-01-02 03:04:05
<<<|
space
  and control
|>>>
<<<|
cpu
|>>>
7 is the random seed
2.5 seconds per run
4096 MB per run
2 runs per planner
3.25 seconds spent to collect the data
1 enum type
status|Unknown status|Timeout|Exact solution
2 planners
control_rrt
2 common properties
goal_bias = 0.05
step = 0.1
4 properties for each run
final error REAL
graph states INTEGER
solved BOOLEAN
time REAL
2 runs
0.25; 12; 1; 0.5;~
; 90; 0; inf;~
2 progress properties for each run
best cost REAL
time REAL
2 runs
inf,0.1,;3.5,0.2,;3.5,0.2,;

.
control_est
0 common properties
2 properties for each run
solved BOOLEAN
time REAL
1 runs
1; 0.125;~
.
""".replace("~", " ")  # the spaces that OMPL leaves at the ends of lines

FAKE_CASE = """
import json, os, sys, time
from dataclasses import replace
from cbrrt_ompl.benchmark.case import Case, crash_log
from cbrrt_ompl.benchmark.log import format_log
from cbrrt_ompl.processes import die_with_parent
die_with_parent(int(sys.argv[3]))
data = json.load(sys.stdin)
case = Case(**{**data, "seeds": tuple(data["seeds"])})
if case.planner == "est":
    print("on purpose", file=sys.stderr, flush=True)
    os.abort()
time.sleep(1000 if case.planner == "pdst" else case.time_limit)
log = crash_log(case, ("goal_bias = 0.05",))
runs = tuple((str(seed), "1", "6") for seed in case.seeds)
log = replace(log, planners=(replace(log.planners[0], runs=runs),))
open(sys.argv[2], "w").write(format_log(log))
"""
"""A case that needs its time limit and says that all runs are solved; est crashes, pdst hangs."""


@pytest.fixture
def open_file(tmp_path: Path) -> Path:
    path = tmp_path / "open.yaml"
    path.write_text(OPEN, encoding="utf-8")
    return path


@pytest.fixture
def field(open_file: Path) -> Scenario:
    return load_scenario(open_file)


@pytest.fixture
def fake(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Cases of a few milliseconds, without OMPL."""
    path = tmp_path / "fake.py"
    path.write_text(FAKE_CASE, encoding="utf-8")
    monkeypatch.setattr(job_module, "COMMAND", (sys.executable, str(path)))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(path for path in sys.path if path))
    return path


def cells(log: Log) -> dict[str, list[dict[str, str]]]:
    """The runs of each planner by the name of the column."""
    return {
        planner.name.removeprefix("control_"): [
            {column.rsplit(" ", 1)[0]: cell for column, cell in zip(planner.columns, row, strict=True)}
            for row in planner.runs
        ]
        for planner in log.planners
    }


def query(database: Path, text: str) -> list[tuple[Any, ...]]:
    with closing(sqlite3.connect(database)) as connection:
        return connection.execute(text).fetchall()


def contents(database: Path) -> dict[str, tuple[list[tuple[Any, ...]], list[tuple[Any, ...]]]]:
    """Columns and rows of every table and view."""
    found = {}
    for (name,) in query(database, "SELECT name FROM sqlite_master WHERE type IN ('table', 'view')"):
        columns = query(database, f"SELECT name, type FROM pragma_table_info('{name}')")
        found[name] = (columns, query(database, f"SELECT * FROM {name}"))
    return found


# Logs and the database


def test_a_log_is_written_as_it_was_read() -> None:
    assert format_log(parse_log(SMALL_LOG)) == SMALL_LOG


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("Running on here", "Walking", r"line 6: got 'Walking', expected a line that begins with 'Running on'"),
        ("4 properties", "5 properties", r"line 33: got '0.25; 12; 1; 0.5; ', expected a line that ends with 'runs'"),
        ("0.25; 12; 1; 0.5; ", "0.25; 12; ", r"2 values in a run', expected 4, one a column"),
        (SMALL_LOG[SMALL_LOG.index("control_est") :], "", r"line 41: missing, expected the name of a planner"),
        ("2 planners", "two planners", r"line 22: got 'two', expected a number of lines"),
    ],
)
def test_a_broken_log_is_refused_with_the_line(old: str, new: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        parse_log(SMALL_LOG.replace(old, new))


def test_the_database_of_a_small_log(tmp_path: Path) -> None:
    path = tmp_path / "small.db"
    write_database(path, [parse_log(SMALL_LOG)])
    assert query(path, "SELECT * FROM experiments") == [
        (1, "gaps", 3.25, 2.5, 4096.0, 2, "OMPL 1.7.0", "here", "cpu\n", "2026-01-02 03:04:05", "7",
         "space\n  and control\n", 50000, "Two gaps"),
    ]  # fmt: skip
    assert query(path, "SELECT * FROM plannerConfigs") == [
        (1, "control_rrt", "goal_bias = 0.05\n;step = 0.1\n;"),
        (2, "control_est", ""),
    ]
    assert query(path, "SELECT * FROM enums") == [
        ("status", 0, "Unknown status"), ("status", 1, "Timeout"), ("status", 2, "Exact solution"),
    ]  # fmt: skip
    columns = "id, experimentid, plannerid, final_error, graph_states, solved, time"
    assert query(path, f"SELECT {columns} FROM runs") == [
        (1, 1, 1, 0.25, 12, 1, 0.5), (2, 1, 1, None, 90, 0, None), (3, 1, 2, None, None, 1, 0.125),
    ]  # fmt: skip
    assert query(path, "SELECT runid, time, best_cost FROM progress") == [(1, 0.1, None), (1, 0.2, 3.5)]
    assert query(path, "SELECT * FROM bestPlannerConfigsPerExperiment") == [(2, 1, 1.0, 0.125), (1, 1, 0.5, 0.5)]
    assert query(path, "SELECT * FROM bestPlannerConfigs") == [(2, 1.0, 0.125), (1, 0.5, 0.5)]


def official_database(path: Path, logs: list[Path]) -> None:
    """Run the statistics script of OMPL 2.x, named by OMPL_BENCHMARK_STATISTICS."""
    script = os.environ.get("OMPL_BENCHMARK_STATISTICS")
    if not script:
        pytest.skip("OMPL_BENCHMARK_STATISTICS does not name OMPL's script (py-bindings/ompl/_benchmark_statistics.py)")
    spec = importlib.util.spec_from_file_location("official_statistics", script)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.readBenchmarkLog(str(path), [str(log) for log in logs], False)
    module.computeViews(str(path), False)


@pytest.mark.filterwarnings("ignore::ResourceWarning")  # the script leaves its connections to the collector
def test_the_official_script_makes_the_same_database_of_a_small_log(tmp_path: Path) -> None:
    (tmp_path / "small.log").write_text(SMALL_LOG, encoding="utf-8")
    official_database(tmp_path / "official.db", [tmp_path / "small.log"])
    write_database(tmp_path / "ours.db", [parse_log(SMALL_LOG)])
    assert contents(tmp_path / "ours.db") == contents(tmp_path / "official.db")


@pytest.mark.needs_ompl
@pytest.mark.filterwarnings("ignore::ResourceWarning")  # the script leaves its connections to the collector
def test_the_official_script_makes_the_same_database_of_our_logs(tmp_path: Path, field: Scenario) -> None:
    log = Experiment(field, {"cb-rrt": [1, 2], "rrt": [1, 2]}, "open").run(5.0)
    logs = [replace(log, name=name) for name in ("one", "two")]
    for part in logs:
        (tmp_path / f"{part.name}.log").write_text(format_log(part), encoding="utf-8")
    official_database(tmp_path / "official.db", [tmp_path / "one.log", tmp_path / "two.log"])
    write_database(tmp_path / "ours.db", logs)
    ours = contents(tmp_path / "ours.db")
    assert ours == contents(tmp_path / "official.db")
    assert len(ours["runs"][1]) == 8


def test_merged_parts_are_one_experiment_with_all_columns() -> None:
    first = parse_log(SMALL_LOG)
    rrt = first.planners[0]
    second = replace(
        first, host="there", date="2026-01-01 00:00:00", total_time="1", cpu="other\n",
        planners=(PlannerLog(rrt.name, rrt.settings, ("solved BOOLEAN", "extra REAL"), (("1", "2.5"),)),),
    )  # fmt: skip
    merged = merge_logs([first, second], "all", seed=3, run_count=3)
    assert (merged.name, merged.seed, merged.run_count, merged.total_time) == ("all", "3", "3", "4.25")
    assert (merged.host, merged.date, merged.cpu) == ("here,there", "2026-01-01 00:00:00", "cpu\n\nother\n")
    assert [planner.name for planner in merged.planners] == ["control_rrt", "control_est"]
    columns = ("extra REAL", "final error REAL", "graph states INTEGER", "solved BOOLEAN", "time REAL")
    assert merged.planners[0].columns == columns
    assert merged.planners[0].runs[0] == ("", "0.25", "12", "1", "0.5")
    assert merged.planners[0].runs[2] == ("2.5", "", "", "1", "")
    assert parse_log(format_log(merged)) == merged


def test_a_database_replaces_nothing_but_a_database(tmp_path: Path) -> None:
    path = tmp_path / "notes.db"
    path.write_text("years of work", encoding="utf-8")
    with pytest.raises(InputError, match="expected an SQLite database"):
        write_database(path, [parse_log(SMALL_LOG)])
    assert path.read_text(encoding="utf-8") == "years of work"
    path.unlink()
    for _ in range(2):
        write_database(path, [parse_log(SMALL_LOG)])
        assert query(path, "SELECT COUNT(*) FROM runs") == [(3,)]
    assert list(tmp_path.iterdir()) == [path]


# OMPL's Benchmark


@pytest.mark.needs_ompl
@pytest.mark.slow
def test_no_planner_runs_with_the_sampler_or_the_model_of_another(
    field: Scenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Syclop's RRT allocates its sampler at its set-up, when the space information may still have another's."""
    monkeypatch.setattr(experiment_module, "plan", lambda *_, **__: None)  # leaves the warming up out
    field = replace(field, planning=replace(field.planning, closed_loop=False))  # for all of them to share a space
    experiment = Experiment(field, {name: [1] for name in PLANNERS}, "open")
    sampled: dict[str, int] = defaultdict(int)
    laws: dict[str, set[int]] = defaultdict(set)
    sample, propagate = ExtensionSampler.sampleTo, TwoWheelPropagator.propagate

    def counting_sample(self: Any, *arguments: Any) -> int:
        sampled[experiment._active.getName()] += 1
        return sample(self, *arguments)

    def noting_propagate(self: Any, *arguments: Any) -> None:
        laws[experiment._active.getName()].add(int(self.model["law"][0]))
        propagate(self, *arguments)

    monkeypatch.setattr(ExtensionSampler, "sampleTo", counting_sample)
    monkeypatch.setattr(TwoWheelPropagator, "propagate", noting_propagate)
    runs = cells(experiment.run(2.0))
    assert list(runs) == list(PLANNERS)
    assert sampled == {name: int(runs[name][0]["samples"]) for name in ("cb-rrt", "s-rrt")}
    for name in PLANNERS:
        expected = {STEERING} if name.startswith("s-rrt") else {OPEN_LOOP}
        assert laws[name] == expected if runs[name][0]["solved"] == "1" else laws[name] <= expected, name
    assert all(laws[name] for name in PLANNERS if not name.startswith(("cb-rrt", "s-rrt")))


@pytest.mark.needs_ompl
@pytest.mark.slow
def test_every_run_repeats_the_plan_with_its_seed(field: Scenario) -> None:
    seeds = (5, 3)
    names = [name for name, row in PLANNERS.items() if not row.is_anytime]  # the others go on
    names.remove("syclop-est")  # a second to set up, and as syclop-rrt
    field = replace(field, planning=replace(field.planning, closed_loop=False))  # for all of them to share a space
    log = Experiment(field, {name: seeds for name in names}, "open").run(10.0)
    for name, runs in cells(log).items():
        for seed, run in zip(seeds, runs, strict=True):
            result = plan(field, name, seed, 10.0)
            found = (run["seed"], run["solved"] == "1", int(run["graph states"]), int(run["samples"]))
            assert found == (str(seed), result.solved, result.nodes, result.samples), name
            if result.trajectory is not None:
                assert float(run["trajectory duration"]) == pytest.approx(result.trajectory.duration), name
                assert run["verified"] == "1", name


@pytest.mark.needs_ompl
@pytest.mark.parametrize("planner", ["cb-rrt", "cb-rrt-compiled", "rrt"])
def test_samples_end_a_run_before_its_time(field: Scenario, planner: str) -> None:
    unreachable = replace(
        field, goal=replace(field.goal, tolerance=1e-9), planning=replace(field.planning, max_samples=200)
    )
    began = time.monotonic()
    ((run,),) = cells(Experiment(unreachable, {planner: [1]}).run(60.0)).values()
    assert time.monotonic() - began < 30.0
    assert (run["solved"], run["samples"], run["within max samples"]) == ("0", "200", "1")
    assert 0 < int(run["extension attempts"]) <= 200
    assert run["trajectory duration"] == run["verified"] == ""


@pytest.mark.needs_ompl
def test_time_ends_a_run(field: Scenario) -> None:
    unreachable = replace(
        field, goal=replace(field.goal, tolerance=1e-9), planning=replace(field.planning, max_samples=10**9)
    )
    ((run,),) = cells(Experiment(unreachable, {"rrt": [1]}).run(0.3)).values()
    assert run["solved"] == "0"
    assert 0.3 <= float(run["planning time"]) < 0.4
    assert float(run["planning time"]) <= float(run["time"])


@pytest.mark.needs_ompl
def test_settings_are_those_of_the_planners_themselves(field: Scenario) -> None:
    biased = replace(field, planning=replace(field.planning, goal_bias=0.25))
    log = Experiment(biased, {"cb-rrt": [1], "kpiece1": [1]}).run(2.0)
    assert "goal_bias = 0.25" in log.planners[0].settings
    assert "border_fraction = 0.8" in log.planners[1].settings
    assert "Planner kpiece1 specs" in log.setup
    assert log.setup.startswith("Scenario: Open field\nSamples of a run at most: 3000\n")


@pytest.mark.needs_ompl
def test_closed_loop_is_benchmarked_alone(field: Scenario) -> None:
    closed = replace(field, planning=replace(field.planning, closed_loop=True))
    with pytest.raises(SettingsError, match="controls of cb-rrt are references.*set planning.closed_loop to False"):
        Experiment(closed, {"cb-rrt": [1], "rrt": [1]})
    log = Experiment(closed, {"cb-rrt": [1], "cb-rrt-compiled": [1]}).run(5.0)
    assert [run["verified"] for runs in cells(log).values() for run in runs] == ["1", "1"]


@pytest.mark.needs_ompl
def test_planners_that_are_unknown_or_uneven_are_refused(field: Scenario) -> None:
    with pytest.raises(UnknownPlannerError, match="'rtt'"):
        Experiment(field, {"rtt": [1]})
    with pytest.raises(InputError, match="as many runs for all"):
        Experiment(field, {"rrt": [1], "est": [1, 2]})


def test_columns_of_a_trajectory_tell_the_errors_of_its_last_state(field: Scenario) -> None:
    trajectory = plan(field, "cb-rrt-compiled", seed=1).trajectory
    assert trajectory is not None
    facing = replace(field, goal=replace(field.goal, theta=trajectory.theta[-1] + 0.25, heading_tolerance=0.3))
    columns = trajectory_columns(trajectory, facing)
    assert float(columns["final heading error REAL"]) == pytest.approx(0.25)
    assert float(columns["final speed error REAL"]) == abs(trajectory.v[-1])
    assert float(columns["final turning rate error REAL"]) == abs(trajectory.omega[-1])
    assert int(columns["point turns INTEGER"]) == len(trajectory.point_turns)
    assert columns["verified BOOLEAN"] == "1"
    assert trajectory_columns(trajectory, field)["final heading error REAL"] == ""
    elsewhere = replace(field, goal=replace(field.goal, x=-1.5))
    assert trajectory_columns(trajectory, elsewhere)["verified BOOLEAN"] == "0"


# Campaigns


def test_seeds_of_runs_differ_and_do_not_depend_on_their_number() -> None:
    few, many = run_seeds(1, "maze", "rrt", 5), run_seeds(1, "maze", "rrt", 50)
    assert few == many[:5]
    others = [run_seeds(2, "maze", "rrt", 50), run_seeds(1, "gaps", "rrt", 50), run_seeds(1, "maze", "est", 50)]
    assert len({*many, *(seed for seeds in others for seed in seeds)}) == 200


def campaign_of(field: Scenario, planners: tuple[str, ...] = ("rrt", "sst"), runs: int = 4, **more: Any) -> Campaign:
    return Campaign({"one": field, "two": field}, planners, runs, more.pop("time_limit", 0.01), **more)


@pytest.mark.needs_ompl
def test_a_campaign_is_one_experiment_a_scenario(field: Scenario, fake: Path, tmp_path: Path) -> None:
    summary = run_campaign(campaign_of(field), tmp_path / "a.db", tmp_path / "logs", partial(run_locally, jobs=2))
    assert (summary.runs, summary.kept, summary.crashes) == (16, 0, {})
    assert query(tmp_path / "a.db", "SELECT name, runcount, seed FROM experiments") == [
        ("one", 4, "1"),
        ("two", 4, "1"),
    ]
    assert query(tmp_path / "a.db", "SELECT COUNT(*) FROM runs GROUP BY experimentid, plannerid") == [(4,)] * 4
    assert query(tmp_path / "a.db", "SELECT name FROM plannerConfigs") == [("control_rrt",), ("control_sst",)]
    again = tmp_path / "again.db"
    write_database(again, [read_log(tmp_path / "logs" / f"{name}.log") for name in ("one", "two")])
    assert contents(again) == contents(tmp_path / "a.db")


@pytest.mark.needs_ompl
def test_finished_cases_are_kept_and_only_changed_ones_run(
    field: Scenario, fake: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(campaign_module, "RUNS_PER_CASE", 2)
    ran: list[Case] = []

    def runner(cases: Any) -> Iterator[Any]:
        ran[:] = cases
        return run_locally(cases, jobs=2)

    def repeat(campaign: Campaign) -> tuple[int, int, int]:
        summary = run_campaign(campaign, tmp_path / "a.db", tmp_path / "logs", runner)
        return len(ran), summary.runs, summary.kept

    def campaign(planners: tuple[str, ...] = ("rrt",), scenario: Scenario = field, **more: Any) -> Campaign:
        return Campaign({"one": scenario}, planners, **{"runs": 4, "time_limit": 0.01, **more})

    assert repeat(campaign()) == (2, 4, 0)
    assert repeat(campaign()) == (0, 4, 4)
    assert repeat(campaign(runs=5)) == (1, 5, 4)
    assert repeat(campaign(planners=("rrt", "sst"))) == (2, 8, 4)
    assert repeat(campaign(seed=2)) == (2, 4, 0)
    assert repeat(campaign(time_limit=0.02)) == (2, 4, 0)
    assert repeat(campaign(scenario=replace(field, name="other"))) == (2, 4, 0)
    (tmp_path / "logs" / "cases" / f"{campaign().cases()[0].name}.log").write_text("half a l", encoding="utf-8")
    assert repeat(campaign()) == (1, 4, 2)


@pytest.mark.needs_ompl
def test_a_crash_or_a_hang_costs_its_case_alone(field: Scenario, fake: Path, tmp_path: Path) -> None:
    campaign = campaign_of(field, planners=("rrt", "est", "pdst"))
    runner = partial(run_locally, jobs=3, patience=2.0)
    seen: list[int] = []
    summary = run_campaign(campaign, tmp_path / "a.db", tmp_path / "logs", runner, seen.append)
    assert seen == [0, 4, 8, 12, 16, 20, 24]
    reasons = {name.split("_")[1]: reason for name, reason in summary.crashes.items()}
    assert reasons == {"est": "crashed: SIGABRT", "pdst": "hung: killed after 2 s"}
    assert len(summary.crashes) == 4
    failed = "SELECT plannerConfigs.name, COUNT(*) FROM runs JOIN plannerConfigs ON plannerConfigs.id = plannerid"
    assert dict(query(tmp_path / "a.db", f"{failed} WHERE status = 7 AND solved = 0 GROUP BY plannerid")) == {
        "control_est": 8, "control_pdst": 8,
    }  # fmt: skip
    assert dict(query(tmp_path / "a.db", f"{failed} WHERE solved = 1 GROUP BY plannerid")) == {"control_rrt": 8}
    errors = [path.read_text(encoding="utf-8") for path in (tmp_path / "logs" / "cases").glob("*_est_*.error")]
    assert len(errors) == 2
    assert all("on purpose" in error for error in errors)
    fake.write_text(FAKE_CASE.replace('"est"', '"none"').replace('"pdst"', '"none"'), encoding="utf-8")
    repaired = run_campaign(campaign, tmp_path / "a.db", tmp_path / "logs", runner)
    assert (repaired.runs, repaired.kept, repaired.crashes) == (24, 8, {})
    assert query(tmp_path / "a.db", "SELECT COUNT(*), SUM(solved) FROM runs") == [(24, 24)]
    assert not list((tmp_path / "logs" / "cases").glob("*.error"))


CAMPAIGN_CODE = """
import sys
from cbrrt_ompl.benchmark import campaign, job
from cbrrt_ompl.cli import main
job.COMMAND = (sys.executable, {fake!r})
campaign.RUNS_PER_CASE = 1
sys.exit(main(["bench", {scenario!r}, "--planner", *"rrt sst".split(), "--runs", "8", "--time-limit", "0.2",
               "--database", "a.db", "--log-dir", "logs", "--jobs", "2"]))
"""


def start_campaign(fake: Path, scenario: Path, folder: Path) -> subprocess.Popen[str]:
    """A campaign of 16 fake cases, in a process of its own."""
    code = CAMPAIGN_CODE.format(fake=str(fake), scenario=str(scenario))
    streams: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([sys.executable, "-c", code], cwd=folder, **streams)


def wait_until(condition: Callable[[], bool], seconds: float = 30.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)


def children_of(script: Path) -> list[str]:
    """Processes that run a script."""
    running = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            arguments = path.read_bytes().split(b"\0")
        except OSError:
            continue
        if str(script).encode() in arguments:
            running.append(path.parent.name)
    return running


@pytest.mark.needs_ompl
@pytest.mark.slow
def test_a_killed_campaign_goes_on_where_it_stopped(fake: Path, open_file: Path, tmp_path: Path) -> None:
    cases = tmp_path / "logs" / "cases"
    with start_campaign(fake, open_file, tmp_path) as process:
        wait_until(lambda: len(list(cases.glob("*.log"))) >= 6)
        process.send_signal(signal.SIGKILL)
        process.communicate(timeout=30)
    wait_until(lambda: not children_of(fake), 5.0)
    assert not (tmp_path / "a.db").exists()
    before = {path.name: path.stat().st_mtime_ns for path in cases.glob("*.log")}
    assert 6 <= len(before) < 16
    with start_campaign(fake, open_file, tmp_path) as process:
        out, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (0, "")
    assert f"16 runs of 2 planners in 1 scenario, {len(before)} of them kept from before" in out
    assert query(tmp_path / "a.db", "SELECT COUNT(*), COUNT(DISTINCT seed), SUM(solved) FROM runs") == [(16, 16, 16)]
    after = {path.name: path.stat().st_mtime_ns for path in cases.glob("*.log")}
    assert {name: after[name] for name in before} == before


@pytest.mark.needs_ompl
@pytest.mark.slow
def test_control_c_ends_a_campaign_and_its_processes(fake: Path, open_file: Path, tmp_path: Path) -> None:
    with start_campaign(fake, open_file, tmp_path) as process:
        wait_until(lambda: len(list((tmp_path / "logs" / "cases").glob("*.log"))) >= 2)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=30)
    assert (process.returncode, out, err) == (130, "", "cbrrt: interrupted\n")
    assert not children_of(fake)


@pytest.mark.needs_ompl
def test_two_campaigns_do_not_share_a_folder(field: Scenario, fake: Path, tmp_path: Path) -> None:
    def runner(cases: Any) -> Iterator[Any]:
        with pytest.raises(CbrrtError, match="another campaign is using this folder"):
            run_campaign(campaign_of(field), tmp_path / "b.db", tmp_path / "logs")
        return run_locally(cases, jobs=2)

    assert run_campaign(campaign_of(field), tmp_path / "a.db", tmp_path / "logs", runner).runs == 16


def test_a_case_takes_the_obstacles_of_its_map_along(tmp_path: Path) -> None:
    (tmp_path / "grid.map").write_text(
        "type octile\nheight 4\nwidth 4\nmap\n....\n.@@.\n....\n....\n", encoding="utf-8"
    )
    path = tmp_path / "mapped.yaml"
    path.write_text(
        "name: mapped\nmap: {file: grid.map, resolution: 1.0}\nstart: {x: 0.5, y: 0.5}\ngoal: {x: 3.5, y: 3.5}\n"
    )
    scenarios = load_scenarios([path])
    (case,) = Campaign(scenarios, ["rrt"], 1, 1.0).cases()
    assert "map" not in case.scenario
    assert len(case.scenario["obstacles"]) == len(scenarios["mapped"].world.obstacles) > 0


@pytest.mark.needs_ompl
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # what a cluster warns of when one of its workers is shot is not ours
def test_a_cluster_finishes_although_a_worker_is_killed(
    field: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    distributed = pytest.importorskip("distributed", reason="the extra 'distributed' is not installed")
    monkeypatch.setattr(campaign_module, "RUNS_PER_CASE", 1)
    campaign = Campaign({"open": field}, ["rrt"], 3, 5.0)
    killed: list[int] = []
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as workers,
        distributed.Client(workers) as client,
    ):

        def kill_one(done: int) -> None:
            if done == 1:
                killed.append(next(iter(client.run(os.getpid).values())))
                os.kill(killed[0], signal.SIGKILL)

        runner = partial(run_on_cluster, address=workers.scheduler_address)
        summary = run_campaign(campaign, tmp_path / "a.db", tmp_path / "logs", runner, kill_one)
    assert len(killed) == 1
    assert (summary.runs, summary.crashes) == (3, {})
    rows = query(tmp_path / "a.db", "SELECT seed, solved, verified FROM runs ORDER BY id")
    assert rows == [(seed, 1, 1) for seed in run_seeds(1, "open", "rrt", 3)]


def test_without_dask_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(CbrrtError, match=r"pip install 'cbrrt-ompl\[distributed\]'"):
        next(run_on_cluster([], "local"))


# The command line


@pytest.mark.needs_ompl
@pytest.mark.slow
def test_bench_and_report_from_the_command_line(
    open_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    database, logs, output = tmp_path / "a.db", tmp_path / "logs", tmp_path / "report"
    arguments = ["--planner", "cb-rrt", "rrt", "--runs", "2", "--time-limit", "5", "--jobs", "2"]
    assert main(["bench", str(open_file), *arguments, "--database", str(database), "--log-dir", str(logs)]) == 0
    captured = capsys.readouterr()
    assert captured.out.startswith("4 runs of 2 planners in 1 scenario\n")
    assert captured.err == ""
    assert query(database, "SELECT solved, verified, within_max_samples FROM runs") == [(1, 1, 1)] * 4
    for planner, seed, nodes in query(
        database, "SELECT name, seed, graph_states FROM runs JOIN plannerConfigs ON plannerConfigs.id = plannerid"
    ):
        assert plan(load_scenario(open_file), planner.removeprefix("control_"), seed).nodes == nodes
    assert main(["report", str(database), "--output", str(output)]) == 0
    header, columns, *rows, page, path = capsys.readouterr().out.splitlines()
    assert (header, page, path) == ("open, medians", str(output / "report.html"), str(output / "report.md"))
    assert [row.split()[:4] for row in rows] == [[planner, "2", "of", "2"] for planner in ("cb-rrt", "rrt")]
    assert {len(line) for line in (columns, *rows)} <= set(range(81))
    assert main(["report", str(database), "--output", str(output), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert [(row["planner"], row["successes"]) for row in printed["summary"]] == [("cb-rrt", 2), ("rrt", 2)]
    assert "| rrt | 2 of 2 |" in (output / "report.md").read_text(encoding="utf-8")


def error_line(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """The one line of a failing command."""
    try:
        code = main(arguments)
    except SystemExit as error:
        code = int(str(error.code))
    captured = capsys.readouterr()
    assert (code, captured.out) == (2, "")
    (line,) = captured.err.splitlines()
    return line.removeprefix("cbrrt: error: ")


@pytest.mark.needs_ompl
def test_bad_arguments_are_one_line(
    open_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    (tmp_path / "notes.db").write_text("years of work", encoding="utf-8")
    (tmp_path / "twin").mkdir()
    twin = tmp_path / "twin" / "open.yaml"
    twin.write_text(OPEN, encoding="utf-8")
    monkeypatch.setattr(cluster, "CONNECT_TIMEOUT", 0.2)
    good = {"--database": str(tmp_path / "a.db"), "--log-dir": str(tmp_path / "logs"), "--planner": "rrt"}
    for more, message in (
        ({"--runs": "0"}, "--runs: got '0', expected a whole number of 1 or more"),
        ({"--jobs": "two"}, "--jobs: got 'two', expected a whole number of 1 or more"),
        ({"--time-limit": "0"}, "--time-limit: got '0', expected a number of seconds above 0"),
        ({"--planner": "rtt"}, "planner: got 'rtt', expected one of cb-rrt, "),
        ({"--database": str(tmp_path / "missing" / "a.db")}, "--database: "),
        ({"--database": str(tmp_path / "a.txt")}, "--database: "),
        ({"--database": str(tmp_path / "notes.db")}, f"{tmp_path / 'notes.db'}: got "),
        ({"--log-dir": str(tmp_path / "file")}, f"{tmp_path / 'file'}"),
        ({"--log-dir": str(tmp_path / "file" / "logs")}, f"{tmp_path / 'file'}"),
    ):
        options = [text for option in {**good, **more}.items() for text in option]
        assert error_line(capsys, "bench", str(open_file), *options).startswith(message)
    options = [text for option in good.items() for text in option]
    assert "a 'open' already" not in error_line(capsys, "bench", str(tmp_path / "none.yaml"), *options)
    assert "there is a 'open' already" in error_line(capsys, "bench", str(open_file), str(twin), *options)
    assert "--database" in error_line(capsys, "bench", str(open_file), "--log-dir", "logs")
    none = tmp_path / "none.db"
    assert error_line(capsys, "report", str(none)).endswith(f"no such file: {none}")
    assert not (tmp_path / "a.db").exists()


@pytest.mark.needs_ompl
def test_a_scheduler_that_is_not_there_is_one_line(
    open_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("distributed", reason="the extra 'distributed' is not installed")
    monkeypatch.setattr(cluster, "CONNECT_TIMEOUT", 0.3)
    outputs = ["--database", str(tmp_path / "a.db"), "--log-dir", str(tmp_path / "logs")]
    line = error_line(capsys, "bench", str(open_file), *outputs, "--scheduler", "tcp://127.0.0.1:9")
    assert line.startswith("no scheduler at tcp://127.0.0.1:9: ")


@pytest.mark.needs_ompl
def test_progress_has_the_runs_and_the_time_left_on_a_terminal(
    field: Scenario, fake: Path, tmp_path: Path, open_file: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setattr(campaign_module, "RUNS_PER_CASE", 1)
    options = ["--planner", "rrt", "--runs", "6", "--time-limit", "0.1", "--jobs", "1"]
    outputs = ["--database", str(tmp_path / "a.db"), "--log-dir", str(tmp_path / "logs")]
    assert main(["bench", str(open_file), *options, *outputs]) == 0
    err = capsys.readouterr().err
    assert "0/6" in err
    assert "6/6" in err
    assert "<00:0" in err
