"""What planners hand out: trajectories and trees."""

from __future__ import annotations

from cbrrt_ompl.trajectory.trajectory import PointTurn, Trajectory
from cbrrt_ompl.trajectory.tree import Tree

__all__ = ["PointTurn", "Trajectory", "Tree"]
