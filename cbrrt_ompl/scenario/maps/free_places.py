"""Free places of a map: where a robot may begin and end that nobody has given a start and a goal."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.errors import MapError, Problem, Remark
from cbrrt_ompl.scenario.maps.occupancy_map import OccupancyMap

Place = tuple[float, float]


def places_apart(grid: OccupancyMap, radius: float) -> tuple[Place, Place]:
    """Two places of a map far from each other, with room for a disc and a way for it between them.

    The first has the most room of the largest part of the map that the disc can move in, the second lies farthest from
    it.

    Args:
        grid: the map.
        radius: of the disc [m].

    Returns:
        Two positions (x, y) [m], to the centimetre.

    Raises:
        MapError: if the disc fits nowhere.
    """
    from scipy import ndimage  # here, since it takes long to import

    free = np.pad(~grid.blocked(), 1)
    room = ndimage.distance_transform_edt(free)[1:-1, 1:-1] * grid.resolution  # to the centres of blocked cells
    rooms, count = ndimage.label(room - grid.resolution > radius)
    if count == 0:
        raise MapError(Problem("cells", Remark("no room"), f"a free place for a disc of {radius:.3g} m"), grid.source)
    is_largest = rooms == 1 + np.argmax(np.bincount(rooms.ravel())[1:])
    first = np.unravel_index(np.argmax(np.where(is_largest, room, 0.0)), room.shape)
    cells = np.argwhere(is_largest)  # (n, 2)
    second = cells[np.argmax(((cells - np.array(first)) ** 2).sum(axis=1))]
    return _centre(grid, np.array(first)), _centre(grid, second)


def _centre(grid: OccupancyMap, cell: NDArray[np.int64]) -> Place:
    """Middle of a cell in the world [m]."""
    x, y, yaw = grid.origin
    up, along = (cell + 0.5) * grid.resolution
    c, s = np.cos(yaw), np.sin(yaw)
    return round(float(x + c * along - s * up), 2), round(float(y + s * along + c * up), 2)
