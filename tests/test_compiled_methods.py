"""Compiled methods behind OMPL's virtual calls: the Python methods' results, and Python where anything is amiss."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cbrrt_ompl import Scenario, make_setup, make_state_space, plan, write_state
from cbrrt_ompl.collision.fcl_referee import FclReferee
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.ompl_plugin.availability import has_ompl
from cbrrt_ompl.planners.registry import PLANNERS, Backend
from cbrrt_ompl.problem.obstacles import Bounds, Box
from cbrrt_ompl.problem.robot import Footprint, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State

if has_ompl():
    from ompl_rounds import solve

    from cbrrt_ompl.ompl_plugin import native_layout, native_space, rounds, self_check
    from cbrrt_ompl.ompl_plugin.binding import ob, oc
    from cbrrt_ompl.ompl_plugin.compiled_methods import VARIABLE, compiled_methods_work, use_compiled_methods
    from cbrrt_ompl.ompl_plugin.native_layout import LayoutError, object_address, vtable_address, words_at
    from cbrrt_ompl.ompl_plugin.propagators import TwoWheelPropagator
    from cbrrt_ompl.ompl_plugin.validity import FclStateValidityChecker
else:
    pytest.skip("all of it needs OMPL", allow_module_level=True)

UNLESS_OFF = pytest.mark.skipif(
    os.environ.get("CBRRT_OMPL_COMPILED_METHODS") == "0", reason="CBRRT_OMPL_COMPILED_METHODS=0 switches them off"
)
pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="elsewhere the wheel hides the symbols"),
    pytest.mark.usefixtures("quiet_ompl"),
]

WORLD = World(Bounds((0.0, 0.0), (10.0, 10.0)), [Box((4.8, 0.0), (5.0, 6.0)), Box((2.0, 7.0), (3.0, 7.2))])
EASY = Scenario(name="easy", world=WORLD, start=State(2.0, 2.0), goal=Goal(8.0, 8.0, tolerance=0.8))
RECTANGLE = Robot(Footprint.polygon([(-0.2, -0.15), (0.2, -0.15), (0.2, 0.15), (-0.2, 0.15)]))
IN_OMPL = [name for name, planner in PLANNERS.items() if planner.backend is not Backend.COMPILED]


@pytest.fixture
def switch(monkeypatch: pytest.MonkeyPatch) -> Callable[[bool], None]:
    """Switches the compiled methods by the environment."""
    return lambda on: monkeypatch.setenv(VARIABLE, "1" if on else "0")


def at_rest(scenario: Scenario) -> Scenario:
    """The same with a goal that is met by final approaches."""
    return replace(scenario, goal=replace(scenario.goal, theta=1.0, speed_tolerance=0.1))


def with_planning(scenario: Scenario, **planning: Any) -> Scenario:
    return replace(scenario, planning=PlanningSettings(max_samples=600, **planning))


# the same results


def assert_same_plans(scenario: Scenario, planner: str, switch: Callable[[bool], None]) -> None:
    """A planner finds the same tree and the same trajectory with both kinds of methods."""
    found = []
    for on in (False, True):
        switch(on)
        found.append(plan(scenario, planner, seed=3, time_limit=60.0))
    python, compiled = found
    assert (compiled.status, compiled.samples, compiled.nodes) == (python.status, python.samples, python.nodes)
    assert np.array_equal(compiled.tree.states, python.tree.states)
    assert np.array_equal(compiled.tree.parents, python.tree.parents)
    if python.trajectory is not None:
        assert np.array_equal(compiled.trajectory.states, python.trajectory.states)


@pytest.mark.parametrize("robot", [Robot(), RECTANGLE], ids=["point", "rectangle"])
@pytest.mark.parametrize("planner", IN_OMPL)
def test_plans_are_those_of_the_python_methods(planner: str, robot: Robot, switch: Callable[[bool], None]) -> None:
    assert_same_plans(replace(with_planning(EASY), robot=robot), planner, switch)


@pytest.mark.parametrize("planner", ["cb-rrt", "s-rrt", "rrt", "sst"])
def test_plans_to_a_goal_at_rest_are_those_of_the_python_methods(planner: str, switch: Callable[[bool], None]) -> None:
    assert_same_plans(at_rest(with_planning(EASY)), planner, switch)


@pytest.mark.parametrize("planning", [{"closed_loop": True}, {"cut_extension": "keep"}, {"brake_safe": True}], ids=str)
def test_plans_with_other_settings_are_those_of_the_python_methods(
    planning: dict[str, Any], switch: Callable[[bool], None]
) -> None:
    assert_same_plans(with_planning(EASY, **planning), "cb-rrt", switch)


# that they are used, and when they are not


def is_redirected(python_object: Any, class_name: str, wrapper: str) -> bool:
    """Whether an object has another vtable than Boost.Python's."""
    return int(words_at(object_address(python_object, class_name), 1)[0]) != vtable_address(wrapper)


