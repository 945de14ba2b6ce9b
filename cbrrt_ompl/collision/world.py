"""Where the robot may be: bounds and obstacles as FCL solids.

The plane is the plane z = 0 of FCL's space. A disc becomes a sphere, a box a tall box, an oriented box or a polygon its
flat triangles, each centred on that plane, so that every answer in the plane is FCL's answer in space. FCL answers in
closed form where one shape is a sphere, and else by GJK, to well below the micrometre of `CONTACT_TOLERANCE`. (Tall
boxes and flat triangles on purpose: FCL 0.7 overestimates the distance of a triangle from a box that is low for its
distance by centimetres, and between `fcl.Convex` and `fcl.BVHModel` by decimetres. No box is turned, for FCL would look
for it in a cube as wide as it is tall.)
"""

from __future__ import annotations

import math
import threading
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import Any

import fcl
import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from cbrrt_ompl.collision.occupancy import (
    FREE_THRESHOLD,
    OCCUPIED_THRESHOLD,
    blocked_cells,
    cells_from,
    grid_bounds,
    grid_obstacles,
)
from cbrrt_ompl.errors import MISSING, Problem, WorldError
from cbrrt_ompl.problem.obstacles import (
    MAX_COORDINATE,
    Bounds,
    Box,
    Disc,
    Obstacle,
    OrientedBox,
    Polygon,
    polygons_from_shapely,
)
from cbrrt_ompl.problem.robot import Footprint

__all__ = [
    "CONTACT_TOLERANCE",
    "MAX_COORDINATE",
    "MITRE_LIMIT",
    "Bounds",
    "Box",
    "CollisionChecker",
    "Disc",
    "Obstacle",
    "OrientedBox",
    "Polygon",
    "World",
]

CONTACT_TOLERANCE = 1e-6
"""Every footprint is grown by this much, so that touching counts as collision whatever the rounding [m]."""

_ZERO_DISTANCE = 1e-12
"""Distances up to this are contact: where shapes overlap, FCL returns 0, -1 or a denormal number [m]."""

MAX_CONTACTS = 64
"""Solids around a point whose depths are compared; of more, the depth below some is told."""

MITRE_LIMIT = 5.0
"""Corners of a grown footprint reach out by at most this many tolerances."""


