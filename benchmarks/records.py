"""Records: ours beside what others published, from one database, with what is the same and what is not.

    python benchmarks/records.py run --output records --data FOLDER
    python benchmarks/records.py page records/records.db --output docs/records.md

`run` takes a folder with the subfolders dynobench, ros and barn (see record_campaigns.py) and skips by name what is
not there. Each campaign leaves a log for each of its problems, in the format of OMPL's Benchmark; a campaign that
has left some is not run again. The database is made from all logs.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from record_campaigns import CAMPAIGNS, Runs
from record_page import page

from cbrrt_ompl.benchmark.database import write_database
from cbrrt_ompl.benchmark.log import Log, PlannerLog, format_log, merge_logs, read_log
from cbrrt_ompl.errors import CbrrtError
from cbrrt_ompl.files import write_file
from cbrrt_ompl.reproduce.machine import processor, versions

COLUMNS = (
    "seed INTEGER",
    "solved BOOLEAN",
    "verified BOOLEAN",
    "time REAL",
    "cost REAL",
)
"""What is kept of a run."""


def as_log(runs: Runs, began: float) -> Log:
    """The runs of one planner in one problem as an experiment of OMPL's Benchmark.

    Args:
        runs: what was run.
        began: when, in seconds since the epoch.
    """
    rows = tuple(
        (str(one.seed), str(int(one.solved)), str(int(one.verified)), repr(one.time), repr(one.cost))
        for one in runs.runs
    )
    return Log(
        name=runs.problem,
        date=time.strftime("%Y-%m-%d", time.gmtime(began)),
        setup=f"{versions()}\n",
        cpu=f"{processor()}\n",
        time_limit=repr(runs.time_limit),
        run_count=str(len(rows)),
        total_time=f"{time.time() - began:.3f}",
        planners=(PlannerLog(runs.planner, (f"time_limit = {runs.time_limit!r}",), COLUMNS, rows),),
    )


def run(data: Path, output: Path, names: Sequence[str]) -> None:
    """Run what has not been run, and make the database of all.

    Args:
        data: folder of the maps.
        output: folder of the logs and of ``records.db``.
        names: campaigns to run.
    """
    output.mkdir(parents=True, exist_ok=True)
    for name in names:
        if any(output.glob(f"{name}-*.log")):
            print(f"{name}: there already", flush=True)
            continue
        logs: dict[str, list[Log]] = {}
        began = time.time()
        try:
            for runs in CAMPAIGNS[name](data):
                logs.setdefault(runs.problem, []).append(as_log(runs, began))
                good = sum(one.verified for one in runs.runs)
                print(f"{name}: {runs.problem}, {runs.planner}: {good} of {len(runs.runs)}", flush=True)
        except FileNotFoundError as missing:
            print(f"{name}: skipped, {missing} is not there", flush=True)
            continue
        for problem, parts in logs.items():
            merged = merge_logs(parts, problem, 0, max(int(part.run_count) for part in parts))
            write_file(output / f"{name}-{problem}.log", format_log(merged))
    write_database(output / "records.db", [read_log(path) for path in sorted(output.glob("*-*.log"))])


def main() -> None:
    """Run the campaigns, or write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    runner = commands.add_parser("run", help="run the campaigns and make the database")
    runner.add_argument("--data", type=Path, required=True, help="folder with the subfolders dynobench, ros, barn")
    runner.add_argument("--output", type=Path, required=True, help="folder of the logs and of records.db")
    runner.add_argument("--only", nargs="+", choices=CAMPAIGNS, default=list(CAMPAIGNS), help="campaigns to run")
    writer = commands.add_parser("page", help="write the page from a database alone")
    writer.add_argument("database", type=Path)
    writer.add_argument("--output", type=Path, required=True, help="the page (Markdown)")
    arguments = parser.parse_args()
    try:
        if arguments.command == "run":
            run(arguments.data, arguments.output, arguments.only)
        else:
            write_file(arguments.output, page(arguments.database))
    except CbrrtError as error:
        sys.exit(f"records.py: error: {error}")


if __name__ == "__main__":
    main()
