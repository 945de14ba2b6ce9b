"""``cbrrt robots``: the list of the ready robots."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING

from cbrrt_ompl.cli.arguments import Commands, add_command, add_json
from cbrrt_ompl.cli.exit_codes import DONE
from cbrrt_ompl.cli.output import print_json, print_values

if TYPE_CHECKING:
    from cbrrt_ompl.problem.robot import Robot


def add_parser(commands: Commands) -> None:
    """Add the command to the grammar."""
    add_json(add_command(commands, "robots", run, "list the ready robots", "cbrrt robots"))


def run(arguments: argparse.Namespace) -> int:
    """``cbrrt robots``."""
    from cbrrt_ompl.problem.ready_robots import ROBOTS
    from cbrrt_ompl.scenario.scenario_file import robot_data

    if arguments.json:
        print_json({name: robot_data(robot) for name, robot in ROBOTS.items()})
    else:
        print_values({name: _line(robot) for name, robot in ROBOTS.items()})
    return DONE


def _line(robot: Robot) -> str:
    """Footprint and top speeds of a robot."""
    limits, shape = robot.limits, robot.footprint
    size = "a point"
    if shape.vertices is not None:
        length, width = (float(side) for side in shape.vertices.max(axis=0) - shape.vertices.min(axis=0))
        size = f"{length:.3g} m x {width:.3g} m"
    elif shape.radius > 0.0:
        size = f"a disc of {shape.radius:.3g} m"
    return f"{limits.v_max:.3g} m/s, {math.degrees(limits.omega_max):.0f} deg/s, {size}"
