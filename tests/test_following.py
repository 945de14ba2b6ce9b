"""Followers in simulation: near the trajectory in spite of slip and noise, within the limits, at rest in the end."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from cbrrt_ompl.errors import SettingsError, TrajectoryError
from cbrrt_ompl.export.following import Disturbance, Follower, KanayamaLaw, error_of, follow
from cbrrt_ompl.planning import plan
from cbrrt_ompl.problem.robot import Gains, Limits
from cbrrt_ompl.scenario.scenario import load_scenario
from cbrrt_ompl.trajectory.trajectory import Trajectory

ROUGH = Disturbance(slip=0.05, noise=0.005, heading_noise=math.radians(0.5))


@pytest.fixture(scope="module", params=["office", "dock"])
def trajectory(request: pytest.FixtureRequest) -> Trajectory:
    scenario = load_scenario(request.param)
    scenario = replace(
        scenario,
        robot=replace(scenario.robot, gains=Gains()),  # the paper's, as in the figures that docs/robot.md gives
        planning=replace(scenario.planning, closed_loop=False, goal_bias=0.05),
    )
    found = plan(scenario, planner="cb-rrt-robust", seed=1).trajectory
    assert found is not None
    return found


def test_without_disturbance_the_robot_stays_within_millimetres(trajectory: Trajectory) -> None:
    result = follow(trajectory)
    assert result.largest_error < 0.005
    assert result.largest_heading_error < 0.01


@pytest.mark.parametrize("seed", range(5))
def test_slip_and_noise_are_taken_back(trajectory: Trajectory, seed: int) -> None:
    result = follow(trajectory, disturbance=ROUGH, seed=seed)
    assert result.largest_error < 0.06
    assert result.mean_error < 0.03
    blind = follow(trajectory, law=lambda error, v, omega: (v, omega), disturbance=ROUGH, seed=seed)
    assert blind.largest_error > 2.0 * result.largest_error


@pytest.mark.parametrize("disturbance", [Disturbance(), ROUGH, Disturbance(0.2, 0.05, 0.2)])
def test_commands_keep_every_limit(trajectory: Trajectory, disturbance: Disturbance) -> None:
    limits = trajectory.limits
    assert limits is not None
    result = follow(trajectory, disturbance=disturbance, seed=1)
    v, omega = result.commands.T
    assert limits.v_min <= v.min() and v.max() <= limits.v_max
    assert limits.omega_min <= omega.min() and omega.max() <= limits.omega_max
    changes = np.abs(np.diff(result.commands, axis=0)) * 20.0
    assert changes[:, 0].max() <= limits.acceleration + 1e-9
    assert changes[:, 1].max() <= limits.angular_acceleration + 1e-9


def test_wheels_are_kept_as_well() -> None:
    limits = Limits(0.0, 1.0, -2.0, 2.0, 1.0, 4.0, wheel_separation=0.4, wheel_speed=1.0, wheel_acceleration=0.8)
    t = np.linspace(0.0, 4.0, 41)
    speed = np.minimum(0.5 * t, 0.8)
    zeros = np.zeros(41)
    x = np.concatenate([[0.0], np.cumsum(0.05 * (speed[1:] + speed[:-1]))])
    trajectory = Trajectory(t, x, zeros, zeros, speed, zeros, speed, zeros)
    result = follow(trajectory, limits, disturbance=Disturbance(0.2, 0.05, 0.1), seed=3)
    rims = np.abs(result.commands[:, 0]) + 0.2 * np.abs(result.commands[:, 1])
    assert rims.max() <= 1.0 + 1e-9
    changes = np.abs(np.diff(result.commands, axis=0)) * 20.0
    assert (changes[:, 0] + 0.2 * changes[:, 1]).max() <= 0.8 + 1e-9


def test_the_robot_is_at_rest_in_the_end_wherever_the_trajectory_ends(trajectory: Trajectory) -> None:
    cut = trajectory.stopping_at(3.0)
    for one in (trajectory, cut):
        result = follow(one)
        assert np.abs(result.states[-1, 3:]).max() < 0.05
        assert result.times[-1] >= one.t[-1] - 1e-9


def test_a_follower_is_told_of_the_error_in_its_own_frame() -> None:
    np.testing.assert_allclose(
        error_of((1.0, 1.0, math.pi / 2), (1.0, 3.0, math.pi)), (2.0, 0.0, math.pi / 2), atol=1e-12
    )
    assert KanayamaLaw()(np.zeros(3), 0.4, 0.3) == (0.4, 0.3)
    v, omega = KanayamaLaw()(np.array([0.1, 0.1, 0.1]), 0.4, 0.0)
    assert v > 0.4 and omega > 0.0


def test_past_the_end_the_follower_brakes() -> None:
    limits = Limits()
    t = np.array([0.0, 1.0])
    straight = Trajectory(t, t, 0 * t, 0 * t, np.ones(2), 0 * t, np.ones(2), 0 * t, limits=limits)
    follower = Follower(straight)
    follower.time = float(follower.trajectory.t[-1])
    speeds = [follower.command((9.0, 9.0, 0.0))[0] for _ in range(40)]
    assert speeds[0] == pytest.approx(1.0 - 0.05 * 0.6)
    assert speeds[-1] == 0.0


def test_the_trajectory_waits_for_a_robot_that_slips_at_full_speed() -> None:
    t = np.linspace(0.0, 20.0, 401)
    straight = Trajectory(t, t, 0 * t, 0 * t, 1 + 0 * t, 0 * t, 1 + 0 * t, 0 * t, limits=Limits())
    results = [follow(straight, disturbance=Disturbance(slip=0.2), seed=seed) for seed in range(10)]
    slow = max(results, key=lambda result: result.t[-1])
    assert slow.t[-1] > 22.0
    assert slow.largest_error < 0.1


def test_what_cannot_be_followed_is_refused() -> None:
    one = Trajectory(*([[0.0]] * 8))
    with pytest.raises(TrajectoryError, match="limits: missing"):
        Follower(one)
    with pytest.raises(SettingsError, match="rate: got 0"):
        Follower(one, Limits(), rate=0)
    with pytest.raises(SettingsError, match="disturbance.slip: got -1"):
        follow(one, Limits(), disturbance=Disturbance(-1))
    assert len(follow(one, Limits()).t) == 1
