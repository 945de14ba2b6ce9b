"""What all figures share: colours, small labels, legends outside of the axes, and times in words.

The colours keep the paper's convention (tree red, path green, point turns blue) in shades that colour-blind readers
tell apart; line widths and markers tell them apart in grey print.
"""

from __future__ import annotations

from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure
from matplotlib.legend_handler import HandlerPolyCollection

TREE_COLOR = "#CC3311"
PATH_COLOR = "#007A5E"
TURN_COLOR = "#0072B2"
START_COLOR = "black"
GOAL_COLOR = "#E69F00"
OBSTACLE_COLOR = "0.62"
SEEN_COLOR = "#FFF3D0"
COMMAND_COLOR = "0.45"
REFERENCE_COLOR = "#0072B2"

HALO = [patheffects.withStroke(linewidth=3.4, foreground="white")]
"""A white rim that parts a line from what is below it."""

LEGEND_COLUMN = 0.84
"""Width of a column of a legend [inch]."""


def legend_above(ax: Axes) -> None:
    """Put the legend above the axes, where no data are, in as many columns as fit."""
    handles, labels = ax.get_legend_handles_labels()
    shown = {label: handle for handle, label in zip(handles, labels, strict=True)}
    figure = ax.get_figure(root=True)
    width = ax.get_position(original=True).width * (figure.get_figwidth() if figure is not None else 4.0)
    ax.legend(
        shown.values(),
        shown.keys(),
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
        ncols=min(max(int(width / LEGEND_COLUMN), 2), len(shown) or 1),
        fontsize=7.5,
        frameon=False,
        handlelength=1.6,
        columnspacing=1.2,
        handler_map={PathCollection: HandlerPolyCollection()},
    )


def shrink_labels(figure: Figure) -> None:
    """Make the labels of all axes small enough for a figure with several."""
    for ax in figure.axes:
        ax.tick_params(labelsize=8)
        ax.xaxis.label.set_fontsize(9)
        ax.yaxis.label.set_fontsize(9)


def time_text(seconds: float) -> str:
    """A time in three digits or whole seconds: ``7.75 ms``, ``1.23 s``, ``1,204 s``."""
    if seconds < 0.9995:
        return f"{1e3 * seconds:.3g} ms"
    return f"{seconds:.3g} s" if seconds < 99.95 else f"{seconds:,.0f} s"
