"""Maps of the MovingAI benchmarks: rows of characters, the upper one first."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.collision.occupancy import FREE, MAX_CELLS, OCCUPIED, check_cell_count
from cbrrt_ompl.errors import MISSING, MapError, Problem, Remark
from cbrrt_ompl.files import refusal
from cbrrt_ompl.scenario.maps.map_files import MapFile

FREE_TERRAIN, BLOCKED_TERRAIN = b".GS", b"@OTW"
"""Ground and swamp can be driven on; out of bounds, trees and water can not."""


def read_movingai(path: Path) -> MapFile:
    """Cells of a MovingAI map.

    Args:
        path: the ``.map`` file.

    Returns:
        The cells, ``OCCUPIED`` or ``FREE``.

    Raises:
        MapError: with the line that is wrong.
    """
    try:
        with path.open("rb") as file:
            lines = file.read(2 * MAX_CELLS).splitlines()
    except (OSError, ValueError) as error:
        raise MapError(Problem("", refusal(error), "a file that can be read"), str(path)) from None
    try:
        first, columns, rows = _header(lines)
        return MapFile(_cells(lines, first, columns, rows))
    except MapError as error:
        raise MapError(error.problems, str(path)) from None


def _header(lines: list[bytes]) -> tuple[int, int, int]:
    """Index of the first row of cells, columns and rows."""
    sizes: dict[bytes, int] = {}
    for i, line in enumerate(lines[:100]):
        words = line.split()
        if words == [b"map"]:
            break
        if len(words) == 2 and words[0] in (b"height", b"width") and words[1].isdigit() and len(words[1]) < 10:
            sizes[words[0]] = int(words[1])
        elif words and words[0] != b"type":
            raise MapError(Problem(f"line {i + 1}", _text(line), "type, height, width or map"))
    else:
        raise MapError(Problem("map", MISSING, "a line with this word before the cells"))
    for name in (b"height", b"width"):
        if sizes.get(name, 0) <= 0:
            raise MapError(
                Problem(_text(name), sizes.get(name, MISSING), "a whole number of 1 or more, before the map")
            )
    check_cell_count((sizes[b"height"], sizes[b"width"]), "map")
    return i + 1, sizes[b"width"], sizes[b"height"]


def _cells(lines: list[bytes], first: int, columns: int, rows: int) -> NDArray[np.int8]:
    """Cells of the rows of characters, the lowest first."""
    rows_of_text = lines[first : first + rows]
    if len(rows_of_text) < rows:
        raise MapError(Problem("height", rows, f"the {len(rows_of_text)} rows that the file has"))
    for i, row in enumerate(rows_of_text):
        if len(row) != columns:
            raise MapError(Problem(f"line {first + i + 1}", Remark(f"{len(row)} cells"), f"{columns}, the width"))
    for i, row in enumerate(lines[first + rows :]):
        if row.strip():
            raise MapError(Problem(f"line {first + rows + i + 1}", _text(row), f"the end after {rows} rows"))
    terrain = np.frombuffer(b"".join(rows_of_text), dtype=np.uint8).reshape(rows, columns)
    is_free, is_blocked = (np.isin(terrain, np.frombuffer(t, dtype=np.uint8)) for t in (FREE_TERRAIN, BLOCKED_TERRAIN))
    if not (is_free | is_blocked).all():
        row, column = np.argwhere(~(is_free | is_blocked))[0].tolist()
        known = ", ".join(_text(FREE_TERRAIN + BLOCKED_TERRAIN))
        found = _text(rows_of_text[row][column : column + 1])
        raise MapError(Problem(f"line {first + row + 1}, column {column + 1}", found, f"one of {known}"))
    return np.where(is_blocked, OCCUPIED, FREE).astype(np.int8)[::-1]


def _text(line: bytes) -> str:
    return line.decode("ascii", errors="backslashreplace")
