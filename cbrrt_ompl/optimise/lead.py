"""The first rows of a trajectory, where the robot stands closer to something than a motion may come.

Only the start may be as close as that. How the robot gets away from there is a matter of single points, a millimetre
apart, which the solver does not see: what a planner found is kept, and the rest is improved.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.optimise.clearance import clearances, least_clearance
from cbrrt_ompl.problem.settings import State
from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.trajectory.columns import COLUMNS
from cbrrt_ompl.trajectory.trajectory import Trajectory


def lead_rows(trajectory: Trajectory, scenario: Scenario, room: float) -> int:
    """How many rows come before the first one with some room [m]; 0 where the start may be left by any motion."""
    if clearances(trajectory.states[:1], scenario)[0] >= least_clearance(scenario):
        return 0
    return int(np.argmax(clearances(trajectory.states, scenario) >= room))


def split_at(trajectory: Trajectory, row: int) -> tuple[Trajectory, Trajectory]:
    """A trajectory up to a row and from there on, where its time begins anew."""
    columns = [getattr(trajectory, name) for name in COLUMNS]
    after = [column[row:] for column in columns]
    after[0] = after[0] - trajectory.t[row]
    return _like(trajectory, [column[: row + 1] for column in columns]), _like(trajectory, after)


def joined(lead: Trajectory, rest: Trajectory) -> Trajectory:
    """The rest after its lead, whose last row is the rest's first one."""
    columns = [np.concatenate([getattr(lead, name)[:-1], getattr(rest, name)]) for name in COLUMNS]
    columns[0][len(lead) - 1 :] += lead.t[-1]
    return _like(rest, columns)


def _like(trajectory: Trajectory, columns: Sequence[NDArray[np.float64]]) -> Trajectory:
    """A trajectory of the same kind."""
    return Trajectory(*columns, kinematic=trajectory.kinematic, limits=trajectory.limits)


def begun_later(scenario: Scenario, lead: Trajectory) -> Scenario:
    """The same problem from the end of a lead on."""
    return replace(scenario, start=State(*lead.states[-1].tolist()))
