"""The command line: ``cbrrt plan | drive | verify | show | planners | bench | report | reproduce | demo | completion``.

Exit codes: 0 done, 1 not solved or not verified, 2 bad input, 130 interrupted. Modules that take long to import are
imported where they are used, so that ``cbrrt --help`` answers at once.
"""

from __future__ import annotations

import argparse
import io
import json
import math
import os
import sys
import textwrap
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TextIO

from cbrrt_ompl.errors import CbrrtError, InputError, Problem
from cbrrt_ompl.files import save_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from cbrrt_ompl.benchmark.report import Report
    from cbrrt_ompl.demo import DemoRun
    from cbrrt_ompl.drive import DriveResult
    from cbrrt_ompl.planning import PlanResult
    from cbrrt_ompl.trajectory import Trajectory

DONE, FAILED, BAD_INPUT, INTERRUPTED, BROKEN_PIPE = 0, 1, 2, 130, 141
TRAJECTORY_SUFFIXES = (".csv", ".npz", ".json")
FIGURE_SUFFIXES = (".png", ".pdf", ".svg")
ANIMATION_SUFFIXES = (".gif", ".html", ".mp4")
DATABASE_SUFFIXES = (".db", ".sqlite", ".sqlite3")
SHELLS = ("bash", "zsh", "tcsh")
LINE_WIDTH = 80
SCENARIO_HELP = "scenario file (YAML), or the name of one that comes along, as paper_case1"
GREEN, RED = "32", "31"

