"""Plans that are improved: by every planner on request, and by the anytime planner of itself."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import SettingsError
from cbrrt_ompl.optimise import Found
from cbrrt_ompl.optimise.anytime import mirrored
from cbrrt_ompl.optimise.guesses import geodesic
from cbrrt_ompl.planners.registry import PLANNERS
from cbrrt_ompl.planning import PlanResult, plan
from cbrrt_ompl.problem.obstacles import Bounds, Box
from cbrrt_ompl.problem.ready_robots import rectangle
from cbrrt_ompl.problem.robot import Limits, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.verification import verify

ANYTIME = "cb-rrt-anytime"

TWO_WAYS = World(Bounds((0.0, 0.0), (8.0, 4.0)), [Box((3.0, 1.0), (5.0, 2.4))])
"""A block that can be passed on either side."""

SCENARIO = Scenario(
    name="two ways",
    world=TWO_WAYS,
    robot=Robot(rectangle(0.5, 0.25), Limits(-0.5, 0.5, -0.5, 0.5, 0.25, 0.25)),
    start=State(1.0, 1.5),
    goal=Goal(7.0, 1.5, tolerance=0.2),
)


def planned(scenario: Scenario = SCENARIO, planner: str = ANYTIME, **arguments: Any) -> PlanResult:
    result = plan(scenario, planner, **{"seed": 1, "time_limit": 20.0, **arguments})
    assert result.solved
    return result


@pytest.mark.slow
@pytest.mark.parametrize("planner", [name for name in PLANNERS if not name.startswith("syclop")])
def test_every_planner_improves_its_plan_on_request(planner: str) -> None:
    scenario = replace(SCENARIO, world=World(TWO_WAYS.bounds), goal=Goal(3.0, 2.0, tolerance=0.5))
    plain = PlanResult if PLANNERS[planner].is_anytime else plan(scenario, planner, seed=1, time_limit=20.0)
    result = planned(scenario, planner, max_iterations=200)
    assert result.trajectory is not None
    assert verify(result.trajectory, scenario).violations == ()
    assert result.history[-1].duration == result.trajectory.duration
    if isinstance(plain, PlanResult) and plain.trajectory is not None:
        assert result.trajectory.duration < plain.trajectory.duration
        assert plain.history == ()


def test_the_history_tells_when_which_guess_gave_what() -> None:
    heard = list[Found]()
    result = planned(callback=heard.append)
    assert result.history == tuple(heard)
    assert result.history[0].source == ANYTIME
    assert all(a.duration > b.duration and a.time <= b.time for a, b in pairwise(result.history))


def test_the_anytime_planner_ends_by_itself_and_repeats_itself() -> None:
    first, second = planned(), planned()
    assert first.trajectory == second.trajectory
    assert [row.source for row in first.history] == [row.source for row in second.history]


def test_seeds_end_near_the_same_duration() -> None:
    durations = [planned(seed=seed).history[-1].duration for seed in range(4)]
    assert max(durations) < 1.02 * min(durations)


def test_time_caps_an_improvement() -> None:
    result = planned(improve_for=0.05)
    assert result.history[-1].time - result.history[0].time < 0.5


def test_a_request_to_stop_leaves_the_first_plan() -> None:
    result = planned(should_stop=lambda: True)
    assert [row.source for row in result.history] == [ANYTIME]


def test_the_anytime_planner_finds_what_no_tree_does() -> None:
    """With one sample CB-RRT has no plan, but a geodesic is a guess, too."""
    scenario = replace(SCENARIO, planning=PlanningSettings(max_samples=1))
    result = planned(scenario)
    assert result.trajectory is not None
    assert verify(result.trajectory, scenario).ok


def test_no_way_is_no_plan() -> None:
    scenario = replace(SCENARIO, world=World(TWO_WAYS.bounds, [Box((3.0, 0.0), (5.0, 4.0))]))
    result = plan(scenario, ANYTIME, seed=1, time_limit=0.2, max_iterations=50)
    assert not result.solved
    assert result.history == ()


def test_a_plan_that_is_not_improved_has_no_history() -> None:
    assert planned(planner="cb-rrt-robust").history == ()


def test_a_start_in_the_goal_needs_no_improvement() -> None:
    result = planned(replace(SCENARIO, start=State(7.0, 1.5)))
    assert result.trajectory is not None
    assert result.trajectory.duration == 0.0


@pytest.mark.parametrize("arguments", [{"improve_for": -1.0}, {"max_iterations": -1}, {"objective": 1.0}])
def test_arguments_that_make_no_sense_are_refused_by_name(arguments: dict[str, Any]) -> None:
    with pytest.raises(SettingsError, match=next(iter(arguments))):
        planned(**arguments)


def test_a_second_geodesic_goes_round_the_other_side() -> None:
    first = geodesic(SCENARIO)
    assert first is not None
    second = geodesic(SCENARIO, avoid=[first])
    assert second is not None
    middle = [path[np.argmin(np.abs(path[:, 0] - 4.0)), 1] for path in (first, second)]
    assert (middle[0] > 2.4) != (middle[1] > 2.4)


def test_a_mirrored_robot_mirrored_again_is_itself() -> None:
    scenario = replace(SCENARIO, goal=Goal(7.0, 1.5, theta=1.0))
    again = mirrored(mirrored(scenario))
    assert again.start == pytest.approx(scenario.start)
    assert again.goal.theta == pytest.approx(1.0)
    assert again.robot.limits == scenario.robot.limits
    assert mirrored(scenario).start.theta == pytest.approx(-math.pi)
