"""State validity: FCL's answer, by certificate where the clearance map holds one."""

from __future__ import annotations

from typing import Any

from cbrrt_ompl.collision.clearance_map import ClearanceMap
from cbrrt_ompl.ompl_plugin.binding import ob
from cbrrt_ompl.ompl_plugin.reals import StateReals
from cbrrt_ompl.ompl_plugin.space import STATE_DIMENSION


class FclStateValidityChecker(ob.StateValidityChecker):  # type: ignore[misc]  # OMPL has no type information
    """A state is valid where the footprint touches neither an obstacle nor a wall.

    Attributes:
        checked: states judged so far.
    """

    def __init__(self, si: Any, space: Any, clearance_map: ClearanceMap) -> None:
        """Make the buffer.

        Args:
            si: the space information that will own this checker.
            space: its state space.
            clearance_map: decides the states.
        """
        super().__init__(si)
        self.checked = 0
        self._reals = StateReals(space, STATE_DIMENSION)
        self._map = clearance_map

    def isValid(self, state: Any) -> bool:  # noqa: N802  # OMPL's name
        """Whether the footprint is free at a state."""
        self.checked += 1
        self._reals.read(state)
        x, y, theta, _, _ = self._reals.values.tolist()
        return not self._map.collides(x, y, theta)

    def clearance(self, state: Any) -> float:
        """Distance of the footprint from the nearest obstacle or wall [m]."""
        self._reals.read(state)
        x, y, theta, _, _ = self._reals.values.tolist()
        return self._map.checker.clearance(x, y, theta)
