"""Compiled EXTEND_TRAJECTORY of the paper (Algorithm II), for the plugin and the compiled planners alike.

An extension decides poses by the clearance map. Where the map cannot, the kernel does not guess: it returns `ASK` with
the pose in question, the caller lets FCL answer it and calls again with the answer, and the extension is repeated.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cbrrt_ompl.clearance_map import COLLISION, ROOM, UNDECIDED, MapView, certify, certify_pose
from cbrrt_ompl.control_laws import reference_pose, steering_rate, tracking_command
from cbrrt_ompl.errors import Problem, SettingsError
from cbrrt_ompl.kinematics import (
    displacement,
    dynamic_step,
    has_wheel_limits,
    joint_ramp,
    kinematic_step,
    middle_heading,
    ramp,
    saturate,
    stopping_time,
    unicycle_step,
    wrap_angle,
)
from cbrrt_ompl.manoeuvres import (
    BRAKE,
    FORWARD,
    REVERSE,
    approach_command,
    has_ended,
    is_manoeuvre,
    most_steps,
)
from cbrrt_ompl.robot import Gains, Limits, Robot
from cbrrt_ompl.settings import Goal, PlanningSettings

OPEN_LOOP, CLOSED_LOOP, STEERING = 0, 1, 2
"""How an extension is driven: Kanayama law once an extension or at every step (CB-RRT), or at full speed (S-RRT)."""

EXTENDED, REFUSED, BLOCKED, ASK = 0, 1, 2, 3
"""What came of an extension: a new node, line 5 of Algorithm II, an obstacle, or a question to FCL."""

MOTION_RESOLUTION = 2.0 * ROOM
"""Largest distance between two checked points of a motion [m]."""

CANDIDATES = 3
"""Extensions tried for one sample at most: the three steering rates of S-RRT."""

NO_CHILD, UNTRIED = -1, -2
"""In place of a node's latest child: it has none; it has none, and no final approach was tried from it."""


class GoalRegion(NamedTuple):
    """The goal as the kernels see it; infinite tolerances leave a condition out."""

    x: float
    y: float
    tolerance: float
    theta: float
    heading_tolerance: float
    speed_tolerance: float


class Model(NamedTuple):
    """All that an extension depends on besides node, sample and world."""

    law: int
    """`OPEN_LOOP`, `CLOSED_LOOP` or `STEERING`."""
    dt: float
    """Integration step [s]."""
    steps: int
    """Steps of a whole extension."""
    look_ahead: float
    """Largest distance of the reference from its node [m]."""
    equal_control_tolerance: float
    """eps_u of line 5 [m/s and rad/s]."""
    keep_cut: bool
    """Whether the free part of an extension that meets an obstacle is kept."""
    approaches: bool
    """Whether a final approach to the goal is tried from every node."""
    brake_safe: bool
    """Whether the robot must be able to brake to rest from every state."""
    limits: Limits
    gains: Gains
    goal: GoalRegion


MODEL_SIZE = 8 + len(Limits._fields) + len(Gains._fields) + len(GoalRegion._fields)
"""Numbers in a packed model."""


def pack_model(law: int, robot: Robot, goal: Goal, planning: PlanningSettings) -> NDArray[np.float64]:
    """The model as one flat array: what a kernel takes from Python at the least cost.

    Args:
        law: `OPEN_LOOP`, `CLOSED_LOOP` or `STEERING`.
        robot: limits and gains.
        goal: goal region.
        planning: settings.

    Returns:
        The numbers that :func:`unpack_model` reads, shape (MODEL_SIZE,).
    """
    region = GoalRegion(
        goal.x,
        goal.y,
        goal.tolerance,
        0.0 if goal.theta is None else goal.theta,
        math.inf if goal.theta is None else goal.heading_tolerance,
        math.inf if goal.speed_tolerance is None else goal.speed_tolerance,
    )
    head = (
        law,
        planning.step,
        planning.steps,
        planning.reference_distance(robot.limits),
        planning.equal_control_tolerance,
        planning.cut_extension == "keep",
        planning.approaches(goal),
        planning.brake_safe,
    )
    return np.array([*head, *robot.limits, *robot.gains, *region], dtype=float)


