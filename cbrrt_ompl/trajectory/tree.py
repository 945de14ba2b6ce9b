"""The tree that a planner grew, for figures and statistics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.errors import InputError, Problem


@dataclass(frozen=True, eq=False)
class Tree:
    """Nodes and edges of a tree; the arrays are copied and read-only.

    Raises:
        InputError: with every array of the wrong shape, and if a parent is no node.
    """

    states: NDArray[np.float64]
    """Rows of (x, y, theta, v, omega), one a node, shape (n, 5) [m, m, rad, m/s, rad/s]."""
    parents: NDArray[np.int64]
    """Index of each node's parent, -1 at the root, shape (n,)."""
    polyline: NDArray[np.float64]
    """Points of all edges, the edges separated by rows of NaN, shape (m, 2) [m]."""

    def __post_init__(self) -> None:
        """Check, copy and freeze the arrays."""
        states, polyline = np.array(self.states, dtype=np.float64), np.array(self.polyline, dtype=np.float64)
        parents: NDArray[Any] = np.array(self.parents)
        problems = [
            Problem(f"tree.{name}", f"shape {array.shape}", f"shape {shape}")
            for name, array, fits, shape in (
                ("states", states, states.ndim == 2 and states.shape[1] == 5, "(n, 5)"),
                ("parents", parents, parents.shape == states.shape[:1], "(n,), as many as states"),
                ("polyline", polyline, polyline.ndim == 2 and polyline.shape[1] == 2, "(m, 2)"),
            )
            if not fits
        ]
        if not problems and len(parents) and parents.dtype.kind not in "iu":
            problems.append(Problem("tree.parents", str(parents.dtype), "whole numbers"))
        if not problems and len(parents) and not (-1 <= parents.min() and parents.max() < len(parents)):
            problems.append(Problem("tree.parents", [parents.min(), parents.max()], f"-1 to {len(parents) - 1}"))
        if problems:
            raise InputError(problems)
        for name, array in (("states", states), ("parents", parents.astype(np.int64)), ("polyline", polyline)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        """Number of nodes."""
        return len(self.states)
