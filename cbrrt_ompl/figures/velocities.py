"""Both velocities of a trajectory over time."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from cbrrt_ompl.figures.style import COMMAND_COLOR, PATH_COLOR, TURN_COLOR
from cbrrt_ompl.problem.robot import Limits
from cbrrt_ompl.trajectory.trajectory import Trajectory


def draw_velocities(axes: Sequence[Axes], trajectory: Trajectory, limits: Limits) -> Sequence[Axes]:
    """Draw both velocities over time with their commands and limits, a dot every second, as in the paper's Fig. 6.

    Args:
        axes: axes for v [m/s] and for omega [deg/s].
        trajectory: what is drawn.
        limits: the ranges, drawn as dashed lines.

    Returns:
        The axes.
    """
    seconds = trajectory.t[0] + np.arange(math.floor(trajectory.duration) + 1)
    dots = trajectory.at(np.minimum(seconds, trajectory.t[-1]))
    degrees = math.degrees(1.0)
    for ax, values, commands, at_seconds, low, high, label in (
        (axes[0], trajectory.v, trajectory.v_command, dots[:, 3], limits.v_min, limits.v_max, "v [m/s]"),
        (
            axes[1],
            degrees * trajectory.omega,
            degrees * trajectory.omega_command,
            degrees * dots[:, 4],
            degrees * limits.omega_min,
            degrees * limits.omega_max,
            r"$\omega$ [deg/s]",
        ),
    ):
        for limit in (low, high):
            ax.axhline(limit, color="black", linestyle="--", linewidth=0.9, label="limit" if limit == high else None)
        ax.plot(trajectory.t, commands, color=COMMAND_COLOR, linewidth=0.7, drawstyle="steps-post", label="command")
        ax.plot(
            trajectory.t,
            values,
            color=PATH_COLOR,
            linewidth=1.5,
            drawstyle="steps-pre" if trajectory.kinematic else "default",
            label="velocity",
        )
        ax.plot(
            seconds,
            at_seconds,
            linestyle="none",
            marker="o",
            markersize=3.2,
            markerfacecolor=TURN_COLOR,
            markeredgewidth=0.0,
            label="every second",
        )
        margin = 0.12 * (high - low)
        ax.set_ylim(
            min(low, values.min(), commands.min()) - margin,
            max(high, values.max(), commands.max()) + margin,
        )
        ax.set_xlim(trajectory.t[0], max(float(trajectory.t[-1]), float(trajectory.t[0]) + 1e-3))
        ax.set_ylabel(label)
        ax.grid(True, linewidth=0.4, color="0.88")
        ax.set_axisbelow(True)
    axes[1].set_xlabel("t [s]")
    return axes
