"""The state space SE(2) x R^2, position-only in its metric, and the control spaces on it."""

from __future__ import annotations

from typing import Any

from cbrrt_ompl.collision.world import Bounds
from cbrrt_ompl.motion.kinematics import wrap_angle
from cbrrt_ompl.ompl_plugin.binding import ob, oc
from cbrrt_ompl.problem.robot import Limits
from cbrrt_ompl.problem.settings import State

STATE_DIMENSION = 5
"""Reals of a state: x, y, theta, v, omega."""


def make_state_space(bounds: Bounds, limits: Limits) -> Any:
    """A flat compound [R^2 (x, y), SO(2), R^2 (v, omega)] with weights 1, 0, 0 and the projection to (x, y).

    The weights make OMPL's nearest neighbour the paper's, which looks at positions alone. The components are those of
    `SE2StateSpace` objects, made in C++: a component made in Python would pay a look-up at every virtual call.

    Args:
        bounds: range of (x, y).
        limits: ranges of v and omega.

    Returns:
        An ``ompl.base.CompoundStateSpace``, locked, not set up yet.
    """
    poses, twists = ob.SE2StateSpace(), ob.SE2StateSpace()
    poses.setBounds(_bounds(bounds.min, bounds.max))
    twists.setBounds(_bounds((limits.v_min, limits.omega_min), (limits.v_max, limits.omega_max)))
    space = ob.CompoundStateSpace()
    space.setName("SE2xR2")
    space.addSubspace(poses.getSubspace(0), 1.0)
    space.addSubspace(poses.getSubspace(1), 0.0)
    space.addSubspace(twists.getSubspace(0), 0.0)
    space.lock()
    space.registerDefaultProjection(
        ob.SubspaceProjectionEvaluator(space, 0)
    )  # before the set-up: afterwards OMPL would crash on it
    return space


def make_control_space(space: Any, limits: Limits, has_manoeuvres: bool = False) -> Any:
    """Velocity commands (v, omega) in R^2, within the velocity ranges.

    Args:
        space: the state space.
        limits: ranges of v and omega.
        has_manoeuvres: whether a third number, from 0 to 1 and without meaning, makes room for the marks of
            :mod:`cbrrt_ompl.motion.manoeuvres`, which are outside of that range.
    """
    low: tuple[float, ...] = (limits.v_min, limits.omega_min)
    high: tuple[float, ...] = (limits.v_max, limits.omega_max)
    if has_manoeuvres:
        low, high = (*low, 0.0), (*high, 1.0)
    controls = oc.RealVectorControlSpace(space, len(low))
    controls.setBounds(_bounds(low, high))
    return controls


def make_reference_space(space: Any, bounds: Bounds) -> Any:
    """References (x_r, y_r, theta_r) in R^3: the control of the closed loop."""
    controls = oc.RealVectorControlSpace(space, 3)
    controls.setBounds(_bounds((*bounds.min, -3.141592653589793), (*bounds.max, 3.141592653589793)))
    return controls


def set_state(state: Any, values: State) -> None:
    """Write a state number by number: slow, and simple. The heading is wrapped."""
    state[0][0], state[0][1] = values.x, values.y
    state[1].value = wrap_angle(values.theta)
    state[2][0], state[2][1] = values.v, values.omega


def _bounds(low: tuple[float, ...], high: tuple[float, ...]) -> Any:
    bounds = ob.RealVectorBounds(len(low))
    for i, (a, b) in enumerate(zip(low, high, strict=True)):
        bounds.setLow(i, a)
        bounds.setHigh(i, b)
    return bounds
