"""A motion is free between its states too, whatever the map holds: no wall is passed, be it of a millimetre."""

from __future__ import annotations

import math

import numpy as np
import pytest
from cbrrt_ompl.collision.clearance_map import ROOM, ClearanceMap
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
    roll_out_answered,
    samples,
    states_of,
)

from cbrrt_ompl.collision import clearance_map as clearance_map_module
from cbrrt_ompl.collision.motion_check import BLOCKED, is_free
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.motion.model import OPEN_LOOP, STEERING
from cbrrt_ompl.planners.extension import EXTENDED
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
        enabled=st.booleans(),
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
        enabled: bool,
    ) -> None:
        """The wall stands across the way that is driven without it, at any angle, between any two steps."""
        model = model_of(law, cut_extension=cut)
        free = drive(WIDE, node, sample, model)
        states = states_of(node, free, model)
        x, y, _ = between(states[at], states[at + 1], share, model)
        world = World(Bounds((-20.0, -20.0), (20.0, 20.0)), [OrientedBox((x, y), (length, 0.001), angle)])
        assume(not world.collides(FOOTPRINTS[shape], node[:3]))
        others = [(1.0, rate) for rate in RATES if law == STEERING and rate != free.command[1]]
        found = drive(ClearanceMap(world, FOOTPRINTS[shape], enabled=enabled), node, sample, model, others)
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
        search = Search(model, ClearanceMap(world, POINT), [State(*(-2.0 * normal), angle)], seed=3)
        search.run(lambda _: False, 3000)
        sides = search.edges()[0][:, :2] @ normal
        assert search.nodes > 200
        assert sides.max() < -0.0005
        assert sides.max() > -0.06  # the wall was reached


@pytest.mark.parametrize("enabled", [True, False])
@pytest.mark.parametrize("law", [OPEN_LOOP, STEERING])
def test_no_corner_turns_into_a_wall_beside_the_start(law: int, enabled: bool) -> None:
    """A start with less than `ROOM` has no margin; it was taken for one of the origin alone, which does not turn."""
    square = Footprint.polygon([(-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1)])
    world = World(Bounds((-1.0, -1.0), (1.0, 1.0)), [Box((0.1 + 0.6 * ROOM, -1.0), (0.3, 1.0))])
    clearance_map = ClearanceMap(world, square, enabled=enabled)
    assert not clearance_map.collides(0.0, 0.0, 0.0)
    steps, outcome, _ = roll_out_answered(clearance_map, State(0.0, 0.0), (0.0, 0.5, 0.0), model_of(law))
    assert (steps, outcome) == (0, BLOCKED)


