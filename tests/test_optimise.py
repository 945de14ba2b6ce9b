"""Laws of improved trajectories: never longer, never refused, all limits kept, the same on every run."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import SettingsError, TrajectoryError
from cbrrt_ompl.optimise import Found, Objective, improve, improving
from cbrrt_ompl.optimise.improving import Improver
from cbrrt_ompl.planning import plan
from cbrrt_ompl.problem.obstacles import Bounds, Box, Disc, Polygon
from cbrrt_ompl.problem.ready_robots import ROBOTS, rectangle
from cbrrt_ompl.problem.robot import Footprint, Limits, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.verification import verify

GAP = World(Bounds((0.0, 0.0), (6.0, 4.0)), [Box((2.8, 0.0), (3.2, 1.5)), Box((2.8, 2.4), (3.2, 4.0))])
"""A wall with a gap of 0.9 m."""

BOX_ROBOT = Robot(rectangle(0.5, 0.25), Limits(-0.5, 0.5, -0.5, 0.5, 0.25, 0.25))
"""Half a metre long, and as fast backwards as ahead."""

FORWARD_ROBOT = replace(BOX_ROBOT, limits=BOX_ROBOT.limits._replace(v_min=0.0))

WHEELED_ROBOT = ROBOTS["turtlebot3_burger"]

ELL = Footprint.polygon([(0.4, 0.3), (0.2, 0.3), (0.2, -0.1), (-0.3, -0.1), (-0.3, -0.3), (0.4, -0.3)])

TEE = Footprint.polygon(
    [(0.5, 0.1), (0.0, 0.1), (0.0, 0.35), (-0.3, 0.35), (-0.3, -0.35), (0.0, -0.35), (0.0, -0.1), (0.5, -0.1)]
)

START, GOAL = State(1.0, 1.0, 0.5), Goal(5.0, 3.0, tolerance=0.1)
ARRIVAL = Goal(5.0, 3.0, tolerance=0.1, theta=1.5, heading_tolerance=0.1, speed_tolerance=0.02)

CASES: dict[str, dict[str, Any]] = {
    "the paper's point": {},
    "a box that reverses": {"robot": BOX_ROBOT},
    "wheels": {"robot": WHEELED_ROBOT},
    "heading and rest": {"robot": BOX_ROBOT, "goal": ARRIVAL},
    "forward only, at rest": {
        "robot": replace(BOX_ROBOT, limits=BOX_ROBOT.limits._replace(v_min=0.0)),
        "goal": ARRIVAL,
    },
    "a moving start": {"robot": BOX_ROBOT, "start": State(1.0, 1.0, 0.5, -0.3, 0.4)},
    "able to brake": {"planning": PlanningSettings(brake_safe=True)},
    "clearance": {"robot": BOX_ROBOT, "planning": PlanningSettings(clearance=0.1)},
}


def scenario_of(**parts: Any) -> Scenario:
    return Scenario(**{"name": "gap", "world": GAP, "start": START, "goal": GOAL, **parts})


def planned(scenario: Scenario, seed: int = 1) -> Trajectory:
    result = plan(scenario, "cb-rrt-robust", seed=seed, time_limit=20.0)
    assert result.solved
    assert result.trajectory is not None
    return result.trajectory


@pytest.fixture(scope="module", params=CASES, ids=lambda name: name.replace(" ", "-"))
def improved(request: pytest.FixtureRequest) -> Iterator[tuple[Scenario, Trajectory, Trajectory]]:
    """A scenario, a plan in it, and what it was improved to."""
    scenario = scenario_of(**CASES[request.param])
    given = planned(scenario)
    yield scenario, given, improve(given, scenario, max_iterations=600)


@pytest.mark.slow
def test_an_improved_trajectory_is_much_shorter_than_a_plan(improved: tuple[Scenario, Trajectory, Trajectory]) -> None:
    _, given, better = improved
    assert better.duration < 0.9 * given.duration


@pytest.mark.slow
def test_verify_accepts_an_improved_trajectory(improved: tuple[Scenario, Trajectory, Trajectory]) -> None:
    scenario, _, better = improved
    assert verify(better, scenario).violations == ()


@pytest.mark.slow
def test_the_clearance_asked_for_is_kept(improved: tuple[Scenario, Trajectory, Trajectory]) -> None:
    scenario, _, better = improved
    least = min(scenario.world.clearance(scenario.robot.footprint, pose) for pose in better.poses)
    assert least >= max(scenario.planning.clearance, 5e-4)


@pytest.mark.slow
def test_no_limit_is_exceeded_between_the_rows(improved: tuple[Scenario, Trajectory, Trajectory]) -> None:
    scenario, _, better = improved
    limits, dt = scenario.robot.limits, np.diff(better.t)
    rim = np.abs(better.v) + 0.5 * limits.wheel_separation * np.abs(better.omega)
    a, alpha = np.abs(np.diff(better.v)) / dt, np.abs(np.diff(better.omega)) / dt
    assert limits.v_min <= better.v.min()
    assert better.v.max() <= limits.v_max
    assert limits.omega_min <= better.omega.min()
    assert better.omega.max() <= limits.omega_max
    assert rim.max() <= limits.wheel_speed
    assert a.max() <= limits.acceleration
    assert alpha.max() <= limits.angular_acceleration
    assert (a + 0.5 * limits.wheel_separation * alpha).max() <= limits.wheel_acceleration


@pytest.mark.slow
def test_rows_are_even_and_at_most_a_step_apart(improved: tuple[Scenario, Trajectory, Trajectory]) -> None:
    scenario, _, better = improved
    steps = np.diff(better.t)
    assert steps.max() <= scenario.planning.step * (1.0 + 1e-9)
    assert np.ptp(steps) < 1e-9


@pytest.mark.slow
def test_the_same_iterations_give_the_same_trajectory() -> None:
    scenario = scenario_of(robot=BOX_ROBOT)
    given = planned(scenario)
    assert improve(given, scenario, max_iterations=150) == improve(given, scenario, max_iterations=150)


def test_no_iterations_give_back_what_was_given() -> None:
    scenario = scenario_of()
    given = planned(scenario)
    assert improve(given, scenario, max_iterations=0) is given


@pytest.mark.slow
def test_improving_again_makes_nothing_longer() -> None:
    scenario = scenario_of(robot=BOX_ROBOT)
    once = improve(planned(scenario), scenario, max_iterations=400)
    assert improve(once, scenario, max_iterations=400).duration <= once.duration


def test_a_trajectory_of_one_row_stays_as_it_is() -> None:
    scenario = scenario_of(goal=Goal(START.x, START.y, tolerance=0.2))
    given = plan(scenario, "cb-rrt-compiled", seed=0).trajectory
    assert given is not None
    assert improve(given, scenario) is given


def test_the_callback_hears_of_shorter_and_shorter_trajectories() -> None:
    scenario, found = scenario_of(robot=BOX_ROBOT), list[Found]()
    better = improve(planned(scenario), scenario, max_iterations=300, callback=found.append)
    durations = [row.duration for row in found]
    assert found[0].source == "given"
    assert durations == sorted(durations, reverse=True)
    assert durations[-1] == better.duration


def test_a_request_to_stop_is_obeyed_at_once() -> None:
    scenario = scenario_of()
    given = planned(scenario)
    assert improve(given, scenario, should_stop=lambda: True) is given


def test_room_is_bought_with_time() -> None:
    """A robot that passes a corner keeps farther from it, and takes longer, if room is worth something."""
    scenario = scenario_of(robot=BOX_ROBOT)
    given = planned(scenario)
    fast = improve(given, scenario, max_iterations=400)
    roomy = improve(given, scenario, max_iterations=400, objective=Objective(room=1.0))
    assert verify(roomy, scenario).smallest_clearance > verify(fast, scenario).smallest_clearance + 0.05
    assert fast.duration < roomy.duration < 1.2 * fast.duration


def test_length_can_be_optimised_alone() -> None:
    scenario = scenario_of(robot=BOX_ROBOT)
    given = planned(scenario)
    objective = Objective(duration=0.01, length=1.0)
    short = improve(given, scenario, max_iterations=400, objective=objective)
    assert short.length <= improve(given, scenario, max_iterations=400).length + 1e-3
    assert objective.cost(short, scenario) < objective.cost(given, scenario)


def test_smoothness_lowers_the_accelerations() -> None:
    scenario = scenario_of(robot=BOX_ROBOT)
    given = planned(scenario)
    smooth = improve(given, scenario, max_iterations=400, objective=Objective(smoothness=2.0))
    fast = improve(given, scenario, max_iterations=400)

    def effort(trajectory: Trajectory) -> float:
        return float(np.sum(np.diff(trajectory.omega) ** 2 / np.diff(trajectory.t)))

    assert effort(smooth) < 0.7 * effort(fast)


def test_walls_of_a_millimetre_are_not_crossed() -> None:
    """A distance field with nodes every 5 cm would have no node inside of such a wall."""
    wall = Polygon(np.array([(2.0, 0.0), (2.001, 0.0), (2.001, 3.5), (2.0, 3.5)]))
    thin = World(Bounds((0.0, 0.0), (4.0, 4.0)), [wall, Box((1.0, 1.0), (1.001, 3.0))])
    scenario = scenario_of(world=thin, start=State(0.5, 2.0), goal=Goal(3.5, 1.0, tolerance=0.1))
    better = improve(planned(scenario), scenario, max_iterations=400)
    assert verify(better, scenario).ok


@pytest.mark.parametrize(("footprint", "width"), [(ELL, 0.8), (TEE, 0.9)], ids=["ell", "tee"])
def test_a_fast_robot_with_corners_is_improved_through_doors_in_thin_walls(footprint: Footprint, width: float) -> None:
    """Between two states of the solver corners passed through the walls; margins that forbade it closed the doors."""
    doors = [(2.0, 0.3), (4.0, 2.8)]  # where the wall is, and where its door begins [m]
    walls = [Box((x - 0.05, 0.0), (x + 0.05, low)) for x, low in doors]
    walls += [Box((x - 0.05, low + width), (x + 0.05, 4.0)) for x, low in doors]
    robot = Robot(footprint, Limits(-3.0, 3.0, -3.0, 3.0, 2.0, 4.0))
    world = World(Bounds((0.0, 0.0), (6.0, 4.0)), walls)
    scenario = scenario_of(world=world, robot=robot, start=State(1.0, 2.0), goal=Goal(5.0, 2.0, tolerance=0.2))
    better = improve(planned(scenario), scenario, max_iterations=2000)
    assert better.duration < 4.0
    assert verify(better, scenario).ok


@pytest.mark.parametrize("heading", [1.0, -1.0])
def test_a_long_way_through_a_hall_takes_few_iterations(heading: float) -> None:
    """A line search that lowered the merit at every step took ever smaller ones, and the plan was left as it was."""
    boxes = [Box((x, y), (x + 0.6, y + 0.6)) for x in range(20, 69, 12) for y in range(20, 69, 12)]
    scenario = scenario_of(
        world=World(Bounds((0.0, 0.0), (80.0, 80.0)), boxes),
        robot=Robot(rectangle(1.2, 0.5), Limits(-1.0, 1.0, -1.0, 1.0, 0.6, 1.0)),
        start=State(3.0, 5.0, heading),
        goal=Goal(75.0, 62.0, tolerance=0.25),
        planning=PlanningSettings(clearance=0.05),
    )
    better = improve(planned(scenario), scenario, max_iterations=200)
    assert better.duration < 1.03 * math.hypot(72.0, 57.0)  # at 1 m/s
    assert verify(better, scenario).ok


def test_other_guesses_may_take_the_place_of_the_geodesics(monkeypatch: pytest.MonkeyPatch) -> None:
    """`cb-rrt-anytime` tried the geodesics a second time where they had led to nothing before a plan was found."""
    scenario, asked = scenario_of(robot=BOX_ROBOT), []
    monkeypatch.setattr(improving, "geodesic_guesses", lambda scenario: asked.append(scenario) or [])
    given = planned(scenario)
    for others, times in ((None, 1), ([], 1)):
        improver = Improver(scenario, Objective(), max_iterations=400)
        improver.improve(given, "given", others)
        assert improver.best is not None
        assert improver.best.duration < given.duration
        assert len(asked) == times


def test_discs_polygons_and_odd_footprints_are_handled() -> None:
    pillar, slope = Disc((3.0, 2.0), 0.6), Polygon(np.array([(0.0, 2.5), (2.0, 4.0), (0.0, 4.0)]))
    wedge = Robot(Footprint.polygon([(-0.1, -0.2), (0.4, 0.0), (-0.1, 0.2), (0.0, 0.0)]))
    scenario = scenario_of(world=World(GAP.bounds, [pillar, slope]), robot=wedge)
    given = planned(scenario)
    better = improve(given, scenario, max_iterations=400)
    assert better.duration < given.duration
    assert verify(better, scenario).ok


@pytest.mark.parametrize("planner", ["s-rrt-compiled", "s-rrt"])
def test_a_kinematic_trajectory_is_improved_as_one(planner: str) -> None:
    """Its velocities go on to jump: without limits of acceleration it takes no longer than the shortest path does."""
    scenario = scenario_of(goal=Goal(5.0, 3.0, tolerance=0.5))
    given = plan(scenario, planner, seed=1, time_limit=20.0).trajectory
    assert given is not None
    better = improve(given, scenario, max_iterations=400)
    assert better.kinematic
    assert better.duration < given.duration
    assert verify(better, scenario).violations == ()


def test_a_trajectory_of_another_scenario_is_refused() -> None:
    given = planned(scenario_of())
    with pytest.raises(TrajectoryError, match="start"):
        improve(given, scenario_of(start=State(1.0, 1.5)))
    with pytest.raises(TrajectoryError, match="goal"):
        improve(given, scenario_of(goal=Goal(5.0, 1.0, tolerance=0.1)))


@pytest.mark.parametrize(
    "arguments",
    [
        {"time_limit": 0.0},
        {"time_limit": "1"},
        {"max_iterations": -1},
        {"max_iterations": 1.5},
        {"objective": "duration"},
        {"callback": 1},
        {"should_stop": True},
    ],
)
def test_arguments_that_make_no_sense_are_refused_by_name(arguments: dict[str, Any]) -> None:
    with pytest.raises(SettingsError, match=next(iter(arguments))):
        improve(planned(scenario_of()), scenario_of(), **arguments)


@pytest.mark.parametrize(
    "weights",
    [{"duration": -1.0}, {"room": math.nan}, {"room_distance": 0.0}, {"duration": 0.0}, {"smoothness": math.inf}],
)
def test_weights_that_make_no_sense_are_refused_by_name(weights: dict[str, float]) -> None:
    with pytest.raises(SettingsError, match=next(iter(weights))):
        Objective(**weights)
