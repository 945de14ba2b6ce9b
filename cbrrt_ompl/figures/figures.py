"""Figures of worlds, trees and trajectories: each function draws on the axes given to it, none shows or saves.

The colours keep the paper's convention (tree red, path green, point turns blue) in shades that colour-blind readers
tell apart; line widths and markers tell them apart in grey print.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.legend_handler import HandlerPolyCollection
from matplotlib.patches import Arc, Circle, Polygon, Rectangle, Wedge
from matplotlib.path import Path
from numpy.typing import NDArray

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.problem.obstacles import Bounds, Box, Disc, Obstacle
from cbrrt_ompl.problem.robot import Footprint, Limits, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.trajectory.tree import Tree

if TYPE_CHECKING:
    from cbrrt_ompl.drive.result import DriveResult
    from cbrrt_ompl.planning import PlanResult
    from cbrrt_ompl.scenario.scenario import Scenario

TREE_COLOR = "#CC3311"
PATH_COLOR = "#007A5E"
TURN_COLOR = "#0072B2"
START_COLOR = "black"
GOAL_COLOR = "#E69F00"
OBSTACLE_COLOR = "0.62"
COMMAND_COLOR = "0.45"
REFERENCE_COLOR = "#0072B2"

FOOTPRINTS_ALONG_PATH = 20
"""Outlines of the footprint along a path, at most."""

_HALO = [patheffects.withStroke(linewidth=3.4, foreground="white")]


def draw_world(ax: Axes, world: World) -> Axes:
    """Draw bounds and obstacles, the obstacles as one collection.

    Args:
        ax: axes of the plane; their limits and labels are set.
        world: what is drawn.

    Returns:
        The axes.
    """
    paths = [obstacle_path(obstacle) for obstacle in world.obstacles]
    solids = PathCollection(paths, facecolor=OBSTACLE_COLOR, edgecolor=OBSTACLE_COLOR, linewidth=0.4, zorder=1)
    solids.set_label("obstacle" if paths else "_nolegend_")
    ax.add_collection(solids, autolim=False)
    (x0, y0), (width, height) = world.bounds.min, world.bounds.size
    border = Rectangle((x0, y0), width, height, fill=False, edgecolor="black", linewidth=1.0, zorder=3)
    border.set_gid("bounds")
    ax.add_patch(border)
    margin = 0.015 * max(width, height)
    ax.set_xlim(x0 - margin, x0 + width + margin)
    ax.set_ylim(y0 - margin, y0 + height + margin)
    ax.set_aspect("equal", adjustable="box")
    ax.spines[:].set_visible(False)  # the bounds are the frame
    ax.set_xlabel("x [m]")
    ax.set_ylabel("y [m]")
    return ax


def draw_scene(ax: Axes, scenario: Scenario) -> Axes:
    """Draw the world, the footprint and heading at the start, and the goal region.

    Args:
        ax: axes of the plane; their limits and labels are set.
        scenario: what is drawn.

    Returns:
        The axes.
    """
    draw_world(ax, scenario.world)
    draw_start(ax, scenario.start, scenario.robot.footprint, scenario.world.bounds)
    draw_goal(ax, scenario.goal, scenario.world.bounds)
    return ax


def draw_tree(ax: Axes, tree: Tree) -> Axes:
    """Draw nodes as small red dots and edges as thin red lines, as in the paper's Fig. 4.

    Args:
        ax: axes of the plane.
        tree: what is drawn.

    Returns:
        The axes.
    """
    size = 1.0 + 2.0 / (1.0 + len(tree) / 500.0)
    x, y = tree.polyline.T
    ax.plot(x, y, color=TREE_COLOR, linewidth=0.5, alpha=0.7, zorder=2, scalex=False, scaley=False, label="edge")
    ax.plot(
        tree.states[:, 0],
        tree.states[:, 1],
        linestyle="none",
        marker="o",
        markersize=size,
        markeredgewidth=0.0,
        color=TREE_COLOR,
        zorder=2.1,
        scalex=False,
        scaley=False,
        label="node",
    )
    return ax


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
        outlines = [footprint.outline_at(pose, segments=32) for pose in _poses_along(trajectory, footprint)]
        ax.add_collection(
            PolyCollection(
                outlines,
                facecolor="none",
                edgecolor=PATH_COLOR,
                linewidth=0.6,
                alpha=0.8,
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
        path_effects=_HALO,
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


def draw_extension(
    ax: Axes,
    node: State,
    sample: tuple[float, float],
    robot: Robot,
    planning: PlanningSettings,
    planner: str = "cb-rrt",
) -> Axes:
    """Draw one extension as if there were no obstacles: Fig. 1 of the paper for CB-RRT, Fig. 2 for S-RRT.

    The reference lies on the way to the sample. For CB-RRT its error posture (x_e, y_e, theta_e), seen from the node,
    is drawn with the motion that the law makes of it, a dot every half second; for S-RRT the three choices of
    steering, the one that ends nearest to the reference in bold.

    Args:
        ax: axes of the plane; their aspect and labels are set.
        node: state to extend.
        sample: position to drive towards [m].
        robot: limits and gains.
        planning: horizon, step and look-ahead.
        planner: `cb-rrt` or `s-rrt`.

    Returns:
        The axes.
    """
    from cbrrt_ompl.motion.control_laws import reference_pose  # here, since a figure of a world needs no kernels
    from cbrrt_ompl.motion.model import STEERING, make_model
    from cbrrt_ompl.planners.registry import law_of
    from cbrrt_ompl.trajectory.replay import extension_trajectories

    law = law_of(planner, planning)
    model = make_model(law, robot, Goal(0.0, 0.0), planning)
    reference = reference_pose(*node[:3], *sample, planning.reference_distance(robot.limits))
    trajectories = extension_trajectories(node, sample, model)
    distances = [math.hypot(one.x[-1] - reference[0], one.y[-1] - reference[1]) for one in trajectories]
    mark = 0.3 * max(math.dist(node[:2], reference[:2]), 0.5)
    ax.plot(*zip(node[:2], sample, strict=True), color=COMMAND_COLOR, linewidth=0.9, linestyle=":", label="way")
    ax.plot(*sample, linestyle="none", marker="x", markersize=7, color="black", label="sample")
    if law != STEERING:
        _draw_error_posture(ax, node, reference, mark)
    for one, distance in zip(trajectories, distances, strict=True):
        chosen = distance == min(distances)
        label = "motion" if chosen else "left out"
        color, width = (PATH_COLOR, 2.0) if chosen else (TREE_COLOR, 0.9)
        ax.plot(one.x, one.y, color=color, linewidth=width, zorder=3, label=label)
        dots = one.at(np.arange(one.t[0], one.t[-1], 0.5))
        ax.plot(dots[:, 0], dots[:, 1], linestyle="none", marker="o", markersize=3.0, color=color, zorder=3)
        if chosen:
            end = one.poses[-1]
    ring: dict[str, Any] = {"marker": "o", "markersize": 9, "fillstyle": "none", "markeredgewidth": 1.6}
    marks: tuple[tuple[Any, str, str, dict[str, Any]], ...] = (
        (end, TREE_COLOR, "new node", ring),
        (reference, REFERENCE_COLOR, "reference", {"marker": "D", "markersize": 5}),
        (node[:3], START_COLOR, "node", {"marker": "o", "markersize": 5}),
    )
    for (x, y, theta), color, label, style in marks:
        ax.plot(x, y, linestyle="none", color=color, zorder=5, label=label, **style)
        ax.update_datalim([(x + mark * math.cos(theta), y + mark * math.sin(theta))])
        _draw_heading(ax, x, y, theta, mark, color)
    ax.margins(0.15)
    ax.set_aspect("equal", adjustable="datalim")
    ax.set_xlabel("x [m]")
    ax.set_ylabel("y [m]")
    ax.grid(True, linewidth=0.4, color="0.88")
    ax.set_axisbelow(True)
    legend_above(ax)
    return ax


def _draw_error_posture(ax: Axes, node: State, reference: tuple[float, float, float], mark: float) -> None:
    """The reference as the node sees it: x_e along its heading, y_e to the left, and theta_e between the headings."""
    from cbrrt_ompl.motion.control_laws import error_posture

    x_error, y_error, theta_error = error_posture(*node[:3], reference)
    ahead = np.array([math.cos(node.theta), math.sin(node.theta)])
    corner = np.array(node[:2]) + x_error * ahead
    legs = np.array([node[:2], corner, reference[:2]])
    ax.plot(*legs.T, color=REFERENCE_COLOR, linewidth=1.1, linestyle="--", label="error posture")
    degrees = [math.degrees(angle) for angle in (node.theta, node.theta + theta_error)]
    ax.add_patch(Arc(reference[:2], mark, mark, theta1=min(degrees), theta2=max(degrees), color=REFERENCE_COLOR))
    ax.plot(*zip(reference[:2], np.add(reference[:2], mark * ahead), strict=True), color=REFERENCE_COLOR, linewidth=0.7)
    for text, position in (
        (rf"$x_e$ = {x_error:.2f} m", (legs[0] + legs[1]) / 2),
        (rf"$y_e$ = {y_error:.2f} m", (legs[1] + legs[2]) / 2),
        (rf"$\theta_e$ = {math.degrees(theta_error):.0f}°", legs[2]),
    ):
        ax.annotate(
            text, position, xytext=(6, -12), textcoords="offset points", fontsize=8, color=REFERENCE_COLOR,
            path_effects=_HALO, zorder=7,
        )  # fmt: skip


def draw_plan(result: PlanResult, scenario: Scenario) -> Figure:
    """Draw what a planner found: scene, tree and path beside the two velocity curves.

    Args:
        result: what :func:`cbrrt_ompl.planning.plan` returned, solved or not.
        scenario: what it was planned for.

    Returns:
        A figure of its own, not known to pyplot, as wide as two columns of a paper.
    """
    trajectory = result.trajectory
    width, height = scenario.world.bounds.size
    tall = min(max(3.5 * height / width, 2.4), 6.0)
    figure = Figure(figsize=(7.2 if trajectory is not None else 4.6, tall + 0.9), layout="constrained", dpi=150)
    figure.suptitle(plan_title(result, scenario), fontsize=9, parse_math=False)
    if trajectory is None:
        plane = figure.add_subplot()
    else:
        grid = figure.add_gridspec(2, 2, width_ratios=(1.15, 1.0))
        plane = figure.add_subplot(grid[:, 0])
        upper = figure.add_subplot(grid[0, 1])
        lower = figure.add_subplot(grid[1, 1], sharex=upper)
        draw_velocities((upper, lower), trajectory, scenario.robot.limits)
        upper.tick_params(labelbottom=False)
        figure.align_ylabels((upper, lower))
        legend_above(upper)
    draw_scene(plane, scenario)
    draw_tree(plane, result.tree)
    if trajectory is not None:
        draw_trajectory(plane, trajectory, scenario.robot.footprint)
    legend_above(plane)
    _shrink_labels(figure)
    return figure


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
        replans = [replan for replan in result.replans if (replan.trajectory is not None) == is_taken]
        if replans:
            ax.plot(
                [replan.time for replan in replans],
                [1e3 * max(replan.planning_time, 1e-5) for replan in replans],
                linestyle="none",
                marker=marker,
                markersize=4.5,
                markerfacecolor=color,
                markeredgecolor="white",
                markeredgewidth=0.5,
                label=label,
            )
    ax.set_yscale("log")
    ax.set_ylim(0.05, 40.0 * max(limit, float(computing.max(initial=0.0))))  # room for the legend
    ax.legend(loc="upper center", ncols=4, fontsize=7.0, frameon=False, handlelength=1.6, columnspacing=1.2)
    ax.set_ylabel("computing [ms]")
    ax.set_xlabel("t [s]")
    ax.grid(True, linewidth=0.4, color="0.88")
    ax.set_axisbelow(True)
    return ax


def draw_drive(result: DriveResult) -> Figure:
    """Draw what came of a drive: the world, what was found, the way and the places of the plans, beside three curves.

    Args:
        result: what :func:`cbrrt_ompl.drive.drive` returned.

    Returns:
        A figure of its own, not known to pyplot, as wide as two columns of a paper.
    """
    scenario, trajectory = result.scenario, result.trajectory
    width, height = scenario.world.bounds.size
    tall = min(max(3.7 * height / width, 3.6), 6.0)
    figure = Figure(figsize=(7.6, tall + 0.9), layout="constrained", dpi=150)
    taken = sum(replan.trajectory is not None for replan in result.replans)
    figure.suptitle(
        f"{textwrap.fill(f'{scenario.name}, {result.settings.planner}', 56)}\n{result.status} after "
        f"{trajectory.duration:.2f} s, {taken} plans taken of {len(result.replans)}",
        fontsize=9,
        parse_math=False,
    )
    grid = figure.add_gridspec(3, 2, width_ratios=(1.25, 1.0))
    plane = figure.add_subplot(grid[:, 0])
    upper = figure.add_subplot(grid[0, 1])
    lower, clock = (figure.add_subplot(grid[row, 1], sharex=upper) for row in (1, 2))
    draw_scene(plane, scenario)
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
    draw_velocities((upper, lower), trajectory, scenario.robot.limits)
    lower.set_xlabel("")
    draw_computing_times(clock, result)
    for ax in (upper, lower):
        ax.tick_params(labelbottom=False)
    figure.align_ylabels((upper, lower, clock))
    for ax in (plane, upper):
        legend_above(ax)
    _shrink_labels(figure)
    return figure


def _shrink_labels(figure: Figure) -> None:
    """Make the labels of all axes small enough for a figure with several."""
    for ax in figure.axes:
        ax.tick_params(labelsize=8)
        ax.xaxis.label.set_fontsize(9)
        ax.yaxis.label.set_fontsize(9)


def plan_title(result: PlanResult, scenario: Scenario) -> str:
    """Scenario and planner; on another line nodes, samples, planning time and duration of the trajectory."""
    found = f"{result.trajectory.duration:.2f} s of driving" if result.trajectory is not None else result.status
    return (
        f"{textwrap.fill(f'{scenario.name}, {result.planner}', 56)}\n{result.nodes:,} nodes, "
        f"{result.samples:,} samples, {1e3 * result.planning_time:.3g} ms, {found}"
    )


def legend_above(ax: Axes) -> None:
    """Put the legend above the axes, where no data are."""
    handles, labels = ax.get_legend_handles_labels()
    shown = {label: handle for handle, label in zip(handles, labels, strict=True)}
    ax.legend(
        shown.values(),
        shown.keys(),
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
        ncols=4,
        fontsize=7.5,
        frameon=False,
        handlelength=1.6,
        columnspacing=1.2,
        handler_map={PathCollection: HandlerPolyCollection()},
    )


def obstacle_path(obstacle: Obstacle) -> Path:
    """Outline of an obstacle in the world, with its holes."""
    if isinstance(obstacle, Box):
        (x0, y0), (x1, y1) = obstacle.min, obstacle.max
        return Path(np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)]), closed=True)
    if isinstance(obstacle, Disc):
        return Path.circle(obstacle.center, obstacle.radius)
    rings = [obstacle.vertices, *(hole[::-1] for hole in obstacle.holes)]
    return Path.make_compound_path(*(Path(np.vstack([ring, ring[:1]]), closed=True) for ring in rings))


def draw_start(ax: Axes, start: State, footprint: Footprint, bounds: Bounds, color: str = START_COLOR) -> None:
    """Draw footprint and heading at the start."""
    x, y, theta = start[:3]
    if footprint.kind != "point":
        outline = footprint.outline_at((x, y, theta))
        ax.add_patch(Polygon(outline, fill=False, edgecolor=color, linewidth=1.0, zorder=6))
    _draw_heading(ax, x, y, theta, max(_mark(bounds), 1.3 * footprint.circumscribed_radius), color)
    ax.plot(
        x,
        y,
        linestyle="none",
        marker="o",
        markersize=4.5,
        color=color,
        zorder=6,
        scalex=False,
        scaley=False,
        label="start",
    )


def draw_goal(ax: Axes, goal: Goal, bounds: Bounds, color: str = "black") -> None:
    """Draw the disc of the goal and, where it is restricted, the sector of the headings."""
    radius = min(goal.tolerance, 2.0 * max(bounds.size))  # a larger one looks the same and takes long
    ax.add_patch(Circle((goal.x, goal.y), radius, facecolor=GOAL_COLOR, edgecolor="none", alpha=0.35, zorder=1.5))
    border = Circle(
        (goal.x, goal.y), radius, fill=False, edgecolor=color, linewidth=0.9, linestyle=(0, (3, 2)), zorder=6
    )
    ax.add_patch(border)
    ax.plot(
        goal.x,
        goal.y,
        linestyle="none",
        marker="+",
        markersize=6,
        color=color,
        zorder=6,
        scalex=False,
        scaley=False,
        label="goal",
    )
    if goal.theta is not None:
        reach = max(_mark(bounds), radius)
        half, middle = math.degrees(min(goal.heading_tolerance, math.pi)), math.degrees(goal.theta)
        ax.add_patch(Wedge((goal.x, goal.y), reach, middle - half, middle + half, color=color, alpha=0.15, zorder=6))
        _draw_heading(ax, goal.x, goal.y, goal.theta, reach, color)


def _mark(bounds: Bounds) -> float:
    """Length of the mark of a heading [m]."""
    return 0.05 * max(bounds.size)


def _draw_heading(ax: Axes, x: float, y: float, theta: float, length: float, color: str) -> None:
    """An arrow from a position along a heading."""
    tip = (x + length * math.cos(theta), y + length * math.sin(theta))
    ax.annotate(
        "",
        xy=tip,
        xytext=(x, y),
        arrowprops={"arrowstyle": "-|>", "color": color, "linewidth": 1.0, "shrinkA": 0.0, "shrinkB": 0.0},
        zorder=6,
    )


def _poses_along(trajectory: Trajectory, footprint: Footprint) -> NDArray[np.float64]:
    """Poses spaced by at least the size of the footprint along the path, the last one among them, shape (k, 3)."""
    way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(trajectory.x), np.diff(trajectory.y)))])
    spacing = max(2.0 * footprint.circumscribed_radius, way[-1] / FOOTPRINTS_ALONG_PATH)
    wanted = np.arange(way[-1], 0.0, -spacing) if spacing > 0.0 else way[-1:]
    rows = np.searchsorted(way, wanted) if len(wanted) else np.array([len(way) - 1])
    return trajectory.poses[np.unique(rows)]
