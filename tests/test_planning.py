"""plan(): how a plan begins and ends, whichever planner it is, and that one seed is one result."""

from __future__ import annotations

import hashlib
import json
import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from cbrrt_ompl import plan, verify
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import SettingsError, UnknownPlannerError
from cbrrt_ompl.planners.registry import PLANNERS
from cbrrt_ompl.planning import PlanResult, available_planners
from cbrrt_ompl.problem.obstacles import Bounds, Box
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.scenario.scenario import Scenario

BOUNDS = Bounds((0.0, 0.0), (10.0, 10.0))


def easy() -> Scenario:
    """A wall to drive around, in a world of its own."""
    world = World(BOUNDS, [Box((4.8, 0.0), (5.0, 6.0))])
    return Scenario(name="easy", world=world, start=State(2.0, 2.0), goal=Goal(8.0, 8.0, tolerance=0.8))


EASY = easy()
UNSOLVABLE = Scenario(
    name="unsolvable",
    world=World(BOUNDS, [Box((4.8, 0.0), (5.0, 10.0))]),
    start=State(2.0, 2.0),
    goal=Goal(8.0, 8.0),
    planning=PlanningSettings(max_samples=10**9),
)


def fingerprint(result: PlanResult) -> list[object]:
    """All that a plan decides, with a hash of every number of its tree and its trajectory."""
    numbers = [result.tree.states, result.tree.parents, result.tree.polyline]
    if result.trajectory is not None:
        trajectory = result.trajectory
        numbers += [trajectory.states, trajectory.v_command, trajectory.omega_command]
    digest = hashlib.sha256(b"".join(np.ascontiguousarray(array).tobytes() for array in numbers))
    return [result.status, result.nodes, result.samples, digest.hexdigest()]


# results


@pytest.mark.parametrize("planner", PLANNERS)
def test_every_planner_solves_an_easy_scenario_and_its_trajectory_is_verified(planner: str) -> None:
    result = plan(EASY, planner, seed=5, time_limit=30.0)
    assert result.status == "solved"
    assert result.solved
    assert result.trajectory is not None
    assert verify(result.trajectory, EASY).ok
    assert result.trajectory.kinematic == planner.startswith("s-rrt")
    assert (result.planner, result.seed) == (planner, 5)
    assert result.nodes == len(result.tree) > 1
    assert result.samples > 0
    assert 0.0 < result.planning_time < 30.0


@pytest.mark.parametrize("planner", ["cb-rrt", "cb-rrt-compiled", "rrt"])
def test_heading_and_speed_of_the_goal_are_obeyed(planner: str) -> None:
    goal = Goal(7.0, 5.0, tolerance=1.0, theta=math.pi / 2, heading_tolerance=0.6, speed_tolerance=0.5)
    scenario = Scenario(name="arrive", world=World(BOUNDS), start=State(3.0, 5.0), goal=goal)
    result = plan(scenario, planner, seed=1, time_limit=30.0)
    assert result.status == "solved"
    assert result.trajectory is not None
    assert goal.violations(State(*result.trajectory.states[-1])) == []
    assert verify(result.trajectory, scenario).ok


@pytest.mark.parametrize("planner", ["cb-rrt", "cb-rrt-compiled"])
def test_a_closed_loop_is_solved_and_verified(planner: str) -> None:
    scenario = replace(EASY, planning=replace(EASY.planning, closed_loop=True))
    result = plan(scenario, planner, seed=1)
    assert result.status == "solved"
    assert result.trajectory is not None
    assert verify(result.trajectory, scenario).ok
    assert fingerprint(result) != fingerprint(plan(EASY, planner, seed=1))


@pytest.mark.parametrize("planner", PLANNERS)
def test_who_starts_in_the_goal_stays_there(planner: str) -> None:
    scenario = replace(EASY, start=State(8.1, 8.1, 0.3))
    result = plan(scenario, planner, seed=1)
    assert result.status == "solved"
    assert result.trajectory is not None
    assert len(result.trajectory) == 1
    assert result.trajectory.duration == 0.0
    assert result.trajectory.states[0].tolist() == [8.1, 8.1, 0.3, 0.0, 0.0]
    assert verify(result.trajectory, scenario).ok
    assert (result.nodes, result.samples, len(result.tree)) == (1, 0, 1)


