"""What the robot knows of the world, and how it learns more."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.problem.obstacles import Obstacle, bounding_box, distance_from_box, signed_distance


class Knowledge:
    """The part of a world that has been seen.

    An obstacle is seen, all of it, as soon as a point of it is within the sensor's range; others do not hide it.

    Attributes:
        world: the bounds and the obstacles known so far; replaced when more are seen.
        hidden: the obstacles not seen yet.
    """

    def __init__(self, world: World, hidden: Sequence[Obstacle]) -> None:
        """Start with what is known beforehand.

        Args:
            world: bounds and known obstacles.
            hidden: obstacles to be found.
        """
        self.world = world
        self.hidden = list(hidden)
        boxes = [bounding_box(obstacle) for obstacle in hidden]
        self._boxes: NDArray[np.float64] = np.array(boxes, dtype=np.float64).reshape(-1, 4)

    def look(self, x: float, y: float, sensor_range: float) -> list[Obstacle]:
        """See what is within range, and learn it.

        Args:
            x: position of the sensor [m].
            y: position of the sensor [m].
            sensor_range: how far it sees [m].

        Returns:
            The obstacles seen for the first time.
        """
        here = np.array([x]), np.array([y])
        is_seen = distance_from_box(self._boxes.T, x, y) <= sensor_range
        for i in np.flatnonzero(is_seen):
            is_seen[i] = signed_distance(self.hidden[i], *here)[0] <= sensor_range
        seen = list(compress(self.hidden, is_seen))
        if seen:
            self.hidden = list(compress(self.hidden, ~is_seen))
            self._boxes = self._boxes[~is_seen]
            self.world = self.world.with_more(seen)
        return seen
