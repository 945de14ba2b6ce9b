"""Exact distances between convex pieces in the plane, compiled.

Two convex polygons that are apart are as far apart as the nearest corner of one from an edge of the other; they overlap
where no edge of either has all of the other on its outer side (separating axes). Below zero only the sign of a distance
means anything: the pieces overlap.
"""

from __future__ import annotations

import math

from cbrrt_ompl.collision.pieces import DISC, RECTANGLE
from cbrrt_ompl.kernels import inner_kernel, kernel
from cbrrt_ompl.motion.records import Record, Records

INFINITY = math.inf


@kernel(inline="always")
def point_rectangle(x: float, y: float, half_x: float, half_y: float) -> float:
    """Signed distance of a point from a rectangle about zero: minus its depth inside [m]."""
    beyond_x, beyond_y = abs(x) - half_x, abs(y) - half_y
    out_x, out_y = max(beyond_x, 0.0), max(beyond_y, 0.0)
    return math.sqrt(out_x * out_x + out_y * out_y) + min(max(beyond_x, beyond_y), 0.0)


@kernel(inline="always")
def squared_from_rectangle(x: float, y: float, half_x: float, half_y: float) -> float:
    """Squared distance of a point from a rectangle about zero, 0 inside [m^2]."""
    out_x, out_y = max(abs(x) - half_x, 0.0), max(abs(y) - half_y, 0.0)
    return out_x * out_x + out_y * out_y


@inner_kernel(forceinline=True)
def point_polygon(x: float, y: float, corners: Records, first: int, count: int) -> float:
    """Signed distance of a point from a convex polygon: minus its depth inside [m].

    Args:
        x: the point, in the frame of the corners [m].
        y: the point [m].
        corners: records of type :data:`cbrrt_ompl.collision.pieces.CORNER`.
        first: row of the polygon's first corner.
        count: how many it has.
    """
    outside, squared = -INFINITY, INFINITY
    for k in range(first, first + count):
        corner = corners[k]
        dx, dy = x - corner.x, y - corner.y
        height = dx * corner.along_y - dy * corner.along_x
        along = dx * corner.along_x + dy * corner.along_y
        outside = max(outside, height)
        if along <= 0.0:
            squared = min(squared, dx * dx + dy * dy)
        elif along < corner.length:
            squared = min(squared, height * height)
    return math.sqrt(squared) if outside > 0.0 else outside


@inner_kernel(forceinline=True)
def point_piece(x: float, y: float, piece: Record, corners: Records) -> float:
    """Signed distance of a point from a piece: minus its depth inside [m].

    Args:
        x: the point [m].
        y: the point [m].
        piece: a record of type :data:`cbrrt_ompl.collision.pieces.PIECE`.
        corners: what polygons refer to.
    """
    dx, dy = x - piece.x, y - piece.y
    if piece.kind == RECTANGLE:
        c, s = piece.cos, piece.sin
        return point_rectangle(c * dx + s * dy, c * dy - s * dx, piece.half_x, piece.half_y)
    if piece.kind == DISC:
        return math.sqrt(dx * dx + dy * dy) - piece.half_x
    return point_polygon(x, y, corners, piece.first, piece.count)


@inner_kernel(forceinline=True)
def rectangle_rectangle(
    own_x: float, own_y: float, x: float, y: float, half_x: float, half_y: float, c: float, s: float, enough: float
) -> float:
    """Distance of two rectangles [m].

    Args:
        own_x: half sides of one, about zero along the axes [m].
        own_y: see above.
        x: centre of the other [m].
        y: see above.
        half_x: half sides of the other [m].
        half_y: see above.
        c: direction of the other's first side, its cosine.
        s: its sine.
        enough: where the distance is at least this, a bound below it will do [m].
    """
    reach_x, reach_y = abs(c) * half_x + abs(s) * half_y, abs(s) * half_x + abs(c) * half_y
    own_reach_x, own_reach_y = abs(c) * own_x + abs(s) * own_y, abs(s) * own_x + abs(c) * own_y
    u, v = c * x + s * y, c * y - s * x  # minus the own centre in the other's frame
    apart = max(
        max(abs(x) - own_x - reach_x, abs(y) - own_y - reach_y),
        max(abs(u) - half_x - own_reach_x, abs(v) - half_y - own_reach_y),
    )
    if apart <= 0.0 or apart >= enough:
        return apart
    ax, ay, bx, by = c * half_x, s * half_x, -s * half_y, c * half_y
    squared = min(
        min(
            squared_from_rectangle(x - ax - bx, y - ay - by, own_x, own_y),
            squared_from_rectangle(x + ax - bx, y + ay - by, own_x, own_y),
        ),
        min(
            squared_from_rectangle(x + ax + bx, y + ay + by, own_x, own_y),
            squared_from_rectangle(x - ax + bx, y - ay + by, own_x, own_y),
        ),
    )
    ax, ay, bx, by = c * own_x, -s * own_x, s * own_y, c * own_y
    squared_back = min(
        min(
            squared_from_rectangle(u - ax - bx, v - ay - by, half_x, half_y),
            squared_from_rectangle(u + ax - bx, v + ay - by, half_x, half_y),
        ),
        min(
            squared_from_rectangle(u + ax + bx, v + ay + by, half_x, half_y),
            squared_from_rectangle(u - ax + bx, v - ay + by, half_x, half_y),
        ),
    )
    return math.sqrt(min(squared, squared_back))


@kernel(inline="always")
def squared_from_edge(height: float, along: float, length: float) -> float:
    """Squared distance of a point from an edge, by its height above the line and its place along it [m^2]."""
    beyond = max(max(-along, along - length), 0.0)
    return height * height + beyond * beyond


