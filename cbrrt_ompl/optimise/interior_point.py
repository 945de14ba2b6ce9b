"""A primal-dual interior point method for the optimal control problem, in compiled code.

Each inequality g(w) >= 0 gets a slack s > 0 with g(w) = s and a multiplier m with s m = mu, and mu goes to 0. Newton
steps of these conditions, with the exact Hessian of the Lagrangian, are linear-quadratic problems
(:mod:`cbrrt_ompl.optimise.riccati`); their length is found by a line search on the merit function

    cost - mu sum log s + nu (sum |f(w) - z| + sum |g(w) - s|).

It is the method of Waechter and Biegler, "On the implementation of an interior-point filter line-search algorithm for
large-scale nonlinear programming", Mathematical Programming 106 (1), 2006, with this merit function in place of the
filter, in a line search that is not monotone near the end (Grippo, Lampariello and Lucidi, "A nonmonotone line search
technique for Newton's method", SIAM Journal on Numerical Analysis 23 (4), 1986). That its linear systems are Riccati
recursions is shown by Rao, Wright and Rawlings, "Application of interior-point methods to model predictive control",
Journal of Optimization Theory and Applications 99 (3), 1998.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.kernels import inner_kernel, kernel
from cbrrt_ompl.motion.records import Record, Records
from cbrrt_ompl.optimise.costs import add_cost_derivatives, stage_cost
from cbrrt_ompl.optimise.dynamics import add_derivatives, interval_end
from cbrrt_ompl.optimise.inequalities import add_row_derivatives, evaluate_rows
from cbrrt_ompl.optimise.program import COLUMNS, CONTROLS, FIRST_COLUMNS, STATES, STEP
from cbrrt_ompl.optimise.riccati import factorise, roll_out_step

SOLVE_NEW, SOLVE_RUNNING, SOLVE_CONVERGED, SOLVE_STUCK, SOLVE_SINGULAR = range(5)
"""State of a solution: not begun, under way, converged, no step helps, or no shift makes the problem convex."""

MEMORY = 5
"""Iterates whose merits a line search compares with: the largest of them may be reached again. Along a long way full
steps are good and yet raise the merit for a while, since the motion is not linear in the headings."""

MEMORY_BARRIER = 1e-3
"""mu above which only the last one counts: far from a solution such steps lead astray."""

PROGRESS = np.dtype(
    [
        ("status", np.int64),
        ("iterations", np.int64),
        ("barrier", np.float64),  # mu
        ("last_barrier", np.float64),  # mu at which to end
        ("least_slack", np.float64),  # what a slack starts with at least
        ("is_warm", np.bool_),  # whether the stages hold multipliers and costates of a like problem's solution
        ("penalty", np.float64),  # nu
        ("merits", np.float64, (MEMORY,)),  # of the last iterates under this mu and nu
        ("merits_barrier", np.float64),  # mu and nu of those
        ("merits_penalty", np.float64),
        ("damping", np.float64),  # shift that short steps of the line search ask for
        ("last_shift", np.float64),  # shift that made the problem convex the last time
        ("failures", np.int64),  # line searches in a row that found nothing
        ("violation", np.float64),  # sum of |f(w) - z| and |g(w) - s| at the iterate
        ("infeasibility", np.float64),  # largest of them
        ("stationarity", np.float64),  # largest derivative of the Lagrangian
        ("least_product", np.float64),  # least and largest s m
        ("largest_product", np.float64),
        ("cost", np.float64),
        ("logarithms", np.float64),  # sum of log s
        ("trial_violation", np.float64),  # the same of the point that the line search looks at
        ("trial_cost", np.float64),
        ("trial_logarithms", np.float64),
    ]
)
"""Where a solution stands: a record."""

LARGEST_INFEASIBILITY = 1e-5
"""Violation of a constraint with which a solution has converged [m, rad, m/s, rad/s]."""

LARGEST_STATIONARITY = 1e-2
"""Derivative of the Lagrangian with which a solution has converged."""

BARRIER_FACTOR, BARRIER_POWER = 0.2, 1.5
"""mu becomes the smaller of 0.2 mu and mu^1.5 when its problem is solved to 10 mu."""

LARGEST_IMBALANCE = 10.0
"""How far s m may be from mu at a warm start."""

HALVINGS = 7
"""Times that a line search shortens a step before it gives up."""

MOST_FAILURES = 8
"""Line searches in a row that may find nothing."""

LARGEST_SHIFT = 1e10
"""Shift of the Hessian at which to give up."""


@kernel
def iterate(
    problem: Record, distances: NDArray[np.float32], stages: Records, progress: Record, iterations: int
) -> None:
    """Do some Newton steps, unless the solution converges before or no step helps any more."""
    if progress.status == SOLVE_NEW:
        enter_slacks(problem, distances, stages, progress)
    for _ in range(iterations):
        evaluate(problem, distances, stages, progress)
        update_barrier(progress)
        if progress.status != SOLVE_RUNNING:
            return
        progress.iterations += 1
        condense(stages, progress.barrier)
        if not solve_step(stages, progress):
            progress.status = SOLVE_SINGULAR
            return
        move(problem, distances, stages, progress)
        if progress.status != SOLVE_RUNNING:
            return


@inner_kernel
def enter_slacks(problem: Record, distances: NDArray[np.float32], stages: Records, progress: Record) -> None:
    """Set slacks and multipliers for the states and controls in the stages; known multipliers as far as s m allows."""
    last = len(stages) - 1
    for k in range(last + 1):
        stage = stages[k]
        evaluate_rows(problem, distances, stage, k == 0, k == last, stage.state, stage.control, stage.values)
        for i in range(stage.row_count):
            slack = max(stage.values[i], progress.least_slack)
            multiplier = progress.barrier / slack
            if progress.is_warm:
                known = stage.multipliers[i]
                multiplier = min(max(known, multiplier / LARGEST_IMBALANCE), multiplier * LARGEST_IMBALANCE)
            stage.slacks[i], stage.multipliers[i] = slack, multiplier
    progress.status = SOLVE_RUNNING


@inner_kernel
def evaluate(problem: Record, distances: NDArray[np.float32], stages: Records, progress: Record) -> None:
    """Write all derivatives at the iterate, and how far it is from a solution."""
    last = len(stages) - 1
    progress.violation = progress.infeasibility = progress.stationarity = progress.cost = progress.logarithms = 0.0
    progress.least_product, progress.largest_product = math.inf, 0.0
    for k in range(last + 1):
        stage = stages[k]
        for i in range(COLUMNS):
            stage.cost_gradient[i] = 0.0
            for j in range(i + 1):
                stage.hessian[i, j] = 0.0
        add_row_derivatives(problem, distances, stage, k == 0, k == last)
        if k < last:
            add_derivatives(
                problem.is_kinematic,
                stage.state,
                stage.control,
                stage.step_ratio,
                stages[k + 1].costate,
                stage.jacobian,
                stage.hessian,
                stage.defect,
            )
            progress.cost += add_cost_derivatives(problem, distances, stage)
            for i in range(STATES):
                stage.defect[i] -= stages[k + 1].state[i]
                progress.violation += abs(stage.defect[i])
                progress.infeasibility = max(progress.infeasibility, abs(stage.defect[i]))
        judge_stage(stage, stages[min(k + 1, last)].costate, k == 0, k == last, progress)


@inner_kernel
def judge_stage(
    stage: Record, costate_after: NDArray[np.float64], is_first: bool, is_last: bool, progress: Record
) -> None:
    """Enter a stage's violations, products s m and derivatives of the Lagrangian, dl/dw - G' m + J' p_after - p.

    Its inequalities' values at the iterate are those of the last trial, or of the start.
    """
    residual, row = stage.gradient, 0  # the gradient of the barrier problem is written later
    for j in range(COLUMNS):
        residual[j] = stage.cost_gradient[j]
    for kind in range(3):
        first = FIRST_COLUMNS[kind]
        for _ in range(stage.counts[kind]):
            slack, multiplier = stage.slacks[row], stage.multipliers[row]
            for j in range(3):
                residual[first + j] -= stage.slopes[row, j] * multiplier
            miss, product = abs(stage.values[row] - slack), slack * multiplier
            progress.violation += miss
            progress.infeasibility = max(progress.infeasibility, miss)
            progress.least_product = min(progress.least_product, product)
            progress.largest_product = max(progress.largest_product, product)
            progress.logarithms += math.log(slack)
            row += 1
    for j in range(STEP if is_first else 0, STATES if is_last else COLUMNS):
        value = residual[j]
        if not is_last:
            for i in range(STATES):
                value += stage.jacobian[i, j] * costate_after[i]
        if not is_first and j < STATES:
            value -= stage.costate[j]
        progress.stationarity = max(progress.stationarity, abs(value))


@inner_kernel
def update_barrier(progress: Record) -> None:
    """Lower mu as often as its problem counts as solved, and see whether that was the last one."""
    while True:
        mu = progress.barrier
        gap = max(progress.largest_product - mu, mu - progress.least_product)
        if mu <= progress.last_barrier:
            if (
                progress.infeasibility < LARGEST_INFEASIBILITY
                and gap < 10.0 * mu
                and progress.stationarity < LARGEST_STATIONARITY
            ):
                progress.status = SOLVE_CONVERGED
            return
        if max(0.1 * progress.stationarity, 5.0 * progress.infeasibility, gap) >= 10.0 * mu:
            return
        progress.barrier = max(progress.last_barrier, min(BARRIER_FACTOR * mu, mu * math.sqrt(mu)))


@inner_kernel
def condense(stages: Records, barrier: float) -> None:
    """Eliminate slacks and multipliers: add G' (m / s) G to the Hessians, and what belongs to it to the gradients."""
    for k in range(len(stages)):
        stage, row = stages[k], 0
        gradient, hessian = stage.gradient, stage.hessian
        for j in range(COLUMNS):
            gradient[j] = stage.cost_gradient[j]
        for kind in range(3):
            first = FIRST_COLUMNS[kind]
            for _ in range(stage.counts[kind]):
                slack, slope = stage.slacks[row], stage.slopes[row]
                weight = stage.multipliers[row] / slack
                push = barrier / slack - weight * (stage.values[row] - slack)
                for i in range(3):
                    gradient[first + i] -= push * slope[i]
                    for j in range(i + 1):
                        hessian[first + i, first + j] += weight * slope[i] * slope[j]
                row += 1


