"""EXTEND_TRAJECTORY of the paper: what an extension is made of, where it ends, and what it never drives through."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from cbrrt_ompl import clearance_map as clearance_map_module
from cbrrt_ompl.clearance_map import ROOM, ClearanceMap
from cbrrt_ompl.compiled.search import Search
from cbrrt_ompl.control_laws import reference_pose, tracking_command
from cbrrt_ompl.errors import SettingsError
from cbrrt_ompl.extension import (
    ASK,
    BLOCKED,
    CLOSED_LOOP,
    EXTENDED,
    OPEN_LOOP,
    REFUSED,
    SCRATCH_SHAPE,
    STEERING,
    Extension,
    GoalRegion,
    check_step,
    extend,
    in_goal,
    is_refused,
    law_of,
    pack_model,
    unpack_model,
)
from cbrrt_ompl.kinematics import dynamic_step, unicycle_step
from cbrrt_ompl.obstacles import Bounds, Box, Disc, OrientedBox, Polygon
from cbrrt_ompl.replay import replay_path
from cbrrt_ompl.robot import Footprint, Gains, Limits, Robot
from cbrrt_ompl.settings import Goal, PlanningSettings, State
from cbrrt_ompl.world import World

LAWS = {"open loop": OPEN_LOOP, "closed loop": CLOSED_LOOP, "steering": STEERING}
LIMITS = Limits()
RATES = (LIMITS.omega_min, 0.0, LIMITS.omega_max)
OUT_OF_REACH = Goal(90.0, 90.0, tolerance=0.1)
POINT = Footprint.point()
FOOTPRINTS = {
    "point": POINT,
    "disc": Footprint.disc(0.15),
    "rectangle": Footprint.polygon([(-0.2, -0.1), (0.3, -0.1), (0.3, 0.1), (-0.2, 0.1)]),
}
WIDE = ClearanceMap(World(Bounds((-100.0, -100.0), (100.0, 100.0))), POINT)

coordinates = st.floats(-2.0, 2.0)
headings = st.floats(-math.pi, math.pi, exclude_max=True)
nodes = st.builds(State, coordinates, coordinates, headings, st.floats(0.0, 1.0), st.floats(*RATES[::2]))
samples = st.tuples(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0))


def plain(kernel: Callable[..., Any]) -> Callable[..., Any]:
    """The Python function behind a kernel."""
    return getattr(kernel, "py_func", kernel)  # with NUMBA_DISABLE_JIT=1 a kernel is that function itself


def model_of(law: int = OPEN_LOOP, goal: Goal = OUT_OF_REACH, **planning: Any) -> NDArray[np.float64]:
    """The paper's robot as a packed model."""
    return pack_model(law, Robot(), goal, PlanningSettings(**planning))


def drive(
    clearance_map: ClearanceMap,
    node: Sequence[float],
    sample: tuple[float, float],
    model: NDArray[np.float64],
    children: Sequence[tuple[float, float]] = (),
    kernel: Callable[..., Extension] = extend,
) -> Extension:
    """One extension, all its questions answered; ``children`` are the commands that the node has used."""
    following = np.arange(-1, len(children), dtype=np.int32)
    commands = np.array([*children, (0.0, 0.0)])
    node, answered = tuple(map(float, node)), 0
    for _ in range(10_000):
        found = kernel(
            node,
            *sample,
            len(children) - 1,
            following,
            commands,
            unpack_model(model),
            clearance_map.view,
            clearance_map.answers,
            answered,
            np.empty(SCRATCH_SHAPE),
        )
        if found.outcome != ASK:
            return found
        answered = clearance_map.answer(answered, *found.control)
    raise AssertionError("there is no end to the questions")


def states_of(node: Sequence[float], found: Extension, model: NDArray[np.float64]) -> NDArray[np.float64]:
    """States of an extension from its node on, shape (steps + 1, 5)."""
    return replay_path(np.array(node, dtype=float), np.array([found.control]), np.array([found.steps]), model)[0]


def between(a: NDArray[np.float64], b: NDArray[np.float64], share: float, model: NDArray[np.float64]) -> list[float]:
    """Pose at a share of the step between two states."""
    v, omega = b[3:] if int(model[0]) == STEERING else a[3:]
    v_there, omega_there = v + share * (b[3] - v), omega + share * (b[4] - omega)
    return list(unicycle_step(*a[:3], v, omega, v_there, omega_there, share * model[1]))


