"""``cbrrt show``: a picture of a scenario, and of a trajectory in it."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cbrrt_ompl.cli.arguments import Commands, add_command, add_scenario, load_trajectory
from cbrrt_ompl.cli.exit_codes import DONE
from cbrrt_ompl.cli.output_files import check_backend, check_output_files
from cbrrt_ompl.errors import CbrrtError

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def add_parser(commands: Commands) -> None:
    """Add the command to the grammar."""
    example = "cbrrt show paper_case1 --trajectory case1.csv --figure case1.png"
    parser = add_command(commands, "show", run, "draw a scenario, and a trajectory in it", example)
    add_scenario(parser)
    parser.add_argument("--trajectory", type=Path, metavar="FILE", help="draw this trajectory too")
    parser.add_argument("--kinematic", action="store_true", help="let its velocities jump, as those of s-rrt do")
    parser.add_argument("--figure", type=Path, metavar="FILE", help="write .png, .pdf or .svg instead of a window")


def run(arguments: argparse.Namespace) -> int:
    """``cbrrt show``."""
    check_output_files(arguments, ["figure"])
    check_backend()
    from matplotlib.figure import Figure

    from cbrrt_ompl.figures.figures import draw_scene, draw_trajectory
    from cbrrt_ompl.files import save_figure
    from cbrrt_ompl.scenario.scenario import load_scenario

    scenario = load_scenario(arguments.scenario)
    trajectory = None if arguments.trajectory is None else load_trajectory(arguments)
    size: dict[str, Any] = {"figsize": (6.4, 6.4), "layout": "constrained", "dpi": 150}
    figure = Figure(**size) if arguments.figure is not None else _window(**size)
    ax = draw_scene(figure.subplots(), scenario)
    if trajectory is not None:
        draw_trajectory(ax, trajectory, scenario.robot.footprint)
    ax.set_title(scenario.name, parse_math=False)
    if arguments.figure is not None:
        save_figure(figure, arguments.figure)
    else:
        from matplotlib import pyplot

        pyplot.show()
    return DONE


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
