"""``cbrrt new``: a scenario file for a map."""

from __future__ import annotations

import argparse
import math
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cbrrt_ompl.cli.arguments import Commands, add_command, add_map
from cbrrt_ompl.cli.exit_codes import DONE
from cbrrt_ompl.cli.problem import add_problem, given_source, map_planner
from cbrrt_ompl.errors import MISSING, InputError, Problem, Refusal, Remark

if TYPE_CHECKING:
    from cbrrt_ompl.scenario.draft import Draft


def add_parser(commands: Commands) -> None:
    """Add the command to the grammar."""
    summary = "write a scenario file for a map"
    parser = add_command(commands, "new", run, summary, "cbrrt new depot.yaml --robot jackal --output tour.yaml")
    add_map(parser)
    parser.add_argument("--output", type=Path, metavar="FILE", help="a new file (default: print it)")
    add_problem(parser)


def run(arguments: argparse.Namespace) -> int:
    """``cbrrt new``."""
    from cbrrt_ompl.files import write_new_file
    from cbrrt_ompl.scenario.draft import make_draft
    from cbrrt_ompl.scenario.sources import is_map
    from cbrrt_ompl.scenario.template import scenario_text

    output: Path | None = arguments.output
    if arguments.scenario.suffix and not arguments.scenario.exists():
        raise InputError(Problem("", Refusal("no such file"), "a map"), str(arguments.scenario))
    if not is_map(arguments.scenario):
        raise InputError(
            Problem("", Remark("no map"), "a map that 'map:' of a scenario reads"), str(arguments.scenario)
        )
    if arguments.robot is None:
        raise InputError(Problem("--robot", MISSING, "a ready robot (see 'cbrrt robots'), or a file of parameters"))
    if output is not None and output.exists():
        raise InputError(Problem("--output", str(output), "a file that does not exist: none is overwritten"))
    source, report = given_source(arguments, may_lack=True)
    draft = make_draft(source, report)
    data = {**source.data} if isinstance(source.data, dict) else {}
    data |= _places(arguments, draft, data)
    folder = Path() if output is None else output.parent
    data["map"] = {**data["map"], "file": _seen_from(Path(data["map"]["file"]), folder)}
    if isinstance(data["robot"], dict) and "nav2" in data["robot"]:
        data["robot"] = {**data["robot"], "nav2": _seen_from(Path(data["robot"]["nav2"]), folder)}
    text = scenario_text(data, f"cbrrt plan {output or 'FILE'} --planner {map_planner()}")
    if output is None:
        print(text, end="")
    else:
        write_new_file(output, text)
        print(output)
    return DONE


def _places(arguments: argparse.Namespace, draft: Draft, data: dict[str, Any]) -> dict[str, Any]:
    """Start and goal: as given, else two free places far from each other."""
    from cbrrt_ompl.scenario.maps.free_places import places_apart
    from cbrrt_ompl.scenario.maps.loading import load_map
    from cbrrt_ompl.scenario.maps.rasterizing import rasterize

    assert draft.map is not None
    wrong = [problem for problem in draft.problems if problem.value is not MISSING]
    if wrong:
        raise InputError(wrong, str(arguments.scenario))
    found = {name: data[name] for name in ("start", "goal") if getattr(arguments, name) is not None}
    if len(found) == 2:
        return found
    side = load_map(draft.map.file, resolution=draft.map.resolution).resolution
    grid = rasterize(draft.world, side)  # with all that blocks, keepout masks too
    (x, y), (goal_x, goal_y) = places_apart(grid, draft.robot.footprint.circumscribed_radius + _clearance(data))
    theta = math.radians(round(math.degrees(math.atan2(goal_y - y, goal_x - x))))
    start = {"x": x, "y": y, "theta": theta}
    return {"start": start, "goal": {"x": goal_x, "y": goal_y, **data["goal"]}, **found}


def _clearance(data: dict[str, Any]) -> float:
    """The distance that the scenario keeps [m]."""
    return float(data["planning"].get("clearance", 0.0))


def _seen_from(file: Path, folder: Path) -> str:
    """A file's name relative to a folder."""
    try:
        return Path(os.path.relpath(file, folder)).as_posix()
    except ValueError:  # another drive
        return file.resolve().as_posix()
