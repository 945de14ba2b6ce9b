"""plan: from a scenario to a drivable trajectory; its parts, and the only place that assembles them."""

from __future__ import annotations

from cbrrt_ompl.planning.first import approachable_goal
from cbrrt_ompl.planning.planning import available_planners, plan, warm_up_improvement, warm_up_planner
from cbrrt_ompl.planning.result import NO_WAY, SAMPLE_LIMIT, SOLVED, TIME_LIMIT, PlanResult

__all__ = [
    "NO_WAY",
    "SAMPLE_LIMIT",
    "SOLVED",
    "TIME_LIMIT",
    "PlanResult",
    "approachable_goal",
    "available_planners",
    "plan",
    "warm_up_improvement",
    "warm_up_planner",
]
