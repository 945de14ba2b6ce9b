"""What the robot knows of the world, and how it learns more."""

from __future__ import annotations

import math
from collections.abc import Sequence

import shapely

from cbrrt_ompl.clearance_map import ClearanceMap, clearance_map_for
from cbrrt_ompl.obstacles import Disc, Obstacle
from cbrrt_ompl.robot import Footprint
from cbrrt_ompl.world import World


class Knowledge:
    """The part of a world that has been seen.

    An obstacle is seen, all of it, as soon as a point of it is within the sensor's range; others do not hide it.

    Attributes:
        world: the bounds and the obstacles known so far; replaced when more are seen.
        hidden: the obstacles not seen yet.
    """

    def __init__(self, world: World, hidden: Sequence[Obstacle], footprint: Footprint) -> None:
        """Start with what is known beforehand.

        Args:
            world: bounds and known obstacles.
            hidden: obstacles to be found.
            footprint: the robot's area, for which clearances are kept.
        """
        self.world = world
        self.hidden = list(hidden)
        self._footprint = footprint
        self._shapes = {id(obstacle): obstacle.to_shapely() for obstacle in hidden}

    @property
    def clearance_map(self) -> ClearanceMap:
        """The clearances of the known world."""
        return clearance_map_for(self.world, self._footprint)

    def look(self, x: float, y: float, sensor_range: float) -> list[Obstacle]:
        """See what is within range, and learn it.

        Args:
            x: position of the sensor [m].
            y: position of the sensor [m].
            sensor_range: how far it sees [m].

        Returns:
            The obstacles seen for the first time.
        """
        seen = [o for o in self.hidden if self._distance(o, x, y) <= sensor_range]
        if seen:
            self.hidden = [o for o in self.hidden if o not in seen]
            self.world = World(self.world.bounds, (*self.world.obstacles, *seen))
        return seen

    def _distance(self, obstacle: Obstacle, x: float, y: float) -> float:
        """Distance of a point from an obstacle, 0 inside [m]."""
        if isinstance(obstacle, Disc):
            return max(math.hypot(x - obstacle.center[0], y - obstacle.center[1]) - obstacle.radius, 0.0)
        return float(shapely.distance(self._shapes[id(obstacle)], shapely.Point(x, y)))
