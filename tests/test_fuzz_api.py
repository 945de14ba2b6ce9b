"""Wrong arguments of every kind: only our own errors come out, each with a message a problem."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import ANYTHING, arguments, changed

from cbrrt_ompl import (
    Bounds,
    Box,
    Disc,
    Footprint,
    Gains,
    Goal,
    InputError,
    Limits,
    OccupancyMap,
    OrientedBox,
    PlanningSettings,
    Polygon,
    Robot,
    Scenario,
    State,
    Trajectory,
    World,
    load_map,
    load_scenario,
    make_setup,
    plan,
    save_map,
    save_scenario,
    verify,
)
from cbrrt_ompl.ompl_plugin.availability import has_ompl
from cbrrt_ompl.problem.settings import MAX_SAMPLES
from cbrrt_ompl.scenario.dynobench import load_dynobench
from cbrrt_ompl.scenario.maps.discs import load_discs
from cbrrt_ompl.scenario.scenario import scenario_from_dict, scenario_to_dict

ROW = np.array([0.0, 1.0])
TRIANGLE = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]
BOUNDS = Bounds((0.0, 0.0), (4.0, 4.0))
WORLD = World(BOUNDS, [Disc((2.0, 2.0), 0.3)])
SCENARIO = Scenario(
    name="small",
    world=WORLD,
    start=State(1.0, 1.0),
    goal=Goal(3.0, 3.0),
    planning=PlanningSettings(max_samples=20),
)
TRAJECTORY = Trajectory(ROW, *(0.0 * ROW for _ in range(7)))


CALLS: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {
    "Bounds": (Bounds, {"min": (0.0, 0.0), "max": (1.0, 1.0)}),
    "Box": (Box, {"min": (0.0, 0.0), "max": (1.0, 1.0)}),
    "OrientedBox": (OrientedBox, {"center": (0.0, 0.0), "size": (1.0, 1.0), "angle": 0.3}),
    "Disc": (Disc, {"center": (0.0, 0.0), "radius": 1.0}),
    "Polygon": (Polygon, {"vertices": TRIANGLE, "holes": ()}),
    "World": (World, {"bounds": BOUNDS, "obstacles": [Disc((1.0, 1.0), 0.2)]}),
    "World.from_grid": (World.from_grid, {"grid": [[0, 1], [0, 0]], "resolution": 0.1, "origin": (0.0, 0.0, 0.0)}),
    "World.from_shapely": (World.from_shapely, {"geometry": [], "bounds": BOUNDS}),
    "Footprint.disc": (Footprint.disc, {"radius": 0.2}),
    "Footprint.polygon": (Footprint.polygon, {"vertices": TRIANGLE}),
    "Footprint": (Footprint, {"radius": 0.2, "vertices": None}),
    "Limits": (lambda **values: Robot(limits=Limits(**values)), Limits()._asdict()),
    "Gains": (lambda **values: Robot(gains=Gains(**values)), Gains()._asdict()),
    "Robot": (Robot, {"footprint": Footprint.point(), "limits": Limits(), "gains": Gains()}),
    "Goal": (
        Goal,
        {"x": 1.0, "y": 1.0, "tolerance": 0.1, "theta": 0.0, "heading_tolerance": 0.1, "speed_tolerance": None},
    ),
    "PlanningSettings": (PlanningSettings, dict(vars(PlanningSettings()))),
    "State": (lambda **values: Scenario(**{**vars(SCENARIO), "start": State(**values)}), State(1.0, 1.0)._asdict()),
    "Scenario": (Scenario, dict(vars(SCENARIO))),
    "Trajectory": (Trajectory, dict(vars(TRAJECTORY))),
    "Trajectory.at": (TRAJECTORY.at, {"times": 0.5}),
    "Trajectory.save": (TRAJECTORY.save, {"path": "/none/file.csv"}),
    "Trajectory.load": (Trajectory.load, {"path": "none.csv", "kinematic": False}),
    "plan": (
        plan,
        {"scenario": SCENARIO, "planner": "cb-rrt-compiled", "seed": 1, "time_limit": 1.0, "progress": None},
    ),
    **({"make_setup": (make_setup, {"scenario": SCENARIO, "planner": "cb-rrt"})} if has_ompl() else {}),
    "verify": (verify, {"trajectory": TRAJECTORY, "scenario": SCENARIO, "tolerance": 1e-3}),
    "load_scenario": (load_scenario, {"path": "none.yaml"}),
    "save_scenario": (save_scenario, {"scenario": SCENARIO, "path": "/none/file.yaml"}),
    "load_map": (load_map, {"path": "none.png", "resolution": 0.1, "origin": (0.0, 0.0, 0.0), "unknown": "free"}),
    "save_map": (save_map, {"world": WORLD, "path": "/none/file.yaml", "resolution": 0.5}),
    "load_discs": (load_discs, {"path": "none.csv"}),
    "load_dynobench": (load_dynobench, {"problem_path": "none.yaml", "model_path": "none.yaml", "tolerance": 0.2}),
    "OccupancyMap": (
        OccupancyMap,
        {"cells": [[0, 100]], "resolution": 0.1, "origin": (0.0, 0.0, 0.0), "unknown": "free"},
    ),
    "scenario_from_dict": (scenario_from_dict, {"data": scenario_to_dict(SCENARIO), "folder": None}),
}
"""What a caller may call, with arguments that are accepted, or refused for a missing file alone."""


@pytest.fixture(scope="module", autouse=True)
def _somewhere_else(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Names of files are arguments as well, and some of them can be written."""
    before = os.getcwd()
    os.chdir(tmp_path_factory.mktemp("fuzz"))
    yield
    os.chdir(before)


