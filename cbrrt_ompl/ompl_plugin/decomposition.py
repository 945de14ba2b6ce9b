"""The workspace grid that OMPL's Syclop planners search first."""

from __future__ import annotations

from typing import Any

from cbrrt_ompl.collision.world import Bounds
from cbrrt_ompl.ompl_plugin.binding import ob, oc

CELLS_PER_SIDE = 32
"""Cells of the grid along each axis, as in OMPL's own Syclop demo."""


class PositionDecomposition(oc.GridDecomposition):  # type: ignore[misc]  # OMPL has no type information
    """A grid over (x, y)."""

    def __init__(self, bounds: Bounds) -> None:
        """Lay the grid over the bounds."""
        limits = ob.RealVectorBounds(2)
        for i in range(2):
            limits.setLow(i, bounds.min[i])
            limits.setHigh(i, bounds.max[i])
        super().__init__(CELLS_PER_SIDE, 2, limits)
        self._bounds = bounds

    def project(self, state: Any, coord: Any) -> None:
        """Position of a state; the nearest one in the grid where it is outside, where OMPL would not find a cell."""
        position, low, high = state[0], self._bounds.min, self._bounds.max
        coord[0], coord[1] = min(max(position[0], low[0]), high[0]), min(max(position[1], low[1]), high[1])

    def sampleFullState(self, sampler: Any, coord: Any, state: Any) -> None:  # noqa: N802  # OMPL's name
        """A random state at a given position."""
        sampler.sampleUniform(state)
        position = state[0]
        position[0], position[1] = coord[0], coord[1]
