"""A campaign: cases of all scenarios and planners, run in any order, kept, and brought together in one database."""

from __future__ import annotations

import re
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np

from cbrrt_ompl.benchmark.case import Case, check_log, crash_log
from cbrrt_ompl.benchmark.database import check_replaceable, write_database
from cbrrt_ompl.benchmark.job import Runner
from cbrrt_ompl.benchmark.local import run_locally
from cbrrt_ompl.benchmark.log import Log, format_log, merge_logs, read_log
from cbrrt_ompl.errors import InputError, Problem, SettingsError
from cbrrt_ompl.files import locked, write_file
from cbrrt_ompl.motion.laws import law_origin
from cbrrt_ompl.motion.model import check_step
from cbrrt_ompl.ompl_plugin.availability import check_ompl
from cbrrt_ompl.planners.registry import planner_named
from cbrrt_ompl.scenario.scenario import Scenario, load_scenario, scenario_to_dict

RUNS_PER_CASE = 10
"""Runs that share a process: what a crash costs, and what the start of a process is spread over."""

Progress: TypeAlias = Callable[[int], None]
"""Takes the runs done so far, those of former calls included."""


@dataclass(frozen=True)
class Campaign:
    """What to measure.

    Raises:
        InputError: with everything that makes no sense.
    """

    scenarios: Mapping[str, Scenario]
    """The scenarios by the names of their experiments."""
    planners: Sequence[str]
    """Names of the planners."""
    runs: int
    """Runs of each planner in each scenario."""
    time_limit: float
    """Time that a run may take [s]."""
    seed: int = 1
    """Seed that the seeds of all runs come from."""

    def __post_init__(self) -> None:
        """Check all values."""
        for planner in self.planners:
            planner_named(planner)
        for scenario in self.scenarios.values():
            check_step(scenario.robot, scenario.planning)
        problems = [
            Problem(name, getattr(self, name), "one or more")
            for name in ("scenarios", "planners")
            if not getattr(self, name)
        ]
        if self.runs < 1:
            problems.append(Problem("runs", self.runs, "a whole number of 1 or more"))
        if not 0.0 < self.time_limit < float("inf"):
            problems.append(Problem("time_limit", self.time_limit, "a number above 0 [s]"))
        if self.seed < 0:
            problems.append(Problem("seed", self.seed, "a whole number of 0 or more"))
        if problems:
            raise SettingsError(problems)

    @property
    def size(self) -> int:
        """Runs in all."""
        return len(self.scenarios) * len(self.planners) * self.runs

    def cases(self) -> list[Case]:
        """All cases, by scenario, planner and run."""
        from cbrrt_ompl import __version__

        cases = []
        for experiment, scenario in self.scenarios.items():
            data = scenario_to_dict(replace(scenario, map=None))  # all obstacles: a map's file may not be there
            law = law_origin(scenario.planning.law)
            for planner in self.planners:
                seeds = run_seeds(self.seed, experiment, planner, self.runs)
                for first in range(0, self.runs, RUNS_PER_CASE):
                    part = seeds[first : first + RUNS_PER_CASE]
                    cases.append(Case(experiment, data, planner, first, part, self.time_limit, __version__, law))
        return cases


class Summary(NamedTuple):
    """The outcome of a campaign."""

    runs: int
    """Runs in the database."""
    kept: int
    """Runs of them that former calls had done."""
    crashes: dict[str, str]
    """Cases without a log, and why: their runs are in the database as failures of the status "Crash"."""


def load_scenarios(paths: Iterable[Path]) -> dict[str, Scenario]:
    """Scenarios by the names of their experiments: those of the files, as one word.

    Raises:
        ScenarioError: with every mistake in a file.
        InputError: if two files have the same name.
    """
    scenarios: dict[str, Scenario] = {}
    for path in paths:
        name = re.sub(r"[^\w.-]+", "_", path.stem, flags=re.ASCII)
        if name in scenarios:
            raise InputError(Problem("SCENARIO", str(path), f"files of different names, there is a {name!r} already"))
        scenarios[name] = load_scenario(path)
    return scenarios


