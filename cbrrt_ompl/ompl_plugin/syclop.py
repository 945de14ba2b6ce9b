"""OMPL's Syclop planners, with the status that their path has."""

from __future__ import annotations

from typing import Any

from cbrrt_ompl.ompl_plugin.binding import ob, oc


class ToldApart:
    """To be derived from together with a Syclop planner, before it: approximate solutions are called so.

    OMPL's own ``solve`` calls them exact.
    """

    def solve(self, *condition: Any) -> Any:
        """Solve; the status is EXACT_SOLUTION only where the problem definition has an exact one."""
        status = super().solve(*condition)  # type: ignore[misc]  # OMPL's
        problem = self.getProblemDefinition()  # type: ignore[attr-defined]  # OMPL's
        if bool(status) and not problem.hasExactSolution():
            return ob.PlannerStatus(ob.PlannerStatus.APPROXIMATE_SOLUTION)
        return status


class SyclopRRT(ToldApart, oc.SyclopRRT):  # type: ignore[misc]  # OMPL has no type information
    """``ompl.control.SyclopRRT``."""


class SyclopEST(ToldApart, oc.SyclopEST):  # type: ignore[misc]  # OMPL has no type information
    """``ompl.control.SyclopEST``."""


SYCLOP: dict[str, type[Any]] = {"SyclopRRT": SyclopRRT, "SyclopEST": SyclopEST}
"""The planners by the names of OMPL's classes."""
