"""From a scenario to the optimal control problem that the kernels solve, and back to a trajectory."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.kernels import kernel
from cbrrt_ompl.motion.kinematics import clamp, unicycle_step
from cbrrt_ompl.motion.records import Record, record_array
from cbrrt_ompl.optimise.clearance import least_clearance
from cbrrt_ompl.optimise.cover import cover
from cbrrt_ompl.optimise.field import field_of
from cbrrt_ompl.optimise.guess import Duals, Guess
from cbrrt_ompl.optimise.inequalities import lay_out_rows
from cbrrt_ompl.optimise.interior_point import PROGRESS, SOLVE_RUNNING, iterate
from cbrrt_ompl.optimise.objective import Objective
from cbrrt_ompl.optimise.program import OMEGA, PROBLEM, STAGE, STEP, THETA, V
from cbrrt_ompl.problem.robot import Limits, decelerations
from cbrrt_ompl.problem.settings import Goal
from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.trajectory.trajectory import Trajectory

INSIDE = 1.0 - 1e-6
"""Fraction of a limit that is used: the solver is precise to 1e-5, and the roll-out clamps the rest."""

SPARE_MARGIN = 0.002
"""What the discs keep beyond the least clearance at first [m]: they do not cover all, nor does the field know all."""

SPARE_FRACTION, SPARE_TOLERANCE = 0.1, 0.002
"""What is left unused of a tolerance of the goal: this fraction, or this much where it is less [m, rad, m/s, rad/s]."""

REGULARISATION = 2e-3
"""Smoothness that the solver adds to every objective: it picks one of many motions that take the same time."""

FIRST_BARRIER, LEAST_SLACK = 0.002, 0.05
"""Barrier parameter to start with from a mere guess, and what a slack starts with at least.

Each of some thousand inequalities costs about the parameter in seconds: from 0.03 on, the solver first made a motion of
half a minute half as long again, and took as many steps to come back.
"""

LEAST_WARM_SLACK = 10.0
"""The same in terms of the barrier parameter, from a solution of a like problem."""

SHORTEST_STEP = 1e-3
"""Least duration of an interval [s]."""

ITERATIONS_AT_ONCE = 16
"""Newton steps between two looks at the clock."""

MOST_ROWS = 1000
"""Rows of a trajectory for the shortest interval at most, however short the planners' step is."""


@dataclass
class Solution:
    """What the solver made of a guess."""

    guess: Guess
    """States and controls, to start from again."""
    infeasibility: float
    """Largest violation of a constraint [m, rad, m/s, rad/s]."""
    cost: float
    """What it costs at least without the regularisation, which is at most a fraction of that [s]."""
    iterations: int
    """Newton steps that it took."""


