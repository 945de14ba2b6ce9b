"""Load or compile the kernels before a clock runs."""

from __future__ import annotations

from functools import cache

import numpy as np

from cbrrt_ompl.clearance_map import ClearanceMap
from cbrrt_ompl.compiled.search import Search
from cbrrt_ompl.motion_model import OPEN_LOOP, pack_model
from cbrrt_ompl.robot import Footprint, Robot
from cbrrt_ompl.settings import Goal, PlanningSettings, State
from cbrrt_ompl.world import Bounds, World


@cache
def warm_up(needs_ompl: bool) -> None:
    """Make all kernels ready that a planner needs: some seconds once after installation, milliseconds ever after.

    Args:
        needs_ompl: whether the planner runs in OMPL.
    """
    world = World(Bounds((0.0, 0.0), (1.0, 1.0)))
    model = pack_model(OPEN_LOOP, Robot(), Goal(0.5, 0.5, tolerance=1e-9), PlanningSettings())
    clearance_map = ClearanceMap(world, Footprint.point())
    clearance_map.collides(0.001, 0.001, 0.0)
    start = State(0.5, 0.5)
    search = Search(model, clearance_map, [start], seed=0)
    search.run(lambda _: False, max_samples=20)
    search.trajectory()
    search.tree()
    if needs_ompl:
        from cbrrt_ompl.ompl_plugin.propagators import advance_packed
        from cbrrt_ompl.ompl_plugin.samplers import warm_up_sampler

        advance_packed(np.array(start, dtype=float), 0.0, 0.0, 0.0, model, 0.05)
        warm_up_sampler(model, clearance_map)
