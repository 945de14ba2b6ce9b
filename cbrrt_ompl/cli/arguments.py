"""Arguments: the types of their values, and those that several commands have."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias, TypeVar

from cbrrt_ompl.errors import Problem

if TYPE_CHECKING:
    from cbrrt_ompl.problem.robot import Robot
    from cbrrt_ompl.trajectory.track import Track
    from cbrrt_ompl.trajectory.trajectory import Trajectory

Rows = TypeVar("Rows", bound="Trajectory | Track")

Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"
"""What the parsers of commands are added to."""


def add_command(
    commands: Commands, name: str, run: Callable[[argparse.Namespace], int], summary: str, example: str
) -> argparse.ArgumentParser:
    """A command with its help and an example.

    Args:
        commands: takes the command.
        name: what is typed.
        run: runs the parsed command line and returns the exit code.
        summary: what it does, one line without a capital and a full stop.
        example: a command line that can be typed as it is.

    Returns:
        The parser that takes the command's arguments.
    """
    parser = commands.add_parser(
        name,
        help=summary,
        description=f"{summary[0].upper()}{summary[1:]}.",
        epilog=f"example:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(run=run)
    return parser


def add_scenario(
    parser: argparse.ArgumentParser, name: str = "scenario", nargs: str | None = None, or_map: bool = False
) -> None:
    """``SCENARIO``, a file or the name of one that comes with the package; or a map where the command takes one."""
    text = "scenario file (YAML), or the name of one that comes along, as paper_case1"
    metavar = "SCENARIO"
    if or_map:
        text, metavar = f"{text}; or a map, as depot.yaml of map_server", "SCENARIO|MAP"
    parser.add_argument(name, type=Path, nargs=nargs, metavar=metavar, help=text)


def add_planner(parser: argparse.ArgumentParser, default: str | None, meaning: str = "") -> None:
    """``--planner``; without a default, the meaning says what is taken."""
    text = f"see 'cbrrt planners' (default: {default or meaning})"
    parser.add_argument("--planner", default=default, metavar="NAME", help=text)


def add_seed(parser: argparse.ArgumentParser) -> None:
    """``--seed`` of a command whose result is a new one each time without it."""
    parser.add_argument("--seed", type=seed, metavar="N", help="seed of the random numbers (default: a new one)")


def add_time_limit(parser: argparse.ArgumentParser, meaning: str) -> None:
    """``--time-limit`` of what the meaning says."""
    text = f"{meaning} at most [s] (default: 5)"
    parser.add_argument("--time-limit", type=seconds, default=5.0, metavar="S", help=text)


def add_iterations(parser: argparse.ArgumentParser) -> None:
    """``--max-iterations`` of an improvement."""
    text = "steps of the solver to improve for: the same result on every run"
    parser.add_argument("--max-iterations", type=count, metavar="N", help=text)


def add_jobs(parser: argparse.ArgumentParser) -> None:
    """``--jobs``."""
    parser.add_argument("--jobs", type=count, metavar="J", help="processes at a time (default: one a processor)")


def add_json(parser: argparse.ArgumentParser) -> None:
    """``--json``."""
    parser.add_argument("--json", action="store_true", help="print the result as JSON, in SI units")


def add_map(parser: argparse.ArgumentParser) -> None:
    """``MAP``, a file."""
    text = "map: a YAML file of map_server, an image (dark is occupied) or a MovingAI map"
    parser.add_argument("scenario", type=Path, metavar="MAP", help=text)


def load_trajectory(arguments: argparse.Namespace, robot: Robot | None) -> Trajectory:
    """The trajectory file of a command line, see :func:`as_kinematic`."""
    from cbrrt_ompl.trajectory.trajectory import Trajectory

    return as_kinematic(Trajectory.load(arguments.trajectory), arguments, robot)


def as_kinematic(rows: Rows, arguments: argparse.Namespace, robot: Robot | None) -> Rows:
    """What a file holds, kinematic where the file or ``--kinematic`` says so or the robot is of first order."""
    is_kinematic = arguments.kinematic or (robot is not None and robot.limits.is_first_order)
    return replace(rows, kinematic=True) if is_kinematic else rows


def seconds(text: str) -> float:
    """A time from the command line [s]."""
    return _above_zero(text, "seconds")


def metres(text: str) -> float:
    """A distance from the command line [m]."""
    return _above_zero(text, "metres")


def tolerance(text: str) -> float:
    """A deviation from the command line."""
    return _above_zero(text, "metres and radians")


def count(text: str) -> int:
    """A number of things from the command line."""
    return _whole(text, 1)


def seed(text: str) -> int:
    """A seed from the command line."""
    return _whole(text, 0)


def _above_zero(text: str, unit: str) -> float:
    """A finite number above 0 from the command line."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise _refusal(text, f"a number of {unit} above 0")
    return value


def _whole(text: str, least: int) -> int:
    """A whole number from the command line."""
    try:
        value = int(text) if text.isascii() and text.isdigit() else -1
    except ValueError:  # more than 4,300 digits
        value = -1
    if value < least:
        raise _refusal(text, f"a whole number of {least} or more")
    return value


def _refusal(text: str, expected: str) -> argparse.ArgumentTypeError:
    """The complaint about a value, in the words of all others of this package."""
    return argparse.ArgumentTypeError(str(Problem("", text, expected)))
