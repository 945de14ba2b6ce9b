"""What the robot knows of the world, and how it learns more."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.drive.sight import Sight
from cbrrt_ompl.drive.unseen import SLACK, UnseenSpace
from cbrrt_ompl.problem.obstacles import Obstacle, bounding_box, distance_from_box, signed_distance
from cbrrt_ompl.problem.robot import Footprint


class Knowledge:
    """The part of a world that has been seen.

    An obstacle is seen, all of it, as soon as a point of it is within the sensor's range; with a line of sight, as soon
    as such a point is not hidden by others.

    Attributes:
        world: the bounds and the obstacles known so far; replaced when more are seen.
        hidden: the obstacles not seen yet.
    """

    def __init__(self, world: World, hidden: Sequence[Obstacle], reach: float | None = None) -> None:
        """Start with what is known beforehand.

        Args:
            world: bounds and known obstacles.
            hidden: obstacles to be found.
            reach: distance from the sensor up to which the unseen space is kept, if there is a line of sight [m].
        """
        self.world = world
        self.hidden = list(hidden)
        boxes = [bounding_box(obstacle) for obstacle in hidden]
        self._boxes: NDArray[np.float64] = np.array(boxes, dtype=np.float64).reshape(-1, 4)
        rows = np.arange(len(hidden), dtype=np.intp)
        self._rows: NDArray[np.intp] = len(world.obstacles) + rows  # of the hidden ones among all
        self._sight = None if reach is None else Sight([*world.obstacles, *hidden])
        self._unseen = None if reach is None else UnseenSpace(world.bounds, reach)

    def look(self, x: float, y: float, sensor_range: float) -> list[Obstacle]:
        """See what is within range, and learn it.

        Args:
            x: position of the sensor [m].
            y: position of the sensor [m].
            sensor_range: how far it sees [m].

        Returns:
            The obstacles seen for the first time.
        """
        if self._sight is not None and self._unseen is not None:
            view = self._sight.look(x, y, sensor_range)
            self._unseen.look(x, y, view)
            is_seen = view.is_seen[self._rows]
        else:
            is_seen = distance_from_box(self._boxes.T, x, y) <= sensor_range
            for i in np.flatnonzero(is_seen):
                is_seen[i] = signed_distance(self.hidden[i], np.array([x]), np.array([y]))[0] <= sensor_range
        seen = list(compress(self.hidden, is_seen))
        if seen:
            self.hidden = list(compress(self.hidden, ~is_seen))
            self._boxes, self._rows = self._boxes[~is_seen], self._rows[~is_seen]
            self.world = self.world.with_more(seen)
        return seen

    def is_seen(self, motion: NDArray[np.float64], dt: float, footprint: Footprint) -> bool:
        """Whether a motion, no farther from the place of the last look than its reach, stays in space that was seen.

        Args:
            motion: rows of (x, y, theta, v, omega), shape (n, 5).
            dt: time between two rows [s].
            footprint: the robot's area.

        Returns:
            True where obstacles hide nothing: then all that is near has been seen.
        """
        if self._unseen is None:
            return True
        (x0, y0), (x1, y1) = motion[:, :2].min(axis=0), motion[:, :2].max(axis=0)
        size = footprint.circumscribed_radius + SLACK
        left, bottom, right, top = self._boxes.T
        is_near = (left < x1 + size) & (right > x0 - size) & (bottom < y1 + size) & (top > y0 - size)
        return not self._unseen.is_entered(motion, dt, footprint, list(compress(self.hidden, is_near)))
