"""Outcomes of all series as arrays, with the statistics that tables, charts and rules take from them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.benchmark.statistics import (
    Interval,
    Quartiles,
    Ratio,
    bootstrap_medians,
    quartiles,
    ratio_of_medians,
    wilson_interval,
)
from cbrrt_ompl.reproduce.measuring import Run
from cbrrt_ompl.reproduce.study import Key

FEWEST = 6
"""Runs from which on their smallest and largest value enclose the true median in 95 % of all samples."""


@dataclass(frozen=True)
class Share:
    """How many of some things have a property."""

    count: int
    of: int

    @property
    def value(self) -> float:
        """The share; NaN of nothing."""
        return self.count / self.of if self.of else math.nan

    @property
    def interval(self) -> Interval:
        """Wilson's 95 % interval; from 0 to 1 for nothing."""
        return wilson_interval(self.count, self.of) if self.of else Interval(0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Sample:
    """The runs of one series. A run has failed that found nothing or whose trajectory failed verification."""

    key: Key
    runs: Sequence[Run]

    def __len__(self) -> int:
        """Number of runs."""
        return len(self.runs)

    @cached_property
    def found(self) -> list[Run]:
        """The runs with a trajectory, valid or not."""
        return [run for run in self.runs if run.solved]

    @cached_property
    def succeeded(self) -> Share:
        """Runs with a valid trajectory."""
        return Share(sum(run.verified is True for run in self.runs), len(self.runs))

    @cached_property
    def verified(self) -> Share:
        """Valid trajectories of those found."""
        return Share(sum(run.verified is True for run in self.found), len(self.found))

    @cached_property
    def turning(self) -> Share:
        """Trajectories with a turn in place."""
        return Share(sum((run.point_turns or 0) > 0 for run in self.found), len(self.found))

    def values(self, measure: str) -> NDArray[np.float64]:
        """A measure of each run, infinite where it has failed, shape (n,).

        Args:
            measure: ``nodes``, ``time``, ``samples`` or ``duration``.
        """
        return np.array([getattr(run, measure) if run.verified else math.inf for run in self.runs], dtype=float)

    def found_values(self, measure: str) -> NDArray[np.float64]:
        """A measure of each run with a trajectory, shape (m,)."""
        return np.array([getattr(run, measure) for run in self.found], dtype=float)

    def quartiles(self, measure: str) -> Quartiles:
        """Quartiles over all runs."""
        return quartiles(self.values(measure))

    def medians(self, measure: str) -> NDArray[np.float64]:
        """Bootstrap medians."""
        return bootstrap_medians(self.values(measure), " ".join((*self.key, measure)))

    def median_interval(self, measure: str) -> Interval:
        """95 % bootstrap interval of the median; from 0 to infinity for less than `FEWEST` runs."""
        if len(self) < FEWEST:
            return Interval(0.0, math.inf)
        low, high = np.quantile(self.medians(measure), (0.025, 0.975), method="inverted_cdf")
        return Interval(float(low), float(high))


class Outcomes:
    """The samples of a study by their keys; a series without any run is not there."""

    def __init__(self, runs: Mapping[Key, Sequence[Run]]) -> None:
        """Take all runs."""
        self._samples = {key: Sample(key, of) for key, of in runs.items() if of}

    def get(self, scene: str, planner: str, variant: str = "") -> Sample | None:
        """A sample, if there is one."""
        return self._samples.get(Key(scene, variant, planner))

    def variants(self, scene: str) -> list[str]:
        """The variants of a scene, without the scene as it is."""
        return list(dict.fromkeys(key.variant for key in self._samples if key.scene == scene and key.variant))

    @property
    def total(self) -> int:
        """Runs in all."""
        return sum(len(sample) for sample in self._samples.values())


def ratio_between(above: Sample, below: Sample, measure: str) -> Ratio:
    """How many times the median of one sample is that of another, with its 95 % bootstrap interval.

    The interval goes from 0 to infinity if one of them has less than `FEWEST` runs.
    """
    values, reference = above.values(measure), below.values(measure)
    ratio = ratio_of_medians(values, reference, above.medians(measure), below.medians(measure))
    if min(len(above), len(below)) < FEWEST and not math.isnan(ratio.value):
        return Ratio(ratio.value, Interval(0.0, math.inf))
    return ratio
