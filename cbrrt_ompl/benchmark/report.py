"""The report of a campaign, from its database alone: one HTML page, Markdown with its charts beside it, and CSV."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from cbrrt_ompl.benchmark.charts import MEASURES, boxes_figure, success_figure
from cbrrt_ompl.benchmark.digits import three_digits
from cbrrt_ompl.benchmark.document import Block, Bullets, Document, Heading, Picture, Table, Text
from cbrrt_ompl.benchmark.results import Experiment, Series, read_experiments
from cbrrt_ompl.benchmark.statistics import (
    Interval,
    Quartiles,
    Ratio,
    bootstrap_medians,
    quartiles,
    ratio_of_medians,
    wilson_interval,
)
from cbrrt_ompl.errors import UnknownPlannerError
from cbrrt_ompl.files import write_file, write_files

SUMMARY_COLUMNS = (
    "scenario", "planner", "runs", "successes", "success_rate", "success_low", "success_high", "invalid", "crashed",
    *(f"{measure}_{part}" for measure, _ in MEASURES for part in ("q1", "median", "q3")),
)  # fmt: skip
"""Header of summary.csv; times in seconds, infinite where the run at that rank has failed."""

RATIO_COLUMNS = ("scenario", "measure", "planner", "reference", "ratio", "low", "high")
"""Header of ratios.csv."""


@dataclass(frozen=True)
class Report:
    """What was written."""

    path: Path
    """The report in Markdown."""
    page: Path
    """The report as one HTML page that needs no other file."""
    invalid: tuple[str, ...]
    """Planners whose exact solutions failed verification, with scenario and number."""
    summary: tuple[dict[str, Any], ...]
    """The rows of summary.csv by their header."""


def write_report(database: Path, output: Path, reference: str | None = None) -> Report:
    """Write ``report.html``, ``report.md``, ``summary.csv``, ``ratios.csv`` and two charts a scenario.

    Args:
        database: a benchmark database.
        output: folder, made where it is missing.
        reference: planner that the report compares the others with; None takes `cb-rrt`, or else the first one.

    Raises:
        InputError: if the file is no benchmark database, does not have the reference, or nothing can be written.
        OSError: if the folder cannot be made.
    """
    experiments = read_experiments(database)
    planners = list(dict.fromkeys(one.planner for experiment in experiments for one in experiment.series))
    if reference is None:
        reference = "cb-rrt" if "cb-rrt" in planners else planners[0]
    elif reference not in planners:
        raise UnknownPlannerError(reference, planners)
    output.mkdir(parents=True, exist_ok=True)
    ratios = {experiment.name: all_ratios(experiment) for experiment in experiments}
    summary = [_summary_row(one) for experiment in experiments for one in experiment.series]
    _write_csv(output / "summary.csv", SUMMARY_COLUMNS, summary)
    _write_csv(output / "ratios.csv", RATIO_COLUMNS, _ratio_rows(ratios))
    document = Document("Benchmark report", list(_blocks(experiments, reference, ratios)))
    for name, png in document.pictures.items():
        write_file(output / name, png)
    path, page = output / "report.md", output / "report.html"
    write_files({path: document.markdown(), page: document.html()})
    rows = (dict(zip(SUMMARY_COLUMNS, row, strict=True)) for row in summary)
    return Report(path, page, tuple(_invalid(experiments)), tuple(rows))


Ratios = dict[tuple[str, str, str], Ratio]
"""By measure, planner and reference."""


def all_ratios(experiment: Experiment) -> Ratios:
    """Ratios of medians between all planners of a scenario, in all measures."""
    ratios = {}
    for measure, _ in MEASURES:
        values: dict[str, NDArray[np.float64]] = {one.planner: getattr(one, measure) for one in experiment.series}
        medians = {
            planner: bootstrap_medians(runs, f"{experiment.name} {planner} {measure}")
            for planner, runs in values.items()
        }
        for one, other in permutations(values, 2):
            ratios[measure, one, other] = ratio_of_medians(values[one], values[other], medians[one], medians[other])
    return ratios


def _blocks(experiments: Sequence[Experiment], reference: str, ratios: dict[str, Ratios]) -> Iterator[Block]:
    """The report, block by block."""
    yield from _overview(experiments)
    yield Heading("Verification")
    yield from _verification(experiments)
    for experiment in experiments:
        yield from _experiment(experiment, reference, ratios[experiment.name])
    yield Heading("How to read the numbers")
    yield Bullets(NOTES)


NOTES = (
    "A run has succeeded if it found an exact solution, drew no more samples than the scenario allows, and its "
    "trajectory passed verification. Success rates have Wilson's 95 % interval.",
    "Time, nodes and duration: median [quartiles] over all runs. A failed run counts as infinite: a median of ∞ says "
    "that half of the runs or more have failed.",
    "Time is that of the search alone, where the database tells it; OMPL's own column `time` has up to some "
    "milliseconds more.",
    "Ratios of medians have percentile bootstrap intervals (95 %, 5,000 resamples, the two planners drawn "
    "independently); where both medians are infinite there is none. ratios.csv has all pairs of planners, summary.csv "
    "the full numbers.",
    "Intervals are for one comparison each: of twenty that show no true difference, one will miss.",
)


def _experiment(experiment: Experiment, reference: str, ratios: Ratios) -> Iterator[Block]:
    """One scenario: a table of its planners, two charts, and how they compare."""
    yield Heading(experiment.title)
    header = ("planner", "succeeded", "success [95 % interval]", "time [ms]", "nodes", "duration [s]")
    yield Table(header, [_table_row(one) for one in experiment.series])
    yield _picture(f"success_{experiment.name}.png", success_figure(experiment), "Runs solved against time")
    caption = "Planning time, nodes and duration: every run, its quartiles, and failures at the right"
    yield _picture(f"boxes_{experiment.name}.png", boxes_figure(experiment), caption)
    if len(experiment.series) > 1 and any(one.planner == reference for one in experiment.series):
        yield Text(f"Medians, as multiples of those of {reference}:")
        others = [one.planner for one in experiment.series if one.planner != reference]
        rows = [(p, *(_ratio(ratios[measure, p, reference]) for measure, _ in MEASURES)) for p in others]
        yield Table(("planner", "time", "nodes", "duration"), rows)


def _picture(name: str, figure: Figure, caption: str) -> Picture:
    """A chart in the report."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return Picture(name, buffer.getvalue(), caption)


