"""Compiled drive from a state under one control: how far it is free, and where the robot could still brake to rest."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cbrrt_ompl.collision.clearance_map import COLLISION, ROOM, MapView, certify, certify_pose
from cbrrt_ompl.collision.motion_check import ASK, BLOCKED, FREE, check_step_motion, note, recall, sum_up, ways_of_step
from cbrrt_ompl.motion.control_laws import tracking_command
from cbrrt_ompl.motion.kinematics import (
    displacement,
    has_wheel_limits,
    joint_ramp,
    middle_heading,
    ramp,
    saturate,
    stopping_time,
    wrap_angle,
)
from cbrrt_ompl.motion.manoeuvres import BRAKE, is_manoeuvre, most_steps
from cbrrt_ompl.motion.model import (
    CLOSED_LOOP,
    STEERING,
    Model,
    advance,
    has_come_to_end,
    in_goal,
    manoeuvre_command,
    manoeuvre_has_ended,
)

BLOCK = 48
"""Steps that are integrated at once, before the first of them is checked."""

SCRATCH_SHAPE = (6, BLOCK + 1)
"""Room for a block: v, omega, theta, heading in the middle of the step, dx, dy."""


@njit(cache=True, forceinline=True)  # else LLVM may leave it a call, which makes an extension a tenth slower
def integrate_block(
    theta: float,
    v: float,
    omega: float,
    v_command: float,
    omega_command: float,
    steps: int,
    model: Model,
    scratch: NDArray[np.float64],
) -> None:
    """Integrate some steps towards one command, with their sines on vector registers.

    They are those of :func:`cbrrt_ompl.motion.model.advance`, bit for bit.

    Args:
        theta: heading at the start [rad].
        v: forward velocity at the start [m/s].
        omega: turning rate at the start [rad/s].
        v_command: forward velocity asked for [m/s].
        omega_command: turning rate asked for [rad/s].
        steps: at most `BLOCK`.
        model: how the robot moves.
        scratch: its rows v, omega and theta are filled up to ``steps``, the others up to ``steps - 1``.
    """
    dt, limits = model.dt, model.limits
    v_command, omega_command = saturate(v_command, omega_command, limits)
    vs, omegas, thetas, middles, dxs, dys = scratch[0], scratch[1], scratch[2], scratch[3], scratch[4], scratch[5]
    if model.law == STEERING:
        v, omega = v_command, omega_command
    most, most_angular = limits.acceleration * dt, limits.angular_acceleration * dt
    vs[0], omegas[0], thetas[0] = v, omega, theta
    if has_wheel_limits(limits):
        for i in range(steps):
            v, omega_next = joint_ramp(v, omega, v_command, omega_command, limits, dt)
            middles[i] = middle_heading(theta, omega, omega_next, dt)
            theta = wrap_angle(theta + 0.5 * (omega + omega_next) * dt)
            omega = omega_next
            vs[i + 1], omegas[i + 1], thetas[i + 1] = v, omega, theta
    else:
        for i in range(steps):
            v, omega_next = ramp(v, v_command, most), ramp(omega, omega_command, most_angular)
            middles[i] = middle_heading(theta, omega, omega_next, dt)
            theta = wrap_angle(theta + 0.5 * (omega + omega_next) * dt)
            omega = omega_next
            vs[i + 1], omegas[i + 1], thetas[i + 1] = v, omega, theta
    for i in range(steps):
        dxs[i], dys[i] = displacement(middles[i], vs[i], omegas[i], vs[i + 1], omegas[i + 1], dt)


@njit(cache=True)
def roll_out(
    node: tuple[float, float, float, float, float],
    control: tuple[float, float, float],
    model: Model,
    view: MapView,
    findings: NDArray[np.float64],
    scratch: NDArray[np.float64],
) -> tuple[int, int, tuple[float, float, float, float, float], tuple[float, float, float]]:
    """Drive from a valid state under one control until the horizon, the goal or an obstacle.

    A manoeuvre has no horizon: it is free if it comes to its own end.

    Args:
        node: (x, y, theta, v, omega) at the start.
        control: see :func:`cbrrt_ompl.motion.model.advance`, whose steps these are, bit for bit.
        model: how the robot moves.
        view: the clearance map.
        findings: what was found before, see :func:`cbrrt_ompl.collision.motion_check.recall`.
        scratch: room for a block, of shape `SCRATCH_SHAPE`.

    Returns:
        The number of steps known to be free; `FREE`, `BLOCKED` or `ASK`; the state after these steps; and the pose
        that FCL must decide.
    """
    x, y, theta, v, omega = node
    dt, goal, steps = model.dt, model.goal, model.steps
    manoeuvres = is_manoeuvre(control)
    if manoeuvres:
        steps = most_steps(control[2], math.hypot(goal.x - x, goal.y - y), model.limits, dt)
    reach = 0.0 if view.is_round else view.outer
    near_goal = goal.tolerance * goal.tolerance * (1.0 + 1e-9)
    is_known, margin, is_certified = recall(findings)
    if not is_known:
        margin, is_certified = certify_pose(view, x, y, theta, ROOM)
        if margin <= 0.0:  # valid all the same, yet with less room than a motion needs
            margin, is_certified = 0.0, False
        note(findings, margin, is_certified)
    k = 0
    while k < steps:
        if manoeuvres or model.law == CLOSED_LOOP:
            if manoeuvres:
                v_command, omega_command = manoeuvre_command((x, y, theta, v, omega), control[2], model)
            else:
                v_command, omega_command = tracking_command(x, y, theta, control, model.limits, model.gains)
            count = 1
        else:
            v_command, omega_command = control[0], control[1]
            count = min(BLOCK, steps - k)
        integrate_block(theta, v, omega, v_command, omega_command, count, model, scratch)
        for i in range(count):
            start = (x, y, theta, scratch[0, i], scratch[1, i])
            end = (x + scratch[4, i], y + scratch[5, i], scratch[2, i + 1], scratch[0, i + 1], scratch[1, i + 1])
            travel, sweep = ways_of_step(start, end, reach, dt)
            used = travel if is_certified else sweep
            if margin >= used:
                margin -= used
            else:
                outcome, margin, is_certified, pose = check_step_motion(
                    start, end, travel, sweep, margin, is_certified, view, findings, dt
                )
                if outcome != FREE:
                    if outcome == ASK and not model.keep_cut:
                        if is_doomed(x, y, theta, v, omega, steps - k, control, model, view):
                            outcome = BLOCKED
                            note(findings, COLLISION, False)
                    return k, outcome, (x, y, theta, v, omega), pose
            x, y, theta, v, omega = end
            k += 1
            if manoeuvres:
                if manoeuvre_has_ended(control[2], (x, y, theta, v, omega), goal):
                    return k, FREE, (x, y, theta, v, omega), (x, y, theta)
                continue
            dx, dy = x - goal.x, y - goal.y
            if dx * dx + dy * dy < near_goal and in_goal(goal, x, y, theta, v, omega):
                return k, FREE, (x, y, theta, v, omega), (x, y, theta)
    return steps, BLOCKED if manoeuvres else FREE, (x, y, theta, v, omega), (x, y, theta)


@njit(cache=True)
def is_doomed(
    x: float,
    y: float,
    theta: float,
    v: float,
    omega: float,
    steps: int,
    control: tuple[float, float, float],
    model: Model,
    view: MapView,
) -> bool:
    """Whether the map alone shows that the next steps meet an obstacle: then FCL need not be asked."""
    for _ in range(steps):
        x, y, theta, v, omega, _, _ = advance(x, y, theta, v, omega, control, model, model.dt)
        if certify_pose(view, x, y, theta, ROOM)[0] == COLLISION:
            return True
        if has_come_to_end((x, y, theta, v, omega), control, model):
            return False
    return False


@njit(cache=True)
def drive_safely(
    node: tuple[float, float, float, float, float],
    control: tuple[float, float, float],
    model: Model,
    view: MapView,
    findings: NDArray[np.float64],
    scratch: NDArray[np.float64],
) -> tuple[int, int, tuple[float, float, float, float, float], tuple[float, float, float]]:
    """:func:`roll_out`, cut before the first step whose end leaves no room to brake where the model is brake-safe.

    Robots whose velocities jump stop on the spot, so that nothing is cut.
    """
    steps, outcome, end, pose = roll_out(node, control, model, view, findings, scratch)
    if not model.brake_safe or model.law == STEERING or outcome == ASK or (outcome == BLOCKED and not model.keep_cut):
        return steps, outcome, end, pose
    unchecked = steps
    if not model.keep_cut:  # the end first: it is the likeliest to be refused
        unchecked -= 1
        stops, asked = check_braking(end, model, view, findings, scratch)
        if stops != FREE:
            return 0, stops, node, asked
    x, y, theta, v, omega = node
    for k in range(unchecked):
        before = (x, y, theta, v, omega)
        x, y, theta, v, omega, _, _ = advance(x, y, theta, v, omega, control, model, model.dt)
        stops, asked = check_braking((x, y, theta, v, omega), model, view, findings, scratch)
        if stops != FREE:
            return k, stops, before, asked
    return steps, outcome, end, pose


@njit(cache=True)
def check_braking(
    state: tuple[float, float, float, float, float],
    model: Model,
    view: MapView,
    findings: NDArray[np.float64],
    scratch: NDArray[np.float64],
) -> tuple[int, tuple[float, float, float]]:
    """Brake to rest from a valid state: `FREE`, `BLOCKED` or `ASK`, and the pose that FCL must decide."""
    stopping_distance = abs(state[3]) * (0.5 * stopping_time(state[3], state[4], model.limits) + model.dt)
    is_known, margin, _ = recall(findings)
    if not is_known:
        margin = certify(view, state[0], state[1], ROOM)
        note(findings, margin, True)
    if margin > stopping_distance:
        return FREE, (0.0, 0.0, 0.0)
    row = int(findings[0, 1])
    _, outcome, _, pose = roll_out(state, (0.0, 0.0, BRAKE), model, view, findings, scratch)
    if outcome == FREE:
        sum_up(findings, row)
    return outcome, pose