class World:
    """Bounds and obstacles, ready for collision queries from any thread.

    Attributes:
        bounds: the walls around everything.
        obstacles: the solids inside, in the order given; they may overlap.
    """

    def __init__(self, bounds: Bounds, obstacles: Iterable[Obstacle] = ()) -> None:
        """Build the FCL solids and their broad-phase tree.

        Args:
            bounds: the walls.
            obstacles: boxes, discs and polygons, any number.

        Raises:
            WorldError: if these are no bounds or no obstacles.
        """
        if not isinstance(bounds, Bounds):
            raise WorldError(Problem("bounds", bounds, "a value of type Bounds"))
        self.bounds = bounds
        try:
            self.obstacles: tuple[Obstacle, ...] = tuple(obstacles)
        except TypeError:
            raise WorldError(Problem("obstacles", obstacles, "a list of obstacles")) from None
        for i, obstacle in enumerate(self.obstacles):
            if not isinstance(obstacle, Obstacle):
                raise WorldError(Problem(f"obstacles[{i}]", obstacle, "a Box, OrientedBox, Disc or Polygon"))
        height = 4.0 * (max(bounds.size) + max(map(_extent, self.obstacles), default=0.0))
        different = dict.fromkeys(self.obstacles)
        straight = [o for o in different if not isinstance(o, OrientedBox)]
        turned = [o.vertices[[0, 1, 2, 0, 2, 3]] for o in different if isinstance(o, OrientedBox)]
        solids = [_solid(o, height) for o in (*bounds.walls(), *straight)]
        if turned:  # all in one mesh, which is made much faster than many
            solids.append(fcl.CollisionObject(_flat_triangles(np.concatenate(turned))))
        self._solids = _manager(solids)
        self._checkers = _Checkers()

    @classmethod
    def from_grid(
        cls,
        grid: ArrayLike,
        resolution: float,
        origin: Sequence[float] = (0.0, 0.0, 0.0),
        *,
        unknown: str = "occupied",
        occupied_thresh: float = OCCUPIED_THRESHOLD,
        free_thresh: float = FREE_THRESHOLD,
    ) -> World:
        """World of an occupancy grid; its first row is the lowest, as in a ROS OccupancyGrid.

        An image has its first row at the top: flip it with ``grid[::-1]``. The cell in row r and column c covers
        x from c to c + 1 and y from r to r + 1 times the resolution, in the frame of the origin.

        Args:
            grid: shape (rows, columns): whether a cell is occupied as bool, 0 or 1; or how likely it is, from 0 to 1,
                NaN where nobody knows; or the whole numbers of ROS: -1 unknown, else 0 to 100 percent.
            resolution: side of a cell [m].
            origin: pose (x, y, yaw) of the lower left corner of the grid, [m, m, rad]; where the grid is rotated, the
                world is the rectangle around it, blocked outside of the grid.
            unknown: whether cells that are neither occupied nor free are ``occupied`` or ``free``.
            occupied_thresh: cells more likely than this are occupied.
            free_thresh: cells less likely than this are free.

        Returns:
            The world, with the blocked cells merged into boxes.

        Raises:
            MapError: if these are no such values, or no cell is free.
        """
        blocked = blocked_cells(cells_from(grid, occupied_thresh, free_thresh), unknown)
        obstacles = grid_obstacles(blocked, resolution, origin)
        return cls(grid_bounds(blocked.shape, resolution, origin), obstacles)

    @classmethod
    def from_shapely(cls, geometry: object, bounds: Bounds | None = None) -> World:
        """World whose obstacles are the area of a shapely geometry.

        Args:
            geometry: a polygon, a multipolygon or a collection of such, or several in a list; in metres.
            bounds: the walls; the rectangle around the geometry if not given.

        Raises:
            WorldError: if a part of the geometry has no area, or it is empty and there are no bounds either.
        """
        obstacles = polygons_from_shapely(geometry)
        if bounds is None:
            if not obstacles:
                raise WorldError(Problem("bounds", MISSING, "bounds, where the geometry is empty"))
            corners = np.concatenate([o.vertices for o in obstacles])  # (n, 2)
            (x0, y0), (x1, y1) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
            bounds = Bounds((x0, y0), (x1, y1))
        return cls(bounds, obstacles)

    def collides(self, footprint: Footprint, pose: ArrayLike) -> bool:
        """Whether a footprint at a pose touches an obstacle or a wall: FCL's answer.

        Args:
            footprint: the robot's area.
            pose: (x, y, theta), [m, m, rad].

        Returns:
            True where it touches, and wherever the robot's origin is not strictly inside the bounds.
        """
        x, y, theta = (float(value) for value in np.asarray(pose, dtype=float)[:3])
        return self.checker(footprint).collides(x, y, theta)

    def clearance(self, footprint: Footprint, pose: ArrayLike) -> float:
        """Distance of a footprint from the nearest obstacle or wall: FCL's answer.

        Args:
            footprint: the robot's area.
            pose: (x, y, theta), [m, m, rad].

        Returns:
            The distance [m]; 0 where they touch or overlap.
        """
        x, y, theta = (float(value) for value in np.asarray(pose, dtype=float)[:3])
        return self.checker(footprint).clearance(x, y, theta)

    def signed_clearance(self, x: float, y: float) -> float:
        """Distance of a point from the nearest solid, or minus a depth below its surface: FCL's answers.

        Inside overlapping solids the depth is that below one of them, so a lower bound: every point nearer than that
        is in collision as well.

        Args:
            x: position [m].
            y: position [m].

        Returns:
            Signed distance [m]; never less certain than a rounding error.
        """
        return self.checker(Footprint.point()).signed_clearance(x, y)

    def checker(self, footprint: Footprint) -> CollisionChecker:
        """The checker for one footprint, made once a thread and kept."""
        checkers = self._checkers.by_footprint
        if footprint not in checkers:
            checkers[footprint] = CollisionChecker(self, footprint)
        return checkers[footprint]

    def __reduce__(self) -> tuple[type[World], tuple[Bounds, tuple[Obstacle, ...]]]:
        """What is pickled: FCL's objects are made again from bounds and obstacles."""
        return World, (self.bounds, self.obstacles)

    @cached_property
    def _polygons(self) -> _Polygons:
        return _Polygons([o for o in dict.fromkeys(self.obstacles) if isinstance(o, Polygon | OrientedBox)])


