"""Worlds made into occupancy maps."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray

from cbrrt_ompl.checks import is_number
from cbrrt_ompl.collision.occupancy import FREE, OCCUPIED, check_cell_count
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import MapError, Problem
from cbrrt_ompl.problem.obstacles import Box, Disc, Obstacle
from cbrrt_ompl.scenario.maps.occupancy_map import OccupancyMap

SLACK = 1e-6
"""Share of a cell's side that an obstacle must reach into it: less is rounding, or touching."""

_BLOCK = 1_000_000
"""Cells that are tested at a time."""


def save_map(world: World, path: str | Path, resolution: float) -> None:
    """Write a world as a ROS map_server map: a YAML file and an image beside it.

    Args:
        world: bounds and obstacles.
        path: the YAML file; the image gets the same name with the suffix ``.pgm``. Both are overwritten.
        resolution: side of a cell [m].

    Raises:
        MapError: if the map would be too large, or cannot be written.
    """
    rasterize(world, resolution).save(path)


def rasterize(world: World, resolution: float) -> OccupancyMap:
    """Map of a world: a cell is occupied where an obstacle, or what is out of bounds, reaches into it.

    Args:
        world: bounds and obstacles.
        resolution: side of a cell [m]; the first cell lies in the lower left corner of the bounds.

    Raises:
        MapError: if the resolution is not above 0, or the map would be too large.
    """
    if not isinstance(world, World):
        raise MapError(Problem("world", world, "a value of type World"))
    if not (is_number(resolution) and resolution > 0.0):
        raise MapError(Problem("resolution", resolution, "the side of a cell, a number above 0 [m]"))
    columns, rows = (max(side / resolution, 1.0) for side in world.bounds.size)
    if columns * rows < math.inf:
        columns, rows = math.ceil(columns - SLACK), math.ceil(rows - SLACK)
    check_cell_count((rows, columns), "resolution")  # type: ignore[arg-type]  # infinite where it fails
    x0, y0 = world.bounds.min
    occupied = np.zeros((int(rows), int(columns)), dtype=np.bool_)
    if columns * resolution > world.bounds.size[0] + SLACK * resolution:
        occupied[:, -1] = True
    if rows * resolution > world.bounds.size[1] + SLACK * resolution:
        occupied[-1, :] = True
    for obstacle in world.obstacles:
        _draw(occupied, obstacle, x0, y0, resolution)
    return OccupancyMap(np.where(occupied, OCCUPIED, FREE), resolution, (x0, y0, 0.0))


def _draw(occupied: NDArray[np.bool_], obstacle: Obstacle, x0: float, y0: float, resolution: float) -> None:
    """Mark the cells that an obstacle reaches into."""
    low_x, low_y, high_x, high_y = _rectangle_around(obstacle)
    rows, columns = occupied.shape
    left, bottom = (max(math.floor((v - o) / resolution + SLACK), 0) for v, o in ((low_x, x0), (low_y, y0)))
    right = min(math.ceil((high_x - x0) / resolution - SLACK), columns)
    top = min(math.ceil((high_y - y0) / resolution - SLACK), rows)
    if left >= right or bottom >= top:
        return
    if isinstance(obstacle, Box):
        occupied[bottom:top, left:right] = True
        return
    shape = None if isinstance(obstacle, Disc) else obstacle.to_shapely()
    if shape is not None:
        shapely.prepare(shape)
    x = x0 + resolution * (np.arange(left, right) + SLACK)
    inset = resolution * (1.0 - 2.0 * SLACK)
    step = max(_BLOCK // (right - left), 1)
    for first in range(bottom, top, step):
        y = y0 + resolution * (np.arange(first, min(first + step, top)) + SLACK)
        x_low, y_low = np.meshgrid(x, y)  # (rows, columns)
        if isinstance(obstacle, Disc):
            dx = np.clip(obstacle.center[0], x_low, x_low + inset) - obstacle.center[0]
            dy = np.clip(obstacle.center[1], y_low, y_low + inset) - obstacle.center[1]
            reached = np.hypot(dx, dy) <= obstacle.radius
        else:
            reached = shapely.intersects(shape, shapely.box(x_low, y_low, x_low + inset, y_low + inset))
        occupied[first : first + len(y), left:right] |= reached


def _rectangle_around(obstacle: Obstacle) -> tuple[float, float, float, float]:
    """Lower left and upper right corner around an obstacle [m]."""
    if isinstance(obstacle, Box):
        return (*obstacle.min, *obstacle.max)
    if isinstance(obstacle, Disc):
        (x, y), r = obstacle.center, obstacle.radius
        return x - r, y - r, x + r, y + r
    (x0, y0), (x1, y1) = obstacle.vertices.min(axis=0).tolist(), obstacle.vertices.max(axis=0).tolist()
    return x0, y0, x1, y1
