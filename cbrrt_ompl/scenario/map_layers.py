"""The map of a scenario: the map itself and the keepout masks over it, as a scenario file names them."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cbrrt_ompl.collision.occupancy import OCCUPIED, UNKNOWN_CELLS, GridLayer
from cbrrt_ompl.errors import InputError, Problem
from cbrrt_ompl.problem.obstacles import Bounds, Obstacle
from cbrrt_ompl.scenario.maps.map_files import as_written
from cbrrt_ompl.scenario.sections import Key, Report, number, one_of, read_section, text


@dataclass(frozen=True)
class KeepoutMask:
    """A second map whose occupied cells block too: the keepout filter of Nav2, the virtual walls of others."""

    file: Path
    """Its file, absolute."""
    resolution: float | None = None
    """Side of a cell [m]; None where the file tells it."""


@dataclass(frozen=True)
class MapSource:
    """The map that a world was read from, kept so that a scenario is saved with it and not with its obstacles."""

    file: Path
    """The map's file, absolute."""
    obstacles: int
    """How many of the world's obstacles came from it and from its masks: the first ones."""
    unknown: str = "occupied"
    """What unknown cells count as: ``occupied`` or ``free``."""
    resolution: float | None = None
    """Side of a cell [m]; None where the map's file tells it."""
    keepout: tuple[KeepoutMask, ...] = ()
    """The masks over it."""
    remarks: tuple[str, ...] = field(default=(), compare=False)
    """What was not taken as the files say, a line each."""


def map_layers(value: object, path: str, report: Report) -> dict[str, Any] | None:
    """The keys of a map, from its file's name, a list of such names (the others are masks), or a mapping."""
    if isinstance(value, list) and value:
        first, *masks = value
        value = {**(first if isinstance(first, Mapping) else {"file": first}), "keepout": masks}
    values = read_section({"file": value} if isinstance(value, str) else value, path, MAP, report)
    return values and {"unknown": "occupied", "keepout": [], **values}


def load_layers(
    keys: Mapping[str, Any], folder: Path, report: Report
) -> tuple[MapSource, Bounds, list[Obstacle]] | None:
    """Bounds and obstacles of a map and its masks; None where one of them cannot be read.

    Args:
        keys: what :func:`map_layers` made.
        folder: what the names of files are relative to.
        report: where the mistakes go.
    """
    from cbrrt_ompl.scenario.maps.loading import load_map

    file = folder / as_written(keys["file"])
    masks = [KeepoutMask((folder / as_written(k["file"])).resolve(), k.get("resolution")) for k in keys["keepout"]]
    resolution = keys.get("resolution")
    before = len(report.problems)
    try:
        grid = load_map(file, resolution=resolution)
        bounds, obstacles, remarks = grid.bounds(), grid.obstacles(keys["unknown"]), list(grid.remarks)
    except InputError as error:
        _adopt(error, "map", report)
    for mask, written in zip(masks, keys["keepout"], strict=True):
        try:
            layer = load_map(folder / as_written(written["file"]), resolution=mask.resolution, may_be_full=True)
        except InputError as error:
            _adopt(error, "map.keepout", report)
        else:
            if len(report.problems) == before:
                obstacles += GridLayer(layer.cells == OCCUPIED, layer.resolution, layer.origin).boxes
                remarks += layer.remarks
    if len(report.problems) > before:
        return None
    source = MapSource(
        file.resolve(), len(obstacles), keys["unknown"], resolution, tuple(masks), tuple(dict.fromkeys(remarks))
    )
    return source, bounds, obstacles


def source_data(source: MapSource, folder: Path) -> dict[str, Any]:
    """Plain value of a map, its files relative to a folder."""
    keepout = [_layer_data(mask, folder) for mask in source.keepout]
    masks: object = keepout if len(keepout) != 1 or len(keepout[0]) > 1 else keepout[0]["file"]
    return {
        **_layer_data(source, folder),
        "unknown": source.unknown,
        **({"keepout": masks} if keepout else {}),
    }


def _layer_data(layer: MapSource | KeepoutMask, folder: Path) -> dict[str, Any]:
    resolution = {} if layer.resolution is None else {"resolution": float(layer.resolution)}
    return {"file": _relative(layer.file, folder), **resolution}


def _adopt(error: InputError, key: str, report: Report) -> None:
    """Report why the file of a key could not be read."""
    where = f"{key}: {error.source}" if error.source else key
    report.adopt([Problem(f"{where}: {p.field}" if p.field else where, p.value, p.expected) for p in error.problems])


def _masks(value: object, path: str, report: Report) -> list[dict[str, Any]] | None:
    """The keys of one mask or of several in a list."""
    entries = value if isinstance(value, list) else [value]
    sections = [{"file": entry} if isinstance(entry, str) else entry for entry in entries]
    found = [read_section(section, path, MASK, report) for section in sections]
    return [keys for keys in found if keys is not None]


def _relative(file: Path, folder: Path) -> str:
    """A file's path as seen from a folder, with forward slashes."""
    try:
        return Path(os.path.relpath(file, folder)).as_posix()
    except ValueError:  # another drive
        return file.as_posix()


MASK = {
    "file": Key(text, required="the name of a mask's file"),
    "resolution": Key(number),
}
MAP = {
    "file": Key(text, required="the name of a map's file"),
    "unknown": Key(one_of(UNKNOWN_CELLS)),
    "resolution": Key(number),
    "keepout": Key(_masks),
}
