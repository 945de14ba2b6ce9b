"""Charts of benchmark results: each function draws on the axes given to it, none shows or saves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from cbrrt_ompl.benchmark.results import Experiment, Series
from cbrrt_ompl.benchmark.statistics import quartiles

COLORS = {
    "cb-rrt": "#0072B2",
    "s-rrt": "#CC3311",
    "rrt": "#000000",
    "kpiece1": "#E69F00",
    "est": "#009E73",
    "sst": "#CC79A7",
    "pdst": "#8C564B",
    "syclop-rrt": "#56B4E9",
    "syclop-est": "#7F7F7F",
}
"""Colours of the planners; a compiled planner has the colour of its twin, and dashes."""

OTHER_COLORS = ("#882255", "#999933", "#332288", "#44AA99", "#AA4499")
"""Colours of planners that are not ours to know, in turn."""

MEASURES = (("time", "planning time [s]"), ("nodes", "nodes"), ("duration", "duration of the trajectory [s]"))
"""What box plots show: attribute of a series, and label."""

BOX_WIDTH = 0.6

MOST_TICKS = 7
"""Ticks of a logarithmic axis, at most, as long as there is one a decade."""


def success_figure(experiment: Experiment) -> Figure:
    """The share of solved runs against time, for all planners of a scenario."""
    figure = Figure(figsize=(7.6, 4.2), layout="constrained", dpi=150)
    ax = draw_success(figure.subplots(), experiment.series, experiment.time_limit)
    ax.set_title(f"{experiment.title}: runs solved within a time", fontsize=10, parse_math=False)
    return figure


def boxes_figure(experiment: Experiment) -> Figure:
    """Planning time, nodes and duration of all planners of a scenario as box plots."""
    height = 1.5 + 0.32 * len(experiment.series)
    figure = Figure(figsize=(11.0, height), layout="constrained", dpi=150)
    for ax, (measure, label) in zip(figure.subplots(1, len(MEASURES), sharey=True), MEASURES, strict=True):
        draw_boxes(ax, experiment.series, measure)
        ax.set_xlabel(label)
    figure.suptitle(f"{experiment.title}: every run, its quartiles, and failures", fontsize=10, parse_math=False)
    return figure


def draw_success(ax: Axes, series: Sequence[Series], time_limit: float) -> Axes:
    """Draw the share of runs that were solved within a time.

    Args:
        ax: axes; their limits, labels and legend are set.
        series: the planners of one scenario.
        time_limit: end of the axis [s].

    Returns:
        The axes.
    """
    times = np.concatenate([one.time[np.isfinite(one.time)] for one in series])
    first = max(float(times.min(initial=time_limit)), 1e-6) / 1.5
    for one in series:
        solved = np.sort(one.time[np.isfinite(one.time)])
        shares = np.arange(len(solved) + 1) / len(one)
        x = np.concatenate([[first], solved, [max(time_limit, solved.max(initial=0.0))]])
        y = np.concatenate([shares, shares[-1:]])
        color, dashes = style_of(one.planner, series)
        ax.step(x, 100.0 * y, where="post", color=color, linestyle=dashes, linewidth=1.5, label=one.planner)
    _log_axis(ax, first, max(time_limit, float(times.max(initial=0.0))))
    ax.set_ylim(-2.0, 102.0)
    ax.set_xlabel("planning time [s]")
    ax.set_ylabel("runs solved [%]")
    ax.grid(color="0.9", linewidth=0.6)
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8, frameon=False)
    return ax


def draw_boxes(ax: Axes, series: Sequence[Series], measure: str) -> Axes:
    """Draw each run as a dot and the quartiles of each planner as a box, on a logarithmic axis.

    Failures are infinite: they lie in a grey band at the right end, and a box reaches into it where a quarter of the
    runs or more has failed.

    Args:
        ax: axes; their limits and the names of the planners are set, the first planner on top.
        series: the planners of one scenario.
        measure: attribute of a series.

    Returns:
        The axes.
    """
    values = [getattr(one, measure) for one in series]
    finite = np.concatenate(values)
    finite = finite[np.isfinite(finite) & (finite > 0.0)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (1.0, 10.0)
    span = max(high / low, 1.2)
    left, edge = low / span**0.06, high * span**0.06
    right = edge * span**0.14
    failed = float(np.sqrt(edge * right))
    ax.axvspan(edge, right, color="0.92", linewidth=0.0, zorder=0)
    for row, (one, runs) in enumerate(zip(series, values, strict=True)):
        color, _ = style_of(one.planner, series)
        _draw_row(ax, row, np.where(np.isinf(runs), failed, runs), color)
    _log_axis(ax, left, right, edge)
    ax.set_yticks(range(len(series)), [one.planner for one in series], fontsize=8)
    ax.set_ylim(len(series) - 0.5, -0.5)
    ax.grid(axis="x", color="0.9", linewidth=0.6, zorder=0)
    ax.set_axisbelow(True)
    ax.annotate(
        "failed", (failed, 1.0), xycoords=("data", "axes fraction"), xytext=(0, 2), textcoords="offset points",
        ha="center", fontsize=7, color="0.35",
    )  # fmt: skip
    return ax


def style_of(planner: str, series: Sequence[Series]) -> tuple[str, str]:
    """Colour and dashes of a planner."""
    twin = planner.removesuffix("-compiled")
    dashes = "-" if planner == twin else "--"
    if twin in COLORS:
        return COLORS[twin], dashes
    others = [one.planner for one in series if one.planner.removesuffix("-compiled") not in COLORS]
    return OTHER_COLORS[others.index(planner) % len(OTHER_COLORS)], dashes


def _log_axis(ax: Axes, low: float, high: float, last_tick: float = math.inf) -> None:
    """Make the x axis logarithmic, with plain numbers at a handful of ticks up to the last one."""
    ax.set_xscale("log")
    ax.set_xlim(low, high)
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    ticks = []
    for steps in (range(1, 10), (1, 2, 5), (1, 3), (1,)):
        ticks = [t for d in decades for step in steps if low <= (t := float(f"{step}e{d}")) <= min(high, last_tick)]
        if len(ticks) <= MOST_TICKS:
            break
    ax.set_xticks(ticks, [f"{tick:,.10g}" for tick in ticks])
    ax.minorticks_off()
    ax.tick_params(axis="x", labelsize=8)


def _draw_row(ax: Axes, row: int, values: NDArray[np.float64], color: str) -> None:
    """One planner: dots, and a box from its quartiles with whiskers to its extremes."""
    if np.isnan(values).any():
        return
    offsets = np.random.default_rng(row).uniform(-0.3, 0.3, len(values)) * BOX_WIDTH
    ax.plot(values, row + offsets, linestyle="none", marker="o", markersize=2.2, color=color, alpha=0.45, zorder=2)
    low, median, high = quartiles(values)
    line: dict[str, Any] = {"color": color, "linewidth": 1.1, "zorder": 3}
    top = row - BOX_WIDTH / 2.0
    ax.hlines([row, row], [values.min(), high], [low, values.max()], **line)
    ax.vlines([values.min(), values.max()], row - BOX_WIDTH / 4.0, row + BOX_WIDTH / 4.0, **line)
    ax.add_patch(Rectangle((low, top), high - low, BOX_WIDTH, fill=False, **line))
    ax.vlines(median, top, top + BOX_WIDTH, color=color, linewidth=2.4, zorder=3)
