"""Jobs on this machine: several processes at a time."""

from __future__ import annotations

import subprocess
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from typing import Any

from cbrrt_ompl.benchmark.job import J, Outcome, execute


def run_locally(waiting: Sequence[J], jobs: int = 1, patience: float | None = None) -> Iterator[tuple[J, Outcome]]:
    """Run jobs, each in a process of its own.

    Args:
        waiting: what to run; the first ones begin first.
        jobs: how many at a time.
        patience: time after which a job counts as hung [s]; its own if None.

    Yields:
        Each job with its outcome when it is done. Closing the iterator kills what is running.
    """
    processes = _Processes()
    pool = ThreadPoolExecutor(jobs)
    try:
        futures = {pool.submit(execute, job, patience, processes.add): job for job in waiting}
        for future in as_completed(futures):
            yield futures.pop(future), future.result()
    finally:
        processes.kill()
        pool.shutdown(cancel_futures=True)


class _Processes:
    """Those that were started, to be killed together."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._running: set[subprocess.Popen[Any]] = set()
        self._is_over = False

    def add(self, process: subprocess.Popen[Any]) -> None:
        """Note a process; kill it where all are to be killed."""
        with self._lock:
            self._running = {known for known in self._running if known.returncode is None} | {process}
            if self._is_over:
                process.kill()

    def kill(self) -> None:
        """Kill all that are still running, and all that come."""
        with self._lock:
            self._is_over = True
            for process in self._running:
                if process.returncode is None:
                    process.kill()
