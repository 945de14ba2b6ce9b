"""FCL, the referee: whether a footprint touches anything, decided in space.

The plane is the plane z = 0 of FCL's space. A disc becomes a sphere, a box a tall box, an oriented box or a polygon its
flat triangles, each centred on that plane, so that every answer in the plane is FCL's answer in space. FCL answers in
closed form where one shape is a sphere, and else by GJK, to well below the micrometre of `CONTACT_TOLERANCE`. (Tall
boxes and flat triangles on purpose: FCL 0.7 mistakes the distance of a triangle from a box that is low for its distance
by centimetres. No box is turned, for FCL would look for it in a cube as wide as it is tall. Distances are not asked of
FCL: its GJK overestimates one in some 10^5 of them, by up to centimetres.)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import fcl
import numpy as np
import shapely
from numpy.typing import NDArray

from cbrrt_ompl.problem.obstacles import Bounds, Box, Disc, Obstacle, OrientedBox, Polygon
from cbrrt_ompl.problem.robot import Footprint

CONTACT_TOLERANCE = 1e-6
"""Every footprint is grown by this much, so that touching counts as collision whatever the rounding [m]."""

MITRE_LIMIT = 5.0
"""Corners of a grown footprint reach out by at most this many tolerances."""


def make_solids(bounds: Bounds, obstacles: Sequence[Obstacle]) -> Any:
    """FCL's broad-phase tree over the walls and the obstacles."""
    height = 4.0 * (max(bounds.size) + max(map(_extent, obstacles), default=0.0))
    different = dict.fromkeys(obstacles)
    straight = [o for o in different if not isinstance(o, OrientedBox)]
    turned = [o.vertices[[0, 1, 2, 0, 2, 3]] for o in different if isinstance(o, OrientedBox)]
    solids = [_solid(o, height) for o in (*bounds.walls(), *straight)]
    if turned:  # all in one mesh, which is made much faster than many
        solids.append(fcl.CollisionObject(_flat_triangles(np.concatenate(turned))))
    manager = fcl.DynamicAABBTreeCollisionManager()
    manager.tree_init_level = 1  # by Morton codes; the default splits tall boxes by height, where nothing is apart
    manager.registerObjects(solids)
    manager.setup()
    return manager


class FclReferee:
    """Asks FCL about one footprint in one world; its FCL object is moved, so each thread needs its own."""

    def __init__(self, bounds: Bounds, solids: Any, footprint: Footprint) -> None:
        """Make the FCL object of the footprint.

        Args:
            bounds: the walls.
            solids: what :func:`make_solids` made of them and the obstacles.
            footprint: the robot's area.
        """
        self._bounds = bounds
        self._solids = solids
        self._grown = fcl.CollisionObject(_footprint_geometry(footprint, CONTACT_TOLERANCE))
        self._translation = np.zeros(3)
        self._rotation = np.eye(3)
        self._is_round = footprint.is_round

    def collides(self, x: float, y: float, theta: float) -> bool:
        """Whether the footprint touches a solid at this pose [m, m, rad]; true wherever the origin is out of bounds."""
        if not (self._bounds.contains(x, y) and (self._is_round or math.isfinite(theta))):
            return True
        self._translation[0], self._translation[1] = x, y
        if not self._is_round:
            c, s = math.cos(theta), math.sin(theta)
            r = self._rotation
            r[0, 0], r[0, 1], r[1, 0], r[1, 1] = c, -s, s, c
            self._grown.setRotation(r)
        self._grown.setTranslation(self._translation)  # both together take half the time of setTransform
        data = fcl.CollisionData()
        self._solids.collide(self._grown, data, fcl.defaultCollisionCallback)
        return bool(data.result.is_collision)


def _extent(obstacle: Obstacle) -> float:
    """About the longest side of an obstacle [m]."""
    if isinstance(obstacle, Box):
        return max(obstacle.max[0] - obstacle.min[0], obstacle.max[1] - obstacle.min[1])
    if isinstance(obstacle, OrientedBox):
        return max(obstacle.size)
    if isinstance(obstacle, Disc):
        return 2.0 * obstacle.radius
    return float(np.ptp(obstacle.vertices, axis=0).max())


def _solid(obstacle: Box | Disc | Polygon, height: float) -> Any:
    """FCL object of an obstacle."""
    if isinstance(obstacle, Box):
        (x0, y0), (x1, y1) = obstacle.min, obstacle.max
        place = fcl.Transform(np.array([0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.0]))
        return fcl.CollisionObject(fcl.Box(x1 - x0, y1 - y0, height), place)
    if isinstance(obstacle, Disc):
        place = fcl.Transform(np.array([*obstacle.center, 0.0]))
        return fcl.CollisionObject(fcl.Sphere(obstacle.radius), place)
    return fcl.CollisionObject(_flat_mesh(obstacle.to_shapely()))


def _flat_mesh(polygon: shapely.Polygon) -> Any:
    """FCL mesh of a polygon's triangles in the plane z = 0."""
    rings = shapely.get_coordinates(shapely.constrained_delaunay_triangles(polygon)).reshape(-1, 4, 2)  # closed
    return _flat_triangles(rings[:, :3].reshape(-1, 2))


def _flat_triangles(corners: NDArray[np.float64]) -> Any:
    """FCL mesh of triangles in the plane z = 0 given by their corners, shape (3 m, 2)."""
    mesh = fcl.BVHModel()
    mesh.beginModel(len(corners), len(corners) // 3)
    mesh.addSubModel(np.column_stack([corners, np.zeros(len(corners))]), np.arange(len(corners)).reshape(-1, 3))
    mesh.endModel()
    return mesh


def _footprint_geometry(footprint: Footprint, growth: float) -> Any:
    """FCL geometry of a footprint in the robot's frame, grown by some metres."""
    if footprint.vertices is None:
        return fcl.Sphere(footprint.radius + growth)
    polygon = shapely.Polygon(footprint.vertices)
    return _flat_mesh(polygon.buffer(growth, join_style="mitre", mitre_limit=MITRE_LIMIT))
