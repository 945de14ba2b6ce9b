"""Animations: how many frames, what they show, and the files that they are saved in."""

from __future__ import annotations

import base64
import html
import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.animation import FFMpegWriter
from numpy.typing import NDArray
from PIL import Image

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.drive import DriveResult, DriveSettings, drive
from cbrrt_ompl.errors import InputError
from cbrrt_ompl.figures import draw_drive
from cbrrt_ompl.figures import film as module
from cbrrt_ompl.figures.animation import animate, animate_drive, save_animation
from cbrrt_ompl.figures.film import frame_times
from cbrrt_ompl.figures.player import player_page
from cbrrt_ompl.figures.player_numbers import GAP, STEPS, plan_numbers
from cbrrt_ompl.planning import plan
from cbrrt_ompl.problem.obstacles import Bounds, Box
from cbrrt_ompl.problem.robot import Footprint, Limits, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.trajectory.tree import Tree

BOX = Box((4.0, 1.0), (4.4, 3.0))


def hall(footprint: Footprint) -> Scenario:
    return Scenario(
        name="hall",
        world=World(Bounds((0.0, 0.0), (8.0, 4.0)), [Box((1.0, 3.5), (2.0, 4.0))]),
        robot=Robot(footprint, Limits(0.0, 1.0, -1.0, 1.0, 0.6, 2.0)),
        start=State(0.8, 2.0),
        goal=Goal(7.2, 2.0, tolerance=0.4),
        planning=PlanningSettings(horizon=1.5, goal_bias=0.05),
    )


@pytest.fixture(scope="module")
def driven() -> DriveResult:
    """A drive that finds a box on its way."""
    return drive(hall(Footprint.disc(0.2)), [BOX], DriveSettings(2.5, max_samples=3000), seed=4)


