"""The pictures that worlds, scenarios, trajectories and plans show of themselves in a notebook."""

from __future__ import annotations

from functools import singledispatch

import numpy as np

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.figures.layout import ShownFigure, plane_alone, plane_and_curves
from cbrrt_ompl.figures.plan import draw_plan
from cbrrt_ompl.figures.scene import draw_scene, draw_world
from cbrrt_ompl.figures.style import legend_above, shrink_labels
from cbrrt_ompl.figures.trajectory import draw_trajectory
from cbrrt_ompl.figures.velocities import draw_velocities
from cbrrt_ompl.planning import PlanResult
from cbrrt_ompl.problem.obstacles import Bounds
from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.trajectory.trajectory import Trajectory


def png_of(value: object) -> bytes | None:
    """The picture of a value as PNG; None where there is none."""
    figure = figure_of(value)
    return None if figure is None else figure._repr_png_()


@singledispatch
def figure_of(value: object) -> ShownFigure | None:
    """The figure that shows a value; None where nothing does."""
    return None


@figure_of.register
def _(world: World) -> ShownFigure:
    figure, plane = plane_alone(world.bounds)
    legend_above(draw_world(plane, world))
    shrink_labels(figure)
    return figure


@figure_of.register
def _(scenario: Scenario) -> ShownFigure:
    figure, plane = plane_alone(scenario.world.bounds)
    figure.suptitle(scenario.name, fontsize=9, parse_math=False)
    legend_above(draw_scene(plane, scenario))
    shrink_labels(figure)
    return figure


@figure_of.register
def _(trajectory: Trajectory) -> ShownFigure:
    points = trajectory.poses[:, :2]
    margin = 0.1 * max(float(np.ptp(points, axis=0).max()), 1.0)
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    bounds = Bounds((float(low[0]), float(low[1])), (float(high[0]), float(high[1])))
    figure, plane, curves, _ = panels = plane_and_curves(bounds, 2)
    draw_trajectory(plane, trajectory)
    plane.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xlabel="x [m]", ylabel="y [m]")
    plane.grid(True, linewidth=0.4, color="0.88")
    draw_velocities(curves, trajectory, trajectory.limits)
    figure.suptitle(repr(trajectory), fontsize=9, parse_math=False)
    return panels.finish()


@figure_of.register
def _(result: PlanResult) -> ShownFigure | None:
    return None if result.scenario is None else draw_plan(result, result.scenario)
