"""reproduce: from nothing to the report, by way of runs that are kept."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from pathlib import Path

from cbrrt_ompl.benchmark.job import Runner
from cbrrt_ompl.benchmark.local import run_locally
from cbrrt_ompl.errors import Problem, SettingsError
from cbrrt_ompl.files import locked, write_file, write_files
from cbrrt_ompl.ompl_plugin.availability import check_ompl
from cbrrt_ompl.planners.nearest import KINDS
from cbrrt_ompl.processes import available_cores
from cbrrt_ompl.reproduce.grids import CELLS, PLACES, RULES, GridStudy, study_grids
from cbrrt_ompl.reproduce.machine import machine, versions
from cbrrt_ompl.reproduce.measuring import runs_of
from cbrrt_ompl.reproduce.neighbours import query_costs
from cbrrt_ompl.reproduce.outcomes import Outcomes
from cbrrt_ompl.reproduce.published import TREE_SIZES
from cbrrt_ompl.reproduce.report import Material, make_report
from cbrrt_ompl.reproduce.scenes import CASE_1, CASE_2
from cbrrt_ompl.reproduce.store import Store
from cbrrt_ompl.reproduce.study import Part, Series, make_study, parts_of
from cbrrt_ompl.reproduce.verdicts import Claim
from cbrrt_ompl.scenario.scenario import Scenario

RUNS_FILE = "runs.jsonl"
PICTURES = "figures"

QUERY_SIZES = (*TREE_SIZES, 10_000, 50_000)
"""Trees in which queries are timed: the published ones, and larger ones up to the number of samples."""

BRIEF_PLACES = 4
"""Places of a grid along each axis in the short report."""


@dataclass(frozen=True, eq=False)
class Reproduction:
    """What was made."""

    page: Path
    """The report as one HTML page."""
    markdown: Path
    """The report in Markdown, with its pictures in a folder beside it."""
    claims: Sequence[Claim]
    """The claims with what was measured of them."""
    runs: int
    """Runs in the report."""
    kept: int
    """Runs of them that former calls had done."""
    failures: dict[str, str]
    """Series of which runs are missing, and why."""


def reproduce(
    output: Path,
    runs: int = 200,
    jobs: int | None = None,
    *,
    brief: bool = False,
    command: str = "",
    progress: Callable[[int], None] = lambda _: None,
) -> Reproduction:
    """Measure the paper again and write the report.

    Finished runs are kept in ``output/runs.jsonl``, whatever ends the call; the same call, or one with more or fewer
    runs, takes those that were made by the same version on the same machine.

    Args:
        output: folder for the report; made where it is missing.
        runs: of each planner in each scene.
        jobs: processes at a time; None for one a core.
        brief: the paper's tables and figures with few moved gaps only.
        command: how the report was asked for, to be told in it.
        progress: called with the runs done so far, at the start and after each part; all are
            :func:`cbrrt_ompl.reproduce.study.study_size`.

    Raises:
        SettingsError: if a number makes no sense.
        OmplMissingError: if there is no OMPL.
        CbrrtError: if another process is using the folder.
        OSError: if nothing can be written there.
    """
    problems = [
        Problem(name, value, "a whole number of 1 or more")
        for name, value in (("runs", runs), ("jobs", jobs))
        if value is not None and value < 1
    ]
    if problems:
        raise SettingsError(problems)
    check_ompl("the reproduction")
    jobs = jobs or available_cores()
    (output / PICTURES).mkdir(parents=True, exist_ok=True)
    study = make_study(runs, brief)
    with locked(output, "another process is making a report there"):
        store = Store(output / RUNS_FILE)
        kept, failures = _run(study, store, partial(run_locally, jobs=jobs), progress)
        digests = {series.key: series.digest(_place()) for series in study}
        outcomes = Outcomes(
            {
                series.key: [found[seed] for seed in series.seeds if seed in found]
                for series in study
                if (found := store.runs(digests[series.key]))
            }
        )
        scenarios = {series.key.scene: series.scenario for series in reversed(study) if not series.key.variant}
        material = Material(
            outcomes=outcomes,
            scenarios={scene: scenarios[scene] for scene in (CASE_1, CASE_2)},
            costs={(kind, size): query_costs(kind, size).tolist() for kind in KINDS for size in QUERY_SIZES},
            grids=_search_grids(scenarios, BRIEF_PLACES if brief else PLACES),
            failures=failures,
            circumstances=_circumstances(command),
            runs=runs,
            jobs=jobs,
            brief=brief,
        )
        document, claims = make_report(material)
        for name, png in document.pictures.items():
            write_file(output / PICTURES / name, png)
        page, markdown = output / "report.html", output / "report.md"
        write_files({page: document.html(), markdown: document.markdown(PICTURES)})
    return Reproduction(page, markdown, claims, outcomes.total, kept, failures)


def _run(
    study: Sequence[Series], store: Store, runner: Runner[Part], progress: Callable[[int], None]
) -> tuple[int, dict[str, str]]:
    """Run what is missing; the number of runs that were there, and what went wrong by the name of the series."""
    digests = {series.key: series.digest(_place()) for series in study}
    parts: list[Part] = []
    for series in sorted(study, key=lambda series: not series.slow):  # the slow ones first
        there = store.runs(digests[series.key])
        parts += parts_of(series, tuple(seed for seed in series.seeds if seed not in there))
    kept = done = sum(series.runs for series in study) - sum(len(part.seeds) for part in parts)
    failures: dict[str, str] = {}
    progress(done)
    with closing(runner(parts)) as outcomes:  # type: ignore[type-var]
        for part, outcome in outcomes:
            if outcome.result is None:
                failures[" ".join(filter(None, part.key))] = outcome.error.partition("\n")[0]
            else:
                store.add(digests[part.key], part.key, runs_of(outcome.result))
            done += len(part.seeds)
            progress(done)
    return kept, failures


def _place() -> str:
    """What times depend on besides the scenario: machine and versions."""
    return f"{machine()} {versions()}"


def _search_grids(scenarios: dict[str, Scenario], places: int) -> list[GridStudy]:
    """Grids of all sides and rules in the paper's two cases."""
    return [
        study_grids(scene, scenarios[scene], cell, rule, places)
        for scene in (CASE_1, CASE_2)
        for cell in CELLS
        for rule in RULES
    ]


def _circumstances(command: str) -> str:
    """Command, date, machine and versions."""
    said = f"Made by `{command}` on" if command else "Made on"
    return f"{said} {datetime.now().astimezone():%Y-%m-%d at %H:%M %Z}. Machine: {machine()}. Versions: {versions()}."
