"""CB-RRT and S-RRT, trajectory planners for two-wheeled robots, inside OMPL's ``control::RRT``.

The names below are looked up when they are first used, so that importing the package costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cbrrt_ompl.collision.world import World
    from cbrrt_ompl.errors import CbrrtError, InputError
    from cbrrt_ompl.maps import OccupancyMap, load_dynobench, load_map, save_map
    from cbrrt_ompl.ompl_plugin.setup import make_setup
    from cbrrt_ompl.optimise import Objective, improve
    from cbrrt_ompl.planning import PlanResult, plan
    from cbrrt_ompl.problem.obstacles import Bounds, Box, Disc, OrientedBox, Polygon
    from cbrrt_ompl.problem.ready_robots import ROBOTS
    from cbrrt_ompl.problem.robot import Footprint, Gains, Limits, Robot
    from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
    from cbrrt_ompl.scenario.scenario import Scenario, load_scenario, save_scenario
    from cbrrt_ompl.trajectory.trajectory import Trajectory
    from cbrrt_ompl.verification import verify

    __version__: str

__all__ = [
    "Bounds",
    "Box",
    "CbrrtError",
    "Disc",
    "Footprint",
    "Gains",
    "Goal",
    "InputError",
    "Limits",
    "Objective",
    "OccupancyMap",
    "OrientedBox",
    "PlanResult",
    "PlanningSettings",
    "Polygon",
    "ROBOTS",
    "Robot",
    "Scenario",
    "State",
    "Trajectory",
    "World",
    "__version__",
    "improve",
    "load_dynobench",
    "load_map",
    "load_scenario",
    "make_setup",
    "plan",
    "save_map",
    "save_scenario",
    "verify",
]

_MODULES = {
    "collision.world": ("World",),
    "errors": ("CbrrtError", "InputError"),
    "ompl_plugin.setup": ("make_setup",),
    "optimise": ("Objective", "improve"),
    "planning": ("PlanResult", "plan"),
    "problem.obstacles": ("Bounds", "Box", "Disc", "OrientedBox", "Polygon"),
    "problem.ready_robots": ("ROBOTS",),
    "problem.robot": ("Footprint", "Gains", "Limits", "Robot"),
    "problem.settings": ("Goal", "PlanningSettings", "State"),
    "maps": ("OccupancyMap", "load_dynobench", "load_map", "save_map"),
    "scenario.scenario": ("Scenario", "load_scenario", "save_scenario"),
    "trajectory.trajectory": ("Trajectory",),
    "verification": ("verify",),
}
_HOME = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Look a public name up in the module that defines it, once."""
    value: object
    if name == "__version__":
        value = _installed_version()
    elif name in _HOME:
        value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def _installed_version() -> str:
    """The version of the installed distribution; a checkout on the path alone has none."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("cbrrt-ompl")
    except PackageNotFoundError:
        return "0+unknown"


def __dir__() -> list[str]:
    """The public names, whether looked up already or not."""
    return sorted({*globals(), *__all__})
