"""A deceleration apart from the acceleration: how fast velocities may shrink, kept by all that drives."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from independent_checker import refusals

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.drive import DriveSettings, drive
from cbrrt_ompl.errors import RobotError
from cbrrt_ompl.export.following import Disturbance, follow
from cbrrt_ompl.motion.kinematics import brake, joint_ramp, ramp, stopping_time
from cbrrt_ompl.motion.manoeuvres import next_velocity
from cbrrt_ompl.optimise import improve
from cbrrt_ompl.planners.registry import PLANNERS
from cbrrt_ompl.planning import plan
from cbrrt_ompl.problem.obstacles import Bounds, Box
from cbrrt_ompl.problem.ready_robots import rectangle
from cbrrt_ompl.problem.robot import Limits, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.scenario.scenario import Scenario, scenario_from_dict, scenario_to_dict
from cbrrt_ompl.trajectory.columns import COLUMNS
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.verification import verify

DT = 0.05
GAP = World(Bounds((0.0, 0.0), (6.0, 4.0)), [Box((2.8, 0.0), (3.2, 1.5)), Box((2.8, 2.4), (3.2, 4.0))])
"""A wall with a gap of 0.9 m."""

WEAK_BRAKES = Limits(-0.5, 0.5, -0.5, 0.5, 0.6, 0.5, deceleration=0.15, angular_deceleration=0.2)
STRONG_BRAKES = Limits(-0.5, 0.5, -0.5, 0.5, 0.15, 0.2, deceleration=0.6, angular_deceleration=0.5)
ON_WHEELS = WEAK_BRAKES._replace(wheel_separation=0.4, wheel_speed=0.5, wheel_acceleration=0.8)
ALL = {"weak brakes": WEAK_BRAKES, "strong brakes": STRONG_BRAKES, "on wheels": ON_WHEELS}
LIMITS = pytest.mark.parametrize("limits", ALL.values(), ids=[name.replace(" ", "-") for name in ALL])

rates, velocities = st.floats(0.01, 3.0), st.floats(-2.0, 2.0)


def scenario_of(limits: Limits, **parts: object) -> Scenario:
    usual = {
        "name": "gap",
        "world": GAP,
        "robot": Robot(rectangle(0.5, 0.25), limits),
        "start": State(1.0, 1.0, 0.5),
        "goal": Goal(5.0, 3.0, tolerance=0.2, theta=1.5, heading_tolerance=0.1, speed_tolerance=0.02),
    }
    return Scenario(**{**usual, **parts})  # type: ignore[arg-type]  # a mapping of all kinds


def planned(scenario: Scenario, planner: str = "cb-rrt-robust") -> Trajectory:
    trajectory = plan(scenario, planner, seed=1, time_limit=30.0).trajectory
    assert trajectory is not None
    return trajectory


def check(trajectory: Trajectory, scenario: Scenario) -> None:
    """By verify and by the checker that shares nothing with it."""
    assert verify(trajectory, scenario).violations == ()
    columns = {name: getattr(trajectory, name).tolist() for name in COLUMNS}
    assert refusals(scenario_to_dict(scenario), columns, trajectory.kinematic) == []


# one step


@given(velocities, velocities, rates, rates)
def test_a_ramp_keeps_both_limits_and_arrives(velocity: float, command: float, faster: float, slower: float) -> None:
    steps = 0
    while velocity != command:
        after = ramp(velocity, command, faster * DT, slower * DT)
        change, turns_round = abs(after - velocity) - 1e-12, after * velocity < 0.0 and abs(velocity) > 1e-9
        if abs(after) > abs(velocity) or turns_round:
            assert change <= faster * DT
        if abs(after) < abs(velocity) or turns_round:
            assert change <= slower * DT
        velocity, steps = after, steps + 1
        assert steps < 10_000


@given(velocities, velocities, rates, rates)
def test_a_ramp_is_the_same_to_either_side(velocity: float, command: float, faster: float, slower: float) -> None:
    assert ramp(-velocity, -command, faster, slower) == -ramp(velocity, command, faster, slower)


def test_a_ramp_by_hand() -> None:
    assert ramp(0.5, 1.0, 0.1, 0.2) == 0.6
    assert ramp(0.5, 0.0, 0.1, 0.2) == 0.3
    assert ramp(0.15, -1.0, 0.1, 0.2) == 0.0  # through rest it may change by 0.1 alone, to rest by more
    assert ramp(0.05, -1.0, 0.1, 0.2) == pytest.approx(-0.05)
    assert ramp(0.0, -1.0, 0.1, 0.2) == -0.1


@given(st.floats(-10.0, 10.0), st.floats(0.0, 1.0), st.floats(0.05, 3.0), rates, rates)
def test_a_manoeuvre_comes_to_rest_exactly_at_the_end_of_its_way(
    way: float, share: float, high: float, faster: float, slower: float
) -> None:
    velocity, at, steps = (2.0 * share - 1.0) * high, 0.0, 0
    assume(high / min(faster, slower) < 100.0)
    while velocity != 0.0 or abs(way - at) > 1e-9 or steps == 0:
        after = next_velocity(way - at, velocity, -high, high, faster * DT, slower * DT, DT)
        assert abs(after - ramp(velocity, after, faster * DT, slower * DT)) <= 1e-12
        at += 0.5 * (velocity + after) * DT
        velocity, steps = after, steps + 1
        assert steps < 100_000
    assert abs(way - at) < 1e-9


@LIMITS
def test_braking_takes_as_long_as_the_deceleration_says(limits: Limits) -> None:
    states = brake(0.0, 0.0, 0.0, 0.45, 0.0, limits, DT, 1000)
    expected = 0.45 / limits.deceleration
    assert stopping_time(0.45, 0.0, limits) == pytest.approx(expected)
    assert (len(states) - 1) * DT == pytest.approx(expected, abs=DT)


def test_wheels_brake_within_the_deceleration() -> None:
    v, omega = joint_ramp(0.4, 0.2, 0.0, 0.0, ON_WHEELS, DT)
    assert v == pytest.approx(0.4 - 0.15 * DT)
    assert omega == pytest.approx(0.2 * v / 0.4)  # on the straight line to rest


# files and limits


def test_decelerations_are_read_and_written() -> None:
    data = scenario_to_dict(scenario_of(WEAK_BRAKES))
    assert (data["robot"]["limits"]["deceleration"], data["robot"]["limits"]["angular_deceleration"]) == (0.15, 0.2)
    assert scenario_from_dict(data).robot.limits == WEAK_BRAKES
    data["robot"]["limits"]["angular_deceleration_deg"] = 90.0
    del data["robot"]["limits"]["angular_deceleration"], data["robot"]["limits"]["deceleration"]
    limits = scenario_from_dict(data).robot.limits
    assert (limits.deceleration, limits.angular_deceleration) == (math.inf, math.radians(90.0))


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan])
def test_a_wrong_deceleration_is_refused_by_name(value: float) -> None:
    with pytest.raises(RobotError, match=r"limits\.deceleration: got"):
        Robot(limits=Limits(deceleration=value))
    with pytest.raises(RobotError, match=r"limits\.deceleration: got 1.0, expected no limit"):
        Robot(limits=Limits(acceleration=math.inf, angular_acceleration=math.inf, deceleration=1.0))


# plans


@pytest.mark.parametrize("planner", PLANNERS)
def test_every_planner_keeps_a_deceleration(planner: str) -> None:
    scenario = scenario_of(WEAK_BRAKES, world=World(GAP.bounds), goal=Goal(5.0, 3.0, tolerance=0.3))
    check(planned(scenario, planner), scenario)


@LIMITS
@pytest.mark.parametrize("brake_safe", [False, True])
@pytest.mark.parametrize("v_min", [-0.5, 0.0])
def test_plans_through_a_gap_to_rest_keep_a_deceleration(limits: Limits, brake_safe: bool, v_min: float) -> None:
    planning = PlanningSettings(brake_safe=brake_safe)
    scenario = scenario_of(limits._replace(v_min=v_min), planning=planning)
    trajectory = planned(scenario)
    check(trajectory, scenario)
    changes = np.diff(np.abs(trajectory.v)) / np.diff(trajectory.t)
    assert changes.min() >= -limits.deceleration - 1e-9
    assert changes.max() <= limits.acceleration + 1e-9


@LIMITS
def test_brake_safe_plans_can_be_braked_from_everywhere(limits: Limits) -> None:
    scenario = scenario_of(limits, planning=PlanningSettings(brake_safe=True))
    trajectory = planned(scenario)
    anywhere = replace(scenario, goal=Goal(3.0, 2.0, tolerance=9.0))
    for t in trajectory.t[::10]:
        check(trajectory.stopping_at(float(t)), anywhere)


def test_verify_refuses_to_brake_harder() -> None:
    weak, strong = scenario_of(WEAK_BRAKES), scenario_of(WEAK_BRAKES._replace(deceleration=0.6))
    found = verify(planned(strong), weak).violations
    assert {violation.kind for violation in found} >= {"acceleration", "motion"}
    assert "limit 0.6 (slowing down 0.15) m/s^2" in next(v.message for v in found if v.kind == "acceleration")


# what is made of plans


@LIMITS
@pytest.mark.parametrize("v_min", [-0.5, 0.0])
def test_an_improved_trajectory_keeps_a_deceleration(limits: Limits, v_min: float) -> None:
    scenario = scenario_of(limits._replace(v_min=v_min))
    given = planned(scenario)
    better = improve(given, scenario, max_iterations=600)
    assert better.duration < given.duration
    check(better, scenario)


def test_a_robot_that_does_not_reverse_uses_both_limits_when_it_is_improved() -> None:
    """One that does is improved within the lesser limit: the solver's limits do not ask for the sign of a velocity."""
    bounds = World(Bounds((0.0, 0.0), (6.0, 2.0)))
    goal = Goal(5.0, 1.0, tolerance=0.05, speed_tolerance=0.01)
    limits = WEAK_BRAKES._replace(v_min=0.0)
    scenario = scenario_of(limits, world=bounds, start=State(1.0, 1.0), goal=goal)
    better = improve(planned(scenario), scenario, max_iterations=600)
    check(better, scenario)
    rates = np.diff(better.v) / np.diff(better.t)
    assert rates.max() > 0.5
    assert rates.min() == pytest.approx(-0.15, rel=0.02)


