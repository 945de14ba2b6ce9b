"""What a drive knew and was about to do at a time: found obstacles, view, plan ahead, the braking that was ready."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray

if TYPE_CHECKING:
    from cbrrt_ompl.drive.result import DriveResult


def seen_until(result: DriveResult, look: int) -> set[int]:
    """Identities of the obstacles found up to a look."""
    return {id(obstacle) for cycle in result.cycles[: look + 1] for obstacle in cycle.seen}


def view_at(result: DriveResult, t: float) -> NDArray[np.float64] | None:
    """Outline of what is in line of sight at a time, within the bounds, shape (n, 2) [m].

    None where obstacles hid nothing.
    """
    if result.sight is None:
        return None
    x, y = result.trajectory.at(t)[0, :2].tolist()
    outline = shapely.Polygon(result.sight.look(x, y, result.settings.sensor_range).outline(x, y))
    bounds = result.world.bounds
    inside = shapely.get_parts(shapely.clip_by_rect(outline, *bounds.min, *bounds.max))
    return shapely.get_coordinates(max(inside, key=shapely.area).exterior)[:-1]


def plan_ahead(result: DriveResult, look: int, t: float) -> NDArray[np.float64]:
    """The rest of the plan that is followed at a time, shape (n, 2); empty while braking."""
    if look > 0 and result.cycles[look - 1].is_braking:
        return np.empty((0, 2))
    taken = [r for r in result.replans if r.trajectory is not None and r.start_time <= t + 1e-9]
    if not taken:
        return np.empty((0, 2))
    plan = taken[-1].trajectory
    assert plan is not None
    return plan.poses[plan.t >= t - 1e-9, :2]


def braking_ahead(result: DriveResult, looks: NDArray[np.float64], look: int, t: float) -> NDArray[np.float64]:
    """The way that the robot is committed to at a time: to the next look and from there to rest, shape (n, 2)."""
    trajectory = result.trajectory
    committed = result.braking
    if look + 1 < len(looks):
        committed = trajectory.stopping_at(min(looks[look + 1], trajectory.t[-1]))
    return np.vstack([trajectory.at(t)[:, :2], committed.poses[committed.t > t, :2]])
