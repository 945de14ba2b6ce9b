"""Samples are drawn only where the robot may get to."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cbrrt_ompl import Bounds, Box, Footprint, Goal, Limits, Robot, Scenario, State, World, plan
from cbrrt_ompl.collision.scene import Scene, footprint_center
from cbrrt_ompl.optimise.anytime import robust_search
from cbrrt_ompl.planners import search as search_module
from cbrrt_ompl.planners.reachable import CLOSED, ReachableCells, reachable_cells, spread

BAR = Footprint.polygon([(0.0, -0.2), (0.8, -0.2), (0.8, 0.2), (0.0, 0.2)])
"""Off the origin, so that its centre is elsewhere."""


def building() -> World:
    """Rooms of 10 m by 8 m in the corner of 200 m by 100 m of blocked cells, and a hall that has no door."""
    blocked = np.ones((200, 400), dtype=np.bool_)
    blocked[4:20, 4:24] = False
    blocked[12, 4:20] = True
    blocked[60:180, 100:300] = False
    return World.from_grid(blocked, 0.5)


def states_of(scene: Scene, start: State, rows: int, columns: int) -> np.ndarray:
    """What is known of the cells of one grid."""
    states = np.zeros((rows, columns), dtype=np.int8)
    frame = scene.frame[0]
    row = int((start.y - frame["y_min"]) / (frame["y_max"] - frame["y_min"]) * rows)
    column = int((start.x - frame["x_min"]) / (frame["x_max"] - frame["x_min"]) * columns)
    assert spread(scene, 4, np.array([[row, column]]), states, np.empty((rows * columns, 2), dtype=np.int64))
    return states


@pytest.mark.parametrize("footprint", [BAR, Footprint.disc(0.3)], ids=lambda f: f.kind)
def test_in_a_closed_cell_the_robot_collides_wherever_it_stands(footprint: Footprint) -> None:
    rng = np.random.default_rng(3)
    boxes = [Box((x, y), (x + w, y + h)) for x, y, w, h in rng.uniform(0.5, 3.0, (40, 4)) * (4.0, 4.0, 0.5, 0.5)]
    world = World(Bounds((0.0, 0.0), (14.0, 14.0)), [b for b in boxes if min(b.min) > 2.2])
    states = states_of(world.scene(footprint), State(1.2, 1.2), 70, 70)
    closed = np.argwhere(states == CLOSED)
    assert len(closed) > 50
    for row, column in closed[:: len(closed) // 50]:
        for x, y, theta in rng.random((20, 3)):
            x, y, theta = 0.2 * (column + x), 0.2 * (row + y), 6.3 * theta
            center = footprint_center(footprint)[0]
            pose = x - center * math.cos(theta), y - center * math.sin(theta), theta
            assert world.clearance(footprint, pose) <= 0.0


@pytest.mark.parametrize("footprint", [BAR, Footprint.disc(0.3)], ids=lambda f: f.kind)
def test_samples_stay_in_the_rooms_that_the_start_is_connected_to(footprint: Footprint) -> None:
    cells = reachable_cells(building().scene(footprint), [State(6.0, 4.0)])
    assert cells is not None
    places = cells.place(np.random.default_rng(1).random((20_000, 2))) * (200.0, 100.0)
    assert (places.min(axis=0) > (1.0, 1.0)).all()
    assert (places.max(axis=0) < (13.0, 11.0)).all()
    corners = np.array([(3.0, 3.0), (11.0, 3.0), (3.0, 9.0), (11.0, 9.0)])  # of both rooms
    assert (np.hypot(*(places[:, None] - corners).T).min(axis=1) < 0.3).all()


def test_places_are_uniform_over_the_cells() -> None:
    cells = ReachableCells(np.array([[True, False, True], [False, False, True]]))
    x, y = cells.place(np.random.default_rng(2).random((30_000, 2))).T
    counts = np.histogram2d(y, x, bins=(2, 3), range=((0, 1), (0, 1)))[0]
    assert counts[[0, 1, 1], [1, 0, 1]].tolist() == [0, 0, 0]
    assert counts[[0, 0, 1], [0, 2, 2]] == pytest.approx(10_000, rel=0.03)
    assert np.histogram(x[x < 1 / 3], bins=4, range=(0, 1 / 3))[0] == pytest.approx(2500, rel=0.1)


def test_where_nearly_everything_can_be_reached_nothing_is_left_out() -> None:
    world = World(Bounds((0.0, 0.0), (14.0, 9.0)), [Box((5.0, 0.0), (6.0, 7.0))])
    assert reachable_cells(world.scene(BAR), [State(1.0, 1.0)]) is None


def test_a_building_in_a_large_blocked_map_is_planned_in_as_if_it_were_alone() -> None:
    """Samples all over the map left most of the tree's growth to chance."""
    whole = Scenario(
        name="building",
        world=building(),
        robot=Robot(footprint=Footprint.disc(0.3)),
        start=State(3.0, 9.0),
        goal=Goal(3.0, 3.0, tolerance=0.5),
    )
    crop = World.from_grid(whole.world.layer.blocked[:24, :28], 0.5)
    found = [plan(s, "cb-rrt-robust", seed=2) for s in (whole, replace(whole, world=crop))]
    assert [result.status for result in found] == ["solved"] * 2
    assert found[0].samples < 5 * found[1].samples


def test_a_search_again_is_that_of_its_seed() -> None:
    """Though the cells that it draws from are those of the first search."""
    scenario = Scenario(
        name="building",
        world=building(),
        robot=Robot(footprint=Footprint.disc(0.3)),
        start=State(3.0, 9.0),
        goal=Goal(3.0, 3.0, tolerance=0.5),
    )
    first = robust_search(scenario, 2)
    first.run(lambda _: False, 300)
    before = first.edges()[0].copy()
    again, fresh = first.again(5), robust_search(scenario, 5)
    for search in (again, fresh):
        search.run(lambda _: False, 300)
    assert all(np.array_equal(a, b) for a, b in zip(again.edges(), fresh.edges(), strict=True))
    assert len(again.edges()[0]) > 10
    assert np.array_equal(first.edges()[0], before)


def test_an_anytime_plan_looks_for_reachable_cells_once_a_direction(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []

    def counted(*arguments: Any) -> ReachableCells | None:
        calls.append(arguments)
        return reachable_cells(*arguments)

    monkeypatch.setattr(search_module, "reachable_cells", counted)
    for v_min, looks in ((0.0, 1), (-1.0, 2)):
        calls.clear()
        robot = Robot(Footprint.disc(0.3), Limits(v_min=v_min))
        scenario = Scenario(
            name="building", world=building(), robot=robot, start=State(3.0, 9.0), goal=Goal(3.0, 3.0, tolerance=0.5)
        )
        history = plan(scenario, "cb-rrt-anytime", seed=2, max_iterations=3000).history
        assert len(history) > 1
        assert len(calls) == looks
