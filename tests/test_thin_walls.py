"""A thin wall is never passed, be it of a micrometre, whatever the angle and wherever it stands between two steps."""

from __future__ import annotations

import math

import numpy as np
import pytest
from cbrrt_ompl.collision.clearance_map import ClearanceMap
from kernels import LAWS, roll_out_answered

from cbrrt_ompl.collision.motion_check import BLOCKED, FREE
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.motion.model import CLOSED_LOOP, pack_model
from cbrrt_ompl.planning import plan
from cbrrt_ompl.problem.obstacles import Bounds, OrientedBox
from cbrrt_ompl.problem.robot import Footprint, Limits, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.scenario.scenario import Scenario

THICKNESS = 1e-6
SPEED = 1.0
FOOTPRINTS = {
    "point": Footprint.point(),
    "disc": Footprint.disc(0.1),
    "polygon": Footprint.polygon([(-0.1, -0.05), (0.12, -0.05), (0.12, 0.05), (-0.1, 0.05)]),
}


def wall_through(x: float, y: float, normal: float) -> OrientedBox:
    """A long wall through a point; its normal has this direction."""
    return OrientedBox((x, y), (THICKNESS, 60.0), normal)


def driven_straight(law: int, footprint: Footprint, wall: OrientedBox | None, heading: float) -> tuple[int, float]:
    """Drive 2 m from the origin at 1 m/s, all questions answered by FCL: what came of it and how far it went."""
    model = pack_model(law, Robot(footprint), Goal(9.0, 9.0), PlanningSettings())
    clearance_map = ClearanceMap(World(Bounds((-10.0, -10.0), (10.0, 10.0)), [wall] if wall else []), footprint)
    node = (0.0, 0.0, heading, SPEED, 0.0)
    control = (SPEED, 0.0, 0.0)
    if law == CLOSED_LOOP:
        control = (5.0 * math.cos(heading), 5.0 * math.sin(heading), heading)
    _, outcome, state = roll_out_answered(clearance_map, node, control, model)
    return outcome, math.hypot(*state[:2])


@pytest.mark.parametrize("footprint", FOOTPRINTS.values(), ids=FOOTPRINTS)
@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_no_extension_drives_through_it(law: int, footprint: Footprint) -> None:
    rng = np.random.default_rng(law)
    for heading, tilt, distance in zip(
        rng.uniform(-math.pi, math.pi, 100), rng.uniform(-1.3, 1.3, 100), rng.uniform(0.7, 1.9, 100), strict=True
    ):
        assert driven_straight(law, footprint, None, heading) == (FREE, pytest.approx(2.0))
        wall = wall_through(distance * math.cos(heading), distance * math.sin(heading), heading + tilt)
        outcome, way = driven_straight(law, footprint, wall, heading)
        assert outcome == BLOCKED and way < distance


@pytest.mark.parametrize("planner", ["cb-rrt", "s-rrt", "cb-rrt-compiled", "s-rrt-compiled", "cb-rrt-robust"])
@pytest.mark.parametrize("cut_extension", ["discard", "keep"])
def test_no_tree_grows_through_it(planner: str, cut_extension: str) -> None:
    rng = np.random.default_rng(7)
    for angle, offset in zip(rng.uniform(-math.pi, math.pi, 6), rng.uniform(-0.5, 0.5, 6), strict=True):
        normal = np.array([math.cos(angle), math.sin(angle)])
        x, y = (offset * normal).tolist()
        start, goal = ((offset + side) * normal for side in (-1.5, 1.5))
        scenario = Scenario(
            name="thin wall",
            world=World(Bounds((-3.0, -3.0), (3.0, 3.0)), [wall_through(x, y, angle)]),
            robot=Robot(limits=Limits(0.0, SPEED, -2.0, 2.0, 2.0, 4.0)),
            start=State(*start.tolist(), theta=angle),
            goal=Goal(*goal.tolist(), tolerance=0.5),
            planning=PlanningSettings(max_samples=400, goal_bias=0.5, cut_extension=cut_extension),
        )
        result = plan(scenario, planner, seed=3, time_limit=60.0)
        assert not result.solved
        assert result.nodes > 10
        assert (result.tree.states[:, :2] @ normal).max() < offset
