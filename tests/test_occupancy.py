"""Grids made into few rectangles, exactly and in the right place; worlds of grids and of shapely geometries."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
import shapely
from hypothesis import example, given
from hypothesis.extra.numpy import array_shapes, arrays
from numpy.typing import ArrayLike, NDArray

from cbrrt_ompl.collision.occupancy import GridLayer, covering_rectangles, grid_bounds
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import MapError, WorldError
from cbrrt_ompl.problem.obstacles import Bounds, Box, Disc, Obstacle, OrientedBox, Polygon
from cbrrt_ompl.problem.robot import Footprint

grids = arrays(np.bool_, array_shapes(min_dims=2, max_dims=2, max_side=12))
ASYMMETRIC = np.array([(1, 0, 0, 0, 0), (1, 0, 0, 1, 0), (0, 0, 0, 0, 0)], dtype=bool)  # an L's foot lies at row 0
POINT = Footprint.point()
YAWS = (0.0, 0.3, -1.2, 2.5, 4.0, math.pi / 2, math.pi, -math.pi / 2, 1.5708, 1e-8)


def drawn(rectangles: NDArray[np.int32], shape: tuple[int, ...]) -> NDArray[np.bool_]:
    grid = np.zeros(shape, dtype=bool)
    for bottom, left, top, right in rectangles.tolist():
        grid[bottom:top, left:right] = True
    return grid


@given(grids)
@example(np.ones((3, 4), dtype=bool))
@example(np.zeros((2, 2), dtype=bool))
def test_the_rectangles_cover_the_true_cells_and_no_other(grid: NDArray[np.bool_]) -> None:
    np.testing.assert_array_equal(drawn(covering_rectangles(grid), grid.shape), grid)


@given(grids)
def test_no_rectangle_can_grow_up_or_right_and_each_covers_something_of_its_own(grid: NDArray[np.bool_]) -> None:
    rectangles = covering_rectangles(grid)
    padded = np.pad(grid, (0, 1))
    covered = np.zeros(grid.shape, dtype=bool)
    for bottom, left, top, right in rectangles.tolist():
        assert not padded[bottom:top, right].all()
        assert not padded[top, left:right].all()
        assert not covered[bottom:top, left:right].all()
        covered[bottom:top, left:right] = True


def test_a_wall_is_one_rectangle_and_a_cross_two() -> None:
    cross = np.zeros((50, 60), dtype=bool)
    cross[20:22], cross[:, 30] = True, True
    assert covering_rectangles(np.ones((50, 60), dtype=bool)).tolist() == [[0, 0, 50, 60]]
    assert sorted(covering_rectangles(cross).tolist()) == [[0, 30, 50, 31], [20, 0, 22, 60]]


def test_more_rectangles_than_there_was_room_for_are_all_there() -> None:
    board = np.indices((400, 400)).sum(axis=0) % 2 == 0
    rectangles = covering_rectangles(board)
    assert len(rectangles) == 80_000
    np.testing.assert_array_equal(drawn(rectangles, board.shape), board)


@pytest.mark.parametrize("yaw", YAWS)
def test_a_cell_lies_where_ros_says_and_nothing_around_it(yaw: float) -> None:
    origin, resolution = (-3.0, 1.5, yaw), 0.25
    world = World.from_grid(ASYMMETRIC, resolution, origin)
    c, s = math.cos(yaw), math.sin(yaw)
    for r in range(-1, 4):
        for col in range(-1, 6):
            is_inside = 0 <= r < 3 and 0 <= col < 5
            for u, v in ((0.01, 0.01), (0.99, 0.01), (0.01, 0.99), (0.99, 0.99), (0.5, 0.5)):
                along, up = (col + u) * resolution, (r + v) * resolution
                x, y = origin[0] + c * along - s * up, origin[1] + s * along + c * up
                expected = bool(ASYMMETRIC[r, col]) if is_inside else True
                assert world.collides(POINT, (x, y, 0.0)) == expected, (r, col, u, v)


@pytest.mark.parametrize("yaw", YAWS)
@pytest.mark.parametrize("seed", range(3))
def test_the_obstacles_are_the_blocked_cells_and_what_is_out_of_the_map(yaw: float, seed: int) -> None:
    grid = np.random.default_rng(seed).random((7, 9)) < 0.5
    origin, resolution = (1.0, -2.0, yaw), 0.1
    bounds = grid_bounds(grid.shape, resolution, origin)
    found = shapely.union_all([o.to_shapely() for o in GridLayer(grid, resolution, origin).obstacles])
    cells = [shapely.box(column, row, column + 1, row + 1) for row, column in np.argwhere(grid)]
    c, s = resolution * math.cos(yaw), resolution * math.sin(yaw)

    def in_world(shape: shapely.Geometry) -> shapely.Geometry:
        return shapely.transform(shape, lambda p: p @ np.array([(c, s), (-s, c)]) + origin[:2])

    outside = shapely.box(*bounds.min, *bounds.max).difference(in_world(shapely.box(0, 0, 9, 7)))
    expected = shapely.union_all([in_world(shapely.union_all(cells)), outside])
    assert shapely.symmetric_difference(found, expected).area < 1e-6


def test_bounds_of_a_rotated_map_hold_it_closely() -> None:
    bounds = grid_bounds((2, 4), 1.0, (1.0, 2.0, math.pi / 2))
    assert (bounds.min, bounds.max) == ((-1.0, 2.0), (1.0, 6.0))
    tilted = grid_bounds((1, 1), 1.0, (0.0, 0.0, math.pi / 4))
    assert tilted.size == pytest.approx((math.sqrt(2.0), math.sqrt(2.0)))


def blocked_pattern(world: World, shape: tuple[int, int]) -> list[list[bool]]:
    return [[world.collides(POINT, (c + 0.5, r + 0.5, 0.0)) for c in range(shape[1])] for r in range(shape[0])]


@pytest.mark.parametrize(
    "grid",
    [
        np.array([(True, False, False)]),
        np.array([(1, 0, 0)]),
        np.array([(1, 0, -1)], dtype=np.int8),
        np.array([(100, 0, 50)], dtype=np.int8),
        np.array([(66, 19, -1)]),
        np.array([(0.9, 0.1, 0.5)]),
        np.array([(1.0, 0.0, math.nan)], dtype=np.float32),
        [[1.0, 0.0, 0.0]],
    ],
)
def test_bools_likelihoods_and_the_numbers_of_ros_mean_what_they_say(grid: ArrayLike) -> None:
    """A grid of 0 and 1 is one of truth values: as percent, all of it would have been free."""
    world = World.from_grid(grid, 1.0, unknown="free")
    assert blocked_pattern(world, (1, 3)) == [[True, False, False]]


def test_unknown_cells_are_blocked_unless_they_are_called_free() -> None:
    grid = np.array([(100, -1, 0)])
    assert blocked_pattern(World.from_grid(grid, 1.0), (1, 3)) == [[True, True, False]]
    assert blocked_pattern(World.from_grid(grid, 1.0, unknown="free"), (1, 3)) == [[True, False, False]]


def test_thresholds_part_likelihoods() -> None:
    world = World.from_grid([[0.4, 0.3, 0.2]], 1.0, occupied_thresh=0.35, free_thresh=0.35)
    assert blocked_pattern(world, (1, 3)) == [[True, False, False]]


@pytest.mark.parametrize(
    ("grid", "words"),
    [
        (np.zeros(3), "rows and columns"),
        (np.zeros((0, 3)), "rows and columns"),
        ([[0, 1], [1]], "rows and columns"),
        (np.full((2, 2), 255), "whole numbers from -1 to 100"),
        (np.full((2, 2), 1.5), "likelihoods from 0 to 1"),
        (np.full((2, 2), math.inf), "likelihoods from 0 to 1"),
        (np.array([["a", "b"]]), "truth values or numbers"),
        (np.ones((2, 2), dtype=bool), "a free one"),
        (np.full((2, 2), math.nan), r"a free one \(unknown cells count as occupied\)"),
        (np.broadcast_to(np.zeros(1), (20_000, 20_000)), "at most 100000000 cells"),
    ],
)
def test_an_array_that_is_no_map_is_refused_in_one_line(grid: NDArray[np.generic], words: str) -> None:
    with pytest.raises(MapError, match=words) as caught:
        World.from_grid(grid, 0.1)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize("resolution", [0.0, -0.05, math.nan, math.inf, "0.05", None, True, 1e7])
def test_a_cell_without_a_size_is_refused(resolution: float) -> None:
    with pytest.raises(MapError, match="resolution: got"):
        World.from_grid(ASYMMETRIC, resolution)


@pytest.mark.parametrize(
    "origin", [(0.0, 0.0), (0.0, 0.0, 0.0, 1.0), (0.0, math.nan, 0.0), "abc", 3.0, (2e6, 0.0, 0.0)]
)
def test_an_origin_that_is_no_pose_is_refused(origin: tuple[float, ...]) -> None:
    with pytest.raises(MapError, match="expected (three finite numbers|a map within)"):
        World.from_grid(ASYMMETRIC, 0.05, origin)


@pytest.mark.parametrize(("low", "high"), [(0.7, 0.6), (-0.1, 0.5), (0.2, 1.1), (math.nan, 0.5)])
def test_thresholds_out_of_order_are_refused(low: float, high: float) -> None:
    with pytest.raises(MapError, match="0 <= free_thresh <= occupied_thresh <= 1"):
        World.from_grid(ASYMMETRIC, 0.05, occupied_thresh=high, free_thresh=low)


def test_another_word_for_unknown_is_refused() -> None:
    with pytest.raises(MapError, match="unknown: got 'yes', expected one of occupied, free"):
        World.from_grid(ASYMMETRIC, 0.05, unknown="yes")


@pytest.mark.parametrize(
    "footprint", [POINT, Footprint.disc(0.2), Footprint.polygon([(-0.3, -0.2), (0.4, 0.0), (-0.3, 0.2)])]
)
def test_an_oriented_box_is_as_far_as_shapely_says(footprint: Footprint) -> None:
    box = OrientedBox((0.3, -0.2), (1.4, 0.5), 0.7)
    world = World(Bounds((-5.0, -5.0), (5.0, 5.0)), [box])
    rng = np.random.default_rng(4)
    for x, y, theta in rng.uniform((-2.0, -2.0, -3.0), (2.0, 2.0, 3.0), (200, 3)):
        here = shapely.Polygon(footprint.outline_at((x, y, theta))) if footprint.vertices is not None else None
        gap = shapely.distance(here or shapely.Point(x, y), box.to_shapely()) - footprint.radius
        assert world.collides(footprint, (x, y, theta)) == (gap <= 0.0)
        assert world.clearance(footprint, (x, y, theta)) == pytest.approx(max(gap, 0.0), abs=1e-6)


def test_the_depth_in_an_oriented_box_is_that_below_its_nearest_side() -> None:
    box = OrientedBox((0.0, 0.0), (2.0, 1.0), math.radians(30.0))
    world = World(Bounds((-5.0, -5.0), (5.0, 5.0)), [box])
    assert world.signed_clearance(0.0, 0.0) == pytest.approx(-0.5)
    along = (0.9 * math.cos(box.angle), 0.9 * math.sin(box.angle))
    assert world.signed_clearance(*along) == pytest.approx(-0.1)


@pytest.mark.parametrize(
    ("change", "field"),
    [({"center": (math.nan, 0.0)}, "center"), ({"size": (1.0, 0.0)}, "size"), ({"angle": math.inf}, "angle")],
)
def test_an_oriented_box_that_is_no_solid_is_refused(change: dict[str, tuple[float, float]], field: str) -> None:
    values = {"center": (0.0, 0.0), "size": (1.0, 1.0), "angle": 0.0} | change
    with pytest.raises(WorldError, match=f"oriented_box.{field}"):
        OrientedBox(**values)  # type: ignore[arg-type]  # wrong on purpose


def test_a_shapely_geometry_keeps_its_parts_and_holes() -> None:
    ring = shapely.Point(0.0, 0.0).buffer(2.0).difference(shapely.box(-0.5, -0.5, 0.5, 0.5))
    parts = shapely.union_all([ring, shapely.box(5.0, 0.0, 6.0, 1.0)])
    world = World.from_shapely(parts)
    assert isinstance(parts, shapely.MultiPolygon)
    assert shapely.union_all([o.to_shapely() for o in world.obstacles]).equals(parts)
    assert (world.bounds.min, world.bounds.max) == ((-2.0, -2.0), (6.0, 2.0))
    assert [world.collides(POINT, (x, 0.1, 0.0)) for x in (0.0, 1.0, 3.0, 5.5)] == [False, True, False, True]


def test_shapely_geometries_come_in_lists_and_collections_too() -> None:
    bounds = Bounds((-1.0, -1.0), (9.0, 9.0))
    parts = [shapely.box(0, 0, 1, 1), shapely.GeometryCollection([shapely.box(2, 2, 3, 3), shapely.Polygon()])]
    assert len(World.from_shapely(parts, bounds).obstacles) == 2
    assert World.from_shapely(shapely.Polygon(), bounds).obstacles == ()


@pytest.mark.parametrize(
    ("geometry", "words"),
    [
        (shapely.LineString([(0, 0), (1, 1)]), "shapely.buffer"),
        (shapely.GeometryCollection([shapely.Point(0, 0)]), "shapely.buffer"),
        (shapely.Polygon(), "bounds, where the geometry is empty"),
        (shapely.Polygon([(0, 0), (1, 1), (1, 0), (0, 1)]), "a simple polygon"),
        ("POLYGON EMPTY", "shapely.buffer"),
    ],
)
def test_a_geometry_without_an_area_is_refused(geometry: object, words: str) -> None:
    with pytest.raises(WorldError, match=words):
        World.from_shapely(geometry)


@pytest.mark.slow
def test_a_hundred_thousand_obstacles_are_built_and_asked_quickly() -> None:
    """The broad phase once split tall boxes by height, where all are alike: a query took a millisecond."""
    rng = np.random.default_rng(0)
    places = rng.uniform(0.0, 100.0, (100_000, 2)).tolist()
    obstacles: list[Obstacle] = [Box((x, y), (x + 0.05, y + 0.05)) for x, y in places[:90_000]]
    obstacles += [Disc((x, y), 0.03) for x, y in places[90_000:]]
    started = time.process_time()
    world, disc = World(Bounds((-1.0, -1.0), (101.0, 101.0)), obstacles), Footprint.disc(0.1)
    world.collides(disc, (0.0, 0.0, 0.0))
    world.referee(disc)
    built = time.process_time()
    for x, y in places[:1000]:
        world.collides(disc, (x + 0.2, y, 0.0))
        world.referee(disc).collides(x + 0.2, y, 0.0)
    assert built - started < 3.0
    assert time.process_time() - built < 0.3


@pytest.mark.slow
def test_a_thousand_polygons_cost_a_point_no_more_than_those_around_it() -> None:
    """Every query inside a solid once asked shapely about every polygon of the world."""
    corners = np.array([(0.0, 0.0), (0.6, 0.0), (0.3, 0.5)])
    polygons = [Polygon(corners + (i % 40, i // 40)) for i in range(1600)]
    world = World(Bounds((-1.0, -1.0), (41.0, 41.0)), polygons)
    started = time.process_time()
    depths = [world.signed_clearance(i % 40 + 0.3, i // 40 + 0.2) for i in range(1600)]
    assert time.process_time() - started < 1.0
    assert depths == pytest.approx([-shapely.Polygon(corners).exterior.distance(shapely.Point(0.3, 0.2))] * 1600)


def blocked_by(costs: ArrayLike, **settings: object) -> list[list[bool]]:
    """Which cells of a costmap the world of it blocks."""
    world = World.from_costmap(costs, 1.0, **settings)
    rows, columns = np.shape(costs)
    return [[world.collides(POINT, (c + 0.5, r + 0.5, 0.0)) for c in range(columns)] for r in range(rows)]


def test_a_costmap_blocks_where_it_is_lethal_or_unknown() -> None:
    costs = np.array([[0, 252, 253, 254, 255]], dtype=np.uint8)
    assert blocked_by(costs) == [[False, False, False, True, True]]
    assert blocked_by(costs, unknown="free") == [[False, False, False, True, False]]
    assert blocked_by(costs, lethal_threshold=253) == [[False, False, True, True, True]]
    assert blocked_by(costs.astype(np.int64)) == blocked_by(costs)


@pytest.mark.parametrize(("dtype", "unseen"), [(np.int8, -1), (np.int64, -1), (np.uint8, 255)])
def test_an_occupancy_grid_blocks_at_100_percent_or_unknown(dtype: type, unseen: int) -> None:
    """In uint8 as well: nav2_simple_commander's PyCostmap2D keeps percent in one, -1 as 255."""
    costs = np.array([[0, 50, 99, 100, unseen]]).astype(dtype)
    assert blocked_by(costs) == [[False, False, False, True, True]]
    assert blocked_by(costs, lethal_threshold=65) == [[False, False, True, True, True]]
    assert blocked_by(costs, unknown="free") == [[False, False, False, True, False]]


