"""cb-rrt-ao: trees bounded by the best plan so far keep what may be quicker, and nothing else."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from kernels import plain, record_of

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import SettingsError
from cbrrt_ompl.motion.model import OPEN_LOOP, make_model
from cbrrt_ompl.optimise import Objective
from cbrrt_ompl.optimise.improving import Found
from cbrrt_ompl.planners.bounded import TREE_SAMPLES, BoundedTrees
from cbrrt_ompl.planners.growth import drawn_steps, steps_left
from cbrrt_ompl.planners.registry import law_of, scenario_for
from cbrrt_ompl.planners.search import Search, search_in
from cbrrt_ompl.planning import PlanResult, plan
from cbrrt_ompl.problem.obstacles import Bounds, Box
from cbrrt_ompl.problem.ready_robots import rectangle
from cbrrt_ompl.problem.robot import Limits, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.verification import verify

AO = "cb-rrt-ao"

SCENARIO = Scenario(
    name="two ways",
    world=World(Bounds((0.0, 0.0), (8.0, 4.0)), [Box((3.0, 1.0), (5.0, 2.4))]),
    robot=Robot(rectangle(0.5, 0.25), Limits(-0.5, 0.5, -0.5, 0.5, 0.25, 0.25)),
    start=State(1.0, 1.5),
    goal=Goal(7.0, 1.5, tolerance=0.2),
)
"""A block that can be passed on either side."""


def planned(scenario: Scenario = SCENARIO, **arguments: Any) -> PlanResult:
    result = plan(scenario, AO, **{"seed": 1, "time_limit": 60.0, **arguments})
    assert result.solved
    return result


def first_search(scenario: Scenario, seed: int) -> Search:
    scenario = scenario_for(AO, scenario)
    search = search_in(scenario, law_of(AO, scenario.planning), seed, robust=True)
    search.run(lambda _: False, 500_000)
    assert search.has_reached_goal
    return search


SCENES = pytest.mark.parametrize(
    "scenario",
    [
        SCENARIO,
        replace(SCENARIO, goal=Goal(7.0, 1.5, tolerance=0.2, theta=1.0, speed_tolerance=0.05)),
        replace(SCENARIO, planning=PlanningSettings(nearest_neighbour="kd-tree", cut_extension="keep")),
        replace(SCENARIO, planning=PlanningSettings(nearest_neighbour="brute-force", brake_safe=True)),
    ],
    ids=["disc", "at rest", "k-d tree", "brute force"],
)


@SCENES
def test_every_plan_is_quicker_than_the_one_before_and_passes_verify(scenario: Scenario) -> None:
    trees = BoundedTrees(first_search(scenario, 3), 3)
    durations = [trees.best.trajectory().duration]
    while trees.find_quicker(lambda _: False, 150_000):
        trajectory = trees.best.trajectory()
        assert verify(trajectory, scenario).violations == ()
        durations.append(trajectory.duration)
    assert len(durations) > 1
    assert all(later < earlier - 1e-9 for earlier, later in pairwise(durations))
    assert trees.samples == 150_000


@SCENES
def test_the_cost_of_a_node_is_its_time_along_the_tree_and_within_the_bound(scenario: Scenario) -> None:
    first = first_search(scenario, 2)
    bound = int(first.total_steps[-1]) - 1
    tree = first.again(5, bound)
    tree.run(lambda _: False, TREE_SAMPLES)
    for search in (first, tree):
        assert search.nodes > 10
        states, parents, _, steps = search.edges()
        along = steps.copy()
        for node in range(1, search.nodes):  # parents come before their children
            along[node] += along[parents[node]]
        assert search.total_steps.tolist() == along.tolist()
    goal, limits = scenario.goal, scenario.robot.limits
    left = np.maximum(np.hypot(states[:, 0] - goal.x, states[:, 1] - goal.y) - goal.tolerance, 0.0)
    needed = along + left / (limits.v_max * scenario.planning.step)
    assert needed.max() <= bound
    assert first.total_steps.max() > bound


def test_no_trajectory_is_quicker_than_the_bound_says() -> None:
    """At every row of a trajectory, the steps that are left are no less than the lower bound of them."""
    search = first_search(SCENARIO, 4)
    trajectory, model = search.trajectory(), record_of(search.model)
    left = np.array([plain(steps_left)(x, y, model) for x, y in trajectory.poses[:, :2].tolist()])
    remaining = np.arange(len(trajectory))[::-1]
    assert (left <= remaining + 1e-9).all()
    assert left[0] == pytest.approx((6.0 - 0.2) / (0.5 * 0.05))


def test_the_drawn_cost_leaves_time_for_the_way_from_the_sample_to_the_goal() -> None:
    robot, settings = Robot(limits=Limits(v_max=2.0, v_min=-4.0)), PlanningSettings(step=0.1)
    model = record_of(make_model(OPEN_LOOP, robot, Goal(9.0, 0.0, tolerance=1.0), settings))
    assert plain(steps_left)(1.0, 0.0, model) == pytest.approx(7.0 / (4.0 * 0.1))
    assert plain(steps_left)(9.5, 0.0, model) == 0.0
    assert plain(drawn_steps)(0.5, (1.0, 0.0), 30.0, model) == pytest.approx(0.5 * (30.0 - 17.5))
    assert plain(drawn_steps)(0.5, (1.0, 0.0), 17.0, model) == 0.0


# plan


def test_the_first_plan_is_that_of_the_robust_planner_and_no_later_one_is_worse() -> None:
    for seed in range(5):
        first = plan(SCENARIO, "cb-rrt-robust", seed=seed)
        assert first.trajectory is not None
        result = planned(seed=seed, max_iterations=20_000)
        assert result.history[0].duration == first.trajectory.duration
        assert result.trajectory is not None
        assert result.trajectory.duration <= first.trajectory.duration
    assert planned(seed=0, max_iterations=0).trajectory == plan(SCENARIO, "cb-rrt-robust", seed=0).trajectory


def test_the_history_falls_and_ends_at_the_trajectory() -> None:
    heard = list[Found]()
    result = planned(max_iterations=50_000, callback=heard.append)
    assert result.history == tuple(heard)
    assert result.history[0].source == AO
    assert len(result.history) > 2
    assert all(a.duration > b.duration and a.time <= b.time for a, b in pairwise(result.history))
    assert result.trajectory is not None
    assert result.trajectory.duration == result.history[-1].duration
    assert verify(result.trajectory, SCENARIO).ok
    assert result.nodes == len(result.tree)


def test_it_ends_by_its_samples_and_repeats_itself() -> None:
    scenario = replace(SCENARIO, planning=PlanningSettings(max_samples=40_000))
    first, second = planned(scenario), planned(scenario)
    assert first.samples == second.samples == 40_000
    assert first.trajectory == second.trajectory
    assert [row[1:] for row in first.history] == [row[1:] for row in second.history]
    assert planned(scenario, seed=2).trajectory != first.trajectory
    assert planned().samples == plan(SCENARIO, "cb-rrt-robust", seed=1).samples + 50_000


def test_samples_of_an_improvement_are_counted_from_the_first_plan_on() -> None:
    first = plan(SCENARIO, "cb-rrt-robust", seed=1)
    assert planned(max_iterations=25_000).samples == first.samples + 25_000


def test_time_ends_it() -> None:
    result = planned(improve_for=0.3)
    assert result.planning_time - result.history[0].time < 0.8
    assert result.samples > 1000
    assert planned(time_limit=0.3, seed=2).planning_time < 0.8


def test_a_request_to_stop_leaves_the_first_plan() -> None:
    assert [row.source for row in planned(should_stop=lambda: True).history] == [AO]


def test_progress_counts_the_samples_of_all_trees() -> None:
    reports = list[tuple[int, float]]()
    planned(improve_for=0.45, progress=lambda *report: reports.append(report))
    samples = [count for count, _ in reports]
    assert samples == sorted(samples)
    assert samples[-1] > TREE_SAMPLES


def test_an_objective_other_than_the_duration_is_refused() -> None:
    with pytest.raises(SettingsError, match=r"objective.*None for cb-rrt-ao, whose cost is the duration"):
        planned(objective=Objective(length=1.0))
    assert planned(objective=Objective(), max_iterations=100).solved


def test_no_way_is_no_plan() -> None:
    scenario = replace(SCENARIO, world=World(Bounds((0.0, 0.0), (8.0, 4.0)), [Box((3.0, 0.0), (5.0, 4.0))]))
    result = plan(scenario, AO, seed=1, time_limit=0.2)
    assert not result.solved
    assert result.history == ()


# in OMPL


@pytest.mark.needs_ompl
def test_in_ompl_trees_are_bounded_where_the_duration_is_the_objective() -> None:
    from cbrrt_ompl import make_setup, trajectory_from_path

    setup = make_setup(SCENARIO, AO)
    assert setup.solve(1.0).asString() == "Exact solution"
    costs = [row.cost for row in setup.getPlanner().progress]
    assert len(costs) > 2
    assert all(later < earlier for earlier, later in pairwise(costs))
    trajectory = trajectory_from_path(setup.getSolutionPath(), SCENARIO)
    assert trajectory.duration == pytest.approx(costs[-1])
    assert verify(trajectory, SCENARIO).ok
    ends = setup.getPlanner().search.total_steps * SCENARIO.planning.step
    assert ends.max() < costs[-2] - 0.5 * SCENARIO.planning.step


@pytest.mark.needs_ompl
def test_in_ompl_another_objective_is_honoured_without_a_bound() -> None:
    from ompl import base as ob

    from cbrrt_ompl import make_setup

    bounds = list[float]()
    setup = make_setup(SCENARIO, AO)
    planner = setup.getPlanner()
    original = planner._new_search
    planner._new_search = lambda starts, most=math.inf: bounds.append(most) or original(starts, most)
    setup.setOptimizationObjective(ob.PathLengthOptimizationObjective(setup.getSpaceInformation()))
    assert setup.solve(0.5).asString() == "Exact solution"
    assert len(bounds) > 2 and set(bounds) == {math.inf}
    bounds.clear()
    other = make_setup(SCENARIO, AO)
    original = other.getPlanner()._new_search
    other.getPlanner()._new_search = lambda starts, most=math.inf: bounds.append(most) or original(starts, most)
    assert other.solve(0.5).asString() == "Exact solution"
    assert math.isinf(bounds[0]) and len(bounds) > 2 and max(bounds[1:]) < math.inf


@pytest.mark.needs_ompl
def test_in_ompl_a_users_checker_is_obeyed_by_every_solution() -> None:
    from ompl import base as ob

    from cbrrt_ompl import make_setup, read_state, trajectory_from_path

    setup = make_setup(SCENARIO, AO)
    checker = ob.StateValidityCheckerFn(lambda state: read_state(state).y < 3.5 and SCENARIO.world.clearance(
        SCENARIO.robot.footprint, read_state(state)[:3]) > 0.0)  # fmt: skip
    setup.setStateValidityChecker(checker)
    assert setup.solve(5.0).asString() == "Exact solution"
    assert max(trajectory_from_path(setup.getSolutionPath(), SCENARIO).y) < 3.5
