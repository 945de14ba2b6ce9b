"""Sections of the reproduction that only a whole study fills, from made-up runs."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cbrrt_ompl.planners.nearest import KINDS
from cbrrt_ompl.reproduce.charts import readings_figure
from cbrrt_ompl.reproduce.claims import make_claims
from cbrrt_ompl.reproduce.measuring import Run
from cbrrt_ompl.reproduce.neighbours import SIDE, answer, build_index
from cbrrt_ompl.reproduce.outcomes import Outcomes
from cbrrt_ompl.reproduce.report import Material, make_report
from cbrrt_ompl.reproduce.scenes import CASE_1, CASE_2, OTHERS, READINGS, ROOMS
from cbrrt_ompl.reproduce.study import COMPILED, NAIVE, NEIGHBOURS, Key
from cbrrt_ompl.reproduce.verdicts import Verdict
from cbrrt_ompl.scenario.scenario import load_scenario

CB, S = COMPILED
FAST, SLOW = READINGS[0].title, READINGS[1].title


def made_up(nodes: int, time: float = 0.01, unsolved: int = 0) -> list[Run]:
    """Twenty runs of about as many nodes; the first ones failed."""
    best = {"verified": True, "duration": 20.0, "length": 10.0, "point_turns": 1}
    uses = {"speed_use": 1.0, "acceleration_use": 1.0}
    failed = [Run(seed, False, 40, 50_000, 0.5) for seed in range(unsolved)]
    return failed + [
        Run(seed, True, nodes + seed, 1000, time * (1.0 + 0.01 * seed), **best, **uses) for seed in range(unsolved, 20)
    ]


def whole_study() -> dict[Key, list[Run]]:
    """Runs for every section; S-RRT fails in Case 2, and CB-RRT at times under the second reading."""
    runs = {Key(scene, "", CB): made_up(400) for scene in (CASE_1, CASE_2, ROOMS, OTHERS[0])}
    runs |= {Key(scene, "", S): made_up(800) for scene in (CASE_1, ROOMS, OTHERS[0])}
    runs[Key(CASE_2, "", S)] = made_up(900, unsolved=20)
    for scene in (CASE_1, CASE_2):
        runs[Key(scene, "", "cb-rrt")] = made_up(400)
        runs[Key(scene, "", NAIVE)] = made_up(4000, time=0.1)
        for kind, time in zip(NEIGHBOURS, (0.01, 0.03), strict=True):
            runs[Key(scene, kind, CB)] = made_up(400, time)
    runs[Key(CASE_1, FAST, CB)] = made_up(200)
    runs[Key(CASE_1, SLOW, CB)] = made_up(800, unsolved=5)
    return runs


def section(markdown: str, heading: str) -> str:
    """The text under a heading."""
    return markdown.split(f"## {heading}\n", 1)[1].split("\n## ", 1)[0]


@pytest.fixture(scope="module")
def page() -> str:
    scenarios = {scene: load_scenario(scene) for scene in (CASE_1, CASE_2)}
    failures = {"case 1 sst": "its process crashed"}
    circumstances = "Made up."
    outcomes = Outcomes(whole_study())
    costs = {(kind, 228): [time] for kind, time in (("grid", 5e-8), ("kd-tree", 2e-7), ("brute-force", 8e-7))}
    document, _ = make_report(Material(outcomes, scenarios, costs, [], failures, circumstances, 20, 1, False))
    return document.markdown("pictures")


def row_of(table: str, first: str) -> list[str]:
    """Cells of the only row that begins with a text."""
    (line,) = [line for line in table.splitlines() if line.startswith(f"| {first}")]
    return [cell.strip() for cell in line.strip("|").split("|")]


@pytest.mark.needs_ompl
def test_readings_are_compared_in_medians_and_failures(page: str) -> None:
    table = section(page, "Readings")
    assert row_of(table, "ours")[1].startswith("409 ")
    assert row_of(table, "ours")[4] == "0 of 20 solved"
    assert row_of(table, FAST)[1:] == [row_of(table, FAST)[1], "–", "–", "–", "–"]
    assert row_of(table, FAST)[1].startswith("209 ")
    assert row_of(table, SLOW)[1].endswith("75 % solved")
    assert "readings.png" in table


@pytest.mark.needs_ompl
def test_other_scenes_are_those_that_were_run(page: str) -> None:
    table = section(page, "Other scenes")
    rows = [line for line in table.splitlines() if line.startswith("|")][2:]
    assert len(rows) == 2


@pytest.mark.needs_ompl
def test_the_naive_rrt_is_compared_with_ours(page: str) -> None:
    row = row_of(section(page, "A naive RRT in five dimensions").replace("`", ""), f"Case 1 | {NAIVE}")
    assert row[2] == "20"
    assert float(row[6].split()[0]) == pytest.approx(4009 / 409, rel=0.01)
    assert float(row[7].split()[0]) == pytest.approx(10.0, rel=0.01)


@pytest.mark.needs_ompl
def test_kinds_of_nearest_neighbours_are_compared_by_query_and_by_plan(page: str) -> None:
    tables = section(page, "k-d tree against brute force")
    assert row_of(tables, "228")[1:] == ["50.0", "200", "800", "4.00"]
    assert row_of(tables, "Case 2")[4].startswith("3")


@pytest.mark.needs_ompl
def test_runs_that_are_missing_are_named(page: str) -> None:
    assert "**Missing:** runs of case 1 sst: its process crashed." in page


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("Searching the plane with a control law", Key(CASE_1, "", NAIVE)),
        ("A k-d tree makes planning faster", Key(CASE_2, "brute-force", CB)),
    ],
)
def test_claims_about_baselines_hold_with_a_slower_one_and_fail_with_a_faster(text: str, key: Key) -> None:
    for runs, verdict in ((whole_study(), Verdict.HOLDS), (whole_study() | {key: made_up(4, 1e-4)}, Verdict.FAILS)):
        (found,) = [one for one in make_claims(Outcomes(runs), {}, []) if one.text.startswith(text)]
        assert found.verdict is verdict


def test_the_figure_of_readings_has_an_interval_a_reading_and_says_what_fails() -> None:
    nan, inf = math.nan, math.inf
    ratios = {
        "one": {"a": (2.0, 1.5, 30.0), "b": (inf, inf, inf), "c": (nan, nan, nan)},
        "two": {"a": (0.5, 0.01, 0.7), "b": (1.0, 0.9, 1.1), "c": (1.2, 1.1, 1.3)},
    }
    first, second = readings_figure(ratios).axes
    assert [text.get_text() for text in first.get_yticklabels()] == ["a", "b", "c"]
    assert [text.get_text() for text in first.texts] == ["fails"]
    assert [line.get_xydata().tolist() for line in first.lines[1:]] == [[[1.5, 0.0], [20.0, 0.0]], [[2.0, 0.0]]]
    assert len(second.lines) == 1 + 2 * 3
    assert second.lines[1].get_xdata().tolist() == [0.04, 0.7]


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_index_that_is_timed_gives_the_same_distances(kind: str) -> None:
    rng = np.random.default_rng(1)
    positions, queries = SIDE * rng.random((300, 2)), SIDE * rng.random((50, 2))
    distances = np.hypot(*(queries[:, None] - positions).transpose(2, 0, 1)).min(axis=1)  # (50,)
    index = build_index(KINDS[kind], positions)
    assert answer(index, queries, len(positions)) == pytest.approx(distances.sum(), rel=1e-12)
