"""The inequalities g(w) >= 0 of a stage: limits, clearance and the goal region, with their derivatives.

They come in three kinds, see :mod:`cbrrt_ompl.optimise.program`: on the pose (discs, the goal's place and heading), on
the velocities (limits, rest in the goal), and on the control (limits, the least h).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.kernels import inner_kernel
from cbrrt_ompl.motion.records import Record, Records
from cbrrt_ompl.optimise.field import distance_and_gradient, distance_at
from cbrrt_ompl.optimise.program import (
    CONTROL_ROWS,
    OMEGA,
    POSE_ROWS,
    STEP,
    THETA,
    VELOCITY_ROWS,
    V,
    X,
    Y,
)


def lay_out_rows(problem: Record, stages: Records) -> None:
    """Count the inequalities of every stage, and write the derivatives of those that are linear: they never change.

    The start is given, so that only its control is restricted.
    """
    discs, velocities = int(problem["disc_count"]), int(problem["velocity_limit_count"])
    controls, counts, slopes = int(problem["control_limit_count"]), stages["counts"], stages["slopes"]
    headings = 0 if problem["heading_tolerance"] == math.inf else 2
    rests = 0 if problem["speed_tolerance"] == math.inf else 4
    counts[:, POSE_ROWS], counts[:, VELOCITY_ROWS], counts[:, CONTROL_ROWS] = discs, velocities, controls
    counts[0] = 0, 0, controls + 1
    counts[-1] = discs + 1 + headings, velocities + rests, 0
    stages["row_count"] = counts.sum(axis=1)
    velocity_rows, control_rows = (problem[f"{name}_limits"][:, 1:] for name in ("velocity", "control"))
    slopes[1:-1, discs : discs + velocities, :2] = velocity_rows[:velocities]
    slopes[1:-1, discs + velocities : discs + velocities + controls, 1:] = control_rows[:controls]
    slopes[0, :controls, 1:], slopes[0, controls, 0] = control_rows[:controls], 1.0
    slopes[-1, discs + 1 : discs + 1 + headings, THETA] = (-1.0, 1.0)[:headings]
    first = discs + 1 + headings
    slopes[-1, first : first + velocities, :2] = velocity_rows[:velocities]
    first += velocities
    slopes[-1, first : first + rests, :2] = ((-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0))[:rests] or np.empty(
        (0, 2)
    )


@inner_kernel
def evaluate_rows(
    problem: Record,
    distances: NDArray[np.float32],
    stage: Record,
    is_first: bool,
    is_last: bool,
    state: NDArray[np.float64],
    control: NDArray[np.float64],
    values: NDArray[np.float64],
) -> None:
    """Write the values of the inequalities of a stage at some state and control, in the order of their kinds."""
    row = 0
    if not is_first:
        cosine, sine, margin = math.cos(state[THETA]), math.sin(state[THETA]), stage.margin
        for i in range(problem.disc_count):
            x = state[X] + cosine * problem.discs[i, 0] - sine * problem.discs[i, 1]
            y = state[Y] + sine * problem.discs[i, 0] + cosine * problem.discs[i, 1]
            values[row] = distance_at(problem.grid, distances, x, y) - problem.discs[i, 2] - margin
            row += 1
        if is_last:
            row = evaluate_goal_pose(problem, state, values, row)
        limits = problem.velocity_limits
        for i in range(problem.velocity_limit_count):
            values[row] = stage.speed_cap * limits[i, 0] + limits[i, 1] * state[V] + limits[i, 2] * state[OMEGA]
            row += 1
        if is_last and problem.speed_tolerance < math.inf:
            most = problem.speed_tolerance
            values[row], values[row + 1] = most - state[V], most + state[V]
            values[row + 2], values[row + 3] = most - state[OMEGA], most + state[OMEGA]
            row += 4
    if not is_last:
        limits = problem.control_limits
        for i in range(problem.control_limit_count):
            values[row] = limits[i, 0] + limits[i, 1] * control[0] + limits[i, 2] * control[1]
            row += 1
    if is_first:
        values[row] = state[STEP] - problem.shortest_step


@inner_kernel
def evaluate_goal_pose(problem: Record, state: NDArray[np.float64], values: NDArray[np.float64], row: int) -> int:
    """Write the conditions on the place and the heading to arrive in, from a row on; returns the row after."""
    dx, dy = state[X] - problem.goal_x, state[Y] - problem.goal_y
    values[row] = 0.5 * (problem.goal_tolerance - (dx * dx + dy * dy) / problem.goal_tolerance)
    if problem.heading_tolerance == math.inf:
        return row + 1
    values[row + 1] = problem.heading_tolerance - (state[THETA] - problem.goal_theta)
    values[row + 2] = problem.heading_tolerance + (state[THETA] - problem.goal_theta)
    return row + 3


@inner_kernel
def add_row_derivatives(
    problem: Record, distances: NDArray[np.float32], stage: Record, is_first: bool, is_last: bool
) -> None:
    """Write the derivatives of the inequalities of a stage that are not linear.

    Minus the multipliers times the second derivatives are added to the Hessian, as far as the discs' turn about the
    robot's origin and the goal's circle make them; the field's own curvature is left out.
    """
    if is_first:
        return
    state, slopes, hessian = stage.state, stage.slopes, stage.hessian
    cosine, sine = math.cos(state[THETA]), math.sin(state[THETA])
    for i in range(problem.disc_count):
        rx = cosine * problem.discs[i, 0] - sine * problem.discs[i, 1]
        ry = sine * problem.discs[i, 0] + cosine * problem.discs[i, 1]
        _, by_x, by_y = distance_and_gradient(problem.grid, distances, state[X] + rx, state[Y] + ry)
        slopes[i, 0], slopes[i, 1], slopes[i, 2] = by_x, by_y, by_y * rx - by_x * ry
        hessian[THETA, THETA] += stage.multipliers[i] * (by_x * rx + by_y * ry)
    if is_last:
        row = problem.disc_count
        slopes[row, 0] = (problem.goal_x - state[X]) / problem.goal_tolerance
        slopes[row, 1] = (problem.goal_y - state[Y]) / problem.goal_tolerance
        hessian[X, X] += stage.multipliers[row] / problem.goal_tolerance
        hessian[Y, Y] += stage.multipliers[row] / problem.goal_tolerance
