"""``cbrrt completion``: a script for the Tab key."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from cbrrt_ompl.cli.arguments import Commands, add_command
from cbrrt_ompl.cli.exit_codes import DONE

SHELLS = ("bash", "zsh", "tcsh", "fish")


def add_parser(commands: Commands) -> None:
    """Add the command to the grammar."""
    summary = "print the script that makes a shell complete cbrrt's arguments"
    parser = add_command(commands, "completion", run, summary, "cbrrt completion bash")
    parser.add_argument("shell", choices=SHELLS, metavar="SHELL", help=", ".join(SHELLS))


def run(arguments: argparse.Namespace) -> int:
    """``cbrrt completion``."""
    import shtab

    from cbrrt_ompl.planners.registry import PLANNERS
    from cbrrt_ompl.problem.ready_robots import ROBOTS
    from cbrrt_ompl.scenario.sources import scenario_names

    scenarios = _names_or_files("scenarios", scenario_names())
    robots = _names_or_files("robots", ROBOTS)
    for action in _actions(arguments.parser):
        if action.metavar is not None and "SCENARIO" in action.metavar:
            action.complete = scenarios  # type: ignore[attr-defined]
        elif action.dest == "robot":
            action.complete = robots  # type: ignore[attr-defined]
        elif action.type is Path:
            action.complete = shtab.DIRECTORY if action.metavar == "DIR" else shtab.FILE  # type: ignore[attr-defined]
        elif action.dest in ("planner", "reference"):
            action.choices = list(PLANNERS)
    print(shtab.complete(arguments.parser, arguments.shell))
    return DONE


def _names_or_files(kind: str, names: Iterable[str]) -> dict[str, Any]:
    """How each shell completes one of some names, or a file."""
    words, function = " ".join(names), f"_cbrrt_{kind}"
    return {
        "bash": function,
        "zsh": f"({{_alternative 'names:name:({words})' 'files:file:_files'}})",
        "tcsh": "f",
        "fish": f"({function})",
        "preamble": {
            "bash": f'{function}() {{ compgen -W "{words}" -- "$1"; _shtab_compgen_files "$1"; }}',
            "fish": f"function {function}\n  printf '%s\\n' {words}\n  __fish_complete_path (commandline -ct)\nend",
        },
    }


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """All arguments of a parser and of its commands."""
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _actions(command)
