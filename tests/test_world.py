"""FCL's answers about a world, held against shapely's, and what may stand in one."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import WorldError
from cbrrt_ompl.problem.obstacles import MAX_COORDINATE, Bounds, Box, Disc, Obstacle, OrientedBox, Polygon
from cbrrt_ompl.problem.robot import Footprint

BORDER = 1e-5
"""Nearer than this to contact, FCL and shapely may disagree: FCL's contact tolerance and the corners of discs [m]."""

FINE = 2048
"""Corners that stand for a disc of the robot in shapely."""

BOUNDS = Bounds((-4.0, -3.0), (4.0, 3.0))
NOTCHED = Polygon(np.array([(-3.0, -2.5), (-0.8, -2.5), (-0.8, -0.6), (-1.6, -2.0), (-3.0, -1.0)]))
HOLLOW = Polygon(
    np.array([(0.5, 0.2), (3.5, 0.2), (3.5, 2.8), (0.5, 2.5)]),
    (np.array([(1.0, 0.6), (2.2, 0.6), (2.2, 2.1), (1.0, 2.2)]), np.array([(2.5, 1.0), (3.2, 1.0), (2.8, 2.3)])),
)
OBSTACLES: dict[str, list[Obstacle]] = {
    "boxes": [Box((-2.0, -1.0), (-1.0, 2.0)), Box((-1.5, 0.5), (1.0, 1.5)), Box((2.0, -2.5), (2.05, 2.0))],
    "boxes at angles": [
        OrientedBox((-1.0, 0.5), (2.5, 0.6), 0.7),
        OrientedBox((2.0, -1.0), (0.04, 3.0), -2.0),
        OrientedBox((-3.0, -2.0), (0.5, 0.5), math.pi / 4),
    ],
    "discs": [Disc((-1.0, 0.5), 0.7), Disc((-0.5, 0.0), 0.5), Disc((2.5, -1.0), 0.05)],
    "polygon that is not convex": [NOTCHED],
    "polygon with holes": [HOLLOW],
    "all together": [
        NOTCHED,
        HOLLOW,
        Box((1.5, -2.0), (2.5, -0.5)),
        Box((2.0, -1.0), (3.0, 0.4)),
        Disc((-2.0, 1.5), 0.6),
        OrientedBox((0.2, -2.0), (0.8, 0.3), 1.0),
    ],
    "none": [],
}
FOOTPRINTS = {
    "point": Footprint.point(),
    "disc": Footprint.disc(0.3),
    "rectangle": Footprint.polygon([(-0.2, -0.15), (0.3, -0.15), (0.3, 0.15), (-0.2, 0.15)]),
    "arrow": Footprint.polygon([(-0.3, -0.25), (0.4, 0.0), (-0.3, 0.25), (-0.1, 0.0)]),
}
MIXED = World(BOUNDS, OBSTACLES["all together"])

finite = st.floats(-3.9, 3.9)


