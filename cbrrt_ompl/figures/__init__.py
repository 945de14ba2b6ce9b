"""Figures and animations; each function draws on the axes given to it, none shows or saves."""

from __future__ import annotations

from cbrrt_ompl.figures.drive import draw_computing_times, draw_drive, draw_unknown
from cbrrt_ompl.figures.explorer import explore
from cbrrt_ompl.figures.extension import draw_extension
from cbrrt_ompl.figures.improvement import draw_history, draw_improvement
from cbrrt_ompl.figures.maps import draw_draft, draw_map
from cbrrt_ompl.figures.plan import draw_plan
from cbrrt_ompl.figures.scene import draw_scene, draw_world
from cbrrt_ompl.figures.trajectory import draw_trajectory
from cbrrt_ompl.figures.tree import draw_tree
from cbrrt_ompl.figures.velocities import draw_velocities

__all__ = [
    "draw_computing_times",
    "draw_draft",
    "draw_drive",
    "draw_extension",
    "draw_history",
    "draw_improvement",
    "draw_map",
    "draw_plan",
    "draw_scene",
    "draw_trajectory",
    "draw_tree",
    "draw_unknown",
    "draw_velocities",
    "draw_world",
    "explore",
]