def run_seeds(seed: int, experiment: str, planner: str, runs: int) -> tuple[int, ...]:
    """Seeds of a planner's runs in a scenario; the first ones stay the same whatever the number of runs.

    Args:
        seed: the campaign's.
        experiment: name of the experiment.
        planner: name of the planner.
        runs: how many.
    """
    words = [zlib.crc32(name.encode()) for name in (experiment, planner)]
    return tuple(int(np.random.SeedSequence([seed, *words, run]).generate_state(1)[0] >> 1) for run in range(runs))


def run_campaign(
    campaign: Campaign,
    database: Path,
    log_dir: Path,
    runner: Runner[Case] = run_locally,
    progress: Progress = lambda _: None,
) -> Summary:
    """Run what has not been run yet, then merge the logs and make the database.

    Each finished case is a file in ``log_dir/cases``; the same call finds it there and goes on with the others. Cases
    that crashed or hung are tried again.

    Args:
        campaign: what to measure.
        database: file of the database, replaced.
        log_dir: folder that takes OMPL's logs: one an experiment, and the cases'; made where it is missing.
        runner: runs the cases.
        progress: called at the start and after each case.

    Raises:
        InputError: if the database's file is something else.
        OmplMissingError: if there is no OMPL.
        CbrrtError: if another campaign is using the folder.
        OSError: if nothing can be written there.
    """
    check_ompl("the benchmark")
    check_replaceable(database)
    case_dir = log_dir / "cases"
    case_dir.mkdir(parents=True, exist_ok=True)
    with locked(log_dir, "another campaign is using this folder"):
        cases = campaign.cases()
        finished = {case.name: log for case in cases if (log := _finished_log(case_dir, case)) is not None}
        kept = done = sum(len(case.seeds) for case in cases if case.name in finished)
        crashes: dict[str, str] = {}
        progress(done)
        waiting = [case for case in cases if case.name not in finished]
        order = np.random.default_rng(campaign.seed).permutation(len(waiting))  # the time so far tells of that to come
        with closing(runner([waiting[i] for i in order])) as outcomes:  # type: ignore[type-var]
            for case, outcome in outcomes:
                if outcome.result is None:
                    crashes[case.name] = outcome.error.partition("\n")[0]
                    write_file(case_dir / f"{case.name}.error", outcome.error)
                else:
                    write_file(case_dir / f"{case.name}.log", outcome.result)
                    (case_dir / f"{case.name}.error").unlink(missing_ok=True)
                    finished[case.name] = read_log(case_dir / f"{case.name}.log")
                done += len(case.seeds)
                progress(done)
        logs = []
        for experiment in campaign.scenarios:
            parts = _with_crashes([case for case in cases if case.experiment == experiment], finished)
            logs.append(merge_logs(parts, experiment, campaign.seed, campaign.runs))
            write_file(log_dir / f"{experiment}.log", format_log(logs[-1]))
        write_database(database, logs)
    return Summary(done, kept, crashes)


def _with_crashes(cases: Sequence[Case], finished: Mapping[str, Log]) -> list[Log]:
    """The logs of an experiment's cases, in order, with failures where there is none; a real one first."""
    settings = {case.planner: finished[case.name].planners[0].settings for case in cases if case.name in finished}
    logs = [finished.get(case.name) or crash_log(case, settings.get(case.planner, ())) for case in cases]
    real = next((finished[case.name] for case in cases if case.name in finished), None)
    return logs if real is None else [replace(real, planners=(), setup="", total_time="0"), *logs]


def _finished_log(case_dir: Path, case: Case) -> Log | None:
    """The log of a case that a former call has finished."""
    try:
        log = read_log(case_dir / f"{case.name}.log")
        check_log(log, case)
    except (FileNotFoundError, InputError):
        return None
    return log
