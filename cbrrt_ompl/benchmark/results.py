"""What a benchmark database says about each planner in each scenario."""

from __future__ import annotations

import math
import re
import sqlite3
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.benchmark.account import max_samples_of, name_of
from cbrrt_ompl.benchmark.database import open_database, write_database
from cbrrt_ompl.benchmark.log import read_log
from cbrrt_ompl.errors import InputError, Problem

CRASH = 7
"""OMPL's status of a run that ended by a crash."""

LOG_START = b"OMPL version "
"""What logs of OMPL's Benchmark begin with."""

PREFIXES = ("control_", "geometric_")
"""What OMPL's Benchmark puts before the names of planners."""


@dataclass(frozen=True, eq=False)
class Series:
    """The runs of one planner in one scenario.

    A run has succeeded if it found an exact solution, within the samples that the scenario allows, that passed
    verification. All values of other runs are infinite.
    """

    experiment: str
    """Name of the experiment."""
    planner: str
    """Name of the planner, without OMPL's prefix."""
    success: NDArray[np.bool_]
    """Which runs have succeeded, shape (n,)."""
    solved: NDArray[np.bool_]
    """Which runs found what they took for an exact solution, shape (n,)."""
    invalid: NDArray[np.bool_]
    """Which runs found an exact solution that failed verification, shape (n,)."""
    unverified: NDArray[np.bool_]
    """Which runs found an exact solution that nobody verified, shape (n,)."""
    crashed: NDArray[np.bool_]
    """Which runs have no result at all, shape (n,)."""
    time: NDArray[np.float64]
    """Planning time, shape (n,) [s]."""
    nodes: NDArray[np.float64]
    """Nodes of the tree, shape (n,)."""
    duration: NDArray[np.float64]
    """Duration of the trajectory, shape (n,) [s]."""

    def __len__(self) -> int:
        """Number of runs."""
        return len(self.success)


@dataclass(frozen=True)
class Experiment:
    """One scenario of a database."""

    name: str
    """Its name, different for each experiment of a database."""
    title: str
    """The scenario's own name, or the experiment's where the database has none."""
    time_limit: float
    """Time that a run may take [s]."""
    max_samples: int | None
    """Samples that a run may draw; None where the database does not tell."""
    host: str
    """Where it ran."""
    date: str
    """When it began."""
    version: str
    """Version of OMPL."""
    seed: str
    """Its seed."""
    series: tuple[Series, ...]
    """The planners, in the order of the database."""


def read_experiments(path: str | Path) -> list[Experiment]:
    """Read a benchmark database, or a log as OMPL's Benchmark writes it.

    Args:
        path: the file.

    Raises:
        InputError: if it is neither, or holds no runs.
    """
    if is_log(path):
        with TemporaryDirectory() as folder:
            write_database(Path(folder) / "log.db", [read_log(path)])
            return read_experiments(Path(folder) / "log.db")
    with closing(open_database(path)) as connection:
        connection.row_factory = sqlite3.Row
        try:
            experiments = [
                _read_experiment(connection, dict(row))
                for row in connection.execute("SELECT * FROM experiments ORDER BY id")
            ]
        except (sqlite3.DatabaseError, KeyError, TypeError, ValueError) as error:
            raise InputError(Problem("", str(error), "an undamaged benchmark database"), str(path)) from None
    if not any(experiment.series for experiment in experiments):
        raise InputError(Problem("", "no runs", "a database with runs"), str(path))
    return experiments


def is_log(path: str | Path) -> bool:
    """Whether a file is a log of OMPL's Benchmark, by its first words."""
    try:
        with Path(path).open("rb") as file:
            return file.read(len(LOG_START)) == LOG_START
    except OSError:
        return False


def _read_experiment(connection: sqlite3.Connection, row: dict[str, Any]) -> Experiment:
    """One experiment with all its planners."""
    planners: dict[str, list[dict[str, Any]]] = {}
    query = """SELECT plannerConfigs.name AS planner, runs.* FROM runs
               JOIN plannerConfigs ON plannerConfigs.id = runs.plannerid WHERE experimentid = ? ORDER BY runs.id"""
    for run in connection.execute(query, (row["id"],)):
        planners.setdefault(run["planner"], []).append(dict(run))
    name = re.sub(r"[^\w.-]+", "_", row["name"])  # names files
    if connection.execute("SELECT 1 FROM experiments WHERE name = ? AND id < ?", (row["name"], row["id"])).fetchone():
        name = f"{name}_{row['id']}"
    account = row.get("setup") or ""
    return Experiment(
        name=name,
        title=name_of(account) or row.get("scenario") or row["name"],
        time_limit=row["timelimit"],
        max_samples=max_samples_of(account) or row.get("max_samples"),  # of older versions: columns
        host=row["hostname"],
        date=row["date"],
        version=row["version"],
        seed=row["seed"],
        series=tuple(_series(name, planner, runs) for planner, runs in planners.items()),
    )


def _series(experiment: str, planner: str, runs: Sequence[dict[str, Any]]) -> Series:
    """The runs of one planner."""
    for prefix in PREFIXES:
        planner = planner.removeprefix(prefix)

    def flags(name: str, default: object) -> NDArray[np.bool_]:
        return np.array([bool(run.get(name, default)) for run in runs])

    solved = flags("solved", 0)
    has_verdict = np.array([run.get("verified") is not None for run in runs])
    verified = flags("verified", 0)
    within = np.array([run.get("within_max_samples") != 0 for run in runs])
    success = solved & within & (verified | ~has_verdict)
    time = "planning_time" if any(run.get("planning_time") is not None for run in runs) else "time"

    def values(name: str) -> NDArray[np.float64]:
        found = [math.nan if run.get(name) is None else float(run[name]) for run in runs]
        return np.where(success, found, math.inf)

    return Series(
        experiment=experiment,
        planner=planner,
        success=success,
        solved=solved,
        invalid=solved & has_verdict & ~verified,
        unverified=solved & ~has_verdict,
        crashed=np.array([run.get("status") == CRASH for run in runs]),
        time=values(time),
        nodes=values("graph_states"),
        duration=values("trajectory_duration"),
    )