def control_dimension(model: NDArray[np.float64]) -> int:
    """Numbers of OMPL's controls under a packed model: (v, omega), a reference pose, or room for a manoeuvre's mark."""
    return 3 if int(model[0]) == CLOSED_LOOP or model[6] else 2


COMPILED_PLANNERS = ("cb-rrt-compiled", "s-rrt-compiled", "cb-rrt-robust")
"""Planners that are one compiled loop and need no OMPL."""


def law_of(planner: str, planning: PlanningSettings) -> int:
    """How a planner drives: `STEERING`, `CLOSED_LOOP` or `OPEN_LOOP` (as OMPL's own planners do)."""
    if planner.startswith("s-rrt"):
        return STEERING
    return CLOSED_LOOP if planner.startswith("cb-rrt") and planning.closed_loop else OPEN_LOOP


@njit(cache=True)
def unpack_model(p: NDArray[np.float64]) -> Model:
    """The model out of its flat array, shape (MODEL_SIZE,)."""
    return Model(
        int(p[0]),
        p[1],
        int(p[2]),
        p[3],
        p[4],
        p[5] != 0.0,
        p[6] != 0.0,
        p[7] != 0.0,
        Limits(p[8], p[9], p[10], p[11], p[12], p[13], p[14], p[15], p[16]),
        Gains(p[17], p[18], p[19]),
        GoalRegion(p[20], p[21], p[22], p[23], p[24], p[25]),
    )


@njit(cache=True)
def in_goal(goal: GoalRegion, x: float, y: float, theta: float, v: float, omega: float) -> bool:
    """Whether a state satisfies the goal; the distance is compared as OMPL's GoalState does, bit for bit."""
    dx, dy = x - goal.x, y - goal.y
    if not math.sqrt(dx * dx + dy * dy) < goal.tolerance:
        return False
    if goal.heading_tolerance < math.inf:
        error = abs(theta - goal.theta) % (2.0 * math.pi)
        if min(error, 2.0 * math.pi - error) > goal.heading_tolerance:
            return False
    return abs(v) <= goal.speed_tolerance and abs(omega) <= goal.speed_tolerance


@njit(cache=True)
def manoeuvre_command(
    state: tuple[float, float, float, float, float], manoeuvre: float, model: Model
) -> tuple[float, float]:
    """Command (v, omega) of the next step of a manoeuvre, [m/s, rad/s]."""
    if manoeuvre == BRAKE:
        return 0.0, 0.0
    goal = model.goal
    return approach_command(
        state,
        (goal.x, goal.y, goal.theta),
        goal.heading_tolerance < math.inf,
        manoeuvre == REVERSE,
        model.law == STEERING,
        model.limits,
        model.dt,
    )


@njit(cache=True)
def manoeuvre_has_ended(manoeuvre: float, state: tuple[float, float, float, float, float], goal: GoalRegion) -> bool:
    """Whether a manoeuvre is over, see :func:`cbrrt_ompl.manoeuvres.has_ended`."""
    return has_ended(manoeuvre, state, (goal.x, goal.y, goal.theta), goal.heading_tolerance < math.inf)


@njit(cache=True, inline="always")  # a call costs as much as the step itself
def advance(
    x: float,
    y: float,
    theta: float,
    v: float,
    omega: float,
    control: tuple[float, float, float],
    model: Model,
    dt: float,
) -> tuple[float, float, float, float, float, float, float]:
    """One integration step under a control.

    Args:
        x: position [m].
        y: position [m].
        theta: heading [rad].
        v: forward velocity [m/s].
        omega: turning rate [rad/s].
        control: command (v, omega, unused), or the reference pose (x_r, y_r, theta_r) where the law is `CLOSED_LOOP`;
            or a manoeuvre, by its third number.
        model: how the robot moves.
        dt: duration of the step [s].

    Returns:
        (x, y, theta, v, omega) one step later, and the command (v, omega) of the step, which the wheels can do.
    """
    if is_manoeuvre(control):
        command = manoeuvre_command((x, y, theta, v, omega), control[2], model)
    elif model.law == CLOSED_LOOP:
        command = tracking_command(x, y, theta, control, model.limits, model.gains)
    else:
        command = (control[0], control[1])
    command = saturate(command[0], command[1], model.limits)
    if model.law == STEERING:
        x, y, theta, v, omega = kinematic_step(x, y, theta, command, dt)
    else:
        x, y, theta, v, omega = dynamic_step(x, y, theta, v, omega, command, model.limits, dt)
    return x, y, theta, v, omega, command[0], command[1]


