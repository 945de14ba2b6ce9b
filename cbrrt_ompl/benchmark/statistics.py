"""Statistics of runs of which some have failed: shares, quantiles and ratios, each with what chance leaves open."""

from __future__ import annotations

import math
import zlib
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

NORMAL_QUANTILE = 1.959963984540054
"""97.5 % quantile of the standard normal distribution: two-sided 95 %."""

RESAMPLES = 5000
"""Bootstrap samples of a ratio's interval."""


class Interval(NamedTuple):
    """A 95 % interval."""

    low: float
    high: float


class Quartiles(NamedTuple):
    """Quartiles; infinite where too many runs have failed."""

    low: float
    median: float
    high: float


class Ratio(NamedTuple):
    """Ratio of two medians with its 95 % interval."""

    value: float
    """Infinite where the first median is; 0 where the second one is; NaN where both are."""
    interval: Interval
    """From 0 to infinity where the data leave everything open."""


def wilson_interval(successes: int, runs: int) -> Interval:
    """Wilson's 95 % score interval of a share.

    Args:
        successes: 0 to ``runs``.
        runs: 1 or more.
    """
    z, share = NORMAL_QUANTILE, successes / runs
    centre = share + z * z / (2.0 * runs)
    half = z * math.sqrt(share * (1.0 - share) / runs + z * z / (4.0 * runs * runs))
    scale = 1.0 + z * z / runs
    return Interval(max(0.0, (centre - half) / scale), min(1.0, (centre + half) / scale))


def quartiles(values: NDArray[np.float64]) -> Quartiles:
    """Quartiles of values of which some may be infinite.

    Args:
        values: one a run, shape (n,), n >= 1; a single NaN makes all quartiles NaN.

    Note:
        Each is the smallest value that a quarter (half, three quarters) of the runs does not exceed: one of the values,
        so that no mean of a finite and an infinite one is ever taken.
    """
    if np.isnan(values).any():
        return Quartiles(math.nan, math.nan, math.nan)
    low, median, high = np.quantile(values, (0.25, 0.5, 0.75), method="inverted_cdf")
    return Quartiles(float(low), float(median), float(high))


def bootstrap_medians(values: NDArray[np.float64], name: str, resamples: int = RESAMPLES) -> NDArray[np.float64]:
    """Medians of samples drawn from the values with replacement.

    Args:
        values: one a run, shape (n,).
        name: seeds the draws: the same name and values give the same medians.
        resamples: how many.

    Returns:
        The medians, shape (resamples,).
    """
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    ranks = np.sort(rng.integers(len(values), size=(resamples, len(values))), axis=1)
    return np.asarray(np.sort(values)[ranks[:, (len(values) - 1) // 2]])


def ratio_of_medians(
    values: NDArray[np.float64],
    reference: NDArray[np.float64],
    medians: NDArray[np.float64],
    reference_medians: NDArray[np.float64],
) -> Ratio:
    """How many times the median of one planner is that of another.

    Args:
        values: of the one, shape (n,).
        reference: of the other, shape (m,).
        medians: :func:`bootstrap_medians` of the one.
        reference_medians: and of the other, drawn independently.

    Returns:
        The ratio with its percentile bootstrap interval. Where both medians of a bootstrap sample are infinite, their
        ratio counts as 0 for the lower and as infinite for the upper end.
    """
    value = float(_divided(np.array([quartiles(values).median]), np.array([quartiles(reference).median]))[0])
    ratios = _divided(medians, reference_medians)
    if np.isnan(values).any() or np.isnan(reference).any():
        return Ratio(math.nan, Interval(math.nan, math.nan))
    low = np.quantile(np.where(np.isnan(ratios), 0.0, ratios), 0.025, method="inverted_cdf")
    high = np.quantile(np.where(np.isnan(ratios), math.inf, ratios), 0.975, method="inverted_cdf")
    return Ratio(value, Interval(float(low), float(high)))


def _divided(above: NDArray[np.float64], below: NDArray[np.float64]) -> NDArray[np.float64]:
    """Quotients; infinite by infinite is NaN, and nothing warns."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return above / below
