"""Exact distances of a footprint from everything, by GEOS: independent of the planners' kernels and of FCL."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray

from cbrrt_ompl.problem.obstacles import Box, Disc

if TYPE_CHECKING:
    from cbrrt_ompl.collision.world import World
    from cbrrt_ompl.problem.robot import Footprint


class Distances:
    """The distances of one footprint in one world.

    Discs are measured by their centres, so that nothing is lost to corners that stand for a circle.
    """

    def __init__(self, world: World, footprint: Footprint) -> None:
        """Index the obstacles.

        Args:
            world: bounds and obstacles.
            footprint: the robot's area.
        """
        self._low, self._high = np.array(world.bounds.min), np.array(world.bounds.max)
        self._vertices, self._radius = footprint.vertices, footprint.radius
        boxes = np.array([(*o.min, *o.max) for o in world.obstacles if isinstance(o, Box)], dtype=float).reshape(-1, 4)
        others = [o.to_shapely() for o in world.obstacles if not isinstance(o, Box | Disc)]
        shapes = [*shapely.box(*boxes.T), *others]
        self._shapes = shapely.STRtree(shapes) if shapes else None
        discs = [o for o in world.obstacles if isinstance(o, Disc)]
        self._centers = shapely.STRtree(shapely.points([disc.center for disc in discs])) if discs else None
        self._radii = np.array([disc.radius for disc in discs])

    def at(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distances at poses.

        Args:
            poses: rows of (x, y, theta), shape (n, 3) [m, m, rad].

        Returns:
            Distance from the nearest obstacle or wall, no greater than that of the robot's origin from the bounds; 0
            where the footprint touches one, 0 or less where it leaves the bounds; shape (n,) [m].
        """
        found = np.full(len(poses), -np.inf)
        is_inside = np.isfinite(poses[:, 2]) & (self._room(poses[:, :2]) > 0.0)
        found[is_inside] = self._inside(poses[is_inside])
        return found

    def _room(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance of points from the bounds, negative outside, shape (..., 2) to (...) [m]."""
        room: NDArray[np.float64] = np.minimum(points - self._low, self._high - points).min(axis=-1)
        return room

    def _inside(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distances at poses whose positions are inside the bounds."""
        origins, theta = poses[:, :2], poses[:, 2]
        if self._vertices is None:
            areas, walls = shapely.points(origins), self._room(origins)
        else:
            c, s = np.cos(theta), np.sin(theta)
            world_from_robot = np.array([[c, -s], [s, c]]).transpose(2, 0, 1)  # (n, 2, 2)
            corners = origins[:, None] + self._vertices @ world_from_robot.transpose(0, 2, 1)  # (n, corners, 2)
            areas, walls = shapely.polygons(corners), np.minimum(self._room(corners).min(axis=1), self._room(origins))
        found = np.minimum(walls, self._from_shapes(areas))
        found = np.minimum(found, self._from_discs(areas)) - self._radius
        return np.where(found > 0.0, np.minimum(found, self._room(origins)), found)

    def _from_shapes(self, areas: NDArray[np.object_]) -> NDArray[np.float64]:
        """Distances from the boxes and polygons, shape (n,) [m]."""
        found = np.full(len(areas), np.inf)
        if self._shapes is not None and len(areas):
            (rows, _), distances = self._shapes.query_nearest(areas, return_distance=True, all_matches=False)
            found[rows] = distances
        return found

    def _from_discs(self, areas: NDArray[np.object_]) -> NDArray[np.float64]:
        """Distances from the discs, 0 or less inside, shape (n,) [m]."""
        found = np.full(len(areas), np.inf)
        if self._centers is None or not len(areas):
            return found
        (rows, nearest), distances = self._centers.query_nearest(areas, return_distance=True, all_matches=False)
        found[rows] = distances - self._radii[nearest]  # that of the nearest centre: of others only larger discs count
        reach = np.maximum(found + self._radii.max(), 0.0) * (1.0 + 1e-12)
        rows, discs = self._centers.query(areas, predicate="dwithin", distance=reach)
        distances = shapely.distance(areas[rows], self._centers.geometries[discs]) - self._radii[discs]
        np.minimum.at(found, rows, distances)
        return found
