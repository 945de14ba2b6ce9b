"""plan: from a scenario to a drivable trajectory, the only place that assembles the parts."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from numbers import Integral
from typing import Any, NamedTuple, TypeVar

import numpy as np

from cbrrt_ompl.checks import is_number
from cbrrt_ompl.collision.free_poses import nearest_free_pose
from cbrrt_ompl.errors import Problem, SettingsError
from cbrrt_ompl.kernels.beside import compiled_beside
from cbrrt_ompl.motion.model import ROOM, check_step, jumps, make_model
from cbrrt_ompl.ompl_plugin.availability import check_ompl, has_ompl
from cbrrt_ompl.optimise.anytime import further_guesses, robust_search
from cbrrt_ompl.optimise.guess import Guess
from cbrrt_ompl.optimise.improving import Found, Improver, check_improvement, geodesic_guesses
from cbrrt_ompl.optimise.improving import warm_up as warm_up_improvement
from cbrrt_ompl.optimise.interior_point import iterate
from cbrrt_ompl.optimise.lattice_plan import STATE_LATTICE, full_speed_guess, lattice_plan
from cbrrt_ompl.optimise.objective import Objective
from cbrrt_ompl.planners.bounded import BoundedTrees
from cbrrt_ompl.planners.first_plan import FirstPlan
from cbrrt_ompl.planners.registry import PLANNERS, is_compiled, law_of, planner_named, scenario_for
from cbrrt_ompl.planners.search import search_in
from cbrrt_ompl.planners.warm_up import warm_up
from cbrrt_ompl.problem.robot import Footprint
from cbrrt_ompl.problem.settings import Goal
from cbrrt_ompl.scenario.connectivity import has_no_way
from cbrrt_ompl.scenario.scenario import Scenario, check_scenario
from cbrrt_ompl.shown import Shown
from cbrrt_ompl.trajectory.replay import trajectory_from_controls
from cbrrt_ompl.trajectory.trajectory import Trajectory
from cbrrt_ompl.trajectory.tree import Tree

FIRST_SAMPLES = 5_000
"""Samples after which an anytime planner looks for another first plan than that of CB-RRT."""

FEW_NODES = 10_000
"""Nodes of a search over the lattice after which an anytime planner looks along the geodesics, and then goes on."""

ANYTIME_ITERATIONS = 3000
"""Newton steps after which an anytime planner ends where neither they nor the time are given."""

BOUNDED_SAMPLES = 50_000
"""Samples after the first plan after which a bounded planner ends where neither they nor the time are given."""

SOLVED, TIME_LIMIT, SAMPLE_LIMIT, NO_WAY = "solved", "time limit", "sample limit", "no way"
"""How a plan ends."""

PATIENCE = 0.5
"""Planning time after which a plan looks for a proof that there is no way, where as much again is left for it [s]."""

PROGRESS_PERIOD = 0.1
"""Time between two reports of progress [s]."""

T = TypeVar("T")

Progress = Callable[[int, float], None]
"""Takes the samples so far and the time since the start [s]."""


@dataclass(frozen=True, eq=False)
class PlanResult(Shown):
    """The result of a plan."""

    planner: str
    """The planner's name."""
    seed: int | None
    """The seed that was asked for."""
    status: str
    """``solved``, ``time limit``, ``sample limit``, or ``no way`` where that is proven."""
    trajectory: Trajectory | None
    """From the start into the goal region; None where not solved."""
    count_nodes: Callable[[], int] = field(repr=False)
    """Counts the nodes in the planner's memory."""
    samples: int
    """Samples drawn; for OMPL's own planners the rounds of their main loop."""
    planning_time: float
    """Time of the search and the improvement alone, without set-up and compilation [s]."""
    make_tree: Callable[[], Tree] = field(repr=False)
    """Makes the tree out of the planner's memory."""
    history: tuple[Found, ...] = ()
    """When which trajectory was found, each better than the one before: rows of (time [s], duration [s], source)."""
    scenario: Scenario | None = None
    """What it was planned for; None where nobody said."""

    def __repr__(self) -> str:
        """Planner, status, what it took, and the trajectory."""
        found = "" if self.trajectory is None else f", {self.trajectory!r}"
        took = f"{self.samples:,} samples, {1e3 * self.planning_time:.2f} ms"
        return f"PlanResult({self.planner}, {self.status}, {took}{found})"

    @property
    def solved(self) -> bool:
        """Whether there is a trajectory into the goal region."""
        return self.status == SOLVED

    @cached_property
    def nodes(self) -> int:
        """Nodes of the tree; counted when first asked for, since OMPL copies a tree to count it."""
        return self.count_nodes()

    @cached_property
    def tree(self) -> Tree:
        """All nodes and edges; made when first asked for."""
        return self.make_tree()

    def __getstate__(self) -> dict[str, Any]:
        """What is pickled: the tree itself and its size instead of the planner's memory."""
        kept = {"make_tree": partial(_given, self.tree), "count_nodes": partial(_given, self.nodes)}
        return {**self.__dict__, **kept}