@njit(cache=True)
def find_answer(answers: NDArray[np.float64], answered: int, x: float, y: float, theta: float) -> float:
    """What FCL said about a pose: its margin [m], 0 in collision, -1 where it was not asked.

    An extension that is repeated asks in the same order, so the search begins behind the row found last, which the last
    number of the first row names.

    Args:
        answers: rows of (x, y, theta, margin, row), shape (n, 5).
        answered: rows in use.
        x: position [m].
        y: position [m].
        theta: heading [rad].
    """
    i = int(answers[0, 4])
    for _ in range(answered):
        if i >= answered:
            i = 0
        if answers[i, 0] == x and answers[i, 1] == y and answers[i, 2] == theta:
            answers[0, 4] = i + 1
            return answers[i, 3]
        i += 1
    return -1.0


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
def has_come_to_end(
    state: tuple[float, float, float, float, float], control: tuple[float, float, float], model: Model
) -> bool:
    """Whether a roll-out ends at a state before its last step: in the goal region, or with its manoeuvre."""
    if is_manoeuvre(control):
        return manoeuvre_has_ended(control[2], state, model.goal)
    return in_goal(model.goal, state[0], state[1], state[2], state[3], state[4])


class Step(NamedTuple):
    """One integration step, as the check between its ends sees it."""

    x: float
    """Position at the start [m]."""
    y: float
    theta: float
    """Heading at the start [rad]."""
    v: float
    """Forward velocity at the start [m/s]."""
    omega: float
    """Turning rate at the start [rad/s]."""
    x_end: float
    """Position at the end [m]."""
    y_end: float
    theta_end: float
    """Heading at the end [rad]."""
    v_end: float
    """Forward velocity at the end [m/s]."""
    omega_end: float
    """Turning rate at the end [rad/s]."""
    travel: float
    """Bound on the way of the robot's origin [m]."""
    sweep: float
    """Bound on the way of any point of the footprint [m]."""


