"""Files that hold a trajectory number for number: CSV, NPZ and JSON."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.errors import MISSING, Problem, TrajectoryError
from cbrrt_ompl.trajectory.columns import COLUMNS, column_problems

Columns: TypeAlias = Mapping[str, NDArray[np.float64]]
"""The arrays of `COLUMNS` by name, each of shape (n,)."""


class Format(NamedTuple):
    """How one file format is written and read."""

    encode: Callable[[Columns, bool], bytes]
    """Makes the content of a file of the columns and of whether the velocities jump; CSV has no room for the latter."""
    decode: Callable[[bytes], dict[str, Any]]
    """Makes the columns, and ``kinematic`` where the format has it, of that; a TrajectoryError tells what is wrong."""


def _encode_csv(columns: Columns, _: bool) -> bytes:
    rows = np.column_stack([columns[name] for name in COLUMNS]).tolist()
    lines = [",".join(COLUMNS), *(",".join(map(repr, row)) for row in rows)]
    return ("\n".join(lines) + "\n").encode()


def _decode_csv(content: bytes) -> dict[str, Any]:
    header, *lines = _text(content).rstrip("\r\n").split("\n")
    if header.rstrip() != ",".join(COLUMNS):
        raise TrajectoryError(Problem("line 1", header, f"the header {','.join(COLUMNS)}"))
    rows = [_csv_row(line, number) for number, line in enumerate(lines, start=2)]
    columns = dict(zip(COLUMNS, np.array(rows).reshape(-1, len(COLUMNS)).T, strict=True))
    problems = column_problems(columns, lambda name, row: f"line {row + 2}, {name}")
    if problems:
        raise TrajectoryError(problems)
    return columns


def _csv_row(line: str, number: int) -> list[float]:
    """The numbers of one line."""
    cells = line.split(",")
    if len(cells) != len(COLUMNS):
        raise TrajectoryError(Problem(f"line {number}", f"{len(cells)} values", f"{len(COLUMNS)} values"))
    row = []
    for name, cell in zip(COLUMNS, cells, strict=True):
        try:
            row.append(float(cell))
        except ValueError:
            raise TrajectoryError(Problem(f"line {number}, {name}", cell.strip(), "a number")) from None
    return row


def _encode_npz(columns: Columns, kinematic: bool) -> bytes:
    buffer = io.BytesIO()
    arrays: dict[str, Any] = {name: columns[name] for name in COLUMNS}
    np.savez(buffer, kinematic=np.array(kinematic), **arrays)
    return buffer.getvalue()


def _decode_npz(content: bytes) -> dict[str, Any]:
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            values = dict(archive)
    except Exception as error:  # a damaged archive fails in zipfile, zlib or NumPy, in a dozen ways
        raise TrajectoryError(Problem("", str(error), "an undamaged NPZ archive")) from error
    kinematic = values.get("kinematic")
    if kinematic is not None and kinematic.shape == ():
        values["kinematic"] = kinematic.item()
    return _checked_names(values)


def _encode_json(columns: Columns, kinematic: bool) -> bytes:
    arrays = {name: columns[name].tolist() for name in COLUMNS}
    return (json.dumps({"kinematic": kinematic, **arrays}) + "\n").encode()


def _decode_json(content: bytes) -> dict[str, Any]:
    text = _text(content)
    try:
        values = json.loads(text)
    except json.JSONDecodeError as error:
        where = f"line {error.lineno}, column {error.colno}"
        raise TrajectoryError(Problem(where, error.msg, "whole and valid JSON")) from error
    except (ValueError, RecursionError) as error:
        raise TrajectoryError(Problem("", str(error), "JSON of a trajectory")) from error
    if not isinstance(values, dict):
        raise TrajectoryError(Problem("", values, f"an object with {', '.join(COLUMNS)} and kinematic"))
    return _checked_names(values)


def _text(content: bytes) -> str:
    """The text of a file, with one kind of line end."""
    try:
        return content.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        raise TrajectoryError(Problem("", error.reason, "text in UTF-8")) from error


def _checked_names(values: dict[str, Any]) -> dict[str, Any]:
    """The values of an NPZ or JSON file, if they are all there and no others."""
    expected = f"the entries {', '.join(COLUMNS)} and kinematic"
    problems = [Problem(name, MISSING, expected) for name in (*COLUMNS, "kinematic") if name not in values]
    problems += [Problem("", name, expected) for name in values if name not in (*COLUMNS, "kinematic")]
    if not problems and not isinstance(values["kinematic"], bool):
        problems.append(Problem("kinematic", values["kinematic"], "true or false"))
    if problems:
        raise TrajectoryError(problems)
    return values


FORMATS = {
    ".csv": Format(_encode_csv, _decode_csv),
    ".json": Format(_encode_json, _decode_json),
    ".npz": Format(_encode_npz, _decode_npz),
}
"""Formats by the suffix of their files."""
