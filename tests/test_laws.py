"""Control laws of one's own: one function, known by its name to every planner, to replays and to benchmarks."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba import njit

from cbrrt_ompl import Scenario, load_scenario, make_setup, plan, register_law, save_scenario, verify
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import InputError, SettingsError
from cbrrt_ompl.motion import laws
from cbrrt_ompl.motion.control_laws import kanayama_command
from cbrrt_ompl.motion.laws import known_laws, law_named, law_origin
from cbrrt_ompl.motion.model import OPEN_LOOP, make_model
from cbrrt_ompl.motion.posq import posq
from cbrrt_ompl.problem.obstacles import Bounds, Box
from cbrrt_ompl.problem.robot import Gains, Limits
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.trajectory.replay import extension_trajectories

WORLD = World(Bounds((0.0, 0.0), (10.0, 10.0)), [Box((4.8, 0.0), (5.0, 6.0))])
EASY = Scenario(name="easy", world=WORLD, start=State(2.0, 2.0), goal=Goal(8.0, 8.0, tolerance=0.8))
PLANNERS = ["cb-rrt", "cb-rrt-compiled", "cb-rrt-robust"]

Error = tuple[float, float, float]


def pure_pursuit(error: Error, limits: Any, gains: Any) -> tuple[float, float]:
    """Along the arc through the reference at full speed."""
    x, y, _ = error
    return limits.v_max, 2.0 * limits.v_max * y / max(x * x + y * y, 1e-9)


def kanayama_again(error: Error, limits: Any, gains: Any) -> tuple[float, float]:
    """The paper's law as a user would write it."""
    x, y, theta = error
    v = limits.v_max * math.cos(theta) + gains.k_x * x
    return v, 0.0 + limits.v_max * (gains.k_y * y + gains.k_theta * math.sin(theta))


def in_python(error: Error, limits: Any, gains: Any) -> tuple[float, float]:
    """What numba cannot compile: a dictionary of different kinds."""
    made: dict[str, Any] = {"command": pure_pursuit(error, limits, gains), "why": None}
    return made["command"]


@pytest.fixture(autouse=True)
def registered() -> Iterator[None]:
    """Has the laws above known by name, and forgets them afterwards."""
    before = dict(laws._laws)
    for law in (pure_pursuit, kanayama_again, in_python):
        register_law(law.__name__, law)
    yield
    laws._laws.clear()
    laws._laws.update(before)


def by(law: str, **planning: Any) -> Scenario:
    return replace(EASY, planning=PlanningSettings(law=law, max_samples=2000, **planning))


@pytest.mark.parametrize("closed_loop", [False, True])
@pytest.mark.parametrize("law", ["posq", "pure_pursuit", "in_python"])
@pytest.mark.parametrize("planner", PLANNERS)
def test_a_law_plans_under_its_name_and_verifies(planner: str, law: str, closed_loop: bool) -> None:
    scenario = by(law, closed_loop=closed_loop)
    result = plan(scenario, planner, seed=1, time_limit=30.0)
    assert result.solved
    assert verify(result.trajectory, scenario).ok


