"""A case: some runs of one planner in one scenario, run by a process of their own."""

from __future__ import annotations

import hashlib
import json
import platform
from dataclasses import asdict, dataclass
from datetime import datetime
from functools import cached_property
from typing import Any, ClassVar

from cbrrt_ompl.benchmark.job import START_ALLOWANCE, do_job
from cbrrt_ompl.benchmark.log import Log, PlannerLog, format_log, parse_log
from cbrrt_ompl.errors import InputError, Problem

STATUSES = (
    "Unknown status", "Invalid start", "Invalid goal", "Unrecognized goal type", "Timeout", "Approximate solution",
    "Exact solution", "Crash", "Unknown status", "Unknown status",
)  # fmt: skip
"""The values of OMPL's status as its Benchmark writes them."""


@dataclass(frozen=True)
class Case:
    """Some runs of one planner in one scenario: all that it takes to repeat them."""

    experiment: str
    """Name of the experiment, one word."""
    scenario: dict[str, Any]
    """The scenario as plain values, with all its obstacles."""
    planner: str
    """The planner's name."""
    first_run: int
    """Number of the first run within the experiment."""
    seeds: tuple[int, ...]
    """Seed of each run."""
    time_limit: float
    """Time that a run may take [s]."""
    version: str
    """Version of this package."""
    law: dict[str, str] | None = None
    """Where to import the scenario's control law from, if it does not come with the package."""

    module: ClassVar[str] = "cbrrt_ompl.benchmark.case"

    @cached_property
    def name(self) -> str:
        """Name that differs where anything differs that matters for the results."""
        digest = hashlib.sha256(json.dumps(asdict(self), sort_keys=True).encode()).hexdigest()[:12]
        return f"{self.experiment}_{self.planner}_{self.first_run:04d}_{digest}"

    @property
    def patience(self) -> float:
        """Time after which the case counts as hung [s]."""
        return START_ALLOWANCE + len(self.seeds) * (2.0 * self.time_limit + 5.0)

    def check(self, result: str) -> None:
        """Refuse what is not OMPL's log of all runs.

        Raises:
            InputError: with what is missing.
        """
        check_log(parse_log(result, self.name), self)


def check_log(log: Log, case: Case) -> None:
    """Refuse a log that does not hold all runs of a case.

    Raises:
        InputError: if runs are missing.
    """
    found = sum(len(planner.runs) for planner in log.planners)
    if found != len(case.seeds):
        raise InputError(Problem("runs", found, str(len(case.seeds))), case.name)


def crash_log(case: Case, settings: tuple[str, ...] = ()) -> Log:
    """The log of a case that has none of its own: every run has failed with OMPL's status "Crash".

    Args:
        case: what crashed.
        settings: of the planner, as other cases tell them.
    """
    columns = ("seed INTEGER", "solved BOOLEAN", "status ENUM")
    crash = str(STATUSES.index("Crash"))
    runs = tuple((str(seed), "0", crash) for seed in case.seeds)
    return Log(
        name=case.experiment,
        host=platform.node() or "UNKNOWN",
        date=datetime.now().isoformat(" ", "seconds"),
        time_limit=f"{case.time_limit:g}",
        enums=(("status", *STATUSES),),
        planners=(PlannerLog(f"control_{case.planner}", settings, columns, runs),),
    )


def do_case(values: dict[str, Any]) -> str:
    """OMPL's log of a case that is run in this process.

    Args:
        values: the fields of the case.
    """
    from cbrrt_ompl.benchmark.experiment import Experiment
    from cbrrt_ompl.motion.laws import register_origin
    from cbrrt_ompl.scenario.scenario import scenario_from_dict

    case = Case(**values)
    if case.law is not None:
        register_origin(case.law)
    scenario = scenario_from_dict(case.scenario)
    return format_log(Experiment(scenario, {case.planner: case.seeds}, case.experiment).run(case.time_limit))


if __name__ == "__main__":
    do_job(do_case)
