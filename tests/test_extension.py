"""EXTEND_TRAJECTORY of the paper: what an extension is made of, where it ends, and what it never drives through."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kernels import (
    FOOTPRINTS,
    LAWS,
    LIMITS,
    POINT,
    RATES,
    WIDE,
    crowded_world,
    drive,
    free_nodes,
    model_of,
    nodes,
    plain,
    record_of,
    samples,
    states_of,
)

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.motion.control_laws import reference_pose, tracking_command
from cbrrt_ompl.motion.kinematics import dynamic_step
from cbrrt_ompl.motion.model import CLOSED_LOOP, OPEN_LOOP, STEERING, in_goal
from cbrrt_ompl.motion.records import as_records
from cbrrt_ompl.planners.extension import BLOCKED, CHILD, EXTENDED, REFUSED, extend, is_refused
from cbrrt_ompl.problem.obstacles import Bounds, Box
from cbrrt_ompl.problem.robot import Footprint, Gains
from cbrrt_ompl.problem.settings import Goal, State


class TestRefusal:
    CHILDREN = as_records(  # 3, 1, 0 of one node; 2 of another
        np.array([(0.5, 0.25, -1, 0), (1.0, -0.5, 0, 0), (0.0, 0.5, -1, 0), (0.0, 0.0, 1, 0)], dtype=CHILD)
    )

    def refused(self, v: float, omega: float, tolerance: float, first: int = 3) -> bool:
        return bool(is_refused(first, self.CHILDREN, v, omega, tolerance))

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
        assert found.outcome == EXTENDED
        assert found.steps == steps or (law == CLOSED_LOOP and 1 <= found.steps < steps)
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
    def test_the_closed_loop_asks_the_law_at_every_step_until_it_is_past_its_reference(
        self, node: State, sample: tuple[float, float]
    ) -> None:
        (x_r, y_r, theta_r), state, steps = reference_pose(*node[:3], *sample, 2.0), tuple(node), 0
        is_past = False
        while steps < 40 and not is_past:
            command = tracking_command(*state[:3], (x_r, y_r, theta_r), LIMITS, Gains())
            state, steps = dynamic_step(*state, command, LIMITS, 0.05), steps + 1
            is_past = math.cos(theta_r) * (state[0] - x_r) + math.sin(theta_r) * (state[1] - y_r) >= 0.0
        found = drive(WIDE, node, sample, model_of(CLOSED_LOOP))
        assert (found.steps, found.state) == (steps, state)
        assert is_past or steps == 40

    @pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
    @given(node=nodes, sample=samples, share=st.floats(0.0, 1.0), tolerance=st.floats(0.02, 0.5), asks=st.booleans())
    @settings(max_examples=60)
    def test_it_ends_at_the_first_state_in_the_goal(
        self, law: int, node: State, sample: tuple[float, float], share: float, tolerance: float, asks: bool
    ) -> None:
        free = drive(WIDE, node, sample, model_of(law))
        states = states_of(node, free, model_of(law))
        x, y, theta = states[1 + round(share * (free.steps - 1)), :3]
        goal = Goal(x, y, tolerance, theta=theta if asks else None, heading_tolerance=0.05)
        model = model_of(law, goal)
        if law == STEERING:  # the goal may change which of the three ends nearest: leave it the same one
            found = drive(WIDE, node, sample, model, [(1.0, rate) for rate in RATES if rate != free.command[1]])
        else:
            found = drive(WIDE, node, sample, model)
        region = record_of(model).goal
        inside = [k for k in range(1, len(states)) if in_goal(region, *states[k])]
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
            found = drive(World(bounds, obstacles[:count]).scene(POINT), node, sample, model_of(STEERING))
            assert (found.outcome, found.command[1]) == (EXTENDED, expected)
        closed = World(bounds, obstacles).scene(POINT)
        assert drive(closed, node, sample, model_of(STEERING)).outcome == BLOCKED


class TestObstacles:
    BOX = World(Bounds((-5.0, -5.0), (5.0, 5.0)), [Box((1.0, -0.5), (1.5, 0.5))])
    AT_SPEED = (0.0, 0.0, 0.0, 1.0, 0.0)

    @pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
    @pytest.mark.parametrize("footprint", FOOTPRINTS.values(), ids=FOOTPRINTS)
    def test_a_cut_extension_is_discarded_or_kept_up_to_the_obstacle(self, law: int, footprint: Footprint) -> None:
        scene, sample = self.BOX.scene(footprint), (4.0, 0.0)
        others = [(1.0, RATES[0]), (1.0, RATES[2])]
        assert drive(scene, self.AT_SPEED, sample, model_of(law), others).outcome == BLOCKED
        kept = drive(scene, self.AT_SPEED, sample, model_of(law, cut_extension="keep"), others)
        assert kept.outcome == EXTENDED
        reach = 1.0 - {"point": 0.0, "disc": 0.15, "polygon": 0.3}[footprint.kind]
        assert reach - 0.05 - 1e-5 < kept.state[0] < reach

    def test_an_extension_that_cannot_do_its_first_step_is_never_kept(self) -> None:
        scene = self.BOX.scene(POINT)
        node = (0.98, 0.0, 0.0, 1.0, 0.0)
        assert drive(scene, node, (4.0, 0.0), model_of(cut_extension="keep")).outcome == BLOCKED

    def test_a_goal_before_the_obstacle_saves_the_extension(self) -> None:
        scene = self.BOX.scene(POINT)
        found = drive(scene, self.AT_SPEED, (4.0, 0.0), model_of(goal=Goal(0.9, 0.0, 0.08)))
        assert (found.outcome, found.state[0]) == (EXTENDED, pytest.approx(0.85))

    def test_a_goal_behind_the_obstacle_does_not(self) -> None:
        scene = self.BOX.scene(POINT)
        found = drive(scene, self.AT_SPEED, (4.0, 0.0), model_of(goal=Goal(1.7, 0.0, 0.1)))
        assert found.outcome == BLOCKED

    def test_a_turn_on_the_spot_sweeps_the_corners_of_the_footprint(self) -> None:
        """A long robot beside a wall: a point could turn there."""
        world = World(Bounds((-5.0, -5.0), (5.0, 5.0)), [Box((-3.0, 0.3), (3.0, 0.4))])
        long = Footprint.polygon([(-0.5, -0.1), (0.5, -0.1), (0.5, 0.1), (-0.5, 0.1)])
        node, sample = (0.0, 0.0, 0.0, 0.0, 0.0), (-2.0, -1.0)
        assert drive(world.scene(POINT), node, sample, model_of()).outcome == EXTENDED
        assert drive(world.scene(long), node, sample, model_of()).outcome == BLOCKED
        kept = drive(world.scene(long), node, sample, model_of(cut_extension="keep"))
        assert kept.state[:2] == (0.0, 0.0)
        assert kept.state[2] == pytest.approx(math.asin(0.1 / 0.26**0.5) - math.asin(0.3 / 0.26**0.5), abs=0.027)


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_compiled_and_plain_kernels_agree(law: int) -> None:
    world, rng = crowded_world(), np.random.default_rng(16)
    scene = world.scene(FOOTPRINTS["rectangle"])
    for node in free_nodes(world, FOOTPRINTS["rectangle"], 20, seed=17):
        sample = tuple(rng.uniform(-2.0, 2.0, 2).tolist())
        compiled, python = (
            drive(scene, node, sample, model_of(law), kernel=kernel) for kernel in (extend, plain(extend))
        )
        assert compiled[:2] == python[:2]
        assert compiled.state == pytest.approx(python.state, abs=1e-14)
        assert compiled.command == pytest.approx(python.command, abs=1e-14)
