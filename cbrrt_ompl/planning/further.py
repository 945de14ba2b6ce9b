"""How a plan goes on after the first trajectory."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from cbrrt_ompl.errors import Problem, SettingsError
from cbrrt_ompl.planners.registry import Planner

if TYPE_CHECKING:  # a plan that is not improved needs no optimiser
    from cbrrt_ompl.optimise.improving import Found
    from cbrrt_ompl.optimise.objective import Objective


class Further(NamedTuple):
    """What a user says of it, see :func:`cbrrt_ompl.planning.plan`; None where nothing."""

    improve_for: float | None
    max_iterations: int | None
    objective: Objective | None
    callback: Callable[[Found], None] | None
    should_stop: Callable[[], bool] | None

    @property
    def is_open(self) -> bool:
        """Whether neither the time nor the number of steps is given."""
        return self.improve_for is None and self.max_iterations is None

    def check(self, planner: str, row: Planner) -> None:
        """Refuse what makes no sense.

        Raises:
            SettingsError: with all that is wrong.
        """
        if all(value is None for value in self):
            return
        from cbrrt_ompl.optimise.improving import check_improvement
        from cbrrt_ompl.optimise.objective import Objective

        check_improvement(*self, name="improve_for")
        if row.is_bounded and self.objective not in (None, Objective()):
            raise SettingsError(Problem("objective", self.objective, f"None for {planner}, whose cost is the duration"))

    def goes_to_optimiser(self, row: Planner) -> bool:
        """Whether a planner's first trajectory is improved by optimal control."""
        return not row.is_bounded and (row.is_anytime or not self.is_open)
