"""What a planner found."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

from cbrrt_ompl.figures.layout import ShownFigure, plane_alone, plane_and_curves
from cbrrt_ompl.figures.scene import draw_scene
from cbrrt_ompl.figures.style import legend_above, shrink_labels, time_text
from cbrrt_ompl.figures.trajectory import draw_trajectory
from cbrrt_ompl.figures.tree import draw_tree
from cbrrt_ompl.figures.velocities import draw_velocities

if TYPE_CHECKING:
    from cbrrt_ompl.planning import PlanResult
    from cbrrt_ompl.scenario.scenario import Scenario


def draw_plan(result: PlanResult, scenario: Scenario) -> ShownFigure:
    """Draw what a planner found: scene, tree and path, the two velocity curves beside or below them.

    Args:
        result: what :func:`cbrrt_ompl.planning.plan` returned, solved or not.
        scenario: what it was planned for.

    Returns:
        A figure of its own, not known to pyplot.
    """
    trajectory, bounds = result.trajectory, scenario.world.bounds
    if trajectory is None:
        figure, plane = plane_alone(bounds)
    else:
        panels = plane_and_curves(bounds, 2)
        figure, plane = panels.figure, panels.plane
        draw_velocities(panels.curves, trajectory, scenario.robot.limits)
    figure.suptitle(plan_title(result, scenario), fontsize=9, parse_math=False)
    draw_scene(plane, scenario)
    draw_tree(plane, result.tree)
    if trajectory is None:
        legend_above(plane)
        shrink_labels(figure)
        return figure
    draw_trajectory(plane, trajectory, scenario.robot.footprint)
    return panels.finish()


def plan_title(result: PlanResult, scenario: Scenario) -> str:
    """Scenario and planner; on another line nodes, samples, planning time and duration of the trajectory."""
    found = f"{result.trajectory.duration:.2f} s of driving" if result.trajectory is not None else result.status
    return (
        f"{textwrap.fill(f'{scenario.name}, {result.planner}', 56)}\n{result.nodes:,} nodes, "
        f"{result.samples:,} samples, {time_text(result.planning_time)}, {found}"
    )
