"""The time of a plan: when it ends, when it tells how far it is, when it doubts that there is a way."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from cbrrt_ompl.planning.result import NO_WAY, SAMPLE_LIMIT, TIME_LIMIT

PATIENCE = 0.5
"""Planning time after which a plan looks for a proof that there is no way, where as much again is left for it [s]."""

PROGRESS_PERIOD = 0.1
"""Time between two reports of progress [s]."""

Progress = Callable[[int, float], None]
"""Takes the samples so far and the time since the start [s]."""


class Watch:
    """Keeps the time of a search and reports its progress."""

    def __init__(self, time_limit: float, progress: Progress | None, is_hopeless: Callable[[], bool]) -> None:
        """Nothing has begun.

        Args:
            time_limit: largest time of the search [s].
            progress: told about the search.
            is_hopeless: whether there is no way, which takes its time.
        """
        self.ended_by = SAMPLE_LIMIT
        self._time_limit, self._progress, self._is_hopeless = time_limit, progress, is_hopeless
        self.began = self._next_report = 0.0
        self._doubts_at = math.inf

    def start(self) -> None:
        """Begin to count the time."""
        self.began = time.perf_counter()
        self._next_report = self.began + PROGRESS_PERIOD
        self._doubts_at = self.began + PATIENCE if self._time_limit >= 2.0 * PATIENCE else math.inf

    def go_on(self, seconds: float) -> None:
        """End so much later than now [s]; there is a way."""
        self._time_limit, self._doubts_at = self.elapsed() + seconds, math.inf

    def left(self) -> float:
        """Time that is left [s]."""
        return self._time_limit - self.elapsed()

    def elapsed(self) -> float:
        """Time since the start [s]."""
        return time.perf_counter() - self.began

    def should_stop(self, samples: int) -> bool:
        """Whether the time is up or there is no way; being Python code, this also lets a Ctrl-C through."""
        if self.ended_by == NO_WAY:
            return True
        now = time.perf_counter()
        if now - self.began >= self._time_limit:
            self.ended_by = TIME_LIMIT
            return True
        if self._progress is not None and now >= self._next_report:
            self._next_report = now + PROGRESS_PERIOD
            self._progress(samples, now - self.began)
        if now >= self._doubts_at:
            self._doubts_at = math.inf
            if self._is_hopeless():
                self.ended_by = NO_WAY
                return True
        return False
