"""A job: runs that are measured together, in a process of their own that may crash or hang."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar, Protocol, TypeAlias, TypeVar

from cbrrt_ompl.errors import InputError
from cbrrt_ompl.processes import die_with_parent

COMMAND = (sys.executable, "-m")
"""Runs the module of a job; takes its name, the file for the result and the number of the process that waits."""

START_ALLOWANCE = 180.0
"""Time that a process may take to start and to compile before it counts as hung [s]."""


class Job(Protocol):
    """A dataclass of plain values: all that it takes to repeat the runs."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def module(self) -> str:
        """What does it, by :func:`do_job`."""
        ...

    @property
    def name(self) -> str:
        """Different for different jobs."""
        ...

    @property
    def seeds(self) -> tuple[int, ...]:
        """One a run."""
        ...

    @property
    def patience(self) -> float:
        """Time after which it counts as hung [s]."""
        ...

    def check(self, result: str) -> None:
        """Refuse a result that is not whole.

        Raises:
            InputError: with what is missing.
        """
        ...


J = TypeVar("J", bound=Job)


@dataclass(frozen=True)
class Outcome:
    """The outcome of a job: a result, or the reason why there is none."""

    result: str | None = None
    """What the job wrote."""
    error: str = ""
    """Why there is none: one line, then what the process wrote."""


Runner: TypeAlias = Callable[[Sequence[J]], Iterator[tuple[J, Outcome]]]
"""Runs jobs somewhere and gives each with its outcome when it is done; closing the iterator stops all."""


def execute(job: Job, patience: float | None = None, started: Callable[[Any], None] = lambda _: None) -> Outcome:
    """Run a job in a process of its own and wait for it.

    Args:
        job: what to run.
        patience: time after which it counts as hung and is killed [s]; the job's own if None.
        started: takes the process when it runs.
    """
    patience = job.patience if patience is None else patience
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    with tempfile.TemporaryDirectory(prefix="cbrrt_bench_") as folder:
        path = Path(folder, "result")
        with subprocess.Popen(
            [*COMMAND, job.module, str(path), str(os.getpid())],
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
                _, said = process.communicate(json.dumps(asdict(job)), timeout=patience)
            except subprocess.TimeoutExpired:
                process.kill()
                _, said = process.communicate()
                return Outcome(error=f"hung: killed after {patience:g} s\n{said}")
        if process.returncode != 0:
            return Outcome(error=f"{_cause(process.returncode, said)}\n{said}")
        try:
            result = path.read_text(encoding="utf-8")
            job.check(result)
        except (OSError, InputError) as error:
            return Outcome(error=f"no complete result: {error}\n{said}")
        return Outcome(result)


def do_job(do: Callable[[dict[str, Any]], str]) -> None:
    """Be the process of a job: its values come on the standard input, its result goes into the file that is named.

    Args:
        do: makes the result from the values.
    """
    path, parent = sys.argv[1:]
    die_with_parent(int(parent))
    Path(path).write_text(do(json.load(sys.stdin)), encoding="utf-8")


def _cause(returncode: int, said: str) -> str:
    """Why a process ended; an exception tells it by the last line of its traceback."""
    if returncode < 0:
        return f"crashed: {signal.Signals(-returncode).name}"
    return ": ".join([f"failed: exit code {returncode}", *said.splitlines()[-1:]])
