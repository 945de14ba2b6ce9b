"""A proof that there is no way: the disc inside the footprint cannot get from the start to the goal region."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.problem.robot import Footprint
from cbrrt_ompl.problem.settings import Goal, State

CELLS_A_RADIUS = 20.0
"""Cells along the radius of the disc: the finer, the narrower the gaps that are seen to be closed."""

MOST_CELLS = 2_000_000
"""Cells of the grid at most."""


def has_no_way(world: World, footprint: Footprint, start: State, goal: Goal) -> bool:
    """Whether the robot certainly cannot get into a goal region, whatever way it takes.

    A cell of a grid is closed where an obstacle is certainly nearer to all of its points than the radius of the largest
    disc about the robot's origin in the footprint. The robot's origin stays in what is connected to the start without
    any closed cell.

    Args:
        world: bounds and obstacles.
        footprint: the robot's area.
        start: where the robot is.
        goal: where it should arrive.

    Returns:
        True only if this is proven.
    """
    from scipy import ndimage  # here, since it takes long to import

    from cbrrt_ompl.scenario.maps.rasterizing import rasterize

    radius = footprint.inscribed_radius
    width, height = world.bounds.size
    side = max(radius / CELLS_A_RADIUS, math.sqrt(width * height / MOST_CELLS))
    if radius < 3.0 * side:  # a point, or a robot too small for the world
        return False
    occupied = np.pad(rasterize(world, side).cells != 0, 1, constant_values=True)  # the walls are obstacles too
    distances = ndimage.distance_transform_edt(~occupied) * side  # from centre to centre
    is_open = (distances + math.sqrt(2.0) * side >= radius)[1:-1, 1:-1]
    parts, _ = ndimage.label(is_open, structure=np.ones((3, 3)))
    origin = np.array(world.bounds.min)
    here = parts[tuple(_cell(np.array([start.x, start.y]), origin, side, parts.shape))]
    if here == 0:
        return False  # the start itself is no place to be: not ours to say
    low = _cell(np.array([goal.x, goal.y]) - goal.tolerance, origin, side, parts.shape)
    high = _cell(np.array([goal.x, goal.y]) + goal.tolerance, origin, side, parts.shape)
    rows, columns = np.mgrid[low[0] : high[0] + 1, low[1] : high[1] + 1]
    offsets = np.stack([columns, rows], axis=-1) * side + origin - (goal.x, goal.y)  # of lower left corners
    nearest = np.clip(0.0, offsets, offsets + side)
    in_goal = np.hypot(nearest[..., 0], nearest[..., 1]) <= goal.tolerance
    return not (in_goal & (parts[rows, columns] == here)).any()


def _cell(
    point: NDArray[np.float64], origin: NDArray[np.float64], side: float, shape: tuple[int, ...]
) -> NDArray[np.int64]:
    """Row and column of the cell at a point, or of the nearest one."""
    cell: NDArray[np.int64] = np.floor((point - origin) / side).astype(np.int64)[::-1]
    return np.clip(cell, 0, np.array(shape) - 1)
