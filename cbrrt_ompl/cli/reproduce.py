"""``cbrrt reproduce``: the paper measured again."""

from __future__ import annotations

import argparse

from cbrrt_ompl.cli.arguments import Commands, add_command, add_jobs, count
from cbrrt_ompl.cli.exit_codes import DONE, FAILED
from cbrrt_ompl.cli.output import kept_runs, print_missing
from cbrrt_ompl.cli.output_files import add_output_folder, check_backend
from cbrrt_ompl.cli.progress import run_progress


def add_parser(commands: Commands) -> None:
    """Add the command to the grammar."""
    summary = "measure the paper again and report which of its claims hold"
    parser = add_command(commands, "reproduce", run, summary, "cbrrt reproduce --runs 20 --output reproduction")
    parser.add_argument(
        "--runs", type=count, default=200, metavar="N", help="runs of each planner in each scene (default: 200)"
    )
    content = "report.html, report.md and the runs; the same command goes on from what it holds"
    add_output_folder(parser, "reproduction", content)
    add_jobs(parser)


def run(arguments: argparse.Namespace) -> int:
    """``cbrrt reproduce``."""
    check_backend()
    from cbrrt_ompl.reproduce.reproduction import reproduce
    from cbrrt_ompl.reproduce.study import study_size

    command = f"cbrrt reproduce --runs {arguments.runs} --output {arguments.output}"
    command += f" --jobs {arguments.jobs}" if arguments.jobs else ""
    with run_progress(study_size(arguments.runs)) as progress:
        made = reproduce(arguments.output, arguments.runs, arguments.jobs, command=command, progress=progress)
    print(f"{made.runs:,} runs{kept_runs(made.kept)}")
    for claim in made.claims:
        print(f"{claim.verdict.value}: {claim.text}")
    print_missing(made.failures)
    print(made.page)
    return FAILED if made.failures else DONE