EXAMPLES = """\
examples:
  cbrrt plan paper_case1 --seed 1 --figure case1.png   a scene of the paper
  cbrrt plan depot.yaml --planner cb-rrt-robust --trajectory depot.csv
  cbrrt drive office --seed 2 --animation office.gif   plan again on the way
  cbrrt verify depot.csv depot.yaml                    check it by other code
  cbrrt bench maze office --runs 20 --database bench.db --log-dir logs
  cbrrt report bench.db --output report                tables and charts

'cbrrt COMMAND --help' explains a command."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command line.

    Args:
        argv: the arguments after the program's name; None takes those of the process.

    Returns:
        The exit code.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a name may hold what the terminal has no letters for
    try:
        arguments = build_parser().parse_args(argv)
        code: int = arguments.run(arguments)
        sys.stdout.flush()
    except KeyboardInterrupt:
        print("cbrrt: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE
    except (CbrrtError, OSError) as error:
        _print_error(error)
        return BAD_INPUT
    return code


def build_parser() -> argparse.ArgumentParser:
    """The grammar of the command line."""
    parser = _Parser(
        prog="cbrrt",
        description="Plan trajectories for two-wheeled robots with CB-RRT and S-RRT in OMPL.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action=_Version, help="print the version and exit")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    _add_plan(commands)
    _add_drive(commands)
    _add_verify(commands)
    _add_show(commands)
    _add_planners(commands)
    _add_bench(commands)
    _add_report(commands)
    _add_reproduce(commands)
    _add_demo(commands)
    _add_completion(commands)
    return parser


def _add_plan(commands: Any) -> None:
    example = "cbrrt plan paper_case1 --seed 1 --trajectory case1.csv --figure case1.png"
    parser = _add_command(commands, "plan", _plan, "plan a trajectory through a scenario", example)
    parser.add_argument("scenario", type=Path, metavar="SCENARIO", help=SCENARIO_HELP)
    parser.add_argument("--planner", default="cb-rrt", metavar="NAME", help="see 'cbrrt planners' (default: cb-rrt)")
    parser.add_argument("--seed", type=_seed, metavar="N", help="seed of the random numbers (default: a new one)")
    parser.add_argument(
        "--time-limit", type=_seconds, default=5.0, metavar="S", help="planning time at most [s] (default: 5)"
    )
    parser.add_argument("--trajectory", type=Path, metavar="FILE", help="write the trajectory: .csv, .npz or .json")
    parser.add_argument("--figure", type=Path, metavar="FILE", help="draw scene, tree and path: .png, .pdf or .svg")
    parser.add_argument("--animation", type=Path, metavar="FILE", help="show the robot drive: .gif, .html or .mp4")
    _add_json(parser)


def _add_drive(commands: Any) -> None:
    example = "cbrrt drive office --sensor-range 2.5 --seed 2 --animation office.gif"
    summary = "drive through a world known within a sensor's range only, planning on the way"
    parser = _add_command(commands, "drive", _drive, summary, example)
    parser.add_argument("scenario", type=Path, metavar="SCENARIO", help=SCENARIO_HELP)
    hidden = parser.add_mutually_exclusive_group()
    hidden.add_argument(
        "--unknown", type=_count, metavar="N",
        help="know the scenario, but not N random obstacles (default: none of the scenario's obstacles is known)",
    )  # fmt: skip
    hidden.add_argument(
        "--hidden", type=Path, metavar="FILE", help="know the scenario, but not the obstacles of this file (YAML)"
    )
    parser.add_argument(
        "--sensor-range", type=_metres, default=3.0, metavar="R", help="how far the robot sees [m] (default: 3)"
    )
    parser.add_argument(
        "--cycle",
        type=_seconds,
        default=0.1,
        metavar="S",
        help="time between two looks, and of a plan [s] (default: 0.1)",
    )
    parser.add_argument(
        "--planner", default="cb-rrt-robust", metavar="NAME", help="see 'cbrrt planners' (default: cb-rrt-robust)"
    )
    parser.add_argument("--seed", type=_seed, metavar="N", help="seed of the random numbers (default: a new one)")
    parser.add_argument(
        "--max-samples", type=_count, metavar="N",
        help="samples of a plan at most, instead of the cycle's time: the same drive on every machine",
    )  # fmt: skip
    parser.add_argument("--trajectory", type=Path, metavar="FILE", help="write the way driven: .csv, .npz or .json")
    parser.add_argument("--figure", type=Path, metavar="FILE", help="draw the drive: .png, .pdf or .svg")
    parser.add_argument("--animation", type=Path, metavar="FILE", help="show the drive: .gif, .html or .mp4")
    _add_json(parser)


def _add_verify(commands: Any) -> None:
    example = "cbrrt verify case1.csv paper_case1"
    parser = _add_command(commands, "verify", _verify, "check a trajectory against a scenario", example)
    parser.add_argument("trajectory", type=Path, metavar="TRAJECTORY", help="trajectory file: .csv, .npz or .json")
    parser.add_argument("scenario", type=Path, metavar="SCENARIO", help=SCENARIO_HELP)
    parser.add_argument("--kinematic", action="store_true", help="let velocities jump, as those of s-rrt do")
    _add_json(parser)


def _add_show(commands: Any) -> None:
    example = "cbrrt show paper_case1 --trajectory case1.csv --figure case1.png"
    parser = _add_command(commands, "show", _show, "draw a scenario, and a trajectory in it", example)
    parser.add_argument("scenario", type=Path, metavar="SCENARIO", help=SCENARIO_HELP)
    parser.add_argument("--trajectory", type=Path, metavar="FILE", help="draw this trajectory too")
    parser.add_argument("--kinematic", action="store_true", help="let its velocities jump, as those of s-rrt do")
    parser.add_argument("--figure", type=Path, metavar="FILE", help="write .png, .pdf or .svg instead of a window")


def _add_planners(commands: Any) -> None:
    _add_json(_add_command(commands, "planners", _planners, "list the planners", "cbrrt planners"))


def _add_bench(commands: Any) -> None:
    example = (
        "cbrrt bench paper_case1 maze --planner cb-rrt s-rrt rrt --runs 20 \\\n"
        "      --time-limit 2 --database bench.db --log-dir logs"
    )
    summary = "run planners in scenarios many times, in OMPL's Benchmark"
    parser = _add_command(commands, "bench", _bench, summary, example)
    parser.add_argument("scenarios", type=Path, nargs="+", metavar="SCENARIO", help=SCENARIO_HELP)
    parser.add_argument(
        "--planner", nargs="+", action="extend", metavar="NAME", help="see 'cbrrt planners' (default: all of them)"
    )
    parser.add_argument(
        "--runs", type=_count, default=20, metavar="N", help="runs of each planner in each scenario (default: 20)"
    )
    parser.add_argument(
        "--time-limit", type=_seconds, default=5.0, metavar="S", help="time of a run at most [s] (default: 5)"
    )
    parser.add_argument("--database", type=Path, required=True, metavar="FILE", help="database to make: .db")
    parser.add_argument(
        "--log-dir", type=Path, required=True, metavar="DIR",
        help="folder for OMPL's logs; the same command goes on from what it holds",
    )  # fmt: skip
    parser.add_argument("--seed", type=_seed, default=1, metavar="N", help="seed of the whole series (default: 1)")
    parser.add_argument("--jobs", type=_count, metavar="J", help="processes at a time (default: one a processor)")
    parser.add_argument(
        "--scheduler", metavar="ADDRESS",
        help="run on the workers of this dask.distributed scheduler; 'local' makes a cluster of J workers",
    )  # fmt: skip
    _add_json(parser)


def _add_report(commands: Any) -> None:
    summary = "make tables and charts from a benchmark database"
    parser = _add_command(commands, "report", _report, summary, "cbrrt report bench.db --output report")
    parser.add_argument("database", type=Path, metavar="DB", help="database of 'cbrrt bench'")
    parser.add_argument(
        "--output", type=Path, default=Path("report"), metavar="DIR", help="folder for tables and charts"
    )
    parser.add_argument(
        "--reference", metavar="NAME", help="planner to compare the others with (default: cb-rrt, if it is there)"
    )
    _add_json(parser)


def _add_reproduce(commands: Any) -> None:
    summary = "measure the paper again and report which of its claims hold"
    parser = _add_command(commands, "reproduce", _reproduce, summary, "cbrrt reproduce --runs 20 --output reproduction")
    parser.add_argument(
        "--runs", type=_count, default=200, metavar="N", help="runs of each planner in each scene (default: 200)"
    )
    parser.add_argument(
        "--output", type=Path, default=Path("reproduction"), metavar="DIR",
        help="folder for report.html, report.md and the runs; the same command goes on from what it holds",
    )  # fmt: skip
    parser.add_argument("--jobs", type=_count, metavar="J", help="processes at a time (default: one a processor)")


def _add_demo(commands: Any) -> None:
    summary = "run both planners of the paper on its two scenes, and make the short report"
    parser = _add_command(commands, "demo", _demo, summary, "cbrrt demo --output demo")
    parser.add_argument(
        "--output", type=Path, default=Path("demo"), metavar="DIR", help="folder for figures, trajectories and table"
    )
    parser.add_argument("--seed", type=_seed, default=1, metavar="N", help="seed of every plan (default: 1)")


def _add_completion(commands: Any) -> None:
    summary = "print the script that makes a shell complete cbrrt's arguments"
    parser = _add_command(commands, "completion", _completion, summary, "cbrrt completion bash")
    parser.add_argument("shell", choices=SHELLS, metavar="SHELL", help=", ".join(SHELLS))


def _add_json(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="print the result as JSON, in SI units")


def _plan(arguments: argparse.Namespace) -> int:
    """``cbrrt plan``."""
    _check_plan_outputs(arguments)
    from cbrrt_ompl.planning import plan
    from cbrrt_ompl.scenario import load_scenario

    scenario = load_scenario(arguments.scenario)
    _warm_up(arguments.planner)
    with _progress(scenario.planning.max_samples, arguments.planner) as progress:
        result = plan(scenario, arguments.planner, arguments.seed, arguments.time_limit, progress=progress)
    written = None
    if arguments.trajectory is not None and result.trajectory is not None:
        written = arguments.trajectory
        result.trajectory.save(written)
    if arguments.figure is not None:
        from cbrrt_ompl.figures import draw_plan

        save_figure(draw_plan(result, scenario), arguments.figure)
    if arguments.animation is not None and result.trajectory is not None:
        from cbrrt_ompl.animation import animate, save_animation

        save_animation(animate(result.trajectory, scenario, result.tree), arguments.animation)
    if arguments.json:
        _print_json(_json_result(scenario.name, result, written, arguments.figure))
    else:
        _print_summary(scenario.name, result)
        if arguments.trajectory is not None and written is None:
            print(f"no trajectory, {arguments.trajectory} not written")
    return DONE if result.solved else FAILED


def _drive(arguments: argparse.Namespace) -> int:
    """``cbrrt drive``."""
    _check_plan_outputs(arguments)
    from cbrrt_ompl.drive import DriveSettings, drive
    from cbrrt_ompl.drive.unknown import load_obstacles, unknown_obstacles
    from cbrrt_ompl.scenario import load_scenario

    scenario = load_scenario(arguments.scenario)
    settings = DriveSettings(
        sensor_range=arguments.sensor_range,
        cycle=arguments.cycle,
        planner=arguments.planner,
        max_samples=arguments.max_samples,
    )
    hidden = None
    if arguments.unknown is not None:
        hidden = unknown_obstacles(scenario, arguments.unknown, arguments.seed, settings.margin)
    elif arguments.hidden is not None:
        hidden = load_obstacles(arguments.hidden)
    _warm_up(arguments.planner)
    result = drive(scenario, hidden, settings, arguments.seed)
    if arguments.trajectory is not None:
        result.trajectory.save(arguments.trajectory)
    if arguments.figure is not None:
        from cbrrt_ompl.figures import draw_drive

        save_figure(draw_drive(result), arguments.figure)
    if arguments.animation is not None:
        from cbrrt_ompl.animation import animate_drive, save_animation

        save_animation(animate_drive(result), arguments.animation)
    figures = _drive_figures(result)
    if arguments.json:
        _print_json({"scenario": scenario.name, "seed": arguments.seed, **figures})
    else:
        _print_drive(scenario.name, figures)
    return DONE if result.reached else FAILED


def _warm_up(planner: str) -> None:
    """Load the kernels, and say so where they must be compiled first."""
    from cbrrt_ompl.extension import COMPILED_PLANNERS
    from cbrrt_ompl.warm_up import warm_up

    message = "cbrrt: compiling the planners, once after installation ..."
    timer = threading.Timer(1.0, print, [message], {"file": sys.stderr, "flush": True})
    timer.daemon = True
    timer.start()
    try:
        warm_up(needs_ompl=planner not in COMPILED_PLANNERS)
    finally:
        timer.cancel()


def _verify(arguments: argparse.Namespace) -> int:
    """``cbrrt verify``."""
    from cbrrt_ompl.scenario import load_scenario
    from cbrrt_ompl.verification import verify

    trajectory = _load_trajectory(arguments)
    verification = verify(trajectory, load_scenario(arguments.scenario))
    if arguments.json:
        _print_json({"ok": verification.ok, **asdict(verification)})
    else:
        verdict, *details = verification.summary().splitlines()
        print("\n".join([_colored(verdict, GREEN if verification.ok else RED), *details]))
    return DONE if verification.ok else FAILED


def _show(arguments: argparse.Namespace) -> int:
    """``cbrrt show``."""
    _check_outputs(("--figure", arguments.figure, FIGURE_SUFFIXES))
    _check_backend()
    from matplotlib.figure import Figure

    from cbrrt_ompl.figures import draw_scene, draw_trajectory
    from cbrrt_ompl.scenario import load_scenario

    scenario = load_scenario(arguments.scenario)
    trajectory = None if arguments.trajectory is None else _load_trajectory(arguments)
    size: dict[str, Any] = {"figsize": (6.4, 6.4), "layout": "constrained", "dpi": 150}
    figure = Figure(**size) if arguments.figure is not None else _window(**size)
    ax = draw_scene(figure.subplots(), scenario)
    if trajectory is not None:
        draw_trajectory(ax, trajectory, scenario.robot.footprint)
    ax.set_title(scenario.name, parse_math=False)
    if arguments.figure is not None:
        save_figure(figure, arguments.figure)
    else:
        from matplotlib import pyplot

        pyplot.show()
    return DONE


def _load_trajectory(arguments: argparse.Namespace) -> Trajectory:
    """The trajectory file of a command line, kinematic where the file or the user says so."""
    from cbrrt_ompl.trajectory import Trajectory

    trajectory = Trajectory.load(arguments.trajectory)
    return replace(trajectory, kinematic=True) if arguments.kinematic else trajectory


def _check_backend() -> None:
    """Import matplotlib, which refuses a wrong MPLBACKEND.

    Raises:
        CbrrtError: if it does.
    """
    try:
        import matplotlib  # noqa: F401  # the import is the check
    except ValueError as error:
        raise CbrrtError(f"MPLBACKEND: {error}") from None


def _planners(arguments: argparse.Namespace) -> int:
    """``cbrrt planners``."""
    from cbrrt_ompl.planning import PLANNERS

    if arguments.json:
        _print_json(PLANNERS)
        return DONE
    width = max(map(len, PLANNERS))
    for name, description in PLANNERS.items():
        print(f"{name:{width}}  {description}")
    return DONE


def _bench(arguments: argparse.Namespace) -> int:
    """``cbrrt bench``."""
    _check_outputs(("--database", arguments.database, DATABASE_SUFFIXES))
    from cbrrt_ompl.benchmark.campaign import Campaign, load_scenarios, run_campaign
    from cbrrt_ompl.benchmark.cluster import run_on_cluster
    from cbrrt_ompl.benchmark.local import available_cores, run_locally
    from cbrrt_ompl.planning import PLANNERS

    planners = list(dict.fromkeys(arguments.planner or PLANNERS))
    scenarios = load_scenarios(arguments.scenarios)
    campaign = Campaign(scenarios, planners, arguments.runs, arguments.time_limit, arguments.seed)
    jobs = arguments.jobs or available_cores()
    runner = partial(run_locally, jobs=jobs)
    if arguments.scheduler is not None:
        runner = partial(run_on_cluster, address=arguments.scheduler, jobs=jobs)
    with _run_progress(campaign.size) as progress:
        summary = run_campaign(campaign, arguments.database, arguments.log_dir, runner, progress)
    if arguments.json:
        _print_json({**summary._asdict(), "database": str(arguments.database), "log_dir": str(arguments.log_dir)})
        return FAILED if summary.crashes else DONE
    kept = f", {summary.kept:,} of them kept from before" if summary.kept else ""
    counted = (("planner", planners), ("scenario", scenarios))
    of, within = (f"{len(things)} {name}{'s' if len(things) > 1 else ''}" for name, things in counted)
    print(f"{summary.runs:,} runs of {of} in {within}{kept}")
    for name, reason in summary.crashes.items():
        print(f"{name}: {reason}, see {arguments.log_dir / 'cases' / f'{name}.error'}")
    print(f"database  {arguments.database}\nlogs      {arguments.log_dir}\nreport    cbrrt report {arguments.database}")
    return FAILED if summary.crashes else DONE


def _report(arguments: argparse.Namespace) -> int:
    """``cbrrt report``."""
    _check_backend()
    from cbrrt_ompl.benchmark.report import write_report

    report = write_report(arguments.database, arguments.output, arguments.reference)
    if arguments.json:
        _print_json({"report": str(report.path), "invalid": report.invalid, "summary": report.summary})
        return DONE
    _print_report(report)
    for line in report.invalid:
        print(f"failed verification: {line}")
    print(report.path)
    return DONE


def _reproduce(arguments: argparse.Namespace) -> int:
    """``cbrrt reproduce``."""
    _check_backend()
    from cbrrt_ompl.reproduce.reproduction import reproduce
    from cbrrt_ompl.reproduce.study import study_size

    command = f"cbrrt reproduce --runs {arguments.runs} --output {arguments.output}"
    command += f" --jobs {arguments.jobs}" if arguments.jobs else ""
    with _run_progress(study_size(arguments.runs)) as progress:
        made = reproduce(arguments.output, arguments.runs, arguments.jobs, command=command, progress=progress)
    print(f"{made.runs:,} runs{f', {made.kept:,} of them kept from before' if made.kept else ''}")
    for claim in made.claims:
        print(f"{claim.verdict.value}: {claim.text}")
    for name, reason in made.failures.items():
        print(f"runs of {name} are missing: {reason}")
    print(made.page)
    return FAILED if made.failures else DONE


def _demo(arguments: argparse.Namespace) -> int:
    """``cbrrt demo``."""
    _check_backend()
    arguments.output.mkdir(parents=True, exist_ok=True)
    from cbrrt_ompl.demo import REPRODUCTION_RUNS, caveat, run_demo
    from cbrrt_ompl.reproduce.reproduction import reproduce
    from cbrrt_ompl.reproduce.study import study_size

    runs = []
    print(_aligned(tuple(DEMO_COLUMNS), DEMO_COLUMNS.values()), flush=True)
    for run in run_demo(arguments.output, arguments.seed, _progress):
        runs.append(run)
        print(_aligned(_demo_cells(run), DEMO_COLUMNS.values()), flush=True)
    print(f"\n{textwrap.fill(caveat(arguments.seed), LINE_WIDTH - 1)}")
    print(f"scenarios, trajectories, figures and results.md: {arguments.output}", flush=True)
    with _run_progress(study_size(REPRODUCTION_RUNS, brief=True)) as progress:
        made = reproduce(arguments.output, REPRODUCTION_RUNS, brief=True, command="cbrrt demo", progress=progress)
    print(f"the paper measured again, in short, {made.runs:,} runs: {made.page}")
    for name, reason in made.failures.items():
        print(f"runs of {name} are missing: {reason}")
    return DONE if all(run.as_published for run in runs) and not made.failures else FAILED


DEMO_COLUMNS = {"scene": 11, "planner": 15, "result": 7, "nodes": 6, "paper": 7, "ms": 6, "paper ms": 8, "s": 4}
"""Columns of the demo's table on a terminal, with their widths; results.md has all of them."""


