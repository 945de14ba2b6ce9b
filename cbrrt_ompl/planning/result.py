"""What a plan returns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, TypeVar

from cbrrt_ompl.planners.first_plan import FirstPlan
from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.shown import Shown
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.trajectory.tree import Tree

if TYPE_CHECKING:  # a plan that is not improved needs no optimiser
    from cbrrt_ompl.optimise.improving import Found

SOLVED, TIME_LIMIT, SAMPLE_LIMIT, NO_WAY = "solved", "time limit", "sample limit", "no way"
"""How a plan ends."""

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class PlanResult(Shown):
    """The result of a plan."""

    planner: str
    """The planner's name."""
    seed: int | None
    """The seed that was asked for."""
    status: str
    """``solved``, ``time limit``, ``sample limit``, or ``no way`` where that is proven."""
    trajectory: Trajectory | None
    """From the start into the goal region; None where not solved."""
    count_nodes: Callable[[], int] = field(repr=False)
    """Counts the nodes in the planner's memory."""
    samples: int
    """Samples drawn; for OMPL's own planners the rounds of their main loop."""
    planning_time: float
    """Time of the search and the improvement alone, without set-up and compilation [s]."""
    make_tree: Callable[[], Tree] = field(repr=False)
    """Makes the tree out of the planner's memory."""
    history: tuple[Found, ...] = ()
    """When which trajectory was found, each better than the one before: rows of (time [s], duration [s], source)."""
    scenario: Scenario | None = None
    """What it was planned for; None where nobody said."""

    def __repr__(self) -> str:
        """Planner, status, what it took, and the trajectory."""
        found = "" if self.trajectory is None else f", {self.trajectory!r}"
        took = f"{self.samples:,} samples, {1e3 * self.planning_time:.2f} ms"
        return f"PlanResult({self.planner}, {self.status}, {took}{found})"

    @property
    def solved(self) -> bool:
        """Whether there is a trajectory into the goal region."""
        return self.status == SOLVED

    @cached_property
    def nodes(self) -> int:
        """Nodes of the tree; counted when first asked for, since OMPL copies a tree to count it."""
        return self.count_nodes()

    @cached_property
    def tree(self) -> Tree:
        """All nodes and edges; made when first asked for."""
        return self.make_tree()

    def __getstate__(self) -> dict[str, Any]:
        """What is pickled: the tree itself and its size instead of the planner's memory."""
        kept = {"make_tree": partial(given, self.tree), "count_nodes": partial(given, self.nodes)}
        return {**self.__dict__, **kept}


def result_of(found: FirstPlan, planner: str, seed: int | None, status: str) -> PlanResult:
    """The result of a planner.

    Args:
        found: what it came back with.
        planner: its name.
        seed: that was asked for.
        status: why it ended, if it has no trajectory.
    """
    return PlanResult(planner, seed, status if found.trajectory is None else SOLVED, *found)


def given(value: T) -> T:
    """The value itself: a function of no arguments that can be pickled is made of it."""
    return value
