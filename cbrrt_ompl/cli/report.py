"""``cbrrt report``: tables and charts of a benchmark."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from cbrrt_ompl.cli.arguments import Commands, add_command, add_json
from cbrrt_ompl.cli.exit_codes import DONE
from cbrrt_ompl.cli.output import print_json, table_line
from cbrrt_ompl.cli.output_files import add_output_folder, check_backend

if TYPE_CHECKING:
    from cbrrt_ompl.benchmark.report import Report

COLUMNS = {"planner": 15, "succeeded": 12, "95 %": 10, "time [ms]": 9, "nodes": 9, "duration [s]": 12}
"""Columns on a terminal, with their widths; the report itself has quartiles and ratios too."""


def add_parser(commands: Commands) -> None:
    """Add the command to the grammar."""
    summary = "make tables and charts from a benchmark database or log"
    parser = add_command(commands, "report", run, summary, "cbrrt report bench.db --output report")
    parser.add_argument(
        "database", type=Path, metavar="DB", help="database of 'cbrrt bench', or a log of OMPL's Benchmark"
    )
    add_output_folder(parser, "report", "tables and charts")
    parser.add_argument(
        "--reference", metavar="NAME", help="planner to compare the others with (default: cb-rrt, if it is there)"
    )
    add_json(parser)


def run(arguments: argparse.Namespace) -> int:
    """``cbrrt report``."""
    check_backend()
    from cbrrt_ompl.benchmark.report import write_report

    report = write_report(arguments.database, arguments.output, arguments.reference)
    if arguments.json:
        print_json({"report": report.path, "page": report.page, "invalid": report.invalid, "summary": report.summary})
        return DONE
    _print_medians(report)
    for line in report.invalid:
        print(f"failed verification: {line}")
    print(report.page)
    print(report.path)
    return DONE


def _print_medians(report: Report) -> None:
    """Print the medians of a report, a table a scenario."""
    scenario = None
    for row in report.summary:
        if row["scenario"] != scenario:
            print(f"{'' if scenario is None else chr(10)}{row['scenario']}, medians")
            print(table_line(COLUMNS, COLUMNS.values(), left=1))
            scenario = row["scenario"]
        time, nodes, duration = (float(row[f"{name}_median"]) for name in ("time", "nodes", "duration"))
        cells = (
            row["planner"],
            f"{row['successes']} of {row['runs']}",
            f"{100.0 * row['success_low']:.0f}-{100.0 * row['success_high']:.0f} %",
            f"{1e3 * time:,.1f}",
            f"{nodes:,.0f}",
            f"{duration:.1f}",
        )
        print(table_line(cells, COLUMNS.values(), left=1))