def _demo_cells(run: DemoRun) -> tuple[str, ...]:
    """A run in the columns of the terminal: what it was, what came of it, and the paper's numbers."""
    result, paper, duration = run.result, run.published, "-"
    outcome = "failed"
    if result.trajectory is not None:
        outcome, duration = "valid" if run.verified else "INVALID", f"{result.trajectory.duration:.1f}"
    nodes = "failure" if paper.nodes is None else f"{paper.nodes:,}"
    milliseconds = "failure" if paper.milliseconds is None else f"{paper.milliseconds:g}"
    time = f"{1e3 * result.planning_time:,.1f}"
    return (run.scene, result.planner, outcome, f"{result.nodes:,}", nodes, time, milliseconds, duration)


def _aligned(cells: Iterable[str], widths: Iterable[int], left: int = 3) -> str:
    """Cells in columns, the first ones to the left and the others to the right."""
    return "  ".join(
        cell.ljust(width) if column < left else cell.rjust(width)
        for column, (cell, width) in enumerate(zip(cells, widths, strict=True))
    )


REPORT_COLUMNS = {"planner": 15, "succeeded": 12, "95 %": 10, "time [ms]": 9, "nodes": 9, "duration [s]": 12}
"""Columns of a report on a terminal, with their widths; the report itself has quartiles and ratios too."""


