"""cb-rrt-anytime as a planner of OMPL: it goes on, honours objectives, reports what it finds, and stays exact."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from cbrrt_ompl import (
    Bounds,
    Box,
    DurationObjective,
    Goal,
    Limits,
    Robot,
    Scenario,
    State,
    World,
    make_setup,
    read_state,
    trajectory_from_path,
    verify,
)

pytestmark = pytest.mark.needs_ompl
ob = pytest.importorskip("ompl.base")

ANYTIME = "cb-rrt-anytime"
WORLD = World(Bounds((-5.0, -5.0), (5.0, 5.0)), [Box((-0.5, -5.0), (0.5, 2.0))])
SCENARIO = Scenario(
    name="wall",
    world=WORLD,
    robot=Robot(limits=Limits(omega_min=-1.5, omega_max=1.5, angular_acceleration=3.0)),
    start=State(-4.0, -3.0),
    goal=Goal(4.0, -3.0),
)


def solved(objective: Any = None, seconds: float = 1.0) -> tuple[Any, list[tuple[int, float]]]:
    """A set-up after ``solve``, and what its callback heard: states and costs."""
    setup, heard = make_setup(SCENARIO, ANYTIME), list[tuple[int, float]]()
    if objective is not None:
        setup.setOptimizationObjective(objective(setup.getSpaceInformation()))
    listen = ob.ReportIntermediateSolutionFn(lambda planner, states, cost: heard.append((len(states), cost.value())))
    setup.getProblemDefinition().setIntermediateSolutionCallback(listen)
    setup.setup()
    assert setup.solve(seconds).asString() == "Exact solution"
    return setup, heard


def test_it_goes_on_and_its_last_solution_is_its_best() -> None:
    setup, heard = solved()
    costs = [row.cost for row in setup.getPlanner().progress]
    assert len(costs) > 1
    assert all(later < earlier for earlier, later in pairwise(costs))
    assert [cost for _, cost in heard] == costs
    trajectory = trajectory_from_path(setup.getSolutionPath(), SCENARIO)
    assert trajectory.duration == pytest.approx(costs[-1], abs=1e-6)
    assert verify(trajectory, SCENARIO).ok


def test_the_path_length_is_honoured() -> None:
    """The shortest of all paths found is not the quickest: both are held against the same trees."""
    setup, heard = solved(ob.PathLengthOptimizationObjective)
    path = setup.getSolutionPath()
    cost = path.asGeometric().cost(setup.getProblemDefinition().getOptimizationObjective()).value()
    assert cost == pytest.approx(heard[-1][1])
    assert cost == pytest.approx(trajectory_from_path(path, SCENARIO).length, rel=1e-3)
    assert setup.getProblemDefinition().getSolutions()[0].cost_.value() == pytest.approx(cost)


@pytest.mark.parametrize("threshold", [100.0, 0.0])
def test_a_solution_that_meets_the_threshold_ends_it(threshold: float) -> None:
    setup, heard = solved(lambda si: DurationObjective(si, threshold), seconds=2.0)
    assert (len(heard) == 1) == (threshold > 0.0)
    assert setup.getProblemDefinition().hasOptimizedSolution() == (threshold > 0.0)


def test_without_a_callback_it_works_as_well() -> None:
    setup = make_setup(SCENARIO, ANYTIME)
    assert setup.solve(0.3).asString() == "Exact solution"
    assert len(setup.getPlanner().progress) > 1


def test_an_exception_of_the_callback_reaches_the_caller() -> None:
    def fail(*_: Any) -> None:
        raise RuntimeError("on purpose")

    setup = make_setup(SCENARIO, ANYTIME)
    setup.getProblemDefinition().setIntermediateSolutionCallback(ob.ReportIntermediateSolutionFn(fail))
    with pytest.raises(RuntimeError, match="on purpose"):
        setup.solve(0.3)


def test_a_users_checker_is_obeyed_by_every_solution() -> None:
    setup = make_setup(SCENARIO, ANYTIME)
    checker = ob.StateValidityCheckerFn(lambda state: read_state(state).y < 4.0 and WORLD.clearance(
        SCENARIO.robot.footprint, read_state(state)[:3]) > 0.0)  # fmt: skip
    setup.setStateValidityChecker(checker)
    assert setup.solve(2.0).asString() == "Exact solution"
    assert max(trajectory_from_path(setup.getSolutionPath(), SCENARIO).y) < 4.0


def test_its_progress_is_in_the_table_of_the_benchmark(tmp_path: Path) -> None:
    from cbrrt_ompl.benchmark.database import write_database
    from cbrrt_ompl.benchmark.experiment import Experiment

    log = Experiment(SCENARIO, {ANYTIME: (1, 2)}, "wall").run(0.5)
    write_database(tmp_path / "runs.db", [log])
    with closing(sqlite3.connect(tmp_path / "runs.db")) as connection:
        rows = connection.execute('SELECT runid, time, "best_cost" FROM progress ORDER BY runid, time').fetchall()
        durations = dict(connection.execute('SELECT id, "trajectory_duration" FROM runs').fetchall())
    assert {runid for runid, _, _ in rows} == set(durations)
    for runid, duration in durations.items():
        costs = [cost for run, _, cost in rows if run == runid]
        assert len(costs) > 1
        assert costs == sorted(costs, reverse=True)
        assert costs[-1] == pytest.approx(duration, abs=1e-6)
