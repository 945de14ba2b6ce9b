"""``cbrrt bench``: planners run in scenarios many times."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

from cbrrt_ompl.cli.arguments import (
    Commands,
    add_command,
    add_jobs,
    add_json,
    add_scenario,
    add_time_limit,
    count,
    seed,
)
from cbrrt_ompl.cli.exit_codes import DONE, FAILED
from cbrrt_ompl.cli.output import kept_runs, print_json, print_values
from cbrrt_ompl.cli.output_files import add_output_files, check_output_files
from cbrrt_ompl.cli.progress import run_progress


def add_parser(commands: Commands) -> None:
    """Add the command to the grammar."""
    example = (
        "cbrrt bench paper_case1 maze --planner cb-rrt s-rrt rrt --runs 20 \\\n"
        "      --time-limit 2 --database bench.db --log-dir logs"
    )
    summary = "run planners in scenarios many times, in OMPL's Benchmark"
    parser = add_command(commands, "bench", run, summary, example)
    add_scenario(parser, "scenarios", nargs="+")
    parser.add_argument(
        "--planner", nargs="+", action="extend", metavar="NAME", help="see 'cbrrt planners' (default: all of them)"
    )
    parser.add_argument(
        "--runs", type=count, default=20, metavar="N", help="runs of each planner in each scenario (default: 20)"
    )
    add_time_limit(parser, "time of a run")
    add_output_files(parser, {"database": "database to make"}, required=True)
    parser.add_argument(
        "--log-dir", type=Path, required=True, metavar="DIR",
        help="folder for OMPL's logs; the same command goes on from what it holds",
    )  # fmt: skip
    parser.add_argument("--seed", type=seed, default=1, metavar="N", help="seed of the whole series (default: 1)")
    add_jobs(parser)
    parser.add_argument(
        "--scheduler", metavar="ADDRESS",
        help="run on the workers of this dask.distributed scheduler; 'local' makes a cluster of J workers",
    )  # fmt: skip
    add_json(parser)


def run(arguments: argparse.Namespace) -> int:
    """``cbrrt bench``."""
    check_output_files(arguments, ["database"])
    from cbrrt_ompl.benchmark.campaign import Campaign, load_scenarios, run_campaign
    from cbrrt_ompl.benchmark.cluster import run_on_cluster
    from cbrrt_ompl.benchmark.local import run_locally
    from cbrrt_ompl.planners.registry import PLANNERS
    from cbrrt_ompl.processes import available_cores

    planners = list(dict.fromkeys(arguments.planner or PLANNERS))
    scenarios = load_scenarios(arguments.scenarios)
    campaign = Campaign(scenarios, planners, arguments.runs, arguments.time_limit, arguments.seed)
    jobs = arguments.jobs or available_cores()
    runner = partial(run_locally, jobs=jobs)
    if arguments.scheduler is not None:
        runner = partial(run_on_cluster, address=arguments.scheduler, jobs=jobs)
    database, log_dir = arguments.database, arguments.log_dir
    with run_progress(campaign.size) as progress:
        summary = run_campaign(campaign, database, log_dir, runner, progress)
    if arguments.json:
        print_json({**summary._asdict(), "database": database, "log_dir": log_dir})
    else:
        of, within = _counted(len(planners), "planner"), _counted(len(scenarios), "scenario")
        print(f"{summary.runs:,} runs of {of} in {within}{kept_runs(summary.kept)}")
        for name, reason in summary.crashes.items():
            print(f"{name}: {reason}, see {log_dir / 'cases' / f'{name}.error'}")
        print_values({"database": f"{database}", "logs": f"{log_dir}", "report": f"cbrrt report {database}"})
    return FAILED if summary.crashes else DONE


def _counted(number: int, name: str) -> str:
    """A number of things."""
    return f"{number} {name}{'s' if number > 1 else ''}"