def _print_report(report: Report) -> None:
    """Print the medians of a report, a table a scenario."""
    scenario = None
    for row in report.summary:
        if row["scenario"] != scenario:
            print(f"{'' if scenario is None else chr(10)}{row['scenario']}, medians")
            print(_aligned(REPORT_COLUMNS, REPORT_COLUMNS.values(), left=1))
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
        print(_aligned(cells, REPORT_COLUMNS.values(), left=1))


def _completion(arguments: argparse.Namespace) -> int:
    """``cbrrt completion``."""
    import shtab

    from cbrrt_ompl.planning import PLANNERS

    parser = build_parser()
    for action in _actions(parser):
        if action.type is Path:
            action.complete = shtab.DIRECTORY if action.metavar == "DIR" else shtab.FILE  # type: ignore[attr-defined]
        elif action.dest in ("planner", "reference"):
            action.choices = list(PLANNERS)
    print(shtab.complete(parser, arguments.shell))
    return DONE


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """All arguments of a parser and of its commands."""
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _actions(command)


def _window(**size: Any) -> Figure:
    """A figure in a window, yet to be shown.

    Raises:
        CbrrtError: if there is no display.
    """
    from matplotlib import pyplot
    from matplotlib.backends import BackendFilter, backend_registry

    try:
        figure = pyplot.figure(**size)
        has_window = pyplot.get_backend().lower() in backend_registry.list_builtin(BackendFilter.INTERACTIVE)
    except ImportError:
        has_window = False
    if not has_window:
        raise CbrrtError("no display to open a window on, write a file with --figure FILE")
    return figure