@inner_kernel
def polygon_rectangle(
    corners: Records,
    first: int,
    count: int,
    center: tuple[float, float],
    half: tuple[float, float],
    direction: tuple[float, float],
) -> float:
    """Distance of a convex polygon from a rectangle [m].

    Args:
        corners: records of type :data:`cbrrt_ompl.collision.pieces.CORNER`.
        first: row of the polygon's first corner.
        count: how many it has.
        center: centre of the rectangle in the polygon's frame [m].
        half: half sides of the rectangle [m].
        direction: of its first side in the polygon's frame, cosine and sine.
    """
    x, y = center
    half_x, half_y = half
    c, s = direction
    ax, ay, bx, by = c * half_x, s * half_x, -s * half_y, c * half_y
    x0, y0, x1, y1 = x - ax - bx, y - ay - by, x + ax - bx, y + ay - by
    x2, y2, x3, y3 = x + ax + bx, y + ay + by, x - ax + bx, y - ay + by
    outside, squared = -INFINITY, INFINITY
    low_u = low_v = INFINITY
    high_u = high_v = -INFINITY
    for k in range(first, first + count):
        corner = corners[k]
        px, py, tx, ty, length = corner.x, corner.y, corner.along_x, corner.along_y, corner.length
        h0, a0 = (x0 - px) * ty - (y0 - py) * tx, (x0 - px) * tx + (y0 - py) * ty
        h1, a1 = (x1 - px) * ty - (y1 - py) * tx, (x1 - px) * tx + (y1 - py) * ty
        h2, a2 = (x2 - px) * ty - (y2 - py) * tx, (x2 - px) * tx + (y2 - py) * ty
        h3, a3 = (x3 - px) * ty - (y3 - py) * tx, (x3 - px) * tx + (y3 - py) * ty
        outside = max(outside, min(min(h0, h1), min(h2, h3)))
        near = min(squared_from_edge(h0, a0, length), squared_from_edge(h1, a1, length))
        far = min(squared_from_edge(h2, a2, length), squared_from_edge(h3, a3, length))
        u, v = (px - x) * c + (py - y) * s, (py - y) * c - (px - x) * s
        low_u, high_u, low_v, high_v = min(low_u, u), max(high_u, u), min(low_v, v), max(high_v, v)
        squared = min(squared, min(min(near, far), squared_from_rectangle(u, v, half_x, half_y)))
    outside = max(outside, max(max(low_u - half_x, -high_u - half_x), max(low_v - half_y, -high_v - half_y)))
    return math.sqrt(squared) if outside > 0.0 else outside


@inner_kernel
def polygon_polygon(corners: Records, part: Record, other: Record, x: float, y: float, c: float, s: float) -> float:
    """Distance of a convex polygon at a pose from one in the world [m].

    Args:
        corners: records of type :data:`cbrrt_ompl.collision.pieces.CORNER`, of both.
        part: the polygon in its own frame, a record of type :data:`cbrrt_ompl.collision.pieces.PIECE`.
        other: the polygon in the world.
        x: where the first one's frame stands in the world [m].
        y: see above.
        c: cosine of the frame's angle.
        s: its sine.
    """
    outside, squared = -INFINITY, INFINITY
    for k in range(part.first, part.first + part.count):
        edge = corners[k]
        lowest = INFINITY
        for j in range(other.first, other.first + other.count):
            wx, wy = corners[j].x - x, corners[j].y - y
            dx, dy = c * wx + s * wy - edge.x, c * wy - s * wx - edge.y
            height, along = dx * edge.along_y - dy * edge.along_x, dx * edge.along_x + dy * edge.along_y
            lowest = min(lowest, height)
            squared = min(squared, squared_from_edge(height, along, edge.length))
        outside = max(outside, lowest)
    for j in range(other.first, other.first + other.count):
        edge = corners[j]
        lowest = INFINITY
        for k in range(part.first, part.first + part.count):
            px, py = corners[k].x, corners[k].y
            dx, dy = c * px - s * py - (edge.x - x), s * px + c * py - (edge.y - y)
            height, along = dx * edge.along_y - dy * edge.along_x, dx * edge.along_x + dy * edge.along_y
            lowest = min(lowest, height)
            squared = min(squared, squared_from_edge(height, along, edge.length))
        outside = max(outside, lowest)
    return math.sqrt(squared) if outside > 0.0 else outside


@inner_kernel(forceinline=True)
def part_piece(corners: Records, part: Record, piece: Record, x: float, y: float, c: float, s: float) -> float:
    """Distance of a footprint's convex part at a pose from a piece of the world [m].

    Args:
        corners: records of type :data:`cbrrt_ompl.collision.pieces.CORNER`, of both.
        part: a polygon in the footprint's frame, a record of type :data:`cbrrt_ompl.collision.pieces.PIECE`.
        piece: the piece of the world.
        x: where the footprint's frame stands [m].
        y: see above.
        c: cosine of its heading.
        s: its sine.
    """
    if piece.kind != RECTANGLE and piece.kind != DISC:
        return polygon_polygon(corners, part, piece, x, y, c, s)
    dx, dy = piece.x - x, piece.y - y
    u, v = c * dx + s * dy, c * dy - s * dx
    if piece.kind == DISC:
        return point_polygon(u, v, corners, part.first, part.count) - piece.half_x
    direction = (c * piece.cos + s * piece.sin, c * piece.sin - s * piece.cos)
    return polygon_rectangle(corners, part.first, part.count, (u, v), (piece.half_x, piece.half_y), direction)
