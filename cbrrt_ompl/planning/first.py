"""The first plan: from a scenario to what its planner finds."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np

from cbrrt_ompl.collision.free_poses import nearest_free_pose
from cbrrt_ompl.motion.model import ROOM, make_model
from cbrrt_ompl.planners.first_plan import FirstPlan
from cbrrt_ompl.planners.registry import PLANNERS, is_compiled, law_of
from cbrrt_ompl.planners.search import search_in
from cbrrt_ompl.planning.result import SOLVED, PlanResult, given, result_of
from cbrrt_ompl.planning.watch import Watch
from cbrrt_ompl.problem.robot import Footprint
from cbrrt_ompl.problem.settings import Goal
from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.trajectory.replay import trajectory_from_controls
from cbrrt_ompl.trajectory.tree import Tree


def first_plan(scenario: Scenario, planner: str, seed: int | None, watch: Watch) -> PlanResult:
    """What a planner finds first."""
    if is_compiled(planner):
        found = _plan_compiled(scenario, planner, seed, watch)
    else:
        from cbrrt_ompl.ompl_plugin.run import run  # here, so that the compiled planners need no OMPL

        found = run(scenario, planner, seed, watch.start, watch.should_stop)
    return result_of(found, planner, seed, watch.ended_by)


def _plan_compiled(scenario: Scenario, planner: str, seed: int | None, watch: Watch) -> FirstPlan:
    """Plan with the compiled loop, without OMPL."""
    row = PLANNERS[planner]
    search = search_in(scenario, row.law(scenario.planning), seed, robust=row.is_robust)
    watch.start()
    search.run(watch.should_stop, scenario.planning.filled().max_samples)
    return search.first_plan(watch.elapsed())


def already_there(scenario: Scenario, planner: str, seed: int | None) -> PlanResult:
    """The plan of a robot that starts in its goal region: stay."""
    model = make_model(law_of(planner, scenario.planning), scenario.robot, scenario.goal, scenario.planning)
    start = np.array([scenario.start], dtype=float)
    stay = trajectory_from_controls(start[0], np.empty((0, 3)), np.empty(0, dtype=np.int64), model)
    tree = Tree(start, np.array([-1]), np.empty((0, 2)))
    found = FirstPlan(stay, partial(given, 1), 0, 0.0, partial(given, tree))
    return result_of(found, planner, seed, SOLVED)


def approachable_goal(scenario: Scenario) -> Goal:
    """The goal region of a final approach: where the robot does not fit its centre, a part about the nearest free pose.

    Every state in it is in the goal region of the scenario.
    """
    goal, robot, room = scenario.goal, scenario.robot, max(scenario.planning.clearance, ROOM) + 1e-3
    centre = (goal.x, goal.y, 0.0 if goal.theta is None else goal.theta)
    if scenario.world.clearance(robot.footprint, centre) > room:
        return goal
    most = 0.5 * goal.heading_tolerance if goal.theta is not None else math.pi
    turns = (0.0, 0.5 * most, -0.5 * most, most, -most)
    reach = 0.9 * goal.tolerance
    around = Footprint.disc(robot.footprint.circumscribed_radius)  # with room to turn on the spot, if there is
    found = nearest_free_pose(scenario.world, around, centre, reach, room=room)
    found = found or nearest_free_pose(scenario.world, robot.footprint, centre, reach, turns, room)
    if found is None:
        return goal
    x, y, theta = found
    left = goal.tolerance - math.hypot(x - goal.x, y - goal.y)
    if goal.theta is None:
        return replace(goal, x=x, y=y, tolerance=left)
    return replace(
        goal, x=x, y=y, tolerance=left, theta=theta, heading_tolerance=goal.heading_tolerance - abs(theta - goal.theta)
    )


def seed_or_fresh(seed: int | None) -> int:
    """A seed, or a fresh one where none is given."""
    return int(np.random.default_rng().integers(2**31)) if seed is None else seed
