"""The path of a trajectory, its point turns, and the footprint along it."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgba
from numpy.typing import NDArray

from cbrrt_ompl.figures.style import HALO, PATH_COLOR, TURN_COLOR
from cbrrt_ompl.problem.robot import Footprint
from cbrrt_ompl.trajectory.trajectory import Trajectory

FOOTPRINTS_ALONG_PATH = 60
"""Outlines of the footprint along a path, at most."""


def draw_trajectory(ax: Axes, trajectory: Trajectory, footprint: Footprint | None = None) -> Axes:
    """Draw the path in green, point turns as blue squares, and the footprint now and then.

    Args:
        ax: axes of the plane.
        trajectory: what is drawn.
        footprint: the robot's area; None or a point draws none.

    Returns:
        The axes.
    """
    if footprint is not None and footprint.kind != "point":
        outlines = [footprint.outline_at(pose, segments=32) for pose in poses_along(trajectory, footprint)]
        ax.add_collection(
            PolyCollection(
                outlines,
                facecolor=to_rgba(PATH_COLOR, 0.12),
                edgecolor=to_rgba(PATH_COLOR, 0.7),
                linewidth=0.5,
                zorder=2.5,
                label="footprint",
            ),
            autolim=False,
        )
    style: dict[str, Any] = {"scalex": False, "scaley": False}
    ax.plot(
        trajectory.x,
        trajectory.y,
        color=PATH_COLOR,
        linewidth=1.8,
        path_effects=HALO,
        solid_capstyle="round",
        zorder=4,
        label="path",
        **style,
    )
    turns = trajectory.point_turns
    if turns:
        ax.plot(
            [turn.x for turn in turns],
            [turn.y for turn in turns],
            linestyle="none",
            marker="s",
            markersize=5.0,
            markerfacecolor=TURN_COLOR,
            markeredgecolor="white",
            markeredgewidth=0.6,
            zorder=5,
            label="point turn",
            **style,
        )
    return ax


def poses_along(trajectory: Trajectory, footprint: Footprint) -> NDArray[np.float64]:
    """Poses spaced by at least the size of the footprint along the path, the last one among them, shape (k, 3)."""
    way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(trajectory.x), np.diff(trajectory.y)))])
    spacing = max(2.0 * footprint.circumscribed_radius, way[-1] / FOOTPRINTS_ALONG_PATH)
    wanted = np.arange(way[-1], 0.0, -spacing) if spacing > 0.0 else way[-1:]
    rows = np.searchsorted(way, wanted) if len(wanted) else np.array([len(way) - 1])
    return trajectory.poses[np.unique(rows)]
