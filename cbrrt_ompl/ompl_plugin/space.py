"""The state space SE(2) x R^2, position-only in its metric, and the control spaces on it."""

from __future__ import annotations

import math
from typing import Any

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import Problem, Remark, SettingsError
from cbrrt_ompl.motion.kinematics import wrap_angle
from cbrrt_ompl.ompl_plugin.binding import ob, oc
from cbrrt_ompl.ompl_plugin.compiled_methods import use_compiled_methods
from cbrrt_ompl.ompl_plugin.native_space import make_native, make_space_native
from cbrrt_ompl.problem.obstacles import Bounds
from cbrrt_ompl.problem.robot import Limits, Robot
from cbrrt_ompl.problem.settings import State

STATE_DIMENSION = 5
"""Reals of a state: x, y, theta, v, omega."""

LAYOUT = [(ob.STATE_SPACE_REAL_VECTOR, 2), (ob.STATE_SPACE_SO2, 1), (ob.STATE_SPACE_REAL_VECTOR, 2)]
"""Type and dimension of the components of our space."""


BOUNDS_SLACK = 1e-9
"""What a state may exceed its bounds by, for the rounding of an integration step [m, m/s, rad/s]."""


def make_state_space(bounds: Bounds | World, limits: Limits | Robot, compiled: bool | None = None) -> Any:
    """A flat compound [R^2 (x, y), SO(2), R^2 (v, omega)] with weights 1, 0, 0 and the projection to (x, y).

    The weights make OMPL's nearest neighbour the paper's, which looks at positions alone. The components are those of
    `SE2StateSpace` objects, made in C++: a component made in Python would pay a look-up at every virtual call.

    Args:
        bounds: range of (x, y), or the world that has it.
        limits: ranges of v and omega, or the robot that has them.
        compiled: whether OMPL's calls of it are led past Python, see :mod:`cbrrt_ompl.ompl_plugin.compiled_methods`.

    Returns:
        An ``ompl.base.CompoundStateSpace``, locked, not set up yet.
    """
    bounds = bounds.bounds if isinstance(bounds, World) else bounds
    limits = limits.limits if isinstance(limits, Robot) else limits
    poses, twists = ob.SE2StateSpace(), ob.SE2StateSpace()
    poses.setBounds(_bounds(bounds.min, bounds.max))
    twists.setBounds(_bounds((limits.v_min, limits.omega_min), (limits.v_max, limits.omega_max)))
    space = ob.CompoundStateSpace()
    space.setName("SE2xR2")
    space.addSubspace(poses.getSubspace(0), 1.0)
    space.addSubspace(poses.getSubspace(1), 0.0)
    space.addSubspace(twists.getSubspace(0), 0.0)
    space.lock()
    space.computeLocations()  # which copies of reals need before any set-up
    is_compiled = use_compiled_methods(compiled)
    if is_compiled:
        make_space_native(space)
    register_projection(space, is_compiled)  # before the set-up: afterwards OMPL would crash on it
    return space


def register_projection(space: Any, compiled: bool | None = None) -> None:
    """Make the projection to (x, y) the default one of a space of ours."""
    projection = ob.SubspaceProjectionEvaluator(space, 0)
    space.getSubspace(0).setup()  # which makes the projection that this one leads to
    projection.setup()  # else OMPL crashes where it prints a space that is not set up
    space.registerDefaultProjection(make_native(projection) if use_compiled_methods(compiled) else projection)


def make_control_space(
    space: Any, limits: Limits | Robot, has_manoeuvres: bool = False, compiled: bool | None = None
) -> Any:
    """Velocity commands (v, omega) in R^2, within the velocity ranges.

    Args:
        space: the state space.
        limits: ranges of v and omega, or the robot that has them.
        has_manoeuvres: whether a third number, from 0 to 1 and without meaning, makes room for the marks of
            :mod:`cbrrt_ompl.motion.manoeuvres`, which are outside of that range.
        compiled: see :func:`make_state_space`.
    """
    limits = limits.limits if isinstance(limits, Robot) else limits
    low: tuple[float, ...] = (limits.v_min, limits.omega_min)
    high: tuple[float, ...] = (limits.v_max, limits.omega_max)
    if has_manoeuvres:
        low, high = (*low, 0.0), (*high, 1.0)
    return _real_vector_controls(space, low, high, compiled)


def make_reference_space(space: Any, bounds: Bounds, compiled: bool | None = None) -> Any:
    """References (x_r, y_r, theta_r) in R^3: the control of the closed loop."""
    low, high = (*bounds.min, -3.141592653589793), (*bounds.max, 3.141592653589793)
    return _real_vector_controls(space, low, high, compiled)


