"""Replayed controls: what was planned comes back bit for bit, as dense trajectories and as the edges of a tree."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kernels import plain
from numpy.typing import NDArray

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.motion.control_laws import tracking_command
from cbrrt_ompl.motion.kinematics import dynamic_step, kinematic_step
from cbrrt_ompl.motion.model import CLOSED_LOOP, OPEN_LOOP, STEERING, make_model
from cbrrt_ompl.motion.records import Records
from cbrrt_ompl.planners.search import Search
from cbrrt_ompl.problem.obstacles import Bounds, Disc
from cbrrt_ompl.problem.robot import Footprint, Gains, Limits, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.trajectory.replay import (
    fill_path,
    replay_edges,
    replay_path,
    trajectory_from_controls,
    tree_from_controls,
)

LAWS = {"open loop": OPEN_LOOP, "closed loop": CLOSED_LOOP, "steering": STEERING}
START = np.array([0.2, -0.3, 0.4, 0.5, -0.1])
DT = 0.05

controls_and_steps = st.lists(
    st.tuples(st.floats(-1.0, 1.0), st.floats(-0.5, 0.5), st.floats(-3.0, 3.0), st.integers(0, 12)), max_size=5
)


def model_of(law: int, **planning: float) -> Records:
    return make_model(law, Robot(), Goal(90.0, 90.0), PlanningSettings(step=DT, **planning))


def arrays(parts: list[tuple[float, float, float, int]]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Controls, shape (n, 3), and steps, shape (n,)."""
    return np.array([p[:3] for p in parts]).reshape(-1, 3), np.array([p[3] for p in parts], dtype=np.int64)


def drive_by_hand(parts: list[tuple[float, float, float, int]], law: int) -> tuple[list, list]:
    """States and commands, step by step through the motion model."""
    state, states, commands = tuple(START), [tuple(START)], []
    for *control, steps in parts:
        for _ in range(steps):
            command = control[0], control[1]
            if law == STEERING:
                state = kinematic_step(*state[:3], command, DT)
            else:
                if law == CLOSED_LOOP:
                    command = tracking_command(*state[:3], tuple(control), Limits(), Gains())
                state = dynamic_step(*state, command, Limits(), DT)
            states.append(state)
            commands.append(command)
    commands.append(commands[-1] if commands else tuple(START[3:]))
    return states, commands


@pytest.fixture(scope="module", params=LAWS.values(), ids=LAWS)
def search(request: pytest.FixtureRequest) -> Search:
    """A tree of a few hundred nodes."""
    world = World(Bounds((-5.0, -5.0), (5.0, 5.0)), [Disc((1.0, 1.0), 0.5)])
    search = Search(model_of(request.param), world, Footprint.point(), [State(*START)], seed=2)
    search.run(lambda _: False, 800)
    assert search.nodes > 100
    return search


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
@given(parts=controls_and_steps)
def test_a_path_is_driven_step_by_step(law: int, parts: list[tuple[float, float, float, int]]) -> None:
    states, commands = replay_path(START, *arrays(parts), model_of(law))
    by_hand = drive_by_hand(parts, law)
    assert np.array_equal(states, by_hand[0])
    assert np.array_equal(commands, by_hand[1])
    python = np.empty_like(states), np.empty_like(commands)
    plain(fill_path)(START, *arrays(parts), model_of(law).view(np.recarray), *python)
    assert states == pytest.approx(python[0], abs=1e-13)
    assert commands == pytest.approx(python[1], abs=1e-13)


