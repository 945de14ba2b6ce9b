"""One door to all maps: the reader is chosen by the suffix of the file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from cbrrt_ompl.collision.occupancy import OCCUPIED
from cbrrt_ompl.errors import MISSING, MapError, Problem, Remark
from cbrrt_ompl.files import as_path, note_read
from cbrrt_ompl.scenario.maps.formats import format_of, map_suffixes
from cbrrt_ompl.scenario.maps.occupancy_map import OccupancyMap


def load_map(
    path: str | Path,
    *,
    resolution: float | None = None,
    origin: Sequence[float] | None = None,
    unknown: str = "occupied",
    may_be_full: bool = False,
) -> OccupancyMap:
    """Map from a file.

    Args:
        path: a ROS map_server map (``.yaml``), an image (``.png``, ``.pgm``, ``.bmp``, ``.tif`` and others; dark is
            occupied), or a MovingAI map (``.map``).
        resolution: side of a cell [m]; needed but for ROS maps, whose own it replaces.
        origin: pose (x, y, yaw) of the lower left corner of the map, [m, m, rad]; that of a ROS map, or zero, if not
            given.
        unknown: whether unknown cells will count as ``occupied`` or ``free``.
        may_be_full: accept a map without any free cell, as a mask over another one may be.

    Returns:
        The map.

    Raises:
        MapError: if it cannot be read, in one line a mistake, or if every cell is occupied.
    """
    path = as_path(path, MapError)
    note_read(path)
    kind = format_of(path)
    if kind is None:
        expected = f"one of {', '.join(map_suffixes())}"
        raise MapError(Problem("suffix", path.suffix.lower() or MISSING, expected), str(path))
    if resolution is None and not kind.tells_resolution:
        expected = "the side of a cell [m], which the file does not tell"
        raise MapError(Problem("resolution", MISSING, expected), str(path))
    cells, own_resolution, own_origin, remarks = kind.read(path)
    resolution = own_resolution if resolution is None else resolution
    origin = own_origin if origin is None else origin
    found = OccupancyMap(cells, resolution, origin, unknown, str(path), remarks)  # type: ignore[arg-type]  # checked
    if not may_be_full and (found.cells == OCCUPIED).all():
        raise MapError(Problem("cells", Remark("only occupied ones"), "a free one"), str(path))
    return found
