"""``cbrrt verify``: a trajectory checked against a scenario."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from cbrrt_ompl.cli.arguments import Commands, add_command, add_json, add_scenario, as_kinematic, tolerance
from cbrrt_ompl.cli.exit_codes import DONE, FAILED
from cbrrt_ompl.cli.output import print_json, verdict

if TYPE_CHECKING:
    from cbrrt_ompl.trajectory.track import Track
    from cbrrt_ompl.trajectory.trajectory import Trajectory


def add_parser(commands: Commands) -> None:
    """Add the command to the grammar."""
    example = "cbrrt verify case1.csv paper_case1"
    parser = add_command(commands, "verify", run, "check a trajectory against a scenario", example)
    parser.add_argument(
        "trajectory",
        type=Path,
        metavar="TRAJECTORY",
        help="trajectory file: .csv, .npz, .json, a dynobench result (.yaml) or a bag",
    )
    add_scenario(parser)
    parser.add_argument("--kinematic", action="store_true", help="let velocities jump, as those of s-rrt do")
    text = "deviation that is accepted [m, rad, m/s, rad/s] (default: 0.001)"
    parser.add_argument("--tolerance", type=tolerance, default=1e-3, metavar="T", help=text)
    parser.add_argument("--collisions-only", action="store_true", help="check nothing but collisions")
    parser.add_argument("--topic", metavar="NAME", help="topic of a bag (default: the first nav_msgs/Path)")
    add_json(parser)


def run(arguments: argparse.Namespace) -> int:
    """``cbrrt verify``."""
    from cbrrt_ompl.scenario.scenario import load_scenario
    from cbrrt_ompl.verification import verify

    scenario = load_scenario(arguments.scenario)
    verification = verify(
        as_kinematic(_load(arguments), arguments, scenario.robot),
        scenario,
        tolerance=arguments.tolerance,
        collisions_only=arguments.collisions_only,
    )
    if arguments.json:
        print_json({"ok": verification.ok, **asdict(verification)})
    else:
        first, *details = verification.summary().splitlines()
        print("\n".join([verdict(first, verification.ok), *details]))
    return DONE if verification.ok else FAILED


def _load(arguments: argparse.Namespace) -> Trajectory | Track:
    """The trajectory or track of a file."""
    from cbrrt_ompl.export.ros_bag import is_bag, read_track
    from cbrrt_ompl.trajectory.foreign import load_track

    if is_bag(arguments.trajectory):
        return read_track(arguments.trajectory, arguments.topic)
    return load_track(arguments.trajectory)
