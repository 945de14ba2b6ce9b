"""The robust planner: what it passes over, that it is repeatable, and that it solves where plain CB-RRT sticks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cbrrt_ompl import (
    ROBOTS,
    Bounds,
    Box,
    Gains,
    Goal,
    Limits,
    PlanningSettings,
    Robot,
    Scenario,
    State,
    World,
    load_scenario,
    make_setup,
    plan,
    verify,
)
from cbrrt_ompl.ompl_plugin.availability import has_ompl
from cbrrt_ompl.planners.growth import shortened, tolerated_failures
from cbrrt_ompl.planners.registry import law_of
from cbrrt_ompl.planners.search import Search, search_in
from cbrrt_ompl.problem.settings import NEAREST_NEIGHBOUR

if has_ompl():
    from cbrrt_ompl.ompl_plugin.compiled_planner import CompiledPlanner

ROBUST = "cb-rrt-robust"


def ended_search(scenario: Scenario, seed: int) -> Search:
    """A search that has ended."""
    search = search_in(scenario, law_of("cb-rrt", scenario.planning), seed, robust=True)
    search.run(lambda _: False, scenario.planning.max_samples)
    return search


@pytest.fixture
def blind_alley() -> Scenario:
    """A deep U that opens away from the goal, the robot inside, its back to the way out."""
    walls = [Box((1.0, -1.0), (1.2, 1.0)), Box((-3.0, 1.0), (1.2, 1.2)), Box((-3.0, -1.2), (1.2, -1.0))]
    return Scenario(
        name="blind alley",
        world=World(Bounds((-5.0, -5.0), (5.0, 5.0)), walls),
        start=State(0.5, 0.0),
        goal=Goal(4.0, 0.0),
        planning=PlanningSettings(goal_bias=0.05, max_samples=20_000),
    )


@pytest.mark.parametrize("failures", [0, 1, 6, 30])
def test_failures_set_the_chance_to_be_passed_over(failures: int) -> None:
    draws = (np.arange(2000) + 0.5) / 2000
    tolerated = np.mean([failures <= tolerated_failures(draw) for draw in draws])
    assert tolerated == pytest.approx(1.0 / (1.0 + failures), abs=1e-3)


def test_a_draw_of_zero_passes_nothing_over() -> None:
    assert tolerated_failures(0.0) == np.inf


@pytest.mark.parametrize(("failures", "distance"), [(0, 4.0), (1, 1.0), (3, 0.5), (30, 0.25)])
def test_failures_shorten_the_way_of_the_next_extension(failures: int, distance: float) -> None:
    assert shortened((5.0, 1.0), 1.0, 1.0, failures, 2.0) == pytest.approx((1.0 + distance, 1.0))


def test_a_sample_within_look_ahead_is_drawn_nearer_too() -> None:
    assert shortened((2.0, 1.0), 1.0, 1.0, 1, 2.0) == pytest.approx((1.5, 1.0))
    assert shortened((1.0, 1.0), 1.0, 1.0, 5, 2.0) == (1.0, 1.0)


@pytest.mark.parametrize("seed", range(5))
def test_rooms_that_are_crossed_in_a_part_of_the_horizon_are_no_trap(seed: int) -> None:
    walls = []
    for c in (1, 2, 3):
        for low in range(4):
            for first, last in ((low, low + 0.2), (low + 0.8, low + 1.0)):
                walls.append(Box((c - 0.02, first), (c + 0.02, last)))
                walls.append(Box((first, c - 0.02), (last, c + 0.02)))
    scenario = Scenario(
        name="rooms of 1 m",
        world=World(Bounds((0.0, 0.0), (4.0, 4.0)), walls),
        robot=ROBOTS["jackal"],
        start=State(0.5, 0.5, 0.3),
        goal=Goal(3.5, 3.5, tolerance=0.2),
        planning=PlanningSettings(max_samples=60_000),
    )
    result = plan(scenario, ROBUST, seed, time_limit=60.0)
    assert result.status == "solved" and result.trajectory is not None
    assert verify(result.trajectory, scenario).ok


def test_every_failed_extension_is_counted_at_a_place(blind_alley: Scenario) -> None:
    world = replace(blind_alley, goal=Goal(4.0, 0.0, tolerance=1e-9), planning=PlanningSettings(max_samples=3000))
    search = ended_search(world, 1)
    is_place = search._tree["place"][: search.nodes] == np.arange(search.nodes)
    failed = search.samples - (search.nodes - 1)
    assert failed == search.refusals + search.collisions
    assert search.failures[is_place].sum() == failed
    assert not is_place.all()


@pytest.mark.parametrize("neighbours", NEAREST_NEIGHBOUR)
@pytest.mark.parametrize("closed_loop", [False, True])
def test_one_seed_gives_one_trajectory(blind_alley: Scenario, closed_loop: bool, neighbours: str) -> None:
    settings = replace(blind_alley.planning, closed_loop=closed_loop, nearest_neighbour=neighbours)
    scenario = replace(blind_alley, planning=settings)
    first, second = (plan(scenario, ROBUST, seed=5, time_limit=60.0) for _ in range(2))
    assert (first.status, second.status) == ("solved", "solved")
    assert first.trajectory.x.tobytes() == second.trajectory.x.tobytes()
    assert verify(first.trajectory, scenario).ok


@pytest.mark.parametrize("seed", range(4))
def test_all_ways_to_find_the_nearest_node_grow_the_same_tree(blind_alley: Scenario, seed: int) -> None:
    """Point turns put many nodes at one position, of which only one is indexed and counted."""
    trees = []
    for neighbours in NEAREST_NEIGHBOUR:
        scenario = replace(blind_alley, planning=replace(blind_alley.planning, nearest_neighbour=neighbours))
        trees.append(plan(scenario, ROBUST, seed=seed, time_limit=60.0).tree)
    for other in trees[1:]:
        assert np.array_equal(trees[0].states, other.states)


@pytest.mark.parametrize("seed", range(5))
def test_solutions_are_valid(blind_alley: Scenario, seed: int) -> None:
    result = plan(blind_alley, ROBUST, seed=seed, time_limit=60.0)
    assert result.status == "solved"
    assert verify(result.trajectory, blind_alley).ok
    assert len(result.tree) == result.nodes


def test_half_the_samples_of_the_plain_planner_do_in_the_maze(scenarios: Path) -> None:
    """The plain planner keeps extending nodes at the walls, which are nearest to most samples."""
    maze = load_scenario(scenarios / "maze.yaml")
    same = replace(maze.planning, closed_loop=False, goal_bias=0.0, max_samples=50_000)
    maze = replace(maze, planning=same, robot=replace(maze.robot, gains=Gains()))
    medians = {}
    for planner in ("cb-rrt-compiled", ROBUST):
        results = [plan(maze, planner, seed=seed, time_limit=60.0) for seed in range(11)]
        medians[planner] = np.median([r.samples if r.solved else np.inf for r in results])
    assert 2.0 * medians[ROBUST] < medians["cb-rrt-compiled"]


@pytest.mark.needs_ompl
def test_the_planner_of_ompl_grows_the_same_tree(blind_alley: Scenario) -> None:
    settings = replace(blind_alley.planning, max_samples=500)
    scenario = replace(blind_alley, goal=Goal(4.0, 0.0, tolerance=1e-9), planning=settings)
    setup = make_setup(scenario, ROBUST)
    planner = CompiledPlanner(setup.getSpaceInformation(), scenario, ROBUST, seed=2)
    setup.setPlanner(planner)
    assert not setup.solve(60.0)
    result = plan(scenario, ROBUST, seed=2, time_limit=60.0)
    assert result.status == "sample limit"
    assert np.array_equal(planner.search.edges()[0], result.tree.states)


def test_a_reversing_robot_is_planned_for(blind_alley: Scenario) -> None:
    scenario = replace(blind_alley, robot=Robot(limits=Limits(v_min=-0.5)))
    result = plan(scenario, ROBUST, seed=1, time_limit=60.0)
    assert result.status == "solved"
    assert verify(result.trajectory, scenario).ok
