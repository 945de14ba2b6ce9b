"""What the sweeps of the motions found, and what they left open."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.verification.motion import LONGEST_TURN, LONGEST_WAY, Motion
from cbrrt_ompl.verification.sweep import Sweep
from cbrrt_ompl.verification.violation import Violation, place


def collision_violations(sweeps: Mapping[str, Sweep], kept: float) -> Iterator[Violation]:
    """Collisions of the motions, or where they come too near.

    Args:
        sweeps: of the motions by their names.
        kept: distance that they were to keep [m].
    """
    for name, sweep in sweeps.items():
        times = sweep.hit_times
        if not len(times):
            continue
        first, last = float(times[0]), float(times[-1])
        where = place(sweep.hit_poses[0])
        distance = sweep.smallest_margin + kept
        kind, what = "collision", "touches an obstacle or a wall"
        if distance > 0.0:
            kind, what = "clearance", f"comes within {distance:.6g} m of an obstacle or a wall"
        message = f"{kind}: the {name} {what} at t = {first:.6g} s, at {where}"
        if len(times) > 1:
            message += f" ({len(times)} states, until t = {last:.6g} s)"
        yield Violation(kind, first, message, len(times), last)


def sampling_violations(
    times: NDArray[np.float64], motions: Iterable[Motion], sweeps: Iterable[Sweep]
) -> Iterator[Violation]:
    """What could not be checked."""
    where = np.flatnonzero(np.any([motion.left_out for motion in motions], axis=0))
    if len(where):
        first, last = (float(times[row]) for row in where[[0, -1]])
        message = (
            f"sampling: the next row is too far away to be checked at t = {first:.6g} s, "
            f"at most {LONGEST_WAY:g} m and {LONGEST_TURN:.6g} rad from row to row"
        )
        if len(where) > 1:
            message += f" ({len(where)} steps, until t = {last:.6g} s)"
        yield Violation("sampling", first, message, len(where), last)
    earliest = min(sweeps, key=lambda sweep: sweep.given_up_at)
    first = earliest.given_up_at
    if first < math.inf:
        message = f"sampling: {earliest.checks} states do not prove the motion free from t = {first:.6g} s on"
        yield Violation("sampling", first, message, last_time=float(times[-1]))