@LIMITS
@pytest.mark.parametrize("hz", [7.0, 20.0, 30.0])
def test_rows_at_another_rate_keep_a_deceleration(limits: Limits, hz: float) -> None:
    scenario = scenario_of(limits)
    rows = planned(scenario).resampled(hz)
    found = [v for v in verify(rows, scenario).violations if v.kind in ("acceleration", "motion", "velocity")]
    assert found == []


@LIMITS
def test_a_follower_keeps_a_deceleration(limits: Limits) -> None:
    result = follow(planned(scenario_of(limits)), disturbance=Disturbance(0.05, 0.01, 0.02), seed=1)
    v = np.abs(result.commands[:, 0])
    assert (np.diff(v) * 20.0).min() >= -limits.deceleration - 1e-9
    assert (np.diff(v) * 20.0).max() <= limits.acceleration + 1e-9


@pytest.mark.parametrize("limits", [WEAK_BRAKES, STRONG_BRAKES], ids=["weak", "strong"])
def test_a_drive_keeps_a_deceleration_and_never_collides(limits: Limits) -> None:
    goal = Goal(5.0, 3.0, tolerance=0.3)
    result = drive(scenario_of(limits, goal=goal), None, DriveSettings(sensor_range=2.5, max_samples=3000), seed=1)
    assert result.verification.ok
    assert result.reached
