"""Prove, once a process, that compiled methods do what the Python methods do on this build of OMPL.

What could go wrong is that OMPL is another version, that its symbols are hidden (as on macOS), that two copies of
libompl are loaded, or that an object is laid out in another way. All that is only read is checked before anything is
written to.
"""

from __future__ import annotations

import ctypes
from importlib.metadata import version
from typing import Any

import numpy as np

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.ompl_plugin.binding import ob, oc
from cbrrt_ompl.ompl_plugin.goals import PoseGoal
from cbrrt_ompl.ompl_plugin.native_layout import BEFORE_SLOTS, LayoutError, object_address, slot_of, symbol_address
from cbrrt_ompl.ompl_plugin.native_layout import vtable_words as vtable
from cbrrt_ompl.ompl_plugin.native_memory import control_at, state_at
from cbrrt_ompl.ompl_plugin.native_methods import (
    CHECKER_WRAPPER,
    DISTANCE_GOAL,
    GOAL,
    GOAL_METHODS,
    GOAL_WRAPPER,
    IS_VALID,
    PROPAGATE,
    PROPAGATOR_WRAPPER,
    SAMPLE_TO,
    SAMPLE_TO_AFTER,
    SAMPLER,
    SAMPLER_WRAPPER,
)
from cbrrt_ompl.ompl_plugin.native_space import (
    DISTANCE,
    NATIVE_CLASSES,
    SPACE,
    SPACE_WRAPPER,
    bounds_address,
    reals_of_bounds,
)
from cbrrt_ompl.ompl_plugin.propagators import TwoWheelPropagator
from cbrrt_ompl.ompl_plugin.rounds import Rounds
from cbrrt_ompl.ompl_plugin.samplers import KanayamaDirectedControlSampler
from cbrrt_ompl.ompl_plugin.space import bounds_of, make_control_space, make_state_space, read_state, write_state
from cbrrt_ompl.ompl_plugin.validity import FclStateValidityChecker
from cbrrt_ompl.ompl_plugin.virtual_calls import virtual_method
from cbrrt_ompl.one_libompl import has_two_copies
from cbrrt_ompl.problem.obstacles import Bounds, Box
from cbrrt_ompl.problem.robot import Footprint, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State

WHEEL = "1.7.0"
"""Version of OMPL that the methods are made for."""

TRIALS = 100
"""Random states on which both kinds of methods are compared."""

_ADDRESS = ctypes.c_size_t
_DISTANCE_GOAL = ctypes.PYFUNCTYPE(ctypes.c_double, _ADDRESS, _ADDRESS)
_SAMPLE_TO = ctypes.PYFUNCTYPE(ctypes.c_uint, _ADDRESS, _ADDRESS, _ADDRESS, _ADDRESS)

_WORLD = World(Bounds((-5.0, -5.0), (5.0, 5.0)), [Box((-1.0, -1.0), (1.0, 1.0))])
_ROBOT = Robot(Footprint.disc(0.2))


def check_compiled_methods() -> None:
    """Raise an exception if something is not as the compiled methods need it."""
    if version("ompl") != WHEEL:
        raise LayoutError(f"they are made for ompl {WHEEL}, and this is {version('ompl')}")
    if has_two_copies():
        raise LayoutError("two copies of libompl are loaded; import cbrrt_ompl before OMPL's modules")
    check_vtables()
    check_reading()
    check_results()
    check_condition()


def check_vtables() -> None:
    """All vtables are there, as long as they should be, and of one libompl."""
    replaced = {
        PROPAGATOR_WRAPPER: (PROPAGATE,),
        CHECKER_WRAPPER: (IS_VALID,),
        SAMPLER_WRAPPER: (SAMPLE_TO, SAMPLE_TO_AFTER),
        GOAL_WRAPPER: (DISTANCE_GOAL, *GOAL_METHODS),
        SPACE: (DISTANCE,),
    }
    for class_name, methods in replaced.items():
        for method in methods:
            slot_of(vtable(class_name), symbol_address(method))
    for method in GOAL_METHODS.values():
        symbol_address(method)
    pairs = {SPACE_WRAPPER: SPACE, **{f"{name}_wrapper": native for name, native in NATIVE_CLASSES.items()}}
    for wrapper, native in pairs.items():
        own, other = vtable(wrapper), vtable(native)
        if len(own) != len(other):
            raise LayoutError(f"the vtables of {wrapper} and {native} differ in length")
        if not np.any(own[BEFORE_SLOTS:] == other[BEFORE_SLOTS:]):
            raise LayoutError(f"{wrapper} inherits from another copy of libompl than that of {native}")