def redirected(setup: Any) -> list[bool]:
    """Whether propagator, checker, space and control space of a set-up have other vtables."""
    si = setup.getSpaceInformation()
    return [
        is_redirected(si.getStatePropagator(), "ompl::control::StatePropagator", "StatePropagator_wrapper"),
        is_redirected(si.getStateValidityChecker(), "ompl::base::StateValidityChecker", "StateValidityChecker_wrapper"),
        is_redirected(si.getStateSpace(), "ompl::base::CompoundStateSpace", "CompoundStateSpace_wrapper"),
        is_redirected(si.getControlSpace(), "ompl::control::RealVectorControlSpace", "RealVectorControlSpace_wrapper"),
    ]


def test_this_wheel_passes_the_check() -> None:
    assert compiled_methods_work()


@UNLESS_OFF
def test_they_are_used_unless_switched_off(switch: Callable[[bool], None]) -> None:
    assert redirected(make_setup(EASY)) == [True] * 4
    assert redirected(make_setup(EASY, compiled=False)) == [False] * 4
    switch(False)
    assert redirected(make_setup(EASY)) == [False] * 4
    assert redirected(make_setup(EASY, compiled=True)) == [True] * 4


@pytest.mark.parametrize("method", ["propagate", "isValid"])
def test_a_derived_class_that_overrides_a_method_is_asked(method: str) -> None:
    calls = []

    class Propagator(TwoWheelPropagator):  # type: ignore[misc]
        def propagate(self, *arguments: Any) -> None:
            calls.append("propagate")
            super().propagate(*arguments)

    class Checker(FclStateValidityChecker):  # type: ignore[misc]
        def isValid(self, state: Any) -> bool:
            calls.append("isValid")
            return super().isValid(state)

    setup = make_setup(EASY, "rrt")
    si = setup.getSpaceInformation()
    if method == "propagate":
        setup.setStatePropagator(Propagator(si, EASY.robot))
    else:
        setup.setStateValidityChecker(Checker(si, EASY.robot, WORLD))
    solve(setup, 10)
    assert len(calls) > 10


def test_the_distance_follows_the_weights_of_the_space() -> None:
    space = make_state_space(WORLD, Robot())
    first, second = ob.State(space), ob.State(space)
    write_state(first, State(1.0, 2.0, 0.5))
    write_state(second, State(4.0, 6.0, 1.5))
    assert space.distance(first(), second()) == 5.0
    space.setSubspaceWeight(1, 2.0)
    assert space.distance(first(), second()) == pytest.approx(7.0)


def test_the_checker_follows_the_bounds_of_the_space() -> None:
    si = make_setup(EASY).getSpaceInformation()
    state = ob.State(si.getStateSpace())
    write_state(state, State(9.0, 9.0))
    assert si.isValid(state())
    si.getStateSpace().getSubspace(0).setBounds(0.0, 8.0)
    assert not si.isValid(state())


# fakes of another version or layout


@pytest.fixture
def unchecked() -> Iterator[None]:
    """Has the check made anew, before and after the test."""
    known = (compiled_methods_work, native_layout.vtable_words, native_layout.symbol_address)
    for function in known:
        function.cache_clear()
    yield
    for function in known:
        function.cache_clear()


def hide(name: str) -> Callable[[str], int]:
    original = native_layout.symbol_address

    def symbol_address(symbol: str) -> int:
        if name in symbol:
            raise LayoutError(f"no symbol {symbol}")
        return original(symbol)

    return symbol_address