class TestModel:
    @pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
    def test_it_survives_packing(self, law: int) -> None:
        limits = Limits(-0.1, 1.1, -0.2, 1.2, 0.3, 1.3, 0.4, 1.4, 0.5)
        robot = Robot(limits=limits, gains=Gains(1.0, 2.0, 3.0))
        goal = Goal(1.5, 2.5, 0.4, theta=0.7, heading_tolerance=0.2, speed_tolerance=0.1)
        planning = PlanningSettings(
            horizon=1.2, step=0.04, cut_extension="keep", equal_control_tolerance=0.07, look_ahead=1.7
        )
        model = unpack_model(pack_model(law, robot, goal, planning))
        assert (model.law, model.dt, model.steps, model.look_ahead) == (law, 0.04, 30, 1.7)
        assert (model.equal_control_tolerance, model.keep_cut) == (0.07, True)
        assert (model.limits, model.gains) == (limits, robot.gains)
        assert model.goal == (1.5, 2.5, 0.4, 0.7, 0.2, 0.1)

    def test_what_the_goal_leaves_free_has_an_infinite_tolerance(self) -> None:
        model = unpack_model(model_of(goal=Goal(1.0, 2.0)))
        assert (model.goal.heading_tolerance, model.goal.speed_tolerance) == (math.inf, math.inf)
        assert not model.keep_cut
        assert model.look_ahead == 2.0

    @pytest.mark.parametrize(
        ("planner", "closed_loop", "law"),
        [
            ("cb-rrt", False, OPEN_LOOP),
            ("cb-rrt", True, CLOSED_LOOP),
            ("cb-rrt-compiled", True, CLOSED_LOOP),
            ("s-rrt", False, STEERING),
            ("s-rrt-compiled", True, STEERING),
            ("kpiece1", True, OPEN_LOOP),
        ],
    )
    def test_every_planner_has_its_law(self, planner: str, closed_loop: bool, law: int) -> None:
        assert law_of(planner, PlanningSettings(closed_loop=closed_loop)) == law

    def test_a_step_in_which_the_robot_could_turn_too_far_is_refused(self) -> None:
        robot = Robot(limits=Limits(omega_min=-4.0, omega_max=1.0))
        check_step(robot, PlanningSettings(step=0.125))
        with pytest.raises(SettingsError, match=r"planning\.step: got 0\.13, expected at most 0\.125 s") as error:
            check_step(robot, PlanningSettings(step=0.13))
        assert [problem.field for problem in error.value.problems] == ["planning.step"]

    def test_a_step_that_is_accepted_has_an_error_below_a_hundred_thousandth_of_its_length(self) -> None:
        """From full right to full left in one step: the worst that a robot of such an acceleration can do."""
        omega, dt = 0.8, 0.05
        limits = Limits(omega_min=-omega, omega_max=omega, angular_acceleration=2.0 * omega / dt)
        with pytest.raises(SettingsError, match=r"planning\.step: got 0\.06, expected at most 0\.05 s"):
            check_step(Robot(limits=limits), PlanningSettings(step=0.06, horizon=0.6))
        check_step(Robot(limits=limits), PlanningSettings(step=dt))
        x, y, _ = unicycle_step(0.0, 0.0, 0.0, 1.0, -omega, 1.0, omega, dt)
        t = (np.arange(10_000) + 0.5) / 10_000 * dt
        heading = -omega * t + omega * t * t / dt
        assert math.hypot(x - dt * np.cos(heading).mean(), y - dt * np.sin(heading).mean()) < 1e-5 * dt


