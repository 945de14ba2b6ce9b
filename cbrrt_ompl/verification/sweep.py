"""The proof that a motion is free, by exact distances and halved intervals."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.trajectory.displacement import wrapped
from cbrrt_ompl.verification.distances import Distances
from cbrrt_ompl.verification.motion import Motion

PROVEN_SHARE = 0.95
"""The bound on the clearance is pursued until it is this share of the smallest clearance found."""

PURSUED_CHECKS = 20_000
"""States of a motion that are looked at for that; a bound above 0 suffices afterwards."""

MAX_CHECKS = 200_000
"""States of a motion that are looked at at most: some seconds."""


@dataclass(frozen=True)
class Sweep:
    """What became of a motion that was swept for collisions."""

    smallest_margin: float
    """Smallest margin found: a distance less what is to be kept [m]."""
    time: float
    """When [s]."""
    pose: tuple[float, float, float]
    """Where, the heading wrapped [m, m, rad]."""
    bound: float
    """What no margin is below [m]."""
    checks: int
    """States that were looked at."""
    unproven: int
    """Intervals accepted for their free ends alone."""
    hit_times: NDArray[np.float64]
    """When a collision was found, shape (k,) [s]."""
    hit_poses: NDArray[np.float64]
    """Where, shape (k, 3)."""
    given_up_at: float
    """Time from which on the checks did not suffice [s]; infinite where they did."""


def sweep(motion: Motion, distances: Distances, resolution: float, kept: float = 0.0) -> Sweep:
    """Prove a motion free, an interval at a time, or find where it is not.

    An interval between two states with margins a and b, on which no point moves further than s, holds no state with a
    margin below (a + b - s) / 2. Where this proves too little, the interval is halved.

    Args:
        motion: what is to be proven free.
        distances: of the footprint from everything.
        resolution: way of any point of the footprint at which halving ends [m].
        kept: distance that is to be kept; a state that is nearer is no free one [m].
    """

    def margins_at(places: NDArray[np.float64]) -> NDArray[np.float64]:
        return distances.at(motion.poses_at(places)) - kept

    ends = np.unique([0.0, len(motion.times) - 1.0])
    asked, found = [ends], [margins_at(ends)]
    begin, end = ends[:-1], ends[1:]
    margin, margin_end = found[0][:-1], found[0][1:]
    smallest, checks, unproven, given_up_at = float(found[0].min()), len(ends), 0, math.inf
    bound = smallest
    while len(begin):
        ways = motion.ways_between(begin, end)
        bounds = 0.5 * (margin + margin_end - ways)
        hits, free = (margin <= 0.0) & (margin_end <= 0.0), (margin > 0.0) & (margin_end > 0.0)
        short = ways <= resolution
        wanted = PROVEN_SHARE * smallest if checks <= PURSUED_CHECKS else 0.0
        settled = free & (bounds > 0.0) & (bounds >= wanted) | short | hits & (end - begin <= 1.0)
        bound = min(bound, float(bounds[settled].min(initial=math.inf)))
        unproven += int(np.count_nonzero(settled & free & (bounds <= 0.0)))
        begin, end, margin, margin_end = (values[~settled] for values in (begin, end, margin, margin_end))
        checks += len(begin)
        if checks > MAX_CHECKS:
            bound, given_up_at = -math.inf, float(motion.times_at(begin).min())
            break
        middle = 0.5 * (begin + end)
        middle = np.where(end - begin > 1.0, np.floor(middle), middle)
        asked.append(middle)
        found.append(margins_at(middle))
        smallest = min(smallest, float(found[-1].min(initial=math.inf)))
        begin, end = np.concatenate([begin, middle]), np.concatenate([middle, end])
        margin, margin_end = np.concatenate([margin, found[-1]]), np.concatenate([found[-1], margin_end])
    places, margins = np.concatenate(asked), np.concatenate(found)
    order = np.argsort(places)
    places, margins = places[order], margins[order]
    nearest, hit = places[[np.argmin(margins)]], places[margins <= 0.0]
    x, y, theta = motion.poses_at(nearest)[0].tolist()
    return Sweep(
        smallest_margin=smallest,
        time=float(motion.times_at(nearest)[0]),
        pose=(x, y, float(wrapped(theta))),
        bound=-math.inf if motion.left_out.any() else bound,
        checks=len(places),
        unproven=unproven,
        hit_times=motion.times_at(hit),
        hit_poses=motion.poses_at(hit),
        given_up_at=given_up_at,
    )
