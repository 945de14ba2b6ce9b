"""Figure of an improvement: the trajectory before and after, and the duration against the time it took."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cbrrt_ompl.figures.figures import COMMAND_COLOR, PATH_COLOR, draw_scene, draw_trajectory, legend_above
from cbrrt_ompl.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from cbrrt_ompl.optimise import Found
    from cbrrt_ompl.scenario.scenario import Scenario


def draw_improvement(given: Trajectory, better: Trajectory, history: Sequence[Found], scenario: Scenario) -> Figure:
    """Draw a trajectory before and after its improvement beside the history of it.

    Args:
        given: the trajectory before.
        better: the trajectory after.
        history: when which guess gave what.
        scenario: where both lead through.

    Returns:
        A new figure.
    """
    figure = Figure(figsize=(11.0, 5.0), layout="constrained")
    plane, times = figure.subplots(1, 2, width_ratios=(1.4, 1.0))
    draw_scene(plane, scenario)
    plane.plot(given.x, given.y, color=COMMAND_COLOR, linestyle="--", linewidth=1.2, zorder=2.5, label="before")
    draw_trajectory(plane, better, scenario.robot.footprint)
    legend_above(plane)
    draw_history(times, history)
    times.set_title(f"{given.duration:.2f} s before, {better.duration:.2f} s after", fontsize=10)
    return figure


def draw_history(ax: Axes, history: Sequence[Found]) -> Axes:
    """Draw the duration of the best trajectory against the time at which it was found, as steps.

    Args:
        ax: axes of their own.
        history: rows of time [s], duration [s] and source.

    Returns:
        The axes.
    """
    times, durations = 1e3 * np.array([row.time for row in history]), [row.duration for row in history]
    ax.step(times, durations, where="post", color=PATH_COLOR, marker="o", markersize=4.0, label="best so far")
    for time, row in zip(times, history, strict=True):
        ax.annotate(row.source, (time, row.duration), xytext=(5.0, 5.0), textcoords="offset points", fontsize=7)
    ax.set_xlabel("time [ms]")
    ax.set_ylabel("duration of the trajectory [s]")
    ax.set_ylim(bottom=0.0)
    ax.margins(x=0.45)
    ax.grid(alpha=0.3)
    return ax
