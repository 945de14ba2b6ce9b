"""Worlds made into occupancy maps."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.checks import LARGEST, SMALLEST, is_number
from cbrrt_ompl.collision.convex import convex_parts
from cbrrt_ompl.collision.occupancy import A_SIDE, FREE, OCCUPIED, check_cell_count
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import MapError, Problem
from cbrrt_ompl.problem.obstacles import Box, Disc, Obstacle
from cbrrt_ompl.scenario.maps.occupancy_map import OccupancyMap

SLACK = 1e-6
"""Share of a cell's side that an obstacle must reach into it: less is rounding, or touching."""


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
    if not (is_number(resolution, LARGEST) and resolution >= SMALLEST):
        raise MapError(Problem("resolution", resolution, A_SIDE))
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
    low: NDArray[np.float64] = y0 + resolution * (np.arange(bottom, top, dtype=np.float64) + SLACK)
    high: NDArray[np.float64] = low + resolution * (1.0 - 2.0 * SLACK)
    if isinstance(obstacle, Disc):
        extents = [_extent_of_disc(obstacle, low, high)]
    else:
        extents = [_extent_of_ring(ring, low, high) for ring in convex_parts(obstacle.to_shapely())]
    for least, most in extents:
        is_reached = least <= most
        first = np.ceil((least[is_reached] - x0) / resolution - 1.0 + SLACK).clip(left, right).astype(int)
        end = np.floor((most[is_reached] - x0) / resolution + 1.0 - SLACK).clip(left, right).astype(int)
        reached = (bottom + np.flatnonzero(is_reached)).tolist()
        for row, start, stop in zip(reached, first.tolist(), end.tolist(), strict=True):
            occupied[row, start:stop] = True


def _extent_of_disc(
    disc: Disc, low: NDArray[np.float64], high: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """See :func:`_extent_of_ring`."""
    x, y = disc.center
    rest = disc.radius**2 - (np.clip(y, low, high) - y) ** 2
    half = np.where(rest >= 0.0, np.sqrt(np.maximum(rest, 0.0)), -np.inf)
    return x - half, x + half


def _extent_of_ring(
    ring: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Least and largest x of a convex polygon between two heights; the least is above the largest where it has none.

    Args:
        ring: corners, shape (n, 2) [m].
        low: lower heights, shape (m,) [m].
        high: upper heights, shape (m,) [m].

    Returns:
        The least and the largest x, each of shape (m,) [m].
    """
    (ax, ay), (bx, by) = (corners.T[:, :, None] for corners in (ring, np.roll(ring, -1, axis=0)))  # (n, 1) each
    bottom, top = np.maximum(np.minimum(ay, by), low), np.minimum(np.maximum(ay, by), high)  # (n, m)
    rise = np.where(by == ay, 1.0, by - ay)
    ends = [np.clip(ax + (y - ay) * ((bx - ax) / rise), np.minimum(ax, bx), np.maximum(ax, bx)) for y in (bottom, top)]
    is_there = bottom <= top
    least = np.where(is_there, np.minimum(*ends), np.inf).min(axis=0)
    return least, np.where(is_there, np.maximum(*ends), -np.inf).max(axis=0)


def _rectangle_around(obstacle: Obstacle) -> tuple[float, float, float, float]:
    """Lower left and upper right corner around an obstacle [m]."""
    if isinstance(obstacle, Box):
        return (*obstacle.min, *obstacle.max)
    if isinstance(obstacle, Disc):
        (x, y), r = obstacle.center, obstacle.radius
        return x - r, y - r, x + r, y + r
    (x0, y0), (x1, y1) = obstacle.vertices.min(axis=0).tolist(), obstacle.vertices.max(axis=0).tolist()
    return x0, y0, x1, y1