class TestGoalRegion:
    goals = st.builds(
        Goal,
        coordinates,
        coordinates,
        st.floats(0.1, 1.0),
        st.none() | st.floats(-10.0, 10.0),
        st.floats(0.01, 4.0),
        st.none() | st.floats(0.01, 1.0),
    )

    @given(goals, st.data())
    def test_it_is_that_of_the_goal_with_its_border(self, goal: Goal, data: st.DataObject) -> None:
        direction = data.draw(st.floats(0.0, 6.0))
        distance = goal.tolerance * data.draw(st.floats(0.0, 0.999999) | st.floats(1.000001, 2.0))
        turns = st.sampled_from([-1.0, 0.0, 1.0]).map(lambda k: k * goal.heading_tolerance) | st.floats(-20.0, 20.0)
        most = goal.speed_tolerance or 0.3
        speeds = st.sampled_from([-most, most, math.nextafter(most, 2.0)]) | st.floats(-0.5, 0.5)
        state = State(
            goal.x + distance * math.cos(direction),
            goal.y + distance * math.sin(direction),
            (goal.theta or 0.0) + data.draw(turns),
            data.draw(speeds),
            data.draw(speeds),
        )
        region = unpack_model(model_of(goal=goal)).goal
        assert in_goal(region, *state) == (not goal.violations(state))
        assert plain(in_goal)(region, *state) == in_goal(region, *state)

    @pytest.mark.parametrize("direction", [(1.0, 0.0), (0.0, -1.0)])
    def test_the_rim_of_the_disc_is_outside(self, direction: tuple[float, float]) -> None:
        region = GoalRegion(0.0, 0.0, 0.5, 0.0, math.inf, math.inf)
        for radius, is_inside in ((0.5, False), (math.nextafter(0.5, 0.0), True)):
            assert in_goal(region, radius * direction[0], radius * direction[1], 3.0, 1.0, 1.0) is is_inside

    def test_the_rim_is_the_same_to_the_last_bit(self) -> None:
        rng = np.random.default_rng(0)
        for x, y in rng.uniform(-1.0, 1.0, (2000, 2)).tolist():
            for radius in (math.hypot(x, y), math.sqrt(x * x + y * y)):
                goal = Goal(0.0, 0.0, radius)
                assert in_goal(unpack_model(model_of(goal=goal)).goal, x, y, 0.0, 0.0, 0.0) == (
                    not goal.violations(State(x, y))
                )


class TestRefusal:
    FOLLOWING = np.array([-1, 0, -1, 1], dtype=np.int32)  # the children 3, 1, 0 of one node; 2 of another
    COMMANDS = np.array([(0.5, 0.25), (1.0, -0.5), (0.0, 0.5), (0.0, 0.0)])

    def refused(self, v: float, omega: float, tolerance: float, first: int = 3) -> bool:
        return bool(is_refused(first, self.FOLLOWING, self.COMMANDS, v, omega, tolerance))

    def test_the_tolerance_itself_is_still_refused(self) -> None:
        assert self.refused(0.75, 0.25, 0.25)
        assert self.refused(0.5, 0.0, 0.25)
        assert not self.refused(math.nextafter(0.75, 1.0), 0.25, 0.25)
        assert not self.refused(0.5, math.nextafter(0.5, 1.0), 0.25)

    def test_both_velocities_must_be_near_the_same_child(self) -> None:
        assert not self.refused(1.0, 0.25, 0.1)

    def test_a_tolerance_of_zero_refuses_identical_commands_alone(self) -> None:
        assert self.refused(1.0, -0.5, 0.0)
        assert not self.refused(1.0, math.nextafter(-0.5, 0.0), 0.0)

    def test_a_negative_tolerance_refuses_nothing(self) -> None:
        assert not self.refused(1.0, -0.5, -1e-9)

    def test_children_of_other_nodes_do_not_count(self) -> None:
        assert not self.refused(0.0, 0.5, 0.1)
        assert self.refused(0.0, 0.5, 0.1, first=2)
        assert not self.refused(0.5, 0.25, 0.1, first=-1)

    @pytest.mark.parametrize("law", [OPEN_LOOP, CLOSED_LOOP])
    def test_an_extension_by_a_used_command_is_given_up(self, law: int) -> None:
        node, sample = (0.0, 0.0, 0.0, 0.0, 0.0), (1.0, 1.0)
        found = drive(WIDE, node, sample, model_of(law))
        v, omega = found.command
        assert found.outcome == EXTENDED
        assert drive(WIDE, node, sample, model_of(law), [(v + 0.09, omega - 0.09)]).outcome == REFUSED
        assert drive(WIDE, node, sample, model_of(law), [(v + 0.09, omega - 0.11)]).outcome == EXTENDED
        never = model_of(law, equal_control_tolerance=-1.0)
        assert drive(WIDE, node, sample, never, [(v, omega)]) == found


