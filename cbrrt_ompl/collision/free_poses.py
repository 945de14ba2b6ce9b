"""Free poses near one that is not: where a robot could start instead, or arrive within its goal region."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.problem.robot import Footprint

REACH = 3.0
"""How far a free pose is looked for [m]."""

_RINGS = 60
"""Distances at which poses are looked at."""

Pose = tuple[float, float, float]


def nearest_free_pose(
    world: World,
    footprint: Footprint,
    pose: Sequence[float],
    reach: float = REACH,
    turns: Sequence[float] = (0.0,),
    room: float = 1e-3,
) -> Pose | None:
    """About the nearest pose at which a footprint has room, looked for on rings about a pose.

    Args:
        world: bounds and obstacles.
        footprint: the robot's area.
        pose: (x, y, theta) [m, m, rad].
        reach: radius of the last ring [m].
        turns: headings that will do, as differences from the pose's own, the best first [rad].
        room: clearance that it is to have [m].

    Returns:
        The pose; None if none was found.
    """
    x, y, theta = (float(value) for value in pose)
    for dx, dy in _places(reach):
        if not world.bounds.contains(x + dx, y + dy):
            continue
        for turn in turns:
            found = (x + dx, y + dy, theta + turn)
            if world.clearance(footprint, found) > room:
                return found
    return None


def _places(reach: float) -> Iterator[tuple[float, float]]:
    """Differences in position, nearer ones first [m]."""
    yield 0.0, 0.0
    spacing = reach / _RINGS
    for ring in range(1, _RINGS + 1):
        for angle in np.linspace(0.0, math.tau, 6 * ring, endpoint=False).tolist():
            yield ring * spacing * math.cos(angle), ring * spacing * math.sin(angle)
