"""Numbers as text: three digits, intervals in brackets, thousands with commas."""

from __future__ import annotations

import math
from collections.abc import Callable

from cbrrt_ompl.benchmark.digits import three_digits
from cbrrt_ompl.benchmark.statistics import Interval, Quartiles, Ratio
from cbrrt_ompl.reproduce.outcomes import Sample, Share


def number(value: float) -> str:
    """Three significant digits; a dash for NaN."""
    return three_digits(value, missing="–")


def whole(value: float) -> str:
    """All digits of a whole number, such as a count of nodes."""
    return f"{value:,.0f}" if math.isfinite(value) else number(value)


def interval_text(interval: Interval, scale: float = 1.0, text: Callable[[float], str] = number) -> str:
    """An interval in brackets."""
    return f"[{text(scale * interval.low)}, {text(scale * interval.high)}]"


def share_text(share: Share) -> str:
    """A share in percent with Wilson's interval."""
    if not share.of:
        return "–"
    low, high = share.interval
    return f"{100.0 * share.value:.3g} % [{100.0 * low:.0f}, {100.0 * high:.0f}]"


def count_text(share: Share) -> str:
    """A share as "so many of so many"."""
    return f"{share.count:,} of {share.of:,}" if share.of else "–"


def median_text(sample: Sample, measure: str, scale: float = 1.0) -> str:
    """Median with its 95 % interval."""
    median, interval = scale * sample.quartiles(measure).median, sample.median_interval(measure)
    if math.isinf(interval.low):
        return number(median)
    text = whole if measure == "nodes" else number
    return f"{text(median)} {interval_text(interval, scale, text)}"


def quartiles_text(found: Quartiles, scale: float = 1.0) -> str:
    """Lower and upper quartile."""
    if math.isinf(found.low):
        return number(found.low)
    return f"{number(scale * found.low)} to {number(scale * found.high)}"


def ratio_text(ratio: Ratio) -> str:
    """A ratio with its interval; a dash where there is none."""
    if math.isnan(ratio.value) or math.isinf(ratio.interval.low):
        return number(ratio.value)
    return f"{number(ratio.value)} {interval_text(ratio.interval)}"
