"""``cbrrt plan``: a trajectory through a scenario."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from cbrrt_ompl.cli.arguments import (
    Commands,
    add_command,
    add_iterations,
    add_json,
    add_planner,
    add_scenario,
    add_seed,
    add_time_limit,
    seconds,
)
from cbrrt_ompl.cli.exit_codes import DONE, FAILED
from cbrrt_ompl.cli.output import heading, print_json, print_values
from cbrrt_ompl.cli.output_files import add_output_files, check_output_files, keeping_inputs
from cbrrt_ompl.cli.problem import MAP_PLANNERS, add_problem, given_scenario, map_planner
from cbrrt_ompl.cli.progress import plan_progress, warm_up

if TYPE_CHECKING:
    from cbrrt_ompl.planning import PlanResult
    from cbrrt_ompl.scenario.scenario import Scenario

FILES = {
    "trajectory": "write the trajectory",
    "figure": "draw scene, tree and path",
    "animation": "show the robot drive",
}
"""What is written, by the option that asks for it."""


def add_parser(commands: Commands) -> None:
    """Add the command to the grammar."""
    example = "cbrrt plan paper_case1 --seed 1 --trajectory case1.csv --figure case1.png"
    parser = add_command(commands, "plan", run, "plan a trajectory through a scenario or a map", example)
    add_scenario(parser, or_map=True)
    add_planner(parser, None, f"cb-rrt; in a map {MAP_PLANNERS[0]}")
    add_seed(parser)
    add_time_limit(parser, "planning time")
    text = "then improve the trajectory by optimal control (cb-rrt-ao: sampling), for this long at most [s]"
    parser.add_argument("--improve-for", type=seconds, metavar="S", help=text)
    add_iterations(parser)
    add_output_files(parser, FILES)
    add_json(parser)
    add_problem(parser)


def run(arguments: argparse.Namespace) -> int:
    """``cbrrt plan``."""
    check_output_files(arguments, FILES)
    from cbrrt_ompl.planners.registry import planner_named
    from cbrrt_ompl.planning import NO_WAY, SAMPLE_LIMIT, TIME_LIMIT, plan
    from cbrrt_ompl.scenario.sources import is_map

    planner = arguments.planner or (map_planner() if is_map(arguments.scenario) else "cb-rrt")
    limits = {"improve_for": arguments.improve_for, "max_iterations": arguments.max_iterations}
    improves = not planner_named(planner).is_bounded and any(limit is not None for limit in limits.values())
    with keeping_inputs(arguments, FILES):
        scenario = given_scenario(arguments, lambda: warm_up(planner, improves))
    with plan_progress(planner_named(planner).settings(scenario.planning).max_samples, planner) as progress:
        result = plan(scenario, planner, arguments.seed, arguments.time_limit, progress=progress, **limits)
    if result.status == SAMPLE_LIMIT and _is_hopeless(scenario):
        result = replace(result, status=NO_WAY)
    trajectory = result.trajectory
    if arguments.trajectory is not None and trajectory is not None:
        trajectory.save(arguments.trajectory, scenario)
    if arguments.figure is not None:
        from cbrrt_ompl.figures import draw_plan
        from cbrrt_ompl.figures.saving import save_figure

        save_figure(draw_plan(result, scenario), arguments.figure)
    if arguments.animation is not None and trajectory is not None:
        from cbrrt_ompl.figures.animation import animate, save_animation

        save_animation(animate(trajectory, scenario, result.tree), arguments.animation)
    data = {"scenario": scenario.name, **_data(result)}
    files = {name: getattr(arguments, name) for name in FILES}
    unwritten = ("trajectory", "animation") if trajectory is None else ()
    if arguments.json:
        print_json({**data, **files, **dict.fromkeys(unwritten)})
    else:
        print_values(_values(data))
        for name in unwritten:
            if files[name] is not None:
                print(f"no trajectory, {files[name]} not written")
        if result.nodes == 1 and result.status in (TIME_LIMIT, SAMPLE_LIMIT):
            horizon = scenario.planning.horizon
            print(f"no extension from the start was free: try a planning.horizon of less than {horizon:g} s")
    return DONE if result.solved else FAILED


def _is_hopeless(scenario: Scenario) -> bool:
    """Whether samples that ran out before a plan began to doubt were in vain."""
    from cbrrt_ompl.scenario.connectivity import has_no_way

    return has_no_way(scenario.world, scenario.robot.footprint, scenario.start, scenario.goal)


def _data(result: PlanResult) -> dict[str, Any]:
    """The result of a plan, for programs, in SI units."""
    names = ("planner", "seed", "solved", "status", "nodes", "samples", "planning_time")
    trajectory = result.trajectory
    return {
        **{name: getattr(result, name) for name in names},
        "duration": None if trajectory is None else trajectory.duration,
        "length": None if trajectory is None else trajectory.length,
        "point_turns": None if trajectory is None else len(trajectory.point_turns),
        "history": [row._asdict() for row in result.history],
    }


def _values(data: dict[str, Any]) -> dict[str, str]:
    """The result of a plan, for people."""
    values = {
        **heading(data, data["solved"]),
        "nodes": f"{data['nodes']:,}",
        "samples": f"{data['samples']:,}",
        "planning time": f"{1e3 * data['planning_time']:.2f} ms",
    }
    if data["solved"]:
        values |= {
            "duration": f"{data['duration']:.2f} s",
            "length": f"{data['length']:.2f} m",
            "point turns": f"{data['point_turns']}",
        }
    if len(data["history"]) > 1:
        first = data["history"][0]
        values["first"] = f"{first['duration']:.2f} s after {1e3 * first['time']:.2f} ms"
        values["last"] = f"after {1e3 * data['history'][-1]['time']:.2f} ms, {data['history'][-1]['source']}"
    return values
