"""One extension of a tree, drawn step by step."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Arc

from cbrrt_ompl.figures.scene import draw_heading
from cbrrt_ompl.figures.style import (
    COMMAND_COLOR,
    HALO,
    PATH_COLOR,
    REFERENCE_COLOR,
    START_COLOR,
    TREE_COLOR,
    legend_above,
)
from cbrrt_ompl.problem.robot import Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State


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
    from cbrrt_ompl.planners.registry import planner_named
    from cbrrt_ompl.trajectory.replay import extension_trajectories

    row = planner_named(planner)
    law = row.law(planning)
    model = make_model(law, row.robot(robot), Goal(0.0, 0.0), planning)
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
        draw_heading(ax, x, y, theta, mark, color)
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
            path_effects=HALO, zorder=7,
        )  # fmt: skip
