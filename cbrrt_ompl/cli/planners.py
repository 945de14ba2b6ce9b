"""``cbrrt planners``: the list of the planners."""

from __future__ import annotations

import argparse

from cbrrt_ompl.cli.arguments import Commands, add_command, add_json
from cbrrt_ompl.cli.exit_codes import DONE
from cbrrt_ompl.cli.output import print_json, print_values


def add_parser(commands: Commands) -> None:
    """Add the command to the grammar."""
    add_json(add_command(commands, "planners", run, "list the planners", "cbrrt planners"))


def run(arguments: argparse.Namespace) -> int:
    """``cbrrt planners``."""
    from cbrrt_ompl.planners.registry import PLANNERS

    if arguments.json:
        print_json({name: row.description for name, row in PLANNERS.items()})
    else:
        print_values({name: row.description for name, row in PLANNERS.items()})
    return DONE