def _print_summary(scenario: str, result: PlanResult) -> None:
    """Print what came of a plan, a value a line."""
    status = _colored(result.status, GREEN if result.solved else RED)
    rows = [("scenario", scenario), ("planner", result.planner), ("status", status)]
    if result.seed is not None:
        rows.append(("seed", str(result.seed)))
    rows += [
        ("nodes", f"{result.nodes:,}"),
        ("samples", f"{result.samples:,}"),
        ("planning time", f"{1e3 * result.planning_time:.2f} ms"),
    ]
    if result.trajectory is not None:
        rows += [
            ("duration", f"{result.trajectory.duration:.2f} s"),
            ("length", f"{result.trajectory.length:.2f} m"),
            ("point turns", str(len(result.trajectory.point_turns))),
        ]
    width = max(len(name) for name, _ in rows)
    for name, value in rows:
        print(f"{name:{width}}  {value}")


def _drive_figures(result: DriveResult) -> dict[str, Any]:
    """What came of a drive, in SI units."""
    verification = result.verification
    return {
        "planner": result.settings.planner,
        "status": result.status,
        "reached": result.reached,
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


def _print_drive(scenario: str, figures: dict[str, Any]) -> None:
    """Print what came of a drive, a value a line."""
    violations = figures["violations"]
    rows = (
        ("scenario", scenario),
        ("planner", figures["planner"]),
        ("status", _colored(figures["status"], GREEN if figures["reached"] else RED)),
        ("duration", f"{figures['duration']:.2f} s"),
        ("length", f"{figures['length']:.2f} m"),
        ("plans", f"{figures['plans']}, {figures['plans_taken']} taken"),
        ("obstacles found", f"{figures['obstacles_found']} of {figures['obstacles_hidden']} hidden"),
        ("longest search", f"{1e3 * figures['longest_search']:.1f} ms, cycle {1e3 * figures['cycle']:g} ms"),
        ("longest computing", f"{1e3 * figures['longest_computing']:.1f} ms"),
        ("smallest clearance", f"{figures['smallest_clearance']:.3f} m"),
        ("verified", "valid" if not violations else "NOT VALID: " + "; ".join(violations)),
    )
    for name, value in rows:
        print(f"{name:18}  {value}")


def _json_result(
    scenario: str, result: PlanResult, trajectory_file: Path | None, figure_file: Path | None
) -> dict[str, Any]:
    """What came of a plan, in SI units, for machines."""
    names = ("planner", "seed", "solved", "status", "nodes", "samples", "planning_time")
    trajectory = result.trajectory
    return {
        "scenario": scenario,
        **{name: getattr(result, name) for name in names},
        "duration": None if trajectory is None else trajectory.duration,
        "length": None if trajectory is None else trajectory.length,
        "point_turns": None if trajectory is None else len(trajectory.point_turns),
        "trajectory": None if trajectory_file is None else str(trajectory_file),
        "figure": None if figure_file is None else str(figure_file),
    }


@contextmanager
def _progress(total: int, label: str) -> Iterator[Callable[[int, float], None] | None]:
    """A progress line for :func:`plan` once it has taken a second; None where nobody watches."""
    if not sys.stderr.isatty():
        yield None
        return
    from tqdm import tqdm

    with tqdm(total=total, desc=label, unit=" samples", delay=1.0, leave=False, file=sys.stderr) as bar:

        def report(samples: int, elapsed: float) -> None:
            bar.update(samples - bar.n)

        yield report


@contextmanager
def _run_progress(total: int) -> Iterator[Callable[[int], None]]:
    """A progress line for a campaign, with the time left; silent where nobody watches."""
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    from tqdm import tqdm

    with ExitStack() as stack:
        bars: list[Any] = []

        def report(done: int) -> None:
            if not bars:  # what former calls have done tells nothing of the time left
                bars.append(tqdm(total=total, initial=done, desc="runs", unit="", smoothing=0.0, file=sys.stderr))
                stack.enter_context(bars[0])
            bars[0].update(done - bars[0].n)

        yield report


def _check_outputs(*outputs: tuple[str, Path | None, tuple[str, ...]]) -> None:
    """Find out before any work whether its results can be written.

    Args:
        outputs: option, file (None for none) and the suffixes that it may have.

    Raises:
        InputError: with every file that cannot be written.
    """
    problems = []
    for option, path, suffixes in outputs:
        if path is None:
            continue
        if path.suffix.lower() not in suffixes:
            problems.append(Problem(option, str(path), f"a file name that ends in {', '.join(suffixes)}"))
        elif not path.parent.is_dir():
            problems.append(Problem(option, str(path), f"a file in a folder that exists, {path.parent} does not"))
        elif path.is_dir() or not os.access(path if path.exists() else path.parent, os.W_OK):
            problems.append(Problem(option, str(path), "a file that may be written"))
    if problems:
        raise InputError(problems)


def _check_plan_outputs(arguments: argparse.Namespace) -> None:
    """Find out before any work whether trajectory, figure and animation can be written.

    Raises:
        InputError: with every file that cannot be written, or for a kind of animation that needs a program.
    """
    _check_outputs(
        ("--trajectory", arguments.trajectory, TRAJECTORY_SUFFIXES),
        ("--figure", arguments.figure, FIGURE_SUFFIXES),
        ("--animation", arguments.animation, ANIMATION_SUFFIXES),
    )
    if arguments.figure is not None or arguments.animation is not None:
        _check_backend()
    if arguments.animation is not None:
        from cbrrt_ompl.animation import check_animation_file

        check_animation_file(arguments.animation)


def _print_error(error: CbrrtError | OSError) -> None:
    """Print an error on stderr, every problem on a line of its own."""
    text = str(error)
    if isinstance(error, OSError) and error.strerror:
        text = f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    for line in text.splitlines():
        print(f"{_colored('cbrrt: error:', RED, sys.stderr)} {line}", file=sys.stderr)


def _print_json(data: object) -> None:
    """Print plain values as JSON; what is infinite or no number is null, since JSON has neither."""
    print(json.dumps(_finite(data), indent=2, allow_nan=False))


def _finite(data: Any) -> Any:
    """Plain values without infinite ones."""
    if isinstance(data, dict):
        return {name: _finite(value) for name, value in data.items()}
    if isinstance(data, (list, tuple)):
        return [_finite(value) for value in data]
    return None if isinstance(data, float) and not math.isfinite(data) else data


def _colored(text: str, color: str, stream: TextIO | None = None) -> str:
    """A text in a colour where a terminal shows it and nobody has set NO_COLOR."""
    stream = stream or sys.stdout
    plain = not stream.isatty() or os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb"
    return text if plain else f"\033[{color}m{text}\033[0m"


def _seconds(text: str) -> float:
    """A time from the command line [s]."""
    return _above_zero(text, "seconds")


def _metres(text: str) -> float:
    """A distance from the command line [m]."""
    return _above_zero(text, "metres")


def _above_zero(text: str, unit: str) -> float:
    """A finite number above 0 from the command line."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise argparse.ArgumentTypeError(f"got {text!r}, expected a number of {unit} above 0")
    return value


def _count(text: str) -> int:
    """A number of things from the command line."""
    if not (text.isascii() and text.isdigit() and int(text) > 0):
        raise argparse.ArgumentTypeError(f"got {text!r}, expected a whole number, 1 or more")
    return int(text)


def _seed(text: str) -> int:
    """A seed from the command line."""
    if not (text.isascii() and text.isdigit()):
        raise argparse.ArgumentTypeError(f"got {text!r}, expected a whole number, 0 or more")
    return int(text)


def _add_command(
    commands: Any, name: str, run: Callable[[argparse.Namespace], int], summary: str, example: str
) -> argparse.ArgumentParser:
    """A subcommand with its help and an example."""
    parser: argparse.ArgumentParser = commands.add_parser(
        name,
        help=summary,
        description=f"{summary[0].upper()}{summary[1:]}.",
        epilog=f"example:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(run=run)
    return parser


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one line, like all others of this program."""

    def error(self, message: str) -> NoReturn:
        """Print the line and leave with exit code 2."""
        self.exit(BAD_INPUT, f"cbrrt: error: {message} (see '{self.prog} --help')\n")


class _Version(argparse.Action):
    """``--version``, looked up only when asked for."""

    def __init__(self, option_strings: Sequence[str], dest: str, help: str) -> None:
        """An option without a value."""
        super().__init__(option_strings, dest, nargs=0, help=help)

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        """Print it and leave."""
        from cbrrt_ompl import __version__

        print(f"cbrrt {__version__}")
        parser.exit()