@given(parts=controls_and_steps, cut=st.integers(0, 5))
def test_a_path_in_two_parts_is_the_path(parts: list[tuple[float, float, float, int]], cut: int) -> None:
    model = model_of(OPEN_LOOP)
    whole, _ = replay_path(START, *arrays(parts), model)
    first, _ = replay_path(START, *arrays(parts[:cut]), model)
    second, _ = replay_path(first[-1], *arrays(parts[cut:]), model)
    assert np.array_equal(whole, np.concatenate([first, second[1:]]))


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_a_trajectory_is_on_the_integration_grid_and_knows_how_its_velocities_change(law: int) -> None:
    trajectory = trajectory_from_controls(START, np.array([(0.7, 0.2, 0.1)]), np.array([7]), model_of(law))
    assert trajectory.t == pytest.approx(DT * np.arange(8), abs=1e-15)
    assert trajectory.kinematic is (law == STEERING)
    states, commands = drive_by_hand([(0.7, 0.2, 0.1, 7)], law)
    rows = np.column_stack([trajectory.x, trajectory.y, trajectory.theta, trajectory.v, trajectory.omega])
    assert np.array_equal(rows, states)
    assert np.array_equal(np.column_stack([trajectory.v_command, trajectory.omega_command]), commands)
    assert (trajectory.v_command[-1], trajectory.omega_command[-1]) == commands[-2]


def test_no_controls_leave_the_start_with_its_own_velocities() -> None:
    trajectory = trajectory_from_controls(START, np.empty((0, 3)), np.empty(0, dtype=np.int64), model_of(OPEN_LOOP))
    assert trajectory.t.tolist() == [0.0]
    assert (trajectory.x[0], trajectory.y[0], trajectory.theta[0]) == tuple(START[:3])
    assert (trajectory.v_command[0], trajectory.omega_command[0]) == tuple(START[3:])


def test_every_edge_of_a_tree_leads_from_parent_to_child_bit_for_bit(search: Search) -> None:
    states, parents, controls, steps = search.edges()
    for node in range(1, len(states)):
        way, _ = replay_path(states[parents[node]], controls[node : node + 1], steps[node : node + 1], search.model)
        assert np.array_equal(way[-1], states[node])


def test_every_edge_has_its_line_and_a_gap_after_it(search: Search) -> None:
    states, parents, controls, steps = search.edges()
    tree = search.tree()
    assert np.array_equal(tree.states, states)
    assert np.array_equal(tree.parents, parents)
    gaps = np.flatnonzero(np.isnan(tree.polyline).all(axis=1))
    assert len(gaps) == len(states) - 1
    assert gaps[-1] == len(tree.polyline) - 1
    assert np.isnan(tree.polyline).any(axis=1).sum() == len(gaps)
    begin = 0
    for node, end in zip(range(1, len(states)), gaps, strict=True):
        line = tree.polyline[begin:end]
        way, _ = replay_path(states[parents[node]], controls[node : node + 1], steps[node : node + 1], search.model)
        assert np.array_equal(line, way[:, :2])
        begin = end + 1


def test_the_trajectory_of_a_tree_ends_at_its_last_node(search: Search) -> None:
    states, _, _, steps = search.edges()
    trajectory = search.trajectory()
    path = search.path_to(search.nodes - 1)
    assert path[0] == 0
    assert len(trajectory.t) == 1 + steps[path].sum()
    last = [getattr(trajectory, name)[-1] for name in ("x", "y", "theta", "v", "omega")]
    assert last == states[-1].tolist()
    ends = np.cumsum(steps[path])
    assert np.array_equal(np.column_stack([trajectory.x, trajectory.y])[ends], states[path, :2])


def test_roots_have_no_edge() -> None:
    states = np.array([START, (1.0, 1.0, 0.0, 0.0, 0.0)])
    roots = (np.array([-1, -1]), np.zeros((2, 3)), np.zeros(2, dtype=np.int64), model_of(OPEN_LOOP))
    assert replay_edges(states, *roots).shape == (0, 2)
    tree = tree_from_controls(states, *roots)
    assert len(tree) == 2
    assert len(tree.polyline) == 0


def test_an_edge_without_steps_is_a_point() -> None:
    """Such a node stands for a second start at the position of the first."""
    states, parents = np.array([START, START]), np.array([-1, 0])
    points = replay_edges(states, parents, np.zeros((2, 3)), np.zeros(2, dtype=np.int64), model_of(OPEN_LOOP))
    assert points[0].tolist() == START[:2].tolist()
    assert all(math.isnan(value) for value in points[1])
    assert len(points) == 2
