"""Statistics of benchmark runs, and the report made of a database."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from cbrrt_ompl.benchmark.charts import draw_boxes, draw_success
from cbrrt_ompl.benchmark.database import write_database
from cbrrt_ompl.benchmark.log import Log, PlannerLog
from cbrrt_ompl.benchmark.report import all_ratios, write_report
from cbrrt_ompl.benchmark.results import CRASH, read_experiments
from cbrrt_ompl.benchmark.statistics import (
    bootstrap_medians,
    quartiles,
    ratio_of_medians,
    wilson_interval,
)
from cbrrt_ompl.errors import InputError, UnknownPlannerError

INF = math.inf
EXACT, TIMEOUT = 6, 4
COLUMNS = (
    "graph states INTEGER", "planning time REAL", "solved BOOLEAN", "status ENUM", "time REAL",
    "trajectory duration REAL", "verified BOOLEAN", "within max samples BOOLEAN",
)  # fmt: skip


def run(time: float, nodes: int = 100, duration: float = 20.0, verified: int = 1, within: int = 1) -> tuple[str, ...]:
    """A run with an exact solution."""
    return (str(nodes), str(time), "1", str(EXACT), str(time + 0.5), str(duration), str(verified), str(within))


FAILURE = ("100", "9.0", "0", str(TIMEOUT), "9.5", "", "", "1")
CRASHED = ("", "", "0", str(CRASH), "", "", "", "")


def planner_log(name: str, *runs: tuple[str, ...]) -> PlannerLog:
    return PlannerLog(f"control_{name}", (), COLUMNS, runs)


def make_database(path: Path, *planners: PlannerLog, title: str = "Two gaps") -> Path:
    parameters = {"scenario VARCHAR(512)": title, "max_samples INTEGER": "50000"}
    write_database(path, [Log(name="gaps", parameters=parameters, time_limit="10", planners=planners)])
    return path


@pytest.mark.parametrize(
    ("successes", "runs", "low", "high"),
    [
        (8, 10, 0.4901625, 0.9433178),
        (0, 10, 0.0, 0.2775328),
        (10, 10, 0.7224672, 1.0),
        (197, 200, 0.9568343, 0.9948858),
    ],
)
def test_wilson_intervals_are_those_of_the_textbook(successes: int, runs: int, low: float, high: float) -> None:
    assert wilson_interval(successes, runs) == pytest.approx((low, high), abs=1e-6)


def test_wilson_interval_solves_its_equation() -> None:
    """Its ends are the shares from which the observed one is 1.96 standard deviations away."""
    for end in wilson_interval(37, 50):
        assert abs(37 / 50 - end) == pytest.approx(1.959964 * math.sqrt(end * (1.0 - end) / 50), rel=1e-6)


def test_quartiles_count_failures_as_infinite() -> None:
    assert quartiles(np.array([4.0, 1.0, 3.0, 2.0])) == (1.0, 2.0, 3.0)
    assert quartiles(np.array([4.0, INF, 3.0, INF])) == (3.0, 4.0, INF)
    assert quartiles(np.array([4.0, INF, INF])) == (4.0, INF, INF)


def test_quartiles_of_unknown_values_are_unknown() -> None:
    assert all(math.isnan(value) for value in quartiles(np.array([1.0, math.nan, 2.0])))


def test_bootstrap_is_repeatable_and_differs_by_name() -> None:
    values = np.random.default_rng(1).exponential(size=30)
    assert np.array_equal(bootstrap_medians(values, "a"), bootstrap_medians(values[::-1], "a"))
    assert not np.array_equal(bootstrap_medians(values, "a"), bootstrap_medians(values, "b"))


def test_bootstrap_draws_medians_as_often_as_order_statistics_say() -> None:
    """The median of three draws from 0, 1, 2 is 0 where two or three of them are: 7 of 27."""
    medians = bootstrap_medians(np.array([0.0, 1.0, 2.0]), "law", 20_000)
    assert np.mean(medians == 0.0) == pytest.approx(7.0 / 27.0, abs=0.01)
    assert np.mean(medians == 2.0) == pytest.approx(7.0 / 27.0, abs=0.01)


def test_ratio_intervals_cover_the_true_ratio_about_19_times_in_20() -> None:
    rng = np.random.default_rng(5)
    covered = 0
    for trial in range(200):
        one, other = 2.0 * rng.exponential(size=40), rng.exponential(size=40)
        medians = (bootstrap_medians(one, f"one {trial}", 500), bootstrap_medians(other, f"other {trial}", 500))
        low, high = ratio_of_medians(one, other, *medians).interval
        covered += low <= 2.0 <= high
    assert 180 <= covered <= 199


@pytest.mark.parametrize(
    ("one", "other", "ratio", "low", "high"),
    [
        ([4.0] * 5, [2.0] * 5, 2.0, 2.0, 2.0),
        ([INF] * 5, [2.0] * 5, INF, INF, INF),
        ([4.0] * 5, [INF] * 5, 0.0, 0.0, 0.0),
        ([INF] * 5, [INF] * 5, math.nan, 0.0, INF),
    ],
)
def test_ratios_with_failures_say_what_is_left_open(
    one: list[float], other: list[float], ratio: float, low: float, high: float
) -> None:
    a, b = np.array(one), np.array(other)
    found = ratio_of_medians(a, b, bootstrap_medians(a, "a"), bootstrap_medians(b, "b"))
    assert found.value == pytest.approx(ratio, nan_ok=True)
    assert found.interval == (low, high)


def test_only_verified_solutions_within_the_samples_are_successes(tmp_path: Path) -> None:
    runs = (run(1.0), run(2.0, verified=0), run(3.0, within=0), FAILURE, CRASHED)
    (experiment,) = read_experiments(make_database(tmp_path / "a.db", planner_log("rrt", *runs)))
    (one,) = experiment.series
    assert (experiment.title, experiment.max_samples, one.planner) == ("Two gaps", 50000, "rrt")
    assert one.success.tolist() == [True, False, False, False, False]
    assert one.solved.tolist() == [True, True, True, False, False]
    assert one.invalid.tolist() == [False, True, False, False, False]
    assert one.crashed.tolist() == [False, False, False, False, True]
    assert one.time.tolist() == one.time.tolist() == [1.0, INF, INF, INF, INF]
    assert one.nodes.tolist() == [100.0, INF, INF, INF, INF]


def test_a_database_without_our_columns_counts_as_it_is(tmp_path: Path) -> None:
    columns = ("graph states INTEGER", "solved BOOLEAN", "time REAL")
    log = PlannerLog("geometric_PRM", (), columns, (("7", "1", "0.25"), ("9", "0", "1.0")))
    (experiment,) = read_experiments(make_database(tmp_path / "a.db", log))
    (one,) = experiment.series
    assert one.planner == "PRM"
    assert one.time.tolist() == [0.25, INF]
    assert one.unverified.tolist() == [True, False]
    report = write_report(tmp_path / "a.db", tmp_path / "out")
    text = report.path.read_text(encoding="utf-8")
    assert "1 of 1 exact solutions were not verified" in text
    assert "| PRM | 1 of 2 | 50 % [9, 91] | 250 [250, ∞] | 7.00 [7.00, ∞] | - [-, -] |" in text


def test_planners_whose_solutions_fail_verification_are_named(tmp_path: Path) -> None:
    good, bad = planner_log("cb-rrt", run(1.0), run(2.0)), planner_log("rrt", run(1.0), run(2.0, verified=0))
    report = write_report(make_database(tmp_path / "a.db", good, bad), tmp_path / "out")
    assert report.invalid == ("rrt in Two gaps: 1 of 2 exact solutions",)
    assert "- rrt in Two gaps: 1 of 2 exact solutions\n" in report.path.read_text(encoding="utf-8")
    report = write_report(make_database(tmp_path / "b.db", good), tmp_path / "out")
    assert report.invalid == ()
    assert "All 2 exact solutions that were verified passed." in report.path.read_text(encoding="utf-8")


def test_crashes_are_named(tmp_path: Path) -> None:
    database = make_database(tmp_path / "a.db", planner_log("est", run(1.0), CRASHED, CRASHED))
    text = write_report(database, tmp_path / "out").path.read_text(encoding="utf-8")
    assert "- est in Two gaps: 2 of 3 runs" in text


def test_the_report_is_the_same_again_and_complete(tmp_path: Path) -> None:
    database = make_database(
        tmp_path / "a.db",
        planner_log("cb-rrt", *(run(t / 1000, 100 + t, 20 + t / 10) for t in range(1, 9))),
        planner_log("rrt", *(run(t / 100, 1000 + t, 30 + t / 10) for t in range(1, 7)), FAILURE, FAILURE),
    )
    write_report(database, tmp_path / "one")
    write_report(database, tmp_path / "two")
    names = {"report.html", "report.md", "summary.csv", "ratios.csv", "success_gaps.png", "boxes_gaps.png"}
    assert {path.name for path in (tmp_path / "one").iterdir()} == names
    for name in ("report.html", "report.md", "summary.csv", "ratios.csv"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
    page = (tmp_path / "one" / "report.html").read_text(encoding="utf-8")
    assert page.count('src="data:image/png;base64,') == 2 and "http" not in page
    assert '<td class="l">rrt</td><td class="r">6 of 8</td><td class="r">75 % [41, 93]</td>' in page
    text = (tmp_path / "one" / "report.md").read_text(encoding="utf-8")
    assert "](success_gaps.png)" in text and "](boxes_gaps.png)" in text
    assert "| cb-rrt | 8 of 8 | 100 % [68, 100] | 4.00 [2.00, 6.00] | 104 [102, 106] | 20.4 [20.2, 20.6] |" in text
    assert "| rrt | 6 of 8 | 75 % [41, 93] | 40.0 [20.0, 60.0] | 1,000 [1,000, 1,010] | 30.4 [30.2, 30.6] |" in text
    with open(tmp_path / "one" / "summary.csv", newline="", encoding="utf-8") as file:
        rows = {row["planner"]: row for row in csv.DictReader(file)}
    assert float(rows["rrt"]["success_rate"]) == 0.75
    assert [float(rows["rrt"][f"time_{part}"]) for part in ("q1", "median", "q3")] == [0.02, 0.04, 0.06]
    with open(tmp_path / "one" / "ratios.csv", newline="", encoding="utf-8") as file:
        ratios = {(r["measure"], r["planner"], r["reference"]): r for r in csv.DictReader(file)}
    assert len(ratios) == 3 * 2
    assert float(ratios["time", "rrt", "cb-rrt"]["ratio"]) == pytest.approx(10.0)
    assert float(ratios["time", "cb-rrt", "rrt"]["ratio"]) == pytest.approx(0.1)


def test_ratios_do_not_depend_on_the_other_planners(tmp_path: Path) -> None:
    one = planner_log("cb-rrt", *(run(t) for t in (1.0, 2.0, 3.0)))
    two = planner_log("rrt", *(run(t) for t in (3.0, 5.0, 7.0)))
    three = planner_log("est", *(run(t) for t in (2.0, 9.0)))
    few = all_ratios(read_experiments(make_database(tmp_path / "a.db", one, two))[0])
    many = all_ratios(read_experiments(make_database(tmp_path / "b.db", three, two, one))[0])
    assert few["time", "rrt", "cb-rrt"] == many["time", "rrt", "cb-rrt"]


def test_success_curves_step_at_the_planning_times(tmp_path: Path) -> None:
    from matplotlib.figure import Figure

    database = make_database(tmp_path / "a.db", planner_log("rrt", run(0.5), run(0.25), FAILURE, FAILURE))
    (experiment,) = read_experiments(database)
    ax = draw_success(Figure().subplots(), experiment.series, 10.0)
    (line,) = ax.lines
    x, y = line.get_data()
    assert list(x)[1:] == [0.25, 0.5, 10.0]
    assert list(y) == [0.0, 25.0, 50.0, 50.0]
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["rrt"]


def test_failed_runs_lie_in_the_band_of_failures(tmp_path: Path) -> None:
    from matplotlib.figure import Figure

    database = make_database(
        tmp_path / "a.db", planner_log("rrt", run(0.5), run(0.25), run(1.0), FAILURE), planner_log("est", FAILURE)
    )
    (experiment,) = read_experiments(database)
    ax = draw_boxes(Figure().subplots(), experiment.series, "time")
    dots = [line.get_xdata() for line in ax.lines if line.get_marker() == "o"]
    assert [len(x) for x in dots] == [4, 1]
    assert sorted(dots[0])[:3] == [0.25, 0.5, 1.0]
    assert max(dots[0]) == dots[1][0] > 1.0
    assert max(ax.get_xticks()) < dots[1][0]
    assert [label.get_text() for label in ax.get_yticklabels()] == ["rrt", "est"]


def test_charts_of_failures_alone_can_be_drawn(tmp_path: Path) -> None:
    database = make_database(tmp_path / "a.db", planner_log("s-rrt", FAILURE, FAILURE))
    text = write_report(database, tmp_path / "out").path.read_text(encoding="utf-8")
    assert "| s-rrt | 0 of 2 | 0 % [0, 66] | ∞ [∞, ∞] | ∞ [∞, ∞] | ∞ [∞, ∞] |" in text
    assert "There is no exact solution to verify." in text


def test_an_unknown_reference_is_told_the_known_ones(tmp_path: Path) -> None:
    database = make_database(tmp_path / "a.db", planner_log("rrt", run(1.0)))
    with pytest.raises(UnknownPlannerError, match="'est', expected one of rrt"):
        write_report(database, tmp_path / "out", "est")


def test_what_is_no_database_is_refused(tmp_path: Path) -> None:
    text = tmp_path / "text.db"
    text.write_text("not a database at all", encoding="utf-8")
    with pytest.raises(InputError, match="expected an SQLite database"):
        read_experiments(text)
    with pytest.raises(InputError, match="no such file: |cannot read "):
        read_experiments(tmp_path / "missing.db")
    empty = tmp_path / "empty.db"
    write_database(empty, [])
    with pytest.raises(InputError, match="expected a database with runs"):
        read_experiments(empty)
