"""``cbrrt improve``: a trajectory made better by optimal control."""

from __future__ import annotations

import argparse
from pathlib import Path

from cbrrt_ompl.cli.arguments import (
    Commands,
    add_command,
    add_iterations,
    add_json,
    add_scenario,
    load_trajectory,
    seconds,
)
from cbrrt_ompl.cli.exit_codes import DONE
from cbrrt_ompl.cli.output import print_json, print_values
from cbrrt_ompl.cli.output_files import add_output_files, check_output_files, keeping_inputs
from cbrrt_ompl.cli.progress import warm_up

FILES = {"output": "write the improved trajectory", "figure": "draw both, and the duration against time"}
"""What is written, by the option that asks for it."""


def add_parser(commands: Commands) -> None:
    """Add the command to the grammar."""
    example = "cbrrt improve case1.csv paper_case1 --time-limit 0.5 --output better.csv"
    parser = add_command(commands, "improve", run, "improve a trajectory by optimal control", example)
    parser.add_argument("trajectory", type=Path, metavar="TRAJECTORY", help="trajectory file: .csv, .npz or .json")
    add_scenario(parser)
    text = "time at most [s] (default: 1, without one if --max-iterations is given)"
    parser.add_argument("--time-limit", type=seconds, metavar="S", help=text)
    add_iterations(parser)
    parser.add_argument("--kinematic", action="store_true", help="let velocities jump, as those of s-rrt do")
    add_output_files(parser, FILES)
    add_json(parser)


def run(arguments: argparse.Namespace) -> int:
    """``cbrrt improve``."""
    check_output_files(arguments, FILES)
    from cbrrt_ompl.optimise import Found, improve
    from cbrrt_ompl.scenario.scenario import load_scenario

    with keeping_inputs(arguments, FILES):
        scenario = load_scenario(arguments.scenario)
    given = load_trajectory(arguments, scenario.robot)
    warm_up(None, improves=True)
    history: list[Found] = []
    limits = {"time_limit": arguments.time_limit, "max_iterations": arguments.max_iterations}
    better = improve(given, scenario, **limits, callback=history.append)
    if arguments.output is not None:
        better.save(arguments.output, scenario)
    if arguments.figure is not None:
        from cbrrt_ompl.figures.improvement import draw_improvement
        from cbrrt_ompl.figures.saving import save_figure

        save_figure(draw_improvement(given, better, history, scenario), arguments.figure)
    data = {
        "scenario": scenario.name,
        "given": given.duration,
        "duration": better.duration,
        "length": better.length,
        "history": [row._asdict() for row in history],
    }
    if arguments.json:
        print_json({**data, **{name: getattr(arguments, name) for name in FILES}})
        return DONE
    values = {
        "scenario": scenario.name,
        "given": f"{given.duration:.2f} s",
        "improved": f"{better.duration:.2f} s",
        "length": f"{better.length:.2f} m",
        "found": f"after {1e3 * history[-1].time:.0f} ms, {history[-1].source}",
    }
    print_values(values)
    return DONE
