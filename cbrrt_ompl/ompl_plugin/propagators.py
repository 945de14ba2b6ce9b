"""State propagators: one integration step a call, by the kernels that the samplers use."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cbrrt_ompl.motion.model import advance, control_dimension
from cbrrt_ompl.motion.records import Records
from cbrrt_ompl.ompl_plugin.binding import oc
from cbrrt_ompl.ompl_plugin.reals import StateReals
from cbrrt_ompl.ompl_plugin.space import STATE_DIMENSION


class TwoWheelPropagator(oc.StatePropagator):  # type: ignore[misc]  # OMPL has no type information
    """Moves the robot for one step; how is a matter of the model.

    ``OPEN_LOOP``: the velocities ramp to the control (v, omega) under the acceleration limits. ``STEERING``: they jump
    to it. ``CLOSED_LOOP``: the control is the reference (x_r, y_r, theta_r), and the Kanayama law is evaluated in here,
    so that OMPL can replay what the law did.

    Contract with OMPL: ``state`` is only read, ``result`` is written and may be the same object; validity is not looked
    at. OMPL calls this once an integration step.
    """

    def __init__(self, si: Any, space: Any, model: Records) -> None:
        """Make the buffer.

        Args:
            si: the space information that will own this propagator.
            space: its state space.
            model: see :func:`cbrrt_ompl.motion.model.make_model`.
        """
        super().__init__(si)
        self._reals = StateReals(space, STATE_DIMENSION)
        self._model = model
        self._has_third = control_dimension(model) == 3

    def propagate(self, state: Any, control: Any, duration: float, result: Any) -> None:
        """Write the state that ``control`` leads to after ``duration`` [s]."""
        self._reals.read(state)
        third = control[2] if self._has_third else 0.0
        advance_values(self._reals.values, control[0], control[1], third, self._model, duration)
        self._reals.write(result)

    def canPropagateBackward(self) -> bool:  # noqa: N802  # OMPL's name
        """No: the ramps do not run backwards."""
        return False


@njit(cache=True)
def advance_values(values: NDArray[np.float64], c0: float, c1: float, c2: float, models: Records, dt: float) -> None:
    """:func:`cbrrt_ompl.motion.model.advance` in place, for a caller in Python; values of shape (5,)."""
    x, y, theta, v, omega = values[0], values[1], values[2], values[3], values[4]
    x, y, theta, v, omega, _, _ = advance(x, y, theta, v, omega, (c0, c1, c2), models[0], dt)
    values[0], values[1], values[2], values[3], values[4] = x, y, theta, v, omega
