"""The verification of a trajectory, put together from its parts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cbrrt_ompl.checks import is_number
from cbrrt_ompl.errors import Problem, SettingsError, TrajectoryError
from cbrrt_ompl.trajectory.track import Track
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.verification.collision_checks import collision_violations, sampling_violations
from cbrrt_ompl.verification.distances import Distances
from cbrrt_ompl.verification.integration import integrate_again
from cbrrt_ompl.verification.limit_checks import (
    acceleration_violations,
    limit_violations,
    wheel_acceleration_violations,
    wheel_speed_violations,
)
from cbrrt_ompl.verification.motion import Motion
from cbrrt_ompl.verification.result import Verification
from cbrrt_ompl.verification.row_checks import goal_violations, motion_violations, start_violations
from cbrrt_ompl.verification.sweep import sweep
from cbrrt_ompl.verification.track_verifying import verify_rows
from cbrrt_ompl.verification.velocities import velocities_again

if TYPE_CHECKING:
    from cbrrt_ompl.scenario.scenario import Scenario

RESOLUTION = 1e-4
"""Intervals in which no point of the footprint moves more than this need no proof: their ends are to be free [m]."""

KINEMATIC_HINT = (
    "the velocities jump exactly to their commands, as those of a kinematic planner (s-rrt) do: "
    "its trajectories are to be verified as kinematic (cbrrt verify --kinematic, Trajectory.load(path, kinematic=True))"
)


def verify(
    trajectory: Trajectory | Track,
    scenario: Scenario,
    *,
    tolerance: float = 1e-3,
    resolution: float = RESOLUTION,
    collisions_only: bool = False,
) -> Verification:
    """Check a trajectory against everything that its scenario asks for.

    From the first row on, the motion is computed again from the commands and the limits: the velocities ramp towards
    the command at the limits of acceleration (kinematic: jump to it), and SciPy integrates heading and position. Every
    row has to agree with that; start, goal and limits are checked besides.

    Both motions, stored and computed again, have to keep ``planning.clearance`` (less the resolution) at any time, or
    touch nothing where that is 0. Exact distances at two times, computed by GEOS, prove all between them, if together
    they exceed a bound on the way of any point of the footprint; else the interval is halved, until no point moves more
    than ``resolution`` in it.

    What others planned or recorded has no commands (a :class:`Track`). Its motion goes from row to row by the
    velocities of the rows, or along arcs where there are none, and every row has to lie where the one before leads;
    velocities, accelerations and the start may be off by the tolerance. A path without times has only its start and
    its goal checked besides collisions.

    Args:
        trajectory: what is to be checked.
        scenario: world, robot, start and goal.
        tolerance: largest deviation of a row from the motion computed again: of the position [m], the heading [rad],
            v [m/s] and omega [rad/s].
        resolution: way of any point of the footprint down to which an interval is proven [m]; a shorter one is accepted
            if its ends are free.
        collisions_only: check nothing but collisions.

    Returns:
        The violations found, and the smallest clearance.

    Raises:
        ScenarioError: if this is no scenario.
        TrajectoryError: if this is no trajectory.
        SettingsError: if the tolerance or the resolution is no number above 0.
    """
    from cbrrt_ompl.scenario.scenario import check_scenario

    check_scenario(scenario)
    if not isinstance(trajectory, Trajectory | Track):
        raise TrajectoryError(Problem("trajectory", trajectory, "a value of type Trajectory, or a Track"))
    for name, value in (("tolerance", tolerance), ("resolution", resolution)):
        if not (is_number(value) and value > 0.0):
            raise SettingsError(Problem(name, value, "a number above 0"))
    if collisions_only or isinstance(trajectory, Track):
        return verify_rows(trajectory, scenario, tolerance, resolution, collisions_only)
    footprint = scenario.robot.footprint
    distances = Distances(scenario.world, footprint)
    kept = max(scenario.planning.clearance - resolution, 0.0)
    reach = 0.0 if footprint.is_round else footprint.circumscribed_radius
    limits = scenario.robot.limits
    with np.errstate(all="ignore"):  # absurd numbers overflow, and are reported as violations
        velocities = velocities_again(trajectory, limits)
        states = integrate_again(trajectory, velocities)
        accelerations = [] if trajectory.kinematic else list(acceleration_violations(trajectory, limits))
        if limits.has_wheel_limits and not trajectory.kinematic:
            accelerations += wheel_acceleration_violations(trajectory, limits)
        motions = {
            "stored motion": Motion.through(trajectory.t, trajectory.poses, trajectory.step_velocities, reach),
            "motion computed again": Motion.through(trajectory.t, states[:, :3], velocities, reach),
        }
        strayed = list(motion_violations(trajectory, states, tolerance))
        sweeps = {name: sweep(motion, distances, resolution, kept) for name, motion in motions.items()}
        violations = (
            *start_violations(trajectory, scenario),
            *limit_violations(trajectory, limits),
            *wheel_speed_violations(trajectory, limits),
            *accelerations,
            *strayed,
            *collision_violations(sweeps, kept),
            *sampling_violations(trajectory.t, motions.values(), sweeps.values()),
            *goal_violations(trajectory, scenario),
        )
        should_jump = bool(accelerations) or (limits.is_first_order and not trajectory.kinematic and bool(strayed))
        nearest = min(sweeps.values(), key=lambda sweep: sweep.smallest_margin)
        return Verification(
            violations=violations,
            smallest_clearance=max(nearest.smallest_margin + kept, 0.0),
            smallest_clearance_time=nearest.time,
            smallest_clearance_pose=nearest.pose,
            clearance_bound=min(sweep.bound for sweep in sweeps.values()) + kept,
            resolution=resolution,
            unproven=sum(sweep.unproven for sweep in sweeps.values()),
            tolerance=tolerance,
            kinematic=trajectory.kinematic,
            rows=len(trajectory),
            duration=trajectory.duration,
            checks=sum(sweep.checks for sweep in sweeps.values()),
            hint=KINEMATIC_HINT if should_jump and _jumps_to_commands(trajectory) else "",
        )


def _jumps_to_commands(trajectory: Trajectory) -> bool:
    """Whether every velocity is the command before it."""
    return np.array_equal(trajectory.v[1:], trajectory.v_command[:-1]) and np.array_equal(
        trajectory.omega[1:], trajectory.omega_command[:-1]
    )
