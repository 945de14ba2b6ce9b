"""The columns of a trajectory, and what is wrong with some arrays as such."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cbrrt_ompl.errors import Problem, TrajectoryError

COLUMNS = ("t", "x", "y", "theta", "v", "omega", "v_command", "omega_command")
"""The arrays of a trajectory, in the order of the CSV header."""


def column(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """A copy of the values as floats.

    Raises:
        TrajectoryError: if they are no array of real numbers.
    """
    try:
        array = np.asarray(values)
    except ValueError:
        array = np.empty(0, dtype=object)
    if array.dtype.kind not in "fiu" or array.ndim != 1:
        raise TrajectoryError(Problem(name, values, "a one-dimensional array of numbers"))
    return array.astype(np.float64)


def column_problems(arrays: Mapping[str, NDArray[np.float64]], place: Callable[[str, int], str]) -> list[Problem]:
    """What keeps the arrays from being a trajectory.

    Args:
        arrays: the columns by name, one-dimensional.
        place: name for messages of the value in a column and a row.
    """
    rows = len(arrays["t"])
    if rows == 0:
        return [Problem("t", [], "at least one row")]
    found = [
        Problem(name, f"{len(array)} values", f"{rows} values, as many as t")
        for name, array in arrays.items()
        if len(array) != rows
    ]
    for name, array in arrays.items():
        for row in np.flatnonzero(~np.isfinite(array))[:1]:
            found.append(Problem(place(name, row), float(array[row]), "a finite number"))
    if not found:
        t = arrays["t"]
        for row in np.flatnonzero(t[1:] <= t[:-1])[:1] + 1:
            found.append(Problem(place("t", row), float(t[row]), f"a time above {float(t[row - 1])!r}, the one before"))
    return found
