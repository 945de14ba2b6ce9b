"""What every value that comes in is checked by: numbers of a size that we can compute with, and rings of corners."""

from __future__ import annotations

import sys
from numbers import Real
from typing import TypeGuard

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from cbrrt_ompl.errors import Problem, WorldError

LARGEST = 1e6
"""Largest coordinate, limit, gain or setting, in SI units: beyond it, what we compute would drown in rounding."""

SMALLEST = 1e-9
"""Smallest size, limit or setting that must be above 0, in SI units, for the same reason."""

A_NUMBER = f"a finite number, at most {LARGEST:g}"
A_POSITIVE_NUMBER = f"a number above 0, from {SMALLEST:g} to {LARGEST:g}"


def is_number(value: object, most: float = sys.float_info.max) -> TypeGuard[float]:
    """Whether a value is a finite number and no truth value.

    Args:
        value: anything.
        most: largest absolute value.
    """
    if isinstance(value, bool) or not isinstance(value, (float, int, Real)):  # the last one takes its time
        return False
    try:
        return abs(value if isinstance(value, int) else float(value)) <= most  # NaN is not
    except OverflowError:
        return False


def counter_clockwise_ring(vertices: ArrayLike, field: str) -> NDArray[np.float64]:
    """Corners of a simple polygon, checked and ordered.

    Args:
        vertices: corners, shape (n, 2) [m], open or closed, in either direction.
        field: name of the value in messages.

    Returns:
        Corners counter-clockwise, not closed, read-only, shape (n, 2) [m].

    Raises:
        WorldError: if they are not finite, fewer than three, or make no simple polygon with an area.
    """
    try:
        numbers = np.array(vertices)
    except ValueError:
        numbers = np.empty(0)
    is_list = numbers.ndim == 2 and numbers.shape[1] == 2 and numbers.dtype.kind in "fiu"
    corners = numbers.astype(np.float64) if is_list else np.empty((0, 2))
    if not (is_list and (np.abs(corners) <= LARGEST).all()):  # NaN is not
        raise WorldError(Problem(field, vertices, f"a list of [x, y] corners with finite numbers, at most {LARGEST:g}"))
    if len(corners) > 1 and np.array_equal(corners[0], corners[-1]):
        corners = corners[:-1]
    if len(corners) < 3:
        raise WorldError(Problem(field, vertices, "at least three corners"))
    polygon = shapely.Polygon(corners)
    if not polygon.is_valid or polygon.area < SMALLEST**2:
        reason = shapely.is_valid_reason(polygon) if not polygon.is_valid else "no area"
        raise WorldError(Problem(field, vertices, f"a simple polygon with an area ({reason.lower()})"))
    ring = corners if polygon.exterior.is_ccw else corners[::-1].copy()
    ring.setflags(write=False)
    return ring
