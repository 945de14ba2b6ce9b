"""Animations of trajectories and drives, as GIF, HTML or MP4: the robot moves, and its curves grow beside it."""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.animation import FFMpegWriter, FuncAnimation, PillowWriter
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon
from numpy.typing import NDArray
from PIL import Image

from cbrrt_ompl.errors import InputError, Problem
from cbrrt_ompl.figures.figures import (
    PATH_COLOR,
    TREE_COLOR,
    TURN_COLOR,
    draw_computing_times,
    draw_scene,
    draw_tree,
    draw_unknown,
    draw_velocities,
    legend_above,
    obstacle_path,
)
from cbrrt_ompl.files import as_path, write_file
from cbrrt_ompl.problem.robot import Footprint
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.trajectory.tree import Tree

if TYPE_CHECKING:
    from cbrrt_ompl.drive.result import DriveResult
    from cbrrt_ompl.problem.obstacles import Obstacle
    from cbrrt_ompl.scenario.scenario import Scenario

SUFFIXES = (".gif", ".html", ".mp4")
"""Kinds of animations that can be saved."""

FRAMES_PER_SECOND = 12
"""Frames shown in a second."""

LONGEST = 10.0
"""Time that an animation takes at most [s]: longer motions are shown faster."""

HOLD = 1.0
"""Time for which the end is shown [s]."""

COLORS = 128
"""Colours of a GIF."""

FIGURE_DPI = 100
"""Pixels an inch."""


def animate(trajectory: Trajectory, scenario: Scenario, tree: Tree | None = None) -> FuncAnimation:
    """Animate a trajectory: the footprint on its way, and both velocities over time.

    Args:
        trajectory: what is driven.
        scenario: where.
        tree: what a planner grew, drawn below it.

    Returns:
        The animation, of `FRAMES_PER_SECOND` and at most `LONGEST` and `HOLD` together; to be kept until it is saved.
    """
    figure, plane, (upper, lower) = _axes(scenario, rows=2)
    draw_scene(plane, scenario)
    if tree is not None:
        draw_tree(plane, tree)
    plane.plot(trajectory.x, trajectory.y, color=PATH_COLOR, linewidth=0.8, zorder=3.5, label="plan")
    robot = _Robot(plane, scenario, trajectory)
    curves = _Curves((upper, lower), trajectory, scenario)
    legend_above(plane)
    title = _Title(figure, scenario.name, trajectory)

    def show(t: float) -> None:
        robot.show(t)
        curves.show(t)
        title.show(t)

    return _animation(figure, trajectory, show, [title.text, *robot.artists, *curves.artists])


def animate_drive(result: DriveResult) -> FuncAnimation:
    """Animate a drive: what is known, the plan, the braking that is ready, velocities and computing times.

    Args:
        result: what :func:`cbrrt_ompl.drive.drive` returned.

    Returns:
        The animation, of `FRAMES_PER_SECOND` and at most `LONGEST` and `HOLD` together; to be kept until it is saved.
    """
    scenario, trajectory = result.scenario, result.trajectory
    figure, plane, (upper, lower, clock) = _axes(scenario, rows=3)
    draw_scene(plane, scenario)
    unseen, seen = draw_unknown(plane, result)
    (plan,) = plane.plot([], [], color=PATH_COLOR, linewidth=1.0, zorder=3.5, label="plan")
    (braking,) = plane.plot([], [], color=TREE_COLOR, linewidth=3.0, zorder=4.5, label="braking, ready")
    sensor = Circle((0.0, 0.0), result.settings.sensor_range, fill=False, linestyle=":", linewidth=0.9, zorder=6)
    plane.add_patch(sensor)
    robot = _Robot(plane, scenario, trajectory)
    curves = _Curves((upper, lower), trajectory, scenario)
    draw_computing_times(clock, result)
    cursor = clock.axvline(trajectory.t[0], color="black", linewidth=0.7)
    future = clock.axvspan(trajectory.t[0], trajectory.t[-1], ymax=0.78, color="white", alpha=0.85, linewidth=0.0)
    lower.set_xlabel("")
    legend_above(plane)
    title = _Title(figure, scenario.name, trajectory)
    looks = np.array([cycle.time for cycle in result.cycles])

    def show(t: float) -> None:
        look = max(int(np.searchsorted(looks, t, side="right")) - 1, 0)
        found = {id(obstacle) for cycle in result.cycles[: look + 1] for obstacle in cycle.seen}
        _set_paths(seen, [o for o in result.hidden if id(o) in found])
        _set_paths(unseen, [o for o in result.hidden if id(o) not in found])
        plan.set_data(*_plan_ahead(result, look, t).T)
        braking.set_data(*_braking_ahead(result, looks, look, t).T)
        sensor.set_center(trajectory.at(t)[0, :2].tolist())
        robot.show(t)
        curves.show(t)
        cursor.set_xdata([t, t])
        future.set_x(t)
        future.set_width(max(float(trajectory.t[-1]) - t, 0.0))
        title.show(t)

    moving = [title.text, unseen, seen, plan, braking, sensor, cursor, future, *robot.artists, *curves.artists]
    return _animation(figure, trajectory, show, moving)