class _Checkers(threading.local):
    """The checkers of a thread: each moves FCL objects of its own."""

    def __init__(self) -> None:
        self.by_footprint: dict[Footprint, CollisionChecker] = {}


class CollisionChecker:
    """Asks FCL about one footprint in one world; its FCL objects are moved, so each thread needs its own.

    Attributes:
        queries: how often FCL was asked.
    """

    def __init__(self, world: World, footprint: Footprint) -> None:
        """Make the FCL objects of the footprint."""
        self.queries = 0
        self._bounds = world.bounds
        self._solids = world._solids
        self._polygons = world._polygons
        self._grown = fcl.CollisionObject(_footprint_geometry(footprint, CONTACT_TOLERANCE))
        self._exact = fcl.CollisionObject(_footprint_geometry(footprint, 0.0))
        self._translation = np.zeros(3)
        self._rotation = np.eye(3)
        self._is_round = footprint.is_round

    def _move(self, footprint: Any, x: float, y: float, theta: float) -> None:
        """Place an FCL object of the footprint at a pose in the plane z = 0."""
        self._translation[0], self._translation[1] = x, y
        if not self._is_round:
            c, s = math.cos(theta), math.sin(theta)
            r = self._rotation
            r[0, 0], r[0, 1], r[1, 0], r[1, 1] = c, -s, s, c
            footprint.setRotation(r)
        footprint.setTranslation(self._translation)  # both together take half the time of setTransform

    def _is_pose(self, x: float, y: float, theta: float) -> bool:
        """Whether the position is inside the bounds, and the heading a number where it matters."""
        return self._bounds.contains(x, y) and (self._is_round or math.isfinite(theta))

    def collides(self, x: float, y: float, theta: float) -> bool:
        """Whether the footprint touches a solid at this pose [m, m, rad]."""
        if not self._is_pose(x, y, theta):
            return True
        self.queries += 1
        self._move(self._grown, x, y, theta)
        data = fcl.CollisionData()
        self._solids.collide(self._grown, data, fcl.defaultCollisionCallback)
        return bool(data.result.is_collision)

    def _distance(self) -> float:
        """FCL's distance of the exact footprint, as it stands, from the nearest solid [m]."""
        data = fcl.DistanceData()
        self._solids.distance(self._exact, data, fcl.defaultDistanceCallback)
        return float(data.result.min_distance)

    def _room(self, x: float, y: float) -> float:
        """Distance of the robot's origin from the bounds, which it must not leave even where no footprint is [m]."""
        (x_min, y_min), (x_max, y_max) = self._bounds.min, self._bounds.max
        return min(x - x_min, x_max - x, y - y_min, y_max - y)

    def clearance(self, x: float, y: float, theta: float) -> float:
        """Distance to the nearest solid [m] at this pose [m, m, rad]; 0 where it touches or is out of bounds."""
        if self.collides(x, y, theta):
            return 0.0
        self.queries += 1
        self._move(self._exact, x, y, theta)
        return min(max(self._distance(), 0.0), self._room(x, y))

    def margin(self, x: float, y: float, theta: float) -> float:
        """How far the footprint may move from this pose [m, m, rad] before it touches anything.

        Returns:
            Its clearance less what the footprint was grown by [m]; 0 exactly where :meth:`collides` is true.
        """
        if not self._is_pose(x, y, theta):
            return 0.0
        self.queries += 1
        self._move(self._exact, x, y, theta)
        margin = min(self._distance() - MITRE_LIMIT * CONTACT_TOLERANCE, self._room(x, y))
        if margin > CONTACT_TOLERANCE:  # else within the rounding of two different queries
            return margin
        return 0.0 if self.collides(x, y, theta) else _ZERO_DISTANCE

    def signed_clearance(self, x: float, y: float) -> float:
        """Signed distance of the robot's origin [m]; see :meth:`World.signed_clearance`."""
        self.queries += 1
        point = self._exact
        self._move(point, x, y, 0.0)
        distance = self._distance()
        if distance > _ZERO_DISTANCE:
            return distance
        contacts = fcl.CollisionData(request=fcl.CollisionRequest(num_max_contacts=MAX_CONTACTS, enable_contact=True))
        self._solids.collide(point, contacts, fcl.defaultCollisionCallback)
        touched = contacts.result.contacts
        depth = max((c.penetration_depth for c in touched if not isinstance(c.o1, fcl.BVHModel)), default=0.0)
        for boundary in self._polygons.boundaries_around(x, y):
            depth = max(depth, fcl.distance(point, boundary))
        return -float(depth)


