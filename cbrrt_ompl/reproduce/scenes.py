"""Scenes of the study: the paper's, the same with gaps moved or settings changed, and the package's others."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, NamedTuple

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import Problem, WorldError
from cbrrt_ompl.problem.obstacles import Box
from cbrrt_ompl.scenario.scenario import Scenario

CASE_1, CASE_2, ROOMS = "paper_case1", "paper_case2", "paper_case2_rooms"

TITLES = {
    CASE_1: "Case 1",
    CASE_2: "Case 2",
    ROOMS: "Case 2 as two rooms",
}
"""What the report calls the scenes of the paper; the others go by the names of their files."""

OTHERS = ("office", "maze", "slalom", "dock")
"""Scenes of the package that were made without a look at the planners."""

SHIFTS = (-0.10, -0.05, -0.02, 0.02, 0.05, 0.10)
"""How far the gaps of the paper's scenes are moved along their walls [m]."""

BRIEF_SHIFTS = (-0.05, 0.05)
"""The same in the short report [m]."""


class Reading(NamedTuple):
    """Another way to read what the paper leaves open."""

    title: str
    """What is different, for tables."""
    changes: Mapping[str, Any]
    """Settings of the planners that differ from ours."""
    slow_with: tuple[str, ...] = ()
    """Planners that take seconds to fail under it."""


READINGS = (
    Reading("law evaluated at every step (closed loop)", MappingProxyType({"closed_loop": True})),
    Reading("reference at most 1 m away", MappingProxyType({"look_ahead": 1.0})),
    Reading("reference at the sample itself", MappingProxyType({"look_ahead": 15.0})),
    Reading("horizon 0.5 s", MappingProxyType({"horizon": 0.5, "look_ahead": None})),
    Reading("horizon 1 s", MappingProxyType({"horizon": 1.0, "look_ahead": None})),
    Reading("horizon 2.5 s", MappingProxyType({"horizon": 2.5, "look_ahead": None})),
    Reading("no control refused", MappingProxyType({"equal_control_tolerance": -1.0})),
    Reading("identical controls refused", MappingProxyType({"equal_control_tolerance": 0.0})),
    Reading("goal bias 5 %", MappingProxyType({"goal_bias": 0.05})),
    Reading("free part of a blocked extension kept", MappingProxyType({"cut_extension": "keep"}), ("s-rrt-compiled",)),
)
"""Our reading is: law once an extension, reference at most 2 m away, horizon 2 s, controls within 0.1 refused."""


def title_of(scene: str) -> str:
    """What the report calls a scene."""
    return TITLES.get(scene, scene)


def shift_title(offset: float) -> str:
    """What the report calls gaps that are moved by an offset [m]."""
    return f"gaps {100.0 * offset:+.0f} cm"


def with_gaps_moved(scenario: Scenario, offset: float) -> Scenario:
    """A scene of level walls whose gaps are moved along x; the walls still end at the bounds.

    Args:
        scenario: scene whose obstacles are boxes.
        offset: how far [m].

    Raises:
        WorldError: if an obstacle is no box.
    """
    world = scenario.world
    low, high = world.bounds.min[0], world.bounds.max[0]

    def moved(x: float) -> float:
        return x if x in (low, high) else x + offset

    boxes = []
    for obstacle in world.obstacles:
        if not isinstance(obstacle, Box):
            raise WorldError(Problem("obstacles", type(obstacle).__name__, "boxes only, to move the gaps between them"))
        (x0, y0), (x1, y1) = obstacle.min, obstacle.max
        boxes.append(Box((moved(x0), y0), (moved(x1), y1)))
    return replace(scenario, name=f"{scenario.name}, {shift_title(offset)}", world=World(world.bounds, boxes))


def with_settings(scenario: Scenario, changes: Mapping[str, Any]) -> Scenario:
    """A scene with other settings of the planners."""
    return replace(scenario, planning=replace(scenario.planning, **changes))