FAKES: dict[str, tuple[Any, str, Any, str]] = {
    "another version": (self_check, "version", lambda _: "2.0.1", "made for ompl 1.7.0, and this is 2.0.1"),
    "two copies of libompl": (self_check, "has_two_copies", lambda: True, "import cbrrt_ompl before OMPL's modules"),
    "hidden wrappers": (native_layout, "symbol_address", hide("_wrapper"), "no symbol _ZTV"),
    "no look-up of objects": (native_layout, "_find_instance", lambda: lambda *_: 0, "no ompl::"),
    "a smaller vtable": (self_check, "vtable", lambda name: native_layout.vtable_words(name)[:-1], "differ"),
    "other states": (self_check, "state_at", lambda _: (0.0,) * 5, "states are laid out in another way"),
    "other controls": (self_check, "control_at", lambda *_: (0.0,) * 3, "controls are laid out in another way"),
    "other bounds": (self_check, "reals_of_bounds", lambda _: [[0.0], [0.0]], "bounds are elsewhere"),
    "other results": (self_check, "read_state", lambda _: object(), "propagate"),
    "another condition": (rounds, "PERIOD", -2.0, "a termination condition is laid out in another way"),
    "other weights": (native_space, "_reals", lambda *_: [0.0] * 3, "0 "),
}


