"""``cbrrt scenarios``: the list of the scenarios that come with the package."""

from __future__ import annotations

import argparse
import textwrap
from pathlib import Path

from cbrrt_ompl.cli.arguments import Commands, add_command, add_json
from cbrrt_ompl.cli.exit_codes import DONE
from cbrrt_ompl.cli.output import LINE_WIDTH, print_json, print_values


def add_parser(commands: Commands) -> None:
    """Add the command to the grammar."""
    add_json(add_command(commands, "scenarios", run, "list the scenarios that come along", "cbrrt scenarios"))


def run(arguments: argparse.Namespace) -> int:
    """``cbrrt scenarios``."""
    from cbrrt_ompl.scenario.sources import scenario_names

    found = scenario_names()
    if arguments.json:
        print_json({name: {"file": file, "about": _about(file)} for name, file in found.items()})
    else:
        width = LINE_WIDTH - 2 - max(map(len, found))
        print_values({name: textwrap.shorten(_about(file), width, placeholder=" ...") for name, file in found.items()})
    return DONE


def _about(file: Path) -> str:
    """The comment that a scenario file begins with, up to its first full stop."""
    lines = file.read_text(encoding="utf-8").splitlines()
    comment = " ".join(line[1:].strip() for line in lines[: next(i for i, x in enumerate(lines) if x[:1] != "#")])
    return comment.partition(". ")[0].removesuffix(".")
