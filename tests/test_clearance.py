"""Distances of the kernels: exact as shapely's, of FCL's sign, and the same whatever the index leaves out."""

from __future__ import annotations

import math
import pickle
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from cbrrt_ompl.collision.clearance import ENOUGH, clearance, clearance_at, clearances_at
from cbrrt_ompl.collision.convex import convex_parts
from cbrrt_ompl.collision.index import CELL
from cbrrt_ompl.collision.motion_check import is_free
from cbrrt_ompl.collision.pieces import footprint_pieces, join
from cbrrt_ompl.collision.scene import Scene, footprint_center, footprint_radii
from cbrrt_ompl.collision.world import CONTACT_BAND, World
from cbrrt_ompl.errors import MapError, WorldError
from cbrrt_ompl.motion.records import record_array
from cbrrt_ompl.planners.roll_out import margin_at
from cbrrt_ompl.problem.obstacles import Bounds, Box, Disc, Obstacle, OrientedBox, Polygon
from cbrrt_ompl.problem.robot import Footprint
from cbrrt_ompl.verification.distances import Distances

ROUNDING = 1e-9
"""Difference of distances that rounding explains where no coordinate is above 100 m [m]."""

FOOTPRINTS = {
    "point": Footprint.point(),
    "disc": Footprint.disc(0.12),
    "rectangle": Footprint.polygon([(-0.2, -0.1), (0.2, -0.1), (0.2, 0.1), (-0.2, 0.1)]),
    "rectangle off its origin": Footprint.polygon([(-0.1, -0.05), (0.4, -0.05), (0.4, 0.15), (-0.1, 0.15)]),
    "turned rectangle": Footprint.polygon([(-0.2, 0.0), (0.0, -0.2), (0.3, 0.1), (0.1, 0.3)]),
    "arrow": Footprint.polygon([(-0.2, -0.15), (0.25, 0.0), (-0.2, 0.15), (-0.05, 0.0)]),
    "L": Footprint.polygon([(0.0, 0.0), (0.4, 0.0), (0.4, 0.1), (0.1, 0.1), (0.1, 0.5), (0.0, 0.5)]),
    "pentagon": Footprint.polygon([(0.2, 0.0), (0.05, 0.2), (-0.15, 0.1), (-0.15, -0.1), (0.05, -0.2)]),
    "beside its origin": Footprint.polygon([(0.1, -0.1), (0.3, -0.1), (0.3, 0.1), (0.1, 0.1)]),
}


def boxes() -> World:
    rng = np.random.default_rng(1)
    low, sides = rng.uniform(-5.0, 4.5, (23, 2)), rng.uniform(0.05, 1.2, (23, 2))
    made = [Box(tuple(a), tuple(a + s)) for a, s in zip(low, sides, strict=True)]
    return World(Bounds((-5.0, -5.0), (5.0, 5.0)), made)


def discs() -> World:
    rng = np.random.default_rng(2)
    made = [Disc(tuple(rng.uniform((-3.0, -1.5), (3.0, 1.5))), float(rng.uniform(0.02, 0.4))) for _ in range(25)]
    return World(Bounds((-3.0, -1.5), (3.0, 1.5)), made)


def slanted_polygons() -> World:
    rng = np.random.default_rng(3)
    made: list[Obstacle] = [
        OrientedBox(tuple(rng.uniform(-3.0, 3.0, 2)), tuple(rng.uniform(0.01, 1.0, 2)), float(rng.uniform(-4.0, 4.0)))
        for _ in range(8)
    ]
    for _ in range(8):
        angles = np.sort(rng.uniform(0.0, math.tau, 3)) + np.array([0.0, 0.05, 0.1])
        radius = rng.uniform(0.2, 0.8)
        made.append(Polygon(rng.uniform(-3.0, 3.0, 2) + radius * np.column_stack([np.cos(angles), np.sin(angles)])))
    return World(Bounds((-3.0, -3.0), (3.0, 3.0)), made)


STAR = np.column_stack([f(np.arange(10) * math.pi / 5.0) * np.tile([1.0, 0.35], 5) for f in (np.cos, np.sin)])
COMB = [(-2.8, -2.5), (2.8, -2.5), (2.8, -1.0), (2.6, -2.2), (1.0, -2.3), (0.9, -1.0), (0.7, -2.2), (-2.6, -2.0)]


