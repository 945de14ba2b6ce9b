"""Figures of maps, and of scenarios that are not right yet: what a start and a goal are read off from."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.patches import Rectangle
from matplotlib.ticker import FixedLocator, MultipleLocator
from matplotlib.transforms import Affine2D

from cbrrt_ompl.collision.occupancy import FREE, OCCUPIED, UNKNOWN
from cbrrt_ompl.figures.scene import draw_goal, draw_start, draw_world
from cbrrt_ompl.figures.style import OBSTACLE_COLOR
from cbrrt_ompl.problem.obstacles import Bounds

if TYPE_CHECKING:
    from cbrrt_ompl.scenario.draft import Draft
    from cbrrt_ompl.scenario.maps.occupancy_map import OccupancyMap

CELL_COLORS = {OCCUPIED: "0.25", UNKNOWN: "#9DB8D2"}
"""Free cells stay white; unknown ones are told from occupied ones in grey print as well."""

WRONG_COLOR = "#CC0000"
"""Of a start or a goal that nobody can plan with."""

MOST_LABELS, MOST_TICKS = 12, 120
"""On an axis, before labels stand several metres apart, and ticks as well."""


def draw_map(ax: Axes, grid: OccupancyMap, unit: str = "m") -> Axes:
    """Draw the cells of a map where they lie, with a tick every metre and a grid.

    Args:
        ax: axes of the plane; their limits and labels are set.
        grid: what is drawn.
        unit: what the axes count: ``m``, or ``cells`` for a map without a scale.

    Returns:
        The axes.
    """
    _set_plane(ax, grid.bounds(), unit)
    _draw_cells(ax, grid)
    return ax


def draw_draft(ax: Axes, draft: Draft, grid: OccupancyMap | None = None) -> Axes:
    """Draw a scenario as far as it goes; a start or goal that is wrong in red.

    Args:
        ax: axes of the plane; their limits and labels are set.
        draft: what is drawn.
        grid: the map of its world, to tell unknown cells from occupied ones.

    Returns:
        The axes.
    """
    draw_world(ax, draft.world)
    _set_plane(ax, draft.world.bounds, "m")
    if grid is not None:
        if draft.map is not None and not draft.map.keepout and len(draft.world.obstacles) == draft.map.obstacles:
            ax.collections[-1].set_label("_nolegend_")  # all obstacles are cells of the map
        _draw_cells(ax, grid)
    low, high = np.array(draft.world.bounds.min), np.array(draft.world.bounds.max)
    for name, part in (("start", draft.start), ("goal", draft.goal)):
        if part is None:
            continue
        color = WRONG_COLOR if draft.is_wrong(name) else "black"
        if name == "start" and draft.start is not None:
            draw_start(ax, draft.start, draft.robot.footprint, draft.world.bounds, color)
        elif draft.goal is not None:
            draw_goal(ax, draft.goal, draft.world.bounds, color)
        most = 0.5 * max(draft.world.bounds.size)  # what lies farther away would make the map too small to see
        near = np.clip((part.x, part.y), low - most, high + most)
        low, high = np.minimum(low, near), np.maximum(high, near)
    _show(ax, low, high)
    return ax


def _set_plane(ax: Axes, bounds: Bounds, unit: str) -> None:
    """Limits, labels, ticks and grid of a plane."""
    _show(ax, np.array(bounds.min), np.array(bounds.max))
    ax.set_aspect("equal", adjustable="box")
    ax.spines[:].set_visible(False)
    ax.set_xlabel(f"x [{unit}]")
    ax.set_ylabel(f"y [{unit}]")
    ax.grid(True, linewidth=0.5, color="0.55", alpha=0.5, zorder=1.3)
    ax.set_axisbelow(False)


def _show(ax: Axes, low: np.ndarray, high: np.ndarray) -> None:
    """Show a rectangle of the plane, with ticks that fit it."""
    margin = 0.015 * max(high - low)
    ax.set_xlim(low[0] - margin, high[0] + margin)
    ax.set_ylim(low[1] - margin, high[1] + margin)
    largest = float(max(high - low))
    apart = next(s for s in _steps() if largest / s <= MOST_LABELS)
    between = next(s for s in _steps() if largest / s <= MOST_TICKS)
    for axis, a, b in ((ax.xaxis, low[0], high[0]), (ax.yaxis, low[1], high[1])):
        axis.set_major_locator(MultipleLocator(apart))
        axis.set_minor_locator(
            FixedLocator([between * i for i in range(math.ceil(a / between), math.floor(b / between) + 1)])
        )
    ax.tick_params(which="minor", length=2)


def _steps() -> list[float]:
    """Whole metres that ticks may stand apart."""
    return [digit * 10.0**power for power in range(8) for digit in (1.0, 2.0, 5.0)]


def _draw_cells(ax: Axes, grid: OccupancyMap) -> None:
    """The cells of a map as an image in their place, and what their colours mean."""
    rows, columns = grid.cells.shape
    image = np.zeros((rows, columns, 4), dtype=np.uint8)
    for cell, color in CELL_COLORS.items():
        image[grid.cells == cell] = np.multiply(to_rgba(color), 255).round()
    x, y, yaw = grid.origin
    place = Affine2D().rotate(yaw).translate(x, y) + ax.transData
    extent = (0.0, columns * grid.resolution, 0.0, rows * grid.resolution)
    limits = ax.get_xlim(), ax.get_ylim()
    shown = ax.imshow(
        image, origin="lower", extent=extent, interpolation="nearest", transform=place, zorder=1.2, aspect="equal"
    )
    shown.set_gid("cells")
    ax.set_xlim(*limits[0])
    ax.set_ylim(*limits[1])
    frame = Rectangle((0.0, 0.0), extent[1], extent[3], fill=False, edgecolor="black", linewidth=0.8, zorder=3)
    frame.set_transform(place)
    ax.add_patch(frame)
    for cell, name in ((FREE, "free"), (UNKNOWN, "unknown"), (OCCUPIED, "occupied")):
        if (grid.cells == cell).any():
            color = CELL_COLORS.get(cell, "white")
            ax.plot([], [], linestyle="none", marker="s", markeredgecolor=OBSTACLE_COLOR, color=color, label=name)
