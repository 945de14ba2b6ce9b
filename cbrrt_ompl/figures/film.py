"""Animations as frames: 1080p in GIF and MP4, and a player in HTML."""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.animation import FFMpegWriter, FuncAnimation, PillowWriter
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from cbrrt_ompl.errors import InputError, Problem
from cbrrt_ompl.figures.layout import DPI
from cbrrt_ompl.figures.player import framed, player_page
from cbrrt_ompl.files import as_path, write_file
from cbrrt_ompl.trajectory.trajectory import Trajectory

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


class Animation(FuncAnimation):
    """Frames of `FRAMES_PER_SECOND`, of at most `LONGEST` and `HOLD` together, and what a player draws instead."""

    def __init__(
        self,
        figure: Figure,
        trajectory: Trajectory,
        show: Callable[[float], None],
        moving: Sequence[Artist],
        numbers: Callable[[], Mapping[str, Any]],
    ) -> None:
        """An animation that shows one time a frame.

        Args:
            figure: what is shown.
            trajectory: whose times.
            show: brings the figure to a time [s].
            moving: all artists that change; the others are drawn once, since they take long.
            numbers: makes what the player draws.
        """
        times = frame_times(trajectory)
        _make_backdrop(figure, moving, lambda: show(float(times[0])))

        def show_frame(frame: int) -> list[Artist]:
            show(float(times[frame]))
            return list(moving)

        super().__init__(figure, show_frame, frames=len(times), interval=1000.0 / FRAMES_PER_SECOND, repeat=True)
        self._draw_was_started = True  # matplotlib warns of those never drawn, and a player draws none
        self._numbers = numbers

    def to_html(self) -> str:
        """A page of its own that plays the animation; it draws from numbers and needs no network."""
        return player_page(self._numbers())

    def _repr_html_(self) -> str:
        """The player, in a notebook."""
        return framed(self.to_html())


def frame_times(trajectory: Trajectory) -> NDArray[np.float64]:
    """Times of the frames: evenly spaced, the first and the last row among them, and the last one held, shape (n,)."""
    frames = max(math.ceil(min(trajectory.duration, LONGEST) * FRAMES_PER_SECOND), 1)
    times = np.linspace(trajectory.t[0], trajectory.t[-1], frames + 1)
    return np.append(times, np.full(round(HOLD * FRAMES_PER_SECOND), trajectory.t[-1]))


def save_animation(animation: Animation, path: str | os.PathLike[str]) -> None:
    """Write an animation: a player in one HTML file, GIF, or MP4 where ffmpeg is installed.

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
        write_file(path, animation.to_html())
        return
    writer = _GifWriter if path.suffix.lower() == ".gif" else FFMpegWriter
    with tempfile.TemporaryDirectory() as folder:
        draft = Path(folder, f"draft{path.suffix.lower()}")
        animation.save(draft, writer=writer(fps=FRAMES_PER_SECOND), dpi=DPI)
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
        colors = np.array(palette.getpalette()).reshape(-1, 3)
        colors[(colors >= 248).all(axis=1)] = 255  # Pillow's means, and its nearest colours, are not quite white
        palette.putpalette(colors.ravel().tolist())
        self._frames = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
        super().finish()


def _make_backdrop(figure: Figure, moving: Sequence[Artist], show: Callable[[], None]) -> None:
    """Draw what does not move once, as a picture behind what does."""
    show()
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
