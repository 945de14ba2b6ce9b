"""Plans from several threads and processes at once: the results are those of plans alone."""

from __future__ import annotations

import copy
import multiprocessing
import pickle
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cbrrt_ompl import Goal, PlanningSettings, PlanResult, Scenario, load_scenario, plan, verify
from cbrrt_ompl.problem.robot import Footprint
from cbrrt_ompl.scenario.scenario import scenario_from_dict

JOBS = [
    (planner, seed)
    for planner in ("cb-rrt-compiled", "s-rrt-compiled", "cb-rrt-robust", "cb-rrt", "s-rrt", "rrt", "kpiece1")
    for seed in (1, 2)
]


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    """A wall with a gap, and a robot with corners, so that no disc decides all poses."""
    return scenario_from_dict(
        {
            "name": "gap",
            "bounds": {"min": [-5, -5], "max": [5, 5]},
            "obstacles": [
                {"type": "box", "min": [-5, -0.2], "max": [-0.6, 0.2]},
                {"type": "polygon", "vertices": [[0.6, -0.3], [5, -0.2], [5, 0.2], [0.6, 0.3]]},
                {"type": "disc", "center": [2, 2], "radius": 0.5},
            ],
            "robot": {
                "footprint": {"type": "polygon", "vertices": [[-0.3, -0.2], [0.3, -0.2], [0.3, 0.2], [-0.3, 0.2]]}
            },
            "start": {"x": -3, "y": -3},
            "goal": {"x": 3, "y": 3, "tolerance": 0.8},
            "planning": {"max_samples": 1500},
        }
    )


@pytest.fixture
def hasty_threads() -> Iterator[None]:
    """Threads that take turns as often as they can."""
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(interval)


def plan_without_clock(scenario: Scenario, planner: str, seed: int) -> PlanResult:
    return plan(scenario, planner, seed, float("inf"))


def assert_same(found: PlanResult, alone: PlanResult) -> None:
    assert (found.planner, found.seed, found.status) == (alone.planner, alone.seed, alone.status)
    assert (found.nodes, found.samples) == (alone.nodes, alone.samples)
    assert found.trajectory == alone.trajectory
    assert np.array_equal(found.tree.states, alone.tree.states)


@pytest.mark.needs_ompl
def test_plans_of_many_threads_are_those_of_one(scenario: Scenario, hasty_threads: None) -> None:
    alone = [plan_without_clock(scenario, *job) for job in JOBS]
    assert sum(result.solved for result in alone) > len(JOBS) / 2
    fresh = copy.deepcopy(scenario)  # a world of which no scene is made yet
    with ThreadPoolExecutor(4) as pool:
        futures: list[Future[PlanResult]] = [
            pool.submit(plan_without_clock, fresh, *job) for job in [*JOBS, *reversed(JOBS)]
        ]
        found = [future.result(timeout=60.0) for future in futures]
    for result, expected in zip(found, [*alone, *reversed(alone)], strict=True):
        assert_same(result, expected)


def test_queries_and_verification_in_one_thread_leave_plans_of_another_alone(
    scenario: Scenario, hasty_threads: None
) -> None:
    alone = plan_without_clock(scenario, "cb-rrt-compiled", 1)
    assert alone.trajectory is not None
    fresh, over = [copy.deepcopy(scenario) for _ in range(5)], threading.Event()

    def disturb() -> int:
        rounds = 0
        while not over.is_set():
            assert all(verify(alone.trajectory, one).ok for one in fresh)
            rounds += 1
        return rounds

    with ThreadPoolExecutor(1) as pool:
        disturbance = pool.submit(disturb)
        try:
            for one in fresh:
                assert_same(plan_without_clock(one, "cb-rrt-compiled", 1), alone)
        finally:
            over.set()
        assert disturbance.result(timeout=60.0) > 0


def test_queries_of_two_threads_do_not_meet(scenario: Scenario, hasty_threads: None) -> None:
    """FCL's object of the footprint used to be moved by one thread while another one asked about it."""
    footprint, places = scenario.robot.footprint, [(-3.0, -3.0, 0.3), (0.0, -1.0, 1.0), (2.0, 2.0, 0.0)]
    alone = [(scenario.world.clearance(footprint, p), scenario.world.referee(footprint).collides(*p)) for p in places]
    assert {collides for _, collides in alone} == {False, True}

    def ask(place: tuple[float, float, float]) -> set[tuple[float, bool]]:
        world, referee = scenario.world, scenario.world.referee(footprint)
        return {(world.clearance(footprint, place), referee.collides(*place)) for _ in range(2000)}

    with ThreadPoolExecutor(3) as pool:
        assert list(pool.map(ask, places)) == [{answers} for answers in alone]


def test_threads_share_the_scene_and_have_a_referee_each(scenario: Scenario) -> None:
    footprint, world = Footprint.disc(0.1), copy.deepcopy(scenario.world)
    with ThreadPoolExecutor(4) as pool:
        scenes = list(pool.map(lambda _: world.scene(footprint), range(8)))
        theirs = pool.submit(world.referee, footprint).result()
    assert all(scene is scenes[0] for scene in [*scenes, world.scene(footprint)])
    assert world.referee(footprint) is world.referee(footprint)
    assert theirs is not world.referee(footprint)


@pytest.mark.needs_ompl
def test_plans_of_many_processes_are_those_of_one(scenario: Scenario) -> None:
    jobs = [("cb-rrt-compiled", 1), ("cb-rrt", 2), ("cb-rrt-robust", 1)]
    alone = [plan_without_clock(scenario, *job) for job in jobs]
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        futures = [pool.submit(plan_without_clock, scenario, *job) for job in jobs]
        for future, expected in zip(futures, alone, strict=True):
            assert_same(future.result(timeout=120.0), expected)


@pytest.mark.needs_ompl
def test_a_plan_within_the_progress_of_another_does_not_wait_for_it(scenario: Scenario) -> None:
    inner: list[PlanResult] = []

    def progress(samples: int, elapsed: float) -> None:
        if not inner:
            inner.append(plan_without_clock(scenario, "cb-rrt", 1))

    endless = replace(scenario, goal=Goal(3.0, 3.0, tolerance=1e-9), planning=PlanningSettings(max_samples=10**9))
    plan(endless, "pdst", 1, 1.0, progress=progress)
    assert_same(inner[0], plan_without_clock(scenario, "cb-rrt", 1))


def test_scenarios_and_results_survive_pickle_and_deepcopy(scenarios: Path) -> None:
    office = load_scenario(scenarios / "office.yaml")
    for twin in (pickle.loads(pickle.dumps(office)), copy.deepcopy(office)):
        assert twin == office
    result = plan_without_clock(office, "cb-rrt-compiled", 1)
    assert_same(pickle.loads(pickle.dumps(result)), result)
