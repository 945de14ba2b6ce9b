"""Drives with a sensor that obstacles block: what it sees, what stays unseen, and that nothing is ever touched."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.drive import Drive, DriveResult, DriveSettings, drive
from cbrrt_ompl.drive.knowledge import Knowledge
from cbrrt_ompl.drive.settings import hides_itself, needed_range
from cbrrt_ompl.drive.sight import Sight
from cbrrt_ompl.drive.unknown import random_obstacles
from cbrrt_ompl.drive.unseen import UnseenSpace
from cbrrt_ompl.errors import SettingsError
from cbrrt_ompl.figures import draw_drive
from cbrrt_ompl.figures.animation import animate_drive
from cbrrt_ompl.problem.obstacles import Bounds, Box, Disc, Obstacle, OrientedBox, Polygon
from cbrrt_ompl.problem.robot import Footprint, Limits, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.scenario.scenario import Scenario

HALL = Bounds((0.0, 0.0), (8.0, 6.0))
WALL = Box((3.0, 0.0), (3.2, 4.0))
BEHIND = Disc((4.0, 1.5), 0.3)
ROUND = Robot(Footprint.disc(0.2), Limits(0.0, 1.0, -1.0, 1.0, 0.6, 2.0))
OBLONG = Robot(Footprint.polygon([[-0.3, -0.2], [0.3, -0.2], [0.3, 0.2], [-0.3, 0.2]]), ROUND.limits)
SETTINGS = DriveSettings(sensor_range=4.0, max_samples=2000, line_of_sight=True)
U_SHAPED = Footprint.polygon(
    [(-0.3, -0.3), (0.3, -0.3), (0.3, -0.2), (0.1, -0.2), (0.1, 0.2), (0.3, 0.2), (0.3, 0.3), (-0.3, 0.3)]
)


def scenario(obstacles: list[Obstacle], robot: Robot = ROUND) -> Scenario:
    """From one side of the hall to the other, over the end of the wall."""
    planning = PlanningSettings(horizon=1.5, step=0.05)
    goal, world = Goal(6.5, 1.5, tolerance=0.4), World(HALL, obstacles)
    return Scenario(name="hall", world=world, robot=robot, start=State(1.0, 1.5), goal=goal, planning=planning)


def is_visible(point: tuple[float, float], place: tuple[float, float], obstacles: list[Obstacle]) -> bool:
    """Whether nothing is between a point and a place, by shapely."""
    sight = shapely.LineString([place, point])
    return not any(shapely.intersects(obstacle.to_shapely(), sight) for obstacle in obstacles)


def assert_touches_nothing(result: DriveResult) -> None:
    """What was driven and the braking that was ready, by FCL at points some millimetres apart, and by verify."""
    assert result.verification.violations == ()
    collides = result.world.referee(result.scenario.robot.footprint).collides
    fine = np.linspace(result.braking.t[0], result.braking.t[-1], 20 * len(result.braking))
    assert not any(collides(*pose) for pose in result.braking.at(fine)[:, :3].tolist())
    np.testing.assert_array_equal(result.braking.states[-1, 3:], 0.0)


def test_what_is_behind_a_wall_is_not_known_until_it_is_seen_around_the_corner() -> None:
    """Everything is within range from the start."""
    obstacles: list[Obstacle] = [WALL, BEHIND]
    result = drive(scenario(obstacles), None, replace(SETTINGS, sensor_range=9.0), seed=1)
    assert result.status == "reached"
    assert_touches_nothing(result)
    found = {id(obstacle): cycle.time for cycle in result.cycles for obstacle in cycle.seen}
    assert found[id(WALL)] == 0.0
    looks = [cycle.time for cycle in result.cycles]
    before, after = (result.trajectory.at(looks[looks.index(found[id(BEHIND)]) - k])[0, :2] for k in (1, 0))
    points = [(4.0 + 0.2999 * math.cos(a), 1.5 + 0.2999 * math.sin(a)) for a in np.linspace(0.0, math.tau, 2000)]
    assert not any(is_visible(point, tuple(before), [WALL]) for point in points)
    assert any(is_visible(point, tuple(after), [WALL]) for point in points)
    everything = drive(scenario(obstacles), None, replace(SETTINGS, sensor_range=9.0, line_of_sight=False), seed=1)
    assert everything.cycles[0].seen == (WALL, BEHIND)


def random_scene(seed: int) -> tuple[list[Obstacle], tuple[float, float]]:
    """Obstacles of all kinds, some of which overlap, and a free place among them."""
    rng = np.random.default_rng(seed)
    place = float(rng.uniform(1.0, 7.0)), float(rng.uniform(1.0, 5.0))
    obstacles = random_obstacles(HALL, 14, rng, [(*place, 0.3)])
    notch = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.8, 0.2], [0.0, 0.3]]) + (0.2, 0.2)
    return [*obstacles, Box((7.0, 5.2), (7.9, 5.6)), Polygon(notch)], place


@pytest.mark.parametrize("seed", range(12))
def test_an_obstacle_is_seen_where_a_point_of_it_is_visible_and_within_range(seed: int) -> None:
    """Against points of all borders, 5 mm apart, which the other obstacles hide or do not."""
    obstacles, place = random_scene(seed)
    seen = Sight(obstacles).look(*place, 3.0).is_seen
    for i, obstacle in enumerate(obstacles):
        border = shapely.segmentize(obstacle.to_shapely().exterior, 5e-3)
        points = shapely.get_coordinates(border)
        points = points[np.hypot(*(points - place).T) < 3.0 - 1e-3]
        others = shapely.union_all([o.to_shapely() for o in obstacles if o is not obstacle])
        towards = place + (1.0 - 1e-4) * (points - place)  # not into the obstacle itself
        lines = shapely.linestrings(np.stack([np.broadcast_to(place, points.shape), towards], axis=1))
        is_free = ~shapely.intersects(lines, others) & ~shapely.intersects(lines, obstacle.to_shapely().buffer(-1e-6))
        assert seen[i] == is_free.any()


@pytest.mark.parametrize("seed", range(12))
def test_space_counts_as_seen_only_if_a_look_has_shown_it(seed: int) -> None:
    """Of random points near the last of four places; those within 1 mm of a border may be either."""
    obstacles, place = random_scene(seed)
    walls = shapely.union_all([obstacle.to_shapely() for obstacle in obstacles])
    sight, unseen = Sight(obstacles), UnseenSpace(HALL, 2.5)
    places = [(place[0] + 0.05 * k, place[1] + 0.04 * k) for k in range(4)]
    for x, y in places:
        unseen.look(x, y, sight.look(x, y, 2.6))
    points = np.random.default_rng(seed).uniform(-2.4, 2.4, size=(2000, 2)) + places[-1]
    points = points[(points > 0.0).all(axis=1) & (points < HALL.max).all(axis=1)]
    points = points[~shapely.dwithin(walls, shapely.points(points), 1e-3)]
    was_visible = np.zeros(len(points), dtype=bool)
    for k, at in enumerate(places):
        lines = shapely.linestrings(np.stack([np.broadcast_to(at, points.shape), points], axis=1))
        was_near = ((np.abs(points - at) < 2.5).all(axis=1) | (k == 3)) & (np.hypot(*(points - at).T) < 2.6)
        was_visible |= ~shapely.intersects(lines, walls) & was_near
    is_unseen = shapely.contains_xy(unseen.region, points)
    near = shapely.dwithin(shapely.boundary(unseen.region), shapely.points(points), 1e-3)
    assert (is_unseen | was_visible | near).all(), "hidden space counts as seen"
    assert not (is_unseen & was_visible & ~near).any(), "what was seen is forgotten"
    assert 0.0 < is_unseen.mean() < 0.98


def test_what_leaves_the_square_is_forgotten() -> None:
    sight, unseen, before_the_wall = Sight([WALL]), UnseenSpace(HALL, 1.0), shapely.Point(2.8, 3.9)

    def is_unseen_from(x: float, y: float) -> bool:
        unseen.look(x, y, sight.look(x, y, 4.0))
        return bool(unseen.region.contains(before_the_wall))

    assert is_unseen_from(3.5, 3.9)
    assert not is_unseen_from(2.9, 4.5)
    assert not is_unseen_from(3.5, 3.9), "it was seen a moment ago"
    assert not is_unseen_from(5.0, 3.9), "it is not in the square"
    assert is_unseen_from(3.5, 3.9)


@pytest.mark.parametrize("robot", [ROUND, OBLONG], ids=["round", "oblong"])
def test_a_motion_around_a_blind_corner_is_not_committed_to(robot: Robot) -> None:
    """Nothing is there, but nobody has seen that; one straight past the wall is free and seen."""
    knowledge = Knowledge(World(HALL, [WALL]), [], 2.0)
    knowledge.look(2.0, 4.6, 5.0)
    ahead = np.array([2.0, 4.6, 0.0, 1.0, 0.0]) + np.outer(np.linspace(0.0, 1.5, 31), (1.0, 0.0, 0.0, 0.0, 0.0))
    turn = np.linspace(0.0, 1.8, 37)  # at 0.5 m/s and 1 rad/s, about the end of the wall
    around = np.column_stack([3.1 + 0.5 * np.sin(turn), 4.1 + 0.5 * np.cos(turn), -turn])
    around = np.column_stack([around, np.full((len(turn), 2), (0.5, -1.0))])
    assert World(HALL, [WALL]).clearance(robot.footprint, around[-1, :3]) > 0.03
    assert knowledge.is_seen(ahead, 0.05, robot.footprint)
    assert not knowledge.is_seen(around, 0.05, robot.footprint)


def test_every_committed_motion_is_in_space_that_was_in_sight() -> None:
    """Against the lines from all places of looks so far to the border of the robot, around a wall at 2 m/s."""
    fast = Robot(OBLONG.footprint, Limits(0.0, 2.0, -2.0, 2.0, 1.5, 4.0))
    close_behind = replace(scenario([WALL], fast), goal=Goal(4.0, 1.5, tolerance=0.4))
    made = Drive(close_behind, None, replace(SETTINGS, max_iterations=200), seed=0)
    walls = WALL.to_shapely()
    border = shapely.get_coordinates(shapely.segmentize(shapely.Polygon(fast.footprint.vertices).exterior, 0.1))
    places, committed = [], 0
    while made.status is None:
        places.append(np.array(made.state[:2]))
        made.cycle()
        for x, y, theta in made._committed.poses:
            c, s = math.cos(theta), math.sin(theta)
            left = border @ [[c, s], [-s, c]] + (x, y)
            for place in reversed(places):
                lines = shapely.linestrings(np.stack([np.broadcast_to(place, left.shape), left], axis=1))
                left = left[shapely.intersects(lines, walls)]
            assert len(left) == 0
            committed += 1
    assert made.status == "reached" and committed > 100


def random_drive(seed: int) -> DriveResult:
    """A drive among random obstacles, none of them known."""
    rng = np.random.default_rng(seed)
    robot = (ROUND, OBLONG)[seed % 2]
    obstacles = random_obstacles(HALL, 25, rng, [(1.0, 1.5, 0.5), (6.5, 1.5, 0.8)])
    return drive(scenario(obstacles, robot), None, replace(SETTINGS, tries=4), seed=seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(16))
def test_drives_among_random_obstacles_touch_nothing(seed: int) -> None:
    assert_touches_nothing(random_drive(seed))


def test_a_robot_that_hides_a_part_of_itself_is_refused() -> None:
    assert hides_itself(U_SHAPED)
    assert not any(hides_itself(footprint) for footprint in (OBLONG.footprint, ROUND.footprint, Footprint.point()))
    with pytest.raises(SettingsError, match="line_of_sight: got True, expected False for a footprint that hides"):
        Drive(scenario([], Robot(U_SHAPED, ROUND.limits)), [], SETTINGS)
    with pytest.raises(SettingsError, match="line_of_sight: got 'yes', expected True or False"):
        DriveSettings(line_of_sight="yes")  # type: ignore[arg-type]


def test_figure_and_animation_show_what_is_in_sight() -> None:
    result = drive(scenario([WALL, BEHIND]), None, SETTINGS, seed=1)
    (seen,) = [c for c in draw_drive(result).axes[0].collections if c.get_label() == "seen"]
    shown = [shapely.Polygon(path.vertices) for path in seen.get_paths()]
    assert len(shown) == len(result.cycles)
    hidden = shapely.Point(4.0, 1.0)  # behind the wall
    assert not shown[0].contains(hidden)
    assert any(view.contains(hidden) for view in shown)
    animation = animate_drive(result)
    view = next(patch for patch in animation._fig.axes[0].patches if patch.get_zorder() == 0.5)
    animation._func(0)
    np.testing.assert_allclose(shapely.Polygon(view.get_xy()).area, shown[0].area, rtol=1e-9)
    plain = drive(scenario([WALL]), None, replace(SETTINGS, line_of_sight=False), seed=1)
    assert not [c for c in draw_drive(plain).axes[0].collections if c.get_label() == "seen"]


def test_the_unseen_space_reaches_as_far_as_the_robot_is_committed() -> None:
    made = Drive(scenario([WALL]), None, SETTINGS, seed=1)
    made.cycle()
    assert made._knowledge._unseen is not None
    assert made._knowledge._unseen._reach == pytest.approx(needed_range(ROUND, SETTINGS, 0.05))


def test_one_seed_is_one_drive() -> None:
    first, second = (random_drive(3) for _ in range(2))
    assert first.trajectory == second.trajectory
    turned = OrientedBox((4.0, 3.0), (1.0, 1.0), 0.4)
    assert Sight([turned]).look(1.0, 3.0, 5.0).is_seen.tolist() == [True]


def test_looks_from_nearly_one_place_do_not_add_corners_without_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """A robot that crept past round things had a million of them after some seconds, and seconds a look."""
    obstacles, (x, y) = random_scene(3)
    sight, rng = Sight(obstacles), np.random.default_rng(0)
    exact, coarse = UnseenSpace(HALL, 2.5), UnseenSpace(HALL, 2.5)
    for _ in range(60):
        view = sight.look(x, y, 2.5)
        exact.look(x, y, view)
        with monkeypatch.context() as few:
            few.setattr("cbrrt_ompl.drive.unseen.MOST_CORNERS", 100)
            coarse.look(x, y, view)
        assert shapely.get_num_coordinates(coarse.region) <= 100
        assert shapely.difference(exact.region, shapely.buffer(coarse.region, 1e-6)).area < 1e-5
        x, y = x + rng.uniform(-1e-3, 1e-3), y + rng.uniform(-1e-3, 1e-3)
    assert shapely.get_num_coordinates(exact.region) > 100
    assert coarse.region.area < 1.2 * exact.region.area
