"""Verification: what is right passes, and every kind of tampering is found, named and timed."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import SettingsError
from cbrrt_ompl.problem.obstacles import Bounds, Box, Disc, OrientedBox, Polygon
from cbrrt_ompl.problem.robot import Footprint, Limits, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.verification import verify
from cbrrt_ompl.verification.sweep import PROVEN_SHARE, PURSUED_CHECKS
from cbrrt_ompl.verification.verifying import RESOLUTION

DT = 0.05
LIMITS = Limits()
BOUNDS = Bounds((-5.0, -5.0), (5.0, 5.0))
START = State(-4.0, -4.0, 0.5)
COMMANDS = ((1.0, 0.0, 3.0), (0.8, 0.5, 2.0), (0.0, 0.0, 2.0), (0.0, -0.5, 2.0), (0.0, 0.0, 1.0), (0.7, 0.2, 3.0))
"""(v, omega, duration): drive, turn left, stop, turn on the spot, stop turning, drive on."""


def drive(
    kinematic: bool = False, start: State = START, commands: tuple[tuple[float, float, float], ...] = COMMANDS
) -> Trajectory:
    """A trajectory by plain small steps: the velocities in closed form, the pose in 40 midpoint steps each."""
    state, parts = list(start), 40
    rows: list[list[float]] = []
    for v_command, omega_command, duration in commands:
        for _ in range(round(duration / DT)):
            rows.append([len(rows) * DT, *state, v_command, omega_command])
            x, y, theta, v, omega = state
            if kinematic:
                v, omega = v_end, omega_end = v_command, omega_command
            else:
                v_end = float(np.clip(v_command, v - LIMITS.acceleration * DT, v + LIMITS.acceleration * DT))
                most = LIMITS.angular_acceleration * DT
                omega_end = float(np.clip(omega_command, omega - most, omega + most))
            for part in range(parts):
                share = (part + 0.5) / parts
                heading = theta + share * DT * (omega + 0.5 * share * (omega_end - omega))
                speed = v + share * (v_end - v)
                x += speed * math.cos(heading) * DT / parts
                y += speed * math.sin(heading) * DT / parts
            theta = math.remainder(theta + 0.5 * DT * (omega + omega_end), math.tau)
            state = [x, y, theta, v_end, omega_end]
    rows.append([len(rows) * DT, *state, *rows[-1][6:]])
    return Trajectory(*np.array(rows).T, kinematic=kinematic)


def scenario_for(
    trajectory: Trajectory,
    obstacles: tuple[Box, ...] = (),
    footprint: Footprint | None = None,
    limits: Limits = LIMITS,
    start: State = START,
    goal: Goal | None = None,
    bounds: Bounds = BOUNDS,
) -> Scenario:
    """The scenario that a trajectory solves, if nothing else is given."""
    return Scenario(
        name="test",
        world=World(bounds, obstacles),
        robot=Robot(footprint=Footprint.point() if footprint is None else footprint, limits=limits),
        start=start,
        goal=Goal(float(trajectory.x[-1]), float(trajectory.y[-1]), 0.2) if goal is None else goal,
        planning=PlanningSettings(),
    )


def changed(trajectory: Trajectory, column: str, row: int, by: float) -> Trajectory:
    """The trajectory with one value tampered with."""
    values = getattr(trajectory, column).copy()
    values[row] += by
    return replace(trajectory, **{column: values})


def kinds(trajectory: Trajectory, scenario: Scenario) -> set[str]:
    return {violation.kind for violation in verify(trajectory, scenario).violations}


@pytest.fixture(scope="module")
def honest() -> Trajectory:
    return drive()


@pytest.fixture(scope="module")
def scenario(honest: Trajectory) -> Scenario:
    return scenario_for(honest)


@pytest.mark.parametrize("kinematic", [False, True])
def test_a_trajectory_that_keeps_everything_is_valid_to_a_micrometre(kinematic: bool) -> None:
    trajectory = drive(kinematic)
    result = verify(trajectory, scenario_for(trajectory), tolerance=1e-5)
    assert result.violations == ()
    assert result.ok


def test_a_trajectory_of_one_row_is_valid_where_the_start_is_in_the_goal() -> None:
    stay = Trajectory(*np.array([[0.0, *START, 0.0, 0.0]]).T)
    assert verify(stay, scenario_for(stay)).ok


def test_steps_of_unlike_durations_are_each_driven_for_their_own() -> None:
    t = np.concatenate([[-3.0], -3.0 + np.cumsum([1e-4, 2.0, 0.03, 1e-6, 0.7])])
    rows, turn = np.ones(6), 0.4 * (t - t[0])
    arc = Trajectory(t, np.sin(turn), 1.0 - np.cos(turn), turn, 0.4 * rows, 0.4 * rows, 0.4 * rows, 0.4 * rows)
    scenario = scenario_for(arc, start=State(0.0, 0.0, 0.0, 0.4, 0.4))
    assert verify(arc, scenario, tolerance=1e-9).ok
    assert kinds(changed(arc, "t", 2, 0.01), scenario) == {"motion"}


def test_headings_are_compared_through_the_wrap() -> None:
    start = State(0.0, 0.0, 3.0)
    circle = drive(start=start, commands=((0.3, 0.5, 14.0),))
    assert np.ptp(circle.theta) > 6.0
    assert verify(circle, scenario_for(circle, start=start)).ok
    unwrapped = replace(circle, theta=np.unwrap(circle.theta))
    assert verify(unwrapped, scenario_for(circle, start=start)).ok


@pytest.mark.parametrize("column", ["x", "y", "theta"])
def test_a_shifted_row_is_found_at_its_time(honest: Trajectory, scenario: Scenario, column: str) -> None:
    (violation,) = verify(changed(honest, column, 50, 0.0011), scenario).violations
    assert (violation.kind, violation.time, violation.count) == ("motion", pytest.approx(2.5), 1)
    assert "differs by 0.0011" in violation.message and "at t = 2.5 s, tolerance 0.001" in violation.message
    assert verify(changed(honest, column, 50, 0.0009), scenario).ok


def test_a_shift_of_all_later_rows_is_counted_to_the_end(honest: Trajectory, scenario: Scenario) -> None:
    shift = np.where(honest.t > 9.99, 0.02, 0.0)
    (violation,) = verify(replace(honest, y=honest.y + shift), scenario).violations
    assert violation.kind == "motion"
    assert violation.last_time == honest.t[-1]
    assert "position differs by 0.02 m" in violation.message and "61 rows, until t = 13 s" in violation.message


@pytest.mark.parametrize(("column", "unit"), [("v", "m/s"), ("omega", "rad/s")])
def test_a_jump_of_a_velocity_breaks_the_acceleration_and_the_motion(
    honest: Trajectory, scenario: Scenario, column: str, unit: str
) -> None:
    tampered = changed(honest, column, 20, 0.1)
    violations = {violation.kind: violation for violation in verify(tampered, scenario).violations}
    assert set(violations) == {"acceleration", "motion"}
    rate = (getattr(tampered, column)[20] - getattr(honest, column)[19]) / DT
    assert violations["acceleration"].message.startswith(f"acceleration: {column} changes by {rate:.6g} {unit}^2 at")
    assert violations["acceleration"].time == pytest.approx(0.95)


def test_accelerating_at_exactly_the_limit_is_allowed_and_a_millionth_more_is_not(honest: Trajectory) -> None:
    weaker = LIMITS._replace(acceleration=LIMITS.acceleration / (1.0 + 1e-6))
    result = verify(honest, scenario_for(honest, limits=weaker))
    assert {violation.kind for violation in result.violations} == {"acceleration"}
    assert "v changes by 0.6 m/s^2 at t = 0 s, limit 0.599999 m/s^2" in result.violations[0].message


@pytest.mark.parametrize(
    ("limits", "text"),
    [
        (LIMITS._replace(v_max=0.9), "v{} = 1 m/s at t = {} s, limits 0 to 0.9 m/s"),
        (LIMITS._replace(omega_max=0.4), "omega{} = 0.5 rad/s at t = {} s, limits -0.523599 to 0.4 rad/s"),
        (LIMITS._replace(omega_min=-0.3), "omega{} = -0.5 rad/s at t = {} s, limits -0.3 to 0.523599 rad/s"),
    ],
)
def test_an_exceeded_limit_is_found_in_velocities_and_commands(limits: Limits, text: str) -> None:
    trajectory = drive(kinematic=True)
    violations = verify(trajectory, scenario_for(trajectory, limits=limits)).violations
    assert [violation.kind for violation in violations] == ["velocity", "command"]
    for violation, suffix in zip(violations, ("", "_command"), strict=True):
        assert violation.message.startswith(f"{violation.kind}: {text.format(suffix, f'{violation.time:.6g}')}")
    assert violations[0].time == pytest.approx(violations[1].time + DT)


def test_the_worst_value_is_that_furthest_out_of_its_range(honest: Trajectory, scenario: Scenario) -> None:
    """It was the largest in magnitude, so 1.1 m/s where -0.5 m/s stood as well and the limits are 0 to 1 m/s."""
    tampered = changed(changed(honest, "v_command", 0, 0.1), "v_command", 9, -1.5)
    violation = next(violation for violation in verify(tampered, scenario).violations if violation.kind == "command")
    assert "v_command = 1.1 m/s at t = 0 s" in violation.message
    assert violation.message.endswith("(2 rows, until t = 0.45 s, worst -0.5)")


def test_a_tampered_command_is_found_through_the_motion_it_would_cause(honest: Trajectory, scenario: Scenario) -> None:
    tampered = changed(honest, "v_command", 59, -1.0)
    result = verify(tampered, scenario)
    assert {violation.kind for violation in result.violations} == {"motion"}
    assert min(violation.time for violation in result.violations) == pytest.approx(3.0)


def test_a_command_out_of_range_is_found_even_where_it_changes_nothing(honest: Trajectory, scenario: Scenario) -> None:
    (violation,) = verify(changed(honest, "v_command", 0, 5.0), scenario).violations
    assert violation.message == "command: v_command = 6 m/s at t = 0 s, limits 0 to 1 m/s"


def wall_at(trajectory: Trajectory, row: float, thickness: float) -> Box:
    """A wall across the first, straight piece, centred between rows."""
    x = float(np.interp(row, np.arange(len(trajectory)), trajectory.x))
    return Box((x - thickness / 2, -5.0), (x + thickness / 2, 0.0))


@pytest.mark.parametrize("thickness", [0.002, 0.001, 0.0002])
def test_a_thin_wall_between_the_rows_is_found_where_the_robot_enters_it(honest: Trajectory, thickness: float) -> None:
    for row in np.arange(45.03, 46.0, 0.07):
        wall = wall_at(honest, row, thickness)
        hits = [wall.min[0] <= x <= wall.max[0] for x in honest.x]
        assert not any(hits)
        violations = verify(honest, scenario_for(honest, (wall,))).violations
        assert [violation.kind for violation in violations] == ["collision"] * 2
        for violation, name in zip(violations, ("stored motion", "motion computed again"), strict=True):
            (x, _, _, v, _) = honest.at(violation.time)[0]
            assert wall.min[0] - 1e-6 <= x <= wall.min[0] + RESOLUTION + 1e-6 * v
            assert f"the {name} touches an obstacle or a wall at t = {violation.time:.6g} s, at (" in violation.message


def straight(length: float, speed: float, angle: float = 0.0) -> Trajectory:
    """Straight on from the origin at constant speed, as two rows."""
    c, s = math.cos(angle), math.sin(angle)
    t, v, zero = np.array([0.0, length / speed]), np.full(2, speed), np.zeros(2)
    way = np.array([0.0, length])
    return Trajectory(t, c * way, s * way, np.full(2, math.remainder(angle, math.tau)), v, zero, v, zero)


@pytest.mark.parametrize("thickness", [1e-3, 2e-4])
def test_a_thin_wall_is_found_in_any_direction(thickness: float) -> None:
    rng = np.random.default_rng(5)
    for angle, turn, distance in zip(
        rng.uniform(-math.pi, math.pi, 60), rng.uniform(-1.4, 1.4, 60), rng.uniform(0.5, 2.5, 60), strict=True
    ):
        trajectory = straight(3.0, 1.0, angle)
        center = (distance * math.cos(angle), distance * math.sin(angle))
        wall = OrientedBox(center, (thickness, 1.0), angle + turn)
        start = State(0.0, 0.0, angle, 1.0)
        assert verify(trajectory, scenario_for(trajectory, start=start)).ok
        assert kinds(trajectory, scenario_for(trajectory, (wall,), start=start)) == {"collision"}


def test_rows_far_apart_hide_no_wall() -> None:
    """Four checks between rows 1 s apart would miss a wall of 0.1 m."""
    limits = Limits(acceleration=1000.0)
    t = np.arange(4.0)
    ones, zero = np.ones(4), np.zeros(4)
    straight_on = Trajectory(t, t - 2.0, zero, zero, ones, zero, ones, zero)
    start, wall = State(-2.0, 0.0, 0.0, 1.0), Box((-1.45, -1.0), (-1.35, 1.0))
    assert verify(straight_on, scenario_for(straight_on, limits=limits, start=start)).ok
    assert kinds(straight_on, scenario_for(straight_on, (wall,), limits=limits, start=start)) == {"collision"}


def test_a_wait_is_proven_however_long_it_is() -> None:
    t, zero = np.array([0.0, 1e6]), np.zeros(2)
    wait = Trajectory(t, zero, zero, zero, zero, zero, zero, zero)
    assert verify(wait, scenario_for(wait, start=State(0.0, 0.0))).ok


@pytest.mark.parametrize(("v", "omega"), [(0.0, 0.5), (1e5, 0.0), (1e300, 1e300)])
def test_rows_too_far_apart_to_be_checked_are_a_violation(v: float, omega: float) -> None:
    t, zero = np.array([0.0, 1000.0, 1001.0]), np.zeros(3)
    jump = Trajectory(t, zero, zero, zero, zero, zero, np.full(3, v), np.full(3, omega), kinematic=True)
    result = verify(jump, scenario_for(jump, start=State(0.0, 0.0)))
    violation = next(violation for violation in result.violations if violation.kind == "sampling")
    assert violation.message.startswith("sampling: the next row is too far away to be checked at t = 0 s, at most ")
    assert violation.message.split(" at most ")[1].startswith("1e+06 m and 6.28319 rad from row to row")
    assert result.clearance_bound == -math.inf


def test_the_work_is_limited_and_what_it_did_not_reach_is_a_violation(
    honest: Trajectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cbrrt_ompl.verification.sweep.MAX_CHECKS", 20)
    obstacle = Box((-3.0, -3.6), (-2.9, -3.5))
    result = verify(honest, scenario_for(honest, (obstacle,)))
    (violation,) = result.violations
    asked = re.match("sampling: (\\d+) states do not prove the motion free from t = ", violation.message)
    assert asked is not None and 10 < int(asked[1]) <= 20
    assert 0.0 < violation.time < 5.0
    assert result.checks <= 40


def test_a_long_way_close_to_a_wall_is_proven_though_a_tight_bound_would_take_too_long() -> None:
    """All states were spent on a bound of 95 % of the clearance, and the motion was called unproven, so not valid."""
    trajectory, start, wall = straight(100.0, 1.0), State(0.0, 0.0, 0.0, 1.0), Box((-1.0, 0.004), (101.0, 1.0))
    bounds = Bounds((-2.0, -5.0), (102.0, 5.0))
    result = verify(trajectory, scenario_for(trajectory, (wall,), start=start, bounds=bounds))
    assert result.violations == ()
    assert result.unproven == 0 and 0.0 < result.clearance_bound < PROVEN_SHARE * 0.004
    assert result.checks < 4 * PURSUED_CHECKS


def test_driving_along_a_wall_at_less_than_the_resolution_is_accepted_and_said() -> None:
    trajectory = straight(0.1, 0.5)
    start, wall = State(0.0, 0.0, 0.0, 0.5), Box((-1.0, 2e-5), (2.0, 1.0))
    result = verify(trajectory, scenario_for(trajectory, (wall,), start=start))
    assert result.ok
    assert result.unproven > 100 and -0.5 * RESOLUTION < result.clearance_bound < 0.0
    text = f"intervals of at most 0.0001 m accepted for their free ends: {result.unproven}"
    assert text in result.summary().splitlines()[-2]
    assert result.summary().endswith("; not proven to be above 0 everywhere")
    finer = verify(trajectory, scenario_for(trajectory, (wall,), start=start), resolution=1e-5)
    assert finer.unproven == 0 and 0.0 < finer.clearance_bound <= 2e-5


def test_a_corner_between_two_rows_is_found_down_to_the_resolution() -> None:
    trajectory = straight(2.0, 1.0)
    start = State(0.0, 0.0, 0.0, 1.0)
    for depth, expected in ((-1e-5, set()), (6e-5, {"collision"})):
        diamond = Polygon([(0.7123, depth), (0.2, -0.5), (1.2, -0.5)])  # its tip reaches over the way by so much
        assert kinds(trajectory, scenario_for(trajectory, (diamond,), start=start)) == expected


@pytest.mark.parametrize("kinematic", [False, True])
@pytest.mark.parametrize("rear", [-0.05, 0.5])
def test_the_motion_is_proven_where_the_robot_turns_and_its_corners_sweep(kinematic: bool, rear: float) -> None:
    """The clearance of a bar that turns about a point in it or behind it, between rows at which it is free."""
    t = np.array([0.0, 2.0])
    zero, rate = np.zeros(2), np.full(2, 0.5)
    turn = Trajectory(t, zero, zero, np.array([0.0, 1.0]), zero, rate, zero, rate, kinematic=kinematic)
    bar, start = Footprint.polygon([(rear, -0.05), (1.0, -0.05), (1.0, 0.05), (rear, 0.05)]), State(0, 0, 0, 0, 0.5)
    place = 0.98 * np.array([math.cos(0.5), math.sin(0.5)])
    pin = Disc((float(place[0]), float(place[1])), 0.01)
    assert verify(turn, scenario_for(turn, (), bar, start=start)).ok
    (violation, _) = verify(turn, scenario_for(turn, (pin,), bar, start=start)).violations
    assert violation.kind == "collision"
    touches = 0.5 - math.asin(0.05 / 0.98) - math.asin(0.01 / 0.98)
    assert violation.time == pytest.approx(touches / 0.5, abs=1e-3)


def test_the_footprint_collides_where_its_centre_does_not(honest: Trajectory) -> None:
    obstacle = Box(
        (float(honest.x[40]), float(honest.y[40]) - 0.4), (float(honest.x[40]) + 0.1, float(honest.y[40]) - 0.3)
    )
    assert verify(honest, scenario_for(honest, (obstacle,))).ok
    assert kinds(honest, scenario_for(honest, (obstacle,), Footprint.disc(0.35))) == {"collision"}


def test_only_one_of_stored_and_computed_motion_in_an_obstacle_is_reported_as_that(
    honest: Trajectory, scenario: Scenario
) -> None:
    tampered = changed(honest, "x", 200, 20.0)
    messages = [v.message for v in verify(tampered, scenario).violations if v.kind == "collision"]
    assert len(messages) == 1 and "the stored motion touches" in messages[0]


@pytest.mark.parametrize(("index", "name"), list(enumerate(State._fields)))
def test_a_wrong_start_is_named_by_its_value(honest: Trajectory, index: int, name: str) -> None:
    for off, count in ((0.9e-6, 0), (1.1e-6, 1)):
        start = START._replace(**{name: START[index] + off})
        violations = verify(honest, scenario_for(honest, start=start)).violations
        assert [violation.message.split(" =")[0] for violation in violations] == [f"start: {name}"] * count


def test_a_start_heading_a_full_turn_away_is_the_same(honest: Trajectory) -> None:
    assert verify(honest, scenario_for(honest, start=START._replace(theta=START.theta + 2 * math.pi))).ok


def test_a_missed_goal_is_reported_in_the_words_of_the_goal(honest: Trajectory) -> None:
    goal = Goal(float(honest.x[-1]) + 0.3, float(honest.y[-1]), 0.2, speed_tolerance=0.1)
    violations = verify(honest, scenario_for(honest, goal=goal)).violations
    assert [violation.message for violation in violations] == [
        "goal: 0.3 m from the goal, tolerance 0.2 m, at the end, t = 13 s",
        "goal: arrives with v = 0.7 m/s, tolerance 0.1, at the end, t = 13 s",
        "goal: arrives with omega = 0.2 rad/s, tolerance 0.1, at the end, t = 13 s",
    ]


def test_kinematic_motion_verified_as_dynamic_fails_with_the_hint() -> None:
    trajectory = replace(drive(kinematic=True), kinematic=False)
    result = verify(trajectory, scenario_for(trajectory))
    assert not result.ok
    assert "verified as kinematic" in result.hint
    assert result.hint in result.summary()


def test_a_jump_that_is_none_of_a_kinematic_planner_gets_no_hint(honest: Trajectory, scenario: Scenario) -> None:
    assert verify(changed(honest, "v", 20, 0.1), scenario).hint == ""


def test_dynamic_motion_verified_as_kinematic_fails(honest: Trajectory, scenario: Scenario) -> None:
    assert "motion" in kinds(replace(honest, kinematic=True), scenario)


@pytest.mark.parametrize("footprint", [Footprint.disc(0.2), Footprint.polygon([(0.25, 0), (-0.1, 0.2), (-0.1, -0.2)])])
def test_the_smallest_clearance_is_bounded_over_the_whole_motion(honest: Trajectory, footprint: Footprint) -> None:
    obstacle = Disc((float(honest.x[100]), float(honest.y[100]) - 0.72), 0.1)
    scenario = scenario_for(honest, (obstacle,), footprint)
    result = verify(honest, scenario)
    times = np.linspace(honest.t[0], honest.t[-1], 20_000)
    clearances = np.array([scenario.world.clearance(footprint, state[:3]) for state in honest.at(times)])
    assert result.ok
    assert result.clearance_bound <= clearances.min() <= result.smallest_clearance + 1e-5
    assert result.clearance_bound >= PROVEN_SHARE * (result.smallest_clearance - 1e-5)
    by_the_kernels = scenario.world.clearance(footprint, result.smallest_clearance_pose)
    assert result.smallest_clearance == pytest.approx(by_the_kernels, abs=1e-12)
    there = honest.at(result.smallest_clearance_time)[0, :3]
    assert there == pytest.approx(result.smallest_clearance_pose, abs=1e-4)


def test_a_trajectory_in_open_space_takes_few_states(honest: Trajectory, scenario: Scenario) -> None:
    assert verify(honest, scenario).checks < 60


def test_the_motion_is_integrated_again_as_finely_as_scipy_can() -> None:
    """A spiral whose velocities are linear in time, against a quadrature of its own."""
    limits = Limits(-1.0, 1.0, -3.0, 3.0, 1.0, 3.0)
    t, zero = np.array([0.0, 1.0]), np.zeros(2)
    states = []
    for parts in (200_000, 400_000):
        middle = (np.arange(parts) + 0.5) / parts
        heading, way = 1.5 * middle**2, middle / parts
        states.append((np.sum(way * np.cos(heading)), np.sum(way * np.sin(heading)), 1.5))
    x, y, theta = (np.array([0.0, (4.0 * fine - coarse) / 3.0]) for coarse, fine in zip(*states, strict=True))
    spiral = Trajectory(t, x, y, theta, t, 3.0 * t, zero + 1.0, zero + 3.0)
    scenario = scenario_for(spiral, limits=limits, start=State(0.0, 0.0))
    assert verify(spiral, scenario, tolerance=1e-10).ok


def test_absurd_numbers_are_violations_not_crashes(honest: Trajectory, scenario: Scenario) -> None:
    for column in ("x", "theta", "v", "omega", "v_command", "t"):
        row = len(honest) - 1 if column == "t" else 30
        assert not verify(changed(honest, column, row, 1e308), scenario).ok


def test_times_whose_differences_overflow_are_violations_not_crashes() -> None:
    """A step of infinite duration made SciPy's integrator fail."""
    zero = np.zeros(3)
    for command in (0.0, 0.1):
        wait = Trajectory(np.array([-1.7e308, 1.7e308, 1.75e308]), *[zero] * 5, zero + command, zero)
        violations = verify(wait, scenario_for(wait, start=State(0.0, 0.0))).violations
        assert {violation.kind for violation in violations} == {"sampling"} | ({"motion"} if command else set())


