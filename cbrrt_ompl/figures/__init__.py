"""Figures and animations; each function draws on the axes given to it, none shows or saves."""

from __future__ import annotations

from cbrrt_ompl.figures.figures import (
    draw_computing_times,
    draw_drive,
    draw_extension,
    draw_plan,
    draw_scene,
    draw_trajectory,
    draw_tree,
    draw_unknown,
    draw_velocities,
    draw_world,
)
from cbrrt_ompl.figures.improvement import draw_history, draw_improvement
from cbrrt_ompl.figures.maps import draw_draft, draw_map

__all__ = [
    "draw_computing_times",
    "draw_draft",
    "draw_drive",
    "draw_extension",
    "draw_map",
    "draw_history",
    "draw_improvement",
    "draw_plan",
    "draw_scene",
    "draw_trajectory",
    "draw_tree",
    "draw_unknown",
    "draw_velocities",
    "draw_world",
]
