"""Trajectory files of others: rows of (t, x, y, theta) with velocities or without, and results of dynobench."""

from __future__ import annotations

import io
import json
import math
import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cbrrt_ompl.checks import is_number
from cbrrt_ompl.errors import MISSING, Problem, Remark, TrajectoryError
from cbrrt_ompl.files import as_path, refusal
from cbrrt_ompl.trajectory.columns import COLUMNS
from cbrrt_ompl.trajectory.track import POSE_COLUMNS, VELOCITY_COLUMNS, Track, stamped_track
from cbrrt_ompl.trajectory.trajectory import Trajectory

DYNOBENCH_STEP = 0.1
"""Time step of dynobench's models, where a result tells nothing else [s]."""

_ALIASES = {
    **dict.fromkeys(("time", "timestamp", "stamp", "time_s", "t_s", "seconds"), "t"),
    **dict.fromkeys(("pos_x", "px", "x_m", "position_x"), "x"),
    **dict.fromkeys(("pos_y", "py", "y_m", "position_y"), "y"),
    **dict.fromkeys(("yaw", "heading", "th", "phi", "angle", "theta_rad"), "theta"),
    **dict.fromkeys(("vx", "speed", "velocity", "v_m_s", "linear"), "v"),
    **dict.fromkeys(("w", "yaw_rate", "wz", "angular", "omega_rad_s"), "omega"),
}
"""What others call the columns."""

_EXPECTED = f"columns {', '.join(POSE_COLUMNS)}, perhaps {' and '.join(VELOCITY_COLUMNS)}"


def load_track(path: str | os.PathLike[str], kinematic: bool = False) -> Trajectory | Track:
    """A trajectory of this package, or what another program wrote.

    Args:
        path: a trajectory file as :meth:`Trajectory.save` writes it; a CSV file (commas, semicolons or white space)
            with the columns t, x, y, theta and perhaps v and omega, named or in this order; JSON or NPZ with such
            names; or a YAML file with a result of dynobench, or with a nav_msgs/Path.
        kinematic: whether the velocities of a CSV file jump.

    Raises:
        TrajectoryError: if it is none of these.
    """
    path = as_path(path, TrajectoryError)
    suffix = path.suffix.lower()
    readers = {".json": _json, ".npz": _npz, ".yaml": _yaml, ".yml": _yaml}
    if suffix not in {".csv", ".txt", *readers}:
        known = ", ".join([".csv", ".txt", *readers])
        raise TrajectoryError(Problem("suffix", path.suffix, f"one of {known}"), str(path))
    try:
        content = path.read_bytes()
    except (OSError, ValueError) as error:
        raise TrajectoryError(Problem("", refusal(error), "a trajectory file"), str(path)) from None
    try:
        found = readers[suffix](content) if suffix in readers else _table(content)
        return Trajectory.load(path, kinematic) if found is None else found
    except TrajectoryError as error:
        raise TrajectoryError(error.problems, error.source or str(path)) from None


def _table(content: bytes) -> Track | None:
    """A track from rows of numbers; None where all columns of a trajectory of ours are there."""
    try:
        lines = content.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise TrajectoryError(Problem("", Remark(error.reason), "text in UTF-8")) from None
    rows = [
        (i, _cells(line)) for i, line in enumerate(lines, start=1) if line.strip() and line.lstrip()[:1] not in "#%"
    ]
    if not rows:
        raise TrajectoryError(Problem("", Remark("no rows"), _EXPECTED))
    names = _header(rows[0][1])
    if names is None:
        names = list((*POSE_COLUMNS, *VELOCITY_COLUMNS))[: len(rows[0][1])]
    else:
        del rows[0]
    if set(COLUMNS) <= set(names):
        return None
    values = [_row(number, cells, names) for number, cells in rows]
    return _track(dict(zip(names, np.array(values).reshape(-1, len(names)).T, strict=True)))


def _cells(line: str) -> list[str]:
    """Cells of a line, by the first separator that it has."""
    separator = next((s for s in (",", ";", "\t") if s in line), None)
    return [cell.strip() for cell in line.strip().split(separator)]


def _header(cells: Sequence[str]) -> list[str] | None:
    """Our names of the columns; None where the first line has numbers."""
    try:
        list(map(float, cells))
        return None
    except ValueError:
        names = [cell.strip("\"' ").lower() for cell in cells]
        return [_ALIASES.get(name, name) for name in (n.partition("[")[0].strip() for n in names)]


def _row(number: int, cells: Sequence[str], names: Sequence[str]) -> list[float]:
    if len(cells) != len(names):
        raise TrajectoryError(Problem(f"line {number}", f"{len(cells)} values", f"{len(names)} values"))
    row = []
    for name, cell in zip(names, cells, strict=True):
        try:
            row.append(float(cell))
        except ValueError:
            if name in (*POSE_COLUMNS, *VELOCITY_COLUMNS):
                raise TrajectoryError(Problem(f"line {number}, {name}", cell, "a number")) from None
            row.append(math.nan)
    return row


