"""State validity: exact distances, and FCL's answer within some micrometres of contact."""

from __future__ import annotations

import math
from typing import Any

from cbrrt_ompl.collision.clearance import clearance_at
from cbrrt_ompl.collision.world import CONTACT_BAND, World
from cbrrt_ompl.motion.records import record_array
from cbrrt_ompl.ompl_plugin.binding import ob
from cbrrt_ompl.ompl_plugin.compiled_methods import use_compiled_methods
from cbrrt_ompl.ompl_plugin.native_methods import CHECKER_RECORD, make_checker_native
from cbrrt_ompl.ompl_plugin.reals import StateReals
from cbrrt_ompl.ompl_plugin.space import STATE_DIMENSION, check_space, is_within_bounds
from cbrrt_ompl.problem.robot import Robot


class FclStateValidityChecker(ob.StateValidityChecker):  # type: ignore[misc]  # OMPL has no type information
    """A state is valid where it is within the bounds of its space and the footprint touches no obstacle and no wall.

    Contract with OMPL: the state is only read. A state with a number that is not finite is invalid.

    Robot and world stay: for others, make another checker.
    """

    def __init__(self, si: Any, robot: Robot, world: World, *, compiled: bool | None = None) -> None:
        """Judge for a robot in a world.

        Args:
            si: the space information that will own this checker, on a space of
                :func:`cbrrt_ompl.ompl_plugin.space.make_state_space`.
            robot: its footprint.
            world: obstacles and walls.
            compiled: whether OMPL calls compiled code, see :mod:`cbrrt_ompl.ompl_plugin.compiled_methods`.
        """
        super().__init__(si)
        check_space(si.getStateSpace())
        self._record = record_array(1, CHECKER_RECORD)
        self._robot, self._world = robot, world
        self._scene = world.scene(robot.footprint)
        self._space = si.getStateSpace()
        self._reals = StateReals(self._space, STATE_DIMENSION)
        if type(self).isValid is _IS_VALID and use_compiled_methods(compiled):
            make_checker_native(self, self._scene, self._space, self._record)

    @property
    def robot(self) -> Robot:
        """Whose footprint is posed."""
        return self._robot

    @property
    def world(self) -> World:
        """Obstacles and walls."""
        return self._world

    @property
    def checked(self) -> int:
        """States judged so far."""
        return int(self._record["checked"][0])

    def isValid(self, state: Any) -> bool:  # noqa: N802  # OMPL's name
        """Whether the state is within the bounds, and the footprint free at it."""
        self._record["checked"] += 1
        self._reals.read(state)
        x, y, theta, v, omega = self._reals.values.tolist()
        if not math.isfinite(x + y + theta + v + omega):
            return False
        return is_within_bounds(self._space, state) and not self._collides(x, y, theta)

    def _collides(self, x: float, y: float, theta: float) -> bool:
        """:meth:`cbrrt_ompl.World.collides` without its checks of the pose, which cost as much as all the rest."""
        found = clearance_at(*self._scene, x, y, theta)
        if abs(found) > CONTACT_BAND:
            return bool(found < 0.0)
        return self.world.referee(self.robot.footprint).collides(x, y, theta)

    def clearance(self, state: Any) -> float:
        """Distance of the footprint from the nearest obstacle or wall [m]."""
        self._reals.read(state)
        return self.world.clearance(self.robot.footprint, self._reals.values)


_IS_VALID = FclStateValidityChecker.isValid


def is_of_ours(checker: Any, robot: Robot, world: World) -> bool:
    """Whether a space information's checker judges by FCL for this robot in this world, and by nothing else."""
    return (
        isinstance(checker, FclStateValidityChecker)
        and type(checker).isValid is _IS_VALID
        and checker.world is world
        and checker.robot.footprint == robot.footprint
    )
