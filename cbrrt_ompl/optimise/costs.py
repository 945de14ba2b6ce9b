"""What an interval costs, with its derivatives.

    l(w) = h (duration + length sqrt(v^2 + e^2) + room r(x, y, theta)) + (s_a a^2 + s_alpha alpha^2) h / 2

where r is the mean over the discs of max(0, 1 - d / room_distance)^2, d being a disc's distance from everything.
(Kinematic: v is the velocity of the interval, and a and alpha are replaced by the jumps from the interval before.)
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.kernels import inner_kernel
from cbrrt_ompl.motion.records import Record
from cbrrt_ompl.optimise.field import distance_and_gradient, distance_at
from cbrrt_ompl.optimise.program import ALPHA, OMEGA, STEP, THETA, A, V, X, Y

SMALL_SPEED = 0.01
"""e above: rounds the corner of |v| at 0 [m/s]."""


@inner_kernel
def stage_cost(
    problem: Record, distances: NDArray[np.float32], state: NDArray[np.float64], control: NDArray[np.float64]
) -> float:
    """The cost l(w) of an interval."""
    a, alpha, v = control[0], control[1], state[V]
    if problem.is_kinematic:
        a, alpha, v = control[0] - state[V], control[1] - state[OMEGA], control[0]
    rate = problem.duration_weight + 0.5 * (problem.smoothness_a * a * a + problem.smoothness_alpha * alpha * alpha)
    if problem.length_weight > 0.0:
        rate += problem.length_weight * math.sqrt(v * v + SMALL_SPEED * SMALL_SPEED)
    if problem.room_weight > 0.0:
        rate += problem.room_weight * tightness(problem, distances, state)
    return state[STEP] * rate


@inner_kernel
def tightness(problem: Record, distances: NDArray[np.float32], state: NDArray[np.float64]) -> float:
    """r(x, y, theta): 0 where everything is farther than ``room_distance``, 1 where all discs touch something."""
    cosine, sine, found = math.cos(state[THETA]), math.sin(state[THETA]), 0.0
    for i in range(problem.disc_count):
        x = state[X] + cosine * problem.discs[i, 0] - sine * problem.discs[i, 1]
        y = state[Y] + sine * problem.discs[i, 0] + cosine * problem.discs[i, 1]
        distance = distance_at(problem.grid, distances, x, y) - problem.discs[i, 2]
        lack = max(0.0, 1.0 - distance / problem.room_distance)
        found += lack * lack
    return found / problem.disc_count


@inner_kernel
def add_cost_derivatives(problem: Record, distances: NDArray[np.float32], stage: Record) -> float:
    """Write the gradient of l and add its Hessian, with that of r in the manner of Gauss and Newton.

    Returns:
        The cost.
    """
    state, control, gradient, hessian = stage.state, stage.control, stage.cost_gradient, stage.hessian
    h, s_a, s_alpha = state[STEP], problem.smoothness_a, problem.smoothness_alpha
    a, alpha, rate = control[0], control[1], problem.duration_weight
    for j in range(len(gradient)):
        gradient[j] = 0.0
    if problem.is_kinematic:
        a, alpha = a - state[V], alpha - state[OMEGA]
        gradient[V], gradient[OMEGA] = -h * s_a * a, -h * s_alpha * alpha
        hessian[V, V] += h * s_a
        hessian[OMEGA, OMEGA] += h * s_alpha
        hessian[A, V] -= h * s_a
        hessian[ALPHA, OMEGA] -= h * s_alpha
        hessian[STEP, V] -= s_a * a
        hessian[STEP, OMEGA] -= s_alpha * alpha
    rate += 0.5 * (s_a * a * a + s_alpha * alpha * alpha)
    gradient[A], gradient[ALPHA] = h * s_a * a, h * s_alpha * alpha
    hessian[A, A] += h * s_a
    hessian[ALPHA, ALPHA] += h * s_alpha
    hessian[A, STEP] += s_a * a
    hessian[ALPHA, STEP] += s_alpha * alpha
    if problem.length_weight > 0.0:
        rate += add_length_derivatives(problem, stage)
    if problem.room_weight > 0.0:
        rate += add_room_derivatives(problem, distances, stage)
    gradient[STEP] = rate
    return h * rate


@inner_kernel
def add_length_derivatives(problem: Record, stage: Record) -> float:
    """Add the derivatives of the path length but for that by h, which is returned."""
    column = A if problem.is_kinematic else V
    v = stage.control[0] if problem.is_kinematic else stage.state[V]
    h, weight, speed = stage.state[STEP], problem.length_weight, math.sqrt(v * v + SMALL_SPEED * SMALL_SPEED)
    stage.cost_gradient[column] += h * weight * v / speed
    stage.hessian[column, column] += h * weight * SMALL_SPEED * SMALL_SPEED / (speed * speed * speed)
    stage.hessian[max(column, STEP), min(column, STEP)] += weight * v / speed
    return weight * speed


@inner_kernel
def add_room_derivatives(problem: Record, distances: NDArray[np.float32], stage: Record) -> float:
    """Add the derivatives of the room's cost but for that by h, which is returned."""
    state, hessian, h, found = stage.state, stage.hessian, stage.state[STEP], 0.0
    cosine, sine = math.cos(state[THETA]), math.sin(state[THETA])
    factor = 2.0 * problem.room_weight / (problem.disc_count * problem.room_distance)
    for k in range(problem.disc_count):
        rx = cosine * problem.discs[k, 0] - sine * problem.discs[k, 1]
        ry = sine * problem.discs[k, 0] + cosine * problem.discs[k, 1]
        distance, by_x, by_y = distance_and_gradient(problem.grid, distances, state[X] + rx, state[Y] + ry)
        lack = 1.0 - (distance - problem.discs[k, 2]) / problem.room_distance
        if lack <= 0.0:
            continue
        found += lack * lack
        slope = (by_x, by_y, by_y * rx - by_x * ry)
        for i in range(3):
            stage.cost_gradient[i] -= h * factor * lack * slope[i]
            hessian[STEP, i] -= factor * lack * slope[i]
            for j in range(i + 1):
                hessian[i, j] += h * factor / problem.room_distance * slope[i] * slope[j]
    return problem.room_weight * found / problem.disc_count