def check_reading() -> None:
    """States and controls that OMPL has written are read back; nothing is written."""
    rng = np.random.default_rng(1)
    si = _space_information(is_compiled=False)
    space, controls = si.getStateSpace(), si.getControlSpace()
    for component, (low, high) in zip((0, 2), np.split(np.array(bounds_of(space)).reshape(4, 2), 2), strict=True):
        bounds = reals_of_bounds(bounds_address(space, component))
        if bounds != [low.tolist(), high.tolist()]:
            raise LayoutError("bounds are elsewhere")
    state, control = ob.State(space), controls.allocControl()
    for _ in range(TRIALS):
        values = State(*rng.uniform(-3.0, 3.0, 5).tolist())
        write_state(state, values)
        if state_at(object_address(state(), "ompl::base::State")) != (*values,):
            raise LayoutError("states are laid out in another way")
        numbers = rng.uniform(-1.0, 1.0, 2).tolist()
        control[0], control[1] = numbers
        if control_at(object_address(control, "ompl::control::Control"), 2) != (*numbers, 0.0):
            raise LayoutError("controls are laid out in another way")
    controls.freeControl(control)


def check_results() -> None:
    """Compiled and Python methods give the same numbers, bit for bit, through OMPL's virtual calls."""
    found = [_results(is_compiled) for is_compiled in (False, True)]
    for (name, expected), (_, compiled) in zip(*found, strict=True):
        if expected != compiled:
            raise LayoutError(f"{name}: {compiled} instead of {expected}")


def check_condition() -> None:
    """Rounds are counted, and Python is asked in between."""
    asked: list[int] = []

    def look(count: int) -> bool:
        asked.append(count)
        return False

    rounds = Rounds(10, look)
    with rounds.condition() as condition:
        ended = [condition.eval() for _ in range(12)]
    if (ended, rounds.count, asked[:1]) != ([False] * 10 + [True] * 2, 10, [0]):
        raise LayoutError("rounds are not counted")


def _results(is_compiled: bool) -> list[tuple[str, Any]]:
    """What OMPL's calls give for random states, with names."""
    rng = np.random.default_rng(2)
    si = _space_information(is_compiled)
    space, controls = si.getStateSpace(), si.getControlSpace()
    goal = PoseGoal(si, space, Goal(1.0, 2.0, 3.0, theta=0.3, speed_tolerance=0.2), compiled=is_compiled)
    sampler = KanayamaDirectedControlSampler(si, _ROBOT, _WORLD, compiled=is_compiled)
    state, other, result = (ob.State(space) for _ in range(3))
    control = controls.allocControl()
    this_goal, this_sampler = object_address(goal, GOAL), object_address(sampler, SAMPLER)
    distance_goal = _DISTANCE_GOAL(virtual_method(goal, GOAL, GOAL_WRAPPER, DISTANCE_GOAL))
    sample_to = _SAMPLE_TO(virtual_method(sampler, SAMPLER, SAMPLER_WRAPPER, SAMPLE_TO))
    found: list[tuple[str, Any]] = []
    for _ in range(TRIALS):
        for scoped in (state, other):
            write_state(scoped, State(*(rng.uniform(-1.0, 1.0, 5) * (4.9, 4.9, 3.0, 0.4, 0.4)).tolist()))
        control[0], control[1] = rng.uniform(-1.0, 1.0, 2).tolist()
        si.propagate(state(), control, 3, result())
        found.append(("propagate", read_state(result)))
        found.append(("isValid", (si.isValid(state()), si.isValid(result()))))
        found.append(("distance", si.distance(state(), other())))
        addresses = [object_address(scoped(), "ompl::base::State") for scoped in (state, other)]
        found.append(("distanceGoal", (goal.isSatisfied(state()), distance_goal(this_goal, addresses[0]))))
        steps = sample_to(this_sampler, object_address(control, "ompl::control::Control"), *addresses)
        found.append(("sampleTo", (steps, control[0], control[1], read_state(other))))
    found.append(("counters", (si.getStateValidityChecker().checked, sampler.samples, sampler.children)))
    controls.freeControl(control)
    return found


def _space_information(is_compiled: bool) -> Any:
    """A space information, not set up: that would take seeds of OMPL's random numbers."""
    space = make_state_space(_WORLD, _ROBOT, compiled=is_compiled)
    si = oc.SpaceInformation(space, make_control_space(space, _ROBOT, compiled=is_compiled))
    si.setStateValidityChecker(FclStateValidityChecker(si, _ROBOT, _WORLD, compiled=is_compiled))
    si.setStatePropagator(TwoWheelPropagator(si, _ROBOT, compiled=is_compiled))
    si.setPropagationStepSize(PlanningSettings().step)
    si.setMinMaxControlDuration(1, PlanningSettings().steps)
    return si
