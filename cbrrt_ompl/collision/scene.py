"""A world as one footprint sees it: convex pieces, and the index of those that can be nearest."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from cbrrt_ompl.collision.index import build_index, side_of
from cbrrt_ompl.collision.pieces import Pieces, footprint_pieces, join
from cbrrt_ompl.motion.records import Records, as_records, record_array
from cbrrt_ompl.problem.obstacles import Bounds
from cbrrt_ompl.problem.robot import Footprint

FRAME = np.dtype(
    [
        ("x_min", np.float64),  # bounds of the world [m]
        ("y_min", np.float64),
        ("x_max", np.float64),
        ("y_max", np.float64),
        ("roots", np.int64),  # root cells along each side of the square over the bounds
        ("roots_per_metre", np.float64),
        ("center_x", np.float64),  # centre of the footprint in the robot's frame [m]
        ("center_y", np.float64),
        ("center_distance", np.float64),  # of that centre from the robot's origin [m]
        ("reach", np.float64),  # how far a turn moves the footprint, a radian at most [m]; 0 for a round one
        ("outer", np.float64),  # radius about the centre of a disc that holds the footprint [m]
        ("inner", np.float64),  # radius about the centre of a disc inside the footprint [m]
        ("half_x", np.float64),  # half sides of a footprint that is a rectangle, else 0 [m]
        ("half_y", np.float64),
        ("parts", np.int64),  # convex parts of the footprint, the first of the pieces; 0 for a round one
    ],
    align=True,
)
"""Bounds of a world, and the footprint."""


class Scene(NamedTuple):
    """All that the kernels know of a world and a footprint; nobody writes to it, so that threads share it."""

    frame: Records
    """One record of type `FRAME`, shape (1,)."""
    cells: Records
    """Quadtrees over the bounds, the roots in rows: see :data:`cbrrt_ompl.collision.index.CELL`, shape (n,)."""
    lists: NDArray[np.int32]
    """Rows of the pieces that each leaf needs, one leaf after the other, shape (l,)."""
    pieces: Records
    """Parts of the footprint, then the pieces of the world; shape (m,)."""
    corners: Records
    """What the polygons among the pieces refer to, shape (k,)."""


def make_scene(bounds: Bounds, world: Pieces, footprint: Footprint) -> Scene:
    """The scene of a footprint in a world.

    Args:
        bounds: the walls.
        world: the pieces of its obstacles.
        footprint: the robot's area.
    """
    frame = record_array(1, FRAME)
    f = frame[0]
    (f["x_min"], f["y_min"]), (f["x_max"], f["y_max"]) = bounds.min, bounds.max
    center = footprint_center(footprint)
    f["center_x"], f["center_y"], f["center_distance"] = *center, math.hypot(*center)
    f["outer"], f["inner"] = footprint_radii(footprint, center)
    f["half_x"], f["half_y"] = half_sides(footprint, center)
    f["reach"] = 0.0 if footprint.is_round else footprint.circumscribed_radius
    own = footprint_pieces(footprint, center)
    f["parts"] = len(own.pieces)
    together = join((own, world))
    cells, lists, roots = build_index(together, f)
    f["roots"], f["roots_per_metre"] = roots, roots / side_of(f)
    return Scene(frame, cells, lists, as_records(together.pieces), as_records(together.corners))


def footprint_center(footprint: Footprint) -> tuple[float, float]:
    """A point inside the footprint from which it reaches as far to all sides, if there is one [m]."""
    if footprint.vertices is None:
        return 0.0, 0.0
    shape = shapely.Polygon(footprint.vertices)
    low, high = footprint.vertices.min(axis=0), footprint.vertices.max(axis=0)
    middle = shapely.Point(0.5 * (low + high))
    if not shape.contains(middle):
        middle = shapely.Point(shapely.maximum_inscribed_circle(shape).coords[0])
    return middle.x, middle.y


def footprint_radii(footprint: Footprint, center: tuple[float, float]) -> tuple[float, float]:
    """Radii about a centre inside a footprint: of a disc that holds it, and of one that it holds [m]."""
    if footprint.vertices is None:
        return footprint.radius, footprint.radius
    outer = float(np.hypot(*(footprint.vertices - center).T).max())
    return outer, float(shapely.distance(shapely.Polygon(footprint.vertices).exterior, shapely.Point(center)))


def half_sides(footprint: Footprint, center: tuple[float, float]) -> tuple[float, float]:
    """Half sides of a footprint that is a rectangle along the robot's axes, else (0, 0) [m]."""
    if footprint.vertices is None or len(footprint.vertices) != 4:
        return 0.0, 0.0
    distances = np.abs(footprint.vertices - center)  # (4, 2)
    half_x, half_y = distances[0].tolist()
    return (half_x, half_y) if np.ptp(distances, axis=0).max() <= 1e-14 * half_x else (0.0, 0.0)
