"""Scenes: bounds and obstacles, the start and the goal region."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.patches import Circle, Polygon, Rectangle, Wedge
from matplotlib.path import Path

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.figures.style import GOAL_COLOR, OBSTACLE_COLOR, START_COLOR
from cbrrt_ompl.problem.obstacles import Bounds, Box, Disc, Obstacle
from cbrrt_ompl.problem.robot import Footprint
from cbrrt_ompl.problem.settings import Goal, State

if TYPE_CHECKING:
    from cbrrt_ompl.scenario.scenario import Scenario


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


def draw_start(ax: Axes, start: State, footprint: Footprint, bounds: Bounds, color: str = START_COLOR) -> None:
    """Draw footprint and heading at the start."""
    x, y, theta = start[:3]
    if footprint.kind != "point":
        outline = footprint.outline_at((x, y, theta))
        ax.add_patch(Polygon(outline, fill=False, edgecolor=color, linewidth=1.0, zorder=6))
    draw_heading(ax, x, y, theta, max(mark_length(bounds), 1.3 * footprint.circumscribed_radius), color)
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
        reach = max(mark_length(bounds), radius)
        half, middle = math.degrees(min(goal.heading_tolerance, math.pi)), math.degrees(goal.theta)
        ax.add_patch(Wedge((goal.x, goal.y), reach, middle - half, middle + half, color=color, alpha=0.15, zorder=6))
        draw_heading(ax, goal.x, goal.y, goal.theta, reach, color)


def draw_heading(ax: Axes, x: float, y: float, theta: float, length: float, color: str) -> None:
    """An arrow from a position along a heading."""
    tip = (x + length * math.cos(theta), y + length * math.sin(theta))
    ax.annotate(
        "",
        xy=tip,
        xytext=(x, y),
        arrowprops={"arrowstyle": "-|>", "color": color, "linewidth": 1.0, "shrinkA": 0.0, "shrinkB": 0.0},
        zorder=6,
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


def mark_length(bounds: Bounds) -> float:
    """Length of the mark of a heading [m]."""
    return 0.05 * max(bounds.size)