def polygons_that_are_not_convex() -> World:
    hole = np.array([(-0.2, -0.15), (0.2, -0.1), (0.1, 0.2)])
    frame = np.array([(-2.9, 0.1), (-0.6, 0.3), (-0.8, 2.6), (-2.5, 2.9)])
    return World(
        Bounds((-3.0, -3.0), (3.0, 3.0)),
        [
            Polygon(np.array(COMB)),
            Polygon(STAR + (1.5, 1.4), (hole + (1.5, 1.4),)),
            Polygon(frame, (np.array([(-2.5, 0.6), (-1.0, 0.7), (-1.1, 2.2), (-2.2, 2.4)]),)),
        ],
    )


def overlapping_obstacles() -> World:
    return World(
        Bounds((-2.0, -3.0), (2.0, 3.0)),
        [
            Box((-1.0, -1.0), (0.0, 1.0)),
            Box((-0.5, -0.5), (0.5, 0.5)),
            Box((0.5, -0.5), (1.0, 0.0)),
            Disc((-1.0, 1.0), 0.5),
            Disc((-1.0, 1.2), 0.5),
            Disc((-1.0, 1.2), 0.2),
            OrientedBox((0.0, 0.0), (3.0, 0.2), 0.8),
            Polygon(np.array([(-1.5, -2.5), (1.0, -2.0), (0.0, -1.0), (-0.3, -1.8)])),
            Polygon(np.array([(-1.0, -2.8), (0.5, -2.2), (0.2, 0.2)])),
            Box((1.5, -3.5), (2.5, -2.0)),
        ],
    )


def wide_hall() -> World:
    """Most of it is far from everything; its bounds are not square."""
    corner = [Disc((x, 1.0), 0.05) for x in (1.0, 1.5, 2.0)]
    return World(Bounds((0.0, -1.0), (90.0, 40.0)), [Box((80.0, 35.0), (81.0, 36.0)), *corner])


def grid_map() -> World:
    return World.from_grid(np.random.default_rng(4).random((80, 120)) < 0.04, 0.1)


def turned_grid_map() -> World:
    return World.from_grid(np.random.default_rng(5).random((20, 30)) < 0.1, 0.1, (1.0, -2.0, 0.4))


def far_from_the_origin() -> World:
    return World(
        Bounds((499_997.0, -700_003.0), (500_003.0, -699_997.0)),
        [
            Polygon(np.array([(-2.0, -2.0), (1.0, -1.5), (0.0, 0.0), (-0.5, -1.2)]) + (500_000.0, -700_000.0)),
            Disc((499_999.0, -699_999.0), 0.5),
            OrientedBox((500_001.0, -699_999.0), (1.0, 0.3), 0.5),
            Box((500_001.0, -700_002.0), (500_002.0, -700_001.0)),
        ],
    )


def nothing() -> World:
    return World(Bounds((-1.0, -2.0), (1.5, 2.0)))


WORLDS = {
    "boxes": boxes,
    "discs": discs,
    "slanted polygons": slanted_polygons,
    "polygons that are not convex": polygons_that_are_not_convex,
    "overlapping obstacles": overlapping_obstacles,
    "wide hall": wide_hall,
    "grid map": grid_map,
    "turned grid map": turned_grid_map,
    "far from the origin": far_from_the_origin,
    "nothing": nothing,
}


@pytest.fixture(scope="module", params=WORLDS)
def world(request: pytest.FixtureRequest) -> World:
    return WORLDS[request.param]()


@pytest.fixture(params=FOOTPRINTS)
def footprint(request: pytest.FixtureRequest) -> Footprint:
    return FOOTPRINTS[request.param]


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20)


def rounding(world: World) -> float:
    """`ROUNDING`, or more where coordinates have fewer digits left [m]."""
    return max(ROUNDING, 1e-14 * np.abs([*world.bounds.min, *world.bounds.max]).max())


