"""State validity: exact distances, and FCL's answer within some micrometres of contact."""

from __future__ import annotations

from typing import Any

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.ompl_plugin.binding import ob
from cbrrt_ompl.ompl_plugin.reals import StateReals
from cbrrt_ompl.ompl_plugin.space import STATE_DIMENSION
from cbrrt_ompl.problem.robot import Footprint


class FclStateValidityChecker(ob.StateValidityChecker):  # type: ignore[misc]  # OMPL has no type information
    """A state is valid where the footprint touches neither an obstacle nor a wall.

    Attributes:
        checked: states judged so far.
    """

    def __init__(self, si: Any, space: Any, world: World, footprint: Footprint) -> None:
        """Make the buffer.

        Args:
            si: the space information that will own this checker.
            space: its state space.
            world: bounds and obstacles.
            footprint: the robot's area.
        """
        super().__init__(si)
        self.checked = 0
        self._reals = StateReals(space, STATE_DIMENSION)
        self._world, self._footprint = world, footprint

    def isValid(self, state: Any) -> bool:  # noqa: N802  # OMPL's name
        """Whether the footprint is free at a state."""
        self.checked += 1
        self._reals.read(state)
        return not self._world.collides(self._footprint, self._reals.values)

    def clearance(self, state: Any) -> float:
        """Distance of the footprint from the nearest obstacle or wall [m]."""
        self._reals.read(state)
        return self._world.clearance(self._footprint, self._reals.values)
