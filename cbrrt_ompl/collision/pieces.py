"""Obstacles and footprints as convex pieces: the records that the kernels read."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from cbrrt_ompl.collision.convex import convex_parts
from cbrrt_ompl.motion.records import Records, put_records
from cbrrt_ompl.problem.obstacles import Box, Disc, Obstacle, OrientedBox, Polygon
from cbrrt_ompl.problem.robot import Footprint

RECTANGLE, DISC, POLYGON = 0, 1, 2
"""Kinds of a piece."""

PIECE = np.dtype(
    [
        ("kind", np.int32),
        ("first", np.int32),  # polygon: row of its first corner
        ("count", np.int32),  # polygon: how many corners it has
        ("x", np.float64),  # centre [m]
        ("y", np.float64),
        ("half_x", np.float64),  # rectangle: half sides; disc: its radius [m]
        ("half_y", np.float64),
        ("cos", np.float64),  # rectangle: direction of its first side
        ("sin", np.float64),
    ],
    align=True,
)
"""A convex piece of the world or of a footprint."""

CORNER = np.dtype(
    [
        ("x", np.float64),  # [m]
        ("y", np.float64),
        ("along_x", np.float64),  # unit vector along the edge to the next corner, counter-clockwise
        ("along_y", np.float64),
        ("length", np.float64),  # of that edge [m]
    ],
    align=True,
)
"""A corner of a convex polygon, and the edge that follows it."""


class Pieces(NamedTuple):
    """Convex pieces and the corners that those of them which are polygons refer to."""

    pieces: Records
    """Records of type `PIECE`, shape (n,)."""
    corners: Records
    """Records of type `CORNER`, shape (m,)."""


def join(parts: Iterable[Pieces]) -> Pieces:
    """Several sets of pieces as one."""
    parts = list(parts)
    pieces = np.empty(sum(len(part.pieces) for part in parts), dtype=PIECE)
    corners = np.empty(sum(len(part.corners) for part in parts), dtype=CORNER)
    row = first = 0
    for part in parts:
        put_records(pieces[row:], part.pieces)
        pieces["first"][row : row + len(part.pieces)] += first
        put_records(corners[first:], part.corners)
        row, first = row + len(part.pieces), first + len(part.corners)
    return Pieces(pieces, corners)


def obstacle_pieces(obstacles: Sequence[Obstacle]) -> Pieces:
    """The pieces of obstacles, kind after kind; of equal ones those of one.

    Args:
        obstacles: boxes, discs and polygons.
    """
    boxes: dict[tuple[float, ...], None] = {}  # of numbers, which are compared sooner than obstacles
    turned: dict[tuple[float, ...], None] = {}
    discs: dict[tuple[float, ...], None] = {}
    polygons: dict[Polygon, None] = {}
    for obstacle in obstacles:
        if isinstance(obstacle, Box):
            boxes.setdefault(obstacle.min + obstacle.max)
        elif isinstance(obstacle, OrientedBox):
            turned.setdefault((*obstacle.center, *obstacle.size, obstacle.angle))
        elif isinstance(obstacle, Disc):
            discs.setdefault((*obstacle.center, obstacle.radius))
        else:
            polygons.setdefault(obstacle)
    x0, y0, x1, y1 = np.array(list(boxes), dtype=float).reshape(-1, 4).T
    straight = _simple_pieces(RECTANGLE, 0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (x1 - x0), 0.5 * (y1 - y0))
    x, y, width, height, angle = np.array(list(turned), dtype=float).reshape(-1, 5).T
    tilted = _simple_pieces(RECTANGLE, x, y, 0.5 * width, 0.5 * height, angle)
    x, y, radius = np.array(list(discs), dtype=float).reshape(-1, 3).T
    round_ones = _simple_pieces(DISC, x, y, radius, radius)
    with_corners = join(polygon_pieces(polygon) for polygon in polygons)
    return with_corners._replace(pieces=np.concatenate([straight, tilted, round_ones, with_corners.pieces]))


@lru_cache(maxsize=10_000)
def polygon_pieces(polygon: Polygon) -> Pieces:
    """The convex parts of a polygon; kept, since they take their time and worlds share their obstacles."""
    return ring_pieces(convex_parts(polygon.to_shapely()))


def rectangle_pieces(centers: NDArray[np.float64], sizes: NDArray[np.float64], angle: float = 0.0) -> Pieces:
    """Pieces of many rectangles that are turned alike.

    Args:
        centers: shape (n, 2) [m].
        sizes: shape (n, 2) [m].
        angle: direction of the first side [rad]; 0 lies exactly along the axes.
    """
    (x, y), (half_x, half_y) = centers.T, 0.5 * sizes.T
    return Pieces(_simple_pieces(RECTANGLE, x, y, half_x, half_y, angle), np.empty(0, dtype=CORNER))


def footprint_pieces(footprint: Footprint, center: tuple[float, float]) -> Pieces:
    """The convex parts of a footprint with corners, about a centre in the robot's frame [m]; none of a round one."""
    if footprint.vertices is None:
        return join(())
    return ring_pieces([ring - center for ring in convex_parts(shapely.Polygon(footprint.vertices))])


def ring_pieces(rings: Sequence[NDArray[np.float64]]) -> Pieces:
    """Pieces of convex rings of corners, counter-clockwise, each of shape (n, 2) [m]."""
    counts = [len(ring) for ring in rings]
    pieces = np.zeros(len(rings), dtype=PIECE)
    pieces["kind"], pieces["count"], pieces["first"] = POLYGON, counts, np.cumsum([0, *counts])[:-1]
    pieces["x"], pieces["y"] = np.array([ring.mean(axis=0) for ring in rings]).reshape(-1, 2).T
    return Pieces(pieces, np.concatenate([np.empty(0, dtype=CORNER), *(corner_records(ring) for ring in rings)]))


def corner_records(ring: NDArray[np.float64]) -> Records:
    """Records of a convex ring's corners, counter-clockwise, shape (n, 2) to (n,)."""
    edges = np.roll(ring, -1, axis=0) - ring  # (n, 2)
    lengths = np.hypot(*edges.T)
    records = np.empty(len(ring), dtype=CORNER)
    records["x"], records["y"] = ring.T
    records["along_x"], records["along_y"] = (edges / lengths[:, None]).T
    records["length"] = lengths
    return records


def _simple_pieces(
    kind: int,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    half_x: NDArray[np.float64],
    half_y: NDArray[np.float64],
    angle: NDArray[np.float64] | float = 0.0,
) -> Records:
    """Rectangles or discs, one a row of the arrays, each of shape (n,)."""
    pieces = np.zeros(len(x), dtype=PIECE)
    pieces["kind"], pieces["x"], pieces["y"] = kind, x, y
    pieces["half_x"], pieces["half_y"], pieces["cos"], pieces["sin"] = half_x, half_y, np.cos(angle), np.sin(angle)
    return pieces
