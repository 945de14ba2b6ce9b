"""Drives with improved plans: shorter, as safe, and the same on every run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cbrrt_ompl import PlanResult, Scenario, improve, load_scenario, plan
from cbrrt_ompl.drive import DriveSettings, drive, simulation
from cbrrt_ompl.drive.improving import on_whole_steps
from cbrrt_ompl.errors import SettingsError
from cbrrt_ompl.trajectory.trajectory import Trajectory


@pytest.fixture(scope="module")
def office(scenarios: Path) -> Scenario:
    return load_scenario(scenarios / "office.yaml")


def test_a_drive_with_improved_plans_is_shorter_safe_and_repeats_itself(office: Scenario) -> None:
    plain, *better = (
        drive(office, None, DriveSettings(sensor_range=2.5, max_samples=2000, max_iterations=steps), seed=1)
        for steps in (0, 600, 600)
    )
    assert better[0].reached and better[0].verification.ok
    assert better[0].smallest_clearance >= better[0].settings.margin
    assert better[0].trajectory.duration < 0.8 * plain.trajectory.duration
    assert better[0].trajectory == better[1].trajectory


def test_an_improvement_that_was_cut_short_goes_on_in_the_next_cycles(office: Scenario) -> None:
    """Until it comes to its end: then no cycle takes the plan up again."""
    settings = DriveSettings(sensor_range=30.0, max_samples=2000, max_iterations=14)
    result = drive(office, [], settings, seed=1)
    statuses = [replan.status for replan in result.replans]
    assert statuses[0] == "solved" and set(statuses[1:]) == {"improved"}
    assert len(statuses) < 0.5 * len(result.cycles)
    assert len(result.searches) == len(result.planning_times) == 1
    assert result.reached and result.verification.ok
    arrivals = [replan.start_time + replan.trajectory.duration for replan in result.replans if replan.trajectory]
    assert arrivals == sorted(arrivals, reverse=True)
    assert arrivals[-1] < 0.9 * arrivals[0]


def test_a_plan_is_driven_where_its_improvement_is_late(office: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [0.0]
    monkeypatch.setattr(simulation.time, "perf_counter", lambda: clock[0])

    def late(found: Trajectory, *_: object) -> tuple[Trajectory, bool]:
        clock[0] += 1.0
        return found.resampled(20.0), False

    monkeypatch.setattr(simulation, "improved", late)
    made = []

    def planned(scenario: Scenario, *_: object) -> PlanResult:
        made.append(plan(scenario, "cb-rrt-robust", seed=1))
        return made[-1]

    monkeypatch.setattr(simulation, "plan", planned)
    result = drive(office, [], DriveSettings(sensor_range=30.0, max_iterations=600), seed=1)
    assert result.reached and len(made) == 1
    assert [replan.status for replan in result.replans] == ["solved"]
    taken = result.replans[0].trajectory
    assert taken is not None and np.array_equal(taken.states, made[0].trajectory.states)


def test_an_improved_trajectory_has_rows_at_whole_steps_and_ends_where_it_did(office: Scenario) -> None:
    """Also where it ends at speed in the middle of a step: it drives on to the end of that."""
    first = plan(office, "cb-rrt-robust", seed=1).trajectory
    better = improve(first, office, max_iterations=400)
    rows = on_whole_steps(better, 0.05)
    assert np.diff(rows.t) == pytest.approx(0.05)
    assert better.duration <= rows.duration + 1e-9 < better.duration + 0.05 + 1e-9
    along = rows.at(better.t)
    assert np.hypot(*(along[:, :2] - better.poses[:, :2]).T).max() < 0.01
    limits = office.robot.limits
    assert np.abs(np.diff(rows.v)).max() <= 0.05 * limits.acceleration + 1e-9
    assert np.abs(np.diff(rows.omega)).max() <= 0.05 * limits.angular_acceleration + 1e-9


@pytest.mark.parametrize("steps", [-1, 0.5, "600"])
def test_wrong_iterations_are_refused_by_name(steps: object) -> None:
    with pytest.raises(SettingsError, match="max_iterations: got .* expected a whole number of 0 or more"):
        DriveSettings(max_iterations=steps)  # type: ignore[arg-type]


def test_a_last_step_that_became_longer_is_cut_in_two() -> None:
    """Rows that follow a motion to a goal at speed may end a little after it, in a step longer than the others."""
    t = np.linspace(0.0, 0.9998, 26)
    v = 1.0 + 0.9 * np.sin(3.0 * t)
    x = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t))])
    flat = np.zeros_like(t)
    motion = Trajectory(t, x, flat, flat, v, flat, np.append(v[1:], v[-1]), flat)
    assert motion.resampled(20.0).duration > 1.0 + 1e-6, "the last step is no longer than the others"
    rows = on_whole_steps(motion, 0.05)
    assert np.diff(rows.t) == pytest.approx(0.05)
    assert rows.duration == pytest.approx(1.05)
    assert rows.at(0.9998)[0, 0] == pytest.approx(x[-1], abs=5e-3)
    assert rows.x[-1] == pytest.approx(x[-1] + v[-1] * (1.05 - 0.9998), abs=5e-3)
