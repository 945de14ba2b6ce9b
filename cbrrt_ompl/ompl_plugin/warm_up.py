"""Load or compile the kernels behind OMPL's calls before a clock runs."""

from __future__ import annotations

from functools import cache

import numpy as np

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.motion.model import OPEN_LOOP, make_model
from cbrrt_ompl.ompl_plugin.compiled_methods import use_compiled_methods
from cbrrt_ompl.ompl_plugin.extender import warm_up_extender
from cbrrt_ompl.ompl_plugin.propagators import advance_values
from cbrrt_ompl.problem.obstacles import Bounds
from cbrrt_ompl.problem.robot import Footprint, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State


@cache
def warm_up() -> None:
    """Make all kernels ready that the plugin needs besides those of the compiled planners."""
    scene = World(Bounds((0.0, 0.0), (1.0, 1.0))).scene(Footprint.point())
    model = make_model(OPEN_LOOP, Robot(), Goal(0.5, 0.5, tolerance=1e-9), PlanningSettings())
    advance_values(np.array(State(0.5, 0.5), dtype=float), 0.0, 0.0, 0.0, model, 0.05)
    warm_up_extender(model, scene)
    use_compiled_methods()