def test_the_first_row_of_a_costmap_is_the_lowest_and_its_origin_turns_it() -> None:
    world = World.from_costmap(np.array([[254, 0], [0, 0]]), 0.5, (1.0, 2.0, math.pi / 2))
    assert world.collides(POINT, (0.75, 2.25, 0.0))
    assert not world.collides(POINT, (0.75, 2.75, 0.0))


@pytest.mark.parametrize(
    ("costs", "settings", "words"),
    [
        ([[0.5]], {}, "costs: got values of type float64, expected whole numbers"),
        ([0, 1], {}, "costs: got the shape (2,), expected cells in rows and columns"),
        ([[0], [0, 1]], {}, "costs: got"),
        ([[-2, 0]], {}, "costs: got values from -2 to 0"),
        ([[256]], {}, "costs: got values from 256 to 256"),
        ([[0, 254]], {"lethal_threshold": 255}, "lethal_threshold: got 255, expected a whole number from 1 to 254"),
        ([[0, 100]], {"lethal_threshold": 0}, "lethal_threshold: got 0, expected a whole number from 1 to 100"),
        ([[0, 100]], {"lethal_threshold": 65.0}, "lethal_threshold: got 65.0"),
        ([[254]], {}, "cells: got 1 x 1 blocked ones"),
    ],
)
def test_what_is_no_costmap_is_refused(costs: ArrayLike, settings: dict[str, object], words: str) -> None:
    with pytest.raises(MapError) as caught:
        World.from_costmap(costs, 1.0, **settings)
    assert words in str(caught.value)