def uniform_poses(world: World, count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Poses in the bounds and a little beside them, shape (count, 3)."""
    (x0, y0), (x1, y1) = world.bounds.min, world.bounds.max
    return rng.uniform((x0 - 0.2, y0 - 0.2, -4.0), (x1 + 0.2, y1 + 0.2, 4.0), (count, 3))


def border_poses(world: World, footprint: Footprint, count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Poses at 1e-9 m to 1 cm from one where validity changes, shape (count, 3)."""
    scene = world.scene(footprint)
    poses = uniform_poses(world, 4000, rng)
    found = clearances_at(scene, poses)
    free, blocked = (poses[rng.choice(np.flatnonzero(which), count)] for which in (found > 0.0, found <= 0.0))
    blocked[:, 2] = free[:, 2]
    outside = clearances_at(scene, blocked) > 0.0  # at this heading it is free: leave the bounds instead
    blocked[outside, 0] = world.bounds.max[0]
    for _ in range(50):
        middle = 0.5 * (free + blocked)
        is_free_there = (clearances_at(scene, middle) > 0.0)[:, None]
        free, blocked = np.where(is_free_there, middle, free), np.where(is_free_there, blocked, middle)
    angles, radii = rng.uniform(0.0, math.tau, count), 10.0 ** rng.uniform(-9.0, -2.0, count)
    return free + np.column_stack([radii * np.cos(angles), radii * np.sin(angles), np.zeros(count)])


def poses_in(world: World, footprint: Footprint, rng: np.random.Generator, count: int = 300) -> NDArray[np.float64]:
    """Poses anywhere and near contact, shape (2 count, 3)."""
    return np.concatenate([uniform_poses(world, count, rng), border_poses(world, footprint, count, rng)])


def distances_by_shapely(world: World, footprint: Footprint, poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance of a footprint from the nearest obstacle or wall; 0 or less where it touches one, shape (n,) [m]."""
    low, high = np.array(world.bounds.min), np.array(world.bounds.max)
    origins = poses[:, None, :2]  # (n, 1, 2)
    outline, areas = origins, shapely.points(poses[:, :2])
    if footprint.vertices is not None:
        c, s = np.cos(poses[:, 2])[:, None], np.sin(poses[:, 2])[:, None]
        x, y = footprint.vertices.T
        outline = origins + np.stack([c * x - s * y, s * x + c * y], axis=-1)  # (n, corners, 2)
        areas = shapely.polygons(outline)
    found = np.minimum(outline - low, high - outline).min(axis=(1, 2)) - footprint.radius
    for obstacle in world.obstacles:
        if isinstance(obstacle, Disc):
            gap = shapely.distance(areas, shapely.Point(obstacle.center)) - obstacle.radius
        else:
            gap = shapely.distance(areas, obstacle.to_shapely())
        found = np.minimum(found, gap - footprint.radius)
    room = np.minimum(origins - low, high - origins).min(axis=(1, 2))
    return np.where(room > 0.0, np.minimum(found, room), -1.0)


def assert_exact(world: World, footprint: Footprint, poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """The kernels' distances, which are shapely's; below zero both only say that something is touched."""
    found, expected = clearances_at(world.scene(footprint), poses), distances_by_shapely(world, footprint, poses)
    np.testing.assert_allclose(np.maximum(found, 0.0), np.maximum(expected, 0.0), rtol=0.0, atol=rounding(world))
    return found


class TestDistance:
    def test_it_is_that_of_shapely(self, world: World, footprint: Footprint, rng: np.random.Generator) -> None:
        found = assert_exact(world, footprint, poses_in(world, footprint, rng))
        assert 50 < (found > 0.0).sum() < 550
        assert ((found > 0.0) & (found < 1e-4)).any()

    def test_it_has_the_sign_of_fcl(self, world: World, footprint: Footprint, rng: np.random.Generator) -> None:
        referee = world.referee(footprint)
        for pose in poses_in(world, footprint, rng, 200).tolist():
            found, touches = clearance_at(*world.scene(footprint), *pose), referee.collides(*pose)
            assert world.collides(footprint, pose) == touches
            if abs(found) > CONTACT_BAND:
                assert touches == (found < 0.0), pose

    def test_it_changes_no_more_than_the_footprint_moves(
        self, world: World, footprint: Footprint, rng: np.random.Generator
    ) -> None:
        """Where a cell of the index lacked a piece, it would jump at the cell's border."""
        scene, count = world.scene(footprint), 4000
        reach = scene.frame["reach"][0]
        start = uniform_poses(world, count, rng)
        angle, way = rng.uniform(0.0, math.tau, count), 0.2 * rng.random(count)
        turn = rng.uniform(-0.3, 0.3, count)
        end = start + np.column_stack([way * np.cos(angle), way * np.sin(angle), turn])
        before, after = (np.maximum(clearances_at(scene, poses), 0.0) for poses in (start, end))
        assert (np.abs(after - before) <= way + reach * np.abs(turn) + rounding(world)).all()

    def test_the_index_leaves_out_nothing_that_matters(
        self, world: World, footprint: Footprint, rng: np.random.Generator
    ) -> None:
        scene, poses = world.scene(footprint), poses_in(world, footprint, rng, 1000)
        found, of_all = clearances_at(scene, poses), clearances_at(without_index(world, footprint), poses)
        np.testing.assert_allclose(np.maximum(found, 0.0), np.maximum(of_all, 0.0), rtol=0.0, atol=rounding(world))
        assert ((found > 0.0) == (of_all > 0.0)).all()

    def test_a_bound_is_given_only_where_it_is_enough(
        self, world: World, footprint: Footprint, rng: np.random.Generator
    ) -> None:
        scene, poses = world.scene(footprint), poses_in(world, footprint, rng)
        exact = np.maximum(distances_by_shapely(world, footprint, poses), 0.0)
        for enough in (1e-3, ENOUGH, 2.0):
            bounds = np.array([clearance(scene, *pose, enough)[0] for pose in poses.tolist()])
            assert (bounds <= exact + rounding(world)).all()
            is_near = exact < enough - rounding(world)
            np.testing.assert_allclose(np.maximum(bounds[is_near], 0.0), exact[is_near], rtol=0.0, atol=rounding(world))
            assert (bounds[~is_near] >= enough - rounding(world)).all()

    def test_a_margin_holds_for_the_way_and_the_turn_that_use_it_up(
        self, world: World, footprint: Footprint, rng: np.random.Generator
    ) -> None:
        """One for any heading is used up by how far the turn moves the footprint's centre, others by its corners."""
        scene = world.scene(footprint)
        frame = scene.frame[0]
        for pose in poses_in(world, footprint, rng, 200).tolist():
            distance, any_heading = clearance(scene, *pose, 0.01)
            margin = distance - rounding(world)
            if margin <= 0.0:
                continue
            arm = frame["center_distance"] if any_heading else frame["reach"]
            used = margin * (1.0 - rng.random(20) ** 4)  # mostly close to the end
            turned = used * rng.random(20) if arm > 0.0 else np.zeros(20)
            turns = rng.choice([-1.0, 1.0], 20) * (turned / arm if arm > 0.0 else 9.0 * rng.random(20))
            angles = rng.uniform(0.0, math.tau, 20)
            moves = np.column_stack([(used - turned) * np.cos(angles), (used - turned) * np.sin(angles), turns])
            there = clearances_at(scene, np.array(pose) + moves)
            assert (there >= margin - used).all()

    def test_far_from_everything_it_is_a_bound_for_any_heading(self, footprint: Footprint) -> None:
        scene = wide_hall().scene(footprint)
        bound, exact = (clearance(scene, 40.0, 20.0, 0.3, enough) for enough in (ENOUGH, 100.0))
        assert 5.0 < bound[0] <= exact[0]
        assert (bound[1], exact[1]) == (True, footprint.is_round)


def without_index(world: World, footprint: Footprint) -> Scene:
    """A scene of a single cell, whose list holds all pieces."""
    center = footprint_center(footprint)
    own = footprint_pieces(footprint, center)
    pieces, corners = join((own, world.pieces))
    frame, cells = world.scene(footprint).frame.copy(), record_array(1, CELL)
    frame["roots"], frame["roots_per_metre"] = 1, 0.0
    cells["clearance"], cells["count"] = -math.inf, len(world.pieces.pieces)
    lists = np.arange(len(own.pieces), len(pieces), dtype=np.int32)
    as_those_of = world.scene(footprint)
    return Scene(frame, cells, lists, pieces.view(type(as_those_of.pieces)), corners.view(type(as_those_of.corners)))


SQUARE = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])

