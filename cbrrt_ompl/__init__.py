"""CB-RRT and S-RRT, trajectory planners for two-wheeled robots, inside OMPL's ``control::RRT``.

The names below are looked up when they are first used, so that importing the package costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from cbrrt_ompl.one_libompl import load_one_libompl
from cbrrt_ompl.shown import show_by

if TYPE_CHECKING:
    from cbrrt_ompl.collision.world import World
    from cbrrt_ompl.errors import CbrrtError, InputError, OmplMissingError
    from cbrrt_ompl.export.following import follow
    from cbrrt_ompl.maps import OccupancyMap, load_dynobench, load_map, save_map
    from cbrrt_ompl.motion.laws import register_law
    from cbrrt_ompl.ompl_plugin.duration_objective import DurationObjective
    from cbrrt_ompl.ompl_plugin.own_sampler import with_directed_sampler
    from cbrrt_ompl.ompl_plugin.propagators import TwoWheelPropagator
    from cbrrt_ompl.ompl_plugin.results import trajectory_from_path
    from cbrrt_ompl.ompl_plugin.samplers import KanayamaDirectedControlSampler, SteeringDirectedControlSampler
    from cbrrt_ompl.ompl_plugin.setup import make_setup
    from cbrrt_ompl.ompl_plugin.space import make_control_space, make_state_space, read_state, write_state
    from cbrrt_ompl.ompl_plugin.validity import FclStateValidityChecker
    from cbrrt_ompl.optimise import Objective, improve
    from cbrrt_ompl.planning import PlanResult, plan
    from cbrrt_ompl.problem.obstacles import Bounds, Box, Disc, OrientedBox, Polygon
    from cbrrt_ompl.problem.ready_robots import ROBOTS
    from cbrrt_ompl.problem.robot import Footprint, Gains, Limits, Robot
    from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
    from cbrrt_ompl.scenario.scenario import Scenario, load_scenario, save_scenario
    from cbrrt_ompl.trajectory.foreign import load_track
    from cbrrt_ompl.trajectory.track import Track
    from cbrrt_ompl.trajectory.trajectory import Trajectory
    from cbrrt_ompl.verification import verify

    __version__: str

__all__ = [
    "Bounds",
    "Box",
    "CbrrtError",
    "Disc",
    "DurationObjective",
    "FclStateValidityChecker",
    "Footprint",
    "Gains",
    "Goal",
    "InputError",
    "KanayamaDirectedControlSampler",
    "Limits",
    "Objective",
    "OccupancyMap",
    "OmplMissingError",
    "OrientedBox",
    "PlanResult",
    "PlanningSettings",
    "Polygon",
    "ROBOTS",
    "Robot",
    "Scenario",
    "State",
    "SteeringDirectedControlSampler",
    "Track",
    "Trajectory",
    "TwoWheelPropagator",
    "World",
    "__version__",
    "follow",
    "improve",
    "load_dynobench",
    "load_map",
    "load_scenario",
    "load_track",
    "make_control_space",
    "make_setup",
    "make_state_space",
    "plan",
    "read_state",
    "register_law",
    "save_map",
    "save_scenario",
    "trajectory_from_path",
    "verify",
    "with_directed_sampler",
    "write_state",
]

_MODULES = {
    "collision.world": ("World",),
    "errors": ("CbrrtError", "InputError", "OmplMissingError"),
    "export.following": ("follow",),
    "maps": ("OccupancyMap", "load_dynobench", "load_map", "save_map"),
    "motion.laws": ("register_law",),
    "ompl_plugin.duration_objective": ("DurationObjective",),
    "ompl_plugin.own_sampler": ("with_directed_sampler",),
    "ompl_plugin.propagators": ("TwoWheelPropagator",),
    "ompl_plugin.results": ("trajectory_from_path",),
    "ompl_plugin.samplers": ("KanayamaDirectedControlSampler", "SteeringDirectedControlSampler"),
    "ompl_plugin.setup": ("make_setup",),
    "ompl_plugin.space": ("make_control_space", "make_state_space", "read_state", "write_state"),
    "ompl_plugin.validity": ("FclStateValidityChecker",),
    "optimise": ("Objective", "improve"),
    "planning": ("PlanResult", "plan"),
    "problem.obstacles": ("Bounds", "Box", "Disc", "OrientedBox", "Polygon"),
    "problem.ready_robots": ("ROBOTS",),
    "problem.robot": ("Footprint", "Gains", "Limits", "Robot"),
    "problem.settings": ("Goal", "PlanningSettings", "State"),
    "scenario.scenario": ("Scenario", "load_scenario", "save_scenario"),
    "trajectory.foreign": ("load_track",),
    "trajectory.track": ("Track",),
    "trajectory.trajectory": ("Trajectory",),
    "verification": ("verify",),
}
_HOME = {name: module for module, names in _MODULES.items() for name in names}

load_one_libompl()


def _png_of(value: object) -> bytes | None:
    """What a value shows of itself in a notebook; matplotlib is imported when the first one does."""
    from cbrrt_ompl.figures.notebook import png_of

    return png_of(value)


show_by(_png_of)


def __getattr__(name: str) -> Any:
    """Look a public name up in the module that defines it, once."""
    value: object
    if name == "__version__":
        value = _installed_version()
    elif name in _HOME:
        value = _public_value(name)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def _public_value(name: str) -> object:
    """A public name's value; where it needs OMPL and there is none, what says so when it is used."""
    from cbrrt_ompl.errors import OmplMissingError

    try:
        return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    except OmplMissingError:
        from cbrrt_ompl.ompl_plugin.availability import Absent

        return Absent(name)


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
