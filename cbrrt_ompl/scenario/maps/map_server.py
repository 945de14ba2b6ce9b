"""ROS map_server maps: a YAML file with an image beside it, read as nav2_map_server reads them, and written."""

from __future__ import annotations

import glob
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from cbrrt_ompl.checks import LARGEST, SMALLEST, is_number
from cbrrt_ompl.collision.occupancy import A_SIDE, FREE, FREE_THRESHOLD, OCCUPIED, OCCUPIED_THRESHOLD, UNKNOWN
from cbrrt_ompl.errors import MISSING, InputError, MapError, Problem
from cbrrt_ompl.files import write_files
from cbrrt_ompl.scenario.maps.image import MODES, UNKNOWN_GREY, Reading, cells_of
from cbrrt_ompl.scenario.maps.map_files import IMAGE_SUFFIXES, MapFile, find_beside
from cbrrt_ompl.scenario.maps.pixels import read_pixels
from cbrrt_ompl.scenario.plain_yaml import dump_line, read_yaml

_GREYS = {OCCUPIED: 0, FREE: 254, UNKNOWN: UNKNOWN_GREY}
"""What map_saver writes."""


def read_map_server(path: Path) -> MapFile:
    """Cells, resolution and origin of a ROS map.

    Required are ``image``, ``resolution`` and ``origin``. Where they are left out, ``mode`` is ``trinary``, ``negate``
    0, ``occupied_thresh`` 0.65 and ``free_thresh`` 0.196, or ``occupied_thresh`` where that is less. Other keys are
    skipped.

    The image is looked for where the file says: relative to the YAML file, absolute, or under the home folder (``~``);
    and, for files that came from another machine, by its name beside the YAML file, with a remark.

    Args:
        path: the YAML file.

    Raises:
        MapError: with every mistake in the YAML file, or with why its image cannot be read.
    """
    problems: list[Problem] = []
    try:
        data = read_yaml(path, problems)
    except InputError as error:
        raise MapError(error.problems, str(path)) from None
    if not isinstance(data, Mapping):
        problem = Problem("", data, "a mapping with the keys image, resolution, origin")
        raise MapError(problem, str(path))
    remarks: list[str] = []
    image = _image(data, path, problems, remarks)
    resolution = _resolution(data, problems)
    origin = _origin(data, problems)
    reading = _reading(data, problems)
    if problems or image is None or resolution is None or origin is None:
        raise MapError(problems, str(path))
    return MapFile(cells_of(read_pixels(image), reading), resolution, origin, tuple(remarks))


def write_map_server(grid: MapFile, path: Path) -> None:
    """Write a map, from which :func:`read_map_server` reads the same cells, resolution and origin.

    Args:
        grid: what to write; its remarks are left out.
        path: the YAML file; the image gets the same name with the suffix ``.pgm``.

    Raises:
        MapError: if the name has another suffix, or a file cannot be written.
    """
    if path.suffix.lower() not in (".yaml", ".yml"):
        raise MapError(Problem("path", str(path), "a name that ends in .yaml"))
    image = path.with_suffix(".pgm")
    rows, columns = grid.cells.shape
    greys = np.empty((rows, columns), dtype=np.uint8)
    for cell, grey in _GREYS.items():
        greys[grid.cells[::-1] == cell] = grey
    keys = {
        "image": image.name,
        "mode": "trinary",
        "resolution": grid.resolution,
        "origin": list(grid.origin),
        "negate": 0,
        "occupied_thresh": OCCUPIED_THRESHOLD,
        "free_thresh": FREE_THRESHOLD,
    }
    pixels = f"P5\n{columns} {rows}\n255\n".encode("ascii") + greys.tobytes()
    lines = "".join(f"{dump_line({key: value})}\n" for key, value in keys.items())
    write_files({image: pixels, path: lines}, MapError)


def _image(data: Mapping[object, object], path: Path, problems: list[Problem], remarks: list[str]) -> Path | None:
    """The image file, looked for where the YAML file says and then beside it."""
    name = data.get("image", MISSING)
    if not isinstance(name, str) or not name.strip():
        problems.append(Problem("image", name, "the name of an image file"))
        return None
    image, remark = find_beside(name, path.parent)
    if image is not None:
        remarks += [f"{path}: image: {remark}"] if remark else []
        return image
    others = [file.name for file in sorted(path.parent.glob(f"{glob.escape(path.stem)}.*")) if _is_image(file)]
    hint = f" ({others[0]} lies there: write image: {others[0]})" if others else ""
    problems.append(Problem("image", name, f"a file that exists, looked for as {remark}{hint}"))
    return None


def _is_image(file: Path) -> bool:
    return file.suffix.lower() in IMAGE_SUFFIXES


def _resolution(data: Mapping[object, object], problems: list[Problem]) -> float | None:
    value = data.get("resolution", MISSING)
    if is_number(value, LARGEST) and value >= SMALLEST:
        return float(value)
    problems.append(Problem("resolution", value, A_SIDE))
    return None


def _origin(data: Mapping[object, object], problems: list[Problem]) -> tuple[float, float, float] | None:
    value = data.get("origin", MISSING)
    if isinstance(value, list) and len(value) == 3 and all(is_number(entry) for entry in value):
        x, y, yaw = value
        return float(x), float(y), float(yaw)
    if isinstance(value, list) and len(value) == 3 and all(map(is_number, value[:2])) and _is_nan(value[2]):
        expected = "a yaw that is a number; map_saver writes this for a SLAM that sends no rotation: write 0.0 there"
        problems.append(Problem("origin", value, expected))
        return None
    problems.append(Problem("origin", value, "three finite numbers [x, y, yaw] [m, m, rad]"))
    return None


def _is_nan(value: object) -> bool:
    """Whether a value is no number, in YAML's own notation or in that of C."""
    if isinstance(value, str):
        return value.lower().lstrip("+-").startswith("nan")
    return isinstance(value, float) and math.isnan(value)


def _reading(data: Mapping[object, object], problems: list[Problem]) -> Reading:
    """How the image is to be read; the defaults where the file is wrong."""
    mode = data.get("mode", "trinary")
    mode = mode.lower() if isinstance(mode, str) else mode
    if mode not in MODES:
        problems.append(Problem("mode", mode, f"one of {', '.join(MODES)}"))
    negate = data.get("negate", 0)
    if not (isinstance(negate, int) and negate in (0, 1)):
        problems.append(Problem("negate", negate, "0 or 1"))
    occupied = data.get("occupied_thresh", OCCUPIED_THRESHOLD)
    free = data.get("free_thresh", min(FREE_THRESHOLD, occupied) if is_number(occupied) else FREE_THRESHOLD)
    wrong = [
        Problem(name, value, "a number from 0 to 1")
        for name, value in (("occupied_thresh", occupied), ("free_thresh", free))
        if not (is_number(value) and 0.0 <= value <= 1.0)
    ]
    if not wrong and free > occupied:  # type: ignore[operator]  # both are numbers
        wrong.append(Problem("free_thresh", free, f"at most occupied_thresh, which is {occupied}"))
    problems.extend(wrong)
    if wrong:
        return Reading()
    return Reading(str(mode), bool(negate), float(occupied), float(free))  # type: ignore[arg-type]  # as above
