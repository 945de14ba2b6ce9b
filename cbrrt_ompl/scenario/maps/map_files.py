"""Files of maps: what their names end in, what is in them, and where the files that they name are looked for."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

ROS_SUFFIXES = (".yaml", ".yml")
IMAGE_SUFFIXES = (".bmp", ".gif", ".jpeg", ".jpg", ".pbm", ".pgm", ".png", ".ppm", ".tif", ".tiff")
"""What the names of map_server's files and of images end in."""

MAP_SERVER_KEYS = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")
"""Keys of a map_server file, by which it is told from other YAML files."""


class MapFile(NamedTuple):
    """What the file of a map holds."""

    cells: NDArray[np.int8]
    """``OCCUPIED``, ``FREE`` or ``UNKNOWN``, the lowest row first, shape (rows, columns)."""
    resolution: float | None = None
    """Side of a cell [m]; None where the file does not tell it."""
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Pose (x, y, yaw) of the lower left corner [m, m, rad]."""
    remarks: tuple[str, ...] = ()
    """What was not taken as it was written, a line each."""


LONGEST_NAME = 255
"""Characters that the name of a file may have; a message does not repeat a longer one."""


def find_beside(name: str, folder: Path) -> tuple[Path | None, str]:
    """The file that another one names, also if that came from another machine.

    Args:
        name: as written: relative to the folder, absolute, or under the home folder.
        folder: where the file that names it lies.

    Returns:
        The file and nothing where it is as written; the file of the same name in the folder and a remark on that; or
        None and the place where it was looked for.
    """
    written = folder / as_written(name)
    if _is_file(written):
        return written, ""
    last = re.split(r"[\\/]", name.rstrip())[-1]  # of either kind of machine
    if len(last) > LONGEST_NAME:
        return None, f"a file in {folder}, where names have at most {LONGEST_NAME} characters"
    beside = folder / last
    if last and beside != written and _is_file(beside):
        return beside, f"there is no {name}, {beside} is taken"
    return None, f"{written}" if beside == written or not last else f"{written} and as {beside}"


def as_written(name: str) -> Path:
    """A path with ``~`` replaced by the home folder, as shells do."""
    try:
        return Path(name).expanduser()
    except RuntimeError:  # no home folder
        return Path(name)


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name that no file can have
        return False