def assert_a_line_a_problem(error: InputError) -> None:
    lines = str(error).splitlines()
    assert len(lines) == len(error.problems) > 0
    ours = (", expected ", "no such file: ", "cannot read ")
    assert all(any(words in line for words in ours) and len(line) < 400 for line in lines)


@pytest.mark.parametrize("name", CALLS)
def test_a_wrong_argument_is_refused_in_our_own_words(name: str) -> None:
    call, good = CALLS[name]

    @given(arguments(good))
    def check(values: dict[str, Any]) -> None:
        try:
            call(**values)
        except InputError as error:
            assert_a_line_a_problem(error)

    check()


@given(changed(scenario_to_dict(SCENARIO)))
def test_plain_values_make_a_scenario_or_are_refused_in_our_own_words(data: Any) -> None:
    try:
        scenario_from_dict(data)
    except InputError as error:
        assert_a_line_a_problem(error)


@pytest.mark.parametrize(
    ("name", "value", "complaint"),
    [
        ("horizon", "2", "planning.horizon: got '2', expected a number above 0, from 1e-09 to 1e+06 [s]"),
        ("horizon", 1e308, "planning.horizon: got 1e+308, expected a number above 0, from 1e-09 to 1e+06 [s]"),
        ("goal_bias", "1", "planning.goal_bias: got '1', expected a number from 0 to 1"),
        (
            "max_samples",
            True,
            "planning.max_samples: got True, expected a whole number of 1 or more, at most 1000000000",
        ),
        ("max_samples", 10**30, f"expected a whole number of 1 or more, at most {MAX_SAMPLES}"),
        ("cut_extension", ["keep"], "planning.cut_extension: got ['keep'], expected one of discard, keep"),
        ("closed_loop", "no", "planning.closed_loop: got 'no', expected True or False"),
    ],
)
def test_a_wrong_setting_is_named_with_what_it_should_be(name: str, value: object, complaint: str) -> None:
    with pytest.raises(InputError) as caught:
        PlanningSettings(**{name: value})  # type: ignore[arg-type]
    assert complaint in str(caught.value)
    assert_a_line_a_problem(caught.value)


@given(ANYTHING)
def test_what_is_no_scenario_is_refused_by_everything_that_takes_one(value: Any) -> None:
    calls = [plan, lambda s: verify(TRAJECTORY, s), lambda s: save_scenario(s, Path("x.yaml"))]
    for call in [*calls, make_setup] if has_ompl() else calls:
        with pytest.raises(InputError, match="expected a value of type Scenario"):
            call(value)


@given(st.sampled_from(sorted(CALLS)))
def test_every_good_argument_is_accepted(name: str) -> None:
    call, good = CALLS[name]
    try:
        call(**good)
    except InputError as error:
        assert "file" in str(error) or "suffix" in str(error)


def test_a_number_of_too_many_digits_to_be_shown_is_named_by_its_type() -> None:
    with pytest.raises(InputError, match="planning.max_samples: got a value of type int, expected a whole number"):
        PlanningSettings(max_samples=10**5000)
