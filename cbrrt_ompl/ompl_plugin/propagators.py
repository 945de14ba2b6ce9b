"""State propagators: one integration step a call, by the kernels that the samplers use."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.kernels import kernel
from cbrrt_ompl.motion.laws import is_compiled_law, raise_errors
from cbrrt_ompl.motion.model import CLOSED_LOOP, OPEN_LOOP, STEERING, advance, make_model
from cbrrt_ompl.motion.records import Records
from cbrrt_ompl.ompl_plugin.binding import oc
from cbrrt_ompl.ompl_plugin.compiled_methods import use_compiled_methods
from cbrrt_ompl.ompl_plugin.native_methods import make_propagator_native
from cbrrt_ompl.ompl_plugin.reals import StateReals
from cbrrt_ompl.ompl_plugin.space import STATE_DIMENSION, check_controls, check_space
from cbrrt_ompl.problem.robot import Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings


class TwoWheelPropagator(oc.StatePropagator):  # type: ignore[misc]  # OMPL has no type information
    """Moves the robot for one step.

    The velocities ramp to the control (v, omega) under the acceleration limits; in a kinematic model they jump to it.
    In closed loop the control is the reference (x_r, y_r, theta_r), and the Kanayama law is evaluated in here, so that
    OMPL can replay what the law did.

    Contract with OMPL: ``state`` is only read, ``result`` is written and may be the same object; validity is not looked
    at. OMPL calls this once an integration step, and steps of any duration are taken.

    Attributes:
        model: one record, see :func:`cbrrt_ompl.motion.model.make_model`.
    """

    def __init__(
        self,
        si: Any,
        robot: Robot,
        planning: PlanningSettings | None = None,
        *,
        kinematic: bool = False,
        goal: Goal | None = None,
        compiled: bool | None = None,
    ) -> None:
        """Drive a robot.

        Args:
            si: the space information that will own this propagator.
            robot: its limits, and the gains of the closed loop.
            planning: whether the loop is closed; None takes the defaults.
            kinematic: whether the velocities jump, as for S-RRT.
            goal: where final approaches lead to; None where there are none.
            compiled: whether OMPL calls compiled code, see :mod:`cbrrt_ompl.ompl_plugin.compiled_methods`.

        Raises:
            SettingsError: if the state space or the control space is laid out otherwise than ours.
        """
        super().__init__(si)
        planning = planning or PlanningSettings()
        law = STEERING if kinematic else CLOSED_LOOP if planning.closed_loop else OPEN_LOOP
        check_space(si.getStateSpace())
        check_controls(si.getControlSpace(), law == CLOSED_LOOP)
        self._robot, self._goal = robot, goal
        self.model = make_model(law, robot, goal or NOWHERE, planning)
        self._reals = StateReals(si.getStateSpace(), STATE_DIMENSION)
        dimension = si.getControlSpace().getDimension()
        self._has_third = dimension == 3
        may_raise = law == CLOSED_LOOP and not is_compiled_law(planning.law)
        if self.drives_by_model and not may_raise and use_compiled_methods(compiled):
            make_propagator_native(self, self.model, dimension)

    def propagate(self, state: Any, control: Any, duration: float, result: Any) -> None:
        """Write the state that ``control`` leads to after ``duration`` [s]."""
        if duration != self.model["dt"][0]:
            self.model["dt"] = duration  # final approaches look one step ahead
        self._reals.read(state)
        third = control[2] if self._has_third else 0.0
        advance_values(self._reals.values, control[0], control[1], third, self.model, duration)
        raise_errors()
        self._reals.write(result)

    @property
    def robot(self) -> Robot:
        """Whose limits and gains are kept."""
        return self._robot

    @property
    def goal(self) -> Goal | None:
        """Where final approaches lead to; None where there are none."""
        return self._goal

    @property
    def drives_by_model(self) -> bool:
        """Whether a step is the model's, and not that of a derived class."""
        return type(self).propagate is _PROPAGATE

    def canPropagateBackward(self) -> bool:  # noqa: N802  # OMPL's name
        """No: the ramps do not run backwards."""
        return False


NOWHERE = Goal(0.0, 0.0)
"""In place of a goal where no motion depends on it."""


_PROPAGATE = TwoWheelPropagator.propagate


def drives_like(propagator: Any, model: Records) -> bool:
    """Whether a space information's propagator is ours and moves the robot as a model does, but for its step."""
    if not (isinstance(propagator, TwoWheelPropagator) and propagator.drives_by_model):
        return False
    own, other = propagator.model[0], model[0]
    return all(own[name].tobytes() == other[name].tobytes() for name in ("law", "limits", "gains")) and (
        own["law"] != CLOSED_LOOP or own["law_address"] == other["law_address"]
    )


@kernel
def advance_values(values: NDArray[np.float64], c0: float, c1: float, c2: float, models: Records, dt: float) -> None:
    """:func:`cbrrt_ompl.motion.model.advance` in place, for a caller in Python; values of shape (5,)."""
    x, y, theta, v, omega = values[0], values[1], values[2], values[3], values[4]
    x, y, theta, v, omega, _, _ = advance(x, y, theta, v, omega, (c0, c1, c2), models[0], dt)
    values[0], values[1], values[2], values[3], values[4] = x, y, theta, v, omega
