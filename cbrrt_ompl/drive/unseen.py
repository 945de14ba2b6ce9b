"""The space around the robot that no look has shown yet."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from cbrrt_ompl.collision.motion_check import is_free
from cbrrt_ompl.collision.pieces import join, obstacle_pieces, ring_pieces
from cbrrt_ompl.collision.scene import make_scene
from cbrrt_ompl.drive.sight import View
from cbrrt_ompl.problem.obstacles import Bounds, Obstacle
from cbrrt_ompl.problem.robot import Footprint

GRID = 1e-4
"""Spacing of the positions that corners of the unseen space are rounded to [m]: less than the room of a motion."""

SLIVER = 1e-6
"""Area of unseen space that is too small to keep [m^2]."""

MOST_CORNERS = 2_000
"""Corners of the unseen space, beyond which it is made coarser: looks from nearly one place would add more and more."""

COARSENESS = 0.002
"""By how much the unseen space grows then, twice this at most [m]."""

SLACK = 0.05
"""What is farther than this from a footprint all along a motion is not in its way [m]."""


class UnseenSpace:
    """What has been hidden at all looks so far, within a square about the place of the last one.

    A point is seen if nothing stands between it and the sensor: obstacles are unseen space themselves. What leaves the
    square is forgotten: it counts as not seen when it comes back.

    Attributes:
        region: the unseen space in the square, without what is beyond the bounds.
    """

    def __init__(self, bounds: Bounds, reach: float) -> None:
        """Begin with nothing seen.

        Args:
            bounds: the walls.
            reach: half the side of the square [m].
        """
        self._bounds, self._reach = bounds, reach
        self._inside = shapely.box(*bounds.min, *bounds.max)
        self._square: shapely.Geometry = shapely.Polygon()
        self.region: shapely.Geometry = shapely.Polygon()

    def look(self, x: float, y: float, view: View) -> None:
        """Look around: what was hidden before, or is new in the square, remains unseen where it is hidden now.

        Args:
            x: position of the sensor [m].
            y: position of the sensor [m].
            view: what is seen from there, as far as half the side of the square at least.
        """
        reach = self._reach
        square = shapely.intersection(shapely.box(x - reach, y - reach, x + reach, y + reach), self._inside)
        still, new = shapely.intersection(self.region, square), shapely.difference(square, self._square)
        seen = shapely.make_valid(shapely.Polygon(view.outline(x, y, 1.5 * reach)))
        region = _areas(shapely.difference(shapely.union(_areas(still), _areas(new)), _areas(seen)))
        self.region = (
            region if shapely.get_num_coordinates(region) <= MOST_CORNERS else _areas(_coarser(region, square))
        )
        self._square = square

    def is_entered(
        self, motion: NDArray[np.float64], dt: float, footprint: Footprint, hidden: Sequence[Obstacle] = ()
    ) -> bool:
        """Whether a motion comes into unseen space, at one of the points that planners look at, or nearly touches it.

        Args:
            motion: rows of (x, y, theta, v, omega), within the square, shape (n, 5).
            dt: time between two rows [s].
            footprint: the robot's area.
            hidden: obstacles that no look has shown: wherever they are, space is unseen.
        """
        way = shapely.LineString(motion[:, :2]) if len(motion) > 1 else shapely.Point(motion[0, :2])
        around = shapely.buffer(way, footprint.circumscribed_radius + SLACK)
        near = _areas(shapely.intersection(self.region, around, grid_size=GRID))
        triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(near))
        if len(triangles) == 0 and not hidden:
            return False
        rings = [shapely.get_coordinates(ring)[:3] for ring in shapely.orient_polygons(triangles)]
        pieces = join((ring_pieces(rings), obstacle_pieces(hidden)))
        return not is_free(motion, dt, make_scene(self._bounds, pieces, footprint))


def _coarser(region: shapely.Geometry, square: shapely.Geometry) -> shapely.Geometry:
    """A region with fewer corners that holds all of another one, within a square; the square alone if that fails."""
    wider = shapely.buffer(region, COARSENESS, join_style="mitre")
    coarser = shapely.intersection(shapely.simplify(wider, COARSENESS), square)
    return coarser if shapely.get_num_coordinates(coarser) <= MOST_CORNERS else square


def _areas(geometry: shapely.Geometry) -> shapely.MultiPolygon:
    """The polygons in a geometry, without lines, points and slivers."""
    parts = shapely.get_parts(shapely.get_parts(geometry))  # a collection may hold multipolygons
    return shapely.multipolygons(parts[shapely.area(parts) > SLIVER])
