"""Plans over the state lattice: where a robot with corners has to turn and shunt."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.optimise import improve
from cbrrt_ompl.optimise.geodesic import ways_to
from cbrrt_ompl.optimise.lattice_plan import STATE_LATTICE, lattice_plan, ring_of
from cbrrt_ompl.planning import plan
from cbrrt_ompl.problem.obstacles import Bounds, Box
from cbrrt_ompl.problem.ready_robots import rectangle
from cbrrt_ompl.problem.robot import Footprint, Limits, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.verification import verify

LIMITS = Limits(-1.0, 1.0, -1.0, 1.0, 0.6, 1.0)

TEE = Footprint.polygon(
    [(0.5, 0.1), (0.0, 0.1), (0.0, 0.35), (-0.3, 0.35), (-0.3, -0.35), (0.0, -0.35), (0.0, -0.1), (0.5, -0.1)]
)

OFF_CENTRE = Footprint.polygon([(0.75, 0.25), (-0.15, 0.25), (-0.15, -0.25), (0.75, -0.25)])

PARKING = Scenario(
    name="a gap 0.4 m longer than the robot",
    world=World(Bounds((0.0, 0.0), (10.0, 4.0)), [Box((0.0, 0.0), (4.0, 0.6)), Box((5.6, 0.0), (10.0, 0.6))]),
    robot=Robot(rectangle(1.2, 0.5), LIMITS),
    start=State(1.5, 1.8),
    goal=Goal(4.8, 0.31, tolerance=0.04, theta=0.0, heading_tolerance=0.15, speed_tolerance=0.05),
)

OUT_OF_A_BAY = Scenario(
    name="a bay 0.2 m wider than the robot",
    world=World(Bounds((0.0, 0.0), (10.0, 5.0)), [Box((0.0, 0.0), (4.0, 1.0)), Box((4.7, 0.0), (10.0, 1.0))]),
    robot=Robot(OFF_CENTRE, Limits(-0.1, 0.2, -0.5, 0.5, 0.2, 0.3)),
    start=State(4.35, 0.81, -0.5 * math.pi),
    goal=Goal(8.5, 2.4, tolerance=0.1, theta=0.0, heading_tolerance=0.15),
)

DOORS = Scenario(
    name="doors of 0.8 m",
    world=World(
        Bounds((0.0, 0.0), (6.0, 4.0)),
        [
            Box((x - 0.05, low), (x + 0.05, high))
            for x, door in ((2.0, 0.3), (4.0, 2.8))
            for low, high in ((0.0, door), (door + 0.8, 4.0))
        ],
    ),
    robot=Robot(TEE, Limits(-3.0, 3.0, -3.0, 3.0, 2.0, 4.0)),
    start=State(1.0, 2.0),
    goal=Goal(5.0, 2.0, tolerance=0.2),
)


def found(scenario: Scenario, **arguments: Any) -> Trajectory:
    trajectory = lattice_plan(scenario, lambda: False, **arguments)
    assert trajectory is not None
    assert verify(trajectory, scenario).violations == ()
    return trajectory


@pytest.mark.parametrize("scenario", [PARKING, OUT_OF_A_BAY, DOORS], ids=lambda scenario: scenario.name)
def test_a_plan_over_the_lattice_is_sound(scenario: Scenario) -> None:
    trajectory = found(scenario)
    assert trajectory.ends_at_rest
    assert trajectory == found(scenario)


def test_a_robot_parks_in_a_gap_hardly_longer_than_itself() -> None:
    first, second = (plan(PARKING, "cb-rrt-anytime", seed=seed, time_limit=60.0, max_iterations=600) for seed in (1, 1))
    assert first.solved
    assert first.trajectory is not None
    assert first.history[0].source == STATE_LATTICE
    assert verify(first.trajectory, PARKING).ok
    assert first.trajectory == second.trajectory


@pytest.mark.parametrize(
    ("limits", "goal"),
    [
        (LIMITS._replace(v_min=0.0), {}),
        (LIMITS._replace(omega_min=0.0), {}),
        (LIMITS._replace(wheel_separation=0.4, wheel_speed=0.8, wheel_acceleration=0.5), {}),
        (LIMITS._replace(deceleration=0.2, angular_deceleration=3.0), {}),
        (LIMITS, {"theta": 2.0, "speed_tolerance": 0.01}),
        (Limits(-1.0, 1.0, -1.0, 1.0, math.inf, math.inf), {"theta": 2.0, "speed_tolerance": 0.01}),
    ],
    ids=["ahead alone", "to the left alone", "wheels", "brakes", "a heading", "first order"],
)
def test_the_lattice_keeps_what_a_robot_can_do(limits: Limits, goal: dict[str, Any]) -> None:
    scenario = replace(
        DOORS, robot=Robot(rectangle(0.5, 0.3), limits), goal=Goal(**{"x": 5.0, "y": 2.0, "tolerance": 0.2, **goal})
    )
    assert found(scenario, is_kinematic=limits.is_first_order).kinematic == limits.is_first_order


def test_a_moving_robot_brakes_first() -> None:
    trajectory = found(replace(DOORS, start=State(1.0, 2.0, 1.0, 0.5, -0.5)))
    assert trajectory.states[0].tolist() == [1.0, 2.0, 1.0, 0.5, -0.5]


def test_a_moving_robot_whose_velocities_jump_does_not_brake() -> None:
    """The rows of its braking were integrated as if they did not jump."""
    trajectory = found(replace(DOORS, start=State(1.0, 2.0, 1.0, 0.5, -0.5)), is_kinematic=True)
    assert trajectory.v_command[0] in (0.0, -3.0, 3.0)


def test_clearance_and_braking_are_kept() -> None:
    scenario = replace(DOORS, planning=PlanningSettings(clearance=0.03, brake_safe=True))
    found(scenario)


def test_a_wall_without_a_door_is_not_passed() -> None:
    world = World(DOORS.world.bounds, [Box((3.0, 0.0), (3.1, 4.0))])
    assert lattice_plan(replace(DOORS, world=world), lambda: False) is None


def test_a_request_to_stop_ends_a_search() -> None:
    assert lattice_plan(PARKING, lambda: True) is None


@pytest.mark.parametrize("scenario", [DOORS, OUT_OF_A_BAY], ids=lambda scenario: scenario.name)
def test_what_no_other_guess_leads_through_is_improved(scenario: Scenario) -> None:
    """The geodesics of discs, and the plan of CB-RRT, led to no free trajectory: plans came back as they were."""
    planned = plan(scenario, "cb-rrt-robust", seed=1, time_limit=60.0).trajectory
    assert planned is not None
    better = improve(planned, scenario, max_iterations=3000)
    assert better.duration < 0.7 * planned.duration
    assert verify(better, scenario).ok


def test_the_ring_holds_the_headings_of_both_ends() -> None:
    ring = ring_of(64, [0.3, -3.0, None])
    assert {0.3, -3.0} <= set(ring.tolist())
    assert (np.diff(ring) > 0.02).all()
    assert np.diff(ring).max() < 0.15
    assert ring[-1] - ring[0] < math.tau


def test_ways_over_a_grid_lead_around_what_is_blocked() -> None:
    costs = np.ones((20, 30), dtype=np.float32)
    costs[:15, 9:11] = np.inf
    ways = ways_to(costs.ravel(), 30, 0, 29, 2.0).reshape(20, 30)
    assert ways[0, 0] == 0.0
    assert ways[0, 5] == pytest.approx(5.0)
    assert ways[0, 29] > math.hypot(15.0, 9.0) + math.hypot(15.0, 18.0) - 1e-3
    assert np.isinf(ways[:15, 9:11]).all()
