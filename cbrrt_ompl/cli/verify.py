"""``cbrrt verify``: a trajectory checked against a scenario."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

from cbrrt_ompl.cli.arguments import Commands, add_command, add_json, add_scenario, load_trajectory
from cbrrt_ompl.cli.exit_codes import DONE, FAILED
from cbrrt_ompl.cli.output import print_json, verdict


def add_parser(commands: Commands) -> None:
    """Add the command to the grammar."""
    example = "cbrrt verify case1.csv paper_case1"
    parser = add_command(commands, "verify", run, "check a trajectory against a scenario", example)
    parser.add_argument("trajectory", type=Path, metavar="TRAJECTORY", help="trajectory file: .csv, .npz or .json")
    add_scenario(parser)
    parser.add_argument("--kinematic", action="store_true", help="let velocities jump, as those of s-rrt do")
    add_json(parser)


def run(arguments: argparse.Namespace) -> int:
    """``cbrrt verify``."""
    from cbrrt_ompl.scenario.scenario import load_scenario
    from cbrrt_ompl.verification import verify

    trajectory = load_trajectory(arguments)
    verification = verify(trajectory, load_scenario(arguments.scenario))
    if arguments.json:
        print_json({"ok": verification.ok, **asdict(verification)})
    else:
        first, *details = verification.summary().splitlines()
        print("\n".join([verdict(first, verification.ok), *details]))
    return DONE if verification.ok else FAILED