class TestWayOfAnExtension:
    @pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
    @given(node=nodes, sample=samples, steps=st.sampled_from([1, 40, 48, 49, 150]))
    @settings(max_examples=60)
    def test_it_lasts_to_the_horizon_and_replays_bit_for_bit(
        self, law: int, node: State, sample: tuple[float, float], steps: int
    ) -> None:
        model = model_of(law, horizon=0.05 * steps)
        found = drive(WIDE, node, sample, model)
        assert (found.outcome, found.steps) == (EXTENDED, steps)
        states = states_of(node, found, model)
        assert tuple(states[-1]) == found.state
        assert tuple(states[0]) == node

    @given(node=nodes, sample=samples)
    def test_the_law_is_evaluated_at_the_node_for_a_reference_within_look_ahead(
        self, node: State, sample: tuple[float, float]
    ) -> None:
        found = drive(WIDE, node, sample, model_of(look_ahead=0.7))
        reference = reference_pose(*node[:3], *sample, 0.7)
        assert found.command == tracking_command(*node[:3], reference, LIMITS, Gains())
        assert found.control == (*found.command, 0.0)
        assert drive(WIDE, node, sample, model_of(CLOSED_LOOP, look_ahead=0.7)).control == reference

    @pytest.mark.parametrize("law", [OPEN_LOOP, CLOSED_LOOP])
    @given(node=nodes, sample=samples)
    @settings(max_examples=50)
    def test_velocities_keep_their_ranges_and_accelerations(
        self, law: int, node: State, sample: tuple[float, float]
    ) -> None:
        model = model_of(law)
        states = states_of(node, drive(WIDE, node, sample, model), model)
        v, omega = states[:, 3], states[:, 4]
        assert LIMITS.v_min <= v.min() and v.max() <= LIMITS.v_max
        assert LIMITS.omega_min <= omega.min() and omega.max() <= LIMITS.omega_max
        assert np.abs(np.diff(v)).max() <= LIMITS.acceleration * 0.05 + 1e-15
        assert np.abs(np.diff(omega)).max() <= LIMITS.angular_acceleration * 0.05 + 1e-15

    @given(node=nodes, sample=samples)
    @settings(max_examples=50)
    def test_the_closed_loop_asks_the_law_at_every_step(self, node: State, sample: tuple[float, float]) -> None:
        reference, state = reference_pose(*node[:3], *sample, 2.0), tuple(node)
        for _ in range(40):
            state = dynamic_step(*state, tracking_command(*state[:3], reference, LIMITS, Gains()), LIMITS, 0.05)
        assert drive(WIDE, node, sample, model_of(CLOSED_LOOP)).state == state

    @pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
    @given(node=nodes, sample=samples, share=st.floats(0.0, 1.0), tolerance=st.floats(0.02, 0.5), asks=st.booleans())
    @settings(max_examples=60)
    def test_it_ends_at_the_first_state_in_the_goal(
        self, law: int, node: State, sample: tuple[float, float], share: float, tolerance: float, asks: bool
    ) -> None:
        free = drive(WIDE, node, sample, model_of(law))
        states = states_of(node, free, model_of(law))
        x, y, theta = states[1 + round(share * 39), :3]
        goal = Goal(x, y, tolerance, theta=theta if asks else None, heading_tolerance=0.05)
        model = model_of(law, goal)
        if law == STEERING:  # the goal may change which of the three ends nearest: leave it the same one
            found = drive(WIDE, node, sample, model, [(1.0, rate) for rate in RATES if rate != free.command[1]])
        else:
            found = drive(WIDE, node, sample, model)
        region = unpack_model(model).goal
        inside = [k for k in range(1, 41) if in_goal(region, *states[k])]
        assert (found.outcome, found.steps) == (EXTENDED, inside[0])
        assert found.state == tuple(states[inside[0]])

    def test_a_goal_that_is_passed_too_fast_does_not_end_it(self) -> None:
        node, sample = (0.0, 0.0, 0.0, 1.0, 0.0), (4.0, 0.0)
        assert drive(WIDE, node, sample, model_of(goal=Goal(1.0, 0.0, 0.2))).steps < 20
        assert drive(WIDE, node, sample, model_of(goal=Goal(1.0, 0.0, 0.2, speed_tolerance=0.1))).steps == 40