class Transcription:
    """The problem of one scenario; margins and speed caps differ from solution to solution."""

    def __init__(self, scenario: Scenario, objective: Objective, *, is_kinematic: bool = False) -> None:
        """Gather what does not change."""
        self.scenario, self.objective, self.is_kinematic = scenario, objective, is_kinematic
        limits = scenario.robot.limits
        velocities, accelerations = velocity_rows(limits), acceleration_rows(limits)
        problem = record_array(1, PROBLEM)[0]
        fill_rows(problem, "velocity_limit", np.empty((0, 3)) if is_kinematic else velocities)
        fill_rows(problem, "control_limit", velocities if is_kinematic else accelerations)
        fill_rows(problem, "disc", cover(scenario.robot.footprint))
        problem["grid"], self._distances = field_of(scenario.world)
        problem["is_kinematic"], problem["shortest_step"] = is_kinematic, SHORTEST_STEP
        self._problem, self._goal_theta = problem, scenario.goal.theta or 0.0
        fill_goal(problem, scenario.goal)
        if is_kinematic:  # it stops on the spot, afterwards
            problem["speed_tolerance"] = math.inf
        fill_weights(problem, objective, limits)
        self.margin = least_clearance(scenario) + SPARE_MARGIN

    def solve(
        self,
        guess: Guess,
        margins: NDArray[np.float64],
        speed_caps: NDArray[np.float64],
        last_barrier: float,
        may_iterate: Callable[[int], int],
        barrier: float | None = None,
    ) -> Solution:
        """Improve a guess.

        Args:
            guess: states and controls; one that knows its duals is taken for nearly a solution.
            margins: distance to keep at each state, shape (N + 1,) [m].
            speed_caps: fraction of the velocity limits to use at each state, shape (N + 1,).
            last_barrier: last value of the barrier parameter, see :mod:`cbrrt_ompl.optimise.interior_point`.
            may_iterate: takes the number of Newton steps so far and says how many more there may be.
            barrier: its first value for a guess that knows its duals; the last one if not given.
        """
        stages, multiples = record_array(len(guess.states), STAGE), guess.multiples
        stages["state"] = guess.states
        stages["state"][:-1, STEP] = multiples * (guess.duration / multiples.sum())
        stages["state"][-1, STEP] = stages["state"][-2, STEP]
        stages["step_ratio"], stages["step_ratio"][:-2] = 1.0, multiples[1:] / multiples[:-1]
        stages["control"][:-1] = guess.states[1:, V : OMEGA + 1] if self.is_kinematic else guess.controls
        stages["margin"], stages["speed_cap"] = margins, speed_caps
        progress = record_array(1, PROGRESS)[0]
        progress["barrier"], progress["least_slack"] = FIRST_BARRIER, LEAST_SLACK
        progress["last_barrier"], progress["penalty"] = last_barrier, 1.0
        if guess.duals is not None:
            barrier = barrier or last_barrier
            progress["barrier"], progress["least_slack"] = barrier, LEAST_WARM_SLACK * barrier
            stages["multipliers"], stages["costate"] = guess.duals
            progress["is_warm"] = True
        turns = round((guess.states[-1, THETA] - self._goal_theta) / math.tau)
        problem, distances = self._problem.copy(), self._distances
        problem["goal_theta"] = self._goal_theta + turns * math.tau  # the solver knows no wrapped angles
        lay_out_rows(problem, stages)
        while progress["status"] <= SOLVE_RUNNING:
            allowed = may_iterate(int(progress["iterations"]))
            if allowed <= 0:
                break
            iterate(problem, distances, stages, progress, min(allowed, ITERATIONS_AT_ONCE))
        duals = Duals(stages["multipliers"].copy(), stages["costate"].copy())
        found = Guess(stages["state"].copy(), stages["control"][:-1].copy(), guess.source, duals)
        cost = float(progress["cost"]) / (1.0 + REGULARISATION)
        return Solution(found, float(progress["infeasibility"]), cost, int(progress["iterations"]))

    def trajectory(self, guess: Guess) -> Trajectory:
        """The motion that the controls of a solution lead to, integrated exactly from the scenario's start.

        Its rows are evenly spaced, at most an integration step apart. A kinematic robot that is to arrive at rest
        stands in one more step.
        """
        rows = self.rows(guess)
        states, dt = self.roll_out(guess, rows), guess.duration / rows.sum()
        most = self.scenario.goal.speed_tolerance
        if self.is_kinematic and most is not None and np.abs(states[-1, 3:]).max() > most:
            states = np.concatenate([states, [[*states[-1, :3], 0.0, 0.0]]])
        commands = np.concatenate([states[1:, 3:], states[-1:, 3:]])
        t: NDArray[np.float64] = dt * np.arange(len(states), dtype=float)
        return Trajectory(t, *states.T, *commands.T, kinematic=self.is_kinematic, limits=self.scenario.robot.limits)

    def roll_out(self, guess: Guess, rows: NDArray[np.int64]) -> NDArray[np.float64]:
        """The states that the controls lead to, with some rows for each interval after that of the start."""
        begin, dt = np.array(self.scenario.start, dtype=float), guess.duration / rows.sum()
        states: NDArray[np.float64] = roll_out_controls(
            begin, guess.controls, dt, rows, self.scenario.robot.limits, self.is_kinematic
        )
        return states

    def rows(self, guess: Guess) -> NDArray[np.int64]:
        """Rows of the trajectory for each interval, after that of the start, shape (N,)."""
        multiples = guess.multiples
        shortest = guess.duration / multiples.sum()
        return multiples * min(max(1, math.ceil(shortest / self.scenario.planning.step - 1e-9)), MOST_ROWS)


def fill_rows(problem: Record, name: str, rows: NDArray[np.float64]) -> None:
    """Enter rows of three numbers and their count into the record of a problem."""
    problem[f"{name}s"][: len(rows)], problem[f"{name}_count"] = rows, len(rows)


def fill_goal(problem: Record, goal: Goal) -> None:
    """Enter the goal region, drawn in so that rounding does not leave it."""

    def drawn_in(tolerance: float) -> float:
        return tolerance - min(SPARE_FRACTION * tolerance, SPARE_TOLERANCE)

    problem["goal_x"], problem["goal_y"], problem["goal_tolerance"] = goal.x, goal.y, drawn_in(goal.tolerance)
    problem["heading_tolerance"] = math.inf if goal.theta is None else drawn_in(goal.heading_tolerance)
    problem["speed_tolerance"] = math.inf if goal.speed_tolerance is None else drawn_in(goal.speed_tolerance)


