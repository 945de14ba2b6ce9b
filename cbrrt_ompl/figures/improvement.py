"""Figure of an improvement: the trajectory before and after, and the duration against the time it took."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from cbrrt_ompl.figures.layout import ShownFigure, plane_and_curves
from cbrrt_ompl.figures.scene import draw_scene
from cbrrt_ompl.figures.style import COMMAND_COLOR, PATH_COLOR, legend_above, shrink_labels, time_text
from cbrrt_ompl.figures.trajectory import draw_trajectory
from cbrrt_ompl.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from cbrrt_ompl.optimise import Found
    from cbrrt_ompl.scenario.scenario import Scenario


def draw_improvement(
    given: Trajectory, better: Trajectory, history: Sequence[Found], scenario: Scenario
) -> ShownFigure:
    """Draw a trajectory before and after its improvement with the history of it beside or below.

    Args:
        given: the trajectory before.
        better: the trajectory after.
        history: when which guess gave what.
        scenario: where both lead through.

    Returns:
        A new figure.
    """
    figure, plane, (times,), _ = plane_and_curves(scenario.world.bounds, 1)
    draw_scene(plane, scenario)
    plane.plot(given.x, given.y, color=COMMAND_COLOR, linestyle="--", linewidth=1.2, zorder=2.5, label="before")
    draw_trajectory(plane, better, scenario.robot.footprint)
    legend_above(plane)
    draw_history(times, history)
    figure.suptitle(
        f"{scenario.name}\n{given.duration:.2f} s before, {better.duration:.2f} s after, "
        f"found after {time_text(history[-1].time if history else 0.0)}",
        fontsize=9,
        parse_math=False,
    )
    shrink_labels(figure)
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
    ax.set_ylabel("duration [s]")
    ax.set_ylim(0.0, 1.25 * max(durations, default=1.0))
    ax.set_xlim(0.0, 1.45 * max(times, default=1.0))
    ax.grid(alpha=0.3)
    return ax
