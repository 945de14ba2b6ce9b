"""Compiled drive from a state under one control: how far it is free, and where the robot could still brake to rest."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.collision.clearance import ENOUGH, clearance
from cbrrt_ompl.collision.motion_check import check_step_motion, lever_arm, way_of_step
from cbrrt_ompl.collision.scene import Scene
from cbrrt_ompl.kernels import inner_kernel, kernel
from cbrrt_ompl.motion.control_laws import is_past
from cbrrt_ompl.motion.kinematics import (
    decelerations,
    displacement,
    has_wheel_limits,
    joint_ramp,
    middle_heading,
    ramp,
    saturate,
    stopping_time,
    stopping_time_of_turn,
    wrap_angle,
)
from cbrrt_ompl.motion.manoeuvres import BRAKE, is_manoeuvre, most_steps
from cbrrt_ompl.motion.model import CLOSED_LOOP, advance, in_goal, manoeuvre_has_ended
from cbrrt_ompl.motion.records import Record
from cbrrt_ompl.problem.robot import Limits

MOTION_FREE, MOTION_BLOCKED = 0, 1
"""Outcomes of a motion."""

BLOCK = 48
"""Steps that are integrated at once, before the first of them is checked."""

SHORT_BLOCK = 8
"""The same near an obstacle, where the first steps may well be refused."""

STRIDE = 8
"""Steps that a margin is to prove at once, where their velocities only rise or only fall."""

FEW = 8
"""Steps that are looked at one after the other, not in the middle first."""

NEAR = 0.2
"""Margin below which the first block is a short one [m]."""

FARTHER = 1.2
"""Covers that a step may lead farther than speed times duration, as it is integrated: by a thousandth, and no tenth."""

STEPS = np.dtype(
    [
        *((name, np.float64, (BLOCK,)) for name in ("dx", "dy")),  # way of each step [m]
        *((name, np.float64, (BLOCK + 1,)) for name in ("x", "y", "theta", "v", "omega")),  # at the ends of the steps
        ("margin", np.float64),  # of the pose after the last free step, where it was looked at, else negative [m]
        ("any_heading", np.bool_),  # of the margin
    ],
    align=True,
)
"""Room for the states of a block, the first of them before its first step.

What a loop writes comes before what it reads: where LLVM cannot rule out that a read meets an earlier write, it halves
the width of the vectors.
"""


@kernel(forceinline=True)
def ramp_along(values: NDArray[np.float64], command: float, faster: float, slower: float, count: int) -> None:
    """Velocities at the ends of some steps, from the first of them to a command; see :func:`ramp`."""
    i = 0
    while i < count and values[i] != command:
        values[i + 1] = ramp(values[i], command, faster, slower)
        i += 1
    for k in range(i, count):
        values[k + 1] = command


@kernel(forceinline=True)
def ramp_jointly(
    vs: NDArray[np.float64],
    omegas: NDArray[np.float64],
    v_command: float,
    omega_command: float,
    count: int,
    limits: Limits,
    dt: float,
) -> None:
    """Both velocities at the ends of some steps, as of a robot with wheel limits; see :func:`joint_ramp`."""
    i = 0
    while i < count and not (vs[i] == v_command and omegas[i] == omega_command):
        vs[i + 1], omegas[i + 1] = joint_ramp(vs[i], omegas[i], v_command, omega_command, limits, dt)
        i += 1
    for k in range(i, count):
        vs[k + 1], omegas[k + 1] = v_command, omega_command


@kernel(forceinline=True)  # else LLVM may leave it a call, which makes an extension a tenth slower
def integrate_block(steps: Record, v_command: float, omega_command: float, count: int, model: Record) -> None:
    """Integrate some steps towards one command, with their sines on vector registers.

    They are those of :func:`cbrrt_ompl.motion.model.advance`, bit for bit.

    Args:
        steps: a record of type `STEPS`; its first state is the one to start from, the others are written.
        v_command: forward velocity asked for [m/s].
        omega_command: turning rate asked for [rad/s].
        count: at most `BLOCK`.
        model: how the robot moves, a record of type :data:`cbrrt_ompl.motion.model.MODEL`.
    """
    dt, limits = model.dt, model.limits
    xs, ys, thetas, vs, omegas = steps.x, steps.y, steps.theta, steps.v, steps.omega
    dxs, dys = steps.dx, steps.dy
    v_command, omega_command = saturate(v_command, omega_command, limits)
    if model.jumps:
        vs[0], omegas[0] = v_command, omega_command
    if has_wheel_limits(limits):
        ramp_jointly(vs, omegas, v_command, omega_command, count, limits, dt)
    else:
        slower, turns_slower = decelerations(limits)
        ramp_along(vs, v_command, limits.acceleration * dt, slower * dt, count)
        ramp_along(omegas, omega_command, limits.angular_acceleration * dt, turns_slower * dt, count)
    theta = thetas[0]
    for i in range(count):
        theta = wrap_angle(theta + 0.5 * (omegas[i] + omegas[i + 1]) * dt)
        thetas[i + 1] = theta
    for i in range(count):
        middle = middle_heading(thetas[i], omegas[i], omegas[i + 1], dt)
        dxs[i], dys[i] = displacement(middle, vs[i], omegas[i], vs[i + 1], omegas[i + 1], dt)
    x, y = xs[0], ys[0]
    for i in range(count):
        x, y = x + dxs[i], y + dys[i]
        xs[i + 1], ys[i + 1] = x, y


@inner_kernel
def integrate_stepwise(
    steps: Record, control: tuple[float, float, float], count: int, model: Record
) -> tuple[int, bool]:
    """Integrate some steps under a control that is evaluated anew at each: a closed loop or a manoeuvre.

    Args:
        steps: see :func:`integrate_block`.
        control: see :func:`cbrrt_ompl.motion.model.advance`.
        count: at most `BLOCK`.
        model: see :func:`integrate_block`.

    Returns:
        How many steps there are, fewer where a manoeuvre comes to its end or a closed loop passes its reference; and
        whether it does.
    """
    state = (steps.x[0], steps.y[0], steps.theta[0], steps.v[0], steps.omega[0])
    is_manoeuvring = is_manoeuvre(control)
    for i in range(1, count + 1):
        x, y, theta, v, omega = state
        x, y, theta, v, omega, _, _ = advance(x, y, theta, v, omega, control, model, model.dt)
        steps.x[i], steps.y[i], steps.theta[i], steps.v[i], steps.omega[i] = x, y, theta, v, omega
        state = (x, y, theta, v, omega)
        if manoeuvre_has_ended(control[2], state, model.goal) if is_manoeuvring else is_past(x, y, control):
            return i, True
    return count, False


@kernel(inline="always")
def state_at(steps: Record, i: int) -> tuple[float, float, float, float, float]:
    """The state at the end of a block's step, 0 before the first: (x, y, theta, v, omega)."""
    return steps.x[i], steps.y[i], steps.theta[i], steps.v[i], steps.omega[i]


