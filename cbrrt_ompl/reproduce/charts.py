"""Figures of the report: the paper's, made again, and charts of what was measured."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure
from matplotlib.legend_handler import HandlerPolyCollection
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from cbrrt_ompl.benchmark.charts import COLORS
from cbrrt_ompl.figures import draw_scene, draw_trajectory, draw_tree, draw_velocities
from cbrrt_ompl.figures.style import legend_above
from cbrrt_ompl.planning import PlanResult, plan
from cbrrt_ompl.reproduce.claims import QueryCosts
from cbrrt_ompl.reproduce.grids import GridPath
from cbrrt_ompl.reproduce.measuring import TIME_LIMIT
from cbrrt_ompl.reproduce.outcomes import Outcomes, Sample
from cbrrt_ompl.reproduce.published import PAPER
from cbrrt_ompl.reproduce.scenes import CASE_1, CASE_2, shift_title, title_of
from cbrrt_ompl.reproduce.study import COMPILED
from cbrrt_ompl.scenario.scenario import Scenario

NAMES = {"cb-rrt": "CB-RRT", "s-rrt": "S-RRT"}
MARKERS = {"cb-rrt": "o", "s-rrt": "s", "grid": "o", "kd-tree": "^", "brute-force": "s"}
LEGEND_COLUMN = 1.2
"""Width of a column of a legend below a figure [in]."""

KIND_COLORS = {"grid": "#0072B2", "kd-tree": "#009E73", "brute-force": "#CC3311"}


def typical_plan(sample: Sample, scenario: Scenario) -> PlanResult:
    """The run of a sample that is nearest to its medians in nodes and duration, made again from its seed.

    Args:
        sample: runs of a planner of :func:`cbrrt_ompl.plan`, of which one or more have succeeded.
        scenario: what they were run in.
    """
    solved = [run for run in sample.runs if run.verified]
    figures = np.log(np.array([[run.nodes, run.duration] for run in solved], dtype=float))  # (n, 2)
    best = int(np.abs(figures - np.median(figures, axis=0)).sum(axis=1).argmin())
    return plan(scenario, sample.key.planner, solved[best].seed, TIME_LIMIT)


def scenes_figure(scenarios: Mapping[str, Scenario]) -> Figure:
    """Fig. 3: the two scenes side by side."""
    figure = _figure(8.6, 4.7)
    for ax, (name, scenario) in zip(np.atleast_1d(figure.subplots(1, len(scenarios))), scenarios.items(), strict=True):
        draw_scene(ax, scenario)
        ax.set_title(title_of(name))
    _legend_below(figure)
    return figure


def trees_figure(results: Sequence[PlanResult], scenario: Scenario) -> Figure:
    """Fig. 4: trees and paths of both planners in one scene, side by side."""
    figure = _figure(8.6, 4.9)
    for ax, result in zip(np.atleast_1d(figure.subplots(1, len(results))), results, strict=True):
        _draw_result(ax, result, scenario)
        ax.set_title(f"{NAMES[result.planner]}: {result.nodes:,} nodes")
    _legend_below(figure)
    return figure


def path_figure(result: PlanResult, scenario: Scenario) -> Figure:
    """Fig. 5: tree, path and point turns of one planner."""
    figure = _figure(6.0, 6.4)
    ax = figure.subplots()
    _draw_result(ax, result, scenario)
    turns = 0 if result.trajectory is None else len(result.trajectory.point_turns)
    ax.set_title(f"{NAMES[result.planner]}: {result.nodes:,} nodes, {turns} point turn{'s' if turns != 1 else ''}")
    _legend_below(figure)
    return figure


def velocities_figure(result: PlanResult, scenario: Scenario) -> Figure:
    """Fig. 6: both velocities over time, a dot every second."""
    figure = _figure(8.6, 4.6)
    axes = figure.subplots(2, sharex=True)
    if result.trajectory is not None:
        draw_velocities(axes, result.trajectory, scenario.robot.limits)
    figure.align_ylabels(axes)
    _legend_below(figure)
    return figure


def nodes_figure(outcomes: Outcomes) -> Figure:
    """Nodes of every run beside the published number, on a logarithmic axis; failures stand at the right."""
    rows = [
        (scene, sample)
        for scene, planner in PAPER
        for suffix in ("", "-compiled")
        if (sample := outcomes.get(scene, planner + suffix)) is not None and sample.succeeded.count
    ]
    figure = _figure(8.6, 1.2 + 0.42 * len(rows))
    ax = figure.subplots()
    most = max((run.nodes for _, sample in rows for run in sample.found), default=1)
    failed = 2.2 * most
    for row, (scene, sample) in enumerate(rows):
        twin = sample.key.planner.removesuffix("-compiled")
        values = np.where(np.isinf(sample.values("nodes")), failed, sample.values("nodes"))
        offsets = np.random.default_rng(row).uniform(-0.22, 0.22, len(values))
        ax.plot(values, row + offsets, "o", markersize=2.6, color=COLORS[twin], alpha=0.4, markeredgewidth=0.0)
        low, median, high = (min(value, failed) for value in sample.quartiles("nodes"))
        ax.plot([low, high], [row, row], color=COLORS[twin], linewidth=5.0, alpha=0.45, solid_capstyle="butt")
        ax.plot([median], [row], "|", color=COLORS[twin], markersize=17, markeredgewidth=2.2)
        published = PAPER[scene, twin].nodes
        if published is not None:
            ax.plot([published], [row], "D", color="black", markersize=5.5, label="paper" if row == 0 else None)
    ax.axvspan(1.6 * most, 3.0 * most, color="0.93", linewidth=0.0, zorder=0)
    ax.set_xscale("log")
    ax.set_xlim(right=3.0 * most)
    ax.set_ylim(len(rows) - 0.5, -0.5)
    labels = [
        f"{title_of(scene)}, {NAMES[sample.key.planner.removesuffix('-compiled')]}"
        f" {'compiled' if sample.key.planner.endswith('-compiled') else 'in OMPL'}"
        for scene, sample in rows
    ]
    ax.set_yticks(range(len(rows)), labels)
    ax.set_xlabel("nodes of the tree: every run, quartiles and median; failures in the grey band")
    ax.grid(axis="x", color="0.9", linewidth=0.6)
    ax.set_axisbelow(True)
    _plain_ticks(ax)
    legend_above(ax)
    return figure


def shifts_figure(outcomes: Outcomes, shifts: Sequence[float]) -> Figure:
    """Median nodes of both compiled planners in both cases, against how far the gaps were moved."""
    figure = _figure(8.6, 4.0)
    for ax, scene in zip(figure.subplots(1, 2), (CASE_1, CASE_2), strict=True):
        for planner in COMPILED:
            twin = planner.removesuffix("-compiled")
            offsets = sorted({*shifts, 0.0})
            samples = [outcomes.get(scene, planner, shift_title(offset) if offset else "") for offset in offsets]
            shown = [
                (100.0 * offset, sample.quartiles("nodes").median, *sample.median_interval("nodes"))
                for offset, sample in zip(offsets, samples, strict=True)
                if sample is not None and math.isfinite(sample.quartiles("nodes").median)
            ]
            if not shown:
                ax.plot([], [], color=COLORS[twin], marker=MARKERS[twin], label=f"{NAMES[twin]}: no median, it fails")
                continue
            x, median, low, high = np.array(shown).T
            bars = np.array([median - low, np.where(np.isinf(high), 10.0 * median, high) - median]).tolist()
            ax.errorbar(
                x, median, bars, color=COLORS[twin], marker=MARKERS[twin], markersize=5, capsize=3, linewidth=1.4,
                label=NAMES[twin],
            )  # fmt: skip
            published = PAPER[scene, twin].nodes
            if published is not None:
                ax.plot(
                    [0.0], [published], "D", color="black", markersize=6, zorder=5, label=_once(ax, "paper's number")
                )
        ax.set_title(title_of(scene))
        ax.set_yscale("log")
        _plain_ticks(ax, "y")
        ax.set_xlabel("gaps moved by [cm]")
        ax.set_ylabel("nodes, median and 95 % interval")
        ax.grid(color="0.9", linewidth=0.6)
        ax.set_axisbelow(True)
        legend_above(ax)
    return figure


def neighbours_figure(costs: QueryCosts) -> Figure:
    """Time of a nearest-neighbour query against the number of nodes."""
    figure = _figure(6.4, 4.0)
    ax = figure.subplots()
    for kind, color in KIND_COLORS.items():
        sizes = sorted(size for known, size in costs if known == kind)
        times = [1e9 * float(np.median(costs[kind, size])) for size in sizes]
        ax.plot(sizes, times, color=color, marker=MARKERS[kind], label=kind.replace("-", " ").replace("kd", "k-d"))
    for nodes in sorted({published.nodes for published in PAPER.values() if published.nodes is not None}):
        ax.axvline(nodes, color="0.6", linewidth=0.8, linestyle="--", label=_once(ax, "published trees"))
    ax.set_xscale("log")
    ax.set_yscale("log")
    _plain_ticks(ax)
    _plain_ticks(ax, "y")
    ax.set_xlabel("nodes of the tree")
    ax.set_ylabel("time of a query [ns]")
    ax.grid(color="0.9", linewidth=0.6)
    ax.set_axisbelow(True)
    legend_above(ax)
    return figure


def grid_figure(result: PlanResult, scenario: Scenario, paths: Mapping[float, GridPath]) -> Figure:
    """Paths on grids beside the trajectory of CB-RRT."""
    figure = _figure(6.0, 6.4)
    ax = figure.subplots()
    draw_scene(ax, scenario)
    if result.trajectory is not None:
        draw_trajectory(ax, result.trajectory)
    for (cell, path), (color, dashes) in zip(paths.items(), (("#AA4499", "-"), ("#DD7700", "--")), strict=False):
        ax.plot(
            *path.points.T, color=color, linestyle=dashes, marker="o", markersize=3.2, linewidth=1.3, zorder=3.5,
            label=f"grid of {cell:g} m: {len(path.turns)} corners",
        )  # fmt: skip
    _legend_below(figure)
    return figure


def readings_figure(ratios: Mapping[str, Mapping[str, tuple[float, float, float]]]) -> Figure:
    """Median nodes under other readings as multiples of ours, with intervals, a panel a series.

    Args:
        ratios: for each panel's title, by reading: ratio, lower and upper end; an infinite ratio stands for failure.
    """
    readings = list(next(iter(ratios.values())))
    figure = _figure(9.6, 1.1 + 0.3 * len(readings))
    panels = figure.subplots(1, len(ratios), sharey=True, sharex=True)
    for ax, (title, found) in zip(np.atleast_1d(panels), ratios.items(), strict=True):
        ax.axvline(1.0, color="0.5", linewidth=1.0)
        for row, (value, low, high) in enumerate(found.values()):
            if math.isinf(value):
                ax.annotate("fails", (16.0, row), ha="right", va="center", fontsize=7.5, color="#CC3311")
            elif not math.isnan(value):
                ax.plot([max(low, 0.04), min(high, 20.0)], [row, row], color="#0072B2", linewidth=1.6)
                ax.plot([value], [row], "o", color="#0072B2", markersize=4.5)
        ax.set_xscale("log")
        ax.set_xlim(0.05, 20.0)
        ax.set_xticks([0.1, 0.3, 1, 3, 10], ["0.1", "0.3", "1", "3", "10"])
        ax.minorticks_off()
        ax.tick_params(labelsize=7.5)
        ax.set_title(title, fontsize=8.5)
        ax.grid(axis="x", color="0.9", linewidth=0.6)
        ax.set_axisbelow(True)
        ax.set_yticks(range(len(readings)), readings)
        ax.set_ylim(len(readings) - 0.5, -0.5)
    figure.supxlabel("median nodes, as a multiple of those under our reading, 95 % interval", fontsize=8.5)
    return figure


def _figure(width: float, height: float) -> Figure:
    """A figure of a size [in]."""
    return Figure(figsize=(width, height), layout="constrained", dpi=150)


def _draw_result(ax: Axes, result: PlanResult, scenario: Scenario) -> None:
    """Scene, tree and path."""
    draw_scene(ax, scenario)
    draw_tree(ax, result.tree)
    if result.trajectory is not None:
        draw_trajectory(ax, result.trajectory, scenario.robot.footprint)


def _once(ax: Axes, label: str) -> str | None:
    """A label, if the axes have no such one yet."""
    return None if label in ax.get_legend_handles_labels()[1] else label


def _legend_below(figure: Figure) -> None:
    """One legend for all axes, below them."""
    shown: dict[str, Artist] = {}
    for ax in figure.axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            shown.setdefault(label, handle)
    columns = min(len(shown), int(figure.get_figwidth() / LEGEND_COLUMN))
    style: dict[str, Any] = {"fontsize": 8, "frameon": False, "columnspacing": 1.2, "handlelength": 1.6}
    figure.legend(
        shown.values(), shown.keys(), loc="outside lower center", ncols=columns,
        handler_map={PathCollection: HandlerPolyCollection()}, **style,
    )  # fmt: skip


def _plain_ticks(ax: Axes, axis: str = "x") -> None:
    """Write the ticks of a logarithmic axis as plain numbers."""
    one = ax.xaxis if axis == "x" else ax.yaxis
    low, high = one.get_view_interval()
    decades = math.log10(high / low)
    one.set_major_locator(LogLocator(subs=(1.0,) if decades > 3.0 else (1.0, 2.0, 5.0) if decades > 1.0 else range(10)))
    one.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}"))
    one.set_minor_formatter(NullFormatter())
