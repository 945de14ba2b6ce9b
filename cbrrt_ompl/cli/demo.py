"""``cbrrt demo``: both planners of the paper on its two scenes, and the short report."""

from __future__ import annotations

import argparse
import textwrap
from typing import TYPE_CHECKING

from cbrrt_ompl.cli.arguments import Commands, add_command, seed
from cbrrt_ompl.cli.exit_codes import DONE, FAILED
from cbrrt_ompl.cli.output import LINE_WIDTH, print_missing, table_line
from cbrrt_ompl.cli.output_files import add_output_folder, check_backend
from cbrrt_ompl.cli.progress import plan_progress, run_progress
from cbrrt_ompl.errors import OmplMissingError

if TYPE_CHECKING:
    from cbrrt_ompl.reproduce.demo import DemoRun

COLUMNS = {"scene": 11, "planner": 15, "result": 7, "nodes": 6, "paper": 7, "ms": 6, "paper ms": 8, "s": 4}
"""Columns on a terminal, with their widths; results.md has all of them."""


def add_parser(commands: Commands) -> None:
    """Add the command to the grammar."""
    summary = "run both planners of the paper on its two scenes, and make the short report"
    parser = add_command(commands, "demo", run, summary, "cbrrt demo --output demo")
    add_output_folder(parser, "demo", "figures, trajectories, table and report")
    parser.add_argument("--seed", type=seed, default=1, metavar="N", help="seed of every plan (default: 1)")


def run(arguments: argparse.Namespace) -> int:
    """``cbrrt demo``."""
    check_backend()
    arguments.output.mkdir(parents=True, exist_ok=True)
    from cbrrt_ompl.ompl_plugin.availability import has_ompl
    from cbrrt_ompl.reproduce.demo import REPRODUCTION_RUNS, caveat, run_demo
    from cbrrt_ompl.reproduce.reproduction import reproduce
    from cbrrt_ompl.reproduce.study import study_size

    runs = []
    print(table_line(COLUMNS, COLUMNS.values(), left=3), flush=True)
    for done in run_demo(arguments.output, arguments.seed, plan_progress):
        runs.append(done)
        print(table_line(_cells(done), COLUMNS.values(), left=3), flush=True)
    print(f"\n{textwrap.fill(caveat(arguments.seed), LINE_WIDTH - 1)}")
    print(f"scenarios, trajectories, figures and results.md: {arguments.output}", flush=True)
    as_published = all(done.as_published for done in runs)
    if not has_ompl():
        print(textwrap.fill(f"left out: {OmplMissingError('the other half, with the short report,')}", LINE_WIDTH - 1))
        return DONE if as_published else FAILED
    with run_progress(study_size(REPRODUCTION_RUNS, brief=True)) as progress:
        made = reproduce(arguments.output, REPRODUCTION_RUNS, brief=True, command="cbrrt demo", progress=progress)
    print(f"the paper measured again, in short, {made.runs:,} runs: {made.page}")
    print_missing(made.failures)
    return DONE if as_published and not made.failures else FAILED


def _cells(done: DemoRun) -> tuple[str, ...]:
    """A run in the columns of the terminal: what it was, what came of it, and the paper's numbers."""
    result, paper, duration = done.result, done.published, "-"
    outcome = "failed"
    if result.trajectory is not None:
        outcome, duration = "valid" if done.verified else "INVALID", f"{result.trajectory.duration:.1f}"
    nodes = "failure" if paper.nodes is None else f"{paper.nodes:,}"
    milliseconds = "failure" if paper.milliseconds is None else f"{paper.milliseconds:g}"
    time = f"{1e3 * result.planning_time:,.1f}"
    return (done.scene, result.planner, outcome, f"{result.nodes:,}", nodes, time, milliseconds, duration)
