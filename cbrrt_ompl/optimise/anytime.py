"""Guesses without end: what an anytime planner tries after the first plan."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.motion.kinematics import wrap_angle
from cbrrt_ompl.optimise.guess import Guess, guess_from_trajectory
from cbrrt_ompl.optimise.guesses import AHEAD, BACKWARDS, geodesic, guess_along
from cbrrt_ompl.planners.registry import law_of, scenario_for
from cbrrt_ompl.planners.search import Search, search_in
from cbrrt_ompl.problem.robot import Footprint
from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.trajectory.trajectory import Trajectory

ROBUST = "cb-rrt-robust"
"""The planner of first and further plans."""

SAMPLES = 20_000
"""Samples of each further plan, at most."""

ROUNDS = 4
"""Further plans, and further ways around obstacles, that are tried."""


def robust_search(scenario: Scenario, seed: int) -> Search:
    """A search by CB-RRT as it suits real maps."""
    scenario = scenario_for(ROBUST, scenario)
    return search_in(scenario, law_of(ROBUST, scenario.planning), seed, robust=True)


def further_guesses(scenario: Scenario, search: Search, seed: int, has_ended: Callable[[], bool]) -> Iterator[Guess]:
    """Guesses after the first plan and the geodesic: by turns other ways, the plan of the mirrored robot, other seeds.

    Args:
        scenario: what to plan.
        search: that made the first plan.
        seed: of that.
        has_ended: whether to stop a search.
    """
    paths = [path for path in [geodesic(scenario)] if path is not None]
    limits, behind = scenario.robot.limits, None
    reverses = limits.v_min < 0.0
    for number in range(1, ROUNDS + 1):
        if paths:
            path = geodesic(scenario, avoid=paths)
            if path is not None:
                paths.append(path)
                yield guess_along(path, scenario, AHEAD, f"way {number} ahead")
                if reverses:
                    yield guess_along(path, scenario, BACKWARDS, f"way {number} backwards")
        if reverses:
            behind = robust_search(mirrored(scenario), seed + number) if behind is None else behind.again(seed + number)
            trajectory = _plan(behind, has_ended)
            if trajectory is not None:
                yield guess_from_trajectory(_turned_round(trajectory), limits, f"mirrored plan {number}")
        search = search.again(seed + number)
        trajectory = _plan(search, has_ended)
        if trajectory is not None:
            yield guess_from_trajectory(trajectory, limits, f"plan {number}")


def mirrored(scenario: Scenario) -> Scenario:
    """The same problem for the robot seen from behind: its back is its front, so that CB-RRT drives backwards."""
    robot, start, goal = scenario.robot, scenario.start, scenario.goal
    limits, footprint = robot.limits, robot.footprint
    if footprint.vertices is not None:
        footprint = Footprint.polygon(-footprint.vertices)
    return replace(
        scenario,
        robot=replace(robot, footprint=footprint, limits=limits._replace(v_min=-limits.v_max, v_max=-limits.v_min)),
        start=start._replace(theta=wrap_angle(start.theta + math.pi), v=-start.v),
        goal=goal if goal.theta is None else replace(goal, theta=wrap_angle(goal.theta + math.pi)),
    )


def _turned_round(trajectory: Trajectory) -> Trajectory:
    """The trajectory of a mirrored robot as that of the robot itself."""
    theta: NDArray[np.float64] = trajectory.theta + math.pi
    return replace(trajectory, theta=theta, v=-trajectory.v, v_command=-trajectory.v_command)


def _plan(search: Search, has_ended: Callable[[], bool]) -> Trajectory | None:
    """A plan of CB-RRT, if a few samples make one."""
    search.run(lambda _: has_ended(), SAMPLES)
    return search.trajectory() if search.has_reached_goal else None