lattice = st.integers(-8, 8).map(lambda k: 0.25 * k)
coordinates = lattice | st.floats(-2.0, 2.0)
places = st.tuples(coordinates, coordinates)
sides = st.sampled_from([0.001, 0.25, 0.5, 1.0]) | st.floats(0.001, 2.0)
angles = st.integers(-8, 8).map(lambda k: k * math.pi / 4.0) | st.floats(-4.0, 4.0)


@st.composite
def polygons_about(draw: st.DrawFn, least: int = 3) -> NDArray[np.float64]:
    """Corners of a star-shaped polygon about (0, 0), shape (n, 2)."""
    count = draw(st.integers(least, 8))
    radii = draw(st.lists(st.floats(0.1, 1.0), min_size=count, max_size=count))
    turns = (np.arange(count) + draw(st.floats(0.0, 0.5))) * math.tau / count
    return np.array(radii)[:, None] * np.column_stack([np.cos(turns), np.sin(turns)])


obstacles = st.one_of(
    st.builds(lambda at, w, h: Box(at, (at[0] + w, at[1] + h)), places, sides, sides),
    st.builds(OrientedBox, places, st.tuples(sides, sides), angles),
    st.builds(Disc, places, sides),
    st.builds(lambda at, corners: Polygon(corners + at), places, polygons_about()),
)
footprints = st.one_of(
    st.sampled_from(list(FOOTPRINTS.values())),
    st.builds(Footprint.disc, sides),
    st.builds(lambda at, size: Footprint.polygon(at + SQUARE * size), places, st.tuples(sides, sides)),
    st.builds(lambda at, corners: Footprint.polygon(0.5 * corners + at), places, polygons_about()),
)


