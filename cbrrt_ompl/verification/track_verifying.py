"""The verification of what has no commands, or of collisions alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cbrrt_ompl.trajectory.track import Track
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.verification.collision_checks import collision_violations, sampling_violations
from cbrrt_ompl.verification.distances import Distances
from cbrrt_ompl.verification.motion import Motion
from cbrrt_ompl.verification.result import COLLISIONS, PATH, ROWS, Verification
from cbrrt_ompl.verification.sweep import sweep
from cbrrt_ompl.verification.track_checks import (
    track_goal_violations,
    track_limit_violations,
    track_motion_violations,
    track_start_violations,
)
from cbrrt_ompl.verification.violation import Violation

if TYPE_CHECKING:
    from cbrrt_ompl.scenario.scenario import Scenario


def verify_rows(
    rows: Trajectory | Track, scenario: Scenario, tolerance: float, resolution: float, collisions_only: bool
) -> Verification:
    """Check the motion through some rows; see :func:`cbrrt_ompl.verify`."""
    footprint = scenario.robot.footprint
    kept = max(scenario.planning.clearance - resolution, 0.0)
    reach = 0.0 if footprint.is_round else footprint.circumscribed_radius
    with np.errstate(all="ignore"):  # absurd numbers overflow, and are reported as violations
        motion = Motion.through(rows.t, rows.poses, rows.step_velocities, reach)
        swept = sweep(motion, Distances(scenario.world, footprint), resolution, kept)
        judged = [] if collisions_only or isinstance(rows, Trajectory) else _judged(rows, motion, scenario, tolerance)
        violations = (
            *judged,
            *collision_violations({"motion": swept}, kept),
            *sampling_violations(rows.t, [motion], [swept]),
        )
    return Verification(
        violations=violations,
        smallest_clearance=max(swept.smallest_margin + kept, 0.0),
        smallest_clearance_time=swept.time,
        smallest_clearance_pose=swept.pose,
        clearance_bound=swept.bound + kept,
        resolution=resolution,
        unproven=swept.unproven,
        tolerance=tolerance,
        kinematic=rows.kinematic,
        rows=len(rows),
        duration=rows.duration,
        checks=swept.checks,
        scope=COLLISIONS if collisions_only else ROWS if getattr(rows, "is_timed", True) else PATH,
    )


def _judged(track: Track, motion: Motion, scenario: Scenario, tolerance: float) -> list[Violation]:
    """All violations but collisions; of a path without times those of start and goal."""
    found = [*track_start_violations(track, scenario, tolerance)]
    if track.is_timed:
        found += track_limit_violations(track, scenario.robot.limits, tolerance)
        found += track_motion_violations(track, motion, tolerance)
    return [*found, *track_goal_violations(track, scenario)]