def exact_solid(obstacle: Obstacle) -> shapely.Polygon:
    if isinstance(obstacle, Disc):
        return shapely.Point(obstacle.center).buffer(obstacle.radius, quad_segs=FINE // 4)
    return obstacle.to_shapely()


def solid_of(world: World) -> shapely.Geometry:
    """Obstacles and the outside of the bounds as one shapely area."""
    inside = shapely.box(*world.bounds.min, *world.bounds.max)
    return shapely.union_all([inside.buffer(20.0).difference(inside), *map(exact_solid, world.obstacles)])


def margin(footprint: Footprint, pose: NDArray[np.float64], solid: shapely.Geometry) -> float:
    """Shapely's distance of a footprint from a solid; negative where they overlap, 0 where it is too close to call."""
    if footprint.is_round:
        centre = shapely.Point(pose[:2])
        distance = shapely.distance(centre, solid) or -shapely.distance(centre, solid.boundary)
        gap = distance - footprint.radius
    else:
        area = shapely.Polygon(footprint.outline_at(pose))
        overlaps = area.buffer(-BORDER).intersects(solid)
        gap = -1.0 if overlaps else shapely.distance(area, solid)
    return float(gap) if abs(gap) > BORDER else 0.0


def poses(count: int, seed: int) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    return rng.uniform([-4.3, -3.3, -math.pi], [4.3, 3.3, math.pi], size=(count, 3))  # (count, 3)


@pytest.mark.parametrize("footprint", FOOTPRINTS.values(), ids=FOOTPRINTS)
@pytest.mark.parametrize("obstacles", OBSTACLES.values(), ids=OBSTACLES)
def test_fcl_and_shapely_agree_on_collision_and_clearance(obstacles: list[Obstacle], footprint: Footprint) -> None:
    world = World(BOUNDS, obstacles)
    solid = solid_of(world)
    shapely.prepare(solid)
    hits = 0
    for pose in poses(400, seed=1):
        gap = margin(footprint, pose, solid)
        if gap != 0.0:
            assert world.collides(footprint, pose) == (gap < 0.0), pose
            hits += gap < 0.0
        assert world.clearance(footprint, pose) == pytest.approx(max(gap, 0.0), abs=BORDER), pose
    assert 20 < hits < 400


@pytest.mark.parametrize("obstacles", OBSTACLES.values(), ids=OBSTACLES)
def test_signed_clearance_is_the_distance_outside_and_a_certain_depth_inside(obstacles: list[Obstacle]) -> None:
    world = World(BOUNDS, obstacles)
    solid = solid_of(world)
    for x, y, _ in poses(400, seed=2):
        point, signed = shapely.Point(x, y), world.signed_clearance(x, y)
        outside = shapely.distance(point, solid)
        if outside > 0.0:
            assert signed == pytest.approx(outside, abs=BORDER), (x, y)
        else:
            assert -shapely.distance(point, solid.boundary) - BORDER <= signed <= 0.0, (x, y)


@pytest.mark.parametrize(
    ("obstacle", "inside", "depth"),
    [
        (Box((-1.0, -0.5), (1.0, 0.5)), (0.8, 0.1), 0.2),
        (Disc((0.0, 0.0), 0.5), (0.1, 0.0), 0.4),
        (Polygon(NOTCHED.vertices[:3]), (-1.2, -2.3), 0.2),
    ],
    ids=["box", "disc", "polygon"],
)
def test_the_depth_in_a_convex_solid_is_that_to_its_border(
    obstacle: Obstacle, inside: tuple[float, float], depth: float
) -> None:
    assert World(BOUNDS, [obstacle]).signed_clearance(*inside) == pytest.approx(-depth, abs=BORDER)


def test_where_the_convex_parts_of_a_polygon_meet_it_is_solid() -> None:
    """There the depth that is certain is 0."""
    for polygon in (NOTCHED, HOLLOW):
        world, area = World(BOUNDS, [polygon]), polygon.to_shapely()
        for triangle in shapely.constrained_delaunay_triangles(area).geoms:
            for share in (0.2, 0.5, 0.71):
                x, y = triangle.exterior.interpolate(share, normalized=True).coords[0]
                if shapely.distance(area.boundary, shapely.Point(x, y)) > BORDER:
                    assert world.collides(Footprint.point(), (x, y, 0.0))
                    assert world.signed_clearance(x, y) < 1e-12


@pytest.mark.parametrize("hole", [(1.5, 1.5), (2.8, 1.5)])
def test_a_hole_of_a_polygon_is_free(hole: tuple[float, float]) -> None:
    assert not MIXED.collides(Footprint.point(), (*hole, 0.0))
    assert MIXED.signed_clearance(*hole) > 0.1


TOUCHING = {
    "disc beside a box": (Footprint.disc(0.3), Box((1.0, -1.0), (2.0, 1.0)), (0.7, 0.2, 0.0)),
    "disc at the corner of a box": (Footprint.disc(0.5), Box((1.0, 1.0), (2.0, 2.0)), (0.7, 0.6, 0.0)),
    "disc beside a disc": (Footprint.disc(0.3), Disc((1.0, 0.0), 0.4), (0.3, 0.0, 1.0)),
    "disc beside a polygon": (Footprint.disc(0.3), NOTCHED, (-0.5, -1.5, 0.0)),
    "rectangle flush with a box": (FOOTPRINTS["rectangle"], Box((1.0, -1.0), (2.0, 1.0)), (0.7, 0.2, 0.0)),
    "rectangle flush with a polygon": (FOOTPRINTS["rectangle"], NOTCHED, (-0.6, -1.5, 0.0)),
    "arrow with its tip on a disc": (FOOTPRINTS["arrow"], Disc((1.0, 0.0), 0.4), (0.2, 0.0, 0.0)),
    "point on the side of a box": (Footprint.point(), Box((1.0, -1.0), (2.0, 1.0)), (1.0, 0.3, 0.0)),
    "point on a disc": (Footprint.point(), Disc((1.0, 0.0), 0.4), (0.6, 0.0, 0.0)),
    "point on a slanted edge": (Footprint.point(), NOTCHED, (-1.2, -1.3, 0.0)),
    "point on the rim of a hole": (Footprint.point(), HOLLOW, (1.0, 1.4, 0.0)),
}


@pytest.mark.parametrize(("footprint", "obstacle", "pose"), TOUCHING.values(), ids=TOUCHING)
def test_touching_is_collision(footprint: Footprint, obstacle: Obstacle, pose: tuple[float, float, float]) -> None:
    world = World(BOUNDS, [obstacle])
    assert world.collides(footprint, pose)
    assert world.clearance(footprint, pose) < 1e-15


@pytest.mark.parametrize(
    ("footprint", "pose"),
    [
        (Footprint.point(), (4.0, 0.0, 0.0)),
        (Footprint.point(), (0.0, -3.0, 0.0)),
        (Footprint.disc(0.3), (3.7, 0.0, 0.0)),
        (Footprint.disc(0.3), (0.0, -2.7, 1.0)),
        (FOOTPRINTS["rectangle"], (3.7, 0.0, 0.0)),
        (FOOTPRINTS["rectangle"], (-3.85, 0.0, math.pi / 2)),
        (FOOTPRINTS["arrow"], (0.0, 2.6, math.pi / 2)),
    ],
)
def test_touching_the_bounds_is_collision_and_a_tenth_of_a_millimetre_of_air_is_not(
    footprint: Footprint, pose: tuple[float, float, float]
) -> None:
    world = World(BOUNDS)
    assert world.collides(footprint, pose)
    x, y, theta = pose
    pull = 1.0 - 1e-4 / max(abs(x), abs(y))
    assert not world.collides(footprint, (x * pull, y * pull, theta))


def test_bounds_are_walls_for_the_whole_footprint() -> None:
    world = World(BOUNDS)
    at_the_wall = (3.75, 0.0, 0.0)
    assert not world.collides(Footprint.point(), at_the_wall)
    assert world.collides(Footprint.disc(0.3), at_the_wall)
    assert world.collides(FOOTPRINTS["rectangle"], at_the_wall)
    assert not world.collides(FOOTPRINTS["rectangle"], (3.75, 0.0, math.pi))


@pytest.mark.parametrize("far", [4.0, 4.1, 30.0, 1e5, 1e12])
def test_everything_outside_the_bounds_collides(far: float) -> None:
    for footprint in FOOTPRINTS.values():
        assert MIXED.collides(footprint, (far, 0.0, 0.0))
        assert MIXED.clearance(footprint, (far, 0.0, 0.0)) == 0.0


@pytest.mark.parametrize("pose", [(math.nan, 0.0, 0.0), (0.0, math.nan, 0.0), (math.inf, 0.0, 0.0)])
def test_a_pose_that_is_no_place_collides(pose: tuple[float, float, float]) -> None:
    for footprint in FOOTPRINTS.values():
        assert MIXED.collides(footprint, pose)
        assert MIXED.clearance(footprint, pose) == 0.0


@pytest.mark.parametrize("theta", [math.nan, math.inf])
def test_a_heading_that_is_no_angle_collides_where_the_heading_matters(theta: float) -> None:
    assert World(BOUNDS).collides(FOOTPRINTS["rectangle"], (0.0, 0.0, theta))


@given(finite, finite, finite, finite, st.floats(-4, 4))
def test_clearance_is_1_lipschitz(x0: float, y0: float, x1: float, y1: float, theta: float) -> None:
    apart = math.hypot(x1 - x0, y1 - y0)
    for footprint in FOOTPRINTS.values():
        before, after = (MIXED.clearance(footprint, (x, y, theta)) for x, y in ((x0, y0), (x1, y1)))
        assert abs(after - before) <= apart + BORDER


@given(finite, finite, finite, finite)
def test_signed_clearance_certifies_a_disc_of_its_size(x0: float, y0: float, x1: float, y1: float) -> None:
    signed = MIXED.signed_clearance(x0, y0)
    there = np.array([x0, y0]) + 0.99 * abs(signed) * np.array([math.cos(x1 + y1), math.sin(x1 + y1)])
    if abs(signed) > 1e-3:
        assert MIXED.collides(Footprint.point(), (*there, 0.0)) == (signed < 0.0)


@given(st.floats(-3.9, 3.9), st.floats(-2.9, 2.9))
def test_a_disc_collides_where_its_radius_exceeds_the_clearance_of_its_centre(x: float, y: float) -> None:
    margin = MIXED.clearance(Footprint.point(), (x, y, 0.0)) - 0.3
    if abs(margin) > BORDER:
        assert MIXED.collides(Footprint.disc(0.3), (x, y, 0.0)) == (margin < 0.0)


MISTAKES: dict[str, tuple[Callable[[], object], str]] = {
    "bounds without area": (lambda: Bounds((0, 0), (0, 1)), "bounds"),
    "bounds not a number": (lambda: Bounds((0, 0), (math.nan, 1)), "bounds"),
    "bounds too large": (lambda: Bounds((0, 0), (2 * MAX_COORDINATE, 1)), "bounds"),
    "box upside down": (lambda: Box((0, 1), (1, 0)), "box"),
    "box infinite": (lambda: Box((0, 0), (1, math.inf)), "box"),
    "oriented box without width": (lambda: OrientedBox((0, 0), (1, 0), 0.0), "oriented_box.size"),
    "oriented box nowhere": (lambda: OrientedBox((math.nan, 0), (1, 1), 0.0), "oriented_box.center"),
    "oriented box without direction": (lambda: OrientedBox((0, 0), (1, 1), math.inf), "oriented_box.angle"),
    "disc without radius": (lambda: Disc((0, 0), 0.0), "disc.radius"),
    "disc radius not a number": (lambda: Disc((0, 0), math.nan), "disc.radius"),
    "disc nowhere": (lambda: Disc((math.nan, 0), 1.0), "disc.center"),
    "polygon crossing": (lambda: Polygon(np.array([(0, 0), (1, 1), (1, 0), (0, 1)])), "polygon.vertices"),
    "polygon flat": (lambda: Polygon(np.array([(0, 0), (1, 1), (2, 2)])), "polygon.vertices"),
    "polygon too large": (lambda: Polygon(np.array([(0, 0), (1, 0), (0, 1e9)])), "polygon.vertices"),
    "hole crossing itself": (
        lambda: Polygon(HOLLOW.vertices, (np.array([(1, 1), (2, 2), (2, 1), (1, 2)]),)),
        "polygon.holes[0]",
    ),
    "hole outside": (lambda: Polygon(HOLLOW.vertices, (np.array([(8, 1), (9, 1), (9, 2)]),)), "polygon.holes"),
    "holes crossing": (
        lambda: Polygon(HOLLOW.vertices, (HOLLOW.holes[0], HOLLOW.holes[0] + 0.1)),
        "polygon.holes",
    ),
}


@pytest.mark.parametrize(("make", "field"), MISTAKES.values(), ids=MISTAKES)
def test_what_is_no_solid_is_refused_by_name(make: Callable[[], object], field: str) -> None:
    with pytest.raises(WorldError) as caught:
        make()
    assert [problem.field for problem in caught.value.problems] == [field]


def test_equal_polygons_are_equal_corner_for_corner() -> None:
    again = Polygon(HOLLOW.vertices.copy(), HOLLOW.holes)
    assert again == HOLLOW
    assert hash(again) == hash(HOLLOW)
    assert Polygon(HOLLOW.vertices) != HOLLOW
    assert HOLLOW != 0
