"""Parts on this machine: one process a core, each with one part at a time; what crashes costs its own part alone."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections import deque
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import NamedTuple

from cbrrt_ompl.benchmark.case import die_with_parent
from cbrrt_ompl.reproduce.measuring import Run, measure
from cbrrt_ompl.reproduce.study import Part


class Outcome(NamedTuple):
    """What came of a part: its runs, or the reason why there are none."""

    runs: list[Run]
    error: str = ""
    """One line; empty where all went well."""


def run_parts(parts: Sequence[Part], jobs: int) -> Iterator[tuple[Part, Outcome]]:
    """Run parts in several processes at a time.

    Where a process crashes, all parts that were running are run again, each alone: the one that crashes once more is
    given up.

    Args:
        parts: what to run; the first ones begin first.
        jobs: processes at a time.

    Yields:
        Each part when it is done. Closing the iterator kills the processes.
    """
    waiting = deque(parts)
    while waiting:
        suspects = yield from _run_until_crash(waiting, jobs)
        for part in suspects:
            if (yield from _run_until_crash(deque([part]), 1)):
                yield part, Outcome([], "its process crashed")


def _run_until_crash(waiting: deque[Part], jobs: int) -> Generator[tuple[Part, Outcome], None, list[Part]]:
    """Run parts, taking them from the queue, until none is left or a process crashes; the parts it crashed among."""
    before = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(
        min(jobs, len(waiting)), multiprocessing.get_context("spawn"), _begin, (os.getpid(),)
    )  # spawned: a forked process would share OMPL's and numba's state
    running: dict[Future[list[Run]], Part] = {}
    try:
        while waiting or running:
            while waiting and len(running) < jobs:
                part = waiting.popleft()
                try:
                    running[pool.submit(measure, part)] = part
                except BrokenProcessPool:
                    return [part, *running.values()]
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                error = future.exception()
                if isinstance(error, BrokenProcessPool):
                    return list(running.values())
                part = running.pop(future)
                yield part, Outcome(future.result()) if error is None else Outcome([], _line(error))
        return []
    finally:
        for process in set(multiprocessing.active_children()) - before if running else ():
            process.kill()
        pool.shutdown(cancel_futures=True)


def _begin(parent: int) -> None:
    """Prepare a process: it ends with its parent, which alone answers Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    die_with_parent(parent)


def _line(error: BaseException) -> str:
    """An error in one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())
