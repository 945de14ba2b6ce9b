"""What goals and planning settings accept, and how they refuse the rest."""

from __future__ import annotations

import math
from typing import Any

import pytest

from cbrrt_ompl.errors import SettingsError
from cbrrt_ompl.problem.robot import Limits
from cbrrt_ompl.problem.settings import MAX_STEPS, Goal, PlanningSettings, State

NAN, INF = math.nan, math.inf


def fields_of(error: pytest.ExceptionInfo[SettingsError]) -> list[str]:
    return [problem.field for problem in error.value.problems]


class TestGoal:
    @pytest.mark.parametrize(
        ("name", "value"),
        [
            *[(name, value) for name in ("x", "y", "theta") for value in (NAN, INF, -INF)],
            *[
                (name, value)
                for name in ("tolerance", "heading_tolerance", "speed_tolerance")
                for value in (0.0, -0.1, NAN, INF)
            ],
        ],
    )
    def test_a_value_without_sense_is_refused_by_name(self, name: str, value: float) -> None:
        with pytest.raises(SettingsError, match=rf"goal\.{name}: got .*, expected") as error:
            Goal(**{"x": 1.0, "y": 2.0, name: value})
        assert fields_of(error) == [f"goal.{name}"]
        assert error.value.problems[0].value is value

    def test_all_mistakes_are_reported_together(self) -> None:
        with pytest.raises(SettingsError) as error:
            Goal(NAN, 0.0, tolerance=-1.0, theta=INF, speed_tolerance=0.0)
        assert fields_of(error) == ["goal.x", "goal.theta", "goal.tolerance", "goal.speed_tolerance"]
        assert len(str(error.value).splitlines()) == 4

    def test_heading_and_speed_are_free_unless_asked_for(self) -> None:
        goal = Goal(1.0, 2.0)
        assert goal.is_position_only
        assert goal.violations(State(1.2, 1.8, 3.0, 1.0, -2.0)) == []
        assert not Goal(1.0, 2.0, theta=0.0).is_position_only
        assert not Goal(1.0, 2.0, speed_tolerance=0.1).is_position_only

    def test_the_rim_of_the_disc_is_outside(self) -> None:
        goal = Goal(0.0, 0.0, tolerance=0.5)
        assert goal.violations(State(0.5, 0.0)) == ["0.5 m from the goal, tolerance 0.5 m"]
        assert goal.violations(State(math.nextafter(0.5, 0.0), 0.0)) == []

    def test_headings_are_compared_around_the_circle(self) -> None:
        goal = Goal(0.0, 0.0, theta=3.1, heading_tolerance=0.2)
        assert goal.violations(State(0.0, 0.0, -3.1)) == []
        assert goal.violations(State(0.0, 0.0, 3.1 + 10.0 * math.pi)) == []
        assert goal.violations(State(0.0, 0.0, -2.9)) == ["heading off by 0.283185 rad, tolerance 0.2 rad"]

    def test_every_violated_condition_has_its_line(self) -> None:
        goal = Goal(0.0, 0.0, tolerance=0.1, theta=0.0, heading_tolerance=0.1, speed_tolerance=0.2)
        lines = goal.violations(State(1.0, 0.0, 1.0, 0.5, -0.3))
        assert [line.split(",")[0] for line in lines] == [
            "1 m from the goal",
            "heading off by 1 rad",
            "arrives with v = 0.5 m/s",
            "arrives with omega = -0.3 rad/s",
        ]

    def test_a_state_at_the_tolerances_of_heading_and_speed_is_inside(self) -> None:
        goal = Goal(0.0, 0.0, theta=0.0, heading_tolerance=0.25, speed_tolerance=0.5)
        assert goal.violations(State(0.0, 0.0, -0.25, 0.5, -0.5)) == []


class TestPlanningSettings:
    @pytest.mark.parametrize(
        ("name", "value"),
        [
            *[(name, value) for name in ("horizon", "step") for value in (0.0, -1.0, NAN, INF)],
            *[("goal_bias", value) for value in (-0.01, 1.01, NAN)],
            *[("max_samples", value) for value in (0, -1, 1.5, 100.0)],
            *[("cut_extension", value) for value in ("Discard", "", None)],
            *[("equal_control_tolerance", value) for value in (NAN, INF, -INF)],
            *[("look_ahead", value) for value in (0.0, -2.0, NAN, INF)],
            *[("nearest_neighbour", value) for value in ("gnat", None)],
        ],
    )
    def test_a_value_without_sense_is_refused_by_name(self, name: str, value: Any) -> None:
        with pytest.raises(SettingsError, match=rf"planning\.{name}: got .*, expected") as error:
            PlanningSettings(**{name: value})
        assert fields_of(error) == [f"planning.{name}"]

    def test_all_mistakes_are_reported_together(self) -> None:
        with pytest.raises(SettingsError) as error:
            PlanningSettings(horizon=-1.0, step=NAN, goal_bias=2.0, max_samples=0, cut_extension="cut", look_ahead=0.0)
        assert fields_of(error) == [
            f"planning.{name}"
            for name in ("horizon", "step", "goal_bias", "max_samples", "cut_extension", "look_ahead")
        ]
        assert len(str(error.value).splitlines()) == 6

    @pytest.mark.parametrize(("name", "known"), [("cut_extension", "discard, keep"), ("nearest_neighbour", "kd-tree")])
    def test_an_unknown_word_is_told_the_known_ones(self, name: str, known: str) -> None:
        with pytest.raises(SettingsError, match=known):
            PlanningSettings(**{name: "nothing"})

    @pytest.mark.parametrize(("horizon", "step"), [(0.02, 0.05), (1.0, 0.5 / MAX_STEPS)])
    def test_a_horizon_of_no_step_or_too_many_is_refused(self, horizon: float, step: float) -> None:
        with pytest.raises(SettingsError, match=f"1 to {MAX_STEPS} steps") as error:
            PlanningSettings(horizon=horizon, step=step)
        assert fields_of(error) == ["planning.horizon"]

    @pytest.mark.parametrize(("horizon", "step", "steps"), [(2.0, 0.05, 40), (0.3, 0.1, 3), (0.05, 0.05, 1)])
    def test_the_steps_fill_the_horizon(self, horizon: float, step: float, steps: int) -> None:
        assert PlanningSettings(horizon=horizon, step=step).steps == steps

    def test_the_reference_is_as_far_as_full_speed_leads_unless_told(self) -> None:
        limits = Limits(v_max=1.5)
        assert PlanningSettings(horizon=2.0).reference_distance(limits) == 3.0
        assert PlanningSettings(horizon=2.0, look_ahead=0.7).reference_distance(limits) == 0.7

    def test_the_edges_of_the_ranges_are_accepted(self) -> None:
        for values in (
            {"goal_bias": 0.0},
            {"goal_bias": 1.0},
            {"max_samples": 1},
            {"equal_control_tolerance": -1.0},
            {"equal_control_tolerance": 0.0},
            {"horizon": 1.0, "step": 1.0 / MAX_STEPS},
        ):
            assert PlanningSettings(**values).steps >= 1


def test_a_state_stands_still_facing_x_unless_told() -> None:
    assert State(1.0, 2.0) == (1.0, 2.0, 0.0, 0.0, 0.0)
