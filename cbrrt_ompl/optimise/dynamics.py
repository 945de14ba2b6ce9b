"""The motion over one interval of the optimal control problem, with its first and second derivatives.

With the accelerations constant, v and omega are linear in time and the heading quadratic,

    s(t) = v + a t,    phi(t) = theta + omega t + alpha t^2 / 2,

and the position moves by the integral of s (cos phi, sin phi) over [0, h], taken by Gauss's rule of two points: its
error is of the fifth order in h. (Kinematic: s = a and phi = theta + alpha t, the control being the velocity.)
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.kernels import inner_kernel
from cbrrt_ompl.optimise.program import ALPHA, COLUMNS, OMEGA, STATES, STEP, THETA, A, V, X, Y

GAUSS_NODES = (0.5 - math.sqrt(3.0) / 6.0, 0.5 + math.sqrt(3.0) / 6.0)
"""Of the rule on [0, 1]; both weights are one half."""


class GaussPoint(NamedTuple):
    """Speed s and heading phi at a time c h of the interval, and their derivatives that are not 0 or known."""

    speed: float
    heading: float
    speed_by_v: float
    speed_by_step: float
    speed_by_a: float
    heading_by_omega: float
    heading_by_step: float
    heading_by_alpha: float
    speed_by_a_step: float
    heading_by_step_step: float
    heading_by_omega_step: float
    heading_by_alpha_step: float


@inner_kernel
def gauss_point(
    is_kinematic: bool, state: NDArray[np.float64], control: NDArray[np.float64], node: float
) -> GaussPoint:
    """Speed and heading at a fraction of the interval."""
    h, a, alpha = state[STEP], control[0], control[1]
    t = node * h
    if is_kinematic:
        heading = state[THETA] + alpha * t
        return GaussPoint(a, heading, 0.0, 0.0, 1.0, 0.0, node * alpha, t, 0.0, 0.0, 0.0, node)
    turned = state[OMEGA] + alpha * t
    heading = state[THETA] + state[OMEGA] * t + 0.5 * alpha * t * t
    return GaussPoint(
        state[V] + a * t,
        heading,
        1.0,
        node * a,
        t,
        t,
        node * turned,
        0.5 * t * t,
        node,
        node * node * alpha,
        node,
        node * t,
    )


@inner_kernel
def interval_end(
    is_kinematic: bool, state: NDArray[np.float64], control: NDArray[np.float64], step_ratio: float
) -> tuple[float, float, float, float, float, float]:
    """The state f(w) at the end of an interval, with the duration of the next one."""
    h, a, alpha = state[STEP], control[0], control[1]
    dx, dy = 0.0, 0.0
    for i in range(2):
        point = gauss_point(is_kinematic, state, control, GAUSS_NODES[i])
        dx += 0.5 * h * point.speed * math.cos(point.heading)
        dy += 0.5 * h * point.speed * math.sin(point.heading)
    if is_kinematic:
        return state[X] + dx, state[Y] + dy, state[THETA] + h * alpha, a, alpha, step_ratio * h
    theta = state[THETA] + h * state[OMEGA] + 0.5 * h * h * alpha
    return state[X] + dx, state[Y] + dy, theta, state[V] + h * a, state[OMEGA] + h * alpha, step_ratio * h


@inner_kernel
def add_derivatives(
    is_kinematic: bool,
    state: NDArray[np.float64],
    control: NDArray[np.float64],
    step_ratio: float,
    costate: NDArray[np.float64],
    jacobian: NDArray[np.float64],
    hessian: NDArray[np.float64],
    end: NDArray[np.float64],
) -> None:
    """Value and derivatives of f at w.

    Args:
        is_kinematic: whether the velocities jump.
        state: shape (STATES,).
        control: shape (CONTROLS,).
        step_ratio: duration of the next interval, in terms of that of this one.
        costate: multipliers p of f, shape (STATES,).
        jacobian: overwritten by df/dw, shape (STATES, COLUMNS).
        hessian: the second derivative of p . f is added to its lower triangle, shape (COLUMNS, COLUMNS).
        end: overwritten by f, shape (STATES,).
    """
    h, a, alpha = state[STEP], control[0], control[1]
    for i in range(STATES):
        for j in range(COLUMNS):
            jacobian[i, j] = 1.0 if i == j else 0.0
    end[0], end[1], end[2], end[3], end[4], end[5] = interval_end(is_kinematic, state, control, step_ratio)
    jacobian[STEP, STEP] = step_ratio
    if is_kinematic:
        jacobian[V, V] = jacobian[OMEGA, OMEGA] = 0.0
        jacobian[V, A] = jacobian[OMEGA, ALPHA] = 1.0
        jacobian[THETA, STEP], jacobian[THETA, ALPHA] = alpha, h
        hessian[ALPHA, STEP] += costate[THETA]
    else:
        jacobian[THETA, OMEGA], jacobian[THETA, STEP], jacobian[THETA, ALPHA] = h, state[OMEGA] + h * alpha, 0.5 * h * h
        jacobian[V, STEP], jacobian[V, A] = a, h
        jacobian[OMEGA, STEP], jacobian[OMEGA, ALPHA] = alpha, h
        hessian[STEP, OMEGA] += costate[THETA]
        hessian[STEP, STEP] += costate[THETA] * alpha
        hessian[ALPHA, STEP] += costate[THETA] * h + costate[OMEGA]
        hessian[A, STEP] += costate[V]
    for i in range(2):
        point = gauss_point(is_kinematic, state, control, GAUSS_NODES[i])
        add_position_derivatives(point, h, costate[X], costate[Y], jacobian, hessian)


@inner_kernel
def add_position_derivatives(
    point: GaussPoint, h: float, p_x: float, p_y: float, jacobian: NDArray[np.float64], hessian: NDArray[np.float64]
) -> None:
    """Derivatives of one term of Gauss's rule, h s (cos phi, sin phi) / 2.

    With C = p_x cos phi + p_y sin phi and D = dC/dphi, the term of p . f is h s C / 2.
    """
    cosine, sine = math.cos(point.heading), math.sin(point.heading)
    c, d = p_x * cosine + p_y * sine, p_y * cosine - p_x * sine
    half, s = 0.5 * h, point.speed
    by_speed = (0.0, point.speed_by_v, 0.0, point.speed_by_step, point.speed_by_a, 0.0)
    by_heading = (1.0, 0.0, point.heading_by_omega, point.heading_by_step, 0.0, point.heading_by_alpha)
    for i in range(6):
        jacobian[X, THETA + i] += half * (by_speed[i] * cosine - s * sine * by_heading[i])
        jacobian[Y, THETA + i] += half * (by_speed[i] * sine + s * cosine * by_heading[i])
        for j in range(i + 1):
            hessian[THETA + i, THETA + j] += half * (
                d * (by_speed[i] * by_heading[j] + by_speed[j] * by_heading[i]) - s * c * by_heading[i] * by_heading[j]
            )
    jacobian[X, STEP] += 0.5 * s * cosine
    jacobian[Y, STEP] += 0.5 * s * sine
    for j in range(6):  # h itself is a factor
        mixed = 0.5 * (by_speed[j] * c + s * d * by_heading[j])
        row, column = max(STEP, THETA + j), min(STEP, THETA + j)
        hessian[row, column] += 2.0 * mixed if row == column else mixed
    hessian[STEP, OMEGA] += half * s * d * point.heading_by_omega_step
    hessian[STEP, STEP] += half * s * d * point.heading_by_step_step
    hessian[A, STEP] += half * c * point.speed_by_a_step
    hessian[ALPHA, STEP] += half * s * d * point.heading_by_alpha_step
