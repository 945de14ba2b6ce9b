"""Animations: how many frames, what they show, and the files that they are saved in."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.animation import FFMpegWriter, FuncAnimation
from PIL import Image

from cbrrt_ompl.collision.world import World
from cbrrt_ompl.drive import DriveResult, DriveSettings, drive
from cbrrt_ompl.errors import InputError
from cbrrt_ompl.figures import animation as module
from cbrrt_ompl.figures.animation import animate, animate_drive, frame_times, save_animation
from cbrrt_ompl.figures.figures import draw_drive
from cbrrt_ompl.planning import plan
from cbrrt_ompl.problem.obstacles import Bounds, Box
from cbrrt_ompl.problem.robot import Footprint, Limits, Robot
from cbrrt_ompl.problem.settings import Goal, PlanningSettings, State
from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.trajectory.trajectory import Trajectory

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


def unsaved(animation: FuncAnimation) -> FuncAnimation:
    """An animation that may be dropped without being saved: matplotlib warns of others."""
    animation._draw_was_started = True
    return animation


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
        assert image.n_frames == len(moving) == 7, "the held ones are one with the last"
        pictures = []
        for frame in range(len(moving)):
            image.seek(frame)
            pictures.append(np.asarray(image.convert("RGB"), dtype=int))
    assert all(np.abs(b - a).max() > 100 for a, b in zip(pictures, pictures[1:], strict=False))
    assert [path.name for path in tmp_path.iterdir()] == ["plan.gif"]


def test_an_animated_drive_shows_an_obstacle_once_it_is_seen(driven: DriveResult) -> None:
    seen_at = next(cycle.time for cycle in driven.cycles if cycle.seen)
    animation = unsaved(animate_drive(driven))
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
    animation = unsaved(animate_drive(driven))
    times = frame_times(driven.trajectory)
    line = next(line for line in animation._fig.axes[0].lines if line.get_label() == "braking, ready")
    for frame in (2, len(times) - 1):
        animation._func(frame)
        x, y = (np.asarray(values) for values in line.get_data())
        np.testing.assert_allclose([x[0], y[0]], driven.trajectory.at(times[frame])[0, :2])
        assert len(x) > 1
        collides = driven.world.referee(driven.scenario.robot.footprint).collides
        assert not any(collides(a, b, 0.0) for a, b in zip(x.tolist(), y.tolist(), strict=True))


def test_html_is_one_file_with_all_pictures(tmp_path: Path) -> None:
    animation = animate(straight(1.0), hall(Footprint.disc(0.2)))
    save_animation(animation, tmp_path / "plan.html")
    text = (tmp_path / "plan.html").read_text(encoding="utf-8")
    assert text.count("data:image/png;base64,") == 7
    assert 'src="http' not in text


def test_mp4_without_ffmpeg_is_one_clear_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(FFMpegWriter, "isAvailable", classmethod(lambda cls: False))
    animation = unsaved(animate(straight(1.0), hall(Footprint.disc(0.2))))
    with pytest.raises(InputError, match=r"suffix: got '\.mp4', expected ffmpeg on the path for MP4"):
        save_animation(animation, tmp_path / "plan.mp4")


@pytest.mark.parametrize("name", ["plan.avi", "plan"])
def test_other_kinds_of_files_are_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"suffix: got .*, expected one of \.gif, \.html, \.mp4"):
        module.check_animation_file(tmp_path / name)


def test_a_file_that_cannot_be_written_is_an_error_and_leaves_nothing(tmp_path: Path) -> None:
    animation = animate(straight(1.0), hall(Footprint.disc(0.2)))
    (tmp_path / "plan.gif").mkdir()
    with pytest.raises(InputError, match="expected a file that can be written"):
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