def save_animation(animation: FuncAnimation, path: str | os.PathLike[str]) -> None:
    """Write an animation: GIF, HTML in one file, or MP4 where ffmpeg is installed.

    An existing file stays whole until the new one is.

    Args:
        animation: what :func:`animate` or :func:`animate_drive` returned.
        path: the file; its suffix is the kind.

    Raises:
        InputError: if the suffix is another one, ffmpeg is missing or the file cannot be written.
    """
    path = as_path(path, InputError)
    check_animation_file(path)
    if path.suffix.lower() == ".html":
        with mpl.rc_context({"animation.embed_limit": 100.0}):
            write_file(path, animation.to_jshtml(fps=FRAMES_PER_SECOND, default_mode="loop"))
        return
    writer = _GifWriter if path.suffix.lower() == ".gif" else FFMpegWriter
    with tempfile.TemporaryDirectory() as folder:
        draft = Path(folder, f"draft{path.suffix.lower()}")
        animation.save(draft, writer=writer(fps=FRAMES_PER_SECOND), dpi=FIGURE_DPI)
        write_file(path, draft.read_bytes())


def check_animation_file(path: Path) -> None:
    """Find out before any work whether an animation of this kind can be written.

    Raises:
        InputError: if the suffix is not one of `SUFFIXES`, or ffmpeg is missing for an MP4.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(Problem("suffix", path.suffix, f"one of {', '.join(SUFFIXES)}"), str(path))
    if suffix == ".mp4" and not FFMpegWriter.isAvailable():
        raise InputError(Problem("suffix", path.suffix, "ffmpeg on the path for MP4; .gif or .html without"), str(path))


class _GifWriter(PillowWriter):
    """Gives all frames the colours of the last one, undithered: what does not change is stored once."""

    _frames: list[Image.Image]

    def finish(self) -> None:
        """Write the file."""
        frames = [frame.convert("RGB") for frame in self._frames]
        palette = frames[-1].quantize(COLORS)
        self._frames = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
        super().finish()


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
    """Both velocities, with a line at the present time and the future covered."""

    def __init__(self, axes: Sequence[Axes], trajectory: Trajectory, scenario: Scenario) -> None:
        draw_velocities(axes, trajectory, scenario.robot.limits)
        legend_above(axes[0])
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


def frame_times(trajectory: Trajectory) -> NDArray[np.float64]:
    """Times of the frames: evenly spaced, the first and the last row among them, and the last one held, shape (n,)."""
    frames = max(math.ceil(min(trajectory.duration, LONGEST) * FRAMES_PER_SECOND), 1)
    times = np.linspace(trajectory.t[0], trajectory.t[-1], frames + 1)
    return np.append(times, np.full(round(HOLD * FRAMES_PER_SECOND), trajectory.t[-1]))


def _axes(scenario: Scenario, rows: int) -> tuple[Figure, Axes, list[Axes]]:
    """A figure with the plane on the left and some curves over time on the right."""
    width, height = scenario.world.bounds.size
    tall = min(max(3.7 * height / width, 1.25 * rows), 5.0)
    figure = Figure(figsize=(7.6, tall + 0.9), layout="constrained", dpi=FIGURE_DPI)
    grid = figure.add_gridspec(rows, 2, width_ratios=(1.25, 1.0))
    plane = figure.add_subplot(grid[:, 0])
    first = figure.add_subplot(grid[0, 1])
    curves = [first, *(figure.add_subplot(grid[row, 1], sharex=first) for row in range(1, rows))]
    for ax in curves[:-1]:
        ax.tick_params(labelbottom=False)
    figure.align_ylabels(curves)
    for ax in (plane, *curves):
        ax.tick_params(labelsize=8)
    return figure, plane, curves


def _animation(
    figure: Figure, trajectory: Trajectory, show: Callable[[float], None], moving: Sequence[Artist]
) -> FuncAnimation:
    """The animation that shows one time a frame.

    Args:
        figure: what is shown.
        trajectory: whose times.
        show: brings the figure to a time [s].
        moving: all artists that change; the others are drawn once, since they take long.
    """
    times = frame_times(trajectory)
    show(float(times[0]))
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # the axes stay where they are
    for artist in moving:
        artist.set_visible(False)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    picture = np.array(canvas.buffer_rgba())
    for artist in (child for ax in figure.axes for child in ax.get_children()):
        artist.set_visible(False)
    for artist in moving:
        artist.set_visible(True)
    for ax in figure.axes:
        ax.set_axis_off()
    backdrop = figure.add_axes((0.0, 0.0, 1.0, 1.0), zorder=-1.0)
    backdrop.imshow(picture, aspect="auto")
    backdrop.set_axis_off()

    def show_frame(frame: int) -> list[Artist]:
        show(float(times[frame]))
        return list(moving)

    interval = 1000.0 / FRAMES_PER_SECOND
    return FuncAnimation(figure, show_frame, frames=len(times), interval=interval, repeat=True)


def _set_paths(collection: PathCollection, obstacles: Sequence[Obstacle]) -> None:
    """Let a collection show some obstacles."""
    collection.set_paths([obstacle_path(obstacle) for obstacle in obstacles])


def _plan_ahead(result: DriveResult, look: int, t: float) -> NDArray[np.float64]:
    """The rest of the plan that is followed at a time, shape (n, 2); empty while braking."""
    if look > 0 and result.cycles[look - 1].is_braking:
        return np.empty((0, 2))
    taken = [r for r in result.replans if r.trajectory is not None and r.start_time <= t + 1e-9]
    if not taken:
        return np.empty((0, 2))
    plan = taken[-1].trajectory
    assert plan is not None
    return plan.poses[plan.t >= t - 1e-9, :2]


def _braking_ahead(result: DriveResult, looks: NDArray[np.float64], look: int, t: float) -> NDArray[np.float64]:
    """The way that the robot is committed to at a time: to the next look and from there to rest, shape (n, 2)."""
    trajectory = result.trajectory
    committed = result.braking
    if look + 1 < len(looks):
        committed = trajectory.stopping_at(min(looks[look + 1], trajectory.t[-1]))
    return np.vstack([trajectory.at(t)[:, :2], committed.poses[committed.t > t, :2]])
