"""What a search comes back with, whoever ran it."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.trajectory.tree import Tree


class FirstPlan(NamedTuple):
    """A trajectory, if the search found one, and what it took."""

    trajectory: Trajectory | None
    """Into the goal region; None where it was not reached."""
    count_nodes: Callable[[], int]
    """Counts the nodes of the tree; OMPL copies it for that, so that it takes its time."""
    samples: int
    """Samples drawn, or rounds of the main loop of OMPL's own planners."""
    planning_time: float
    """Time of the search alone [s]."""
    make_tree: Callable[[], Tree]
    """Makes the tree out of the planner's memory."""
