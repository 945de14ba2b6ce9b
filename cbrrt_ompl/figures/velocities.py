"""Both velocities of a trajectory over time."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from cbrrt_ompl.figures.style import COMMAND_COLOR, PATH_COLOR, TURN_COLOR
from cbrrt_ompl.problem.robot import Limits
from cbrrt_ompl.trajectory.trajectory import Trajectory

MOST_DOTS = 40
"""Dots along a curve: more of them hide it."""

PERIODS = tuple(factor * 10**power for power in range(12) for factor in (1, 2, 5))
"""Times between two dots [s]."""


def draw_velocities(axes: Sequence[Axes], trajectory: Trajectory, limits: Limits | None) -> Sequence[Axes]:
    """Draw both velocities over time with their commands and limits, a dot every second, as in the paper's Fig. 6.

    Of a long trajectory every second, fifth, tenth, ... second has one.

    Args:
        axes: axes for v [m/s] and for omega [deg/s].
        trajectory: what is drawn.
        limits: the ranges, drawn as dashed lines; None where they are not known.

    Returns:
        The axes.
    """
    period = next(period for period in PERIODS if trajectory.duration <= MOST_DOTS * period)
    seconds = trajectory.t[0] + np.arange(0, math.floor(trajectory.duration) + 1, period)
    dots = trajectory.at(np.minimum(seconds, trajectory.t[-1]))
    for ax, name, column, unit, label in (
        (axes[0], "v", 3, 1.0, "v [m/s]"),
        (axes[1], "omega", 4, math.degrees(1.0), r"$\omega$ [deg/s]"),
    ):
        values, commands = unit * getattr(trajectory, name), unit * getattr(trajectory, f"{name}_command")
        ends = () if limits is None else tuple(unit * getattr(limits, f"{name}_{end}") for end in ("min", "max"))
        for limit in ends:
            ax.axhline(limit, color="black", linestyle="--", linewidth=0.9, label="limit" if limit == ends[1] else None)
        _draw_curve(ax, trajectory, values, commands)
        ax.plot(
            seconds,
            unit * dots[:, column],
            linestyle="none",
            marker="o",
            markersize=3.2,
            markerfacecolor=TURN_COLOR,
            markeredgewidth=0.0,
            label="every second" if period == 1 else f"every {period:,} s",
        )
        shown = np.array([*ends, values.min(), commands.min(), values.max(), commands.max()])
        margin = 0.12 * float(np.ptp(ends or shown)) or 0.1
        ax.set_ylim(shown.min() - margin, shown.max() + margin)
        ax.set_xlim(trajectory.t[0], max(float(trajectory.t[-1]), float(trajectory.t[0]) + 1e-3))
        ax.set_ylabel(label)
        ax.grid(True, linewidth=0.4, color="0.88")
        ax.set_axisbelow(True)
    axes[1].set_xlabel("t [s]")
    return axes


def _draw_curve(ax: Axes, trajectory: Trajectory, values: NDArray[np.float64], commands: NDArray[np.float64]) -> None:
    """One velocity and its commands."""
    ax.plot(trajectory.t, commands, color=COMMAND_COLOR, linewidth=0.7, drawstyle="steps-post", label="command")
    style = "steps-pre" if trajectory.kinematic else "default"
    ax.plot(trajectory.t, values, color=PATH_COLOR, linewidth=1.5, drawstyle=style, label="velocity")
