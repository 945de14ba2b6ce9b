"""Images read as maps: dark pixels are occupied."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.collision.occupancy import FREE, FREE_THRESHOLD, OCCUPIED, OCCUPIED_THRESHOLD, UNKNOWN
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
    """Whether bright pixels are the occupied ones."""
    occupied_thresh: float = OCCUPIED_THRESHOLD
    """Pixels more likely occupied than this are occupied."""
    free_thresh: float = FREE_THRESHOLD
    """Pixels less likely occupied than this are free."""


def read_image(path: Path) -> NDArray[np.int8]:
    """Cells of an image without further data: dark is occupied, bright free, transparent unknown.

    Args:
        path: the image file.

    Returns:
        ``OCCUPIED``, ``FREE`` or ``UNKNOWN``, the lowest row first, shape (rows, columns).

    Raises:
        MapError: if it cannot be read.
    """
    pixels = read_pixels(path)
    cells = cells_of(pixels._replace(alpha=None), Reading())
    if pixels.alpha is not None:
        cells[pixels.alpha[::-1] != 255] = UNKNOWN
    return cells


def cells_of(pixels: Pixels, reading: Reading) -> NDArray[np.int8]:
    """Cells as nav2_map_server makes them, those between the thresholds unknown in every mode.

    - ``trinary``: alpha counts as one more channel of the brightness, a grey 1 - p is occupied with likelihood p.
    - ``scale``: the same of the colours alone, and what is not opaque is unknown.
    - ``raw``: the brightness from 0 to 255 is the number of ROS, percent up to 100 and unknown above; ``negate`` and
      alpha have no meaning.

    Note:
        map_saver writes unknown cells as grey 205 of 255, which is free under the ``free_thresh`` of 0.25 that nav2
        writes beside it. Here that very grey is unknown whatever the threshold, in a trinary map that is not negated.

    Args:
        pixels: the image.
        reading: how to read it.

    Returns:
        ``OCCUPIED``, ``FREE`` or ``UNKNOWN``, the lowest row first, shape (rows, columns).
    """
    sums, peak, alpha = pixels
    unknown_sum = UNKNOWN_GREY * (peak // 255)
    cells = None
    if reading.mode == "trinary" and alpha is not None:
        four_channels = sums + alpha  # a sum of three channels and alpha stays below 2^16
        cells = _likelihood_cells(peak + 255, reading)[four_channels]
    else:
        cells = _likelihood_cells(peak, reading)[sums]
    if reading.mode == "trinary" and not reading.negate:
        cells[sums == unknown_sum] = UNKNOWN
    if reading.mode == "scale" and alpha is not None:
        cells[alpha != 255] = UNKNOWN
    return cells[::-1]


def _likelihood_cells(peak: int, reading: Reading) -> NDArray[np.int8]:
    """Cell for every brightness from 0 to a peak, shape (peak + 1,)."""
    shade = np.arange(peak + 1) / peak
    likelihood = shade if reading.negate else 1.0 - shade
    if reading.mode == "raw":
        percent = np.round(255.0 * shade)
        likelihood = np.where(percent <= 100.0, percent / 100.0, np.nan)
    cells = np.full(peak + 1, UNKNOWN, dtype=np.int8)
    cells[likelihood > reading.occupied_thresh] = OCCUPIED
    cells[likelihood < reading.free_thresh] = FREE
    return cells