@inner_kernel
def solve_step(stages: Records, progress: Record) -> bool:
    """Find the Newton step, with the smallest shift tried that makes the problem convex."""
    shift = progress.damping if progress.damping > 1e-6 else 0.0
    while not factorise(stages, shift):
        if shift == 0.0:
            shift = max(1e-5, progress.last_shift / 3.0)
        else:
            shift *= 8.0 if progress.last_shift == 0.0 else 4.0
        if shift > LARGEST_SHIFT:
            return False
    if shift > progress.damping:
        progress.last_shift = shift
    roll_out_step(stages)
    return True


@inner_kernel
def step_multipliers(stages: Records, barrier: float) -> tuple[float, float, float]:
    """Write the steps of slacks and multipliers.

    Returns:
        The fractions of the steps that keep 1 % of each slack and of each multiplier, and the derivative of
        cost - mu sum log s along the step.
    """
    keep = max(0.99, 1.0 - barrier)
    primal, dual, slope = 1.0, 1.0, 0.0
    step = np.empty(COLUMNS)
    for k in range(len(stages)):
        stage, row = stages[k], 0
        for j in range(STATES):
            step[j] = stage.state_step[j]
        for j in range(CONTROLS):
            step[STATES + j] = stage.control_step[j]
        if k < len(stages) - 1:
            for j in range(COLUMNS):
                slope += stage.cost_gradient[j] * step[j]
        for kind in range(3):
            first = FIRST_COLUMNS[kind]
            for _ in range(stage.counts[kind]):
                slack, multiplier = stage.slacks[row], stage.multipliers[row]
                change = stage.values[row] - slack
                for j in range(3):
                    change += stage.slopes[row, j] * step[first + j]
                multiplier_change = (barrier - multiplier * change) / slack - multiplier
                stage.slack_steps[row], stage.multiplier_steps[row] = change, multiplier_change
                if change < 0.0:
                    primal = min(primal, -keep * slack / change)
                if multiplier_change < 0.0:
                    dual = min(dual, -keep * multiplier / multiplier_change)
                slope -= barrier * change / slack
                row += 1
    return primal, dual, slope


