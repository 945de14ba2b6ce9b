"""Animations of trajectories and drives: the robot moves, and its curves grow beside it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon

from cbrrt_ompl.figures.drive import draw_computing_times, draw_unknown
from cbrrt_ompl.figures.drive_history import braking_ahead, plan_ahead, seen_until, view_at
from cbrrt_ompl.figures.film import LONGEST, Animation, check_animation_file, save_animation
from cbrrt_ompl.figures.layout import plane_and_curves
from cbrrt_ompl.figures.player_numbers import drive_numbers, plan_numbers
from cbrrt_ompl.figures.scene import draw_scene, obstacle_path
from cbrrt_ompl.figures.style import PATH_COLOR, SEEN_COLOR, TREE_COLOR, TURN_COLOR
from cbrrt_ompl.figures.tree import draw_tree
from cbrrt_ompl.figures.velocities import draw_velocities
from cbrrt_ompl.problem.robot import Footprint
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.trajectory.tree import Tree

if TYPE_CHECKING:
    from cbrrt_ompl.drive.result import DriveResult
    from cbrrt_ompl.problem.obstacles import Obstacle
    from cbrrt_ompl.scenario.scenario import Scenario

__all__ = ["animate", "animate_drive", "check_animation_file", "save_animation"]

FULL_HD = (12.8, 7.2)
"""Size of an animation [inch]: 1920 x 1080 pixels."""


def animate(trajectory: Trajectory, scenario: Scenario, tree: Tree | None = None) -> Animation:
    """Animate a trajectory: the footprint on its way, and both velocities over time.

    Args:
        trajectory: what is driven.
        scenario: where.
        tree: what a planner grew, drawn below it.

    Returns:
        The animation, of 1920 x 1080 pixels; a notebook shows it as a player.
    """
    panels = plane_and_curves(scenario.world.bounds, 2, FULL_HD)
    plane = panels.plane
    draw_scene(plane, scenario)
    if tree is not None:
        draw_tree(plane, tree)
    plane.plot(trajectory.x, trajectory.y, color=PATH_COLOR, linewidth=0.8, zorder=3.5, label="plan")
    robot = _Robot(plane, scenario, trajectory)
    curves = _Curves(panels.curves, trajectory, scenario)
    panels.finish()
    title = _Title(panels.figure, scenario.name, trajectory)

    def show(t: float) -> None:
        robot.show(t)
        curves.show(t)
        title.show(t)

    moving = [title.text, *robot.artists, *curves.artists]
    return Animation(panels.figure, trajectory, show, moving, lambda: plan_numbers(trajectory, scenario, tree))


def animate_drive(result: DriveResult) -> Animation:
    """Animate a drive: what is seen and known, the plan, the braking that is ready, velocities and computing times.

    Args:
        result: what :func:`cbrrt_ompl.drive.drive` returned.

    Returns:
        The animation, of 1920 x 1080 pixels; a notebook shows it as a player.
    """
    scenario, trajectory = result.scenario, result.trajectory
    panels = plane_and_curves(scenario.world.bounds, 3, FULL_HD)
    plane, clock = panels.plane, panels.curves[2]
    draw_scene(plane, scenario)
    unseen, seen = draw_unknown(plane, result)
    (plan,) = plane.plot([], [], color=PATH_COLOR, linewidth=1.0, zorder=3.5, label="plan")
    (braking,) = plane.plot([], [], color=TREE_COLOR, linewidth=3.0, zorder=4.5, label="braking, ready")
    sensor = Circle((0.0, 0.0), result.settings.sensor_range, fill=False, linestyle=":", linewidth=0.9, zorder=6)
    plane.add_patch(sensor)
    view = Polygon(np.zeros((3, 2)), facecolor=SEEN_COLOR, edgecolor="none", zorder=0.5)
    plane.add_patch(view)
    robot = _Robot(plane, scenario, trajectory)
    draw_computing_times(clock, result)
    curves = _Curves(panels.curves, trajectory, scenario)
    panels.finish()
    title = _Title(panels.figure, scenario.name, trajectory)
    looks = np.array([cycle.time for cycle in result.cycles])

    def show(t: float) -> None:
        look = max(int(np.searchsorted(looks, t, side="right")) - 1, 0)
        found = seen_until(result, look)
        _set_paths(seen, [o for o in result.hidden if id(o) in found])
        _set_paths(unseen, [o for o in result.hidden if id(o) not in found])
        plan.set_data(*plan_ahead(result, look, t).T)
        braking.set_data(*braking_ahead(result, looks, look, t).T)
        sensor.set_center(trajectory.at(t)[0, :2].tolist())
        if (outline := view_at(result, t)) is not None:
            view.set_xy(outline)
        robot.show(t)
        curves.show(t)
        title.show(t)

    moving = [title.text, view, unseen, seen, plan, braking, sensor, *robot.artists, *curves.artists]
    return Animation(panels.figure, trajectory, show, moving, lambda: drive_numbers(result))


class _Robot:
    """The footprint, its heading and the way so far."""

    def __init__(self, ax: Axes, scenario: Scenario, trajectory: Trajectory) -> None:
        self._trajectory = trajectory
        self._footprint = scenario.robot.footprint
        if self._footprint.kind == "point":  # an arrow head stands for it
            length = 0.03 * max(scenario.world.bounds.size)
            self._footprint = Footprint.polygon(length * np.array([(1.0, 0.0), (-0.7, 0.6), (-0.7, -0.6)]))
        self._front = 1.0 * self._footprint.circumscribed_radius
        (self._path,) = ax.plot([], [], color=TURN_COLOR, linewidth=2.2, zorder=4, label="driven")
        outline = self._footprint.outline_at(trajectory.poses[0])
        self._body = Polygon(outline, facecolor=TURN_COLOR, edgecolor="black", linewidth=0.8, zorder=7)
        ax.add_patch(self._body)
        (self._heading,) = ax.plot([], [], color="white", linewidth=1.4, zorder=7.5)
        self.artists: list[Artist] = [self._path, self._body, self._heading]

    def show(self, t: float) -> None:
        """Move to where the robot is at a time."""
        trajectory = self._trajectory
        x, y, theta = trajectory.at(t)[0, :3].tolist()
        rows = trajectory.t < t
        self._path.set_data(np.append(trajectory.x[rows], x), np.append(trajectory.y[rows], y))
        self._body.set_xy(self._footprint.outline_at((x, y, theta)))
        ahead = np.array([0.15, 0.85]) * self._front
        self._heading.set_data(x + ahead * math.cos(theta), y + ahead * math.sin(theta))


class _Curves:
    """Both velocities and what else goes over time, with a line at the present time and the future covered."""

    def __init__(self, axes: Sequence[Axes], trajectory: Trajectory, scenario: Scenario) -> None:
        draw_velocities(axes[:2], trajectory, scenario.robot.limits)
        self._trajectory = trajectory
        self._cursors = [ax.axvline(trajectory.t[0], color="black", linewidth=0.7, zorder=6) for ax in axes]
        span = (trajectory.t[0], max(trajectory.t[-1], trajectory.t[0] + 1e-3))
        self._future = [ax.axvspan(*span, color="white", alpha=0.8, linewidth=0.0, zorder=5) for ax in axes]
        self.artists: list[Artist] = [*self._cursors, *self._future]

    def show(self, t: float) -> None:
        """Move on to a time."""
        for cursor, future in zip(self._cursors, self._future, strict=True):
            cursor.set_xdata([t, t])
            future.set_x(t)
            future.set_width(max(float(self._trajectory.t[-1]) - t, 0.0))


class _Title:
    """Name, time and how fast it is shown, at the top of the figure."""

    def __init__(self, figure: Figure, name: str, trajectory: Trajectory) -> None:
        self.text = figure.suptitle("t", fontsize=9, parse_math=False)
        speed = trajectory.duration / LONGEST
        self._name, self._speed = name, f", shown {speed:.1f} times as fast" if speed > 1.0 else ""

    def show(self, t: float) -> None:
        """Move on to a time."""
        self.text.set_text(f"{self._name}: t = {t:.1f} s{self._speed}")


def _set_paths(collection: PathCollection, obstacles: Sequence[Obstacle]) -> None:
    """Let a collection show some obstacles."""
    collection.set_paths([obstacle_path(obstacle) for obstacle in obstacles])