@pytest.fixture(autouse=True)
def _few_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three frames a second are enough to test."""
    monkeypatch.setattr(module, "FRAMES_PER_SECOND", 3)
    monkeypatch.setattr(module, "LONGEST", 2.0)


def straight(duration: float) -> Trajectory:
    t = np.linspace(0.0, duration, 11)
    zero, one = np.zeros(11), np.full(11, 0.5)
    return Trajectory(t, 0.8 + 0.5 * t, zero + 2.0, zero, one, zero, one, zero)


def test_a_short_trajectory_is_shown_at_its_own_speed_and_its_end_is_held() -> None:
    np.testing.assert_allclose(frame_times(straight(1.0)), [0.0, 1 / 3, 2 / 3, 1.0, 1.0, 1.0, 1.0])


def test_a_long_trajectory_is_shown_faster() -> None:
    times = frame_times(straight(10.0))
    assert (len(times), times[0], times[-1]) == (2 * 3 + 1 + 3, 0.0, 10.0)


@pytest.mark.parametrize("footprint", [Footprint.point(), Footprint.disc(0.2)], ids=["point", "disc"])
def test_a_gif_has_every_frame_and_shows_motion(footprint: Footprint, tmp_path: Path) -> None:
    scenario = hall(footprint)
    result = plan(scenario, "cb-rrt-compiled", seed=1)
    assert result.trajectory is not None
    save_animation(animate(result.trajectory, scenario, result.tree), tmp_path / "plan.gif")
    with Image.open(tmp_path / "plan.gif") as image:
        moving = frame_times(result.trajectory)[:-3]
        assert image.size == (1920, 1080)
        assert image.n_frames == len(moving) == 7, "the held ones are one with the last"
        pictures = []
        for frame in range(len(moving)):
            image.seek(frame)
            pictures.append(np.asarray(image.convert("RGB"), dtype=int))
    assert (pictures[0][0, 0] == 255).all(), "paper is white"
    assert all(np.abs(b - a).max() > 100 for a, b in zip(pictures, pictures[1:], strict=False))
    assert [path.name for path in tmp_path.iterdir()] == ["plan.gif"]


def test_an_animated_drive_shows_an_obstacle_once_it_is_seen(driven: DriveResult) -> None:
    seen_at = next(cycle.time for cycle in driven.cycles if cycle.seen)
    animation = animate_drive(driven)
    show, times = animation._func, frame_times(driven.trajectory)
    plane = animation._fig.axes[0]
    seen, unseen = (next(c for c in plane.collections if c.get_label() == name) for name in ("found", "unknown"))
    shown = []
    for frame, t in enumerate(times):
        show(frame)
        shown.append((len(seen.get_paths()), len(unseen.get_paths())))
        assert shown[-1] == ((1, 0) if t >= seen_at else (0, 1))
    assert {(1, 0), (0, 1)} == set(shown)


def test_an_animated_drive_shows_the_braking_that_is_ready(driven: DriveResult) -> None:
    animation = animate_drive(driven)
    times = frame_times(driven.trajectory)
    line = next(line for line in animation._fig.axes[0].lines if line.get_label() == "braking, ready")
    for frame in (2, len(times) - 1):
        animation._func(frame)
        x, y = (np.asarray(values) for values in line.get_data())
        np.testing.assert_allclose([x[0], y[0]], driven.trajectory.at(times[frame])[0, :2])
        assert len(x) > 1
        collides = driven.world.referee(driven.scenario.robot.footprint).collides
        assert not any(collides(a, b, 0.0) for a, b in zip(x.tolist(), y.tolist(), strict=True))


def numbers_in(path: Path) -> dict[str, Any]:
    """What a player draws, read back from its page."""
    (text,) = re.findall(r'<script id="numbers" type="application/json">(.*?)</script>', path.read_text("utf-8"), re.S)
    numbers: dict[str, Any] = json.loads(text)
    return numbers


def unpacked(text: str, bounds: list[float]) -> NDArray[np.float64]:
    """Packed points in the world, shape (n, 2); gaps are NaN."""
    whole = np.frombuffer(base64.b64decode(text), dtype="<u2").reshape(-1, 2).astype(float)
    whole[whole == GAP] = np.nan
    return np.array(bounds[:2]) + whole * max(bounds[2] - bounds[0], bounds[3] - bounds[1]) / STEPS


class TestPlayer:
    def test_it_holds_the_trajectory_the_scene_and_the_tree(self, tmp_path: Path) -> None:
        scenario, trajectory = hall(Footprint.disc(0.2)), straight(1.0)
        tree = Tree(np.zeros((2, 5)), np.array([-1, 0]), np.array([[0.8, 2.0], [1.0, 2.5], [np.nan, np.nan]]))
        save_animation(animate(trajectory, scenario, tree), tmp_path / "plan.html")
        found = numbers_in(tmp_path / "plan.html")
        assert (found["name"], found["bounds"]) == ("hall", [0.0, 0.0, 8.0, 4.0])
        for name in ("t", "x", "y", "theta", "v", "v_command"):
            np.testing.assert_allclose(found["rows"][name], getattr(trajectory, name), atol=1e-3)
        np.testing.assert_allclose(unpacked(found["boxes"], found["bounds"]), [(1.0, 3.5), (2.0, 4.0)], atol=1e-3)
        np.testing.assert_allclose(unpacked(found["tree"], found["bounds"]), tree.polyline, atol=1e-3)
        assert found["limits"]["omega"] == pytest.approx([-57.2958, 57.2958], abs=1e-3)
        np.testing.assert_allclose(np.hypot(*np.array(found["robot"]).T), 0.2, atol=1e-5)

    def test_it_needs_nothing_from_elsewhere_and_has_its_buttons(self, tmp_path: Path) -> None:
        save_animation(animate(straight(1.0), hall(Footprint.point())), tmp_path / "plan.html")
        text = (tmp_path / "plan.html").read_text(encoding="utf-8")
        assert "http" not in text and "src=" not in text and "<link" not in text and "@import" not in text
        assert re.findall(r'<button id="(\w+)"', text) == ["play", "fit", "theme"]
        assert text.count("<canvas") == 1 and '<input id="time" type="range"' in text

    def test_a_name_cannot_leave_its_place(self, tmp_path: Path) -> None:
        scenario = replace(hall(Footprint.point()), name="</script><b>")
        save_animation(animate(straight(1.0), scenario), tmp_path / "plan.html")
        text = (tmp_path / "plan.html").read_text(encoding="utf-8")
        assert "<b>" not in text and numbers_in(tmp_path / "plan.html")["name"] == "</script><b>"

    def test_a_huge_tree_a_long_way_and_many_obstacles_stay_below_a_megabyte(self, tmp_path: Path) -> None:
        rng = np.random.default_rng(1)
        edges = np.dstack([rng.uniform(0.1, 7.9, (40_000, 11)), rng.uniform(0.1, 3.9, (40_000, 11))])
        edges[:, -1] = np.nan
        tree = Tree(np.zeros((1, 5)), np.array([-1]), edges.reshape(-1, 2))
        corners = rng.uniform((0.0, 0.0), (7.9, 3.9), (20_000, 2))
        boxes = [Box((x, y), (x + 0.01, y + 0.01)) for x, y in corners.tolist()]
        scenario = hall(Footprint.disc(0.2))
        crowded = SimpleNamespace(
            name="crowded", world=World(scenario.world.bounds, boxes), robot=scenario.robot,
            start=scenario.start, goal=scenario.goal,
        )  # fmt: skip
        t = np.linspace(0.0, 9.0, 20_000)
        zero, one = np.zeros(20_000), np.full(20_000, 0.5)
        numbers = plan_numbers(Trajectory(t, 0.8 + 0.5 * t, zero + 2.0, zero, one, zero, one, zero), crowded, tree)
        assert len(player_page(numbers)) < 1_000_000
        lines = unpacked(numbers["tree"], numbers["bounds"])
        assert 10_000 < np.isnan(lines[:, 0]).sum() < 20_001
        np.testing.assert_allclose(lines[0], edges[0, 0], atol=1e-3)

    def test_a_drive_tells_when_what_was_seen_and_which_plan_was_followed(
        self, driven: DriveResult, tmp_path: Path
    ) -> None:
        save_animation(animate_drive(driven), tmp_path / "drive.html")
        drive = numbers_in(tmp_path / "drive.html")["drive"]
        assert [index for seen in drive["seen"] for index in seen] == [0]
        assert len(drive["looks"]) == len(drive["braking"]) == len(driven.cycles)
        taken = [replan for replan in driven.replans if replan.trajectory is not None]
        assert [plan["from"] for plan in drive["plans"]] == [replan.start_time for replan in taken]
        np.testing.assert_allclose(drive["computing"], driven.computing_times, atol=1e-6)
        for look, line in zip(drive["looks"], drive["braking"], strict=True):
            np.testing.assert_allclose(line[0], driven.trajectory.at(look)[0, :2], atol=1e-3)

    def test_a_notebook_shows_it_in_a_frame(self) -> None:
        shown = animate(straight(1.0), hall(Footprint.point()))._repr_html_()
        assert shown.startswith("<iframe") and html.unescape(shown).count("<!DOCTYPE html>") == 1


def test_frames_are_1080p() -> None:
    figure = animate(straight(1.0), hall(Footprint.point()))._fig
    assert tuple(figure.bbox.size) == (1920.0, 1080.0)


def test_mp4_without_ffmpeg_is_one_clear_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(FFMpegWriter, "isAvailable", classmethod(lambda cls: False))
    animation = animate(straight(1.0), hall(Footprint.disc(0.2)))
    with pytest.raises(InputError, match=r"suffix: got '\.mp4', expected ffmpeg on the path for MP4"):
        save_animation(animation, tmp_path / "plan.mp4")


@pytest.mark.parametrize("name", ["plan.avi", "plan"])
def test_other_kinds_of_files_are_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"suffix: got .*, expected one of \.gif, \.html, \.mp4"):
        module.check_animation_file(tmp_path / name)


def test_a_file_that_cannot_be_written_is_an_error_and_leaves_nothing(tmp_path: Path) -> None:
    animation = animate(straight(1.0), hall(Footprint.disc(0.2)))
    (tmp_path / "plan.gif").mkdir()
    with pytest.raises(InputError, match="cannot write .*plan.gif: is a directory"):
        save_animation(animation, tmp_path / "plan.gif")
    assert [path.name for path in tmp_path.iterdir()] == ["plan.gif"]


def test_the_figure_of_a_drive_shows_what_was_found_and_every_plan_taken(driven: DriveResult) -> None:
    figure = draw_drive(driven)
    plane, clock = figure.axes[0], figure.axes[3]
    found = next(c for c in plane.collections if c.get_label() == "found")
    assert len(found.get_paths()) == 1
    starts = next(line for line in plane.lines if line.get_label() == "new plan")
    assert len(starts.get_xdata()) == sum(replan.trajectory is not None for replan in driven.replans)
    limit = next(line for line in clock.lines if line.get_label() == "cycle time")
    assert set(limit.get_ydata()) == {100.0}
    computing = next(line for line in clock.lines if line.get_label() == "all computing")
    np.testing.assert_allclose(computing.get_ydata(), 1e3 * driven.computing_times)
    assert (clock.get_xlabel(), clock.get_ylabel()) == ("t [s]", "computing [ms]")
