"""Compiled methods of our propagator, validity checker, directed samplers and goal, behind OMPL's virtual calls.

Each does what the Python method of its class does, bit for bit, and calls the method that was in its slot before for
everything that is not the common case. Records tell them of their object: addresses of arrays that the Python object
keeps, and counters that both methods share.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import carray, types

from cbrrt_ompl.collision.clearance import clearance
from cbrrt_ompl.collision.index import CELL
from cbrrt_ompl.collision.pieces import CORNER, PIECE
from cbrrt_ompl.collision.scene import FRAME, Scene
from cbrrt_ompl.collision.world import CONTACT_BAND
from cbrrt_ompl.kernels import callback, kernel
from cbrrt_ompl.motion.model import GOAL_REGION, MODEL, advance
from cbrrt_ompl.motion.records import Records, record_array
from cbrrt_ompl.ompl_plugin.children import COUNTS, PARENT, add_child, slot_of_node
from cbrrt_ompl.ompl_plugin.goal_distance import region_distance
from cbrrt_ompl.ompl_plugin.native_layout import symbol_address
from cbrrt_ompl.ompl_plugin.native_memory import (
    call_is_valid,
    call_propagate,
    call_sample_to,
    control_at,
    peek_real,
    pointer,
    position_at,
    set_control_at,
    set_state_at,
    state_at,
)
from cbrrt_ompl.ompl_plugin.native_space import bounds_address
from cbrrt_ompl.ompl_plugin.space import BOUNDS_SLACK
from cbrrt_ompl.ompl_plugin.virtual_calls import call_compiled, record_address
from cbrrt_ompl.planners.extension import CHILD, EXTENDED, NO_CHILD, REFUSED, UNTRIED, extend
from cbrrt_ompl.planners.roll_out import STEPS, margin_at

PYTHON_PERIOD = 4096
"""Calls of ``isValid`` of which one goes through Python, which lets a Ctrl-C through."""

PROPAGATOR, CHECKER = "ompl::control::StatePropagator", "ompl::base::StateValidityChecker"
SAMPLER = "ompl::control::DirectedControlSampler"
PROPAGATOR_WRAPPER, CHECKER_WRAPPER = "StatePropagator_wrapper", "StateValidityChecker_wrapper"
SAMPLER_WRAPPER = "DirectedControlSampler_wrapper"

PROPAGATE = "_ZNK23StatePropagator_wrapper9propagateEPKN4ompl4base5StateEPKNS0_7control7ControlEdPS2_"
IS_VALID = "_ZNK28StateValidityChecker_wrapper7isValidEPKN4ompl4base5StateE"
SAMPLE_TO = "_ZN30DirectedControlSampler_wrapper8sampleToEPN4ompl7control7ControlEPKNS0_4base5StateEPS5_"
SAMPLE_TO_AFTER = "_ZN30DirectedControlSampler_wrapper8sampleToEPN4ompl7control7ControlEPKS2_PKNS0_4base5StateEPS7_"

PROPAGATOR_RECORD = np.dtype(
    [
        ("model", np.int64),  # address of the model
        ("dimension", np.int64),  # numbers of a control
        ("python", np.int64),  # address of the method that calls Python
    ]
)

_SCENE_FIELDS = [
    *((name, np.int64) for name in Scene._fields),  # addresses of the scene's arrays
    *((f"{name}_count", np.int64) for name in ("cell", "list", "piece", "corner")),  # and their lengths
]

CHECKER_RECORD = np.dtype(
    [
        *_SCENE_FIELDS,
        ("position_bounds", np.int64),  # addresses of the vectors of the lows, each followed by that of the highs
        ("velocity_bounds", np.int64),
        ("checked", np.int64),  # states judged so far
        ("python", np.int64),
    ]
)

SAMPLER_RECORD = np.dtype(
    [
        *_SCENE_FIELDS,
        ("model", np.int64),
        ("block", np.int64),  # address of room for the kernel
        ("parents", np.int64),  # addresses of the arrays of the children
        ("children", np.int64),
        ("counts", np.int64),
        ("capacity", np.int64),  # children that there is room for
        ("slots", np.int64),
        ("dimension", np.int64),
        ("is_compiled", np.int64),  # whether kernels decide everything
        ("look_period", np.int64),  # calls of which one goes through Python
        ("samples", np.int64),  # calls so far
        ("refused", np.int64),
        ("python", np.int64),
    ]
)


@kernel(forceinline=True)
def scene_of(record: Any) -> Scene:
    """The scene whose arrays a record tells."""
    return Scene(
        carray(pointer(record.frame), 1, FRAME),
        carray(pointer(record.cells), record.cell_count, CELL),
        carray(pointer(record.lists), record.list_count, np.int32),
        carray(pointer(record.pieces), record.piece_count, PIECE),
        carray(pointer(record.corners), record.corner_count, CORNER),
    )


def enter_scene(record: Records, scene: Scene) -> None:
    """Tell a record the arrays of a scene; whoever keeps the record keeps the scene."""
    for name in Scene._fields:
        record[name] = getattr(scene, name).ctypes.data
    record["cell_count"], record["list_count"] = len(scene.cells), len(scene.lists)
    record["piece_count"], record["corner_count"] = len(scene.pieces), len(scene.corners)


# propagate


@callback(types.void(types.int64, types.int64, types.int64, types.float64, types.int64))
def propagate(this: int, state: int, control: int, duration: float, result: int) -> None:
    """``StatePropagator::propagate``: by the model, but through Python for a step that the model does not have."""
    record = carray(pointer(record_address(this)), 1, PROPAGATOR_RECORD)[0]
    model = carray(pointer(record.model), 1, MODEL)[0]
    if duration != model.dt:
        call_propagate(record.python, this, state, control, duration, result)
        return
    x, y, theta, v, omega = state_at(state)
    numbers = control_at(control, record.dimension)
    x, y, theta, v, omega, _, _ = advance(x, y, theta, v, omega, numbers, model, duration)
    set_state_at(result, x, y, theta, v, omega)


def make_propagator_native(propagator: Any, model: Records, dimension: int) -> None:
    """Put the compiled method into a :class:`cbrrt_ompl.TwoWheelPropagator`.

    Args:
        propagator: the propagator, which keeps the model.
        model: see :func:`cbrrt_ompl.motion.model.make_model`.
        dimension: numbers of a control.

    Raises:
        LayoutError: if it is not laid out as expected.
    """
    record = record_array(1, PROPAGATOR_RECORD)
    record["model"], record["dimension"], record["python"] = model.ctypes.data, dimension, symbol_address(PROPAGATE)
    call_compiled(propagator, PROPAGATOR, PROPAGATOR_WRAPPER, {PROPAGATE: propagate.address}, record)


# isValid


@kernel(forceinline=True)
def is_within(bounds: int, first: float, second: float) -> bool:
    """Whether two numbers are within the bounds of an R^2, whose vectors of lows and of highs begin at an address."""
    low, high = carray(pointer(bounds), 4, np.int64)[0], carray(pointer(bounds), 4, np.int64)[3]
    return (
        peek_real(low) - BOUNDS_SLACK <= first <= peek_real(high) + BOUNDS_SLACK
        and peek_real(low + 8) - BOUNDS_SLACK <= second <= peek_real(high + 8) + BOUNDS_SLACK
    )


@callback(types.uint8(types.int64, types.int64))
def is_valid(this: int, state: int) -> bool:
    """``StateValidityChecker::isValid``: by the exact distance, through Python where FCL has to decide."""
    record = carray(pointer(record_address(this)), 1, CHECKER_RECORD)[0]
    x, y, theta, v, omega = state_at(state)
    found = clearance(scene_of(record), x, y, theta, 2.0 * CONTACT_BAND)[0]
    is_common = abs(found) > CONTACT_BAND and -math.pi <= theta < math.pi
    if not is_common or (record.checked + 1) % PYTHON_PERIOD == 0:
        return call_is_valid(record.python, this, state) != 0
    record.checked += 1
    return (
        found > 0.0
        and math.isfinite(x + y + theta + v + omega)
        and is_within(record.position_bounds, x, y)
        and is_within(record.velocity_bounds, v, omega)
    )


def make_checker_native(checker: Any, scene: Scene, space: Any, record: Records) -> None:
    """Put the compiled method into a :class:`cbrrt_ompl.FclStateValidityChecker`.

    Args:
        checker: the checker.
        scene: its world and footprint.
        space: its state space.
        record: of type `CHECKER_RECORD`, in which the checker counts.

    Raises:
        LayoutError: if it is not laid out as expected.
    """
    enter_scene(record, scene)
    record["position_bounds"], record["velocity_bounds"] = bounds_address(space, 0), bounds_address(space, 2)
    record["python"] = symbol_address(IS_VALID)
    call_compiled(checker, CHECKER, CHECKER_WRAPPER, {IS_VALID: is_valid.address}, record)


# the goal's distance

GOAL, GOAL_WRAPPER = "ompl::base::GoalSampleableRegion", "GoalSampleableRegion_wrapper"
DISTANCE_GOAL = "_ZNK28GoalSampleableRegion_wrapper12distanceGoalEPKN4ompl4base5StateE"
GOAL_METHODS = {
    "_ZNK28GoalSampleableRegion_wrapper11isSatisfiedEPKN4ompl4base5StateE": (
        "_ZNK4ompl4base10GoalRegion11isSatisfiedEPKNS0_5StateE"
    ),
    "_ZNK28GoalSampleableRegion_wrapper11isSatisfiedEPKN4ompl4base5StateEPd": (
        "_ZNK4ompl4base10GoalRegion11isSatisfiedEPKNS0_5StateEPd"
    ),
}
"""Methods that look for an override in vain, and libompl's to take their place."""