@njit(cache=True)
def check_step_motion(
    step: Step, margin: float, is_certified: bool, view: MapView, answers: NDArray[np.float64], answered: int, dt: float
) -> tuple[int, float, bool, tuple[float, float, float]]:
    """Check the points of one step, each no more than `MOTION_RESOLUTION` after the one before.

    Every point must be farther than `ROOM` from everything: then no obstacle, however thin, fits between two of them. A
    point that is farther by m proves all points of the next m metres, so few of them are looked at. What is accepted
    depends on the points alone, never on what the map holds.

    Args:
        step: the step.
        margin: distance proven free at its start, beyond `ROOM` [m].
        is_certified: whether the margin holds for every heading; else it does for the heading there.
        view: the clearance map.
        answers: what FCL has said, see :func:`find_answer`.
        answered: rows of ``answers`` in use.
        dt: duration of the step [s].

    Returns:
        `EXTENDED` (free), `BLOCKED` or `ASK`; margin and ``is_certified`` at the end; and the pose looked at last.
    """
    points = int(step.sweep / MOTION_RESOLUTION) + 1
    pose = (step.x_end, step.y_end, step.theta_end)
    i = 0
    while i < points:
        spacing = (step.travel if is_certified else step.sweep) / points
        proven = int(margin / spacing) if spacing > 1e-12 else points
        if i + proven >= points:
            return EXTENDED, margin - (points - i) * spacing, is_certified, pose
        i += proven + 1
        pose = (step.x_end, step.y_end, step.theta_end)
        if i < points:
            share = i / points
            v = step.v + share * (step.v_end - step.v)
            omega = step.omega + share * (step.omega_end - step.omega)
            pose = unicycle_step(step.x, step.y, step.theta, step.v, step.omega, v, omega, share * dt)
        margin, is_certified = certify_pose(view, pose[0], pose[1], pose[2], ROOM)
        if margin == UNDECIDED:
            margin, is_certified = find_answer(answers, answered, pose[0], pose[1], pose[2]), False
            if margin < 0.0:
                return ASK, margin, is_certified, pose
            margin -= ROOM
        if margin <= 0.0:
            return BLOCKED, margin, is_certified, pose
    return EXTENDED, margin, is_certified, pose


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
    """Integrate some steps towards one command: :func:`advance`, bit for bit, with its sines on vector registers.

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
    answers: NDArray[np.float64],
    answered: int,
    scratch: NDArray[np.float64],
) -> tuple[int, int, tuple[float, float, float, float, float], tuple[float, float, float]]:
    """Drive from a valid state under one control until the horizon, the goal or an obstacle.

    A manoeuvre has no horizon: it is free if it comes to its own end.

    Args:
        node: (x, y, theta, v, omega) at the start.
        control: see :func:`advance`, whose steps these are, bit for bit.
        model: how the robot moves.
        view: the clearance map.
        answers: what FCL has said, see :func:`find_answer`.
        answered: rows of ``answers`` in use.
        scratch: room for a block, of shape `SCRATCH_SHAPE`.

    Returns:
        The number of steps known to be free; `EXTENDED`, `BLOCKED` or `ASK`; the state after these steps; and the pose
        that FCL must decide.
    """
    x, y, theta, v, omega = node
    dt, goal, steps = model.dt, model.goal, model.steps
    manoeuvres = is_manoeuvre(control)
    if manoeuvres:
        steps = most_steps(control[2], math.hypot(goal.x - x, goal.y - y), model.limits, dt)
    near_goal = goal.tolerance * goal.tolerance * (1.0 + 1e-9)
    reach = 0.0 if view.is_round else view.outer
    margin, is_certified = certify_pose(view, x, y, theta, ROOM)
    margin = max(margin, 0.0)
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
            v0, omega0, v1, omega1 = scratch[0, i], scratch[1, i], scratch[0, i + 1], scratch[1, i + 1]
            x1, y1, theta1 = x + scratch[4, i], y + scratch[5, i], scratch[2, i + 1]
            travel = max(abs(v0), abs(v1)) * dt
            sweep = travel + reach * max(abs(omega0), abs(omega1)) * dt
            used = travel if is_certified else sweep
            if margin >= used:
                margin -= used
            else:
                step = Step(x, y, theta, v0, omega0, x1, y1, theta1, v1, omega1, travel, sweep)
                outcome, margin, is_certified, pose = check_step_motion(
                    step, margin, is_certified, view, answers, answered, dt
                )
                if outcome != EXTENDED:
                    if outcome == ASK and not model.keep_cut:
                        if is_doomed(x, y, theta, v, omega, steps - k, control, model, view):
                            outcome = BLOCKED
                    return k, outcome, (x, y, theta, v, omega), pose
            x, y, theta, v, omega = x1, y1, theta1, v1, omega1
            k += 1
            if manoeuvres:
                if manoeuvre_has_ended(control[2], (x, y, theta, v, omega), goal):
                    return k, EXTENDED, (x, y, theta, v, omega), (x, y, theta)
                continue
            dx, dy = x - goal.x, y - goal.y
            if dx * dx + dy * dy < near_goal and in_goal(goal, x, y, theta, v, omega):
                return k, EXTENDED, (x, y, theta, v, omega), (x, y, theta)
    return steps, BLOCKED if manoeuvres else EXTENDED, (x, y, theta, v, omega), (x, y, theta)


class Extension(NamedTuple):
    """What came of an extension."""

    outcome: int
    """`EXTENDED`, `REFUSED`, `BLOCKED` or `ASK`."""
    steps: int
    """Integration steps."""
    state: tuple[float, float, float, float, float]
    """(x, y, theta, v, omega) at the end."""
    command: tuple[float, float]
    """Command (v, omega) that line 5 compares."""
    control: tuple[float, float, float]
    """Control for :func:`advance`; for `ASK` the pose in question instead."""


@njit(cache=True)
def approach(
    node: tuple[float, float, float, float, float],
    model: Model,
    view: MapView,
    answers: NDArray[np.float64],
    answered: int,
    scratch: NDArray[np.float64],
) -> Extension:
    """The final approach from a node to the goal, ahead or backwards, whichever is free and takes the smaller turn.

    Args:
        node: (x, y, theta, v, omega) of the node.
        model: all settings.
        view: the clearance map.
        answers: what FCL has said, see :func:`find_answer`.
        answered: rows of ``answers`` in use.
        scratch: room for a block, of shape `SCRATCH_SHAPE`.

    Returns:
        `EXTENDED` into the goal, `BLOCKED` or `ASK`.
    """
    goal = model.goal
    ahead = math.cos(node[2]) * (goal.x - node[0]) + math.sin(node[2]) * (goal.y - node[1]) >= 0.0
    for first in (True, False):
        manoeuvre = FORWARD if first == ahead else REVERSE
        if manoeuvre == REVERSE and model.limits.v_min == 0.0:
            continue
        control = (0.0, 0.0, manoeuvre)
        steps, outcome, state, pose = drive_safely(node, control, model, view, answers, answered, scratch)
        if outcome == ASK:
            return Extension(ASK, 0, node, (0.0, 0.0), pose)
        if outcome == EXTENDED and in_goal(goal, state[0], state[1], state[2], state[3], state[4]):
            return Extension(EXTENDED, steps, state, (0.0, 0.0), control)
    return Extension(BLOCKED, 0, node, (0.0, 0.0), (0.0, 0.0, 0.0))


@njit(cache=True)
def brake(
    state: tuple[float, float, float, float, float],
    model: Model,
    view: MapView,
    answers: NDArray[np.float64],
    answered: int,
    scratch: NDArray[np.float64],
) -> tuple[int, tuple[float, float, float]]:
    """Brake to rest from a valid state: `EXTENDED` (free), `BLOCKED` or `ASK`, and the pose that FCL must decide."""
    stopping_distance = abs(state[3]) * (0.5 * stopping_time(state[3], state[4], model.limits) + model.dt)
    if certify(view, state[0], state[1], ROOM) > stopping_distance:
        return EXTENDED, (0.0, 0.0, 0.0)
    _, outcome, _, pose = roll_out(state, (0.0, 0.0, BRAKE), model, view, answers, answered, scratch)
    return outcome, pose


@njit(cache=True)
def drive_safely(
    node: tuple[float, float, float, float, float],
    control: tuple[float, float, float],
    model: Model,
    view: MapView,
    answers: NDArray[np.float64],
    answered: int,
    scratch: NDArray[np.float64],
) -> tuple[int, int, tuple[float, float, float, float, float], tuple[float, float, float]]:
    """:func:`roll_out`, cut before the first step whose end leaves no room to brake where the model is brake-safe.

    Robots whose velocities jump stop on the spot, so that nothing is cut.
    """
    steps, outcome, end, pose = roll_out(node, control, model, view, answers, answered, scratch)
    if not model.brake_safe or model.law == STEERING or outcome == ASK or (outcome == BLOCKED and not model.keep_cut):
        return steps, outcome, end, pose
    unchecked = steps
    if not model.keep_cut:  # the end first: it is the likeliest to be refused
        unchecked -= 1
        stops, asked = brake(end, model, view, answers, answered, scratch)
        if stops != EXTENDED:
            return 0, stops, node, asked
    x, y, theta, v, omega = node
    for k in range(unchecked):
        before = (x, y, theta, v, omega)
        x, y, theta, v, omega, _, _ = advance(x, y, theta, v, omega, control, model, model.dt)
        stops, asked = brake((x, y, theta, v, omega), model, view, answers, answered, scratch)
        if stops != EXTENDED:
            return k, stops, before, asked
    return steps, outcome, end, pose


@njit(cache=True)
def is_refused(
    first: int,
    following: NDArray[np.int32],
    commands: NDArray[np.float64],
    v: float,
    omega: float,
    tolerance: float,
) -> bool:
    """Line 5 of Algorithm II: whether a node has a child by (nearly) the same command.

    Args:
        first: index of the node's latest child, -1 if it has none.
        following: the next older sibling of each child, -1 at the end.
        commands: command (v, omega) that made each child, shape (n, 2), [m/s, rad/s].
        v: forward velocity of the new command [m/s].
        omega: turning rate of the new command [rad/s].
        tolerance: eps_u [m/s and rad/s].
    """
    child = first
    while child >= 0:
        if abs(commands[child, 0] - v) <= tolerance and abs(commands[child, 1] - omega) <= tolerance:
            return True
        child = following[child]
    return False


@njit(cache=True)
def candidate(
    index: int,
    node: tuple[float, float, float, float, float],
    reference: tuple[float, float, float],
    model: Model,
) -> tuple[float, float, tuple[float, float, float]]:
    """A command worth trying from a node, and the control that carries it out.

    Args:
        index: 0 for CB-RRT; 0, 1, 2 for the steering rates of S-RRT.
        node: (x, y, theta, v, omega) of the node.
        reference: pose to drive to, [m, m, rad].
        model: how the robot moves.

    Returns:
        The command (v, omega) that line 5 compares, and the control for :func:`advance`.
    """
    if model.law == STEERING:
        v, omega = saturate(model.limits.v_max, steering_rate(index, model.limits), model.limits)
        return v, omega, (v, omega, 0.0)
    v, omega = tracking_command(node[0], node[1], node[2], reference, model.limits, model.gains)
    if model.law == CLOSED_LOOP:
        return v, omega, reference
    return v, omega, (v, omega, 0.0)


@njit(cache=True)
def extend(
    node: tuple[float, float, float, float, float],
    x_sample: float,
    y_sample: float,
    first: int,
    following: NDArray[np.int32],
    commands: NDArray[np.float64],
    model: Model,
    view: MapView,
    answers: NDArray[np.float64],
    answered: int,
    scratch: NDArray[np.float64],
) -> Extension:
    """EXTEND_TRAJECTORY of the paper: from a node towards a sample, or by a final approach to the goal.

    CB-RRT has one candidate. S-RRT tries its three steering rates, leaves out those that the node has used or that
    collide, and takes the one that ends nearest to the reference.

    Args:
        node: (x, y, theta, v, omega) of the node.
        x_sample: the sample [m].
        y_sample: the sample [m].
        first: latest child of the node, see :func:`is_refused`, or `UNTRIED`.
        following: next older sibling of each child.
        commands: command of each child, shape (n, 2).
        model: all settings.
        view: the clearance map.
        answers: what FCL has said in this extension, see :func:`find_answer`.
        answered: rows of ``answers`` in use.
        scratch: room for a block, of shape `SCRATCH_SHAPE`.
    """
    if first == UNTRIED and model.approaches:
        best = approach(node, model, view, answers, answered, scratch)
        if best.outcome != BLOCKED:
            return best
    reference = reference_pose(node[0], node[1], node[2], x_sample, y_sample, model.look_ahead)
    best = Extension(REFUSED, 0, node, (0.0, 0.0), (0.0, 0.0, 0.0))
    nearest = math.inf
    for c in range(CANDIDATES if model.law == STEERING else 1):
        v, omega, control = candidate(c, node, reference, model)
        if is_refused(first, following, commands, v, omega, model.equal_control_tolerance):
            continue
        steps, outcome, state, pose = drive_safely(node, control, model, view, answers, answered, scratch)
        if outcome == ASK:
            return Extension(ASK, 0, node, (v, omega), pose)
        if steps == 0 or (outcome == BLOCKED and not model.keep_cut):
            if best.outcome == REFUSED:
                best = Extension(BLOCKED, 0, node, (v, omega), control)
            continue
        dx, dy = state[0] - reference[0], state[1] - reference[1]
        distance = dx * dx + dy * dy
        if distance < nearest:
            nearest = distance
            best = Extension(EXTENDED, steps, state, (v, omega), control)
    return best


def check_step(robot: Robot, planning: PlanningSettings) -> None:
    """Refuse a step that is too long for the integrator.

    Raises:
        SettingsError: if the robot can turn too far in one step, or change its turn too much.
    """
    limits = robot.limits
    fastest, spread = max(-limits.omega_min, limits.omega_max), limits.omega_max - limits.omega_min
    longest_ramp = max(MAX_CHANGE_PER_STEP / spread, math.sqrt(MAX_CHANGE_PER_STEP / limits.angular_acceleration))
    longest = min(MAX_TURN_PER_STEP / fastest, longest_ramp)
    if planning.step > longest * (1.0 + 1e-9):
        expected = f"at most {longest:.3g} s for a robot that turns at {fastest:.3g} rad/s"
        raise SettingsError(Problem("planning.step", planning.step, expected))


MAX_TURN_PER_STEP = 0.5
"""Largest turn in one integration step [rad]: the error of a step then stays below 1e-5 of its length."""

MAX_CHANGE_PER_STEP = 0.08
"""Largest difference between the turns at a step's first and last turning rate [rad], for the same reason."""
