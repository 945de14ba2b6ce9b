"""Discs that stand for a footprint in the constraints of an optimisation."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import shapely
from numpy.typing import NDArray

from cbrrt_ompl.optimise.program import MOST_DISCS
from cbrrt_ompl.problem.robot import Footprint

OUTLINE_POINTS = 160
"""Points of the outline that are to be covered."""

GAP = 0.08
"""How far a point of the outline may lie outside of all discs, as a fraction of the radius of the largest one."""

LEAST_GAP = 1e-3
"""The gap of a footprint in which hardly a disc fits, as a fraction of its size."""

_HALVINGS = 30


@lru_cache(maxsize=64)
def cover(footprint: Footprint) -> NDArray[np.float64]:
    """Discs inside a footprint that leave little of its outline uncovered.

    Of the largest discs inside that touch the outline, the one that covers the most is taken, again and again (greedy
    set cover); the corners that stick out are discs of radius 0.

    Args:
        footprint: the robot's area.

    Returns:
        Rows of (x, y, radius) in the robot's frame, read-only, shape (n, 3) [m].
    """
    if footprint.vertices is None:
        discs = np.array([[0.0, 0.0, footprint.radius]])
    else:
        discs = _cover_polygon(shapely.Polygon(footprint.vertices))
    discs.setflags(write=False)
    return discs


def _cover_polygon(polygon: shapely.Polygon) -> NDArray[np.float64]:
    """The discs of a footprint with corners."""
    points, inward = _outline(polygon)
    candidates = np.column_stack(_largest_discs(polygon, points, inward))
    corners = _convex_corners(polygon)
    span = float(np.ptp(points, axis=0).max())
    gap, count = max(GAP * float(candidates[:, 2].max()), LEAST_GAP * span), MOST_DISCS + 1
    while count > MOST_DISCS:
        discs = _greedy_cover(points, candidates, corners, gap)
        gap, count = 1.3 * gap, len(discs)
    return discs


def _greedy_cover(
    points: NDArray[np.float64], candidates: NDArray[np.float64], corners: NDArray[np.float64], gap: float
) -> NDArray[np.float64]:
    """Corners and candidates, rows of (x, y, radius), that leave no point farther than a gap outside of all."""
    chosen = [np.column_stack([corners, np.zeros(len(corners))])]
    from_candidates = np.hypot(*(points[:, None] - candidates[None, :, :2]).transpose(2, 0, 1)) - candidates[:, 2]
    covers = from_candidates <= gap  # (points, candidates)
    missing = np.hypot(*(points[:, None] - corners[None]).transpose(2, 0, 1)).min(axis=1) > gap
    while missing.any():
        covered = covers[missing].sum(axis=0)
        best = int(np.argmax(covered))
        if covered[best] > 0:
            chosen.append(candidates[[best]])
            missing &= ~covers[:, best]
        else:  # a sliver: no disc fits into it, so its outline itself is covered
            point = points[np.argmax(missing)]
            chosen.append(np.array([[*point, 0.0]]))
            missing &= np.hypot(*(points - point).T) > gap
    return np.concatenate(chosen)


def _outline(polygon: shapely.Polygon) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points evenly along the edges and the normals into the polygon, both of shape (n, 2)."""
    ring = shapely.get_coordinates(polygon.exterior)
    ends = ring[1:]
    edges = ends - ring[:-1]
    lengths = np.hypot(*edges.T)
    counts = np.maximum(1, np.round(OUTLINE_POINTS * lengths / lengths.sum())).astype(int)
    points = [a + (np.arange(n)[:, None] + 0.5) / n * e for a, e, n in zip(ring[:-1], edges, counts, strict=True)]
    normals = np.column_stack([-edges[:, 1], edges[:, 0]]) / lengths[:, None]
    return np.concatenate(points), np.repeat(normals, counts, axis=0)


def _largest_discs(
    polygon: shapely.Polygon, points: NDArray[np.float64], inward: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centres, shape (n, 2), and radii, shape (n,), of the largest discs inside that touch the outline at points."""
    x_min, y_min, x_max, y_max = polygon.bounds
    low: NDArray[np.float64] = np.zeros(len(points))
    high: NDArray[np.float64] = np.full(len(points), max(x_max - x_min, y_max - y_min))
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        centres = shapely.points(points + middle[:, None] * inward)
        fits = shapely.contains(polygon, centres) & (
            shapely.distance(polygon.exterior, centres) >= middle * (1.0 - 1e-9)
        )
        low, high = np.where(fits, middle, low), np.where(fits, high, middle)
    return points + low[:, None] * inward, low


def _convex_corners(polygon: shapely.Polygon) -> NDArray[np.float64]:
    """Corners at which the outline turns to the left, shape (n, 2)."""
    ring = shapely.get_coordinates(polygon.exterior)[:-1]
    before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    return ring[before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0] > 0.0]
