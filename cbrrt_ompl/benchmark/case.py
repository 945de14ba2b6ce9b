"""A case: some runs of one planner in one scenario, run by a process of their own."""

from __future__ import annotations

import ctypes
import hashlib
import json
import os
import platform
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import Any

from cbrrt_ompl.benchmark.log import Log, PlannerLog, format_log, parse_log
from cbrrt_ompl.errors import InputError, Problem

COMMAND = (sys.executable, "-m", "cbrrt_ompl.benchmark.case")
"""Runs the case on its standard input; takes the name of the log file and the number of the process that waits."""

START_ALLOWANCE = 180.0
"""Time that a process may take to start and to compile before it counts as hung [s]."""

STATUSES = (
    "Unknown status", "Invalid start", "Invalid goal", "Unrecognized goal type", "Timeout", "Approximate solution",
    "Exact solution", "Crash", "Unknown status", "Unknown status",
)  # fmt: skip
"""The values of OMPL's status as its Benchmark writes them."""

_PR_SET_PDEATHSIG = 1


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

    @cached_property
    def name(self) -> str:
        """Name that differs where anything differs that matters for the results."""
        digest = hashlib.sha256(json.dumps(asdict(self), sort_keys=True).encode()).hexdigest()[:12]
        return f"{self.experiment}_{self.planner}_{self.first_run:04d}_{digest}"

    @property
    def patience(self) -> float:
        """Time after which the case counts as hung [s]."""
        return START_ALLOWANCE + len(self.seeds) * (2.0 * self.time_limit + 5.0)


@dataclass(frozen=True)
class Outcome:
    """What came of a case: a log, or the reason why there is none."""

    log: str | None = None
    """OMPL's log."""
    error: str = ""
    """Why there is no log: one line, then what the process wrote."""


def execute(case: Case, patience: float | None = None, started: Callable[[Any], None] = lambda _: None) -> Outcome:
    """Run a case in a process of its own and wait for it.

    Args:
        case: what to run.
        patience: time after which it counts as hung and is killed [s]; the case's own if None.
        started: takes the process when it runs.
    """
    patience = case.patience if patience is None else patience
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    with tempfile.TemporaryDirectory(prefix="cbrrt_bench_") as folder:
        path = Path(folder, "benchmark.log")
        with subprocess.Popen(
            [*COMMAND, str(path), str(os.getpid())],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
            env={**os.environ, **threads},
            start_new_session=True,
        ) as process:
            started(process)
            try:
                _, said = process.communicate(json.dumps(asdict(case)), timeout=patience)
            except subprocess.TimeoutExpired:
                process.kill()
                _, said = process.communicate()
                return Outcome(error=f"hung: killed after {patience:g} s\n{said}")
        if process.returncode != 0:
            return Outcome(error=f"{_cause(process.returncode)}\n{said}")
        try:
            log = path.read_text(encoding="utf-8")
            check_log(parse_log(log, case.name), case)
        except (OSError, InputError) as error:
            return Outcome(error=f"no complete log: {error}\n{said}")
        return Outcome(log)


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


def main() -> None:
    """Run the case on the standard input."""
    die_with_parent(int(sys.argv[2]))
    case = Case(**json.load(sys.stdin))
    from cbrrt_ompl.benchmark.experiment import Experiment
    from cbrrt_ompl.motion.laws import register_origin
    from cbrrt_ompl.scenario.scenario import scenario_from_dict

    if case.law is not None:
        register_origin(case.law)
    scenario = scenario_from_dict(case.scenario)
    log = Experiment(scenario, {case.planner: case.seeds}, case.experiment).run(case.time_limit)
    Path(sys.argv[1]).write_text(format_log(log), encoding="utf-8")


def die_with_parent(parent: int) -> None:
    """Have the kernel kill this process as soon as the one that waits for it has ended, whatever ended it.

    Args:
        parent: number of the process that waits.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:
            os.kill(os.getpid(), signal.SIGKILL)


def _cause(returncode: int) -> str:
    """Why a process ended."""
    if returncode < 0:
        return f"crashed: {signal.Signals(-returncode).name}"
    return f"failed: exit code {returncode}"


if __name__ == "__main__":
    main()
