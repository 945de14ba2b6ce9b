"""A footprint as a tree of discs: what lies in all of them together holds it, and each holds a part of it.

Where one disc about the robot's origin is too coarse to decide, its parts are asked (Quinlan, "Efficient distance
computation between non-convex objects", 1994, does so with spheres).
"""

from __future__ import annotations

import math

import numpy as np
import shapely
from numpy.typing import NDArray

from cbrrt_ompl.problem.robot import Footprint

DEPTH = 2
"""Times that a footprint is quartered."""

COLUMNS = 5
"""Numbers of a disc: centre (x, y) in the robot's frame, outer and inner radius [m], and the row after its parts."""


def disc_tree(footprint: Footprint, growth: float) -> NDArray[np.float64]:
    """The parts of a polygon, in depth-first order.

    The outer disc of a row holds its part of the footprint, the inner disc lies in the footprint (its radius is
    negative where its centre does not). A row's own parts follow it, up to the row that its last number names. The
    whole is no row: its two radii about the origin are known already.

    Args:
        footprint: the robot's area; a round one has no parts.
        growth: what is added to the outer radii [m].

    Returns:
        Rows of (x, y, outer, inner, next), shape (n, COLUMNS).
    """
    rows: list[list[float]] = []
    if footprint.vertices is not None:
        polygon = shapely.Polygon(footprint.vertices)
        for part in _quarters(polygon):
            _add(rows, part, polygon, growth, DEPTH - 1)
    return np.array(rows, dtype=float).reshape(-1, COLUMNS)


def _add(rows: list[list[float]], part: shapely.Geometry, polygon: shapely.Polygon, growth: float, depth: int) -> None:
    """Append the row of a part and those of its own parts."""
    x0, y0, x1, y1 = part.bounds
    centre = shapely.Point(0.5 * (x0 + x1), 0.5 * (y0 + y1))
    corners = shapely.get_coordinates(part)
    outer = float(np.hypot(*(corners - (centre.x, centre.y)).T).max()) * (1.0 + 1e-12) + growth
    inner = shapely.distance(polygon.exterior, centre) if polygon.contains(centre) else -math.inf
    row = [centre.x, centre.y, outer, inner, 0.0]
    rows.append(row)
    if depth > 0:
        for quarter in _quarters(part):
            _add(rows, quarter, polygon, growth, depth - 1)
    row[4] = len(rows)


def _quarters(shape: shapely.Geometry) -> list[shapely.Geometry]:
    """The shape cut by the middle lines of its bounding box; quarters without an area are left out."""
    x0, y0, x1, y1 = shape.bounds
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    boxes = [(x0, y0, x, y), (x, y0, x1, y), (x0, y, x, y1), (x, y, x1, y1)]
    parts = [shapely.intersection(shape, shapely.box(*box)) for box in boxes]
    return [part for part in parts if part.area > 0.0]