def _real_vector_controls(space: Any, low: tuple[float, ...], high: tuple[float, ...], compiled: bool | None) -> Any:
    controls = oc.RealVectorControlSpace(space, len(low))
    controls.setBounds(_bounds(low, high))
    return make_native(controls) if use_compiled_methods(compiled) else controls


def read_state(state: Any) -> State:
    """The numbers of an OMPL state of our space by name.

    Args:
        state: what OMPL hands to callbacks and paths hold, or an ``ompl.base.State`` (a scoped state).
    """
    state = state() if isinstance(state, ob.State) else state
    return State(state[0][0], state[0][1], state[1].value, state[2][0], state[2][1])


def write_state(state: Any, values: State) -> None:
    """Set an OMPL state of our space; the heading is wrapped to [-pi, pi).

    Args:
        state: what OMPL hands to callbacks, or an ``ompl.base.State`` (a scoped state).
        values: the numbers by name, such as ``State(x=1.0, y=2.0, theta=0.5)``.
    """
    state = state() if isinstance(state, ob.State) else state
    state[0][0], state[0][1] = values.x, values.y
    state[1].value = wrap_angle(values.theta) if math.isfinite(values.theta) else values.theta
    state[2][0], state[2][1] = values.v, values.omega


def is_within_bounds(space: Any, state: Any) -> bool:
    """Whether a state of our space is within its bounds, give or take `BOUNDS_SLACK`."""
    if space.satisfiesBounds(state):
        return True
    for component in (0, 2):
        bounds = space.getSubspace(component).getBounds()
        for i in range(2):
            if not bounds.low[i] - BOUNDS_SLACK <= state[component][i] <= bounds.high[i] + BOUNDS_SLACK:
                return False
    return bool(space.getSubspace(1).satisfiesBounds(state[1]))


def check_space(space: Any) -> None:
    """Refuse a state space of another layout than ours.

    Raises:
        SettingsError: if it is none of :func:`make_state_space`.
    """
    parts = [space.getSubspace(i) for i in range(space.getSubspaceCount())] if space.isCompound() else []
    if [(part.getType(), part.getDimension()) for part in parts] != LAYOUT:
        expected = "one of make_state_space(world, robot): (x, y), theta, (v, omega)"
        raise SettingsError(Problem("state space", space.getName(), expected))


def check_controls(controls: Any, closed_loop: bool = False) -> None:
    """Refuse a control space of another layout than ours.

    Args:
        controls: the control space.
        closed_loop: whether its controls have to be references.

    Raises:
        SettingsError: if it is no R^2 or R^3, or no R^3 in closed loop.
    """
    if controls.isCompound() or not isinstance(controls, oc.RealVectorControlSpace):
        found, is_known = type(controls).__name__, False
    else:
        dimension = controls.getDimension()
        found, is_known = f"R^{dimension}", dimension == 3 or (dimension == 2 and not closed_loop)
    if not is_known:
        expected = "R^3, references (x, y, theta), in closed loop" if closed_loop else "R^2 or R^3, (v, omega) first"
        raise SettingsError(Problem("control space", Remark(found), expected))


def bounds_of(space: Any) -> tuple[float, ...]:
    """Bounds of a space of ours: lows and highs of (x, y), then lows and highs of (v, omega)."""
    numbers: list[float] = []
    for component in (0, 2):
        bounds = space.getSubspace(component).getBounds()
        for vector in (bounds.low, bounds.high):
            numbers += (vector[0], vector[1])
    return tuple(numbers)


def covers(space: Any, bounds: Bounds | None, limits: Limits) -> bool:
    """Whether the bounds of a space of ours leave out no position of a world and no velocity of a robot.

    Args:
        space: the space.
        bounds: of the world; None if they do not matter.
        limits: of the robot.
    """
    x_low, y_low, x_high, y_high, v_low, omega_low, v_high, omega_high = bounds_of(space)
    has_positions = bounds is None or (
        x_low <= bounds.min[0] and y_low <= bounds.min[1] and x_high >= bounds.max[0] and y_high >= bounds.max[1]
    )
    return (
        has_positions
        and v_low <= limits.v_min
        and omega_low <= limits.omega_min
        and v_high >= limits.v_max
        and omega_high >= limits.omega_max
    )


def _bounds(low: tuple[float, ...], high: tuple[float, ...]) -> Any:
    bounds = ob.RealVectorBounds(len(low))
    for i, (a, b) in enumerate(zip(low, high, strict=True)):
        bounds.setLow(i, a)
        bounds.setHigh(i, b)
    return bounds
