"""Load or compile the kernels before a clock runs."""

from __future__ import annotations

from functools import cache

from cbrrt_ompl.collision.world import Bounds, World
from cbrrt_ompl.motion.model import OPEN_LOOP, make_model
from cbrrt_ompl.planners.search import Search
from cbrrt_ompl.problem.robot import Footprint, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State


@cache
def warm_up() -> None:
    """Make all kernels ready that a compiled planner needs: some seconds once after installation, then milliseconds."""
    world = World(Bounds((0.0, 0.0), (1.0, 1.0)))
    model = make_model(OPEN_LOOP, Robot(), Goal(0.5, 0.5, tolerance=1e-9), PlanningSettings())
    search = Search(model, world, Footprint.point(), [State(0.5, 0.5)], seed=0)
    search.run(lambda _: False, max_samples=20)
    search.trajectory()
    search.tree()
