"""What is in line of sight from a place: rays to the first thing that they hit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.collision.pieces import DISC, RECTANGLE, Pieces, join, obstacle_pieces
from cbrrt_ompl.kernels import kernel
from cbrrt_ompl.motion.records import Record, Records, record_array
from cbrrt_ompl.problem.obstacles import Disc, Obstacle

UNIFORM_RAYS = 720
"""Rays a look has besides those at the edges of what is near."""

EDGE = 1e-7
"""Angle by which a ray passes an edge [rad]."""

ARCS = 120
"""Arcs that an outline has where nothing is in the way, all around."""

SHAPE = np.dtype(
    [
        ("first", np.int64),  # row of its first corner
        ("count", np.int64),  # of its corners; 0 for a disc
        ("x", np.float64),  # a point inside [m]
        ("y", np.float64),
        ("radius", np.float64),  # of a disc [m]
    ],
    align=True,
)
"""A convex shape."""

SPAN = np.dtype(
    [
        ("start", np.float64),  # direction of its right edge, seen from a place, from -pi to pi [rad]
        ("width", np.float64),  # angle to its left edge [rad]
        ("nearest", np.float64),  # distance of its nearest point [m]
        ("nearest_angle", np.float64),  # direction of that [rad]
    ],
    align=True,
)
"""A convex shape as it is seen from a place outside of it."""


class View(NamedTuple):
    """What a look shows."""

    is_seen: NDArray[np.bool_]
    """Whether a ray hits an obstacle within range, before all others; shape (number of obstacles,)."""
    rays: NDArray[np.float64]
    """Directions of the rays, from -pi to pi, sorted, shape (k,) [rad]."""
    hits: NDArray[np.int64]
    """Which convex shape each of them ends at, -1 where it is none, shape (k,)."""
    lengths: NDArray[np.float64]
    """How far each of them sees, shape (k,) [m]."""

    def outline(self, x: float, y: float, reach: float = math.inf) -> NDArray[np.float64]:
        """Where the rays end, or are cut off, counter-clockwise, shape (n, 2) [m].

        Of neighbours that end at one convex shape, there are the first and the last alone: between these, the outline
        runs within the shape.

        Args:
            x: position of the sensor [m].
            y: position of the sensor [m].
            reach: where rays are cut off [m].
        """
        arcs = -1 - ((self.rays + math.pi) * (ARCS / math.tau)).astype(int)
        hits = np.where((self.hits >= 0) & (self.lengths < reach), self.hits, arcs)
        is_corner = (hits != np.roll(hits, 1)) | (hits != np.roll(hits, -1))
        rays, lengths = self.rays[is_corner], np.minimum(self.lengths, reach)[is_corner]
        return np.column_stack([x + lengths * np.cos(rays), y + lengths * np.sin(rays)])


class Sight:
    """Obstacles, as convex shapes that hide each other.

    Rays go past both sides of each edge and corner, halfway between each two of these, to the nearest points, and in
    `UNIFORM_RAYS` directions besides. So of what does not overlap everything visible is hit; of overlapping obstacles a
    sliver between two rays may be missed. Then the obstacle counts as not seen.
    """

    def __init__(self, obstacles: Sequence[Obstacle]) -> None:
        """Take the obstacles apart.

        Args:
            obstacles: all that blocks the sight, known or not.
        """
        parts = [obstacle_pieces([obstacle]) for obstacle in obstacles]
        counts = np.array([len(part.pieces) for part in parts], dtype=int)
        self._owner = np.repeat(np.arange(len(parts)), counts)  # obstacle of each shape
        self._shapes, self._corners = _shapes(join(parts))
        self._obstacles = len(parts)

    def look(self, x: float, y: float, sensor_range: float) -> View:
        """Look around.

        Args:
            x: position of the sensor, outside of all obstacles [m].
            y: position of the sensor [m].
            sensor_range: how far it sees [m].
        """
        shapes, spans, owner = self._near(x, y, sensor_range)
        rows = np.concatenate([np.empty(0, dtype=int), *(s["first"] + np.arange(s["count"]) for s in shapes)])
        corners = self._corners[rows]
        towards = np.arctan2(corners[:, 1] - y, corners[:, 0] - x)
        rays = _rays(np.concatenate([spans["start"], spans["start"] + spans["width"], towards]), spans["nearest_angle"])
        firsts = np.searchsorted(rays, spans["start"] - np.array([[0.0], [math.tau]]))
        distances, hits = first_hits(shapes, self._corners, spans, rays, firsts, x, y)
        is_seen = np.zeros(self._obstacles, dtype=bool)
        is_seen[owner[hits[(hits >= 0) & (distances <= sensor_range)]]] = True
        return View(is_seen, rays, np.where(distances < sensor_range, hits, -1), np.minimum(distances, sensor_range))

    def _near(self, x: float, y: float, reach: float) -> tuple[Records, Records, NDArray[np.int64]]:
        """Shapes within reach, how they are seen, and their obstacles."""
        spans = record_array(len(self._shapes), SPAN)
        find_spans(self._shapes, self._corners, x, y, spans)
        is_near = spans["nearest"] <= reach
        return self._shapes[is_near], spans[is_near], self._owner[is_near]


@cache
def warm_up() -> None:
    """Make the kernels ready that look, before a clock runs."""
    Sight([Disc((1.0, 0.0), 0.1)]).look(0.0, 0.0, 2.0)


def _shapes(parts: Pieces) -> tuple[Records, NDArray[np.float64]]:
    """Convex pieces as discs and rings of corners, and these corners, shape (m, 2) [m]."""
    pieces = parts.pieces
    shapes = record_array(len(pieces), SHAPE)
    for name in ("first", "count", "x", "y"):
        shapes[name] = pieces[name]
    is_disc, is_rectangle = pieces["kind"] == DISC, pieces["kind"] == RECTANGLE
    shapes["radius"][is_disc] = pieces["half_x"][is_disc]
    boxes = pieces[is_rectangle]
    a = boxes["half_x"] * [boxes["cos"], boxes["sin"]]  # (2, n)
    b = boxes["half_y"] * [-boxes["sin"], boxes["cos"]]
    outlines = [boxes["x"], boxes["y"]] + np.array([-a - b, a - b, a + b, b - a])  # (4, 2, n)
    shapes["first"][is_rectangle] = len(parts.corners) + 4 * np.arange(len(boxes))
    shapes["count"][is_rectangle] = 4
    own_corners = np.column_stack([parts.corners["x"], parts.corners["y"]])
    return shapes, np.concatenate([own_corners, outlines.transpose(2, 0, 1).reshape(-1, 2)])


def _rays(edges: NDArray[np.float64], nearest: NDArray[np.float64]) -> NDArray[np.float64]:
    """Directions to look in, from -pi to pi, sorted, shape (k,) [rad]."""
    edges = np.sort(_wrapped(edges))
    between = 0.5 * (edges + np.append(edges[1:], edges[:1] + math.tau))
    around = np.linspace(-math.pi, math.pi, UNIFORM_RAYS, endpoint=False)
    return np.sort(_wrapped(np.concatenate([edges - EDGE, edges + EDGE, between, nearest, around])))


def _wrapped(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angles from -pi to below pi."""
    return (angles + math.pi) % math.tau - math.pi


