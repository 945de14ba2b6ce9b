"""``cbrrt completion``: a script for the Tab key."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

from cbrrt_ompl.cli.arguments import Commands, add_command
from cbrrt_ompl.cli.exit_codes import DONE

SHELLS = ("bash", "zsh", "tcsh")


def add_parser(commands: Commands) -> None:
    """Add the command to the grammar."""
    summary = "print the script that makes a shell complete cbrrt's arguments"
    parser = add_command(commands, "completion", run, summary, "cbrrt completion bash")
    parser.add_argument("shell", choices=SHELLS, metavar="SHELL", help=", ".join(SHELLS))


def run(arguments: argparse.Namespace) -> int:
    """``cbrrt completion``."""
    import shtab

    from cbrrt_ompl.planners.registry import PLANNERS

    for action in _actions(arguments.parser):
        if action.type is Path:
            action.complete = shtab.DIRECTORY if action.metavar == "DIR" else shtab.FILE  # type: ignore[attr-defined]
        elif action.dest in ("planner", "reference"):
            action.choices = list(PLANNERS)
    print(shtab.complete(arguments.parser, arguments.shell))
    return DONE


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """All arguments of a parser and of its commands."""
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _actions(command)
