"""Polygons as few convex parts: constrained Delaunay triangles, joined while they stay convex.

Joining triangles over inessential diagonals gives at most four times as many parts as the best partition: S. Hertel and
K. Mehlhorn, "Fast triangulation of simple polygons", FCT 1983.
"""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

_FLATNESS = 1e-12
"""Sine of the angle by which a corner of a convex part may be turned inwards: rounding."""

Ring = list[tuple[float, float]]


def convex_parts(polygon: shapely.Polygon) -> list[NDArray[np.float64]]:
    """Convex polygons that fill a polygon without overlapping.

    Args:
        polygon: simple, with holes if need be.

    Returns:
        Corners of each part, counter-clockwise, shape (n, 2) [m].
    """
    ring = shapely.get_coordinates(polygon.exterior)[:-1]
    ring = ring if polygon.exterior.is_ccw else ring[::-1]
    if not polygon.interiors and _is_convex(ring):
        return [_without_repetitions(ring)]
    triangles = shapely.get_coordinates(shapely.constrained_delaunay_triangles(polygon)).reshape(-1, 4, 2)[:, :3]
    a, b, c = np.moveaxis(triangles, 1, 0)
    is_clockwise = _cross(b - a, c - a) < 0.0
    triangles[is_clockwise] = triangles[is_clockwise, ::-1]
    return [np.array(part) for part in _join([[(x, y) for x, y in corners] for corners in triangles.tolist()])]


def _join(parts: list[Ring]) -> list[Ring]:
    """Parts with every diagonal removed whose two sides are convex together; each diagonal is looked at once."""
    owner = list(range(len(parts)))  # of each triangle: the part that it has become a part of

    def part_of(triangle: int) -> int:
        while owner[triangle] != triangle:
            triangle = owner[triangle]
        return triangle

    sides = {(a, b): i for i, part in enumerate(parts) for a, b in zip(part, part[1:] + part[:1], strict=True)}
    for (a, b), triangle in sides.items():
        if a > b or (b, a) not in sides:
            continue
        i, j = part_of(triangle), part_of(sides[b, a])
        if i != j:  # else both sides go around a hole
            union = _union(parts[i], parts[j], a, b)
            if len(set(union)) == len(union) and _is_convex(np.array(union)):
                parts[i], owner[j] = union, i
    return [parts[i] for i in range(len(parts)) if owner[i] == i]


def _union(one: Ring, other: Ring, a: tuple[float, float], b: tuple[float, float]) -> Ring:
    """The ring around two parts of which one has the edge from a to b, the other the edge back."""
    k, m = one.index(b), other.index(a)
    return one[k:] + one[:k] + (other[m:] + other[:m])[1:-1]


def _is_convex(ring: NDArray[np.float64]) -> bool:
    """Whether a counter-clockwise ring, shape (n, 2), turns left at all corners, or hardly right."""
    edges = np.roll(ring, -1, axis=0) - ring
    following = np.roll(edges, -1, axis=0)
    least = -_FLATNESS * np.hypot(*edges.T) * np.hypot(*following.T)
    return bool((_cross(edges, following) >= least).all())


def _without_repetitions(ring: NDArray[np.float64]) -> NDArray[np.float64]:
    """A ring without corners that repeat the one before."""
    return ring[(ring != np.roll(ring, 1, axis=0)).any(axis=1)]


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Third component of the cross products of vectors, shape (n, 2) to (n,)."""
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
