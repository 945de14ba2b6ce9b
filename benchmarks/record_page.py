"""The page of records, made from a database of runs alone."""

from __future__ import annotations

import math
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.benchmark.database import open_database
from cbrrt_ompl.benchmark.statistics import bootstrap_medians, quartiles, wilson_interval


class Series(NamedTuple):
    """The runs of one planner in one problem; times and costs of runs that are no success are infinite."""

    problem: str
    planner: str
    good: NDArray[np.bool_]
    """Which runs were solved and passed verification, shape (n,)."""
    refused: int
    """How many were solved and did not pass it."""
    time: NDArray[np.float64]
    """CPU time to the first trajectory, shape (n,) [s]."""
    cost: NDArray[np.float64]
    """What the section is about, shape (n,)."""


class Section(NamedTuple):
    """A part of the page."""

    title: str
    text: str
    """What is the same and what is not."""
    cost: str
    """Head of the column of costs."""
    published: dict[str, str]
    """What others published, by problem; its keys are the problems of the section, in order."""
    statistic: str = "median"
    """``median`` or ``mean`` of the costs."""


_DYNOBENCH = """Published: J. Ortiz-Haro et al., "iDb-A*: Iterative search and optimization for optimal kinodynamic
motion planning", IEEE Transactions on Robotics, 2024. The same: scene, start, goal, the limits of the model, and
the goal's tolerance for optimisers (0.03). Not the same: the machine and the time spent."""

_AT_LIMITS = """The published trajectories keep 0.45 of the 0.5 m/s and rad/s that the model allows, and 2.9 cm from
everything, which ours need not: [ours with these limits](improve.md#measured) are longer."""

_NAV2 = """A map of 100 m x 100 m, a tenth of it occupied (navigation2, tools/planner_benchmarking, 100by100_10).
Published: planning times of Nav2's Smac planners in it. The same: the map. Not the same: the machine, the pairs of
poses (random ones here), and the robot, a Jackal that arrives within 0.25 m with a heading and at rest. Ours is a
trajectory with velocities, theirs a path. The time is that of the first trajectory; the length, after 150 ms, is
told in terms of the shortest path over the cells and their eight neighbours."""

_ROS = """A TurtleBot3 Waffle Pi between random free poses of maps that come with Nav2 and AWS' small warehouse,
after 100 ms. We know of no published numbers for these. The bound below the duration knows the shortest path and
the top speed, and nothing of turning."""

_BARN = """The challenge's metric, OT / clip(AT, 2 OT, 8 OT) of a drive that arrives and touches nothing, else 0: at
most 0.5. One drive through each world of the challenge's own report (0, 6, ... 294), nothing known at first.
Published: the challenge's baseline, move_base with DWA (README of github.com/Daffan/the-barn-challenge). The same:
worlds, start, goal, reference paths, metric. Not the same: the challenge simulates robot, lidar and delays, where
here motion and sensor are exact; here the sensor reaches 5 m all around, obstacles hide what is behind them, and
one seen in part is known as a whole; and AT begins with the first plan, not once the robot has moved 0.1 m, which
makes it longer. In BARN plans are limited by samples, the same on every machine, and a cycle of 0.1 s may take
longer to compute; in BARN_by_the_clock what comes late is dropped, and the score depends on the machine, on which
other work was going on. The time is that of a drive's longest cycle (by the clock), and the metric the mean over
the worlds."""

_AISLE = """A robot of 0.62 m x 0.9 m, with a diagonal of 1.093 m, drives from one aisle into the next around the
end of a rack and arrives with a heading; all aisles are 1.1 m wide. Ours goes on for 200 ms; OMPL's planners, in
this package's set-up, end with their first solution or after 10 s."""

_OMPL = """dynobench's unicycles of second order with its tolerance for samplers (0.2). The same: problem, machine
and integration. Not the same: ours goes on for 200 ms; OMPL's planners end with their first solution or after 10 s,
and look for collisions at the ends of steps only: a solution that `verify` refuses counts as none."""

_CITIES = """A disc of 0.4 m in cells of 1 m. Published: the lengths in the files of problems (N. Sturtevant,
"Benchmarks for grid-based pathfinding", IEEE Transactions on Computational Intelligence and AI in Games, 2012), of
a point that moves in eight directions."""

SECTIONS = (
    Section(
        "dynobench, unicycle of second order",
        f"{_DYNOBENCH}\n\n{_AT_LIMITS}",
        "duration [s]",
        {"unicycle2_bugtrap": "25.1 s", "unicycle2_kink": "17.7 s", "unicycle2_parallelpark": "5.8 s"},
    ),
    Section(
        "dynobench, unicycle of first order",
        _DYNOBENCH,
        "duration [s]",
        {"unicycle1_bugtrap": "20.7 s", "unicycle1_kink": "13.2 s", "unicycle1_parallelpark": "3.1 s"},
    ),
    Section("BARN", _BARN, "metric", {"BARN": "0.169", "BARN_by_the_clock": "0.169"}, "mean"),
    Section(
        "Nav2's planner benchmark",
        _NAV2,
        "length / grid path",
        {"100by100_10": "89 ms (Smac Hybrid-A*), 223 ms (Smac Lattice)"},
    ),
    Section("ROS maps", _ROS, "duration / bound", {"depot": "", "tb3_sandbox": "", "small_warehouse": ""}),
    Section("An aisle of 1.1 m", _AISLE, "duration [s]", {"aisle": ""}),
    Section(
        "OMPL's own planners",
        _OMPL,
        "duration [s]",
        {"unicycle2_bugtrap_wide": "", "unicycle2_kink_wide": "", "unicycle2_parallelpark_wide": ""},
    ),
    Section("MovingAI's city maps", _CITIES, "length / published", {"Berlin_0_256": "1", "Boston_0_256": "1"}),
)
"""The parts of the page; those without runs say so."""

