"""Refusals that say what is there, goals whose centre is blocked, and proofs that there is no way."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from cbrrt_ompl.cli import main
from cbrrt_ompl.collision.free_poses import nearest_free_pose
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import ScenarioError
from cbrrt_ompl.planning import approachable_goal, plan
from cbrrt_ompl.problem.obstacles import Bounds, Box, Disc, OrientedBox
from cbrrt_ompl.problem.robot import Footprint, Limits, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.scenario.connectivity import has_no_way
from cbrrt_ompl.scenario.scenario import Scenario, load_scenario, save_scenario
from cbrrt_ompl.verification import verify

WALLS = Bounds((0.0, 0.0), (6.0, 4.0))
DISC = Footprint.disc(0.2)
SQUARE = Footprint.polygon([(0.2, 0.15), (-0.2, 0.15), (-0.2, -0.15), (0.2, -0.15)])


def refusal(**parts: Any) -> str:
    given = {"name": "n", "world": World(WALLS, [Box((3.0, 1.0), (4.0, 2.0)), Disc((1.0, 3.0), 0.4)])}
    given |= {"robot": Robot(DISC), "start": State(1.0, 1.0), "goal": Goal(5.0, 3.0, 0.3)}
    with pytest.raises(ScenarioError) as caught:
        Scenario(**{**given, **parts})
    (line,) = str(caught.value).splitlines()
    return line


@pytest.mark.parametrize(
    ("x", "y", "what", "away"),
    [
        (2.9, 1.5, "it reaches 0.1 m into obstacles[0], a box", "0.15 m away"),
        (1.0, 2.45, "it reaches 0.05 m into obstacles[1], a disc", "0.1 m away"),
        (0.1, 1.0, "it reaches 0.1 m beyond the bounds", "0.15 m away"),
    ],
)
def test_a_refused_start_says_what_is_there_how_deep_and_where_there_is_room(
    x: float, y: float, what: str, away: str
) -> None:
    line = refusal(start=State(x, y))
    assert line.startswith(
        f"start: got [{x}, {y}, 0.0], expected a pose where the footprint touches no obstacle and no bound"
    )
    assert what in line
    assert away in line


def test_a_refused_goal_says_what_is_at_its_centre() -> None:
    line = refusal(goal=Goal(3.5, 1.5, 0.3))
    assert "all of it is in collision; at its centre it reaches 0.2 m into obstacles[0], a box" in line
    assert "nearest free pose is about (" in line


def test_a_world_without_room_says_so() -> None:
    with pytest.raises(ScenarioError, match="no free pose is near"):
        Scenario(name="n", world=World(WALLS), robot=Robot(Footprint.disc(2.5)), start=State(1, 1), goal=Goal(5, 3))


def test_unknown_cells_are_named_with_the_key_that_frees_them(tmp_path: Path) -> None:
    greys = np.full((60, 80), 254, dtype=np.uint8)
    greys[:, 60:] = 205
    greys[10:12, 10:12] = 0
    Image.fromarray(greys).save(tmp_path / "room.pgm")
    text = "name: n\nmap: {file: room.yaml%s}\nrobot: {robot_radius: 0.2}\nstart: {x: %s, y: %s}\ngoal: {x: 2, y: 1}\n"

    def start(x: float, y: float, more: str = "", yaw: float = 0.0) -> str:
        (tmp_path / "room.yaml").write_text(f"image: room.pgm\nresolution: 0.05\norigin: [0, 0, {yaw}]\n")
        (tmp_path / "s.yaml").write_text(text % (more, x, y))
        try:
            load_scenario(tmp_path / "s.yaml")
        except ScenarioError as error:
            return str(error)
        return ""

    unknown = (
        "it reaches into unknown cells, which count as occupied (map: {file: room.yaml, unknown: free} lets it in)"
    )
    assert unknown in start(2.9, 1.5)
    assert "0.15 m away" in start(2.9, 1.5)
    assert start(2.9, 1.5, ", unknown: free") == ""
    assert "m into occupied cells of the map" in start(0.55, 2.45)
    assert unknown in start(-1.0, 3.3, yaw=np.pi / 2)  # the map lies to the left of the origin now


def test_the_nearest_free_pose_is_free_and_hardly_farther_than_any_other() -> None:
    world = World(WALLS, [Box((2.0, 1.0), (4.0, 3.0))])
    found = nearest_free_pose(world, SQUARE, (2.3, 2.0, 0.0))
    assert found is not None
    assert not world.collides(SQUARE, found)
    assert 0.5 < np.hypot(found[0] - 2.3, found[1] - 2.0) < 0.56  # 0.3 m to the wall, and half the robot


SHELF = Scenario(
    name="shelf",
    world=World(WALLS, [Box((2.9, 1.0), (3.1, 4.0))]),
    robot=Robot(SQUARE, Limits(0.0, 0.5, -1.5, 1.5)),
    start=State(0.7, 2.0),
    goal=Goal(2.9, 1.0, 0.5, 0.0, 0.2, 0.01),
    planning=PlanningSettings(closed_loop=True, goal_bias=0.05, max_samples=5_000),
)


@pytest.mark.parametrize("planner", ["cb-rrt-robust", "cb-rrt"])
def test_a_goal_whose_centre_is_blocked_is_reached_where_part_of_it_is_free(planner: str) -> None:
    """It was planned for in vain: every final approach ended at the centre."""
    result = plan(SHELF, planner=planner, seed=1)
    assert result.status == "solved"
    assert result.trajectory is not None
    assert verify(result.trajectory, SHELF).ok


def test_the_part_of_a_goal_that_is_approached_lies_inside_it() -> None:
    part, goal = approachable_goal(SHELF), SHELF.goal
    assert part != goal and part.theta is not None and goal.theta is not None
    assert np.hypot(part.x - goal.x, part.y - goal.y) + part.tolerance <= goal.tolerance + 1e-12
    assert abs(part.theta - goal.theta) + part.heading_tolerance <= goal.heading_tolerance + 1e-12
    assert not SHELF.world.collides(SQUARE, (part.x, part.y, part.theta))


def gap(width: float) -> World:
    return World(WALLS, [Box((3.0, 0.0), (3.1, 2.0)), Box((3.0, 2.0 + width), (3.1, 4.0))])


@pytest.mark.parametrize(("width", "closed"), [(0.0, True), (0.3, True), (0.4001, False), (0.6, False)])
def test_a_gap_narrower_than_the_robot_is_proven_to_be_none(width: float, closed: bool) -> None:
    assert has_no_way(gap(width), DISC, State(1.0, 2.0), Goal(5.0, 2.0, 0.3)) == closed
    assert not has_no_way(gap(width), DISC, State(1.0, 2.0), Goal(2.0, 3.0, 0.3))
    assert not has_no_way(gap(width), Footprint.point(), State(1.0, 2.0), Goal(5.0, 2.0, 0.3))


def test_a_goal_region_that_reaches_through_the_wall_has_a_way() -> None:
    assert not has_no_way(gap(0.0), DISC, State(1.0, 2.0), Goal(3.6, 2.0, 1.0))


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=15, deadline=None)
def test_what_was_solved_is_never_proven_to_be_impossible(seed: int) -> None:
    rng = np.random.default_rng(seed)
    boxes = [Box(tuple(c), tuple(c + rng.uniform(0.1, 0.8, 2))) for c in rng.uniform(0.0, 5.0, (14, 2))]
    world = World(WALLS, boxes)
    start, goal = (rng.uniform((0.3, 0.3), (5.7, 3.7)) for _ in range(2))
    if world.collides(SQUARE, (*start, 0.0)) or world.collides(DISC, (*goal, 0.0)):
        return
    scenario = Scenario(name="n", world=world, robot=Robot(SQUARE), start=State(*start), goal=Goal(*goal, 0.3),
                        planning=PlanningSettings(max_samples=2_000, closed_loop=True))  # fmt: skip
    if plan(scenario, planner="cb-rrt-robust", seed=1, time_limit=0.4).solved:
        assert not has_no_way(world, SQUARE, scenario.start, scenario.goal)


@pytest.mark.parametrize("planner", ["cb-rrt-robust", "cb-rrt"])
def test_a_plan_ends_with_the_proof_and_not_with_its_time(planner: str) -> None:
    scenario = Scenario(
        name="closed", world=gap(0.3), robot=Robot(DISC), start=State(1.0, 2.0), goal=Goal(5.0, 2.0, 0.3),
        planning=PlanningSettings(max_samples=10**8),
    )  # fmt: skip
    began = time.perf_counter()
    result = plan(scenario, planner=planner, seed=1, time_limit=20.0)
    assert result.status == "no way"
    assert result.trajectory is None
    assert time.perf_counter() - began < 10.0


def test_walls_that_lie_askew_do_not_make_the_proof_slow() -> None:
    """In a map with a yaw it took 20 s: every turned wall was asked about each cell of the rectangle around it."""
    askew = [OrientedBox((20.0, 20.0 + 0.5 * k), (70.0, 0.1), 0.75) for k in range(-20, 20)]
    world = World(Bounds((0.0, 0.0), (40.0, 40.0)), askew)
    assert not has_no_way(world, DISC, State(1.0, 10.0), Goal(1.0, 10.0, 0.3))  # the imports are not to be timed
    began = time.process_time()
    assert has_no_way(world, DISC, State(35.0, 2.0), Goal(2.0, 35.0, 0.3))
    assert time.process_time() - began < 4.0


def test_a_plan_that_is_to_end_soon_is_not_kept_waiting_for_a_proof() -> None:
    """The proof began after half a second and took another half, whatever the time limit was."""
    scenario = Scenario(
        name="closed", world=gap(0.3), robot=Robot(DISC), start=State(1.0, 2.0), goal=Goal(5.0, 2.0, 0.3),
        planning=PlanningSettings(max_samples=10**8),
    )  # fmt: skip
    result = plan(scenario, planner="cb-rrt-robust", seed=1, time_limit=0.7)
    assert result.status == "time limit"


@pytest.mark.parametrize(
    ("samples", "width", "words"), [(10, 0.3, "status         no way"), (10, 0.6, "status         sample limit")]
)
def test_samples_that_run_out_soon_are_told_from_a_gap_too_narrow(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], samples: int, width: float, words: str
) -> None:
    """A robot too wide for its world was told of its samples alone where they ran out within half a second."""
    scenario = Scenario(
        name="gap", world=gap(width), robot=Robot(DISC), start=State(1.0, 2.0), goal=Goal(5.0, 2.0, 0.3),
        planning=PlanningSettings(max_samples=samples),
    )  # fmt: skip
    save_scenario(scenario, tmp_path / "gap.yaml")
    assert main(["plan", str(tmp_path / "gap.yaml"), "--planner", "cb-rrt-compiled", "--seed", "1"]) == 1
    assert words in capsys.readouterr().out


def test_a_robot_that_cannot_make_one_extension_is_told_of_the_horizon(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It was told of the time limit, and of a tree of one node."""
    fast = Robot(SQUARE, Limits(0.0, 2.0, -0.5, 0.5))  # 4 m an extension, nearly straight on
    scenario = Scenario(
        name="room", world=World(Bounds((0.0, 0.0), (3.0, 3.0))), robot=fast, start=State(0.5, 1.5),
        goal=Goal(2.5, 0.5, 0.2), planning=PlanningSettings(max_samples=20, horizon=2.0),
    )  # fmt: skip
    save_scenario(scenario, tmp_path / "room.yaml")
    assert main(["plan", str(tmp_path / "room.yaml"), "--planner", "s-rrt-compiled", "--seed", "1"]) == 1
    out = capsys.readouterr().out
    assert "nodes          1\n" in out
    assert out.endswith("no extension from the start was free: try a planning.horizon of less than 2 s\n")
