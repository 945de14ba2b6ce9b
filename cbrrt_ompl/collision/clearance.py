"""Exact clearance of a posed footprint, compiled."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.collision.distances import part_piece, point_piece, rectangle_rectangle
from cbrrt_ompl.collision.pieces import RECTANGLE
from cbrrt_ompl.collision.scene import Scene
from cbrrt_ompl.kernels import inner_kernel, kernel
from cbrrt_ompl.motion.kinematics import sine_cosine
from cbrrt_ompl.motion.records import Record, Records

OUTSIDE = -1.0
"""In place of a clearance where the robot's origin is not strictly inside the bounds [m]."""

ENOUGH = 0.1
"""Clearance from which on a bound below it does for a motion: it proves the next decimetre [m]."""


@kernel(inline="always")
def wall_distance(frame: Record, x: float, y: float) -> float:
    """Distance of a point from the bounds [m]; `OUTSIDE` outside, and for NaN."""
    if not (frame.x_min < x < frame.x_max and frame.y_min < y < frame.y_max):  # NaN is not, and min() may ignore it
        return OUTSIDE
    return min(min(x - frame.x_min, frame.x_max - x), min(y - frame.y_min, frame.y_max - y))


@kernel(inline="always")
def leaf_at(scene: Scene, x: float, y: float) -> int:
    """Row of the leaf that holds a position inside the bounds."""
    frame, cells = scene.frame[0], scene.cells
    last = frame.roots - 1
    column = min(int((x - frame.x_min) * frame.roots_per_metre), last)
    row = min(int((y - frame.y_min) * frame.roots_per_metre), last)
    cell = row * frame.roots + column
    child = cells[cell].child
    while child > 0:
        cell = child + (1 if x >= cells[cell].x else 0) + (2 if y >= cells[cell].y else 0)
        child = cells[cell].child
    return cell


@kernel(forceinline=True)
def clearance(scene: Scene, x: float, y: float, theta: float, enough: float) -> tuple[float, bool]:
    """Distance of the footprint at a pose from the nearest obstacle or wall.

    Args:
        scene: world and footprint.
        x: position of the robot's origin [m].
        y: see above.
        theta: heading [rad].
        enough: where the distance is at least this, a bound below it will do [m]; infinite for the distance itself.

    Returns:
        The distance, negative where they overlap, of which only the sign means anything then, and no greater than that
        of the robot's origin from the bounds [m]; and whether it is a bound that holds in every heading about the
        footprint's centre.
    """
    if scene.frame[0].parts == 0:
        return _clearance_of_disc(scene, x, y, enough), True
    return _clearance_of_polygon(scene, x, y, theta, enough)


@inner_kernel(forceinline=True)
def _clearance_of_disc(scene: Scene, x: float, y: float, enough: float) -> float:
    """:func:`clearance` of a round footprint."""
    frame = scene.frame[0]
    walls = wall_distance(frame, x, y)
    if not walls > 0.0:
        return OUTSIDE
    found = walls - frame.outer
    if found <= 0.0:
        return found
    cell = scene.cells[leaf_at(scene, x, y)]
    dx, dy = x - cell.x, y - cell.y
    bound = cell.clearance - frame.outer - math.sqrt(dx * dx + dy * dy)
    if bound >= enough:
        return min(bound, found)
    for i in range(cell.first, cell.first + cell.count):
        found = min(found, point_piece(x, y, scene.pieces[scene.lists[i]], scene.corners) - frame.outer)
    return found


@inner_kernel(forceinline=True)
def _clearance_of_polygon(scene: Scene, x: float, y: float, theta: float, enough: float) -> tuple[float, bool]:
    """:func:`clearance` of a footprint with corners."""
    frame, lists, pieces, corners = scene.frame[0], scene.lists, scene.pieces, scene.corners
    found = wall_distance(frame, x, y)
    if not found > 0.0:
        return OUTSIDE, False
    s, c = sine_cosine(theta)
    x, y = x + (c * frame.center_x - s * frame.center_y), y + (s * frame.center_x + c * frame.center_y)
    walls = wall_distance(frame, x, y)
    if not walls >= frame.inner:  # NaN is not
        return OUTSIDE, False
    cell = scene.cells[leaf_at(scene, x, y)]
    dx, dy = x - cell.x, y - cell.y
    bound = min(cell.clearance - math.sqrt(dx * dx + dy * dy), walls) - frame.outer
    if bound >= enough:
        return min(bound, found), True
    bound = walls
    for i in range(cell.first, cell.first + cell.count):
        bound = min(bound, point_piece(x, y, pieces[lists[i]], corners))
    if bound < frame.inner:
        return bound - frame.inner, False
    if bound - frame.outer >= enough:
        return min(bound - frame.outer, found), True
    if walls - frame.outer < found:
        found = min(found, _distance_from_walls(scene, x, y, c, s))
        if found <= 0.0:
            return found, False
    for i in range(cell.first, cell.first + cell.count):
        piece = pieces[lists[i]]
        if point_piece(x, y, piece, corners) - frame.outer >= found:
            continue
        if frame.half_x > 0.0 and piece.kind == RECTANGLE:
            dx, dy = piece.x - x, piece.y - y
            distance = rectangle_rectangle(
                frame.half_x,
                frame.half_y,
                c * dx + s * dy,
                c * dy - s * dx,
                piece.half_x,
                piece.half_y,
                c * piece.cos + s * piece.sin,
                c * piece.sin - s * piece.cos,
                found,
            )
            found = min(found, distance)
        else:
            for part in range(frame.parts):
                found = min(found, part_piece(corners, pieces[part], piece, x, y, c, s))
        if found <= 0.0:
            return found, False
    return found, False


@inner_kernel
def _distance_from_walls(scene: Scene, x: float, y: float, c: float, s: float) -> float:
    """Distance of the footprint from the bounds, by its corners, its centre at (x, y) [m]."""
    frame, corners = scene.frame[0], scene.corners
    last = scene.pieces[frame.parts - 1]
    found = math.inf
    for k in range(last.first + last.count):  # those of the footprint come first
        u, v = corners[k].x, corners[k].y
        found = min(found, wall_distance(frame, x + (c * u - s * v), y + (s * u + c * v)))
    return found


@kernel
def clearance_at(
    frame: Records,
    cells: Records,
    lists: NDArray[np.int32],
    pieces: Records,
    corners: Records,
    x: float,
    y: float,
    theta: float,
) -> float:
    """The exact :func:`clearance` for a caller in Python, to whom arrays cost less than a named tuple."""
    return clearance(Scene(frame, cells, lists, pieces, corners), x, y, theta, math.inf)[0]


@kernel
def clearances_at(scene: Scene, poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """The exact :func:`clearance` at poses (x, y, theta), shape (n, 3) to (n,) [m]."""
    found = np.empty(len(poses))
    for i in range(len(poses)):
        found[i] = clearance(scene, poses[i, 0], poses[i, 1], poses[i, 2], math.inf)[0]
    return found
