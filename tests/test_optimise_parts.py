"""What an improvement is made of: the field, the cover, the derivatives, the solver and the geodesic."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from numba import njit
from numpy.typing import NDArray

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.optimise.clearance import disc_distances
from cbrrt_ompl.optimise.cover import cover
from cbrrt_ompl.optimise.dynamics import add_derivatives, interval_end
from cbrrt_ompl.optimise.field import Field, distance_and_gradient, field_of, make_field
from cbrrt_ompl.optimise.guess import Guess, guess_from_trajectory, interval_count, refined, split
from cbrrt_ompl.optimise.guesses import AHEAD, geodesic, guess_along
from cbrrt_ompl.optimise.objective import Objective
from cbrrt_ompl.optimise.program import COLUMNS, MOST_DISCS, STATES
from cbrrt_ompl.optimise.transcription import Transcription
from cbrrt_ompl.problem.obstacles import Bounds, Box, Disc, OrientedBox, Polygon
from cbrrt_ompl.problem.ready_robots import ROBOTS, rectangle
from cbrrt_ompl.problem.robot import Footprint, Limits, Robot
from cbrrt_ompl.problem.settings import Goal, State
from cbrrt_ompl.scenario.scenario import Scenario

OPEN = World(Bounds((0.0, 0.0), (10.0, 4.0)))
MIXED = World(
    Bounds((0.0, 0.0), (4.0, 3.0)),
    [
        Box((1.0, 0.0), (1.5, 1.0)),
        Disc((3.0, 2.0), 0.4),
        OrientedBox((2.0, 2.2), (0.8, 0.3), 0.6),
        Polygon(np.array([(2.5, 0.2), (3.5, 0.2), (3.5, 1.0), (3.0, 0.5)])),
    ],
)
L_SHAPE = Footprint.polygon([(0.0, 0.0), (0.6, 0.0), (0.6, 0.2), (0.2, 0.2), (0.2, 0.6), (0.0, 0.6)])


def nodes_of(field: Field) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    rows, columns = field.distances.shape
    x = field.grid["x_min"] + field.grid["spacing"] * np.arange(columns)
    y = field.grid["y_min"] + field.grid["spacing"] * np.arange(rows)
    return np.meshgrid(x, y)


def test_the_field_is_exact_at_its_nodes() -> None:
    field = make_field(MIXED)
    x, y = nodes_of(field)
    free = shapely.box(*MIXED.bounds.min, *MIXED.bounds.max).difference(
        shapely.union_all([obstacle.to_shapely() for obstacle in MIXED.obstacles])
    )
    points = shapely.points(x, y)
    inside = shapely.contains(free, points)
    error = field.distances - shapely.distance(free.boundary, points)
    assert np.abs(error[inside]).max() < 1e-3  # the disc is a polygon there
    assert field.distances[~inside].max() < 1e-3


def test_the_gradient_of_the_field_is_its_slope() -> None:
    grid, distances = field_of(MIXED)
    rng, d = np.random.default_rng(0), 1e-5
    for x, y in rng.uniform((0.1, 0.1), (3.9, 2.9), size=(50, 2)):
        _, by_x, by_y = distance_and_gradient(grid, distances, x, y)
        ahead, behind = (distance_and_gradient(grid, distances, x + s * d, y)[0] for s in (1.0, -1.0))
        above, below = (distance_and_gradient(grid, distances, x, y + s * d)[0] for s in (1.0, -1.0))
        assert by_x == pytest.approx((ahead - behind) / (2.0 * d), abs=1e-5)
        assert by_y == pytest.approx((above - below) / (2.0 * d), abs=1e-5)


def test_walls_thinner_than_the_spacing_are_seen() -> None:
    world = World(Bounds((0.0, 0.0), (4.0, 4.0)), [Box((1.98, 0.0), (1.9801, 4.0))])
    grid, distances = make_field(world)
    crossing = [distance_and_gradient(grid, distances, x, 2.0)[0] for x in np.linspace(1.5, 2.5, 200)]
    assert min(crossing) <= 0.0


def test_a_world_has_one_field() -> None:
    assert field_of(MIXED) is field_of(MIXED)


@pytest.mark.parametrize(
    "footprint", [rectangle(0.5, 0.25), ROBOTS["jackal"].footprint, L_SHAPE], ids=["box", "jackal", "L"]
)
def test_discs_of_a_cover_lie_inside_and_leave_little_of_the_outline(footprint: Footprint) -> None:
    discs, polygon = cover(footprint), shapely.Polygon(footprint.vertices)
    parts = shapely.union_all([shapely.Point(x, y).buffer(max(r, 1e-9), quad_segs=64) for x, y, r in discs])
    outline = shapely.line_interpolate_point(polygon.exterior, np.linspace(0.0, 1.0, 400), normalized=True)
    assert len(discs) <= MOST_DISCS
    assert shapely.hausdorff_distance(parts, parts.intersection(polygon)) < 1e-4
    assert shapely.distance(parts, outline).max() < 0.15 * discs[:, 2].max()


def test_a_round_robot_is_one_disc() -> None:
    assert cover(Footprint.disc(0.3)).tolist() == [[0.0, 0.0, 0.3]]
    assert cover(Footprint.point()).tolist() == [[0.0, 0.0, 0.0]]


def test_distances_of_discs_are_those_of_the_posed_footprint() -> None:
    robot = Robot(rectangle(0.5, 0.25))
    scenario = Scenario(name="mixed", world=MIXED, robot=robot, start=State(0.5, 1.5), goal=Goal(3.5, 2.8))
    poses = np.array([(0.5, 1.5, 0.3), (1.7, 1.4, 1.0), (2.2, 1.5, -2.0)])
    exact = [MIXED.clearance(robot.footprint, pose) for pose in poses]
    assert disc_distances(poses, scenario).min(axis=1) == pytest.approx(exact, abs=0.012)


@njit
def end_of(is_kinematic, state, control):  # type: ignore[no-untyped-def]
    return interval_end(is_kinematic, state, control, 0.5)


@njit
def derivatives_of(is_kinematic, state, control, costate, jacobian, hessian, end):  # type: ignore[no-untyped-def]
    add_derivatives(is_kinematic, state, control, 0.5, costate, jacobian, hessian, end)


def derivatives(
    is_kinematic: bool, w: NDArray[np.float64], costate: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    jacobian, hessian, end = np.empty((STATES, COLUMNS)), np.zeros((COLUMNS, COLUMNS)), np.empty(STATES)
    derivatives_of(is_kinematic, w[:STATES].copy(), w[STATES:].copy(), costate, jacobian, hessian, end)
    return jacobian, np.tril(hessian) + np.tril(hessian, -1).T


@pytest.mark.parametrize("is_kinematic", [False, True], ids=["dynamic", "kinematic"])
def test_derivatives_of_an_interval_are_its_slopes(is_kinematic: bool) -> None:
    rng, d = np.random.default_rng(1), 1e-6
    for _ in range(10):
        w, costate = rng.uniform(-1.0, 1.0, size=COLUMNS), rng.normal(size=STATES)
        w[5] = rng.uniform(0.05, 0.4)
        jacobian, hessian = derivatives(is_kinematic, w, costate)
        for j in range(COLUMNS):
            change = d * np.eye(COLUMNS)[j]
            ends = [np.array(end_of(is_kinematic, *np.split(w + s * change, [STATES]))) for s in (1.0, -1.0)]
            slopes = [derivatives(is_kinematic, w + s * change, costate)[0].T @ costate for s in (1.0, -1.0)]
            assert jacobian[:, j] == pytest.approx((ends[0] - ends[1]) / (2.0 * d), abs=1e-7)
            assert hessian[:, j] == pytest.approx((slopes[0] - slopes[1]) / (2.0 * d), abs=1e-7)


def solved(scenario: Scenario, objective: Objective) -> float:
    """Duration of a precise solution from the geodesic."""
    transcription, path = Transcription(scenario, objective), geodesic(scenario)
    assert path is not None
    guess = guess_along(path, scenario, AHEAD, "ahead")
    n = len(guess.states)
    solution = transcription.solve(guess, np.zeros(n), np.ones(n), 1e-7, lambda done: 300 - done)
    assert solution.infeasibility < 1e-5
    return transcription.trajectory(solution.guess).duration


def test_the_best_way_straight_ahead_is_accelerating_driving_and_braking() -> None:
    """From rest to rest over a distance d at most v and a takes d / v + v / a."""
    limits = Limits(0.0, 1.0, -1.0, 1.0, 0.5, 1.0)
    goal = Goal(8.0, 2.0, tolerance=1e-3, speed_tolerance=1e-3)
    scenario = Scenario(name="straight", world=OPEN, robot=Robot(limits=limits), start=State(2.0, 2.0), goal=goal)
    assert solved(scenario, Objective()) == pytest.approx(6.0 / 1.0 + 1.0 / 0.5, rel=0.003)


def test_the_best_way_on_the_spot_is_half_a_turn_up_and_half_down() -> None:
    """A turn by an angle b at most alpha takes 2 sqrt(b / alpha), where omega is large enough."""
    limits = Limits(-1.0, 1.0, -3.0, 3.0, 0.5, 1.0)
    goal = Goal(2.0, 2.0, tolerance=1e-3, theta=1.5, heading_tolerance=1e-3, speed_tolerance=1e-3)
    scenario = Scenario(name="turn", world=OPEN, robot=Robot(limits=limits), start=State(2.0, 2.0), goal=goal)
    assert solved(scenario, Objective()) == pytest.approx(2.0 * math.sqrt(1.5), rel=0.003)


def test_a_geodesic_bends_around_an_obstacle() -> None:
    world = World(Bounds((0.0, 0.0), (6.0, 4.0)), [Box((2.5, 0.0), (3.5, 3.0))])
    robot = Robot(Footprint.disc(0.2))
    scenario = Scenario(name="wall", world=world, robot=robot, start=State(1.0, 1.0), goal=Goal(5.0, 1.0))
    path = geodesic(scenario)
    assert path is not None
    line = shapely.LineString(path)
    corners = 2.0 * math.hypot(1.5, 2.0) + 1.0  # over the corners of the wall, the shortest path of a point
    assert corners < line.length < corners + 0.8
    assert shapely.distance(line, world.obstacles[0].to_shapely()) > 0.15


def test_there_is_no_geodesic_through_a_closed_wall() -> None:
    world = World(Bounds((0.0, 0.0), (6.0, 4.0)), [Box((2.5, 0.0), (3.5, 4.0))])
    assert geodesic(Scenario(name="closed", world=world, start=State(1.0, 1.0), goal=Goal(5.0, 1.0))) is None


def test_an_interval_of_a_guess_is_as_short_as_the_robot_is_fast() -> None:
    """A fast robot had one every 0.9 m, between which it jumped over corners."""
    assert interval_count(19.9, Limits(0.0, 3.0, -1.0, 1.0)) == 100
    assert interval_count(19.9, Limits(-3.0, 1.0, -1.0, 1.0)) == 100


def solution_in_the_open(*, is_kinematic: bool) -> tuple[Transcription, Guess]:
    scenario = Scenario(name="open", world=OPEN, start=State(1.0, 1.0, 1.0), goal=Goal(8.0, 3.0, tolerance=0.1))
    path = geodesic(scenario)
    assert path is not None
    transcription = Transcription(scenario, Objective(), is_kinematic=is_kinematic)
    guess = guess_along(path, scenario, AHEAD, "ahead")
    n = len(guess.states)
    return transcription, transcription.solve(guess, np.zeros(n), np.ones(n), 1e-4, lambda done: 200 - done).guess


@pytest.mark.parametrize("is_kinematic", [False, True], ids=["dynamic", "kinematic"])
def test_intervals_of_different_lengths_are_solved_and_rolled_out_to_even_rows(is_kinematic: bool) -> None:
    transcription, solution = solution_in_the_open(is_kinematic=is_kinematic)
    before = transcription.trajectory(solution)
    for first in (0, 5):
        chosen = np.zeros(len(solution.controls), dtype=np.bool_)
        chosen[first : first + 7] = True
        solution = split(solution, chosen, is_kinematic=is_kinematic)
    assert sorted(set(solution.multiples.tolist())) == [1, 2, 4]
    same = transcription.trajectory(solution)
    assert same.duration == pytest.approx(before.duration)
    assert same.states[-1] == pytest.approx(before.states[-1], abs=1e-5)
    n = len(solution.states)
    again = transcription.solve(solution, np.zeros(n), np.ones(n), 1e-5, lambda done: 100 - done)
    assert again.infeasibility < 1e-5
    np.testing.assert_array_equal(again.guess.multiples, solution.multiples)
    trajectory = transcription.trajectory(again.guess)
    assert np.diff(trajectory.t) == pytest.approx(trajectory.t[1])
    ends = trajectory.states[np.append(0, np.cumsum(transcription.rows(again.guess))), :3]
    assert ends == pytest.approx(again.guess.states[:, :3], abs=2e-3)


def test_a_solution_is_solved_again_in_a_few_steps() -> None:
    """With larger margins it took as many steps as the first time: its multipliers were forgotten."""
    wall = World(Bounds((0.0, 0.0), (10.0, 4.0)), [Box((3.0, 0.0), (3.5, 2.5)), Box((6.0, 1.5), (6.5, 4.0))])
    scenario = Scenario(name="wall", world=wall, start=State(1.0, 1.0), goal=Goal(9.0, 3.0, tolerance=0.1))
    path = geodesic(scenario)
    assert path is not None
    transcription = Transcription(scenario, Objective())

    def steps(guess: Guess, margin: float) -> tuple[int, Guess]:
        n = len(guess.states)
        solution = transcription.solve(guess, np.full(n, margin), np.ones(n), 1e-4, lambda done: 200 - done)
        assert solution.infeasibility < 1e-5
        return solution.iterations, solution.guess

    first, solution = steps(guess_along(path, scenario, AHEAD, "ahead"), 0.01)
    again, _ = steps(solution, 0.012)
    forgotten, _ = steps(solution._replace(duals=None), 0.012)
    assert again <= 5
    assert again < 0.5 * min(first, forgotten)
    finer, _ = steps(refined(solution, is_kinematic=False), 0.01)
    assert finer <= 20


@pytest.mark.parametrize("is_kinematic", [False, True], ids=["dynamic", "kinematic"])
def test_a_refined_guess_is_the_same_motion(is_kinematic: bool) -> None:
    transcription, solution = solution_in_the_open(is_kinematic=is_kinematic)
    finer = refined(solution, is_kinematic=is_kinematic)
    coarse, fine = transcription.trajectory(solution), transcription.trajectory(finer)
    driven = fine.at(np.arange(len(finer.states)) * finer.states[0, -1] * (1.0 - 1e-9))
    assert np.abs(driven[1:, 2:] - finer.states[1:, 2:5]).max() < 2e-3  # heading and velocities
    assert fine.duration == pytest.approx(coarse.duration)
    assert fine.states[-1] == pytest.approx(coarse.states[-1], abs=1e-5)
    again = guess_from_trajectory(coarse, transcription.scenario.robot.limits, "again")
    assert again.states[-1, :2] == pytest.approx(coarse.states[-1, :2])
