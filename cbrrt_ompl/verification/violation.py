"""One broken condition, and the sentence that says where, when and by how much."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cbrrt_ompl.trajectory.displacement import wrapped

UNITS = {"x": "m", "y": "m", "theta": "rad", "v": "m/s", "omega": "rad/s"}
"""Units of the values of a state."""


@dataclass(frozen=True)
class Violation:
    """One condition that a trajectory breaks, once or for a while."""

    kind: str
    """What is broken: ``start``, ``goal``, ``velocity``, ``command``, ``acceleration``, ``wheel speed``, ``wheel
    acceleration``, ``motion``, ``collision`` or ``sampling``."""
    time: float
    """When it is broken first [s]."""
    message: str
    """What was found there and what was expected, in one line."""
    count: int = 1
    """How many rows, steps or states break it."""
    last_time: float = math.nan
    """When it is broken last [s]."""


def broken_condition(
    kind: str,
    text: str,
    limit: str,
    figures: ArrayLike,
    broken: NDArray[np.bool_],
    times: NDArray[np.float64],
    noun: str,
    excess: ArrayLike | None = None,
) -> Iterator[Violation]:
    """The violation of one condition, if there is one.

    Args:
        kind: kind of the violation.
        text: what was found, with ``{}`` for the figure of the first time.
        limit: what was expected.
        figures: the figures found, shape (n,).
        broken: where the condition is broken, shape (n,).
        times: when, shape (n,) [s].
        noun: what is counted.
        excess: how far the figures are off, shape (n,); their magnitudes if not given.
    """
    where = np.flatnonzero(broken)
    if not len(where):
        return
    found = np.asarray(figures, dtype=float)[where]
    first, last = float(times[where[0]]), float(times[where[-1]])
    message = f"{kind}: {text.format(f'{found[0]:.6g}')} at t = {first:.6g} s, {limit}"
    if len(where) > 1:
        worst = found[np.argmax(np.abs(found) if excess is None else np.asarray(excess)[where])]
        message += f" ({len(where)} {noun}, until t = {last:.6g} s, worst {worst:.6g})"
    yield Violation(kind, first, message, len(where), last)


def rates_text(faster: float, slower: float) -> str:
    """An acceleration and its deceleration, one number where they are the same."""
    return f"{faster:.6g}" if faster == slower else f"{faster:.6g} (slowing down {slower:.6g})"


def place(pose: Sequence[float] | NDArray[np.float64]) -> str:
    """A pose in words."""
    x, y, theta = pose
    return f"({x:.6g} m, {y:.6g} m, {float(wrapped(theta)):.6g} rad)"