@pytest.mark.parametrize("footprint", FOOTPRINTS.values(), ids=FOOTPRINTS)
@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
class TestWhatTheMapHolds:
    """What is accepted depends on the points of the way alone: not on the map, and not on whether there is one."""

    @pytest.mark.parametrize("brake_safe", [False, True], ids=["", "brake safe"])
    @pytest.mark.parametrize("cut", ["discard", "keep"])
    def test_an_extension_ends_at_the_same_bits(
        self, footprint: Footprint, law: int, cut: str, brake_safe: bool
    ) -> None:
        world, rng = crowded_world(), np.random.default_rng(8)
        model = model_of(law, Goal(0.5, 0.2, 0.2), cut_extension=cut, brake_safe=brake_safe)
        off, grown = ClearanceMap(world, footprint, enabled=False), ClearanceMap(world, footprint)
        for pose in rng.uniform((-2.0, -2.0, -math.pi), (2.0, 2.0, math.pi), (1500, 3)).tolist():
            grown.collides(*pose)
        outcomes = []
        for node in free_nodes(world, footprint, 60, seed=9):
            sample = tuple(rng.uniform(-2.0, 2.0, 2).tolist())
            exact = drive(off, node, sample, model)
            forgetful = [ClearanceMap(world, footprint, enabled=enabled) for enabled in (True, False)]
            for clearance_map in forgetful:
                clearance_map.findings = np.zeros((2, 2))  # to be enlarged in mid-extension
            for clearance_map in (grown, ClearanceMap(world, footprint), *forgetful):
                found = drive(clearance_map, node, sample, model)
                assert found[:3] == exact[:3]
                assert exact.outcome == BLOCKED or found == exact
            outcomes.append(exact.outcome)
        assert outcomes.count(EXTENDED) >= 10
        assert outcomes.count(BLOCKED) >= 10 or cut == "keep"

    def test_a_full_map_changes_nothing(self, footprint: Footprint, law: int, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(clearance_map_module, "MAX_CELLS", 21)
        world, rng = crowded_world(), np.random.default_rng(10)
        off, full = ClearanceMap(world, footprint, enabled=False), ClearanceMap(world, footprint)
        for node in free_nodes(world, footprint, 40, seed=11):
            sample = tuple(rng.uniform(-2.0, 2.0, 2).tolist())
            assert drive(full, node, sample, model_of(law))[:3] == drive(off, node, sample, model_of(law))[:3]
        assert full.cells == 21

    def test_a_tree_grows_the_same_node_by_node(self, footprint: Footprint, law: int) -> None:
        world = crowded_world()
        model, grown, trees = model_of(law, horizon=0.5, cut_extension="keep"), ClearanceMap(world, footprint), []
        for clearance_map in (grown, grown, ClearanceMap(world, footprint, enabled=False)):
            search = Search(model, clearance_map, [State(-1.5, 0.0, 1.5)], seed=5)
            search.run(lambda _: False, 300)
            trees.append(search.edges())
        assert len(trees[0][0]) > 20
        for tree in trees[1:]:
            assert all(np.array_equal(a, b) for a, b in zip(trees[0], tree, strict=True))

    @pytest.mark.parametrize("cut", ["discard", "keep"])
    def test_every_way_is_free_between_its_steps_too(self, footprint: Footprint, law: int, cut: str) -> None:
        world, rng = crowded_world(), np.random.default_rng(12)
        clearance_map, collides = ClearanceMap(world, footprint), world.checker(footprint).collides
        model, longest = model_of(law, cut_extension=cut), 0
        for node in free_nodes(world, footprint, 40, seed=13):
            found = drive(clearance_map, node, tuple(rng.uniform(-2.0, 2.0, 2).tolist()), model)
            if found.outcome == EXTENDED:
                longest = max(longest, found.steps)
                states = states_of(node, found, model)
                for a, b in zip(states[:-1], states[1:], strict=True):
                    assert not collides(*b[:3])
                    assert not collides(*between(a, b, 0.5, model))
        assert longest == 40

    def test_a_kept_way_cannot_be_driven_a_step_further(self, footprint: Footprint, law: int) -> None:
        world, rng = crowded_world(), np.random.default_rng(14)
        clearance_map, margin = ClearanceMap(world, footprint), world.checker(footprint).margin
        model, cut = model_of(law, cut_extension="keep"), 0
        for node in free_nodes(world, footprint, 40, seed=15):
            found = drive(clearance_map, node, tuple(rng.uniform(-2.0, 2.0, 2).tolist()), model)
            if found.outcome != EXTENDED or found.steps == 40:
                continue
            cut += 1
            a, b = states_of(node, found._replace(steps=found.steps + 1), model)[-2:]
            assert min(margin(*between(a, b, share, model)) for share in np.linspace(0.005, 1.0, 200)) < 1.1 * ROOM
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
            assert is_free(found.states, 0.05, ClearanceMap(world, footprint))

    @given(st.floats(0.001, 7.999), st.floats(0.0, 6.28))
    def test_a_thin_wall_between_two_of_them_is_seen(self, x: float, angle: float) -> None:
        """The wall is 1.1 mm thick, and the steps are 5 cm long."""
        state = State(4.0 - math.cos(angle), 2.0 - math.sin(angle), angle, 1.0)
        steps = np.arange(41) * 0.05
        rows = [[state.x + math.cos(angle) * s, state.y + math.sin(angle) * s, angle, 1.0, 0.0] for s in steps]
        wall = OrientedBox((4.0 + 0.01 * x * math.cos(angle), 2.0 + 0.01 * x * math.sin(angle)), (0.0011, 1.0), angle)
        for obstacles, free in ((), True), ((wall,), False):
            assert is_free(np.array(rows), 0.05, ClearanceMap(World(self.HALL, obstacles), POINT)) == free

    def test_a_corner_that_turns_into_a_wall_is_seen(self) -> None:
        square = Footprint.polygon([(-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1)])
        headings = np.linspace(0.0, math.pi / 2.0, 21)  # at 0.5 rad/s
        turn = np.column_stack([0.0 * headings, 0.0 * headings, headings, 0.0 * headings, 0.5 + 0.0 * headings])
        bounds, dt = Bounds((-1.0, -1.0), (1.0, 1.0)), (headings[1] - headings[0]) / 0.5
        for wall, is_expected in ((0.13, False), (0.145, True)):  # the corners pass at 0.1414 m
            world = World(bounds, [Box((wall, -1.0), (0.3, 1.0))])
            assert is_free(turn, dt, ClearanceMap(world, square)) is is_expected

    @pytest.mark.parametrize("footprint", FOOTPRINTS.values(), ids=FOOTPRINTS)
    def test_a_motion_that_begins_in_an_obstacle_is_not_free(self, footprint: Footprint) -> None:
        rows = np.array([[4.2, 2.0, 0.0, 0.0, 0.0]])
        assert not is_free(rows, 0.05, ClearanceMap(World(self.HALL, [Box((4.0, 1.0), (4.4, 3.0))]), footprint))