class TestSteering:
    @given(node=nodes, sample=samples)
    def test_the_rate_that_ends_nearest_to_the_reference_is_taken(
        self, node: State, sample: tuple[float, float]
    ) -> None:
        found = drive(WIDE, node, sample, model_of(STEERING))
        x_reference, y_reference, _ = reference_pose(*node[:3], *sample, 2.0)
        distances = {}
        for rate in RATES:
            heading = node.theta + rate
            chord = 2.0 if rate == 0.0 else 2.0 * math.sin(rate) / rate  # of two seconds at 1 m/s
            end = node.x + chord * math.cos(heading), node.y + chord * math.sin(heading)
            distances[rate] = math.hypot(end[0] - x_reference, end[1] - y_reference)
        assert found.outcome == EXTENDED
        assert found.command[0] == LIMITS.v_max
        assert distances[found.command[1]] <= min(distances.values()) + 1e-9
        assert found.state[3:] == found.command  # the velocities jump

    def test_used_rates_are_left_out_until_none_remains(self) -> None:
        node, sample, used = (0.0, 0.0, 0.0, 0.0, 0.0), (2.0, 1.0), []
        for expected in (RATES[2], RATES[1], RATES[0]):
            found = drive(WIDE, node, sample, model_of(STEERING), used)
            assert (found.outcome, found.command[1]) == (EXTENDED, expected)
            used.append(found.command)
        assert drive(WIDE, node, sample, model_of(STEERING), used).outcome == REFUSED

    def test_rates_that_collide_are_left_out(self) -> None:
        node, sample = (0.0, 0.0, 0.0, 0.0, 0.0), (2.0, 1.0)
        obstacles = [Box((0.5, 0.15), (1.5, 1.0)), Box((1.9, -0.1), (2.5, 0.1)), Box((0.5, -1.0), (1.5, -0.15))]
        bounds = Bounds((-5.0, -5.0), (5.0, 5.0))
        for count, expected in ((1, RATES[1]), (2, RATES[0])):
            found = drive(ClearanceMap(World(bounds, obstacles[:count]), POINT), node, sample, model_of(STEERING))
            assert (found.outcome, found.command[1]) == (EXTENDED, expected)
        closed = ClearanceMap(World(bounds, obstacles), POINT)
        assert drive(closed, node, sample, model_of(STEERING)).outcome == BLOCKED


class TestObstacles:
    BOX = World(Bounds((-5.0, -5.0), (5.0, 5.0)), [Box((1.0, -0.5), (1.5, 0.5))])
    AT_SPEED = (0.0, 0.0, 0.0, 1.0, 0.0)

    @pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
    @pytest.mark.parametrize("footprint", FOOTPRINTS.values(), ids=FOOTPRINTS)
    def test_a_cut_extension_is_discarded_or_kept_up_to_the_obstacle(self, law: int, footprint: Footprint) -> None:
        clearance_map, sample = ClearanceMap(self.BOX, footprint), (4.0, 0.0)
        others = [(1.0, RATES[0]), (1.0, RATES[2])]
        assert drive(clearance_map, self.AT_SPEED, sample, model_of(law), others).outcome == BLOCKED
        kept = drive(clearance_map, self.AT_SPEED, sample, model_of(law, cut_extension="keep"), others)
        assert kept.outcome == EXTENDED
        reach = 1.0 - {"point": 0.0, "disc": 0.15, "polygon": 0.3}[footprint.kind]
        assert reach - 0.05 - 1e-5 < kept.state[0] < reach

    def test_an_extension_that_cannot_do_its_first_step_is_never_kept(self) -> None:
        clearance_map = ClearanceMap(self.BOX, POINT)
        node = (0.98, 0.0, 0.0, 1.0, 0.0)
        assert drive(clearance_map, node, (4.0, 0.0), model_of(cut_extension="keep")).outcome == BLOCKED

    def test_a_goal_before_the_obstacle_saves_the_extension(self) -> None:
        clearance_map = ClearanceMap(self.BOX, POINT)
        found = drive(clearance_map, self.AT_SPEED, (4.0, 0.0), model_of(goal=Goal(0.9, 0.0, 0.08)))
        assert (found.outcome, found.state[0]) == (EXTENDED, pytest.approx(0.85))

    def test_a_goal_behind_the_obstacle_does_not(self) -> None:
        clearance_map = ClearanceMap(self.BOX, POINT)
        found = drive(clearance_map, self.AT_SPEED, (4.0, 0.0), model_of(goal=Goal(1.7, 0.0, 0.1)))
        assert found.outcome == BLOCKED

    def test_a_turn_on_the_spot_sweeps_the_corners_of_the_footprint(self) -> None:
        """A long robot beside a wall: a point could turn there."""
        world = World(Bounds((-5.0, -5.0), (5.0, 5.0)), [Box((-3.0, 0.3), (3.0, 0.4))])
        long = Footprint.polygon([(-0.5, -0.1), (0.5, -0.1), (0.5, 0.1), (-0.5, 0.1)])
        node, sample = (0.0, 0.0, 0.0, 0.0, 0.0), (-2.0, -1.0)
        assert drive(ClearanceMap(world, POINT), node, sample, model_of()).outcome == EXTENDED
        assert drive(ClearanceMap(world, long), node, sample, model_of()).outcome == BLOCKED
        kept = drive(ClearanceMap(world, long), node, sample, model_of(cut_extension="keep"))
        assert kept.state[:2] == (0.0, 0.0)
        assert kept.state[2] == pytest.approx(math.asin(0.1 / 0.26**0.5) - math.asin(0.3 / 0.26**0.5), abs=0.027)

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


