"""Formats of maps: a row each, found by what the name of a file ends in."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from cbrrt_ompl.scenario.maps.image import read_image
from cbrrt_ompl.scenario.maps.map_files import IMAGE_SUFFIXES, ROS_SUFFIXES, MapFile
from cbrrt_ompl.scenario.maps.map_server import read_map_server
from cbrrt_ompl.scenario.maps.movingai import read_movingai


class MapFormat(NamedTuple):
    """A format of maps."""

    suffixes: tuple[str, ...]
    """What the names of its files end in, in small letters."""
    read: Callable[[Path], MapFile]
    """Reads a file; a MapError tells why it cannot."""
    tells_resolution: bool = True
    """Whether its files tell the side of a cell."""


FORMATS = (
    MapFormat(ROS_SUFFIXES, read_map_server),
    MapFormat((".map",), read_movingai, tells_resolution=False),
    MapFormat(IMAGE_SUFFIXES, read_image, tells_resolution=False),
)
"""All formats that are read."""


def map_suffixes() -> tuple[str, ...]:
    """What the names of maps end in."""
    return tuple(suffix for row in FORMATS for suffix in row.suffixes)


def format_of(path: Path) -> MapFormat | None:
    """The format of a file by its suffix; None if it is no map's."""
    return next((row for row in FORMATS if path.suffix.lower() in row.suffixes), None)
