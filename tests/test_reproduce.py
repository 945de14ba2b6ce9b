"""The reproduction: the rules of its verdicts, what its runs are, and the report that it writes."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cbrrt_ompl.benchmark.local import run_locally
from cbrrt_ompl.benchmark.statistics import Interval
from cbrrt_ompl.cli import main
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import CbrrtError, SettingsError, WorldError
from cbrrt_ompl.files import locked
from cbrrt_ompl.planning import plan
from cbrrt_ompl.problem.obstacles import Bounds, Box, Disc
from cbrrt_ompl.problem.settings import Goal, State
from cbrrt_ompl.reproduce import reproduction
from cbrrt_ompl.reproduce.claims import make_claims
from cbrrt_ompl.reproduce.grids import CENTRES, WHOLE_CELLS, GridStudy, shortest_path
from cbrrt_ompl.reproduce.measuring import Run, measure, plan_naively, runs_of, uses_of_limits
from cbrrt_ompl.reproduce.outcomes import FEWEST, Outcomes, Sample
from cbrrt_ompl.reproduce.reproduction import reproduce
from cbrrt_ompl.reproduce.scenes import CASE_1, CASE_2, READINGS, ROOMS, with_gaps_moved
from cbrrt_ompl.reproduce.store import Store
from cbrrt_ompl.reproduce.study import NAIVE, Key, Part, Series, make_study, parts_of, study_size
from cbrrt_ompl.reproduce.verdicts import Answer, Claim, Verdict, above, all_of, below, inside, judge, none_of
from cbrrt_ompl.scenario.scenario import Scenario, load_scenario

YES, NO, OPEN = Answer.YES, Answer.NO, Answer.OPEN

CB, S = "cb-rrt-compiled", "s-rrt-compiled"


@pytest.mark.parametrize(
    ("low", "high", "over", "under"),
    [(2.1, 3.0, YES, NO), (1.0, 1.9, NO, YES), (1.9, 2.1, OPEN, OPEN), (0.0, math.inf, OPEN, OPEN)],
)
def test_an_interval_answers_only_if_all_of_it_lies_on_one_side(
    low: float, high: float, over: Answer, under: Answer
) -> None:
    assert above(Interval(low, high), 2.0) is over
    assert below(Interval(low, high), 2.0) is under


def test_an_interval_that_is_none_leaves_it_open() -> None:
    nothing = Interval(math.nan, math.nan)
    assert above(nothing, 1.0) is below(nothing, 1.0) is inside(nothing, 0.0, 1.0) is OPEN


@pytest.mark.parametrize(
    ("low", "high", "answer"),
    [(0.2, 0.8, YES), (0.0, 0.05, NO), (0.95, 1.0, NO), (0.05, 0.5, OPEN), (0.5, 0.95, OPEN), (0.0, 1.0, OPEN)],
)
def test_inside_needs_all_of_the_interval(low: float, high: float, answer: Answer) -> None:
    assert inside(Interval(low, high), 0.1, 0.9) is answer


def test_one_exception_refutes_all_and_none() -> None:
    assert [all_of(count, 3) for count in (3, 2, 0)] == [YES, NO, NO]
    assert [none_of(count, 3) for count in (3, 1, 0)] == [NO, NO, YES]
    assert all_of(0, 0) is none_of(0, 0) is OPEN


@pytest.mark.parametrize(
    ("in_paper", "elsewhere", "verdict"),
    [
        ([YES, YES], [YES], Verdict.HOLDS),
        ([YES], [], Verdict.HOLDS),
        ([YES], [YES, OPEN], Verdict.HOLDS_THERE),
        ([YES], [OPEN, NO, YES], Verdict.ONLY_THERE),
        ([YES, NO], [YES], Verdict.FAILS),
        ([OPEN, NO], [], Verdict.FAILS),
        ([YES, OPEN], [NO], Verdict.OPEN),
        ([], [YES], Verdict.OPEN),
    ],
)
def test_the_verdict_follows_from_the_answers(
    in_paper: list[Answer], elsewhere: list[Answer], verdict: Verdict
) -> None:
    assert judge(in_paper, elsewhere) is verdict


def made_up(nodes: float, count: int = 20, **more: Any) -> list[Run]:
    """Solved runs whose numbers scatter by some percent."""
    best: dict[str, Any] = {"verified": True, "duration": 20.0, "length": 10.0, "point_turns": 1}
    best |= {"time": 1e-5 * nodes, "speed_use": 1.0, "acceleration_use": 1.0} | more
    return [
        Run(seed, True, **{**best, "nodes": int(nodes * (0.95 + 0.005 * seed)), "samples": 1000})
        for seed in range(count)
    ]


def unsolved(count: int = 20) -> list[Run]:
    return [Run(seed, False, 40, 50_000, 0.5) for seed in range(count)]


def as_published() -> dict[Key, list[Run]]:
    """Runs as the paper reports them."""
    runs = {}
    for suffix in ("", "-compiled"):
        runs[Key(CASE_1, "", f"cb-rrt{suffix}")] = made_up(228, time=5e-3)
        runs[Key(CASE_1, "", f"s-rrt{suffix}")] = made_up(658, time=15e-3, point_turns=0, acceleration_use=40.0)
        runs[Key(CASE_2, "", f"cb-rrt{suffix}")] = made_up(1391, time=16e-3)
        runs[Key(CASE_2, "", f"s-rrt{suffix}")] = unsolved()
    return runs


def claim(text: str, runs: dict[Key, list[Run]]) -> Claim:
    """The claim that begins so."""
    (found,) = [one for one in make_claims(Outcomes(runs), {}, []) if one.text.startswith(text)]
    return found


@pytest.mark.parametrize(
    "text",
    [
        "CB-RRT solves both cases",
        "S-RRT fails in Case 2",
        "CB-RRT needs fewer nodes",
        "CB-RRT is twice as fast",
        "Case 2 is harder",
        "The published number of nodes is typical (CB-RRT",
        "The published number of nodes is typical (S-RRT",
        "CB-RRT's trajectories keep all limits",
        "S-RRT is kinematic only",
        "Point turns carry CB-RRT",
    ],
)
def test_runs_as_published_bear_the_claim_out(text: str) -> None:
    assert claim(text, as_published()).verdict is Verdict.HOLDS


@pytest.mark.parametrize(
    ("text", "key", "runs"),
    [
        ("CB-RRT solves both cases", Key(CASE_2, "", CB), unsolved()),
        ("S-RRT fails in Case 2", Key(CASE_2, "", S), made_up(900)),
        ("CB-RRT needs fewer nodes", Key(CASE_1, "", S), made_up(150)),
        ("CB-RRT is twice as fast", Key(CASE_1, "", S), made_up(658, time=8e-3)),
        ("Case 2 is harder", Key(CASE_2, "", CB), made_up(100)),
        ("The published number of nodes is typical (CB-RRT", Key(CASE_2, "", CB), made_up(4000, 100)),
        ("The published number of nodes is typical (S-RRT", Key(CASE_1, "", S), made_up(90, 100)),
        ("CB-RRT's trajectories keep all limits", Key(CASE_1, "", CB), made_up(228, verified=False)),
        ("S-RRT is kinematic only", Key(CASE_1, "", S), made_up(658)),
        ("Point turns carry CB-RRT", Key(CASE_2, "", CB), made_up(1391, point_turns=0)),
        ("CB-RRT plans in real time", Key(CASE_1, "", CB), made_up(228, time=8e-3)),
    ],
)
def test_other_runs_refute_the_claim_or_confine_it_to_the_paper(text: str, key: Key, runs: list[Run]) -> None:
    assert claim(text, {**as_published(), key: runs}).verdict is Verdict.FAILS


def test_moved_gaps_confine_a_claim_to_scenes_like_the_papers() -> None:
    moved = {Key(CASE_1, "gaps +5 cm", CB): made_up(200), Key(CASE_1, "gaps +5 cm", S): made_up(90)}
    fewer = claim("CB-RRT needs fewer nodes", {**as_published(), **moved})
    assert fewer.verdict is Verdict.ONLY_THERE
    assert [(finding.place, finding.answer) for finding in fewer.findings if not finding.in_paper] == [
        ("Case 1, gaps +5 cm", NO)
    ]


def test_a_handful_of_runs_decides_nothing_about_medians() -> None:
    few = {key: runs[: FEWEST - 1] for key, runs in as_published().items()}
    assert claim("CB-RRT needs fewer nodes", few).verdict is Verdict.OPEN
    assert Sample(Key(CASE_1, "", CB), few[Key(CASE_1, "", CB)]).median_interval("nodes") == (0.0, math.inf)


def test_a_failure_counts_as_infinite_and_so_does_an_invalid_trajectory() -> None:
    sample = Sample(Key(CASE_1, "", CB), [*made_up(100, 2), *made_up(100, 1, verified=False), *unsolved(1)])
    assert np.isinf(sample.values("nodes")).tolist() == [False, False, True, True]
    assert (sample.succeeded.count, sample.succeeded.of) == (2, 4)
    assert (sample.verified.count, sample.verified.of) == (2, 3)


def test_ten_times_is_judged_in_trees_of_the_published_sizes() -> None:
    def verdict(brute: float) -> Verdict:
        costs = {("kd-tree", 228): [1.0, 1.0], ("brute-force", 228): [brute, brute + 0.2]}
        large = {("kd-tree", 50_000): [1.0], ("brute-force", 50_000): [60.0]}
        (one,) = make_claims(Outcomes({}), costs | large, [])
        return one.verdict

    assert [verdict(brute) for brute in (9.5, 8.9, 8.0)] == [Verdict.HOLDS, Verdict.OPEN, Verdict.FAILS]


def test_one_path_on_a_grid_refutes_that_grids_cannot_be_used(gap: Scenario) -> None:
    path = shortest_path(gap, 0.1)
    assert path is not None
    claims = [make_claims(Outcomes({}), {}, [GridStudy(CASE_1, 0.1, CENTRES, 9, paths)]) for paths in ((), (path,))]
    assert [one.verdict for (one,) in claims] == [Verdict.HOLDS, Verdict.FAILS]


@pytest.fixture
def gap() -> Scenario:
    """A wall with a gap of 0.2 m straight ahead, and cells of 0.1 m and 0.2 m that fit it when they are not moved."""
    world = World(Bounds((0.0, 0.0), (4.0, 2.0)), [Box((1.9, 0.0), (2.1, 0.8)), Box((1.9, 1.0), (2.1, 2.0))])
    return Scenario(name="gap", world=world, start=State(0.5, 0.9, 0.0), goal=Goal(3.5, 0.9, 0.15))


def test_a_grid_finds_the_straight_way_and_a_robot_drives_it_without_a_stop(gap: Scenario) -> None:
    path = shortest_path(gap, 0.2)
    assert path is not None
    assert path.points.tolist() == pytest.approx(np.array([[0.5, 0.9], [3.5, 0.9]]))
    assert (path.length, len(path.turns)) == (pytest.approx(3.0), 0)
    assert path.driving_time(0.0, gap.robot.limits) == pytest.approx(3.0 / 1.0 + 1.0 / 0.6)
    assert path.driving_time(math.pi / 2, gap.robot.limits) == pytest.approx(3.0 / 1.0 + 1.0 / 0.6 + 3.0 + 1.0)


def test_whole_cells_pass_a_gap_of_their_size_only_if_they_lie_in_it(gap: Scenario) -> None:
    assert shortest_path(gap, 0.2, WHOLE_CELLS) is not None
    assert shortest_path(gap, 0.2, WHOLE_CELLS, (0.05, 0.05)) is None
    assert shortest_path(gap, 0.1, WHOLE_CELLS, (0.05, 0.05)) is not None


def test_a_path_on_a_grid_is_free_and_as_long_as_its_steps(gap: Scenario) -> None:
    path = shortest_path(replace(gap, start=State(0.5, 0.1, 0.0)), 0.1, origin=(0.03, 0.07))
    assert path is not None
    referee = gap.world.referee(gap.robot.footprint)
    for a, b in zip(path.points[:-1], path.points[1:], strict=True):
        along = np.linspace(a, b, 500)
        assert not any(referee.collides(x, y, 0.0) for x, y in along.tolist())
    steps = np.abs(np.diff(path.points, axis=0))
    octile = (np.maximum(*steps.T) + (math.sqrt(2.0) - 1.0) * np.minimum(*steps.T)).sum()
    assert path.length == pytest.approx(octile)
    assert np.degrees(np.abs(path.turns)).min() == pytest.approx(45.0)


def test_moved_gaps_keep_their_width_and_the_walls_their_ends(scenarios: Path) -> None:
    scenario = load_scenario(scenarios / f"{CASE_2}.yaml")
    moved = with_gaps_moved(scenario, 0.05)
    for before, after in zip(scenario.world.obstacles, moved.world.obstacles, strict=True):
        assert isinstance(before, Box) and isinstance(after, Box)
        for end, there in ((before.min, after.min), (before.max, after.max)):
            assert there[0] == pytest.approx(end[0] if abs(end[0]) == 5.0 else end[0] + 0.05)
            assert there[1] == end[1]
    with pytest.raises(WorldError, match="boxes only"):
        with_gaps_moved(replace(scenario, world=World(scenario.world.bounds, [Disc((0.0, 0.0), 0.1)])), 0.05)


def test_the_study_holds_both_planners_wherever_a_claim_is_tested() -> None:
    keys = [series.key for series in make_study(20)]
    assert len(set(keys)) == len(keys)
    for scene in (CASE_1, CASE_2, ROOMS):
        assert {key.planner for key in keys if key.scene == scene and not key.variant} >= {"cb-rrt", "s-rrt", CB, S}
    places = {
        (key.scene, key.variant) for key in keys if key.planner == CB and key.variant not in ("kd-tree", "brute-force")
    }
    assert places == {(key.scene, key.variant) for key in keys if key.planner == S}
    assert {reading.title for reading in READINGS} <= {key.variant for key in keys}
    assert study_size(20, brief=True) < study_size(20) < 20 * len(keys)


def test_every_run_has_a_seed_of_its_own_that_more_runs_do_not_change() -> None:
    series = make_study(3, brief=True)
    more = make_study(30, brief=True)
    assert all(one.seeds == other.seeds[:3] for one, other in zip(series, more, strict=True))
    assert len({seed for one in more for seed in one.seeds}) == study_size(30, brief=True)


def small_series(planner: str = CB, runs: int = 3) -> Series:
    return Series(Key(CASE_1, "", planner), load_scenario(CASE_1), runs)


def test_a_run_repeats_the_plan_with_its_seed() -> None:
    series = small_series()
    (part,) = parts_of(series, series.seeds)
    runs = measure(part)
    plans = [plan(series.scenario, CB, seed) for seed in series.seeds]
    assert [(run.seed, run.solved, run.nodes, run.samples) for run in runs] == [
        (made.seed, made.solved, made.nodes, made.samples) for made in plans
    ]
    assert all(run.verified for run in runs)


def test_steering_asks_for_more_acceleration_than_there_is_and_the_law_does_not(scenarios: Path) -> None:
    scenario = load_scenario(scenarios / f"{CASE_1}.yaml")
    uses = []
    for planner in (CB, S):
        trajectory = plan(scenario, planner, seed=1).trajectory
        assert trajectory is not None
        uses.append(uses_of_limits(trajectory, scenario.robot.limits))
    (speed, acceleration), (_, jump) = uses
    assert speed <= 1.0 + 1e-9 and acceleration <= 1.0 + 1e-6
    assert jump > 10.0


@pytest.mark.needs_ompl
def test_the_naive_rrt_weighs_all_components(gap: Scenario) -> None:
    crowded = replace(gap, planning=replace(gap.planning, max_samples=300))
    naive, plane = plan_naively(crowded, 1), plan(crowded, "rrt", 1)
    assert naive.samples <= 300
    assert naive.make_tree().states.tolist() != plane.tree.states.tolist()


def test_a_part_that_fails_costs_itself_alone() -> None:
    series = small_series(runs=2)
    (good,) = parts_of(series, series.seeds)
    bad = Part(Key("bad", "", CB), {"name": "no scenario"}, (1,))
    outcomes = {part.key.scene: outcome for part, outcome in run_locally([bad, good], jobs=2)}
    assert outcomes[CASE_1].result is not None
    assert [run.seed for run in runs_of(outcomes[CASE_1].result)] == list(series.seeds)
    assert outcomes["bad"].result is None
    assert outcomes["bad"].error.startswith("failed: exit code 1: scenario: bounds: missing")


def test_a_store_survives_a_line_that_was_cut_off(tmp_path: Path) -> None:
    path = tmp_path / "runs.jsonl"
    runs, key = made_up(100, 3), Key(CASE_1, "", CB)
    Store(path).add("a", key, runs)
    path.write_bytes(path.read_bytes()[:-30])
    again = Store(path)
    assert list(again.runs("a")) == [0, 1]
    again.add("a", key, runs[2:])
    assert list(Store(path).runs("a").values()) == runs
    assert Store(path).runs("b") == {}


def test_two_reports_do_not_share_a_folder(tmp_path: Path) -> None:
    with locked(tmp_path, "taken"), pytest.raises(CbrrtError, match="taken"), locked(tmp_path, "taken"):
        pass


class Page(HTMLParser):
    """Collects what a page refers to, and checks that its tags are closed in order."""

    EMPTY = ("meta", "img", "br")

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: set[str] = set()
        self.references: list[str] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.references += [value or "" for name, value in attrs if name in ("src", "href", "srcset", "data", "action")]
        if tag not in self.EMPTY:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)


def small_study(runs: int, brief: bool = False) -> Sequence[Series]:
    """The compiled planners in Case 1 and CB-RRT in OMPL: enough for a report."""
    wanted = {Key(CASE_1, "", name) for name in (CB, S, "cb-rrt")} | {Key(CASE_2, "", CB)}
    return [series for series in make_study(runs, brief=True) if series.key in wanted]


@pytest.mark.needs_ompl
@pytest.mark.slow
def test_an_interrupted_reproduction_goes_on_and_its_page_needs_no_other_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(reproduction, "make_study", small_study)
    monkeypatch.setattr(reproduction, "QUERY_SIZES", (228,))
    monkeypatch.setattr(reproduction, "PLACES", 1)
    output = tmp_path / "new" / "report"
    first = reproduce(output, runs=2, jobs=1)
    assert (first.runs, first.kept, first.failures) == (8, 0, {})
    lines = (output / "runs.jsonl").read_text(encoding="utf-8").splitlines()
    (output / "runs.jsonl").write_text("\n".join([*lines[:5], lines[5][:40]]), encoding="utf-8")  # killed here

    assert main(["reproduce", "--runs", "2", "--jobs", "1", "--output", str(output)]) == 0
    assert capsys.readouterr().out.startswith("8 runs, 5 of them kept from before\n")

    def results(text: list[str]) -> list[tuple[Any, ...]]:
        names = ("planner", "scene", "seed", "solved", "nodes", "samples", "verified", "duration")
        return sorted(tuple(json.loads(line)[name] for name in names) for line in text)

    again = (output / "runs.jsonl").read_text(encoding="utf-8").splitlines()
    assert results([*again[:5], *again[6:]]) == results(lines)

    source = (output / "report.html").read_text(encoding="utf-8")
    page = Page()
    page.feed(source)
    assert page.open == []
    assert page.tags.isdisjoint({"link", "script", "iframe", "object", "base"})
    assert page.references and all(target.startswith("data:image/png;base64,") for target in page.references)
    assert "url(" not in source and "@import" not in source
    assert "--runs 2" in "".join(page.text)
    markdown = (output / "report.md").read_text(encoding="utf-8")
    pictures = re.findall(r"!\[[^]]*\]\(([^)]+)\)", markdown)
    assert pictures and all((output / picture).is_file() for picture in pictures)
    assert len(pictures) == len(page.references)


@pytest.mark.parametrize("arguments", [{"runs": 0}, {"runs": 1, "jobs": 0}])
def test_numbers_that_make_no_sense_are_refused(tmp_path: Path, arguments: dict[str, int]) -> None:
    with pytest.raises(SettingsError, match="1 or more"):
        reproduce(tmp_path, **arguments)
    assert not list(tmp_path.iterdir())


@pytest.mark.needs_ompl
def test_the_naive_planner_is_measured_and_no_planner_of_the_package() -> None:
    (part,) = parts_of(Series(Key(CASE_1, "", NAIVE), small_scene(), 1), (7,))
    (run,) = measure(part)
    assert (run.seed, run.samples) == (7, 50)


def small_scene() -> Scenario:
    """Case 1 with few samples."""
    scenario = load_scenario(CASE_1)
    return replace(scenario, planning=replace(scenario.planning, max_samples=50))
