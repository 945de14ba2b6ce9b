"""Where plane and curves stand in a figure: the plane as large as it can be, the curves beside or below it."""

from __future__ import annotations

import io
from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cbrrt_ompl.figures.style import legend_above, shrink_labels
from cbrrt_ompl.problem.obstacles import Bounds

WIDTH, TALLEST = 9.6, 8.6
"""Width of a figure with curves, and its height at most [inch]."""

NARROWEST = 6.0
"""Width of a figure at least, for its title [inch]."""

DPI = 150
"""Pixels an inch."""

LABELS = 0.7
"""What the labels of an axis take of the width [inch]."""

HEADER = 1.5
"""What title, legend and labels take of the height [inch]."""

CURVES_WIDTH, CURVES_HEIGHT = 3.4, 2.0
"""What curves take of the width beside the plane, and of the height below it, at least [inch]."""

CURVE_HEIGHT = 1.2
"""Height of each of several curves beside the plane, at least [inch]."""


NOTEBOOK_DPI = 90
"""Pixels an inch in a notebook: with ten pictures it stays below two megabytes."""


class ShownFigure(Figure):
    """A figure that a notebook shows whether pyplot is set up for it or not."""

    def _repr_png_(self) -> bytes:
        """The figure as PNG."""
        buffer = io.BytesIO()
        self.savefig(buffer, format="png", dpi=NOTEBOOK_DPI)
        return buffer.getvalue()


class Panels(NamedTuple):
    """A figure of a plane and curves over time."""

    figure: ShownFigure
    plane: Axes
    curves: list[Axes]
    is_beside: bool
    """Whether the curves stand beside the plane, and not below it."""

    def finish(self) -> ShownFigure:
        """Once all is drawn: times labelled once a column, legends above, small labels."""
        for ax in self.curves:
            is_labelled = not self.is_beside or ax is self.curves[-1]
            ax.set_xlabel("t [s]" if is_labelled else "")
            ax.tick_params(labelbottom=is_labelled)
        if self.is_beside:
            self.figure.align_ylabels(self.curves)
        for ax in (self.plane, self.curves[0]):
            legend_above(ax)
        shrink_labels(self.figure)
        return self.figure


def plane_and_curves(bounds: Bounds, count: int, size: tuple[float, float] | None = None) -> Panels:
    """A figure in which the plane is as large as its shape allows.

    Args:
        bounds: of the plane.
        count: curves over time.
        size: width and height of the figure [inch]; `WIDTH` and what is needed if not given.

    Returns:
        The empty figure, not known to pyplot.
    """
    wide, tall = size or (WIDTH, TALLEST)
    width, height = bounds.size
    beside = min((wide - CURVES_WIDTH - LABELS) / width, (tall - HEADER) / height)
    below = min((wide - LABELS) / width, (tall - HEADER - CURVES_HEIGHT) / height)
    is_beside = beside >= below
    if size is None:
        wide = max(beside * width + LABELS + CURVES_WIDTH, NARROWEST) if is_beside else wide
        tall = HEADER + (max(beside * height, CURVE_HEIGHT * count) if is_beside else below * height + CURVES_HEIGHT)
    figure = ShownFigure(figsize=(wide, tall), layout="constrained", dpi=DPI)
    if is_beside:
        taken = beside * width + LABELS
        grid = figure.add_gridspec(count, 2, width_ratios=(taken, wide - taken))
        plane, cells = figure.add_subplot(grid[:, 0]), [grid[row, 1] for row in range(count)]
    else:
        grid = figure.add_gridspec(2, count, height_ratios=(tall - CURVES_HEIGHT, CURVES_HEIGHT))
        plane, cells = figure.add_subplot(grid[0, :]), [grid[1, column] for column in range(count)]
    first = figure.add_subplot(cells[0])
    return Panels(figure, plane, [first, *(figure.add_subplot(cell, sharex=first) for cell in cells[1:])], is_beside)


def plane_alone(bounds: Bounds) -> tuple[ShownFigure, Axes]:
    """A figure of a plane and nothing else."""
    figure = ShownFigure(figsize=plane_size(bounds), layout="constrained", dpi=DPI)
    return figure, figure.add_subplot()


def plane_size(bounds: Bounds) -> tuple[float, float]:
    """Width and height of a figure of about the shape of a plane [inch]."""
    width, height = bounds.size
    scale = min((WIDTH - LABELS) / width, (TALLEST - HEADER) / height)
    return max(scale * width + LABELS, 4.0), max(scale * height + HEADER, 3.0)
