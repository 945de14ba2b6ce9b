"""The robust planner: what it passes over, that it is repeatable, and that it solves where plain CB-RRT sticks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cbrrt_ompl.collision.clearance_map import ClearanceMap

from cbrrt_ompl import (
    Bounds,
    Box,
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
from cbrrt_ompl.motion.model import law_of, pack_model
from cbrrt_ompl.ompl_plugin.compiled_planner import CompiledPlanner
from cbrrt_ompl.planners.growth import bearable_failures
from cbrrt_ompl.planners.nearest import BRUTE_FORCE, GRID, KD_TREE, Index, insert, nearest
from cbrrt_ompl.planners.search import Search
from cbrrt_ompl.problem.settings import NEAREST_NEIGHBOUR

ROBUST = "cb-rrt-robust"


def index_of(kind: int, positions: np.ndarray) -> tuple[Index, np.ndarray]:
    """An index over positions in [0, 10) x [0, 10), and room to search it."""
    states = np.zeros((len(positions), 5))
    states[:, :2] = positions
    heads = np.full((10, 10) if kind == GRID else (1, 1), -1, dtype=np.int32)
    occupied = np.array([2**31, -1, 2**31, -1, 0] if kind == GRID else [0] * 5)
    links = np.full((len(positions), 2), -1, dtype=np.int32)
    index = Index(kind, states, links, heads, occupied, 0.0, 0.0, 1.0)
    for node in range(len(positions)):
        insert(index, node)
    return index, np.empty((200, 3))


def search_in(scenario: Scenario, seed: int, clearance_map: ClearanceMap, *, robust: bool) -> Search:
    """A search that has ended."""
    planning = scenario.planning
    model = pack_model(law_of("cb-rrt", planning), scenario.robot, scenario.goal, planning)
    search = Search(
        model, clearance_map, [scenario.start], seed, goal_bias=planning.goal_bias,
        neighbours=planning.nearest_neighbour, robust=robust,
    )  # fmt: skip
    search.run(lambda _: False, planning.max_samples)
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


@pytest.mark.parametrize("kind", [GRID, KD_TREE, BRUTE_FORCE])
def test_the_nearest_node_within_the_limit_is_found(kind: int) -> None:
    rng = np.random.default_rng(1)
    positions, failures = rng.uniform(0.0, 10.0, (60, 2)), rng.integers(0, 20, 60).astype(np.int32)
    index, stack = index_of(kind, positions)
    for x, y, limit in rng.uniform((0.0, 0.0, 0.0), (10.0, 10.0, 20.0), (200, 3)):
        distances = np.where(failures <= limit, np.hypot(*(positions - (x, y)).T), np.inf)
        expected = int(distances.argmin()) if np.isfinite(distances).any() else -1
        assert nearest(index, x, y, len(positions), stack, failures, limit) == expected


@pytest.mark.parametrize("kind", [GRID, KD_TREE, BRUTE_FORCE])
def test_no_node_is_found_where_all_have_failed_too_often(kind: int) -> None:
    index, stack = index_of(kind, np.array([[2.0, 2.0], [7.0, 7.0]]))
    assert nearest(index, 6.0, 6.0, 2, stack, np.array([50, 50], dtype=np.int32), 10.0) == -1
    assert nearest(index, 6.0, 6.0, 2, stack, None, 0.0) == 1


@pytest.mark.parametrize("failures", [0, 1, 6, 30])
def test_failures_set_the_chance_to_be_passed_over(failures: int) -> None:
    draws = (np.arange(2000) + 0.5) / 2000
    borne = np.mean([failures <= bearable_failures(draw) for draw in draws])
    assert borne == pytest.approx(1.0 / (1.0 + failures), abs=1e-3)


def test_a_draw_of_zero_passes_nothing_over() -> None:
    assert bearable_failures(0.0) == np.inf


def test_every_failed_extension_is_counted_at_a_place(blind_alley: Scenario) -> None:
    world = replace(blind_alley, goal=Goal(4.0, 0.0, tolerance=1e-9), planning=PlanningSettings(max_samples=3000))
    search = search_in(world, 1, ClearanceMap(world.world, world.robot.footprint), robust=True)
    tree = search._tree
    is_place = tree.places[: search.nodes] == np.arange(search.nodes)
    failed = search.samples - (search.nodes - 1)
    assert search.failures[: search.nodes][is_place].sum() == failed
    assert not is_place.all()


def test_plain_searches_count_no_failures(blind_alley: Scenario) -> None:
    search = search_in(blind_alley, 1, ClearanceMap(blind_alley.world, blind_alley.robot.footprint), robust=False)
    assert search.failures.size == 0


def test_what_the_clearance_map_holds_changes_nothing(scenarios: Path) -> None:
    scenario = load_scenario(scenarios / "office.yaml")
    scenario = replace(scenario, planning=replace(scenario.planning, max_samples=150))
    footprint = scenario.robot.footprint
    grown = ClearanceMap(scenario.world, footprint)
    maps = [grown, grown, ClearanceMap(scenario.world, footprint, enabled=False)]
    first, again, without = (search_in(scenario, 3, m, robust=True).edges() for m in maps)
    for other in (again, without):
        assert all(np.array_equal(a, b) for a, b in zip(first, other, strict=True))


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
def test_brute_force_and_the_k_d_tree_grow_the_same_tree(blind_alley: Scenario, seed: int) -> None:
    """Point turns put many nodes at one position, of which only one is indexed and counted."""
    trees = []
    for neighbours in ("kd-tree", "brute-force"):
        scenario = replace(blind_alley, planning=replace(blind_alley.planning, nearest_neighbour=neighbours))
        trees.append(plan(scenario, ROBUST, seed=seed, time_limit=60.0).tree)
    assert np.array_equal(trees[0].states, trees[1].states)


@pytest.mark.parametrize("seed", range(5))
def test_solutions_are_valid(blind_alley: Scenario, seed: int) -> None:
    result = plan(blind_alley, ROBUST, seed=seed, time_limit=60.0)
    assert result.status == "solved"
    assert verify(result.trajectory, blind_alley).ok
    assert len(result.tree) == result.nodes


def test_half_the_samples_of_the_plain_planner_do_in_the_maze(scenarios: Path) -> None:
    """The plain planner keeps extending nodes at the walls, which are nearest to most samples."""
    maze = load_scenario(scenarios / "maze.yaml")
    medians = {}
    for planner in ("cb-rrt-compiled", ROBUST):
        results = [plan(maze, planner, seed=seed, time_limit=60.0) for seed in range(11)]
        medians[planner] = np.median([r.samples if r.solved else np.inf for r in results])
    assert 2.0 * medians[ROBUST] < medians["cb-rrt-compiled"]


def test_the_planner_of_ompl_grows_the_same_tree(blind_alley: Scenario) -> None:
    settings = replace(blind_alley.planning, max_samples=500)
    scenario = replace(blind_alley, goal=Goal(4.0, 0.0, tolerance=1e-9), planning=settings)
    clearance_map = ClearanceMap(scenario.world, scenario.robot.footprint)
    setup = make_setup(scenario)
    planner = CompiledPlanner(setup.getSpaceInformation(), scenario, ROBUST, clearance_map, seed=2)
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
