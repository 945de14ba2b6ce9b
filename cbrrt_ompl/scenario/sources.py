"""What may stand where a scenario belongs: a file, a name, a problem of MovingAI's; and maps, which are told apart."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from cbrrt_ompl.errors import MISSING, InputError, MapError, Problem, Remark, ScenarioError
from cbrrt_ompl.files import note_read, refusal
from cbrrt_ompl.scenario.maps.formats import format_of
from cbrrt_ompl.scenario.maps.map_files import MAP_SERVER_KEYS, ROS_SUFFIXES, find_beside
from cbrrt_ompl.scenario.plain_yaml import read_yaml
from cbrrt_ompl.scenario.sections import Report

_SCEN = re.compile(r"(.*\.scen)(?::([1-9][0-9]{0,8}))?", re.IGNORECASE)
"""A file of MovingAI's benchmark problems, and which one of them."""

_SCEN_COLUMNS = "bucket, map, width, height, start x, start y, goal x, goal y, length"


class Source(NamedTuple):
    """What was found where a scenario belongs."""

    data: object
    """Plain values with the keys of a scenario file."""
    name: str
    """What messages call it."""
    folder: Path
    """What the names of other files are relative to."""


def read_source(path: Path, report: Report) -> Source:
    """Plain values of a scenario file, of a scenario that comes along, or of a problem of MovingAI's.

    Args:
        path: the file; or the name of a scenario that comes with the package, where there is no such file; or
            ``arena.map.scen:12``, the twelfth problem of a file.
        report: where mistakes go that need not end the reading.

    Raises:
        ScenarioError: if it cannot be read, or is a map.
    """
    scen = _SCEN.fullmatch(str(path))
    if scen and not path.exists():
        return _read_scen(Path(scen[1]), int(scen[2] or 1))
    if scen:
        return _read_scen(path, 1)
    if not (path.suffix or path.parent.name or os.path.exists(path)):
        path = scenario_path(path.name)
    if _is_map_by_suffix(path):
        raise ScenarioError(_a_map(path), str(path))
    try:
        data = read_yaml(path, report.problems)
    except InputError as error:
        raise ScenarioError(error.problems, str(path)) from None
    if _is_map_server(data):
        raise ScenarioError(_a_map(path), str(path))
    return Source(data, str(path), path.parent)


def is_map(path: Path) -> bool:
    """Whether a file is a map that ``map:`` reads, and no scenario: by its suffix, or by the keys of map_server."""
    if _is_map_by_suffix(path):
        return True
    try:
        return path.suffix.lower() in ROS_SUFFIXES and _is_map_server(read_yaml(path, []))
    except InputError:
        return False


def has_no_scale(path: Path) -> bool:
    """Whether a map does not tell the size of its cells."""
    kind = format_of(path)
    return kind is not None and not kind.tells_resolution


def _is_map_by_suffix(path: Path) -> bool:
    """Whether a file is a map whatever it holds; a YAML file may be a scenario as well."""
    return path.suffix.lower() not in ROS_SUFFIXES and format_of(path) is not None


def _is_map_server(data: object) -> bool:
    return isinstance(data, Mapping) and "image" in data and len(data.keys() & set(MAP_SERVER_KEYS)) > 1


def scenario_names() -> dict[str, Path]:
    """The files of the scenarios that come with the package, in a checkout or in an installed wheel, by their names."""
    package = Path(__file__).resolve().parent.parent
    files = [file for folder in (package, package.parent) for file in (folder / "scenarios").glob("*.yaml")]
    return {file.stem: file for file in sorted(files)}


def scenario_path(name: str) -> Path:
    """The file of a scenario that comes with the package.

    Args:
        name: name of the file without its suffix.

    Raises:
        ScenarioError: if there is no such file, with the names that there are.
    """
    found = scenario_names()
    if name not in found:
        expected = f"a scenario file, or one of those that come along: {', '.join(found)}"
        raise ScenarioError(Problem("", MISSING, expected), name)
    return found[name]


def _a_map(path: Path) -> Problem:
    """What to type where a map was given."""
    expected = (
        f"a scenario; 'cbrrt show {path}' draws the map, 'cbrrt plan {path} --robot NAME --start X Y THETA --goal X Y' "
        f"plans in it, 'cbrrt new {path} --robot NAME' writes a scenario"
    )
    return Problem("", Remark("a map"), expected)


def _read_scen(path: Path, number: int) -> Source:
    """One problem of MovingAI's: cells of 1 m, the paper's robot, from the middle of a cell into another one.

    MovingAI counts rows from the top, and cells where they begin.
    """
    where, words = _scen_line(path, number)
    try:
        columns, rows, *cells = map(int, words[2:8])
        if len(cells) != 4 or min(columns, rows) < 1:
            raise ValueError
    except ValueError:
        raise ScenarioError(Problem(where, " ".join(words), _SCEN_COLUMNS), str(path)) from None
    start_x, start_y, goal_x, goal_y = cells
    grid, remark = find_beside(words[1], path.parent)
    if grid is None:
        expected = f"a map that exists, looked for as {remark}"
        raise ScenarioError(Problem(where, words[1], expected), str(path))
    _check_size(grid, columns, rows, f"{path}: {where}")
    data: dict[str, Any] = {
        "name": f"{grid.stem} {number}",
        "map": {"file": os.path.relpath(grid, path.parent), "resolution": 1.0},
        "start": {"x": start_x + 0.5, "y": rows - start_y - 0.5},
        "goal": {"x": goal_x + 0.5, "y": rows - goal_y - 0.5, "tolerance": 0.5},
    }
    return Source(data, f"{path}:{number}", path.parent)


def _scen_line(path: Path, number: int) -> tuple[str, list[str]]:
    """Where a problem stands, and its columns."""
    note_read(path)
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, ValueError) as error:
        reason = refusal(error) if isinstance(error, OSError) else Remark("no text in UTF-8")
        raise ScenarioError(Problem("", reason, "a file that can be read"), str(path)) from None
    problems = [(i, line.split()) for i, line in enumerate(lines, start=1) if line.strip()]
    if problems and problems[0][1][0] == "version":
        del problems[0]
    if number > len(problems):
        raise ScenarioError(Problem("", Remark(f"problem {number}"), f"one from 1 to {len(problems)}"), str(path))
    line, words = problems[number - 1]
    return f"line {line}", words


def _check_size(grid: Path, columns: int, rows: int, where: str) -> None:
    """Refuse a map of another size than the problem is for: benchmarks have maps that are scaled."""
    from cbrrt_ompl.scenario.maps.movingai import read_movingai

    try:
        found = read_movingai(grid).cells.shape
    except MapError as error:
        raise ScenarioError(error.problems, error.source) from None
    if found != (rows, columns):
        problem = Problem("", Remark(f"a map of {found[1]} x {found[0]} cells"), f"one of {columns} x {rows}")
        raise ScenarioError(problem, f"{where}: {grid}")
