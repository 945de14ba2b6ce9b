"""Load or compile the kernels before a clock runs."""

from __future__ import annotations

from functools import cache

from cbrrt_ompl.collision.world import Bounds, World
from cbrrt_ompl.motion.model import OPEN_LOOP, make_model
from cbrrt_ompl.planners.search import FIRST_CAPACITY, Search
from cbrrt_ompl.problem.robot import Footprint, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State


@cache
def warm_up() -> None:
    """Make all kernels ready that a compiled planner needs: some seconds once after installation, then milliseconds."""
    world = World(Bounds((0.0, 0.0), (100.0, 100.0)))
    model = make_model(OPEN_LOOP, Robot(), Goal(90.0, 90.0, tolerance=1e-9), PlanningSettings())
    search = Search(model, world, Footprint.point(), [State(50.0, 50.0)], seed=0)
    search.run(lambda _: False, max_samples=2 * FIRST_CAPACITY)
    search.trajectory()
    search.tree()