@UNLESS_OFF
@pytest.mark.parametrize("fake", FAKES)
def test_another_wheel_falls_back_with_one_line(
    fake: str, unchecked: None, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    module, name, value, reason = FAKES[fake]
    if fake == "a smaller vtable":
        whole = native_layout.vtable_words
        value = lambda n: whole(n)[:-1] if n == "GoalState_wrapper" else whole(n)  # noqa: E731
    monkeypatch.setattr(module, name, value)
    with caplog.at_level(logging.WARNING):
        assert not use_compiled_methods()
        setup = make_setup(EASY, "cb-rrt")
    monkeypatch.undo()
    assert redirected(setup) == [False] * 4
    assert len(caplog.records) == 1
    assert reason in caplog.text
    assert setup.solve(20.0).asString() == "Exact solution"


@UNLESS_OFF
def test_no_thread_has_compiled_methods_before_the_check_is_over(
    unchecked: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those that asked meanwhile were told that they work: on another wheel, that is memory corruption."""
    has_begun, may_end = threading.Event(), threading.Event()

    def check() -> None:
        has_begun.set()
        may_end.wait(10.0)
        raise LayoutError("another wheel")

    monkeypatch.setattr(self_check, "check_compiled_methods", check)
    answers: list[bool] = []
    threads = [threading.Thread(target=lambda: answers.append(use_compiled_methods())) for _ in range(2)]
    threads[0].start()
    assert has_begun.wait(10.0)
    threads[1].start()
    threads[1].join(0.2)
    may_end.set()
    for thread in threads:
        thread.join()
    assert answers == [False, False]


def test_without_sizes_of_symbols_it_falls_back(unchecked: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """As on macOS, whose dlfcn.h has no dladdr1."""
    monkeypatch.setattr(native_layout.ctypes, "CDLL", lambda _: object())
    assert not compiled_methods_work()


@UNLESS_OFF
def test_an_object_with_another_vtable_is_left_alone() -> None:
    space = make_state_space(WORLD, Robot())
    with pytest.raises(LayoutError, match="another vtable"):
        native_space.make_space_native(space)


def test_what_is_no_object_of_a_class_has_no_address_as_such() -> None:
    with pytest.raises(LayoutError, match=r"no ompl::base::State in a"):
        object_address(oc.SimpleSetup, "ompl::base::State")


# rounds of a main loop


@pytest.mark.parametrize("on", [False, True], ids=["Python", "compiled"])
@pytest.mark.parametrize("planner", ["cb-rrt", "rrt", "est"])
def test_a_plan_takes_exactly_the_rounds_that_it_may(planner: str, on: bool, switch: Callable[[bool], None]) -> None:
    switch(on)
    walled = replace(EASY, world=World(WORLD.bounds, [Box((4.8, 0.0), (5.0, 10.0))]))
    result = plan(replace(walled, planning=PlanningSettings(max_samples=777)), planner, seed=1, time_limit=60.0)
    assert (result.status, result.samples) == ("sample limit", 777)


@pytest.mark.parametrize("on", [False, True], ids=["Python", "compiled"])
def test_an_exception_of_a_look_comes_out_and_the_condition_is_as_it_was(
    on: bool, switch: Callable[[bool], None]
) -> None:
    switch(on)

    def fail(count: int) -> bool:
        raise LookupError(f"at {count}")

    counted = rounds.Rounds(100, fail)
    with pytest.raises(LookupError, match="at 0"), counted.condition() as condition:
        make_setup(EASY, "rrt").solve(condition)
    with pytest.raises(LookupError, match="at 0"):
        condition.eval()
    assert counted.count == 0


def test_looks_are_rare_where_rounds_are_short() -> None:
    looks: list[int] = []

    def look(count: int) -> bool:
        looks.append(count)
        return False

    counted = rounds.Rounds(100_000, look)
    with counted.condition() as condition:
        while not condition.eval():
            pass
    assert counted.count == 100_000
    assert looks[0] == 0
    assert len(looks) == len(set(looks))
    if use_compiled_methods():
        assert len(looks) < 50_000


# exceptions, signals, threads, processes


def test_an_exception_comes_out_through_compiled_methods(monkeypatch: pytest.MonkeyPatch) -> None:
    """Within some micrometres of contact the compiled method asks FCL in Python."""

    def fail(*_: Any) -> bool:
        raise LookupError("on purpose")

    touching = replace(EASY, start=State(4.8 - 3e-6, 3.0))
    setup = make_setup(touching, "rrt")
    monkeypatch.setattr(FclReferee, "collides", fail)
    with pytest.raises(LookupError, match="on purpose"):
        setup.solve(5.0)
    monkeypatch.undo()
    assert make_setup(EASY, "rrt").solve(20.0).asString() == "Exact solution"


@pytest.mark.parametrize("planner", ["cb-rrt", "rrt", "sst"])
def test_ctrl_c_ends_a_solve_at_once(planner: str) -> None:
    """No Python runs in the loop of a planner, but for one call in some thousands."""
    code = f"""
import os, signal, threading, time
from dataclasses import replace
import cbrrt_ompl
from cbrrt_ompl.ompl_plugin.binding import ou
ou.setLogLevel(ou.LOG_NONE)
scenario = cbrrt_ompl.load_scenario("paper_case1")
scenario = replace(scenario, goal=cbrrt_ompl.Goal(4.9, -4.9, tolerance=1e-9))
setup = cbrrt_ompl.make_setup(scenario, {planner!r})
setup.setup()
threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
began = time.perf_counter()
try:
    setup.solve(30.0)
except KeyboardInterrupt:
    print("interrupted", time.perf_counter() - began < 3.0)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    assert (done.returncode, done.stdout) == (0, "interrupted True\n"), done.stderr


def test_set_ups_in_threads_do_not_disturb_each_other() -> None:
    """Each thread has a set-up of its own; they take turns at the interpreter's lock."""
    found: list[str] = []

    def work() -> None:
        for _ in range(5):
            found.append(make_setup(EASY, "cb-rrt").solve(20.0).asString())

    threads = [threading.Thread(target=work) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == ["Exact solution"] * 15


def test_a_forked_process_plans_as_its_parent_does() -> None:
    expected = plan(EASY, "rrt", seed=5, time_limit=20.0).nodes
    child = os.fork()
    if child == 0:
        os._exit(0 if plan(EASY, "rrt", seed=5, time_limit=20.0).nodes == expected else 1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


def test_objects_die_with_their_set_up() -> None:
    """A vtable that its object keeps would keep the object if anything of it led back."""
    import gc
    import weakref

    alive: list[Any] = []
    for planner in ("cb-rrt", "rrt"):
        setup = make_setup(EASY, planner)
        setup.solve(20.0)
        si = setup.getSpaceInformation()
        alive += [weakref.ref(si.getStatePropagator()), weakref.ref(si.getStateValidityChecker())]
        if planner == "cb-rrt":
            alive.append(weakref.ref(setup.getPlanner().sampler))
        del setup, si
    gc.collect()
    assert [reference() for reference in alive] == [None] * 5