@kernel
def find_spans(shapes: Records, corners: NDArray[np.float64], x: float, y: float, spans: Records) -> None:
    """How convex shapes are seen from a place outside of them, compiled.

    Args:
        shapes: records of type `SHAPE`, shape (n,).
        corners: corners of those that are no discs, counter-clockwise, shape (m, 2) [m].
        x: position [m].
        y: position [m].
        spans: filled in, records of type `SPAN`, shape (n,).
    """
    for i in range(len(shapes)):
        shape, span = shapes[i], spans[i]
        middle = math.atan2(shape.y - y, shape.x - x)
        if shape.count == 0:
            distance = math.hypot(shape.x - x, shape.y - y)
            low = -math.asin(min(shape.radius / distance, 1.0))
            span.width = -2.0 * low
            span.nearest, span.nearest_angle = max(distance - shape.radius, 0.0), middle
        else:
            low, high, span.nearest = math.inf, -math.inf, math.inf
            for k in range(shape.count):
                ax, ay = corners[shape.first + k, 0] - x, corners[shape.first + k, 1] - y
                turn = math.atan2(ay, ax) - middle
                turn -= math.tau * round(turn / math.tau)
                low, high = min(low, turn), max(high, turn)
                after = shape.first + (k + 1) % shape.count
                ex, ey = corners[after, 0] - x - ax, corners[after, 1] - y - ay
                along = min(max(-(ax * ex + ay * ey) / (ex * ex + ey * ey), 0.0), 1.0)
                distance = math.hypot(ax + along * ex, ay + along * ey)
                if distance < span.nearest:
                    span.nearest, span.nearest_angle = distance, math.atan2(ay + along * ey, ax + along * ex)
            span.width = high - low
        start = middle + low
        span.start = start - math.tau * math.floor((start + math.pi) / math.tau)


@kernel
def first_hits(
    shapes: Records,
    corners: NDArray[np.float64],
    spans: Records,
    rays: NDArray[np.float64],
    firsts: NDArray[np.int64],
    x: float,
    y: float,
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """The first shape that each ray hits, compiled.

    Args:
        shapes: records of type `SHAPE`, shape (n,).
        corners: see :func:`find_spans`.
        spans: of the shapes, from the same place, shape (n,).
        rays: directions from -pi to pi, sorted, shape (k,) [rad].
        firsts: the first ray after the beginning of each span, and after that less a turn, shape (2, n).
        x: position [m].
        y: position [m].

    Returns:
        Distances, infinite where nothing is hit, shape (k,) [m], and rows of the shapes, -1 there, shape (k,).
    """
    distances, hits = np.full(len(rays), math.inf), np.full(len(rays), -1)
    for i in range(len(shapes)):
        for turns in range(2):  # what goes on beyond pi begins again at -pi
            start = spans[i].start - turns * math.tau
            for k in range(firsts[turns, i], len(rays)):
                if rays[k] > start + spans[i].width:
                    break
                distance = _distance_along(shapes[i], corners, math.cos(rays[k]), math.sin(rays[k]), x, y)
                if distance < distances[k]:
                    distances[k], hits[k] = distance, i
    return distances, hits


@kernel(inline="always")
def _distance_along(shape: Record, corners: NDArray[np.float64], c: float, s: float, x: float, y: float) -> float:
    """Distance at which a ray in the direction (c, s) meets a shape; infinite where it does not [m]."""
    nearest = math.inf
    if shape.count == 0:
        along, beside = c * (shape.x - x) + s * (shape.y - y), c * (shape.y - y) - s * (shape.x - x)
        inside = shape.radius * shape.radius - beside * beside
        if inside >= 0.0:
            nearest = along - math.sqrt(inside)
    else:
        for k in range(shape.count):
            after = shape.first + (k + 1) % shape.count
            ax, ay = corners[shape.first + k, 0] - x, corners[shape.first + k, 1] - y
            ex, ey = corners[after, 0] - x - ax, corners[after, 1] - y - ay
            across = c * ey - s * ex
            if across != 0.0 and 0.0 <= (s * ax - c * ay) / across <= 1.0:
                distance = (ax * ey - ay * ex) / across
                if 0.0 <= distance < nearest:
                    nearest = distance
    return nearest
