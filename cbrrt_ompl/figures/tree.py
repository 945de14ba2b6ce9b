"""The tree that a planner grew."""

from __future__ import annotations

from matplotlib.axes import Axes

from cbrrt_ompl.figures.style import TREE_COLOR
from cbrrt_ompl.trajectory.tree import Tree


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
