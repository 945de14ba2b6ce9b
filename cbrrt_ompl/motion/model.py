"""How an extension is driven: the model that all kernels share, the goal in it, and one step under a control."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cbrrt_ompl.errors import Problem, SettingsError
from cbrrt_ompl.motion.control_laws import steering_rate, tracking_command
from cbrrt_ompl.motion.kinematics import dynamic_step, kinematic_step, saturate
from cbrrt_ompl.motion.manoeuvres import BRAKE, REVERSE, approach_command, has_ended, is_manoeuvre
from cbrrt_ompl.problem.robot import Gains, Limits, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings

OPEN_LOOP, CLOSED_LOOP, STEERING = 0, 1, 2
"""How an extension is driven: Kanayama law once an extension or at every step (CB-RRT), or at full speed (S-RRT)."""

MAX_TURN_PER_STEP = 0.5
"""Largest turn in one integration step [rad]: the error of a step then stays below 1e-5 of its length."""

MAX_CHANGE_PER_STEP = 0.08
"""Largest difference between the turns at a step's first and last turning rate [rad], for the same reason."""


CANDIDATES = 3
"""Extensions tried for one sample at most: the three steering rates of S-RRT."""


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


def control_dimension(model: NDArray[np.float64]) -> int:
    """Numbers of OMPL's controls under a packed model: (v, omega), a reference pose, or room for a manoeuvre's mark."""
    return 3 if int(model[0]) == CLOSED_LOOP or model[6] else 2


def law_of(planner: str, planning: PlanningSettings) -> int:
    """How a planner drives: `STEERING`, `CLOSED_LOOP` or `OPEN_LOOP` (as OMPL's own planners do)."""
    if planner.startswith("s-rrt"):
        return STEERING
    return CLOSED_LOOP if planner.startswith("cb-rrt") and planning.closed_loop else OPEN_LOOP


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
    """Whether a manoeuvre is over, see :func:`cbrrt_ompl.motion.manoeuvres.has_ended`."""
    return has_ended(manoeuvre, state, (goal.x, goal.y, goal.theta), goal.heading_tolerance < math.inf)


@njit(cache=True)
def has_come_to_end(
    state: tuple[float, float, float, float, float], control: tuple[float, float, float], model: Model
) -> bool:
    """Whether a roll-out ends at a state before its last step: in the goal region, or with its manoeuvre."""
    if is_manoeuvre(control):
        return manoeuvre_has_ended(control[2], state, model.goal)
    return in_goal(model.goal, state[0], state[1], state[2], state[3], state[4])
