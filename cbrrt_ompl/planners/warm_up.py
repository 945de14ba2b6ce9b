"""Load or compile the kernels before a clock runs."""

from __future__ import annotations

import math
from functools import cache

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.kernels.beside import compiled_beside, is_kept
from cbrrt_ompl.motion.model import OPEN_LOOP, make_model
from cbrrt_ompl.motion.records import record_array
from cbrrt_ompl.planners.growth import grow
from cbrrt_ompl.planners.nearest import GRID, make_index, nearest
from cbrrt_ompl.planners.reachable import reachable_cells
from cbrrt_ompl.planners.roll_out import STEPS, can_brake, free_steps
from cbrrt_ompl.planners.search import FIRST_CAPACITY, Search
from cbrrt_ompl.problem.obstacles import Bounds
from cbrrt_ompl.problem.robot import Footprint, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State


@cache
def warm_up() -> None:
    """Make all kernels ready that a compiled planner needs: some seconds once after installation, then milliseconds.

    Where they are on the disk, only those that every plan calls are loaded.
    """
    world = World(Bounds((0.0, 0.0), (100.0, 100.0)))
    model = make_model(OPEN_LOOP, Robot(), Goal(90.0, 90.0, tolerance=1e-9), PlanningSettings())
    search = Search(model, world, Footprint.point(), [State(50.0, 50.0)], seed=0)
    if not is_kept(grow):
        with compiled_beside(__name__, "warm_up_roll_out", grow):
            nearest(make_index(GRID, world.bounds, FIRST_CAPACITY), 50.0, 50.0, 0, math.inf, math.inf)
            search.tree()
            reachable_cells(world.scene(Footprint.disc(0.5)), [State(50.0, 50.0)])
            free_steps(record_array(1, STEPS)[0], 0, True, 0.0, True, world.scene(Footprint.point()), model[0])
    search.trajectory()  # before the next line: where the last kernel is on the disk, all are
    search.run(lambda _: False, max_samples=2 * FIRST_CAPACITY)


def warm_up_roll_out() -> None:
    """Make the kernels ready that drive a robot and look at its way: a half of all."""
    scene = World(Bounds((0.0, 0.0), (100.0, 100.0))).scene(Footprint.point())
    model = make_model(OPEN_LOOP, Robot(), Goal(90.0, 90.0, tolerance=1e-9), PlanningSettings())
    can_brake((50.0, 50.0, 0.0, 1.0, 0.0), 0.0, True, scene, model[0], record_array(1, STEPS)[0])
