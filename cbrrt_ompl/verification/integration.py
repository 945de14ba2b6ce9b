"""The motion computed again, by an integrator of SciPy's."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.verification.motion import is_checkable

RELATIVE_ERROR, ABSOLUTE_ERROR = 1e-10, 1e-12
"""What SciPy's integrator keeps its error below, relative and absolute [m, rad].

It is the root mean square over all steps: each one by itself may be off by sqrt(3 n) times as much.
"""


def integrate_again(trajectory: Trajectory, velocities: NDArray[np.float64]) -> NDArray[np.float64]:
    """States at the rows of the motion that follows from its first pose and the velocities.

    Within a step the velocities are linear in time, so that the right-hand side is smooth. All steps are integrated at
    once, each in the frame of its own beginning, and then put end to end.

    Args:
        trajectory: start and times.
        velocities: see :func:`velocities_again`; steps that are not checkable are left out.

    Returns:
        Rows of (x, y, theta, v, omega), the heading not wrapped, shape (n, 5).
    """
    steps = np.diff(trajectory.t)
    count = len(steps)
    checkable = is_checkable(velocities, steps)
    steps, (v0, v1, w0, w1) = np.where(checkable, steps, 0.0), np.where(checkable, velocities, 0.0)

    def rates(share: float, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        heading = pose[2 * count :]
        way = steps * (v0 + (v1 - v0) * share)
        return np.concatenate([way * np.cos(heading), way * np.sin(heading), steps * (w0 + (w1 - w0) * share)])

    begin = np.zeros(3 * count)
    found = solve_ivp(rates, (0.0, 1.0), begin, "DOP853", (1.0,), rtol=RELATIVE_ERROR, atol=ABSOLUTE_ERROR)
    dx, dy, turn = found.y.reshape(3, count)
    theta = trajectory.theta[0] + np.concatenate([[0.0], np.cumsum(turn)])
    c, s = np.cos(theta[:-1]), np.sin(theta[:-1])
    x = trajectory.x[0] + np.concatenate([[0.0], np.cumsum(c * dx - s * dy)])
    y = trajectory.y[0] + np.concatenate([[0.0], np.cumsum(s * dx + c * dy)])
    v, omega = (
        np.concatenate([[trajectory.v[0]], velocities[1]]),
        np.concatenate([[trajectory.omega[0]], velocities[3]]),
    )
    return np.column_stack([x, y, theta, v, omega])