def _overview(experiments: Sequence[Experiment]) -> Iterator[Block]:
    """What was run, where and when."""
    rows = [
        (
            experiment.title,
            str(len(experiment.series)),
            " or ".join(dict.fromkeys(f"{len(one)}" for one in experiment.series)),
            f"{experiment.time_limit:g}",
            "-" if experiment.max_samples is None else f"{experiment.max_samples:,}",
            experiment.seed,
            experiment.date,
            experiment.host,
        )
        for experiment in experiments
    ]
    total = sum(len(one) for experiment in experiments for one in experiment.series)
    versions = ", ".join(dict.fromkeys(experiment.version for experiment in experiments))
    yield Text(f"{total:,} runs, {versions}.")
    header = ("scenario", "planners", "runs each", "time limit [s]", "max. samples", "seed", "began", "host")
    yield Table(header, rows)


def _verification(experiments: Sequence[Experiment]) -> Iterator[Block]:
    """Which planners' solutions are none, and what crashed."""
    every = [one for experiment in experiments for one in experiment.series]
    solved, unverified = sum(int(one.solved.sum()) for one in every), sum(int(one.unverified.sum()) for one in every)
    invalid = list(_invalid(experiments))
    if invalid:
        yield Text("**Exact solutions that failed verification**, counted as failures:")
        yield Bullets(invalid)
    elif solved > unverified:
        yield Text(f"All {solved - unverified:,} exact solutions that were verified passed.")
    if unverified:
        yield Text(f"{unverified:,} of {solved:,} exact solutions were not verified; they count as they are.")
    if not solved:
        yield Text("There is no exact solution to verify.")
    crashed = [
        f"{one.planner} in {experiment.title}: {int(one.crashed.sum())} of {len(one)} runs"
        for experiment in experiments
        for one in experiment.series
        if one.crashed.any()
    ]
    if crashed:
        yield Text("**Runs that crashed or hung**, counted as failures:")
        yield Bullets(crashed)


def _invalid(experiments: Iterable[Experiment]) -> Iterator[str]:
    """Planners whose exact solutions failed verification."""
    for experiment in experiments:
        for one in experiment.series:
            if one.invalid.any():
                count = f"{int(one.invalid.sum())} of {int(one.solved.sum())} exact solutions"
                yield f"{one.planner} in {experiment.title}: {count}"


def _table_row(one: Series) -> tuple[str, ...]:
    """One planner in the table of a scenario."""
    successes = int(one.success.sum())
    low, high = wilson_interval(successes, len(one))
    return (
        one.planner,
        f"{successes} of {len(one)}",
        f"{100.0 * successes / len(one):.0f} % [{100.0 * low:.0f}, {100.0 * high:.0f}]",
        _quartiles(quartiles(1e3 * one.time)),
        _quartiles(quartiles(one.nodes)),
        _quartiles(quartiles(one.duration)),
    )


def _quartiles(found: Quartiles) -> str:
    """Median [quartiles] in three digits."""
    return f"{three_digits(found.median)} [{three_digits(found.low)}, {three_digits(found.high)}]"


def _ratio(ratio: Ratio) -> str:
    """A ratio with its interval."""
    if math.isnan(ratio.value):
        return "-"
    return f"{three_digits(ratio.value)} [{three_digits(ratio.interval.low)}, {three_digits(ratio.interval.high)}]"


def _summary_row(one: Series) -> tuple[object, ...]:
    """One planner in summary.csv."""
    successes = int(one.success.sum())
    interval: Interval = wilson_interval(successes, len(one))
    parts = (quartiles(getattr(one, measure)) for measure, _ in MEASURES)
    return (
        one.experiment,
        one.planner,
        len(one),
        successes,
        successes / len(one),
        *interval,
        int(one.invalid.sum()),
        int(one.crashed.sum()),
        *(value for part in parts for value in part),
    )


def _ratio_rows(ratios: dict[str, Ratios]) -> Iterator[tuple[object, ...]]:
    """All ratios for ratios.csv."""
    for experiment, found in ratios.items():
        for (measure, one, other), ratio in found.items():
            yield (experiment, measure, one, other, ratio.value, *ratio.interval)


def _write_csv(path: Path, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Write a table with full precision."""
    buffer = io.StringIO(newline="")
    writer = csv.writer(buffer)
    writer.writerow(header)
    writer.writerows(rows)
    write_file(path, buffer.getvalue())