def velocity_rows(limits: Limits) -> NDArray[np.float64]:
    """Rows (c, c_v, c_omega) with c + c_v v + c_omega omega >= 0 within all limits, shape (n, 3)."""
    rows = [
        (limits.v_max, -1.0, 0.0),
        (-limits.v_min, 1.0, 0.0),
        (limits.omega_max, 0.0, -1.0),
        (-limits.omega_min, 0.0, 1.0),
    ]
    return _inside([*rows, *_wheel_rows(limits.wheel_speed, limits)])


def acceleration_rows(limits: Limits) -> NDArray[np.float64]:
    """Rows (c, c_a, c_alpha) with c + c_a a + c_alpha alpha >= 0 within all limits, shape (n, 3)."""
    slower, turns_slower = decelerations(limits)
    rise, fall = _changes(limits.v_min, limits.acceleration, slower)
    turn_rise, turn_fall = _changes(limits.omega_min, limits.angular_acceleration, turns_slower)
    rows = [(rise, -1.0, 0.0), (fall, 1.0, 0.0), (turn_rise, 0.0, -1.0), (turn_fall, 0.0, 1.0)]
    return _inside([*rows, *_wheel_rows(limits.wheel_acceleration, limits)])


def _changes(lowest: float, faster: float, slower: float) -> tuple[float, float]:
    """Largest rates at which a velocity rises and falls: the lesser one for both where it may have either sign."""
    return (faster, slower) if lowest == 0.0 else (min(faster, slower), min(faster, slower))


def _wheel_rows(most: float, limits: Limits) -> list[tuple[float, float, float]]:
    """Both signs of both wheels: |c_v| + |c_omega| wheel_separation / 2 at most some limit."""
    arm = 0.5 * limits.wheel_separation
    return [(most, a, b * arm) for a in (-1.0, 1.0) for b in (-1.0, 1.0)] if most < math.inf else []


def _inside(rows: list[tuple[float, float, float]]) -> NDArray[np.float64]:
    """The rows with their limits drawn in by rounding."""
    limits = np.array(rows)
    limits[:, 0] *= INSIDE
    return limits


def fill_weights(problem: Record, objective: Objective, limits: Limits) -> None:
    """Enter the weights of an objective for one robot, and the regularisation."""
    problem["duration_weight"], problem["length_weight"] = objective.duration, objective.length
    problem["room_weight"], problem["room_distance"] = objective.room, objective.room_distance
    smoothness = 2.0 * objective.smoothness + REGULARISATION * (objective.duration + objective.length * limits.v_max)
    a_max, alpha_max = limits.acceleration, limits.angular_acceleration
    if problem["is_kinematic"]:
        a_max, alpha_max = limits.v_max - limits.v_min, limits.omega_max - limits.omega_min
    problem["smoothness_a"], problem["smoothness_alpha"] = smoothness / a_max**2, smoothness / alpha_max**2


@kernel
def roll_out_controls(
    begin: NDArray[np.float64],
    controls: NDArray[np.float64],
    dt: float,
    rows: NDArray[np.int64],
    limits: Limits,
    is_kinematic: bool,
) -> NDArray[np.float64]:
    """States (x, y, theta, v, omega) under controls, some rows a control, the limits of the velocities kept."""
    total, written = 1, 0
    for k in range(len(rows)):  # by rows.sum() the kernel would take a fifth of a second to load
        total += rows[k]
    states = np.empty((total, 5))
    states[0] = begin
    x, y, theta, v, omega = begin[0], begin[1], begin[2], begin[3], begin[4]
    for k in range(len(controls)):
        v_before, omega_before, first, second = v, omega, controls[k, 0], controls[k, 1]
        for i in range(1, rows[k] + 1):
            if is_kinematic:
                v_next, omega_next = first, second
            else:
                v_next, omega_next = v_before + first * dt * i, omega_before + second * dt * i
            v_next = clamp(v_next, limits.v_min, limits.v_max)
            omega_next = clamp(omega_next, limits.omega_min, limits.omega_max)
            if is_kinematic:
                v, omega = v_next, omega_next
            x, y, theta = unicycle_step(x, y, theta, v, omega, v_next, omega_next, dt)
            v, omega = v_next, omega_next
            written += 1
            row = states[written]
            row[0], row[1], row[2], row[3], row[4] = x, y, theta, v, omega
    return states