def _track(columns: Mapping[str, Any]) -> Track:
    """A track of columns by their names."""
    missing = [name for name in POSE_COLUMNS if name not in columns]
    if missing:
        raise TrajectoryError([Problem(name, MISSING, _EXPECTED) for name in missing])
    has_velocities = all(name in columns for name in VELOCITY_COLUMNS)
    names = (*POSE_COLUMNS, *VELOCITY_COLUMNS) if has_velocities else POSE_COLUMNS
    return Track(*(columns[name] for name in names))


def _json(content: bytes) -> Track | None:
    try:
        data = json.loads(content)
    except (ValueError, RecursionError):
        return None  # which our own reader says where
    if isinstance(data, list) and all(isinstance(row, list) for row in data):
        rows = [",".join(map(str, row)) for row in data]
        return _table("\n".join(rows).encode())
    if not isinstance(data, dict) or set(COLUMNS) <= data.keys():
        return None
    return _track({_named(name): value for name, value in data.items()})


def _npz(content: bytes) -> Track | None:
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            data = dict(archive)
    except Exception:  # a damaged archive, which our own reader says
        return None
    return None if set(COLUMNS) <= data.keys() else _track({_named(name): value for name, value in data.items()})


def _named(name: str) -> str:
    """Our name of a column."""
    return _ALIASES.get(str(name).lower(), str(name))


def _yaml(content: bytes) -> Track:
    """A result of dynobench, or a nav_msgs/Path as ``ros2 topic echo`` prints it."""
    import yaml

    try:
        data = next(iter(yaml.load_all(content, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))), None)
    except yaml.YAMLError as error:
        raise TrajectoryError(Problem("", Remark(str(error).splitlines()[0]), "a YAML file")) from None
    if not isinstance(data, dict):
        raise TrajectoryError(Problem("", data, "a result of dynobench, or a nav_msgs/Path"))
    return _path(data["poses"]) if "poses" in data else _dynobench(data)


def _path(poses: object) -> Track:
    """The poses of a nav_msgs/Path."""
    rows, times = [], []
    for i, stamped in enumerate(poses if isinstance(poses, list) else []):
        try:
            stamp, pose = stamped["header"]["stamp"], stamped["pose"]
            q = {name: float(pose["orientation"][name]) for name in "xyzw"}
            yaw = math.atan2(2.0 * (q["w"] * q["z"] + q["x"] * q["y"]), 1.0 - 2.0 * (q["y"] ** 2 + q["z"] ** 2))
            rows.append((float(pose["position"]["x"]), float(pose["position"]["y"]), yaw))
            times.append(float(stamp["sec"]) + 1e-9 * float(stamp["nanosec"]))
        except (KeyError, TypeError, ValueError):
            expected = "a geometry_msgs/PoseStamped: header.stamp, pose.position, pose.orientation"
            raise TrajectoryError(Problem(f"poses[{i}]", stamped, expected)) from None
    if not rows:
        raise TrajectoryError(Problem("poses", poses, "a list of poses"))
    return stamped_track(np.array(times), np.array(rows))


def _dynobench(data: Mapping[str, Any]) -> Track:
    """The states of a result of dynobench: (x, y, theta) of a first-order robot, with v and omega of another one."""
    result = data.get("result")
    if isinstance(result, list):
        if len(result) != 1 or not isinstance(result[0], dict):
            raise TrajectoryError(Problem("result", Remark(f"{len(result)} robots"), "the result of one robot"))
        data = {**data, **result[0]}
    states = data.get("states")
    width = len(states[0]) if isinstance(states, list) and states and isinstance(states[0], list) else 0
    if not isinstance(states, list) or width not in (3, 5) or any(not _is_state(state, width) for state in states):
        expected = "rows [x, y, theta] or [x, y, theta, v, omega]: a result of dynobench"
        raise TrajectoryError(Problem("states", MISSING if states is None else states, expected))
    rows = np.array(states, dtype=float)
    return Track(_dynobench_step(data, len(rows)) * np.arange(len(rows), dtype=np.float64), *rows.T)


def _is_state(state: object, width: int) -> bool:
    return isinstance(state, list) and len(state) == width and all(map(is_number, state))


def _dynobench_step(data: Mapping[str, Any], rows: int) -> float:
    """The time step of a result: its own, or what its cost (which is its duration) leaves for each step [s]."""
    step = data.get("dt")
    if is_number(step) and step > 0.0:
        return float(step)
    cost = data.get("cost")
    return float(cost) / (rows - 1) if is_number(cost) and cost > 0.0 and rows > 1 else DYNOBENCH_STEP
