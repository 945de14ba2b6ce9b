"""``cbrrt show``: a picture of a scenario, and of a trajectory in it."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cbrrt_ompl.cli.arguments import Commands, add_command, add_scenario, load_trajectory
from cbrrt_ompl.cli.exit_codes import DONE
from cbrrt_ompl.cli.output_files import check_backend, check_output_files, keeping_inputs
from cbrrt_ompl.cli.problem import add_problem, given_source, print_remarks
from cbrrt_ompl.errors import MISSING, CbrrtError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from cbrrt_ompl.scenario.draft import Draft


def add_parser(commands: Commands) -> None:
    """Add the command to the grammar."""
    example = "cbrrt show paper_case1 --trajectory case1.csv --figure case1.png"
    parser = add_command(commands, "show", run, "draw a scenario or a map, and a trajectory in it", example)
    add_scenario(parser, or_map=True)
    parser.add_argument("--trajectory", type=Path, metavar="FILE", help="draw this trajectory too")
    parser.add_argument("--kinematic", action="store_true", help="let its velocities jump, as those of s-rrt do")
    parser.add_argument("--figure", type=Path, metavar="FILE", help="write .png, .pdf or .svg instead of a window")
    add_problem(parser)


def run(arguments: argparse.Namespace) -> int:
    """``cbrrt show``."""
    check_output_files(arguments, ["figure"])
    check_backend()
    from matplotlib.figure import Figure

    from cbrrt_ompl.figures import draw_draft, draw_map, draw_trajectory
    from cbrrt_ompl.figures.layout import DPI, plane_size
    from cbrrt_ompl.figures.saving import save_figure
    from cbrrt_ompl.figures.style import legend_above
    from cbrrt_ompl.scenario.maps.loading import load_map

    with keeping_inputs(arguments, ["figure"]):
        draft = _draft(arguments)
        grid = load_map(**_map_of(arguments, draft)) if draft is None or draft.map is not None else None
    robot = None if draft is None else draft.robot
    trajectory = None if arguments.trajectory is None else load_trajectory(arguments, robot)
    print_remarks(grid)
    bounds = draft.world.bounds if draft is not None else grid.bounds() if grid is not None else None
    assert bounds is not None
    size: dict[str, Any] = {"figsize": plane_size(bounds), "layout": "constrained", "dpi": DPI}
    figure = Figure(**size) if arguments.figure is not None else _window(**size)
    ax = figure.subplots()
    if draft is not None:
        draw_draft(ax, draft, grid)
    elif grid is not None:
        draw_map(ax, grid, "cells" if _is_without_scale(arguments) else "m")
    if trajectory is not None:
        draw_trajectory(ax, trajectory, None if draft is None else draft.robot.footprint)
    legend_above(ax)
    figure.suptitle(arguments.scenario.name if draft is None else draft.name, fontsize=10, parse_math=False)
    if arguments.figure is not None:
        save_figure(figure, arguments.figure)
    else:
        from matplotlib import pyplot

        pyplot.show()
    return DONE


def _draft(arguments: argparse.Namespace) -> Draft | None:
    """The scenario that is to be drawn, with what is wrong in it told on stderr; None for a map alone."""
    from cbrrt_ompl.scenario.draft import make_draft
    from cbrrt_ompl.scenario.sources import is_map

    has_map = is_map(arguments.scenario)
    if has_map and arguments.start is arguments.goal is arguments.robot is None and not arguments.set:
        return None
    draft = make_draft(*given_source(arguments, may_lack=True))
    for problem in draft.problems:
        if not (has_map and problem.value is MISSING):
            print(f"cbrrt: {arguments.scenario}: {problem}", file=sys.stderr)
    return draft


def _map_of(arguments: argparse.Namespace, draft: Draft | None) -> dict[str, Any]:
    """What the map is read by; a cell counts as a metre where nobody tells its size."""
    if draft is not None and draft.map is not None:
        return {"path": draft.map.file, "resolution": draft.map.resolution, "may_be_full": True}
    if _is_without_scale(arguments):
        text = "it does not tell the size of its cells (--resolution), the axes count them"
        print(f"cbrrt: {arguments.scenario}: {text}", file=sys.stderr)
    resolution = 1.0 if _is_without_scale(arguments) else arguments.resolution
    return {"path": arguments.scenario, "resolution": resolution, "may_be_full": True}


def _is_without_scale(arguments: argparse.Namespace) -> bool:
    """Whether the map that was given does not tell the size of its cells, and nobody else does."""
    from cbrrt_ompl.scenario.sources import has_no_scale

    return arguments.resolution is None and has_no_scale(arguments.scenario)


def _window(**size: Any) -> Figure:
    """A figure in a window, yet to be shown.

    Raises:
        CbrrtError: if there is no display.
    """
    from matplotlib import pyplot
    from matplotlib.backends import BackendFilter, backend_registry

    try:
        figure = pyplot.figure(**size)
        has_window = pyplot.get_backend().lower() in backend_registry.list_builtin(BackendFilter.INTERACTIVE)
    except ImportError:
        has_window = False
    if not has_window:
        raise CbrrtError("no display to open a window on, write a file with --figure FILE")
    return figure
