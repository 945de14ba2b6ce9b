"""OMPL's planners as tests run them: for a number of rounds, which no clock has a say in."""

from __future__ import annotations

from typing import Any

from cbrrt_ompl.ompl_plugin.binding import ob, ou


def solve(setup: Any, rounds: int = 20_000, seed: int | None = 1) -> str:
    """Solve until solved or for a number of rounds of the planner's main loop; the status in words.

    Args:
        setup: an ``ompl.control.SimpleSetup``.
        rounds: how many.
        seed: of OMPL's random numbers; None goes on with those that there are.
    """
    if seed is not None:
        ou.RNG.setSeed(seed)
    left = iter(range(rounds))
    condition = ob.PlannerTerminationConditionFn(lambda: next(left, None) is None)
    status: str = setup.solve(ob.PlannerTerminationCondition(condition)).asString()
    return status
