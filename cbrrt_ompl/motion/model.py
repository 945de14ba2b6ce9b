"""How an extension is driven: the model that all kernels share, the goal in it, and one step under a control."""

from __future__ import annotations

import math

import numpy as np

from cbrrt_ompl.errors import Problem, SettingsError
from cbrrt_ompl.kernels import kernel
from cbrrt_ompl.motion.control_laws import steering_rate, tracking_command
from cbrrt_ompl.motion.kinematics import dynamic_step, kinematic_step, saturate
from cbrrt_ompl.motion.laws import GAINS, LIMITS, law_address
from cbrrt_ompl.motion.manoeuvres import BRAKE, REVERSE, approach_command, has_ended, is_manoeuvre
from cbrrt_ompl.motion.records import Record, Records, record_array
from cbrrt_ompl.problem.robot import Gains, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, goal_distance, heading_error

OPEN_LOOP, CLOSED_LOOP, STEERING = 0, 1, 2
"""How an extension is driven: Kanayama law once an extension or at every step (CB-RRT), or at full speed (S-RRT)."""

ROOM = 5e-4
"""Distance that planned motions keep from everything at least [m]; poses by themselves only have to be free."""

CLEARANCE_DIP = 1e-5
"""What points of a motion keep more than a clearance that is asked for, see :func:`motion_room` [m]."""

MAX_TURN_PER_STEP = 0.5
"""Largest turn in one integration step [rad]: the error of a step then stays below 1e-5 of its length."""

MAX_CHANGE_PER_STEP = 0.08
"""Largest difference between the turns at a step's first and last turning rate [rad], for the same reason."""


CANDIDATES = 3
"""Extensions tried for one sample at most: the three steering rates of S-RRT."""


GOAL_REGION = np.dtype(
    [
        ("x", np.float64),  # centre [m]
        ("y", np.float64),
        ("tolerance", np.float64),  # radius [m]
        ("theta", np.float64),  # heading [rad]
        ("heading_tolerance", np.float64),  # infinite where the heading is free [rad]
        ("speed_tolerance", np.float64),  # infinite where the speeds are free [m/s and rad/s]
    ],
    align=True,
)
"""The goal as the kernels see it."""

MODEL = np.dtype(
    [
        ("law", np.int64),  # OPEN_LOOP, CLOSED_LOOP or STEERING
        ("law_address", np.int64),  # of a control law in the place of Kanayama's, see motion.laws; else 0
        ("jumps", np.bool_),  # whether the velocities jump to their commands
        ("dt", np.float64),  # integration step [s]
        ("steps", np.int64),  # of a whole extension
        ("look_ahead", np.float64),  # largest distance of the reference from its node [m]
        ("equal_control_tolerance", np.float64),  # eps_u of Algorithm II, line 5 [m/s and rad/s]
        ("room", np.float64),  # distance that every point of a motion keeps from everything [m]
        ("keep_cut", np.bool_),  # whether the free part of an extension that meets an obstacle is kept
        ("approaches", np.bool_),  # whether a final approach to the goal is tried from every node
        ("brake_safe", np.bool_),  # whether the robot must be able to brake to rest from every state
        ("limits", LIMITS),
        ("gains", GAINS),
        ("goal", GOAL_REGION),
    ],
    align=True,
)
"""All that an extension depends on besides node, sample and world."""


def make_model(law: int, robot: Robot, goal: Goal, planning: PlanningSettings) -> Records:
    """The model that kernels read.

    Args:
        law: `OPEN_LOOP`, `CLOSED_LOOP` or `STEERING`.
        robot: limits and gains; the paper's gains where none are given.
        goal: goal region.
        planning: settings.

    Returns:
        One record of type `MODEL`, shape (1,): an array, since numba takes one from Python at the least cost.
    """
    model = record_array(1, MODEL)
    model["law"], model["dt"], model["steps"] = law, planning.step, planning.steps
    model["law_address"] = law_address(planning.law)
    model["jumps"] = jumps(law, robot)
    model["look_ahead"] = planning.reference_distance(robot.limits)
    model["equal_control_tolerance"] = planning.equal_control_tolerance
    model["room"] = motion_room(planning.clearance)
    model["keep_cut"] = planning.cut_extension == "keep"
    model["approaches"], model["brake_safe"] = planning.approaches(goal), planning.brake_safe
    model["limits"] = tuple(robot.limits)
    model["gains"] = tuple(Gains() if robot.gains is None else robot.gains)
    model["goal"] = (
        goal.x,
        goal.y,
        goal.tolerance,
        0.0 if goal.theta is None else goal.theta,
        math.inf if goal.theta is None else goal.heading_tolerance,
        math.inf if goal.speed_tolerance is None else goal.speed_tolerance,
    )
    return model


