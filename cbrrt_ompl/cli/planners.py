"""``cbrrt planners``: the list of the planners."""

from __future__ import annotations

import argparse

from cbrrt_ompl.cli.arguments import Commands, add_command, add_json
from cbrrt_ompl.cli.exit_codes import DONE
from cbrrt_ompl.cli.output import print_json, print_values

NOT_AVAILABLE = " [not available: no OMPL]"
"""What is added to the description of a planner that cannot plan here."""


def add_parser(commands: Commands) -> None:
    """Add the command to the grammar."""
    add_json(add_command(commands, "planners", run, "list the planners", "cbrrt planners"))


def run(arguments: argparse.Namespace) -> int:
    """``cbrrt planners``."""
    from cbrrt_ompl.planners.registry import PLANNERS
    from cbrrt_ompl.planning import available_planners

    available = available_planners()
    planners = {
        name: planner.description + ("" if name in available else NOT_AVAILABLE) for name, planner in PLANNERS.items()
    }
    if arguments.json:
        print_json(planners)
    else:
        print_values(planners)
    return DONE