@inner_kernel
def first_in_goal(steps: Record, count: int, model: Record) -> int:
    """The first step of a block that ends in the goal region, or one more than there are."""
    goal, limits = model.goal, model.limits
    fastest = max(max(limits.v_max, -limits.v_min), abs(steps.v[0]))
    reach = goal.tolerance + FARTHER * count * model.dt * fastest
    dx, dy = steps.x[0] - goal.x, steps.y[0] - goal.y
    if dx * dx + dy * dy > reach * reach:
        return count + 1
    near = goal.tolerance * goal.tolerance * (1.0 + 1e-9)
    for i in range(1, count + 1):
        dx, dy = steps.x[i] - goal.x, steps.y[i] - goal.y
        if dx * dx + dy * dy < near and in_goal(goal, *state_at(steps, i)):
            return i
    return count + 1


@kernel
def free_steps(
    steps: Record, count: int, is_monotonic: bool, margin: float, any_heading: bool, scene: Scene, model: Record
) -> tuple[int, float, bool]:
    """How many steps of a block are free, one after the other.

    Where a cut extension is of no use, the end is looked at first, then the middle of what the margins of both sides do
    not prove: that takes fewer poses than to go ahead from the start, and an obstacle is met sooner.

    Args:
        steps: a record of type `STEPS`, which keeps the margin of the last pose where that was looked at.
        count: how many there are.
        is_monotonic: whether each velocity only rises or only falls in them, so that a margin proves many at once.
        margin: distance proven free before the first of them, beyond the model's room [m].
        any_heading: see :func:`cbrrt_ompl.collision.motion_check.lever_arm`.
        scene: world and footprint.
        model: a record of type :data:`cbrrt_ompl.motion.model.MODEL`.

    Returns:
        The number, any smaller one than ``count`` where one is not free and the model keeps no cut extension; and the
        margin and its ``any_heading`` after the last free one.
    """
    steps.margin = -1.0
    if not is_monotonic or count <= STRIDE or model.keep_cut:
        return march(steps, 0, count, is_monotonic, margin, any_heading, scene, model)
    i, margin = proven_ahead(steps, 0, count, margin, any_heading, scene, model)
    if i == count:
        return count, margin, any_heading
    end_margin, end_any_heading = margin_at(steps.x[count], steps.y[count], steps.theta[count], scene, model.room)
    if end_margin <= 0.0:
        return i, margin, any_heading
    last = proven_behind(steps, i, count, end_margin, end_any_heading, scene, model)
    while last > i:
        if last - i <= FEW:
            free, margin, any_heading = march(steps, i, last, True, margin, any_heading, scene, model)
            if free < last:
                return free, margin, any_heading
            break
        middle = (i + last) // 2
        found, found_any_heading = margin_at(steps.x[middle], steps.y[middle], steps.theta[middle], scene, model.room)
        if found <= 0.0:
            return i, margin, any_heading
        first = proven_behind(steps, i, middle, found, found_any_heading, scene, model)
        if first > i:
            free, margin, any_heading = march(steps, i, first, True, margin, any_heading, scene, model)
            if free < first:
                return free, margin, any_heading
        i, margin = proven_ahead(steps, middle, last, found, found_any_heading, scene, model)
        any_heading = found_any_heading
    steps.margin, steps.any_heading = end_margin, end_any_heading
    return count, end_margin, end_any_heading