@given(st.lists(obstacles, max_size=4), footprints, st.lists(st.tuples(coordinates, coordinates, angles), min_size=1))
@settings(max_examples=200)
def test_obstacles_of_all_kinds_at_odd_places_have_their_distances(
    made: list[Obstacle], footprint: Footprint, poses: list[tuple[float, float, float]]
) -> None:
    """On a lattice many sides are parallel or touch."""
    assert_exact(World(Bounds((-2.5, -2.25), (2.0, 2.0)), made), footprint, np.array(poses))


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=40)
def test_grids_have_their_distances(seed: int) -> None:
    rng = np.random.default_rng(seed)
    grid = rng.random(rng.integers(1, 20, 2)) < rng.uniform(0.0, 0.7)
    grid.flat[rng.integers(grid.size)] = False
    yaw = float(rng.choice([0.0, math.pi / 2, -math.pi, 0.4, rng.uniform(-4.0, 4.0)]))
    world = World.from_grid(grid, 0.1, (*rng.uniform(-10.0, 10.0, 2).tolist(), yaw))
    footprint = list(FOOTPRINTS.values())[rng.integers(len(FOOTPRINTS))]
    assert_exact(world, footprint, uniform_poses(world, 100, rng))


class TestWhatIsNoPose:
    NAN, INF = math.nan, math.inf

    @pytest.mark.parametrize(
        "place", [(NAN, 0.5), (0.5, NAN), (NAN, NAN), (INF, 0.5), (0.5, -INF), (1e300, 0.5), (0.5, -1e300)]
    )
    def test_a_place_that_is_none_or_far_out_is_a_collision(
        self, place: tuple[float, float], footprint: Footprint
    ) -> None:
        pose = (*place, 0.3)
        for world in (boxes(), overlapping_obstacles()):
            scene = world.scene(footprint)
            assert world.collides(footprint, pose)
            assert world.clearance(footprint, pose) == 0.0
            assert clearance_at(*scene, *pose) < 0.0
            assert margin_at(*pose, scene, 0.0)[0] == 0.0
            assert not is_free(np.array([[*pose, 0.0, 0.0]]), 0.05, scene)
            assert not world.signed_clearance(*place) > 0.0

    @pytest.mark.parametrize("theta", [NAN, INF, -INF])
    def test_a_heading_that_is_none_is_a_collision_unless_the_robot_is_round(
        self, theta: float, footprint: Footprint
    ) -> None:
        world, pose = nothing(), (0.1, 0.2, theta)
        assert world.collides(footprint, pose) == (not footprint.is_round)
        assert (clearance_at(*world.scene(footprint), *pose) > 0.0) == footprint.is_round
        assert (world.clearance(footprint, pose) > 0.0) == footprint.is_round

    def test_a_heading_of_many_turns_is_an_angle(self, footprint: Footprint) -> None:
        scene = overlapping_obstacles().scene(footprint)
        once, often = (clearance_at(*scene, 1.4, 1.0, 0.7 + turns * math.tau) for turns in (0.0, 1000.0))
        assert once == pytest.approx(often, abs=1e-9)
        assert math.isfinite(clearance_at(*scene, 1.4, 1.0, 1e15))


