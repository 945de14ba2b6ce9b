"""What is printed: values a line, tables, JSON, errors, and their colours."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Iterable, Mapping
from typing import Any, TextIO

from cbrrt_ompl.errors import CbrrtError

GREEN, RED = "32", "31"

LINE_WIDTH = 80
"""Columns of the narrowest terminal that all output fits."""


def print_values(values: Mapping[str, str]) -> None:
    """Print a value a line, behind its name."""
    width = max(map(len, values))
    for name, value in values.items():
        print(f"{name:{width}}  {value}")


def heading(data: Mapping[str, Any], is_good: bool) -> dict[str, str]:
    """Scenario, planner, status and seed of a plan or a drive, for people; no seed where none was asked for."""
    values = {"scenario": data["scenario"], "planner": data["planner"], "status": verdict(data["status"], is_good)}
    return values if data["seed"] is None else {**values, "seed": f"{data['seed']}"}


def table_line(cells: Iterable[str], widths: Iterable[int], left: int) -> str:
    """A line of a table, the first cells to the left of their columns and the others to the right.

    Args:
        cells: the texts.
        widths: of the columns.
        left: how many cells are to the left.
    """
    return "  ".join(
        cell.ljust(width) if column < left else cell.rjust(width)
        for column, (cell, width) in enumerate(zip(cells, widths, strict=True))
    )


def print_json(data: object) -> None:
    """Print plain values and paths as JSON; what is infinite or no number is null, since JSON has neither."""
    print(json.dumps(_finite(data), indent=2, allow_nan=False, default=str))


def _finite(data: Any) -> Any:
    """Plain values without infinite ones."""
    if isinstance(data, dict):
        return {name: _finite(value) for name, value in data.items()}
    if isinstance(data, (list, tuple)):
        return [_finite(value) for value in data]
    return None if isinstance(data, float) and not math.isfinite(data) else data


def kept_runs(kept: int) -> str:
    """The end of a line that counts runs: how many of them former calls had done."""
    return f", {kept:,} of them kept from before" if kept else ""


def print_missing(failures: Mapping[str, str]) -> None:
    """Print which series of runs are missing, and why."""
    for name, reason in failures.items():
        print(f"runs of {name} are missing: {reason}")


def print_error(error: CbrrtError | OSError) -> None:
    """Print an error on stderr, every problem on a line of its own."""
    text = str(error)
    if isinstance(error, OSError) and error.strerror:
        text = f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    for line in text.splitlines():
        print(f"{colored('cbrrt: error:', RED, sys.stderr)} {line}", file=sys.stderr)


def verdict(text: str, is_good: bool) -> str:
    """The outcome of a command, green or red."""
    return colored(text, GREEN if is_good else RED)


def colored(text: str, color: str, stream: TextIO | None = None) -> str:
    """A text in a colour where a terminal shows it and nobody has set NO_COLOR."""
    stream = stream or sys.stdout
    plain = not stream.isatty() or os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb"
    return text if plain else f"\033[{color}m{text}\033[0m"
