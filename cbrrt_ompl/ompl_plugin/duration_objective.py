"""The duration of a path as an objective of OMPL's."""

from __future__ import annotations

from typing import Any

from cbrrt_ompl.ompl_plugin.binding import ob


class DurationObjective(ob.OptimizationObjective):  # type: ignore[misc]  # OMPL has no type information
    """Time to drive a path [s]: each motion between two states of it lasts an integration step.

    It judges the states of whole control paths, as ``path.asGeometric().cost(objective)`` does. Planners of OMPL's that
    ask for the cost of a single motion get a step for each.
    """

    def __init__(self, si: Any, threshold: float = 0.0) -> None:
        """Take over the step.

        Args:
            si: the space information.
            threshold: duration that is good enough to end with [s].
        """
        super().__init__(si)
        self._si = si
        self.setCostThreshold(ob.Cost(threshold))

    def stateCost(self, state: Any) -> Any:  # noqa: N802  # OMPL's name
        """Nothing."""
        return ob.Cost(0.0)

    def motionCost(self, first: Any, second: Any) -> Any:  # noqa: N802  # OMPL's name
        """An integration step [s]."""
        return ob.Cost(self._si.getPropagationStepSize())