def jumps(law: int, robot: Robot) -> bool:
    """Whether velocities jump to their commands: those of S-RRT, and all of a robot of first order."""
    return law == STEERING or robot.limits.is_first_order


def motion_room(clearance: float) -> float:
    """Distance that the checked points of a motion keep, for a clearance that all of it is to have [m].

    Points a millimetre apart are checked. Between two of them a motion may come nearer by some micrometres where it
    passes a corner: `CLEARANCE_DIP` is more than that for any clearance above `ROOM`.
    """
    return ROOM if clearance <= ROOM - CLEARANCE_DIP else clearance + CLEARANCE_DIP


def check_step(robot: Robot, planning: PlanningSettings) -> None:
    """Refuse a step that is too long for the integrator.

    Raises:
        SettingsError: if the robot can turn too far in one step, or change its turn too much.
    """
    limits = robot.limits
    fastest, spread = max(-limits.omega_min, limits.omega_max), limits.omega_max - limits.omega_min
    longest_ramp = max(MAX_CHANGE_PER_STEP / spread, math.sqrt(MAX_CHANGE_PER_STEP / limits.angular_acceleration))
    longest = min(MAX_TURN_PER_STEP / fastest, math.inf if limits.is_first_order else longest_ramp)
    if planning.step > longest * (1.0 + 1e-9):
        expected = f"at most {longest:.3g} s for a robot that turns at {fastest:.3g} rad/s"
        raise SettingsError(Problem("planning.step", planning.step, expected))


_goal_distance, _heading_error = kernel(goal_distance), kernel(heading_error)


@kernel
def in_goal(goal: Record, x: float, y: float, theta: float, v: float, omega: float) -> bool:
    """Whether a state satisfies the goal, a record of type `GOAL_REGION`."""
    if not _goal_distance(goal, x, y) < goal.tolerance:
        return False
    if goal.heading_tolerance < math.inf and _heading_error(goal, theta) > goal.heading_tolerance:
        return False
    return abs(v) <= goal.speed_tolerance and abs(omega) <= goal.speed_tolerance


@kernel(inline="always")  # a call costs as much as the step itself
def advance(
    x: float,
    y: float,
    theta: float,
    v: float,
    omega: float,
    control: tuple[float, float, float],
    model: Record,
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
        model: how the robot moves, a record of type `MODEL`.
        dt: duration of the step [s].

    Returns:
        (x, y, theta, v, omega) one step later, and the command (v, omega) of the step, which the wheels can do.
    """
    if is_manoeuvre(control):
        command = manoeuvre_command((x, y, theta, v, omega), control[2], model)
    elif model.law == CLOSED_LOOP:
        command = tracking_command(x, y, theta, control, model.limits, model.gains, model.law_address)
    else:
        command = (control[0], control[1])
    command = saturate(command[0], command[1], model.limits)
    if model.jumps:
        x, y, theta, v, omega = kinematic_step(x, y, theta, command, dt)
    else:
        x, y, theta, v, omega = dynamic_step(x, y, theta, v, omega, command, model.limits, dt)
    return x, y, theta, v, omega, command[0], command[1]


@kernel
def candidate(
    index: int,
    node: tuple[float, float, float, float, float],
    reference: tuple[float, float, float],
    model: Record,
) -> tuple[float, float, tuple[float, float, float]]:
    """A command worth trying from a node, and the control that carries it out.

    Args:
        index: 0 for CB-RRT; 0, 1, 2 for the steering rates of S-RRT.
        node: (x, y, theta, v, omega) of the node.
        reference: pose to drive to, [m, m, rad].
        model: how the robot moves, a record of type `MODEL`.

    Returns:
        The command (v, omega) that line 5 compares, and the control for :func:`advance`.
    """
    if model.law == STEERING:
        v, omega = saturate(model.limits.v_max, steering_rate(index, model.limits), model.limits)
        return v, omega, (v, omega, 0.0)
    v, omega = tracking_command(node[0], node[1], node[2], reference, model.limits, model.gains, model.law_address)
    if model.law == CLOSED_LOOP:
        return v, omega, reference
    return v, omega, (v, omega, 0.0)


@kernel
def manoeuvre_command(
    state: tuple[float, float, float, float, float], manoeuvre: float, model: Record
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
        model.jumps,
        model.limits,
        model.dt,
    )


@kernel
def manoeuvre_has_ended(manoeuvre: float, state: tuple[float, float, float, float, float], goal: Record) -> bool:
    """Whether a manoeuvre is over, see :func:`cbrrt_ompl.motion.manoeuvres.has_ended`."""
    return has_ended(manoeuvre, state, (goal.x, goal.y, goal.theta), goal.heading_tolerance < math.inf)