HEAD = """# Records

Ours beside what others published, each with what is the same and what is not. All of it is made from one database of
runs, which one command fills and another turns into this page:

<!-- not run: takes a quarter of an hour, and the problems of others -->
```console
$ python benchmarks/records.py run --output records --data FOLDER
$ python benchmarks/records.py page records/records.db --output docs/records.md
```

The folder holds the problems of others, under the names in `benchmarks/record_campaigns.py`; what is not there is
skipped. Times are CPU times on one core, kernels compiled, and a world's index and distance field made beforehand.
A run counts if `verify` passes its trajectory (a drive, if FCL finds no contact at points a millimetre apart); all
others count as infinite. In brackets are 95 % intervals: Wilson's for fractions, bootstrap for medians and means.
"""


def page(database: Path) -> str:
    """The page of a database.

    Args:
        database: the file.

    Raises:
        InputError: if it is no benchmark database.
    """
    series, machines = read(database)
    parts = [HEAD, f"Measured on {', '.join(machines)}.\n"]
    for section in SECTIONS:
        rows = [one for problem in section.published for one in series if one.problem == problem]
        parts += [f"## {section.title}\n", f"{section.text}\n"]
        parts.append(_table(section, rows) if rows else "Not run: the files were not there.\n")
    return "\n".join(parts)


def read(database: Path) -> tuple[list[Series], list[str]]:
    """The runs of a database in its order, and where and when they were made."""
    query = """SELECT experiments.name, plannerConfigs.name, runs.solved, runs.verified, runs.time, runs.cost
               FROM runs JOIN experiments ON experiments.id = runs.experimentid
               JOIN plannerConfigs ON plannerConfigs.id = runs.plannerid ORDER BY runs.id"""
    groups: dict[tuple[str, str], list[tuple[bool, bool, float, float]]] = {}
    with closing(open_database(database)) as connection:
        for problem, planner, solved, verified, time, cost in connection.execute(query):
            good = bool(solved and verified)
            values = (float(time), float(cost)) if good else (math.inf, math.inf)
            groups.setdefault((problem, planner), []).append((good, bool(solved and not good), *values))
        found = connection.execute("SELECT DISTINCT trim(cpuinfo, char(10)), date FROM experiments ORDER BY 1, 2")
        machines = [f"{cpu} ({date})" for cpu, date in found]
    return [_series(*key, rows) for key, rows in groups.items()], machines


def _series(problem: str, planner: str, rows: list[tuple[bool, bool, float, float]]) -> Series:
    good, refused, time, cost = (np.array(column) for column in zip(*rows, strict=True))
    return Series(problem, planner, good, int(refused.sum()), time, cost)


def _table(section: Section, rows: list[Series]) -> str:
    """The table of a section."""
    head = f"| problem | planner | runs that count | time [ms] | {section.cost} | published |"
    lines = [head, "| --- | --- | --- | --- | --- | --- |"]
    for one in rows:
        count, runs = int(one.good.sum()), len(one.good)
        low, high = wilson_interval(count, runs)
        fraction = f"{count} of {runs} ({100 * low:.0f} to {100 * high:.0f} %)"
        fraction += f", {one.refused} refused" if one.refused else ""
        mean = section.statistic == "mean"
        cost = _mean(one) if mean else _median(one.cost, f"{one.problem} {one.planner} cost", 3)
        time = _median(1e3 * one.time, f"{one.problem} {one.planner} time", 1)
        published = section.published[one.problem] or "none"
        lines.append(f"| {one.problem} | {one.planner} | {fraction} | {time} | {cost} | {published} |")
    return "\n".join(lines) + "\n"


def _median(values: NDArray[np.float64], name: str, digits: int) -> str:
    """A median with its interval; nothing where no run counts."""
    if not np.isfinite(values).any():
        return "none"
    low, high = np.quantile(bootstrap_medians(values, name), (0.025, 0.975), method="inverted_cdf")
    return f"{_number(quartiles(values).median, digits)} ({_number(low, digits)} to {_number(high, digits)})"


def _mean(one: Series) -> str:
    """The mean of a score with its interval; runs that do not count score 0."""
    scores = np.where(one.good, one.cost, 0.0)
    draws = np.random.default_rng(0).choice(scores, size=(5000, len(scores))).mean(axis=1)
    low, high = np.quantile(draws, (0.025, 0.975))
    return f"{scores.mean():.3f} ({low:.3f} to {high:.3f})"


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if math.isfinite(value) else "none"