GOAL_RECORD = np.dtype([("region", np.int64)])


@callback(types.float64(types.int64, types.int64))
def distance_goal(this: int, state: int) -> float:
    """``GoalRegion::distanceGoal`` of a :class:`cbrrt_ompl.ompl_plugin.goals.PoseGoal`."""
    record = carray(pointer(record_address(this)), 1, GOAL_RECORD)[0]
    x, y, theta, v, omega = state_at(state)
    return region_distance(carray(pointer(record.region), 1, GOAL_REGION)[0], x, y, theta, v, omega)


def make_goal_native(goal: Any, region: Records) -> None:
    """Put the compiled method into a goal of ours.

    Args:
        goal: the goal, which keeps the region.
        region: one record of type :data:`cbrrt_ompl.motion.model.GOAL_REGION`.

    Raises:
        LayoutError: if it is not laid out as expected.
    """
    record = record_array(1, GOAL_RECORD)
    record["region"] = region.ctypes.data
    methods = {old: symbol_address(new) for old, new in GOAL_METHODS.items()}
    call_compiled(goal, GOAL, GOAL_WRAPPER, {**methods, DISTANCE_GOAL: distance_goal.address}, record)


# sampleTo


@kernel
def sample_to(this: int, control: int, source: int, dest: int) -> int:
    """``DirectedControlSampler::sampleTo``, through Python where arrays are full or a user's parts have to be asked."""
    record = carray(pointer(record_address(this)), 1, SAMPLER_RECORD)[0]
    counts = carray(pointer(record.counts), 1, COUNTS)
    if (
        not record.is_compiled
        or (record.samples + 1) % record.look_period == 0
        or max(counts[0].nodes, counts[0].children) >= record.capacity
    ):
        return call_sample_to(record.python, this, control, source, dest)
    record.samples += 1
    parents = carray(pointer(record.parents), record.slots, PARENT)
    children = carray(pointer(record.children), record.capacity, CHILD)
    model, block = carray(pointer(record.model), 1, MODEL)[0], carray(pointer(record.block), 1, STEPS)[0]
    scene, node = scene_of(record), state_at(source)
    slot = slot_of_node(node, parents, counts)
    margin = margin_at(node[0], node[1], node[2], scene, model.room)
    first_child = parents[slot].first_child
    found = extend(node, margin, position_at(dest), first_child, children, scene, model, block)
    if first_child == UNTRIED:
        parents[slot].first_child = NO_CHILD
    if found.outcome != EXTENDED:
        record.refused += found.outcome == REFUSED
        return 0
    add_child(slot, found.command[0], found.command[1], parents, children, counts)
    set_control_at(control, found.control, record.dimension)
    x, y, theta, v, omega = found.state
    set_state_at(dest, x, y, theta, v, omega)
    return found.steps


@callback(types.uint32(types.int64, types.int64, types.int64, types.int64))
def sample_to_first(this: int, control: int, source: int, dest: int) -> int:
    """The method without the control of the node."""
    return sample_to(this, control, source, dest)


@callback(types.uint32(types.int64, types.int64, types.int64, types.int64, types.int64))
def sample_to_after(this: int, control: int, _: int, source: int, dest: int) -> int:
    """The method with the control of the node, which does not matter."""
    return sample_to(this, control, source, dest)


def make_sampler_native(sampler: Any, record: Records) -> None:
    """Put the compiled methods into a directed sampler of ours.

    Args:
        sampler: the sampler.
        record: of type `SAMPLER_RECORD`, which it keeps up to date.

    Raises:
        LayoutError: if it is not laid out as expected.
    """
    record["python"] = symbol_address(SAMPLE_TO)
    methods = {SAMPLE_TO: sample_to_first.address, SAMPLE_TO_AFTER: sample_to_after.address}
    call_compiled(sampler, SAMPLER, SAMPLER_WRAPPER, methods, record)
