"""What is run: series of runs of one planner in one scene, and the parts in which processes run them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

from cbrrt_ompl.benchmark.campaign import run_seeds
from cbrrt_ompl.benchmark.job import START_ALLOWANCE
from cbrrt_ompl.errors import InputError, Problem
from cbrrt_ompl.reproduce.scenes import (
    BRIEF_SHIFTS,
    CASE_1,
    CASE_2,
    OTHERS,
    READINGS,
    ROOMS,
    SHIFTS,
    shift_title,
    with_gaps_moved,
    with_settings,
)
from cbrrt_ompl.scenario.scenario import Scenario, load_scenario, scenario_to_dict

NAIVE = "rrt-5d"
"""OMPL's control::RRT with a metric over all five components of the state; in this study alone."""

IN_OMPL = ("cb-rrt", "s-rrt")
COMPILED = ("cb-rrt-compiled", "s-rrt-compiled")

NEIGHBOURS = ("kd-tree", "brute-force")
"""Other ways than the grid to find the nearest node."""

SEED = 1
"""Seed from which those of all runs are made."""

RUNS_PER_PART = 100
SLOW_RUNS_PER_PART = 5
"""Runs that share a process."""

TIME_LIMIT = 300.0
"""Planning time that a run may take [s]; the paper's limit is the number of samples."""

SLOW_SHARE = 4
"""One run in so many is made where a run takes seconds ..."""

FEWEST_SLOW = 6
"""... but no less than these, if there are as many of the others."""


class Key(NamedTuple):
    """Which series it is."""

    scene: str
    """Name of the scenario file without its suffix."""
    variant: str
    """What is different from the scene as it is; empty for nothing."""
    planner: str
    """A planner of :func:`cbrrt_ompl.plan`, or `NAIVE`."""


@dataclass(frozen=True, eq=False)
class Series:
    """Runs of one planner in one scene, each with a seed of its own."""

    key: Key
    scenario: Scenario
    """The scene, with what the variant changes."""
    runs: int
    """How many."""
    slow: bool = False
    """Whether a run takes seconds."""

    @cached_property
    def data(self) -> dict[str, Any]:
        """The scenario as plain values, with all its obstacles."""
        return scenario_to_dict(replace(self.scenario, map=None))

    @cached_property
    def seeds(self) -> tuple[int, ...]:
        """Seed of each run; the first ones stay the same whatever the number of runs."""
        return run_seeds(SEED, f"{self.key.scene} {self.key.variant}", self.key.planner, self.runs)

    def digest(self, place: str) -> str:
        """What the results depend on, in short.

        Args:
            place: version of the package and the machine.
        """
        text = json.dumps([place, self.key.planner, self.data], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


@dataclass(frozen=True)
class Part:
    """Some runs of a series: what a process is given to do."""

    key: Key
    scenario: dict[str, Any]
    """The scenario as plain values."""
    seeds: tuple[int, ...]
    """Seed of each run."""

    module: ClassVar[str] = "cbrrt_ompl.reproduce.measuring"

    @cached_property
    def name(self) -> str:
        """Different for different parts."""
        return hashlib.sha256(json.dumps(asdict(self), sort_keys=True).encode()).hexdigest()[:16]

    @property
    def patience(self) -> float:
        """Time after which the part counts as hung [s]."""
        return START_ALLOWANCE + 2.0 * TIME_LIMIT * len(self.seeds)

    def check(self, result: str) -> None:
        """Refuse what is not a line a run.

        Raises:
            InputError: with how many there are.
        """
        if len(result.splitlines()) != len(self.seeds):
            raise InputError(Problem("runs", len(result.splitlines()), str(len(self.seeds))))


def make_study(runs: int, brief: bool = False) -> list[Series]:
    """All series of the report.

    Args:
        runs: of each series.
        brief: the paper's tables and a few moved gaps only.
    """
    scenes = {name: load_scenario(name) for name in (CASE_1, CASE_2, ROOMS, *OTHERS)}
    series = [
        Series(Key(scene, "", planner), scenes[scene], runs)
        for scene in ((CASE_1, CASE_2) if brief else (CASE_1, CASE_2, ROOMS))
        for planner in (*IN_OMPL, *COMPILED)
    ]
    for offset in BRIEF_SHIFTS if brief else SHIFTS:
        for scene in (CASE_1, CASE_2):
            moved = with_gaps_moved(scenes[scene], offset)
            series += [Series(Key(scene, shift_title(offset), planner), moved, runs) for planner in COMPILED]
    if not brief:
        series += _full(scenes, runs)
    return series


def study_size(runs: int, brief: bool = False) -> int:
    """Runs in all, for as many of each series."""
    return sum(series.runs for series in make_study(runs, brief))


def _full(scenes: dict[str, Scenario], runs: int) -> Iterator[Series]:
    """What the short report leaves out."""
    for scene in OTHERS:
        yield from (Series(Key(scene, "", planner), scenes[scene], runs) for planner in COMPILED)
    few = min(runs, max(FEWEST_SLOW, runs // SLOW_SHARE))
    for scene in (CASE_1, CASE_2):
        for kind in NEIGHBOURS:
            scenario = with_settings(scenes[scene], {"nearest_neighbour": kind})
            yield Series(Key(scene, kind, "cb-rrt-compiled"), scenario, runs)
        yield Series(Key(scene, "", "rrt"), scenes[scene], few)
        yield Series(Key(scene, "", NAIVE), scenes[scene], few, slow=True)
    for reading in READINGS:
        for scene in (CASE_1, CASE_2, ROOMS):
            scenario = with_settings(scenes[scene], reading.changes)
            for planner in COMPILED:
                slow = planner in reading.slow_with and scene != CASE_1
                yield Series(Key(scene, reading.title, planner), scenario, few if slow else runs, slow)


def parts_of(series: Series, seeds: tuple[int, ...]) -> Iterator[Part]:
    """Some runs of a series, cut into parts.

    Args:
        series: the series.
        seeds: those of its seeds that are to be run.
    """
    size = SLOW_RUNS_PER_PART if series.slow else RUNS_PER_PART
    for first in range(0, len(seeds), size):
        yield Part(series.key, series.data, seeds[first : first + size])