# limits


@pytest.mark.parametrize("planner", [planner for planner in PLANNERS if not planner.startswith("syclop")])
def test_a_time_limit_is_kept(planner: str) -> None:
    """The best of three: a busy machine is not the planner's fault."""
    excess = math.inf
    for _ in range(3):
        began = time.perf_counter()
        result = plan(UNSOLVABLE, planner, seed=1, time_limit=0.5)
        assert result.status == "time limit"
        assert result.trajectory is None
        assert not result.solved
        assert result.planning_time >= 0.5
        excess = min(excess, time.perf_counter() - began - 0.5)
        if excess < 0.2:
            break
    assert excess < 0.2


@pytest.mark.parametrize("planner", [planner for planner in PLANNERS if planner.startswith("syclop")])
def test_a_time_limit_ends_a_plan_of_syclop(planner: str) -> None:
    result = plan(UNSOLVABLE, planner, seed=1, time_limit=0.5)
    assert result.status == "time limit"
    assert result.trajectory is None


@pytest.mark.parametrize("planner", [planner for planner in PLANNERS if planner.startswith("syclop")])
def test_a_short_time_limit_is_kept_by_syclop(planner: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Counted, not timed: 10,000 states take 0.03 to 0.1 s."""
    from cbrrt_ompl.ompl_plugin.validity import FclStateValidityChecker

    judged = []
    original = FclStateValidityChecker.isValid

    def counted(self: FclStateValidityChecker, state: object) -> bool:
        judged.append(1)
        return original(self, state)

    monkeypatch.setattr(FclStateValidityChecker, "isValid", counted)
    plan(UNSOLVABLE, planner, seed=1, time_limit=1e-3)
    assert len(judged) <= 10_000


@pytest.mark.parametrize("planner", PLANNERS)
def test_the_samples_of_a_plan_are_limited_whatever_the_time(planner: str) -> None:
    scenario = replace(UNSOLVABLE, planning=replace(UNSOLVABLE.planning, max_samples=137))
    result = plan(scenario, planner, seed=1, time_limit=3600.0)
    assert result.status == "sample limit"
    assert result.samples == 137
    assert result.trajectory is None


@pytest.mark.parametrize("planner", ["cb-rrt", "rrt", "cb-rrt-compiled"])
def test_progress_is_reported_about_ten_times_a_second(planner: str) -> None:
    reports: list[tuple[int, float]] = []
    plan(UNSOLVABLE, planner, seed=1, time_limit=0.45, progress=lambda *report: reports.append(report))
    samples, times = zip(*reports, strict=True)
    assert 1 <= len(reports) <= 4
    assert sorted(samples) == list(samples)
    assert samples[0] > 0
    assert np.diff([0.0, *times]).min() >= 0.099
    assert times[-1] < 0.45


@pytest.mark.parametrize("planner", ["cb-rrt", "rrt", "cb-rrt-compiled"])
def test_an_exception_in_the_progress_callback_reaches_the_caller(planner: str) -> None:
    def fail(samples: int, elapsed: float) -> None:
        raise LookupError("on purpose")

    with pytest.raises(LookupError, match="on purpose"):
        plan(UNSOLVABLE, planner, seed=1, time_limit=5.0, progress=fail)


@pytest.fixture
def ctrl_c_soon() -> Iterator[threading.Timer]:
    """Sends this process a SIGINT 0.3 s after its start."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    timer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
    yield timer
    timer.cancel()
    timer.join()
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("planner", ["cb-rrt", "rrt", "sst", "cb-rrt-compiled", "s-rrt-compiled"])
def test_ctrl_c_ends_a_plan_and_spoils_nothing(planner: str, ctrl_c_soon: threading.Timer) -> None:
    expected = fingerprint(plan(EASY, planner, seed=5))
    began = time.perf_counter()
    ctrl_c_soon.start()
    with pytest.raises(KeyboardInterrupt):
        plan(UNSOLVABLE, planner, seed=1, time_limit=30.0)
    assert time.perf_counter() - began < 0.8
    assert fingerprint(plan(EASY, planner, seed=5)) == expected


# what is refused


def test_an_unknown_planner_is_told_the_known_ones() -> None:
    with pytest.raises(UnknownPlannerError) as caught:
        plan(EASY, "rtt")
    assert "'rtt'" in str(caught.value)
    for planner in PLANNERS:
        assert planner in str(caught.value)


@pytest.mark.parametrize("seed", [-1, 2**32 - 1, 1.5, "1", math.nan])
def test_a_seed_that_is_none_is_refused(seed: object) -> None:
    with pytest.raises(SettingsError, match="seed.*a whole number from 0 to 4294967294"):
        plan(EASY, seed=seed)


@pytest.mark.parametrize("time_limit", [0.0, -1.0, math.nan, "5", None])
def test_a_time_limit_that_is_none_is_refused(time_limit: object) -> None:
    with pytest.raises(SettingsError, match=r"time_limit.*a number above 0 \[s\]"):
        plan(EASY, time_limit=time_limit)


def test_a_bad_seed_and_a_bad_time_limit_are_reported_together() -> None:
    with pytest.raises(SettingsError, match=r"(?s)seed.*time_limit"):
        plan(EASY, seed=-1, time_limit=-1.0)


def test_a_step_too_long_for_the_robot_is_refused() -> None:
    scenario = replace(EASY, planning=PlanningSettings(step=1.0))
    with pytest.raises(SettingsError, match="planning.step"):
        plan(scenario)


@pytest.mark.parametrize("seed", [0, 2**32 - 2])
@pytest.mark.parametrize("planner", ["cb-rrt", "cb-rrt-compiled"])
def test_the_smallest_and_the_largest_seed_are_taken(planner: str, seed: int) -> None:
    result = plan(EASY, planner, seed=seed, time_limit=math.inf)
    assert result.status == "solved"
    assert result.seed == seed


@pytest.mark.parametrize(
    "planner",
    [
        "cb-rrt",
        "cb-rrt-compiled",
    ],
)
def test_a_seed_of_numpy_is_the_seed_of_python(planner: str) -> None:
    assert fingerprint(plan(EASY, planner, seed=np.int64(7))) == fingerprint(plan(EASY, planner, seed=7))


# one seed, one result


@pytest.mark.parametrize("planner", PLANNERS)
def test_one_seed_is_one_result_after_other_plans_too(planner: str) -> None:
    expected = fingerprint(plan(easy(), planner, seed=5))
    for other in {"cb-rrt", "rrt", "cb-rrt-compiled"} & set(available_planners()):
        plan(EASY, other, seed=6)
    assert fingerprint(plan(EASY, planner, seed=5)) == expected


@pytest.mark.parametrize("planner", ["cb-rrt", "s-rrt", "cb-rrt-compiled", "s-rrt-compiled", "rrt", "sst"])
def test_another_seed_is_another_result(planner: str) -> None:
    assert fingerprint(plan(EASY, planner, seed=5)) != fingerprint(plan(EASY, planner, seed=6))


@pytest.mark.needs_ompl
@pytest.mark.slow
def test_one_seed_is_one_result_in_another_process() -> None:
    """Backwards there, so that neither the order nor the addresses are those of this process."""
    code = f"""import json, sys
sys.path.insert(0, {os.path.dirname(__file__)!r})
from test_planning import EASY, PLANNERS, fingerprint, plan
print(json.dumps({{p: fingerprint(plan(EASY, p, seed=5)) for p in reversed(PLANNERS)}}))"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == {planner: fingerprint(plan(EASY, planner, seed=5)) for planner in PLANNERS}


@pytest.mark.parametrize("planner", ["cb-rrt", "rrt", "cb-rrt-compiled"])
def test_without_a_seed_each_plan_is_another(planner: str) -> None:
    assert fingerprint(plan(EASY, planner)) != fingerprint(plan(EASY, planner))


@pytest.mark.parametrize("planner", ["cb-rrt", "rrt", "cb-rrt-compiled"])
def test_a_plan_without_a_seed_is_a_fresh_one_after_a_seeded_plan(planner: str) -> None:
    fingerprints = []
    for _ in range(2):
        plan(EASY, planner, seed=5)
        fingerprints.append(fingerprint(plan(EASY, planner)))
    assert fingerprints[0] != fingerprints[1]
