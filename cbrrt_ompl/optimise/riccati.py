"""Newton steps of the barrier problem: a linear-quadratic problem, solved by the Riccati recursion.

    minimise    sum_k  w_k' H_k w_k / 2 + q_k' w_k
    subject to  z_{k+1} = J_k w_k + c_k,   z_0 = 0 but for h

over the steps w_k = (z_k, u_k). With the cost-to-go z' P z / 2 + p' z of the stage after,

    Q = H + J' P J + shift I,   q = q_k + J' (p + P c),
    u = K z + d,   K = -Quu^-1 Quz,   d = -Quu^-1 qu,
    P <- Qzz + Qzu K,   p <- qz + Qzu d.

The step goes downhill only where every Quu (and the P of the free h at the start) is positive definite; where one is
not, the caller tries again with a larger shift (inertia correction).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.kernels import inner_kernel
from cbrrt_ompl.motion.records import Record, Records
from cbrrt_ompl.optimise.program import COLUMNS, CONTROLS, STATES, STEP

LEAST_CURVATURE = 1e-12
"""Pivots up to this are not positive."""


@inner_kernel
def factorise(stages: Records, shift: float) -> bool:
    """Run the recursion backwards.

    Args:
        stages: their Hessians, gradients, Jacobians and defects are read; gains, offsets and costs-to-go are written.
        shift: what is added to every diagonal element.

    Returns:
        Whether the problem is convex, so that the step is a minimum.
    """
    last = stages[len(stages) - 1]
    for i in range(STATES):
        last.to_go_slope[i] = last.gradient[i]
        for j in range(i + 1):
            last.to_go[i, j] = last.to_go[j, i] = last.hessian[i, j]
        last.to_go[i, i] += shift
    big_q, q = np.empty((COLUMNS, COLUMNS)), np.empty(COLUMNS)
    product, moved = np.empty((STATES, COLUMNS)), np.empty(STATES)
    for k in range(len(stages) - 2, -1, -1):
        pull_back(stages[k], stages[k + 1], shift, product, moved, big_q, q)
        if not eliminate_control(stages[k], big_q, q):
            return False
    return stages[0].to_go[STEP, STEP] > LEAST_CURVATURE


@inner_kernel
def pull_back(
    stage: Record,
    after: Record,
    shift: float,
    product: NDArray[np.float64],
    moved: NDArray[np.float64],
    big_q: NDArray[np.float64],
    q: NDArray[np.float64],
) -> None:
    """Write Q (lower triangle) and q of a stage, and P J and p + P c on the way."""
    to_go, jacobian, hessian = after.to_go, stage.jacobian, stage.hessian
    for i in range(STATES):
        total = after.to_go_slope[i]
        for m in range(STATES):
            total += to_go[i, m] * stage.defect[m]
        moved[i] = total
        for j in range(COLUMNS):
            total = 0.0
            for m in range(STATES):
                total += to_go[i, m] * jacobian[m, j]
            product[i, j] = total
    for i in range(COLUMNS):
        total = stage.gradient[i]
        for m in range(STATES):
            total += jacobian[m, i] * moved[m]
        q[i] = total
        for j in range(i + 1):
            total = hessian[i, j]
            for m in range(STATES):
                total += jacobian[m, i] * product[m, j]
            big_q[i, j] = total
        big_q[i, i] += shift


@inner_kernel
def eliminate_control(stage: Record, big_q: NDArray[np.float64], q: NDArray[np.float64]) -> bool:
    """Write K, d and the cost-to-go P, p of a stage; False where Quu is not positive definite."""
    a, b, c = big_q[STATES, STATES], big_q[STATES + 1, STATES], big_q[STATES + 1, STATES + 1]
    determinant = a * c - b * b
    if not (a > LEAST_CURVATURE and determinant > 1e-14 * a * abs(c)):
        return False
    gain, offset, to_go = stage.gain, stage.offset, stage.to_go
    offset[0] = (b * q[STATES + 1] - c * q[STATES]) / determinant
    offset[1] = (b * q[STATES] - a * q[STATES + 1]) / determinant
    for j in range(STATES):
        gain[0, j] = (b * big_q[STATES + 1, j] - c * big_q[STATES, j]) / determinant
        gain[1, j] = (b * big_q[STATES, j] - a * big_q[STATES + 1, j]) / determinant
    for i in range(STATES):
        stage.to_go_slope[i] = q[i] + big_q[STATES, i] * offset[0] + big_q[STATES + 1, i] * offset[1]
        for j in range(i + 1):
            value = big_q[i, j] + big_q[STATES, i] * gain[0, j] + big_q[STATES + 1, i] * gain[1, j]
            to_go[i, j] = to_go[j, i] = value
    return True


@inner_kernel
def roll_out_step(stages: Records) -> None:
    """Write the Newton steps of states and controls, forwards from the best change of h."""
    first = stages[0]
    for i in range(STATES):
        first.state_step[i] = 0.0
    first.state_step[STEP] = -first.to_go_slope[STEP] / first.to_go[STEP, STEP]
    for k in range(len(stages) - 1):
        stage, after = stages[k], stages[k + 1]
        for i in range(CONTROLS):
            total = stage.offset[i]
            for j in range(STATES):
                total += stage.gain[i, j] * stage.state_step[j]
            stage.control_step[i] = total
        for i in range(STATES):
            total = stage.defect[i]
            for j in range(STATES):
                total += stage.jacobian[i, j] * stage.state_step[j]
            for j in range(CONTROLS):
                total += stage.jacobian[i, STATES + j] * stage.control_step[j]
            after.state_step[i] = total