@inner_kernel
def try_step(
    problem: Record, distances: NDArray[np.float32], stages: Records, progress: Record, fraction: float
) -> None:
    """Write the trial point at a fraction of the step, with its cost, its sum of log s and its violation.

    A slack is raised to the value of its inequality where that is larger: this lowers barrier and violation at once.
    """
    last = len(stages) - 1
    for k in range(last + 1):
        stage = stages[k]
        for i in range(STATES):
            stage.trial_state[i] = stage.state[i] + fraction * stage.state_step[i]
        for i in range(CONTROLS):
            stage.trial_control[i] = stage.control[i] + fraction * stage.control_step[i]
    progress.trial_cost = progress.trial_logarithms = progress.trial_violation = 0.0
    for k in range(last + 1):
        stage = stages[k]
        state, control = stage.trial_state, stage.trial_control
        evaluate_rows(problem, distances, stage, k == 0, k == last, state, control, stage.trial_values)
        for i in range(stage.row_count):
            value = stage.trial_values[i]
            slack = max(stage.slacks[i] + fraction * stage.slack_steps[i], value)
            stage.trial_slacks[i] = slack
            progress.trial_logarithms += math.log(slack)
            progress.trial_violation += abs(value - slack)
        if k < last:
            end = interval_end(problem.is_kinematic, state, control, stage.step_ratio)
            for i in range(STATES):
                progress.trial_violation += abs(end[i] - stages[k + 1].trial_state[i])
            progress.trial_cost += stage_cost(problem, distances, state, control)