@pytest.mark.parametrize("closed_loop", [False, True])
@pytest.mark.parametrize("planner", PLANNERS)
def test_the_paper_s_law_written_again_plans_the_same(planner: str, closed_loop: bool) -> None:
    found = [plan(by(law, closed_loop=closed_loop), planner, seed=2) for law in ("kanayama", "kanayama_again")]
    assert found[0].nodes == found[1].nodes
    assert np.allclose(found[0].tree.states, found[1].tree.states, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("planner", PLANNERS)
def test_a_law_in_python_plans_as_its_compiled_self(planner: str) -> None:
    found = [plan(by(law), planner, seed=3).tree for law in ("pure_pursuit", "in_python")]
    assert np.array_equal(found[0].states, found[1].states)


def test_what_numba_can_compile_is_compiled() -> None:
    register_law("jitted", njit(pure_pursuit))
    assert [law_named(name).is_compiled for name in ("posq", "pure_pursuit", "jitted", "in_python")] == [
        True, True, True, False,
    ]  # fmt: skip


def test_an_extension_is_drawn_by_its_law() -> None:
    model = make_model(OPEN_LOOP, EASY.robot, EASY.goal, by("pure_pursuit").planning)
    (trajectory,) = extension_trajectories(State(2.0, 2.0), (3.0, 2.2), model)
    v, omega = pure_pursuit((1.0, 0.2, 0.2), EASY.robot.limits, None)
    assert trajectory.v_command[0] == pytest.approx(v)
    assert trajectory.omega_command[0] == pytest.approx(min(omega, EASY.robot.limits.omega_max))


def failing(error: Error, limits: Any, gains: Any) -> tuple[float, float]:
    """Is compiled, and raises."""
    if error[0] != 1.0:
        raise LookupError("on purpose")
    return 1.0, 0.0


def failing_in_python(error: Error, limits: Any, gains: Any) -> tuple[float, float]:
    """Is not compiled, and raises."""
    return in_python(failing(error, limits, gains) + (0.0,), limits, gains)


def divides(error: Error, limits: Any, gains: Any) -> tuple[float, float]:
    return 1.0, 1.0 / (1.0 - (error[0] != 1.0))


def infinite(error: Error, limits: Any, gains: Any) -> tuple[float, float]:
    return (1.0 if error[0] == 1.0 else math.inf), 0.0


@pytest.mark.parametrize(
    ("law", "expected"),
    [
        (failing, LookupError),
        (failing_in_python, LookupError),
        (divides, ZeroDivisionError),
        (infinite, ArithmeticError),
    ],
)
@pytest.mark.parametrize("planner", PLANNERS)
def test_an_exception_in_a_law_reaches_the_caller(planner: str, law: Any, expected: type[Exception]) -> None:
    register_law("failing", law)
    with pytest.raises(expected):
        plan(by("failing"), planner, seed=1)
    assert plan(by("posq"), planner, seed=1).solved


@pytest.mark.needs_ompl
@pytest.mark.parametrize("compiled", [False, True])
def test_a_law_steers_a_set_up_of_ompl(compiled: bool) -> None:
    setup = make_setup(by("posq"), "cb-rrt", compiled=compiled)
    assert setup.solve(20.0).asString() == "Exact solution"
    assert setup.getSolutionPath().check()


def test_posq_heads_for_the_reference_and_slows_down_near_it() -> None:
    limits, gains = Limits(), Gains()
    assert posq((1e-3, 0.0, 0.0), limits, gains)[0] < 0.01 < posq((1.0, 0.0, 0.0), limits, gains)[0]
    assert posq((1.0, 0.5, 0.4), limits, gains)[1] > 0.0 > posq((1.0, -0.5, -0.4), limits, gains)[1]
    assert kanayama_command((0.0, 0.0, 0.0), 0.0, 0.0, gains) == (0.0, 0.0) == posq((0.0, 0.0, 0.0), limits, gains)


def test_a_scenario_file_names_its_law(tmp_path: Path) -> None:
    save_scenario(by("posq"), tmp_path / "posq.yaml")
    assert load_scenario(tmp_path / "posq.yaml").planning.law == "posq"


def test_an_unknown_law_is_told_the_known_ones() -> None:
    with pytest.raises(SettingsError, match="planning.law: got 'posk', expected one of .*kanayama.*posq.*pure_pursuit"):
        plan(by("posk"), "cb-rrt-compiled")
    assert known_laws() == sorted(known_laws())


@pytest.mark.parametrize(
    ("name", "function"),
    [("", pure_pursuit), ("kanayama", pure_pursuit), ("a\nb", pure_pursuit), (3, pure_pursuit), ("none", 3),
     ("short", lambda *_: (1.0,)), ("nan", lambda *_: (math.nan, 0.0)), ("nothing", lambda *_: None)],
)  # fmt: skip
def test_what_is_no_law_is_refused(name: Any, function: Any) -> None:
    with pytest.raises(InputError):
        register_law(name, function)


def test_a_law_that_no_process_can_import_is_refused_by_name() -> None:
    register_law("nameless", lambda error, limits, gains: (limits.v_max, 0.0))
    with pytest.raises(InputError, match="law 'nameless'.*top of a module"):
        law_origin("nameless")
    assert law_origin("posq") is None is law_origin("kanayama")


@pytest.mark.needs_ompl
@pytest.mark.slow
def test_a_benchmark_knows_the_laws_of_the_script_that_runs_it(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        """
import sqlite3
from dataclasses import replace
from pathlib import Path
import cbrrt_ompl as cb
from cbrrt_ompl.benchmark.campaign import Campaign, run_campaign

def pursuit(error, limits, gains):
    x, y, _ = error
    return limits.v_max, 2.0 * limits.v_max * y / max(x * x + y * y, 1e-9)

cb.register_law("pursuit", pursuit)
if __name__ == "__main__":
    scenario = cb.load_scenario("paper_case1")
    scenarios = {
        law: replace(scenario, planning=replace(scenario.planning, law=law)) for law in ("kanayama", "posq", "pursuit")
    }
    run_campaign(Campaign(scenarios, ("cb-rrt-compiled",), 1, 5.0), Path("bench.db"), Path("logs"))
    print(sqlite3.connect("bench.db").execute("SELECT count(*), sum(solved) FROM runs").fetchall())
""",
        encoding="utf-8",
    )
    done = subprocess.run(
        [sys.executable, str(script)], cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False
    )
    assert "[(3, 3)]" in done.stdout, done.stderr
