"""Images read as maps: dark pixels are occupied."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.collision.occupancy import FREE, FREE_THRESHOLD, OCCUPIED, OCCUPIED_THRESHOLD, UNKNOWN
from cbrrt_ompl.scenario.maps.map_files import MapFile
from cbrrt_ompl.scenario.maps.pixels import Pixels, read_pixels

MODES = ("trinary", "scale", "raw")
"""How map_server makes cells of pixels."""

UNKNOWN_GREY = 205
"""The grey in which map_saver writes unknown cells, of 255."""


class Reading(NamedTuple):
    """How cells are made of pixels; the keys of a map_server file."""

    mode: str = "trinary"
    """One of ``MODES``."""
    negate: bool = False
    """Whether bright pixels are the occupied ones; without meaning in ``raw``."""
    occupied_thresh: float = OCCUPIED_THRESHOLD
    """Pixels at least as likely occupied as this are occupied; without meaning in ``raw``."""
    free_thresh: float = FREE_THRESHOLD
    """Pixels at most as likely occupied as this are free; without meaning in ``raw``."""


def read_image(path: Path) -> MapFile:
    """Cells of an image without further data: dark is occupied, bright free, transparent unknown.

    Args:
        path: the image file.

    Returns:
        The cells.

    Raises:
        MapError: if it cannot be read.
    """
    return MapFile(cells_of(read_pixels(path), Reading()))


def cells_of(pixels: Pixels, reading: Reading) -> NDArray[np.int8]:
    """Cells as nav2_map_server and the static layer of a trinary costmap make them.

    A pixel of brightness p from 0 to 1, the mean of its colours, is occupied with likelihood 1 - p, or p where
    ``negate`` is set.

    - ``trinary``: occupied from ``occupied_thresh`` on, free up to ``free_thresh``, both included, unknown between
      them. What is not opaque is unknown.
    - ``scale``: the same, but what lies between the thresholds is a number of percent on the way from one to the other,
      and less than 100 of them are free to the costmap.
    - ``raw``: the brightness from 0 to 255 is the number of ROS: 100 is occupied, less is free, more is unknown.
      ``negate``, the thresholds and alpha have no meaning.

    Note:
        map_saver writes unknown cells as grey 205 of 255, which is free under the ``free_thresh`` of 0.25 that nav2
        writes beside it. Here that very grey is unknown whatever the threshold, in a trinary map that is not negated.

        Older versions of nav2_map_server (up to Jazzy) left the borders out, and took alpha for a fourth colour in
        trinary maps, where opaque dark grey became unknown.

    Args:
        pixels: the image.
        reading: how to read it.

    Returns:
        ``OCCUPIED``, ``FREE`` or ``UNKNOWN``, the lowest row first, shape (rows, columns).
    """
    sums, peak, alpha = pixels
    if reading.mode == "raw":
        return _raw_cells(peak)[sums][::-1]
    cells = _likelihood_cells(peak, reading)[sums]
    if reading.mode == "trinary" and not reading.negate:
        cells[sums == UNKNOWN_GREY * (peak // 255)] = UNKNOWN
    if alpha is not None:
        cells[alpha != 255] = UNKNOWN
    return cells[::-1]


def _likelihood_cells(peak: int, reading: Reading) -> NDArray[np.int8]:
    """Cell for every brightness from 0 to a peak, shape (peak + 1,), in the single precision of nav2_map_server."""
    shade = np.arange(peak + 1, dtype=np.float32) / np.float32(peak)
    likelihood = shade if reading.negate else np.float32(1.0) - shade
    occupied, free = np.float32(reading.occupied_thresh), np.float32(reading.free_thresh)
    cells = np.full(peak + 1, UNKNOWN, dtype=np.int8)
    if reading.mode == "scale" and occupied > free:
        percent = np.float32(100.0) * ((likelihood - free) / (occupied - free))
        cells[:] = np.where(np.floor(percent + np.float32(0.5)) < OCCUPIED, FREE, OCCUPIED)
    cells[likelihood >= occupied] = OCCUPIED
    cells[likelihood <= free] = FREE
    return cells


def _raw_cells(peak: int) -> NDArray[np.int8]:
    """Cell for every brightness from 0 to a peak where it is the number of ROS, shape (peak + 1,)."""
    number = np.round(255.0 * np.arange(peak + 1) / peak)
    return np.select([number < OCCUPIED, number == OCCUPIED], [FREE, OCCUPIED], UNKNOWN).astype(np.int8)
