"""The clearance map answers as FCL does, whatever it holds; benchmarks/certificates.py asks of many more states."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import pytest
from kernels import findings

from cbrrt_ompl.collision import clearance_map as module
from cbrrt_ompl.collision.clearance_map import (
    COLLISION,
    ROOM,
    UNDECIDED,
    ClearanceMap,
    certify,
    certify_pose,
    clearance_map_for,
)
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.problem.obstacles import Bounds, Box, Disc, Obstacle, OrientedBox, Polygon
from cbrrt_ompl.problem.robot import Footprint

NEAR = 0.01
"""What counts as near the boundary of validity [m]."""

FOOTPRINTS = {
    "point": Footprint.point(),
    "disc": Footprint.disc(0.12),
    "rectangle": Footprint.polygon([(-0.2, -0.1), (0.3, -0.1), (0.3, 0.1), (-0.2, 0.1)]),
    "arrow": Footprint.polygon([(-0.2, -0.15), (0.25, 0.0), (-0.2, 0.15), (-0.05, 0.0)]),
    "beside its origin": Footprint.polygon([(0.1, -0.1), (0.3, -0.1), (0.3, 0.1), (0.1, 0.1)]),
}


def boxes() -> World:
    rng = np.random.default_rng(1)
    low = rng.uniform(-5.0, 4.5, (23, 2))
    sides = rng.uniform(0.05, 1.2, (23, 2))
    return World(
        Bounds((-5.0, -5.0), (5.0, 5.0)), [Box(tuple(a), tuple(a + s)) for a, s in zip(low, sides, strict=True)]
    )


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


def polygons_that_are_not_convex() -> World:
    star = np.column_stack(
        [f(np.arange(10) * math.pi / 5.0) * np.tile([1.0, 0.35], 5) for f in (np.cos, np.sin)]
    )  # (10, 2)
    hole = np.array([(-0.2, -0.15), (0.2, -0.1), (0.1, 0.2)])
    comb = [(-2.8, -2.5), (2.8, -2.5), (2.8, -1.0), (2.6, -2.2), (1.0, -2.3), (0.9, -1.0), (0.7, -2.2), (-2.6, -2.0)]
    frame = np.array([(-2.9, 0.1), (-0.6, 0.3), (-0.8, 2.6), (-2.5, 2.9)])
    return World(
        Bounds((-3.0, -3.0), (3.0, 3.0)),
        [
            Polygon(np.array(comb)),
            Polygon(star + (1.5, 1.4), (hole + (1.5, 1.4),)),
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


def grid_map() -> World:
    return World.from_grid(np.random.default_rng(4).random((250, 250)) < 0.04, 0.1)


def turned_grid_map() -> World:
    return World.from_grid(np.random.default_rng(5).random((20, 30)) < 0.1, 0.1, (1.0, -2.0, 0.4))


def far_from_the_origin() -> World:
    return World(
        Bounds((499_997.0, -700_003.0), (500_003.0, -699_997.0)),
        [
            Polygon(np.array([(-2.0, -2.0), (1.0, -1.5), (0.0, 0.0), (-0.5, -1.2)]) + (500_000.0, -700_000.0)),
            Disc((499_999.0, -699_999.0), 0.5),
            OrientedBox((500_001.0, -699_999.0), (1.0, 0.3), 0.5),
        ],
    )


WORLDS = {
    "boxes": boxes,
    "discs": discs,
    "slanted polygons": slanted_polygons,
    "polygons that are not convex": polygons_that_are_not_convex,
    "overlapping obstacles": overlapping_obstacles,
    "grid map": grid_map,
    "turned grid map": turned_grid_map,
    "far from the origin": far_from_the_origin,
}


def uniform_poses(world: World, rng: np.random.Generator) -> Iterator[tuple[float, float, float]]:
    """Poses anywhere in the bounds, without end."""
    while True:
        for pose in rng.uniform((*world.bounds.min, -4.0), (*world.bounds.max, 4.0), (256, 3)).tolist():
            yield tuple(pose)


def border_poses(
    world: World, footprint: Footprint, rng: np.random.Generator, each: int = 40
) -> Iterator[tuple[float, float, float]]:
    """Poses within `NEAR` of a pose where validity changes, half of them at distances down to rounding, without end."""
    collides = world.checker(footprint).collides
    anywhere = uniform_poses(world, rng)
    while True:
        free, blocked = next(anywhere), next(anywhere)
        if collides(*free) or not collides(*blocked):
            continue
        a, b, theta = np.array(free[:2]), np.array(blocked[:2]), free[2]
        if not collides(*b, theta):
            continue
        for _ in range(60):
            middle = 0.5 * (a + b)
            if np.hypot(*(b - a)) < NEAR:
                yield (*middle.tolist(), theta)
            if collides(*middle, theta):
                b = middle
            else:
                a = middle
            if np.hypot(*(b - a)) < 1e-9:
                break
        radii, angles = NEAR * np.sqrt(rng.random(each // 2)), rng.uniform(0.0, math.tau, each // 2)
        for radius, angle in zip(radii.tolist(), angles.tolist(), strict=True):
            yield (float(a[0]) + radius * math.cos(angle), float(a[1]) + radius * math.sin(angle), theta)


@dataclass
class Comparison:
    """The map's answers about some poses, held against FCL's."""

    states: int = 0
    wrong_answers: int = 0
    """States about which :meth:`ClearanceMap.collides` and FCL differ."""
    wrong_certificates: int = 0
    """States that a certificate called free or in collision and FCL did not."""
    in_collision: int = 0
    certified: int = 0
    """States that the map decided without FCL, growth included."""

    @property
    def disagreements(self) -> int:
        return self.wrong_answers + self.wrong_certificates


def compare(
    clearance_map: ClearanceMap,
    collides: Callable[[float, float, float], bool],
    poses: Iterator[tuple[float, float, float]],
    count: int,
) -> Comparison:
    """Ask map and FCL about the next ``count`` poses."""
    found = Comparison()
    for pose in (next(poses) for _ in range(count)):
        exact = collides(*pose)
        before = clearance_map.exact_queries
        found.wrong_answers += clearance_map.collides(*pose) != exact
        certificate, _ = certify_pose(clearance_map.view, *pose, 0.0)
        found.wrong_certificates += certificate != UNDECIDED and (certificate == COLLISION) != exact
        found.certified += clearance_map.exact_queries == before
        found.in_collision += exact
        found.states += 1
    return found


@pytest.fixture(scope="module", params=WORLDS)
def world(request: pytest.FixtureRequest) -> World:
    return WORLDS[request.param]()


@pytest.fixture(params=FOOTPRINTS)
def footprint(request: pytest.FixtureRequest) -> Footprint:
    return FOOTPRINTS[request.param]


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20)


def small_world() -> World:
    return World(Bounds((-2.0, -2.0), (2.0, 2.0)), [Box((0.5, -1.0), (1.0, 1.0)), Disc((-1.0, 1.0), 0.3)])


def test_uniform_states_get_fcl_s_answer(world: World, footprint: Footprint, rng: np.random.Generator) -> None:
    found = compare(ClearanceMap(world, footprint), world.checker(footprint).collides, uniform_poses(world, rng), 1000)
    assert found.disagreements == 0
    assert 0 < found.in_collision < found.states


def test_states_within_a_centimetre_of_the_border_get_fcl_s_answer(
    world: World, footprint: Footprint, rng: np.random.Generator
) -> None:
    collides = world.checker(footprint).collides
    found = compare(ClearanceMap(world, footprint), collides, border_poses(world, footprint, rng), 1000)
    assert found.disagreements == 0
    assert 100 < found.in_collision < 900


@pytest.mark.parametrize("name", ["overlapping obstacles", "polygons that are not convex"])
def test_every_pose_within_a_certified_margin_is_free(
    name: str, footprint: Footprint, rng: np.random.Generator
) -> None:
    world = WORLDS[name]()
    clearance_map = ClearanceMap(world, footprint)
    margins = 0
    for pose in (next(poses) for poses in (uniform_poses(world, rng), border_poses(world, footprint, rng)) * 300):
        clearance_map.collides(*pose)
        margin, for_every_heading = certify_pose(clearance_map.view, *pose, 0.0)
        if margin in (COLLISION, UNDECIDED):
            continue
        margins += 1
        for share, angle, turn in rng.uniform((0.0, 0.0, -1.0), (1.0, math.tau, 1.0), (4, 3)).tolist():
            used = margin * (1.0 - share**4)  # mostly close to the end
            if for_every_heading:
                r, theta = used, math.pi * turn
            else:
                r, theta = used * (1.0 - abs(turn)), pose[2] + used * turn / footprint.circumscribed_radius
            assert not clearance_map.checker.collides(
                pose[0] + r * math.cos(angle), pose[1] + r * math.sin(angle), theta
            )
    assert margins > 30


def test_a_margin_from_fcl_holds_for_the_way_and_the_turn_it_is_used_up_by(
    footprint: Footprint, rng: np.random.Generator
) -> None:
    """An answer holds for one heading, so turning uses it up at the circumscribed radius.

    Sharp corners had margins where they touched: grown, they reach out by more than the contact tolerance.
    """
    world = overlapping_obstacles()
    margin_at, collides = world.checker(footprint).margin, world.checker(footprint).collides
    reach = 0.0 if footprint.is_round else footprint.circumscribed_radius
    free = 0
    for x, y, theta in (next(poses) for poses in (border_poses(world, footprint, rng),) * 1000):
        margin = margin_at(x, y, theta)
        assert (margin == 0.0) == collides(x, y, theta)
        if margin == 0.0:
            continue
        free += 1
        for share, angle, part in rng.uniform(0.0, (1.0, math.tau, 1.0), (3, 3)):
            used = margin * (1.0 - share**4)
            way = used * part if reach else used
            turn = (used - way) / reach if reach else 0.0
            end = x + way * math.cos(angle), y + way * math.sin(angle), theta + rng.choice([-turn, turn])
            assert not collides(*end)
    assert free > 200


def test_a_footprint_beside_its_origin_may_have_the_origin_inside_an_obstacle() -> None:
    """Such a position was certified as in collision, since an inscribed radius of 0 stood for no disc at all."""
    footprint = FOOTPRINTS["beside its origin"]
    world = World(Bounds((-1.0, -1.0), (1.0, 1.0)), [Disc((0.0, 0.0), 0.05)])
    assert not world.collides(footprint, (0.0, 0.0, 0.0))
    assert not ClearanceMap(world, footprint).collides(0.0, 0.0, 0.0)


def test_two_maps_of_different_growth_answer_alike(footprint: Footprint, rng: np.random.Generator) -> None:
    world = overlapping_obstacles()
    fresh, grown, off = (ClearanceMap(world, footprint, enabled=enabled) for enabled in (True, True, False))
    poses = border_poses(world, footprint, rng)
    for _ in range(500):
        grown.collides(*next(poses))
    for pose in (next(poses) for _ in range(200)):
        assert fresh.collides(*pose) == grown.collides(*pose) == off.collides(*pose)
    assert fresh.cells < grown.cells
    assert off.cells == 0


@pytest.mark.parametrize("most", [1, 5, 60])
def test_a_full_map_still_answers_as_fcl_does(most: int, footprint: Footprint, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MAX_CELLS", most)
    world, rng = overlapping_obstacles(), np.random.default_rng(6)
    clearance_map, collides = ClearanceMap(world, footprint), world.checker(footprint).collides
    for poses in (uniform_poses(world, rng), border_poses(world, footprint, rng)):
        assert compare(clearance_map, collides, poses, 400).disagreements == 0
    assert most - 4 < clearance_map.cells <= most


def test_a_question_asked_again_at_once_adds_no_cell(footprint: Footprint, rng: np.random.Generator) -> None:
    clearance_map = ClearanceMap(overlapping_obstacles(), footprint)
    for pose in (next(poses) for poses in (uniform_poses(small_world(), rng),) * 200):
        answer, cells = clearance_map.collides(*pose), clearance_map.cells
        assert clearance_map.collides(*pose) == answer
        assert clearance_map.cells == cells


def test_one_question_splits_the_cells_on_its_way_down_alone() -> None:
    clearance_map = ClearanceMap(small_world(), Footprint.point())
    assert clearance_map.cells == 1
    clearance_map.collides(0.4999, 0.3, 0.0)
    levels = math.ceil(math.log2(4.0 / module.SMALLEST_CELL))
    assert 1 < clearance_map.cells <= 1 + 4 * levels


def test_a_wide_free_area_is_certified_by_few_cells(rng: np.random.Generator) -> None:
    world = World(Bounds((-50.0, -50.0), (50.0, 50.0)), [Box((40.0, 40.0), (41.0, 41.0))])
    clearance_map = ClearanceMap(world, Footprint.disc(0.3))
    for x, y in rng.uniform(-20.0, 20.0, (500, 2)):
        assert not clearance_map.collides(x, y, 0.0)
    assert clearance_map.cells < 30
    assert clearance_map.exact_queries == 0


@pytest.mark.parametrize("enabled", [True, False])
def test_positions_out_of_bounds_or_not_numbers_collide_without_a_query(footprint: Footprint, enabled: bool) -> None:
    clearance_map = ClearanceMap(small_world(), footprint, enabled=enabled)
    cells = clearance_map.cells
    queries = clearance_map.checker.queries
    nan, inf = math.nan, math.inf
    for x, y in [(nan, 0.0), (0.0, nan), (inf, 0.0), (0.0, -inf), (2.0, 0.0), (-2.0, 0.0), (0.0, 2.0), (0.0, -2.5)]:
        assert clearance_map.collides(x, y, 0.0)
        assert certify(clearance_map.view, x, y, 0.0) == COLLISION
    assert (clearance_map.cells, clearance_map.exact_queries) == (cells, 0)
    assert clearance_map.checker.queries == queries


@pytest.mark.parametrize("theta", [math.nan, math.inf])
def test_a_heading_that_is_no_angle_is_answered_as_fcl_does(theta: float) -> None:
    """Where only FCL can decide, a heading that is no number collides; a disc has no heading."""
    world = small_world()
    rectangle = ClearanceMap(world, FOOTPRINTS["rectangle"], enabled=False)
    assert rectangle.collides(0.0, 0.0, theta)
    assert not ClearanceMap(world, FOOTPRINTS["disc"], enabled=False).collides(0.0, 0.0, theta)


def test_states_that_fcl_decided_are_counted(rng: np.random.Generator) -> None:
    footprint = FOOTPRINTS["rectangle"]
    off, on = (ClearanceMap(small_world(), footprint, enabled=enabled) for enabled in (False, True))
    for x, y, theta in rng.uniform((-1.9, -1.9, -3.0), (1.9, 1.9, 3.0), (100, 3)):
        off.collides(x, y, theta)
        on.collides(x, y, theta)
    assert off.exact_queries == 100
    assert 0 < on.exact_queries < 60
    on.exact_queries = 0
    assert not on.collides(-0.5, -1.0, 0.3)
    assert on.collides(0.75, 0.0, 0.3)
    assert on.exact_queries == 0


def test_a_decided_question_takes_no_row_of_findings() -> None:
    clearance_map = ClearanceMap(small_world(), FOOTPRINTS["rectangle"])
    clearance_map.answer(-0.5, -1.0, 0.0)
    assert findings(clearance_map) == []
    assert certify(clearance_map.view, -0.5, -1.0, 0.0) > 0.0
    assert clearance_map.exact_queries == 0


def test_answers_are_fcl_s_margins_however_many_there_are(rng: np.random.Generator) -> None:
    clearance_map = ClearanceMap(small_world(), FOOTPRINTS["rectangle"], enabled=False)
    poses = rng.uniform((-2.0, -2.0, -3.0), (2.0, 2.0, 3.0), (300, 3))
    for pose in poses.tolist():
        clearance_map.answer(*pose)
    margins = [clearance_map.checker.margin(*pose) - ROOM for pose in poses.tolist()]
    assert min(margins) < 0.0 < max(margins)
    assert findings(clearance_map) == [[margin if margin > 0.0 else COLLISION, 0.0] for margin in margins]


def test_a_world_keeps_one_map_a_footprint() -> None:
    world = small_world()
    kept = clearance_map_for(world, Footprint.disc(0.2))
    assert clearance_map_for(world, Footprint.disc(0.2)) is kept
    assert clearance_map_for(world, Footprint.disc(0.21)) is not kept
    assert clearance_map_for(small_world(), Footprint.disc(0.2)) is not kept
