"""``cbrrt drive``: a drive through a world known within a sensor's range only."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cbrrt_ompl.cli.arguments import (
    Commands,
    add_command,
    add_json,
    add_planner,
    add_scenario,
    add_seed,
    count,
    metres,
    seconds,
)
from cbrrt_ompl.cli.exit_codes import DONE, FAILED
from cbrrt_ompl.cli.output import heading, print_json, print_values
from cbrrt_ompl.cli.output_files import add_output_files, check_output_files, keeping_inputs
from cbrrt_ompl.cli.progress import warm_up

if TYPE_CHECKING:
    from cbrrt_ompl.drive import DriveResult

FILES = {"trajectory": "write the way driven", "figure": "draw the drive", "animation": "show the drive"}
"""What is written, by the option that asks for it."""


def add_parser(commands: Commands) -> None:
    """Add the command to the grammar."""
    example = "cbrrt drive office --sensor-range 2.5 --seed 2 --animation office.gif"
    summary = "drive through a world known within a sensor's range only, planning on the way"
    parser = add_command(commands, "drive", run, summary, example)
    add_scenario(parser)
    hidden = parser.add_mutually_exclusive_group()
    hidden.add_argument(
        "--unknown", type=count, metavar="N",
        help="know the scenario, but not N random obstacles (default: none of the scenario's obstacles is known)",
    )  # fmt: skip
    hidden.add_argument(
        "--hidden", type=Path, metavar="FILE", help="know the scenario, but not the obstacles of this file (YAML)"
    )
    parser.add_argument(
        "--sensor-range", type=metres, default=3.0, metavar="R", help="how far the robot sees [m] (default: 3)"
    )
    parser.add_argument(
        "--line-of-sight", action="store_true", help="do not see what obstacles hide (default: all within range)"
    )
    parser.add_argument(
        "--cycle", type=seconds, default=0.1, metavar="S",
        help="time between two looks, and of a plan [s] (default: 0.1)",
    )  # fmt: skip
    add_planner(parser, "cb-rrt-robust")
    add_seed(parser)
    parser.add_argument(
        "--max-samples", type=count, metavar="N",
        help="samples of a plan at most, instead of the cycle's time: the same drive on every machine",
    )  # fmt: skip
    parser.add_argument(
        "--max-iterations", type=count, default=0, metavar="N",
        help="Newton steps to improve each plan for, as 600 (default: plans are driven as they are)",
    )  # fmt: skip
    add_output_files(parser, FILES)
    add_json(parser)


def run(arguments: argparse.Namespace) -> int:
    """``cbrrt drive``."""
    check_output_files(arguments, FILES)
    from cbrrt_ompl.drive import DriveSettings, drive
    from cbrrt_ompl.drive.unknown import load_obstacles, unknown_obstacles
    from cbrrt_ompl.scenario.scenario import load_scenario

    with keeping_inputs(arguments, FILES):
        scenario = load_scenario(arguments.scenario)
        listed = None if arguments.hidden is None else load_obstacles(arguments.hidden)
    names = ("sensor_range", "cycle", "planner", "max_samples", "max_iterations", "line_of_sight")
    settings = DriveSettings(**{name: getattr(arguments, name) for name in names})
    hidden = listed
    if arguments.unknown is not None:
        hidden = unknown_obstacles(scenario, arguments.unknown, arguments.seed, settings.margin)
    warm_up(arguments.planner)
    result = drive(scenario, hidden, settings, arguments.seed)
    if arguments.trajectory is not None:
        result.trajectory.save(arguments.trajectory, scenario)
    if arguments.figure is not None:
        from cbrrt_ompl.figures import draw_drive
        from cbrrt_ompl.figures.saving import save_figure

        save_figure(draw_drive(result), arguments.figure)
    if arguments.animation is not None:
        from cbrrt_ompl.figures.animation import animate_drive, save_animation

        save_animation(animate_drive(result), arguments.animation)
    data = {"scenario": scenario.name, "seed": arguments.seed, **_data(result)}
    if arguments.json:
        print_json({**data, **{name: getattr(arguments, name) for name in FILES}})
    else:
        print_values(_values(data))
    return DONE if result.reached else FAILED


def _data(result: DriveResult) -> dict[str, Any]:
    """The result of a drive, for programs, in SI units."""
    verification = result.verification
    return {
        "planner": result.settings.planner,
        "status": result.status,
        "reached": result.reached,
        "blocked_by": result.blocked_by or None,
        "duration": result.trajectory.duration,
        "length": result.trajectory.length,
        "plans": len(result.replans),
        "plans_taken": sum(replan.trajectory is not None for replan in result.replans),
        "obstacles_found": sum(len(cycle.seen) for cycle in result.cycles),
        "obstacles_hidden": len(result.hidden),
        "cycle": result.settings.cycle,
        "longest_search": max((replan.planning_time for replan in result.replans), default=0.0),
        "longest_computing": max((cycle.computing_time for cycle in result.cycles), default=0.0),
        "smallest_clearance": verification.smallest_clearance,
        "violations": [violation.message for violation in verification.violations],
    }


def _values(data: dict[str, Any]) -> dict[str, str]:
    """The result of a drive, for people."""
    violations = data["violations"]
    return {
        **heading(data, data["reached"]),
        **({"blocked by": data["blocked_by"]} if data["blocked_by"] else {}),
        "duration": f"{data['duration']:.2f} s",
        "length": f"{data['length']:.2f} m",
        "plans": f"{data['plans']}, {data['plans_taken']} taken",
        "obstacles found": f"{data['obstacles_found']} of {data['obstacles_hidden']} hidden",
        "longest search": f"{1e3 * data['longest_search']:.1f} ms, cycle {1e3 * data['cycle']:g} ms",
        "longest computing": f"{1e3 * data['longest_computing']:.1f} ms",
        "smallest clearance": f"{data['smallest_clearance']:.3f} m",
        "verified": "valid" if not violations else "NOT VALID: " + "; ".join(violations),
    }
