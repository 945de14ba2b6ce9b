"""All planners: a row each, and what follows from it.

To add a planner of OMPL, add its row; a compiled kind of its own also needs its growth, see docs/contributing.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from cbrrt_ompl.errors import UnknownPlannerError
from cbrrt_ompl.motion.model import CLOSED_LOOP, OPEN_LOOP, STEERING
from cbrrt_ompl.problem.settings import PlanningSettings


class Backend(Enum):
    """Who runs a planner."""

    COMPILED = "compiled"
    """One compiled loop, without OMPL."""
    PLUGIN = "plugin"
    """OMPL's control::RRT with a directed sampler of ours."""
    OMPL = "ompl"
    """OMPL alone, with its own samplers and settings, on the dynamic motion model."""


class Steering(Enum):
    """What steers an extension."""

    KANAYAMA = "Kanayama law"
    RATES = "three steering rates"
    RANDOM = "random controls"


@dataclass(frozen=True)
class Planner:
    """What there is to know of a planner before it runs."""

    description: str
    """One line of text."""
    backend: Backend
    steering: Steering
    is_robust: bool = False
    """Whether places are passed over the likelier, the more extensions from there have failed."""
    is_anytime: bool = False
    """Whether it goes on after its first plan (in OMPL's own set-up and benchmark its first plan is all there is)."""
    ompl_class: str = "RRT"
    """Name of its class in ``ompl.control``."""

    def law(self, planning: PlanningSettings) -> int:
        """How it drives: `STEERING`, `CLOSED_LOOP` or `OPEN_LOOP` (as OMPL's own planners do)."""
        if self.steering is Steering.RATES:
            return STEERING
        return CLOSED_LOOP if self.steering is Steering.KANAYAMA and planning.closed_loop else OPEN_LOOP


_COMPILED, _PLUGIN, _OMPL = Backend.COMPILED, Backend.PLUGIN, Backend.OMPL
_KANAYAMA, _RATES, _RANDOM = Steering.KANAYAMA, Steering.RATES, Steering.RANDOM

PLANNERS: dict[str, Planner] = {
    "cb-rrt": Planner("CB-RRT of the paper: the Kanayama law in OMPL's control::RRT", _PLUGIN, _KANAYAMA),
    "s-rrt": Planner("S-RRT, the paper's baseline: full speed, three steering rates; kinematic", _PLUGIN, _RATES),
    "cb-rrt-compiled": Planner(
        "CB-RRT as one compiled loop: the same kernels, many times as fast", _COMPILED, _KANAYAMA
    ),
    "s-rrt-compiled": Planner("S-RRT as one compiled loop", _COMPILED, _RATES),
    "cb-rrt-robust": Planner(
        "cb-rrt-compiled that passes over nodes extended in vain: for real maps", _COMPILED, _KANAYAMA, is_robust=True
    ),
    "cb-rrt-anytime": Planner(
        "cb-rrt-robust, and then better and better by optimal control",
        _COMPILED,
        _KANAYAMA,
        is_robust=True,
        is_anytime=True,
    ),
    "rrt": Planner("OMPL's control::RRT with random controls", _OMPL, _RANDOM),
    "kpiece1": Planner("OMPL's KPIECE1", _OMPL, _RANDOM, ompl_class="KPIECE1"),
    "est": Planner("OMPL's expansive space trees", _OMPL, _RANDOM, ompl_class="EST"),
    "sst": Planner("OMPL's stable sparse RRT, ended by its first solution", _OMPL, _RANDOM, ompl_class="SST"),
    "pdst": Planner("OMPL's path-directed subdivision tree", _OMPL, _RANDOM, ompl_class="PDST"),
    "syclop-rrt": Planner("OMPL's Syclop over a 32 x 32 grid, with RRT", _OMPL, _RANDOM, ompl_class="SyclopRRT"),
    "syclop-est": Planner("OMPL's Syclop over a 32 x 32 grid, with EST", _OMPL, _RANDOM, ompl_class="SyclopEST"),
}
"""Known planners by name."""


def planner_named(name: object) -> Planner:
    """The row of a planner.

    Raises:
        UnknownPlannerError: if there is none of this name.
    """
    if not (isinstance(name, str) and name in PLANNERS):
        raise UnknownPlannerError(name, list(PLANNERS))  # type: ignore[arg-type]  # whatever it is
    return PLANNERS[name]


def law_of(name: str, planning: PlanningSettings) -> int:
    """How a planner drives, see :meth:`Planner.law`."""
    return planner_named(name).law(planning)


def is_compiled(name: str) -> bool:
    """Whether a planner is one compiled loop, and needs no OMPL."""
    return planner_named(name).backend is Backend.COMPILED