class TestContact:
    def test_bounds_are_walls(self, footprint: Footprint) -> None:
        world, (_, y) = nothing(), (0.0, 1.9)
        expected = 2.0 - y - max(np.max(footprint.outline_at((0.0, 0.0, 0.4)), axis=0)[1], 0.0)
        assert clearance_at(*world.scene(footprint), 0.0, y, 0.4) == pytest.approx(expected, abs=1e-4) or expected < 0.0
        assert world.collides(footprint, (0.0, y, 0.4)) == (expected < 0.0)

    def test_the_origin_may_be_in_an_obstacle_that_the_footprint_is_beside(self) -> None:
        """Such a position was certified as in collision, since an inscribed radius of 0 stood for no disc at all."""
        footprint = FOOTPRINTS["beside its origin"]
        world = World(Bounds((-1.0, -1.0), (1.0, 1.0)), [Disc((0.0, 0.0), 0.05)])
        assert not world.collides(footprint, (0.0, 0.0, 0.0))
        assert world.clearance(footprint, (0.0, 0.0, 0.0)) == pytest.approx(0.05)

    def test_no_distance_is_above_that_of_the_origin_from_the_bounds(self) -> None:
        """The footprint is further from them than its origin, which may not leave them either."""
        world = World(Bounds((-1.0, -1.0), (1.0, 1.0)))
        assert world.clearance(FOOTPRINTS["beside its origin"], (-0.95, 0.0, 0.0)) == pytest.approx(0.05)
        assert world.collides(FOOTPRINTS["beside its origin"], (-1.0, 0.0, 0.0))

    def test_a_distance_that_fcl_overestimates_is_right(self) -> None:
        """FCL's GJK ends too early for this triangle beside this box: 0.0584 m, as `World.clearance` once said."""
        footprint = Footprint.polygon([(0.3, 0.1), (0.8, 0.2), (0.5, 0.5)])
        world = World(Bounds((-5.0, -5.0), (5.0, 5.0)), [Box((-4.7318, -2.3176), (-4.3318, -1.9176))])
        pose = (-4.308801829101622, -1.5488790531412655, -1.7748944825045008)
        assert world.clearance(footprint, pose) == pytest.approx(0.05706849407676, abs=1e-12)

    def test_within_the_band_of_contact_fcl_decides(self) -> None:
        world, disc = World(Bounds((-1.0, -1.0), (1.0, 1.0)), [Box((0.3, -1.0), (0.5, 1.0))]), Footprint.disc(0.2)
        for gap, touches in ((-1e-7, True), (0.0, True), (0.5e-6, True), (2e-6, False), (1e-5, False)):
            assert world.collides(disc, (0.1 - gap, 0.0, 0.0)) == touches
            assert world.clearance(disc, (0.1 - gap, 0.0, 0.0)) == pytest.approx(max(gap, 0.0), abs=1e-15)


