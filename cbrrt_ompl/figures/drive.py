"""Drives in the plane: the way driven, the obstacles found on it, and the sight."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection, PolyCollection

from cbrrt_ompl.figures.drive_history import view_at
from cbrrt_ompl.figures.layout import ShownFigure, plane_and_curves
from cbrrt_ompl.figures.scene import draw_scene, obstacle_path
from cbrrt_ompl.figures.style import COMMAND_COLOR, PATH_COLOR, SEEN_COLOR, TREE_COLOR, legend_above
from cbrrt_ompl.figures.trajectory import draw_trajectory
from cbrrt_ompl.figures.velocities import draw_velocities

if TYPE_CHECKING:
    from cbrrt_ompl.drive.result import DriveResult


def draw_drive(result: DriveResult) -> ShownFigure:
    """Draw what came of a drive: the world, what was found, the way and the places of the plans, and three curves.

    Args:
        result: what :func:`cbrrt_ompl.drive.drive` returned.

    Returns:
        A figure of its own, not known to pyplot.
    """
    scenario, trajectory = result.scenario, result.trajectory
    panels = plane_and_curves(scenario.world.bounds, 3)
    plane = panels.plane
    taken = sum(replan.trajectory is not None for replan in result.replans)
    panels.figure.suptitle(
        f"{textwrap.fill(f'{scenario.name}, {result.settings.planner}', 56)}\n{result.status} after "
        f"{trajectory.duration:.2f} s, {taken} plans taken of {len(result.replans)}",
        fontsize=9,
        parse_math=False,
    )
    draw_scene(plane, scenario)
    draw_seen(plane, result)
    draw_unknown(plane, result)
    draw_trajectory(plane, trajectory, scenario.robot.footprint)
    starts = np.array([replan.start[:2] for replan in result.replans if replan.trajectory is not None]).reshape(-1, 2)
    plane.plot(
        *starts.T,
        linestyle="none",
        marker="D",
        markersize=4.5,
        color="white",
        markeredgecolor="black",
        zorder=5.5,
        scalex=False,
        scaley=False,
        label="new plan",
    )
    draw_velocities(panels.curves[:2], trajectory, scenario.robot.limits)
    draw_computing_times(panels.curves[2], result)
    return panels.finish()


def draw_seen(ax: Axes, result: DriveResult) -> PolyCollection | None:
    """Shade what was in line of sight at the looks of a drive, where obstacles hid something.

    Args:
        ax: axes of the plane.
        result: what :func:`cbrrt_ompl.drive.drive` returned.

    Returns:
        The space seen; None where obstacles hid nothing.
    """
    views = [view for cycle in result.cycles if (view := view_at(result, cycle.time)) is not None]
    if not views:
        return None
    seen = PolyCollection(views, facecolor=SEEN_COLOR, edgecolor="none", zorder=0.5, label="seen")
    ax.add_collection(seen, autolim=False)
    return seen


def draw_unknown(ax: Axes, result: DriveResult) -> tuple[PathCollection, PathCollection]:
    """Draw the obstacles that a drive did not know at its start.

    Args:
        ax: axes of the plane.
        result: what :func:`cbrrt_ompl.drive.drive` returned.

    Returns:
        Those never seen, as dotted outlines, and those found on the way, hatched.
    """
    found = {id(obstacle) for cycle in result.cycles for obstacle in cycle.seen}
    unseen = PathCollection(
        [obstacle_path(o) for o in result.hidden if id(o) not in found],
        facecolor="none",
        edgecolor="0.45",
        linestyle=":",
        linewidth=0.9,
        zorder=1.0,
        label="unknown",
    )
    seen = PathCollection(
        [obstacle_path(o) for o in result.hidden if id(o) in found],
        facecolor="0.85",
        edgecolor="0.15",
        hatch="/////",
        linewidth=0.9,
        zorder=1.1,
        label="found",
    )
    for collection in (unseen, seen):
        ax.add_collection(collection, autolim=False)
    return unseen, seen


def draw_computing_times(ax: Axes, result: DriveResult) -> Axes:
    """Draw what the cycles of a drive took to compute, over time, against the time of a cycle.

    Args:
        ax: axes; the time is on a logarithmic scale.
        result: what :func:`cbrrt_ompl.drive.drive` returned.

    Returns:
        The axes.
    """
    times = np.array([cycle.time for cycle in result.cycles])
    computing = 1e3 * np.maximum(result.computing_times, 1e-5)
    limit = 1e3 * result.settings.cycle
    ax.axhline(limit, color="black", linestyle="--", linewidth=0.9, label="cycle time")
    ax.plot(times, computing, color=COMMAND_COLOR, linewidth=0.8, label="all computing")
    for is_taken, marker, color, label in ((True, "o", PATH_COLOR, "plan"), (False, "X", TREE_COLOR, "no plan")):
        searches = [search for search in result.searches if (search.trajectory is not None) == is_taken]
        if searches:
            ax.plot(
                [search.time for search in searches],
                [1e3 * max(search.planning_time, 1e-5) for search in searches],
                linestyle="none",
                marker=marker,
                markersize=4.5,
                markerfacecolor=color,
                markeredgecolor="white",
                markeredgewidth=0.5,
                label=label,
            )
    ax.set_yscale("log")
    ax.set_ylim(0.05, 3.0 * max(limit, float(computing.max(initial=0.0))))
    legend_above(ax)
    ax.set_ylabel("computing [ms]")
    ax.set_xlabel("t [s]")
    ax.grid(True, linewidth=0.4, color="0.88")
    ax.set_axisbelow(True)
    return ax