@pytest.mark.parametrize("name", ["tolerance", "resolution"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_a_tolerance_that_is_none_is_refused(honest: Trajectory, scenario: Scenario, name: str, value: float) -> None:
    with pytest.raises(SettingsError, match=f"{name}: got .*, expected a number above 0"):
        verify(honest, scenario, **{name: value})


def test_the_summary_says_what_was_checked_with_which_tolerance(honest: Trajectory, scenario: Scenario) -> None:
    result = verify(honest, scenario, tolerance=0.002)
    lines = result.summary().splitlines()
    assert lines[0] == "trajectory of 261 rows, 13 s: valid"
    assert any("integrated again from the commands, to 0.002 " in line for line in lines)
    assert f"at {result.checks} states and the way between them; " in result.summary()
    assert lines[-1].startswith(f"smallest clearance: {result.smallest_clearance:.4g} m at t = ")
    assert lines[-1].endswith(f"; proven not to fall below {result.clearance_bound:.4g} m")
    assert "accelerations not checked" not in result.summary()


def test_the_summary_of_a_kinematic_trajectory_says_that_accelerations_were_not_checked() -> None:
    trajectory = drive(kinematic=True)
    assert "accelerations not checked" in verify(trajectory, scenario_for(trajectory)).summary()


@pytest.mark.parametrize("moved", ["into a wall", "too far to be checked"])
def test_the_summary_claims_no_bound_where_none_is_proven(honest: Trajectory, scenario: Scenario, moved: str) -> None:
    """It said "proven not to fall below -0.02 m", or "-inf m"."""
    tampered = changed(honest, "x", 100, 20.0 if moved == "into a wall" else 1e7)
    assert verify(tampered, scenario).summary().endswith("; not proven to be above 0 everywhere")


def test_the_summary_of_a_failure_lists_every_violation(honest: Trajectory, scenario: Scenario) -> None:
    result = verify(changed(honest, "v", 20, 0.1), scenario)
    assert result.summary().startswith("trajectory of 261 rows, 13 s: NOT VALID, 2 violations\n")
    assert [line.strip() for line in result.summary().splitlines()[1:3]] == [v.message for v in result.violations]
