"""The optimal control problem as the kernels see it: multiple shooting over N intervals of a free duration.

Stage k holds the state z_k = (x, y, theta, v, omega, h) and the control u_k = (a, alpha), constant over the interval;
h is its duration, a state that changes by a given factor from stage to stage, mostly 1. With w_k = (z_k, u_k) the
problem is

    minimise    sum_k l(w_k)
    subject to  z_{k+1} = f(w_k),  g_k(w_k) >= 0,  z_0 given but for h.

Each inequality depends on three neighbouring columns of w_k at most, so that a gradient is three numbers and the place
of the first: on (x, y, theta), on (v, omega, h) or on (h, a, alpha).

A kinematic robot, whose velocities jump, has the same columns: its control is the velocity of the interval, and v and
omega hold the control of the interval before.
"""

from __future__ import annotations

import numpy as np

from cbrrt_ompl.optimise.field import GRID

X, Y, THETA, V, OMEGA, STEP, A, ALPHA = range(8)
"""Columns of a stage: position [m], heading [rad], velocities [m/s, rad/s], h [s], accelerations [m/s^2, rad/s^2]."""

STATES, CONTROLS, COLUMNS = 6, 2, 8
"""Numbers of a state, of a control, and of both."""

POSE_ROWS, VELOCITY_ROWS, CONTROL_ROWS = 0, 1, 2
"""Kinds of inequalities, in the order in which a stage holds them."""

FIRST_COLUMNS = (X, V, STEP)
"""The first of the three columns that each kind depends on."""

MOST_DISCS, MOST_LIMITS = 24, 8
"""Discs of a footprint, and limits of velocities or controls, at most."""

ROWS = MOST_DISCS + 3 + MOST_LIMITS + 4 + MOST_LIMITS + 1
"""Inequalities of a stage at most: discs, goal, velocities, rest, controls, h."""

PROBLEM = np.dtype(
    [
        ("is_kinematic", np.bool_),
        ("discs", np.float64, (MOST_DISCS, 3)),  # (x, y, radius) in the robot's frame [m]
        ("disc_count", np.int64),
        ("velocity_limits", np.float64, (MOST_LIMITS, 3)),  # rows (c, c_v, c_omega): c + c_v v + c_omega omega >= 0
        ("velocity_limit_count", np.int64),
        ("control_limits", np.float64, (MOST_LIMITS, 3)),  # rows (c, c_a, c_alpha): c + c_a a + c_alpha alpha >= 0
        ("control_limit_count", np.int64),
        ("shortest_step", np.float64),  # least h [s]
        ("goal_x", np.float64),  # the goal region, drawn in a little; infinite tolerances leave a condition out
        ("goal_y", np.float64),
        ("goal_tolerance", np.float64),
        ("goal_theta", np.float64),  # with as many full turns as the states have
        ("heading_tolerance", np.float64),
        ("speed_tolerance", np.float64),
        ("duration_weight", np.float64),  # see cbrrt_ompl.optimise.costs
        ("length_weight", np.float64),
        ("room_weight", np.float64),
        ("room_distance", np.float64),
        ("smoothness_a", np.float64),
        ("smoothness_alpha", np.float64),
        ("grid", GRID),  # of the distance field
    ]
)
"""What is to be solved, in one record."""

STAGE = np.dtype(
    [
        ("margin", np.float64),  # distance that the discs keep from everything [m]
        ("speed_cap", np.float64),  # fraction of the velocity limits that may be used
        ("step_ratio", np.float64),  # h of the next stage, in terms of that of this one
        ("state", np.float64, (STATES,)),  # z
        ("control", np.float64, (CONTROLS,)),  # u
        ("costate", np.float64, (STATES,)),  # multipliers p of the dynamics that end here
        ("counts", np.int64, (3,)),  # inequalities of each kind
        ("row_count", np.int64),  # of all kinds
        ("slacks", np.float64, (ROWS,)),  # s > 0, with g(w) = s at a solution
        ("multipliers", np.float64, (ROWS,)),  # m > 0 of the inequalities
        ("values", np.float64, (ROWS,)),  # g
        ("slopes", np.float64, (ROWS, 3)),  # derivatives of g by the three columns of its kind
        ("defect", np.float64, (STATES,)),  # f(w) less the next state
        ("jacobian", np.float64, (STATES, COLUMNS)),  # df/dw
        ("cost_gradient", np.float64, (COLUMNS,)),  # dl/dw
        ("gradient", np.float64, (COLUMNS,)),  # of the barrier problem
        ("hessian", np.float64, (COLUMNS, COLUMNS)),  # of the barrier problem's Lagrangian, lower triangle
        ("to_go", np.float64, (STATES, STATES)),  # P: Hessian of the cost-to-go of the quadratic model
        ("to_go_slope", np.float64, (STATES,)),  # p: its gradient
        ("gain", np.float64, (CONTROLS, STATES)),  # K: feedback of the quadratic model
        ("offset", np.float64, (CONTROLS,)),  # d: its constant part
        ("state_step", np.float64, (STATES,)),  # Newton steps
        ("control_step", np.float64, (CONTROLS,)),
        ("slack_steps", np.float64, (ROWS,)),
        ("multiplier_steps", np.float64, (ROWS,)),
        ("trial_state", np.float64, (STATES,)),  # the point that a line search looks at
        ("trial_control", np.float64, (CONTROLS,)),
        ("trial_slacks", np.float64, (ROWS,)),
        ("trial_values", np.float64, (ROWS,)),
    ]
)
"""One stage: the iterate, and what an iteration writes. The last stage of a problem has no control."""