def plan(
    scenario: Scenario,
    planner: str = "cb-rrt",
    seed: int | None = None,
    time_limit: float = 5.0,
    progress: Progress | None = None,
    *,
    improve_for: float | None = None,
    max_iterations: int | None = None,
    objective: Objective | None = None,
    callback: Callable[[Found], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> PlanResult:
    """Plan a trajectory from the scenario's start into its goal region, and improve it if that is asked for.

    Args:
        scenario: world, robot, start, goal and settings; its ``max_samples`` ends a plan whatever the time limit.
        planner: a name from :data:`cbrrt_ompl.planners.registry.PLANNERS`.
        seed: 0 or more; the same seed gives the same result. None draws a fresh one.
        time_limit: largest planning time [s].
        progress: called about ten times a second with the samples so far and the time since the start [s].
        improve_for: time to improve the first trajectory for, from when it is found [s]; see
            :func:`cbrrt_ompl.improve`. None improves nothing, unless ``max_iterations`` is given.
        max_iterations: Newton steps to improve it for: the result is then the same on every run, unless the time ends
            it. ``cb-rrt-anytime`` ends by them where ``improve_for`` is not given. ``cb-rrt-ao`` improves by samples,
            and this is their number; where neither is given, it ends by 50,000, ``max_samples`` or ``time_limit``.
        objective: what to improve; the duration if not given, and the only one that ``cb-rrt-ao`` takes.
        callback: called with each trajectory's time, duration and source, as they are found.
        should_stop: asked every few milliseconds whether to end the improvement with the best so far.

    Returns:
        The result; "not solved" is a status of it and no error.

    Raises:
        ScenarioError: if this is no scenario.
        UnknownPlannerError: if there is no such planner.
        OmplMissingError: if the planner needs OMPL, and there is none; the planners of this package's own do not.
        SettingsError: if the seed, the time limit, the step or what is said of the improvement make no sense.
        KeyboardInterrupt: on Ctrl-C, at once.
    """
    check_scenario(scenario)
    asked = scenario
    row = planner_named(planner)
    scenario = scenario_for(planner, scenario)
    _check_arguments(seed, time_limit, progress)
    check_improvement(improve_for, max_iterations, objective, callback, should_stop, name="improve_for")
    if row.is_bounded and objective not in (None, Objective()):
        raise SettingsError(Problem("objective", objective, f"None for {planner}, whose cost is the duration"))
    check_step(scenario.robot, scenario.planning)
    warm_up_planner(planner)
    improves = not row.is_bounded and (row.is_anytime or improve_for is not None or max_iterations is not None)
    if improves:
        warm_up_improvement()
    if not scenario.goal.violations(scenario.start):
        return _already_there(scenario, planner, seed)
    if scenario.planning.approaches(scenario.goal):
        scenario = replace(scenario, goal=approachable_goal(scenario))
    is_hopeless = partial(has_no_way, scenario.world, scenario.robot.footprint, scenario.start, scenario.goal)
    watch = _Watch(time_limit, progress, is_hopeless)
    if row.is_bounded:
        limits = _Limits(improve_for, max_iterations, should_stop)
        return replace(_plan_bounded(scenario, planner, seed, watch, limits, callback), scenario=asked)
    if not improves:
        return replace(_first_plan(scenario, planner, seed, watch), scenario=asked)
    if row.is_anytime and improve_for is None and max_iterations is None:
        max_iterations = ANYTIME_ITERATIONS
    improver = Improver(
        scenario,
        Objective() if objective is None else objective,
        math.inf,
        max_iterations,
        callback,
        should_stop,
        is_kinematic=jumps(law_of(planner, scenario.planning), scenario.robot),
    )
    budget = math.inf if improve_for is None else improve_for
    if row.is_anytime:
        return replace(_plan_anytime(scenario, planner, seed, watch, improver, budget), scenario=asked)
    result = _first_plan(scenario, planner, seed, watch)
    if result.trajectory is not None:
        improver.begin(budget, watch.began)
        improver.improve(result.trajectory, planner)
    return replace(_with_best(result, improver), scenario=asked)


def _first_plan(scenario: Scenario, planner: str, seed: int | None, watch: _Watch) -> PlanResult:
    """What a planner finds first."""
    if is_compiled(planner):
        found = _plan_compiled(scenario, planner, seed, watch)
    else:
        from cbrrt_ompl.ompl_plugin.run import run  # here, so that the compiled planners need no OMPL

        found = run(scenario, planner, seed, watch.start, watch.should_stop)
    return _result_of(found, planner, seed, watch.ended_by)


def available_planners() -> list[str]:
    """Names of the planners that can plan here: all of them, or without OMPL the compiled ones."""
    return [name for name in PLANNERS if has_ompl() or is_compiled(name)]


def _plan_anytime(
    scenario: Scenario, planner: str, seed: int | None, watch: _Watch, improver: Improver, budget: float
) -> PlanResult:
    """The first plan of CB-RRT, or where that takes long of the lattice or the geodesic; then guess after guess."""
    first_seed = _seed_or_fresh(seed)
    search, most = robust_search(scenario, first_seed), scenario.planning.filled().max_samples
    watch.start()
    improver.begin(watch.left(), watch.began)
    search.run(watch.should_stop, min(FIRST_SAMPLES, most))
    found, others = None, None
    if not search.has_reached_goal:
        found, others = _without_samples(scenario, improver, lambda: watch.should_stop(search.samples))
        if found is None and improver.best is None:
            search.run(watch.should_stop, most)
    result = _result_of(search.first_plan(watch.elapsed()), planner, seed, watch.ended_by)
    improver.begin(budget, watch.began)
    if search.has_reached_goal:
        improver.improve(search.trajectory(), planner, others)
    elif found is not None:
        improver.improve(found, STATE_LATTICE, others)
    if improver.best is not None:
        improver.explore(further_guesses(scenario, search, first_seed, improver.has_ended))
    return _with_best(result, improver)


def _without_samples(
    scenario: Scenario, improver: Improver, should_stop: Callable[[], bool]
) -> tuple[Trajectory | None, list[Guess]]:
    """A plan over the lattice and the guesses to try beside it; or what the improver makes of the geodesics."""
    limits = scenario.robot.limits
    over_lattice = partial(lattice_plan, scenario, should_stop, is_kinematic=limits.is_first_order)
    if not scenario.robot.footprint.is_round:
        found = over_lattice(most_nodes=FEW_NODES)
        if found is not None:
            return found, [full_speed_guess(found, limits), *geodesic_guesses(scenario)]
    improver.run(geodesic_guesses(scenario))
    found = over_lattice() if improver.best is None else None
    return found, [] if found is None else [full_speed_guess(found, limits)]


def _seed_or_fresh(seed: int | None) -> int:
    """A seed, or a fresh one where none is given."""
    return int(np.random.default_rng().integers(2**31)) if seed is None else seed


class _Limits(NamedTuple):
    """How long to go on after the first plan."""

    improve_for: float | None
    max_iterations: int | None
    should_stop: Callable[[], bool] | None


def _plan_bounded(
    scenario: Scenario,
    planner: str,
    seed: int | None,
    watch: _Watch,
    limits: _Limits,
    callback: Callable[[Found], None] | None,
) -> PlanResult:
    """The first plan, and then those of trees that are bounded by the best."""
    row, most = PLANNERS[planner], scenario.planning.filled().max_samples
    first_seed = _seed_or_fresh(seed)
    search = search_in(scenario, row.law(scenario.planning), first_seed, robust=row.is_robust)
    watch.start()
    search.run(watch.should_stop, most)
    if not search.has_reached_goal:
        return _result_of(search.first_plan(watch.elapsed()), planner, seed, watch.ended_by)
    history = list[Found]()

    def note(source: str) -> None:
        dt = float(search.model["dt"][0])
        history.append(Found(watch.elapsed(), dt * int(trees.best.total_steps[-1]), source))
        if callback is not None:
            callback(history[-1])

    def should_stop(samples: int) -> bool:
        return watch.should_stop(samples) or (limits.should_stop is not None and bool(limits.should_stop()))

    trees = BoundedTrees(search, first_seed)
    note(planner)
    if limits.improve_for is not None:
        watch.go_on(limits.improve_for)
    if limits.max_iterations is not None:
        most_samples: float = search.samples + limits.max_iterations
    else:
        most_samples = min(most, search.samples + BOUNDED_SAMPLES) if limits.improve_for is None else math.inf
    while trees.find_quicker(should_stop, most_samples):
        note(f"tree {trees.trees}")
    found = trees.best.first_plan(watch.elapsed())._replace(samples=trees.samples)
    return replace(_result_of(found, planner, seed, SOLVED), history=tuple(history))


def _with_best(result: PlanResult, improver: Improver) -> PlanResult:
    """A result with the best trajectory of an improver, if it has one."""
    if improver.best is None:
        return result
    return replace(
        result,
        status=SOLVED,
        trajectory=improver.best,
        planning_time=improver.elapsed(),
        history=tuple(improver.history),
    )


def warm_up_planner(planner: str) -> None:
    """Load or compile all kernels that a planner needs, before a clock runs.

    Raises:
        UnknownPlannerError: if there is no such planner.
        OmplMissingError: if it needs OMPL, and there is none.
    """
    if not is_compiled(planner):
        check_ompl(f"planner {planner!r}", "s-rrt-compiled" if planner == "s-rrt" else "cb-rrt-compiled")
    if planner_named(planner).optimises:
        with compiled_beside("cbrrt_ompl.optimise.improving", "warm_up", iterate):
            warm_up()
        warm_up_improvement()
    else:
        warm_up()
    if not is_compiled(planner):
        from cbrrt_ompl.ompl_plugin import warm_up as plugin  # here, so that the compiled planners need no OMPL

        plugin.warm_up()


def _check_arguments(seed: object, time_limit: object, progress: object) -> None:
    """Refuse what no plan can start with."""
    problems = []
    if seed is not None and not (is_number(seed) and isinstance(seed, Integral) and 0 <= seed < 2**32 - 1):
        problems.append(Problem("seed", seed, f"a whole number from 0 to {2**32 - 2}"))
    is_infinite = isinstance(time_limit, float) and time_limit == math.inf
    if not (is_infinite or (is_number(time_limit) and time_limit > 0.0)):
        problems.append(Problem("time_limit", time_limit, "a number above 0 [s]"))
    if progress is not None and not callable(progress):
        problems.append(Problem("progress", progress, "something to call, or None"))
    if problems:
        raise SettingsError(problems)


def _plan_compiled(scenario: Scenario, planner: str, seed: int | None, watch: _Watch) -> FirstPlan:
    """Plan with the compiled loop, without OMPL."""
    row = PLANNERS[planner]
    search = search_in(scenario, row.law(scenario.planning), seed, robust=row.is_robust)
    watch.start()
    search.run(watch.should_stop, scenario.planning.filled().max_samples)
    return search.first_plan(watch.elapsed())


def _result_of(found: FirstPlan, planner: str, seed: int | None, status: str) -> PlanResult:
    """The result of a planner.

    Args:
        found: what it came back with.
        planner: its name.
        seed: that was asked for.
        status: why it ended, if it has no trajectory.
    """
    return PlanResult(planner, seed, status if found.trajectory is None else SOLVED, *found)


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


def _already_there(scenario: Scenario, planner: str, seed: int | None) -> PlanResult:
    """The plan of a robot that starts in its goal region: stay."""
    model = make_model(law_of(planner, scenario.planning), scenario.robot, scenario.goal, scenario.planning)
    start = np.array([scenario.start], dtype=float)
    stay = trajectory_from_controls(start[0], np.empty((0, 3)), np.empty(0, dtype=np.int64), model)
    tree = Tree(start, np.array([-1]), np.empty((0, 2)))
    found = FirstPlan(stay, partial(_given, 1), 0, 0.0, partial(_given, tree))
    return replace(_result_of(found, planner, seed, SOLVED), scenario=scenario)


def _given(value: T) -> T:
    return value


class _Watch:
    """Keeps the time of a search and reports its progress."""

    def __init__(self, time_limit: float, progress: Progress | None, is_hopeless: Callable[[], bool]) -> None:
        self.ended_by = SAMPLE_LIMIT
        self._time_limit, self._progress, self._is_hopeless = time_limit, progress, is_hopeless
        self.began = self._next_report = 0.0
        self._doubts_at = math.inf

    def start(self) -> None:
        """Begin to count the time."""
        self.began = time.perf_counter()
        self._next_report = self.began + PROGRESS_PERIOD
        self._doubts_at = self.began + PATIENCE if self._time_limit >= 2.0 * PATIENCE else math.inf

    def go_on(self, seconds: float) -> None:
        """End so much later than now [s]; there is a way."""
        self._time_limit, self._doubts_at = self.elapsed() + seconds, math.inf

    def left(self) -> float:
        """Time that is left [s]."""
        return self._time_limit - self.elapsed()

    def elapsed(self) -> float:
        """Time since the start [s]."""
        return time.perf_counter() - self.began

    def should_stop(self, samples: int) -> bool:
        """Whether the time is up or there is no way; being Python code, this also lets a Ctrl-C through."""
        if self.ended_by == NO_WAY:
            return True
        now = time.perf_counter()
        if now - self.began >= self._time_limit:
            self.ended_by = TIME_LIMIT
            return True
        if self._progress is not None and now >= self._next_report:
            self._next_report = now + PROGRESS_PERIOD
            self._progress(samples, now - self.began)
        if now >= self._doubts_at:
            self._doubts_at = math.inf
            if self._is_hopeless():
                self.ended_by = NO_WAY
                return True
        return False
