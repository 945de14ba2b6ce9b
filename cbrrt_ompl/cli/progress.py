"""What tells a user at a terminal that something takes long: progress lines, and a word on compilation."""

from __future__ import annotations

import sys
import threading
import time
import timeit
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

LOOPS_OF_PLANNERS, LOOPS_OF_PLUGIN, LOOPS_OF_IMPROVEMENT = 7_000, 2_500, 5_000
"""Time to compile the compiled planners, what OMPL calls besides, and the improvement, in times of a loop in Python."""

SHARE_OF_TWO_CORES = 0.6
"""How much of that time it takes where a second core compiles as well."""

SILENCE = 30.0
"""Time after which a campaign that nobody watches tells how far it is, once [s]."""

LEAST_SHARE = 0.02
"""Share of a campaign to be done by then: it begins with the runs that take longest."""

LINE = "{l_bar}{bar}| {n_fmt}/{total_fmt} [{elapsed}<{remaining}, {rate_fmt}]"
"""A progress line: how many of how many, the time since the beginning and the time left."""


def warm_up(planner: str | None, improves: bool = False) -> None:
    """Load the kernels of a planner, and say so on a terminal where they must be compiled first.

    Args:
        planner: its name; None for none.
        improves: whether trajectories are to be improved.
    """
    from cbrrt_ompl import planning

    timer = threading.Timer(1.0, _tell_of_compilation, [planner, improves])
    timer.daemon = True
    if sys.stderr.isatty():
        timer.start()
    try:
        if planner is not None:
            planning.warm_up_planner(planner)
        if improves:
            planning.warm_up_improvement()
    finally:
        timer.cancel()


def _tell_of_compilation(planner: str | None, improves: bool) -> None:
    """Say what is going on and, from the speed of this machine, about how long."""
    from cbrrt_ompl.planners.registry import PLANNERS, is_compiled
    from cbrrt_ompl.processes import available_cores

    loops = 0 if planner is None else LOOPS_OF_PLANNERS
    if planner is not None and not is_compiled(planner):
        loops += LOOPS_OF_PLUGIN
    if improves or (planner is not None and PLANNERS[planner].optimises):
        loops += LOOPS_OF_IMPROVEMENT
    share = SHARE_OF_TWO_CORES if available_cores() > 1 else 1.0
    seconds = share * loops * min(timeit.repeat("sum(i * i for i in range(100_000))", number=1, repeat=10))
    about = f"about {max(5.0, 5.0 * round(seconds / 5.0)):.0f} s"
    print(f"cbrrt: compiling the planners, once after installation: {about} ...", file=sys.stderr, flush=True)


@contextmanager
def plan_progress(total: int, label: str) -> Iterator[Callable[[int, float], None] | None]:
    """A progress line for :func:`cbrrt_ompl.plan` once it has taken a second; None where nobody watches."""
    if not sys.stderr.isatty():
        yield None
        return
    from tqdm import tqdm

    look = {"desc": label, "unit": " samples", "delay": 1.0, "leave": False, "bar_format": LINE}
    with tqdm(total=total, file=sys.stderr, **look) as bar:

        def report(samples: int, elapsed: float) -> None:
            bar.update(samples - bar.n)

        yield report


@contextmanager
def run_progress(total: int) -> Iterator[Callable[[int], None]]:
    """A progress line for a campaign, with the time left; where nobody watches, one line once that can be told."""
    if not sys.stderr.isatty():
        yield _one_line(total)
        return
    from tqdm import tqdm

    with ExitStack() as stack:
        bars: list[Any] = []

        def report(done: int) -> None:
            if not bars:  # what former calls have done tells nothing of the time left
                look = {"desc": "runs", "unit": "", "smoothing": 0.0, "bar_format": LINE}
                bars.append(tqdm(total=total, initial=done, file=sys.stderr, **look))
                stack.enter_context(bars[0])
            bars[0].update(done - bars[0].n)

        yield report


def _one_line(total: int) -> Callable[[int], None]:
    """A report of progress that says once, after a while, how many runs are done and how long the others will take."""
    began: list[tuple[float, int]] = []
    told: list[bool] = []

    def report(done: int) -> None:
        now = time.monotonic()
        if not began:
            began.append((now, done))
        start, before = began[0]
        if told or done >= total or now - start < SILENCE or done - before <= LEAST_SHARE * (total - before):
            return
        told.append(True)
        minutes = (total - done) * (now - start) / (done - before) / 60.0
        print(f"cbrrt: {done:,} of {total:,} runs, about {max(minutes, 1.0):.0f} min left", file=sys.stderr, flush=True)

    return report