class TestConvexParts:
    def assert_fills(self, polygon: shapely.Polygon) -> list[shapely.Polygon]:
        """The parts are convex, do not overlap, and have the polygon's area together."""
        rings = convex_parts(polygon)
        parts = [shapely.Polygon(ring) for ring in rings]
        for ring, part in zip(rings, parts, strict=True):
            assert part.exterior.is_ccw
            assert part.area == pytest.approx(part.convex_hull.area, rel=1e-9, abs=1e-12)
            assert (np.hypot(*(np.roll(ring, -1, axis=0) - ring).T) > 0.0).all()
        assert sum(part.area for part in parts) == pytest.approx(polygon.area, rel=1e-9)
        assert shapely.symmetric_difference(shapely.union_all(parts), polygon).area < 1e-9 * polygon.area
        return parts

    @given(polygons_about())
    def test_they_fill_a_star(self, corners: NDArray[np.float64]) -> None:
        parts = self.assert_fills(shapely.Polygon(corners))
        assert len(parts) <= len(corners) - 2

    @given(polygons_about(), st.lists(polygons_about(), min_size=1, max_size=3))
    def test_they_fill_a_frame_and_leave_its_holes(
        self, outer: NDArray[np.float64], inner: list[NDArray[np.float64]]
    ) -> None:
        frame = shapely.Polygon(10.0 * outer)
        for k, corners in enumerate(inner):
            frame = frame.difference(shapely.Polygon(0.2 * corners + (0.6 * k - 0.6, 0.1 * k)))
        if isinstance(frame, shapely.Polygon):
            self.assert_fills(frame)

    @pytest.mark.parametrize(
        ("polygon", "count"),
        [
            (shapely.box(0.0, 0.0, 2.0, 1.0), 1),
            (shapely.Polygon(FOOTPRINTS["L"].vertices), 2),
            (shapely.Polygon(FOOTPRINTS["arrow"].vertices), 2),
            (shapely.Polygon([(0, 0), (1, 0), (2, 0), (2, 1), (1, 1), (0, 1), (0, 0.5)]), 1),
            (shapely.Polygon([(0, 0), (2, 0), (2, 2), (0, 2)], [[(0.5, 0.5), (1.5, 0.5), (1.5, 1.5), (0.5, 1.5)]]), 4),
            (shapely.Polygon([(0, 0), (1, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2), (0, 1)]), 2),
        ],
        ids=["box", "L", "arrow", "box with corners on its sides", "frame", "L with corners on its sides"],
    )
    def test_they_are_few(self, polygon: shapely.Polygon, count: int) -> None:
        """Merging over diagonals gives at most four times as many as there have to be; here it gives no more."""
        for turned in (polygon, polygon.reverse()):
            assert len(self.assert_fills(turned)) == count

    @pytest.mark.parametrize("corners", [STAR, np.array(COMB)], ids=["star", "comb"])
    def test_they_fill_what_is_far_from_the_origin(self, corners: NDArray[np.float64]) -> None:
        parts = [shapely.Polygon(part) for part in convex_parts(shapely.Polygon(corners + (500_000.0, -700_000.0)))]
        assert sum(part.area for part in parts) == pytest.approx(shapely.Polygon(corners).area, rel=1e-6)


def test_the_discs_about_a_footprints_centre_hold_it_and_lie_in_it(footprint: Footprint) -> None:
    center = footprint_center(footprint)
    outer, inner = footprint_radii(footprint, center)
    if footprint.vertices is None:
        assert (center, outer, inner) == ((0.0, 0.0), footprint.radius, footprint.radius)
        return
    area = shapely.Polygon(footprint.vertices)
    assert shapely.Point(center).buffer(outer + 1e-3, 256).covers(area)
    assert area.covers(shapely.Point(center).buffer(0.9999 * inner))
    assert inner > 0.0


def assert_alike(found: World, expected: World, rng: np.random.Generator) -> None:
    """Two worlds have the same bounds, obstacles and distances, bit for bit."""
    assert (found.bounds, found.obstacles) == (expected.bounds, expected.obstacles)
    for footprint in (FOOTPRINTS["disc"], FOOTPRINTS["L"]):
        poses = uniform_poses(expected, 500, rng)
        scenes = (found.scene(footprint), expected.scene(footprint))
        assert np.array_equal(*(clearances_at(scene, poses) for scene in scenes))
        answers = [[one.collides(footprint, pose) for pose in poses[:100]] for one in (found, expected)]
        assert answers[0] == answers[1]
        assert [one.referee(footprint).collides(*poses[0]) for one in (found, expected)].count(answers[0][0]) == 2


