"""An occupancy map: a grid of cells with its place in the world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cbrrt_ompl.collision.occupancy import (
    FREE,
    FREE_THRESHOLD,
    OCCUPIED,
    OCCUPIED_THRESHOLD,
    UNKNOWN,
    UNKNOWN_CELLS,
    GridLayer,
    blocked_cells,
    cells_from,
    check_cell_count,
    check_frame,
    grid_bounds,
)
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import MapError, Problem, Remark
from cbrrt_ompl.files import as_path
from cbrrt_ompl.problem.obstacles import Bounds, Obstacle
from cbrrt_ompl.scenario.maps.map_files import MapFile
from cbrrt_ompl.scenario.maps.map_server import write_map_server


@dataclass(frozen=True, eq=False)
class OccupancyMap:
    """Cells that are occupied, free or unknown, and where they lie.

    The cell in row r and column c covers x from c to c + 1 and y from r to r + 1 times the resolution, in the frame of
    the origin: row 0 is the lowest, as in a ROS OccupancyGrid.

    Raises:
        MapError: if the cells are no such grid, or it has no place in the world.
    """

    cells: NDArray[np.int8]
    """100 occupied, 0 free, -1 unknown; shape (rows, columns)."""
    resolution: float
    """Side of a cell [m]."""
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Pose (x, y, yaw) of the lower left corner of the grid, [m, m, rad]."""
    unknown: str = "occupied"
    """What unknown cells count as where nothing else is said: ``occupied`` or ``free``."""
    source: str = ""
    """The file that it came from."""
    remarks: tuple[str, ...] = ()
    """What was not taken as its file says, a line each."""

    def __post_init__(self) -> None:
        """Check and freeze everything."""
        try:
            cells: NDArray[Any] = np.array(self.cells)
        except ValueError:  # rows of different lengths
            cells = np.empty(0)
        if cells.ndim != 2 or cells.size == 0:
            raise MapError(Problem("cells", Remark(f"the shape {cells.shape}"), "rows and columns"), self.source)
        check_cell_count(cells.shape, "cells")
        if not ((cells == UNKNOWN) | (cells == FREE) | (cells == OCCUPIED)).all():
            expected = f"only {OCCUPIED} (occupied), {FREE} (free) and {UNKNOWN} (unknown)"
            raise MapError(Problem("cells", Remark("other values"), expected), self.source)
        if not (isinstance(self.unknown, str) and self.unknown in UNKNOWN_CELLS):
            problem = Problem("unknown", self.unknown, f"one of {', '.join(UNKNOWN_CELLS)}")
            raise MapError(problem, self.source)
        try:
            check_frame(cells.shape, self.resolution, self.origin)
        except MapError as error:
            raise MapError(error.problems, self.source) from None
        cells = cells.astype(np.int8, copy=False)
        cells.setflags(write=False)
        x, y, yaw = self.origin
        object.__setattr__(self, "cells", cells)
        object.__setattr__(self, "resolution", float(self.resolution))
        object.__setattr__(self, "origin", (float(x), float(y), float(yaw)))

    @classmethod
    def from_array(
        cls,
        grid: ArrayLike,
        resolution: float,
        origin: Sequence[float] = (0.0, 0.0, 0.0),
        *,
        occupied_thresh: float = OCCUPIED_THRESHOLD,
        free_thresh: float = FREE_THRESHOLD,
    ) -> OccupancyMap:
        """Map of an array, its first row the lowest; see :meth:`World.from_grid` for the values."""
        cells = cells_from(grid, occupied_thresh, free_thresh)
        check_frame(cells.shape, resolution, origin)
        return cls(cells, resolution, (origin[0], origin[1], origin[2]))

    def __eq__(self, other: object) -> bool:
        """Equal where the cells, the resolution and the origin are."""
        if not isinstance(other, OccupancyMap):
            return NotImplemented
        same_frame = (self.resolution, self.origin) == (other.resolution, other.origin)
        return same_frame and np.array_equal(self.cells, other.cells)

    def __hash__(self) -> int:
        """Hash of the resolution, the origin and the size."""
        return hash((self.resolution, self.origin, self.cells.shape))

    def bounds(self) -> Bounds:
        """Rectangle around the map [m]."""
        return grid_bounds(self.cells.shape, self.resolution, self.origin)

    def blocked(self, unknown: str | None = None) -> NDArray[np.bool_]:
        """Which cells nobody may enter.

        Args:
            unknown: whether unknown cells are ``occupied`` or ``free``; the map's own choice if not given.

        Returns:
            True where occupied, shape (rows, columns).

        Raises:
            MapError: if no cell is left to be in, or ``unknown`` is another word.
        """
        try:
            return blocked_cells(self.cells, self.unknown if unknown is None else unknown)
        except MapError as error:
            raise MapError(error.problems, self.source) from None

    def obstacles(self, unknown: str | None = None) -> list[Obstacle]:
        """Few boxes that cover exactly the blocked cells; where the map is rotated, also what lies around it.

        Args:
            unknown: as in :meth:`blocked`.

        Raises:
            MapError: as :meth:`blocked`.
        """
        return list(GridLayer(self.blocked(unknown), self.resolution, self.origin).obstacles)

    def to_world(self, unknown: str | None = None) -> World:
        """World to plan in, bounded by the rectangle around the map.

        Args:
            unknown: as in :meth:`blocked`.

        Raises:
            MapError: as :meth:`blocked`.
        """
        return World.from_layer(GridLayer(self.blocked(unknown), self.resolution, self.origin))

    def save(self, path: str | Path) -> None:
        """Write a ROS map_server map, a YAML file and an image beside it, from which an equal map is read.

        Args:
            path: the YAML file; the image gets the same name with the suffix ``.pgm``. Both are overwritten.

        Raises:
            MapError: if the name has another suffix, or a file cannot be written.
        """
        write_map_server(MapFile(self.cells, self.resolution, self.origin), as_path(path, MapError))