@inner_kernel
def move(problem: Record, distances: NDArray[np.float32], stages: Records, progress: Record) -> None:
    """Find how far to go along the step, and go there."""
    mu, violation = progress.barrier, progress.violation
    primal, dual, slope = step_multipliers(stages, mu)
    if violation > 1e-12 and progress.penalty < slope / (0.7 * violation):
        progress.penalty = min(2.0 * slope / (0.7 * violation) + 1.0, 1e8)
    descent = min(slope - progress.penalty * violation, 0.0)
    before = progress.cost - mu * progress.logarithms
    merit = remember_merit(progress, before + progress.penalty * violation)
    fraction, halvings, is_better = primal, 0, False
    while True:
        try_step(problem, distances, stages, progress, fraction)
        reached = progress.trial_cost - mu * progress.trial_logarithms
        allowed = merit + 1e-4 * fraction * descent + 1e-9 * abs(merit)
        is_better = reached + progress.penalty * progress.trial_violation <= allowed
        if is_better or halvings == HALVINGS:
            break
        fraction *= 0.5
        halvings += 1
    if not is_better or fraction < 0.1 * primal:
        progress.damping = max(1e-3, 6.0 * progress.damping)
    elif fraction >= 0.5 * primal:
        progress.damping *= 0.25
    progress.failures = 0 if is_better else progress.failures + 1
    if progress.failures > MOST_FAILURES:
        progress.status = SOLVE_STUCK
    elif is_better or progress.trial_violation <= violation or reached <= before:
        accept(stages, mu, fraction, dual)


@inner_kernel
def remember_merit(progress: Record, merit: float) -> float:
    """Enter the merit of the iterate, and return the largest one to compare with."""
    merits = progress.merits
    mu, nu = progress.barrier, progress.penalty
    if mu > MEMORY_BARRIER or progress.merits_barrier != mu or progress.merits_penalty != nu:
        progress.merits_barrier, progress.merits_penalty = mu, nu
        for i in range(MEMORY):
            merits[i] = merit
    largest = merit
    for i in range(MEMORY - 1, 0, -1):
        merits[i] = merits[i - 1]
        largest = max(largest, merits[i])
    merits[0] = merit
    return largest


@inner_kernel
def accept(stages: Records, barrier: float, fraction: float, dual: float) -> None:
    """Go to the trial point; multipliers move by their own fraction, costates as far as the states."""
    for k in range(len(stages)):
        stage = stages[k]
        for i in range(STATES):
            wanted = stage.to_go_slope[i]
            for j in range(STATES):
                wanted += stage.to_go[i, j] * stage.state_step[j]
            stage.costate[i] += fraction * (wanted - stage.costate[i])
        for i in range(STATES):
            stage.state[i] = stage.trial_state[i]
        for i in range(CONTROLS):
            stage.control[i] = stage.trial_control[i]
        for i in range(stage.row_count):
            slack = stage.trial_slacks[i]
            moved = stage.multipliers[i] + dual * stage.multiplier_steps[i]
            stage.slacks[i], stage.values[i] = slack, stage.trial_values[i]
            stage.multipliers[i] = min(max(moved, 1e-10 * barrier / slack), 1e10 * barrier / slack)