@kernel(inline="always")
def way_between(steps: Record, first: int, last: int, arm: float, dt: float) -> float:
    """Bound on the way in steps whose velocities only rise or only fall, see :func:`way_of_step` [m]."""
    return (last - first) * way_of_step(state_at(steps, first), state_at(steps, last), arm, dt)


@inner_kernel(forceinline=True)
def proven_ahead(
    steps: Record, i: int, count: int, margin: float, any_heading: bool, scene: Scene, model: Record
) -> tuple[int, float]:
    """How far a margin before a step proves the steps from there on; and what is left of it."""
    arm = lever_arm(scene.frame[0], any_heading)
    while i < count:
        ahead = min(i + STRIDE, count)
        way = way_between(steps, i, ahead, arm, model.dt)
        if margin < way:
            break
        margin -= way
        i = ahead
    return i, margin


@inner_kernel(forceinline=True)
def proven_behind(
    steps: Record, first: int, i: int, margin: float, any_heading: bool, scene: Scene, model: Record
) -> int:
    """From where on a margin after a step proves the steps up to it."""
    arm = lever_arm(scene.frame[0], any_heading)
    while i > first:
        behind = max(i - STRIDE, first)
        way = way_between(steps, behind, i, arm, model.dt)
        if margin < way:
            break
        margin -= way
        i = behind
    return i


@inner_kernel
def march(
    steps: Record,
    i: int,
    count: int,
    is_monotonic: bool,
    margin: float,
    any_heading: bool,
    scene: Scene,
    model: Record,
) -> tuple[int, float, bool]:
    """How many steps of a block are free, from one on up to another, in this order; see :func:`free_steps`."""
    dt, room, frame = model.dt, model.room, scene.frame[0]
    while i < count:
        arm = lever_arm(frame, any_heading)
        if is_monotonic:
            ahead = min(i + STRIDE, count)
            way = way_between(steps, i, ahead, arm, dt)
            if margin >= way:
                margin -= way
                i = ahead
                continue
        start, end = state_at(steps, i), state_at(steps, i + 1)
        if model.jumps:
            start = (start[0], start[1], start[2], end[3], end[4])
        way = way_of_step(start, end, arm, dt)
        if margin >= way:
            margin -= way
        else:
            margin, any_heading = check_step_motion(start, end, margin, any_heading, scene, room, dt)
            if margin <= 0.0:
                return i, margin, any_heading
        i += 1
    return count, margin, any_heading


@kernel
def margin_at(x: float, y: float, theta: float, scene: Scene, room: float) -> tuple[float, bool]:
    """Margin of a valid pose beyond the room, 0 where it has less than a motion needs; and its ``any_heading``."""
    distance, any_heading = clearance(scene, x, y, theta, ENOUGH)
    return max(distance - room, 0.0), any_heading and distance > room