def crowded_world() -> World:
    return World(
        Bounds((-2.0, -2.0), (2.0, 2.0)),
        [
            Box((-1.0, -1.2), (-0.8, 0.8)),
            Disc((0.3, 0.9), 0.35),
            OrientedBox((0.8, -0.8), (0.9, 0.05), 0.6),
            Polygon(np.array([(1.2, 0.2), (1.8, 0.3), (1.5, 0.5), (1.7, 1.2)])),
            Polygon(np.array([(-0.4, -1.7), (0.3, -1.5), (-0.2, -0.9)])),
        ],
    )


def free_nodes(world: World, footprint: Footprint, count: int, seed: int) -> list[State]:
    """Random states at which nothing is touched, at random velocities."""
    rng = np.random.default_rng(seed)
    low, high = (-2.0, -2.0, -math.pi, 0.0, LIMITS.omega_min), (2.0, 2.0, math.pi, 1.0, LIMITS.omega_max)
    drawn = (State(*rng.uniform(low, high).tolist()) for _ in range(100 * count))
    return [node for node in drawn if not world.collides(footprint, node[:3])][:count]


@pytest.mark.parametrize("footprint", FOOTPRINTS.values(), ids=FOOTPRINTS)
@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
class TestWhatTheMapHolds:
    """What is accepted depends on the points of the way alone: not on the map, and not on whether there is one."""

    @pytest.mark.parametrize("cut", ["discard", "keep"])
    def test_an_extension_ends_at_the_same_bits(self, footprint: Footprint, law: int, cut: str) -> None:
        world, rng = crowded_world(), np.random.default_rng(8)
        model = model_of(law, Goal(0.5, 0.2, 0.2), cut_extension=cut)
        off, grown = ClearanceMap(world, footprint, enabled=False), ClearanceMap(world, footprint)
        for pose in rng.uniform((-2.0, -2.0, -math.pi), (2.0, 2.0, math.pi), (1500, 3)).tolist():
            grown.collides(*pose)
        outcomes = []
        for node in free_nodes(world, footprint, 60, seed=9):
            sample = tuple(rng.uniform(-2.0, 2.0, 2).tolist())
            exact = drive(off, node, sample, model)
            for clearance_map in (grown, ClearanceMap(world, footprint)):
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


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_compiled_and_plain_kernels_agree(law: int) -> None:
    world, rng = crowded_world(), np.random.default_rng(16)
    clearance_map = ClearanceMap(world, FOOTPRINTS["rectangle"])
    for node in free_nodes(world, FOOTPRINTS["rectangle"], 20, seed=17):
        sample = tuple(rng.uniform(-2.0, 2.0, 2).tolist())
        compiled, python = (
            drive(clearance_map, node, sample, model_of(law), kernel=kernel) for kernel in (extend, plain(extend))
        )
        assert compiled[:2] == python[:2]
        assert compiled.state == pytest.approx(python.state, abs=1e-14)
        assert compiled.command == pytest.approx(python.command, abs=1e-14)