class TestUpdatedWorlds:
    PLACE: dict[str, Any] = {"resolution": 0.1, "origin": (1.0, -2.0, 0.4)}
    BEFORE, AFTER = (np.random.default_rng(seed).random((20, 30)) < 0.1 for seed in (5, 6))
    MORE = (Disc((2.0, -1.0), 0.2), Polygon(0.3 * STAR + (2.5, 0.5)))

    @pytest.fixture
    def old(self) -> World:
        """A world of a grid whose scenes and referees are there already."""
        old = World.from_grid(self.BEFORE, **self.PLACE)
        for footprint in (FOOTPRINTS["disc"], FOOTPRINTS["L"]):
            old.scene(footprint)
            old.referee(footprint)
        return old

    def test_other_obstacles_make_the_world_that_they_would_make_anew(self, rng: np.random.Generator) -> None:
        old, made = overlapping_obstacles(), boxes().obstacles[:3]
        old.collides(FOOTPRINTS["L"], (0.0, 0.0, 0.0))
        assert_alike(old.updated(obstacles=made), World(old.bounds, made), rng)
        assert_alike(old.updated(), overlapping_obstacles(), rng)
        assert_alike(old.updated(obstacles=[]), World(old.bounds), rng)
        assert_alike(old, overlapping_obstacles(), rng)

    def test_another_grid_makes_the_world_that_it_would_make_anew(self, old: World, rng: np.random.Generator) -> None:
        assert_alike(old.updated(grid=self.AFTER), World.from_grid(self.AFTER, **self.PLACE), rng)
        assert_alike(old, World.from_grid(self.BEFORE, **self.PLACE), rng)

    def test_obstacles_and_grid_are_exchanged_each_without_the_other(
        self, old: World, rng: np.random.Generator
    ) -> None:
        new = World.from_grid(self.AFTER, **self.PLACE)
        expected = World.from_layer(new.layer, new.bounds, self.MORE)
        assert_alike(old.updated(obstacles=self.MORE, grid=self.AFTER), expected, rng)
        assert_alike(old.updated(obstacles=self.MORE).updated(grid=self.AFTER), expected, rng)
        assert_alike(old.updated(grid=self.AFTER).updated(obstacles=self.MORE), expected, rng)
        assert_alike(old.updated(grid=self.AFTER).with_more(self.MORE), expected, rng)

    def test_obstacles_of_a_map_do_not_change_those_of_the_grid(self, old: World) -> None:
        new = old.updated(obstacles=self.MORE)
        assert new.obstacles == (*old.obstacles, *self.MORE)
        assert new.layer is old.layer

    def test_a_world_with_a_grid_survives_pickling(self, old: World, rng: np.random.Generator) -> None:
        assert_alike(pickle.loads(pickle.dumps(old.with_more(self.MORE))), old.with_more(self.MORE), rng)

    def test_a_grid_of_another_shape_or_without_a_free_cell_is_refused(self, old: World) -> None:
        with pytest.raises(WorldError, match=r"grid: got .*expected the shape \[20, 30\]"):
            old.updated(grid=self.AFTER[:, 1:])
        with pytest.raises(MapError, match="a free one"):
            old.updated(grid=np.ones((20, 30), dtype=bool))
        with pytest.raises(WorldError, match="grid: .*not made from a grid"):
            overlapping_obstacles().updated(grid=self.AFTER)
        with pytest.raises(WorldError, match=r"obstacles\[0\]"):
            old.updated(obstacles=[3])  # type: ignore[list-item]  # wrong on purpose


def test_the_distances_that_verify_proves_by_are_those_of_the_kernels(
    world: World, footprint: Footprint, rng: np.random.Generator
) -> None:
    poses = poses_in(world, footprint, rng)
    poses[::50, 0] += 100.0
    poses[1::50, 2] = math.nan
    found, expected = Distances(world, footprint).at(poses), clearances_at(world.scene(footprint), poses)
    if footprint.is_round:  # no heading matters to the kernels
        found, expected = (np.delete(values, np.s_[1::50]) for values in (found, expected))
    np.testing.assert_allclose(np.maximum(found, 0.0), np.maximum(expected, 0.0), rtol=0.0, atol=rounding(world))
    assert ((found <= 0.0) | (found > 0.0)).all()