class _Polygons:
    """The polygons of a world, found by a point inside."""

    def __init__(self, polygons: Sequence[Polygon | OrientedBox]) -> None:
        self._polygons = polygons
        self._tree = shapely.STRtree([polygon.to_shapely() for polygon in polygons])
        self._boundaries: dict[int, Any] = {}

    def boundaries_around(self, x: float, y: float) -> list[Any]:
        """FCL objects of the borders of polygons that a point is inside of: all, or some where there are many."""
        if not self._polygons:
            return []
        indices = self._tree.query(shapely.Point(x, y), predicate="within")[:MAX_CONTACTS].tolist()
        for i in indices:
            if i not in self._boundaries:
                self._boundaries[i] = _boundary(self._polygons[i])
        return [self._boundaries[i] for i in indices]


def _manager(objects: list[Any]) -> Any:
    """A broad-phase tree over FCL objects."""
    manager = fcl.DynamicAABBTreeCollisionManager()
    manager.tree_init_level = 1  # by Morton codes; the default splits tall boxes by height, where nothing is apart
    manager.registerObjects(objects)
    manager.setup()
    return manager


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


def _boundary(polygon: Polygon | OrientedBox) -> Any:
    """FCL object of a polygon's border alone: an upright wall of no thickness along every edge."""
    height = _extent(polygon)
    faces = []
    for ring in (polygon.vertices, *polygon.holes):
        ends = np.roll(ring, -1, axis=0)
        low_a, low_b, high_a, high_b = (
            np.column_stack([corners, np.full(len(ring), z)]) for z in (-height, height) for corners in (ring, ends)
        )
        faces.append(np.stack([low_a, low_b, high_b, low_a, high_b, high_a], axis=1).reshape(-1, 3))  # (6 n, 3)
    return fcl.CollisionObject(_mesh(np.concatenate(faces)))


def _mesh(corners: NDArray[np.float64]) -> Any:
    """FCL mesh of triangles given by their corners, shape (3 m, 3)."""
    mesh = fcl.BVHModel()
    mesh.beginModel(len(corners), len(corners) // 3)
    mesh.addSubModel(corners, np.arange(len(corners)).reshape(-1, 3))
    mesh.endModel()
    return mesh


def _flat_mesh(polygon: shapely.Polygon) -> Any:
    """FCL mesh of a polygon's triangles in the plane z = 0."""
    rings = shapely.get_coordinates(shapely.constrained_delaunay_triangles(polygon)).reshape(-1, 4, 2)  # closed
    return _flat_triangles(rings[:, :3].reshape(-1, 2))


def _flat_triangles(corners: NDArray[np.float64]) -> Any:
    """FCL mesh of triangles in the plane z = 0 given by their corners, shape (3 m, 2)."""
    return _mesh(np.column_stack([corners, np.zeros(len(corners))]))


def _footprint_geometry(footprint: Footprint, growth: float) -> Any:
    """FCL geometry of a footprint in the robot's frame, grown by some metres."""
    if footprint.vertices is None:
        return fcl.Sphere(footprint.radius + growth)
    polygon = shapely.Polygon(footprint.vertices)
    return _flat_mesh(polygon.buffer(growth, join_style="mitre", mitre_limit=MITRE_LIMIT) if growth > 0.0 else polygon)
