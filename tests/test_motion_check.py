"""A motion is free between its states too: no wall is passed, be it of a millimetre."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from kernels import (
    FOOTPRINTS,
    LAWS,
    POINT,
    RATES,
    WIDE,
    between,
    crowded_world,
    drive,
    free_nodes,
    headings,
    model_of,
    nodes,
    roll_out_free,
    samples,
    states_of,
)
from numpy.typing import NDArray

from cbrrt_ompl.collision.clearance import clearances_at
from cbrrt_ompl.collision.motion_check import MOTION_RESOLUTION, is_free
from cbrrt_ompl.collision.scene import Scene
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.motion.model import OPEN_LOOP, ROOM, STEERING
from cbrrt_ompl.motion.records import Records
from cbrrt_ompl.planners.extension import BLOCKED, EXTENDED
from cbrrt_ompl.planners.roll_out import MOTION_BLOCKED, margin_at
from cbrrt_ompl.planners.search import Search
from cbrrt_ompl.planning import plan
from cbrrt_ompl.problem.obstacles import Bounds, Box, OrientedBox
from cbrrt_ompl.problem.robot import Footprint, Limits, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.scenario.scenario import Scenario


class TestThinWalls:
    @pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
    @pytest.mark.parametrize("cut", ["discard", "keep"])
    @given(
        node=nodes,
        sample=samples,
        shape=st.sampled_from(list(FOOTPRINTS)),
        at=st.integers(0, 39),
        share=st.floats(0.0, 1.0),
        angle=headings,
        length=st.sampled_from([0.001, 0.05, 1.0, 30.0]),
    )
    @settings(max_examples=60)
    def test_a_wall_of_a_millimetre_is_never_passed(
        self,
        law: int,
        cut: str,
        node: State,
        sample: tuple[float, float],
        shape: str,
        at: int,
        share: float,
        angle: float,
        length: float,
    ) -> None:
        """The wall stands across the way that is driven without it, at any angle, between any two steps."""
        model = model_of(law, cut_extension=cut)
        free = drive(WIDE, node, sample, model)
        states, at = states_of(node, free, model), min(at, free.steps - 1)
        x, y, _ = between(states[at], states[at + 1], share, model)
        world = World(Bounds((-20.0, -20.0), (20.0, 20.0)), [OrientedBox((x, y), (length, 0.001), angle)])
        assume(not world.collides(FOOTPRINTS[shape], node[:3]))
        others = [(1.0, rate) for rate in RATES if law == STEERING and rate != free.command[1]]
        found = drive(world.scene(FOOTPRINTS[shape]), node, sample, model, others)
        if cut == "discard" or found.steps == 0:
            assert (found.outcome, found.steps) == (BLOCKED, 0)
        else:
            assert found.steps <= at
            assert found.state == tuple(states[found.steps])

    @pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
    @pytest.mark.parametrize("angle", [0.0, 0.3, math.pi / 2.0, 2.0])
    def test_no_tree_grows_through_a_wall_of_a_millimetre(self, law: int, angle: float) -> None:
        world = World(Bounds((-4.0, -4.0), (4.0, 4.0)), [OrientedBox((0.0, 0.0), (20.0, 0.001), angle)])
        normal = np.array([-math.sin(angle), math.cos(angle)])
        model = model_of(law, cut_extension="keep", horizon=0.5)
        search = Search(model, world, POINT, [State(*(-2.0 * normal), angle)], seed=3)
        search.run(lambda _: False, 3000)
        sides = search.edges()[0][:, :2] @ normal
        assert search.nodes > 200
        assert sides.max() < -0.0005
        assert sides.max() > -0.06  # the wall was reached


@pytest.mark.parametrize("law", [OPEN_LOOP, STEERING])
def test_no_corner_turns_into_a_wall_beside_the_start(law: int) -> None:
    """A start with less than `ROOM` has no margin; it was taken for one of the origin alone, which does not turn."""
    square = Footprint.polygon([(-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1)])
    world = World(Bounds((-1.0, -1.0), (1.0, 1.0)), [Box((0.1 + 0.6 * ROOM, -1.0), (0.3, 1.0))])
    assert not world.collides(square, (0.0, 0.0, 0.0))
    steps, outcome, _ = roll_out_free(world.scene(square), State(0.0, 0.0), (0.0, 0.5, 0.0), model_of(law))
    assert (steps, outcome) == (0, MOTION_BLOCKED)


@pytest.mark.parametrize("footprint", FOOTPRINTS.values(), ids=FOOTPRINTS)
@pytest.mark.parametrize("settings", [{}, {"brake_safe": True}, {"cut_extension": "keep"}], ids=str)
@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_nodes_know_their_own_margin_or_none(footprint: Footprint, law: int, settings: dict[str, object]) -> None:
    """A motion leaves it to the node at its end, where it has looked there."""
    world = crowded_world()
    scene, model = world.scene(footprint), model_of(law, horizon=0.7, **settings)
    search = Search(model, world, footprint, free_nodes(world, footprint, 20, seed=1), seed=2)
    search.run(lambda _: False, 1000)
    known = search._tree[: search.nodes][search._tree["margin"][: search.nodes] >= 0.0]
    assert len(known) > 10
    for node in known:
        margin = margin_at(node["x"], node["y"], node["theta"], scene, model["room"][0])
        assert (node["margin"], node["any_heading"]) == margin


def free_steps(scene: Scene, states: NDArray[np.float64], model: Records) -> int:
    """Steps of which every point `MOTION_RESOLUTION` apart has room, one after the other, all looked at."""
    reach, dt, room = scene.frame["reach"][0], model["dt"][0], model["room"][0]
    for step, (a, b) in enumerate(zip(states[:-1], states[1:], strict=True)):
        v, omega = b[3:] if model["law"][0] == STEERING else a[3:]
        way = (max(abs(v), abs(b[3])) + reach * max(abs(omega), abs(b[4]))) * dt
        points = int(way / MOTION_RESOLUTION) + 1
        poses = [between(a, b, point / points, model) for point in range(1, points)] + [list(b[:3])]
        if clearances_at(scene, np.array(poses)).min() <= room:
            return step
    return len(states) - 1


@pytest.mark.parametrize("footprint", FOOTPRINTS.values(), ids=FOOTPRINTS)
@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
class TestExtensions:
    def test_what_is_accepted_depends_on_the_points_alone(self, footprint: Footprint, law: int) -> None:
        """Margins spare most of them, and change nothing."""
        scene, rng = crowded_world().scene(footprint), np.random.default_rng(8)
        model, whole, counts = model_of(law, cut_extension="keep", horizon=1.0), model_of(law, horizon=1.0), []
        is_whole: list[bool] = []
        for node in free_nodes(crowded_world(), footprint, 60, seed=9):
            sample = tuple(rng.uniform(-2.0, 2.0, 2).tolist())
            found, length = drive(scene, node, sample, model), drive(WIDE, node, sample, model).steps
            if found.outcome == BLOCKED:
                counts.append(0)
            else:
                states = states_of(node, found._replace(steps=length), model)
                counts.append(found.steps)
                assert found.steps == free_steps(scene, states, model)
            is_whole.append(counts[-1] == length)
            if law != STEERING:  # which chooses among three
                assert (drive(scene, node, sample, whole).outcome == EXTENDED) == is_whole[-1]
        assert sum(is_whole) >= 10
        assert len(is_whole) - sum(is_whole) >= 10

    @pytest.mark.parametrize("cut", ["discard", "keep"])
    def test_every_way_is_free_between_its_steps_too(self, footprint: Footprint, law: int, cut: str) -> None:
        world, rng = crowded_world(), np.random.default_rng(12)
        scene, collides = world.scene(footprint), world.referee(footprint).collides
        model, longest = model_of(law, cut_extension=cut), 0
        for node in free_nodes(world, footprint, 40, seed=13):
            found = drive(scene, node, tuple(rng.uniform(-2.0, 2.0, 2).tolist()), model)
            if found.outcome == EXTENDED:
                longest = max(longest, found.steps)
                states = states_of(node, found, model)
                for a, b in zip(states[:-1], states[1:], strict=True):
                    assert not collides(*b[:3])
                    assert not collides(*between(a, b, 0.5, model))
        assert longest == 40

    def test_a_kept_way_cannot_be_driven_a_step_further(self, footprint: Footprint, law: int) -> None:
        world, rng = crowded_world(), np.random.default_rng(14)
        scene = world.scene(footprint)
        model, cut = model_of(law, cut_extension="keep"), 0
        for node in free_nodes(world, footprint, 40, seed=15):
            sample = tuple(rng.uniform(-2.0, 2.0, 2).tolist())
            found = drive(scene, node, sample, model)
            if found.outcome != EXTENDED or found.steps == drive(WIDE, node, sample, model).steps:
                continue
            cut += 1
            a, b = states_of(node, found._replace(steps=found.steps + 1), model)[-2:]
            poses = np.array([between(a, b, share, model) for share in np.linspace(0.005, 1.0, 200)])
            assert clearances_at(scene, poses).min() < 1.1 * ROOM
        assert cut >= 5


class TestRowsOfStates:
    HALL = Bounds((0.0, 0.0), (8.0, 4.0))

    @pytest.mark.parametrize("footprint", FOOTPRINTS.values(), ids=FOOTPRINTS)
    def test_every_plan_is_free(self, footprint: Footprint) -> None:
        world = World(self.HALL, [Box((4.0, 0.0), (4.2, 1.6)), Box((4.0, 2.4), (4.2, 4.0))])
        scenario = Scenario(
            name="hall",
            world=world,
            robot=Robot(footprint, Limits(0.0, 1.0, -1.0, 1.0, 0.6, 2.0)),
            start=State(0.8, 2.0),
            goal=Goal(7.2, 2.0, tolerance=0.4),
            planning=PlanningSettings(horizon=1.5, step=0.05),
        )
        for seed in range(5):
            found = plan(scenario, "cb-rrt-robust", seed=seed).trajectory
            assert found is not None
            assert is_free(found.states, 0.05, world.scene(footprint))

    @given(st.floats(0.001, 7.999), st.floats(0.0, 6.28))
    def test_a_thin_wall_between_two_of_them_is_seen(self, x: float, angle: float) -> None:
        """The wall is 1.1 mm thick, and the steps are 5 cm long."""
        state = State(4.0 - math.cos(angle), 2.0 - math.sin(angle), angle, 1.0)
        steps = np.arange(41) * 0.05
        rows = [[state.x + math.cos(angle) * s, state.y + math.sin(angle) * s, angle, 1.0, 0.0] for s in steps]
        wall = OrientedBox((4.0 + 0.01 * x * math.cos(angle), 2.0 + 0.01 * x * math.sin(angle)), (0.0011, 1.0), angle)
        for obstacles, free in ((), True), ((wall,), False):
            assert is_free(np.array(rows), 0.05, World(self.HALL, obstacles).scene(POINT)) == free

    def test_a_corner_that_turns_into_a_wall_is_seen(self) -> None:
        square = Footprint.polygon([(-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1)])
        headings = np.linspace(0.0, math.pi / 2.0, 21)  # at 0.5 rad/s
        turn = np.column_stack([0.0 * headings, 0.0 * headings, headings, 0.0 * headings, 0.5 + 0.0 * headings])
        bounds, dt = Bounds((-1.0, -1.0), (1.0, 1.0)), (headings[1] - headings[0]) / 0.5
        for wall, is_expected in ((0.13, False), (0.145, True)):  # the corners pass at 0.1414 m
            world = World(bounds, [Box((wall, -1.0), (0.3, 1.0))])
            assert is_free(turn, dt, world.scene(square)) is is_expected

    @pytest.mark.parametrize("footprint", FOOTPRINTS.values(), ids=FOOTPRINTS)
    def test_a_motion_that_begins_in_an_obstacle_is_not_free(self, footprint: Footprint) -> None:
        rows = np.array([[4.2, 2.0, 0.0, 0.0, 0.0]])
        assert not is_free(rows, 0.05, World(self.HALL, [Box((4.0, 1.0), (4.4, 3.0))]).scene(footprint))