@kernel
def roll_out(
    node: tuple[float, float, float, float, float],
    control: tuple[float, float, float],
    margin: float,
    any_heading: bool,
    scene: Scene,
    model: Record,
    steps: Record,
) -> tuple[int, int, tuple[float, float, float, float, float]]:
    """Drive from a valid state under one control until the horizon, the goal or an obstacle.

    A manoeuvre has no horizon: it is free if it comes to its own end.

    Args:
        node: (x, y, theta, v, omega) at the start.
        control: see :func:`cbrrt_ompl.motion.model.advance`, whose steps these are, bit for bit.
        margin: of the node's pose, see :func:`margin_at`.
        any_heading: of that margin.
        scene: world and footprint.
        model: how the robot moves, a record of type :data:`cbrrt_ompl.motion.model.MODEL`.
        steps: room for a block, a record of type `STEPS`.

    Returns:
        The number of steps that are free; `MOTION_FREE` or `MOTION_BLOCKED`; and the state after these steps.
    """
    is_manoeuvring = is_manoeuvre(control)
    left = model.steps
    if is_manoeuvring:
        left = most_steps(
            control[2], math.hypot(model.goal.x - node[0], model.goal.y - node[1]), model.limits, model.dt
        )
    steps.x[0], steps.y[0], steps.theta[0], steps.v[0], steps.omega[0] = node
    driven = 0
    size = SHORT_BLOCK if margin < NEAR else BLOCK
    while left > 0:
        count, is_over = min(size, left), False
        is_stepwise = is_manoeuvring or model.law == CLOSED_LOOP
        if is_stepwise:
            count, is_over = integrate_stepwise(steps, control, count, model)
        else:
            integrate_block(steps, control[0], control[1], count, model)
        if not is_manoeuvring:
            goal_at = first_in_goal(steps, count, model)
            count, is_over = min(count, goal_at), is_over or goal_at <= count
        free, margin, any_heading = free_steps(steps, count, not is_stepwise, margin, any_heading, scene, model)
        driven += free
        if free < count:
            return driven, MOTION_BLOCKED, state_at(steps, free)
        if is_over:
            return driven, MOTION_FREE, state_at(steps, free)
        left -= count
        steps.x[0], steps.y[0], steps.theta[0], steps.v[0], steps.omega[0] = state_at(steps, count)
        size = BLOCK
    return driven, MOTION_BLOCKED if is_manoeuvring else MOTION_FREE, state_at(steps, 0)


@kernel(inline="always")
def roll_out_brake_safe(
    node: tuple[float, float, float, float, float],
    control: tuple[float, float, float],
    margin: float,
    any_heading: bool,
    scene: Scene,
    model: Record,
    steps: Record,
) -> tuple[int, int, tuple[float, float, float, float, float]]:
    """:func:`roll_out`, cut before the first step whose end leaves no room to brake where the model is brake-safe.

    Robots whose velocities jump stop on the spot, so that nothing is cut.
    """
    driven, outcome, end = roll_out(node, control, margin, any_heading, scene, model, steps)
    if not model.brake_safe or model.jumps or (outcome == MOTION_BLOCKED and not model.keep_cut):
        return driven, outcome, end
    steps.margin = -1.0  # what follows may look elsewhere, or cut the drive
    unchecked = driven
    if not model.keep_cut:  # the end first: it is the likeliest to be refused
        unchecked -= 1
        if not can_brake(end, -margin, any_heading, scene, model, steps)[0]:
            return 0, MOTION_BLOCKED, node
    frame, state = scene.frame[0], node
    for k in range(unchecked):
        x, y, theta, v, omega = state
        x, y, theta, v, omega, _, _ = advance(x, y, theta, v, omega, control, model, model.dt)
        after = (x, y, theta, v, omega)
        margin -= way_of_step(state, after, lever_arm(frame, any_heading), model.dt)
        is_safe, margin, any_heading = can_brake(after, margin, any_heading, scene, model, steps)
        if not is_safe:
            return k, MOTION_BLOCKED, state
        state = after
    return driven, outcome, end


@kernel
def can_brake(
    state: tuple[float, float, float, float, float],
    margin: float,
    any_heading: bool,
    scene: Scene,
    model: Record,
    steps: Record,
) -> tuple[bool, float, bool]:
    """Whether the robot can brake to rest from a valid state.

    Args:
        state: (x, y, theta, v, omega).
        margin: what is known of its pose's margin [m]; 0 or less where nothing is.
        any_heading: of that margin.
        scene: see :func:`roll_out`.
        model: see :func:`roll_out`.
        steps: see :func:`roll_out`.

    Returns:
        The answer, and what is known of the margin afterwards.
    """
    dt, limits, frame = model.dt, model.limits, scene.frame[0]
    distance = abs(state[3]) * (0.5 * stopping_time(state[3], state[4], limits) + dt)
    turn = abs(state[4]) * (0.5 * stopping_time_of_turn(state[3], state[4], limits) + dt)
    if margin > distance + lever_arm(frame, any_heading) * turn:
        return True, margin, any_heading
    margin, any_heading = margin_at(state[0], state[1], state[2], scene, model.room)
    if margin > distance + lever_arm(frame, any_heading) * turn:
        return True, margin, any_heading
    outcome = roll_out(state, (0.0, 0.0, BRAKE), margin, any_heading, scene, model, steps)[1]
    return outcome == MOTION_FREE, margin, any_heading
