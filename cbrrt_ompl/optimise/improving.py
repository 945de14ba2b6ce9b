"""improve: from a trajectory that can be driven to one that is near the best there is."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from functools import cache
from numbers import Integral
from typing import NamedTuple

import numpy as np

from cbrrt_ompl.checks import is_number
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.errors import Problem, SettingsError, TrajectoryError
from cbrrt_ompl.optimise.clearance import clearances
from cbrrt_ompl.optimise.guess import Guess, guess_from_trajectory, refined
from cbrrt_ompl.optimise.guesses import AHEAD, BACKWARDS, geodesic, guess_along
from cbrrt_ompl.optimise.lattice_plan import STATE_LATTICE, full_speed_guess, lattice_plan
from cbrrt_ompl.optimise.lead import begun_later, joined, lead_rows, split_at
from cbrrt_ompl.optimise.objective import Objective
from cbrrt_ompl.optimise.program import STEP
from cbrrt_ompl.optimise.repair import solve_and_repair
from cbrrt_ompl.optimise.transcription import Transcription
from cbrrt_ompl.problem.obstacles import Bounds, Box
from cbrrt_ompl.problem.settings import Goal, State
from cbrrt_ompl.scenario.scenario import Scenario, check_scenario
from cbrrt_ompl.trajectory.displacement import wrapped
from cbrrt_ompl.trajectory.trajectory import Trajectory

TIME_LIMIT = 1.0
"""Time that :func:`improve` takes at most where nothing else is asked for [s]."""

ITERATIONS_A_GUESS = 400
"""Newton steps that one guess is worth, its repairs included."""

ROUGH, FINE = 1e-4, 1e-6
"""Last barrier parameters: of a first solution, and of the best one's refinement."""

START_TOLERANCE = 1e-6
"""Deviation from the scenario's start with which a trajectory still begins there [m, rad, m/s, rad/s]."""

LEAST_GAIN = 1e-9
"""Cost by which a trajectory must be better to take the place of another [s]."""


class Found(NamedTuple):
    """A row of the history of an improvement."""

    time: float
    """Since the beginning [s]."""
    duration: float
    """Of the best trajectory from then on [s]."""
    source: str
    """What it was made of."""


def improve(
    trajectory: Trajectory,
    scenario: Scenario,
    time_limit: float | None = None,
    max_iterations: int | None = None,
    *,
    objective: Objective | None = None,
    callback: Callable[[Found], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> Trajectory:
    """Make a trajectory shorter, by optimal control.

    The given trajectory, and the shortest path on the distance field driven ahead and backwards, are guesses for a
    solver; what comes of them is rolled out exactly and checked as the planners check their motions. The best is
    returned, or what was given where nothing is better: it keeps all limits, the clearance and the goal region.

    Args:
        trajectory: from the scenario's start into its goal region, of any planner. A kinematic one, whose velocities
            jump (S-RRT, robots of first order), is improved as such: accelerations have no limit, and the velocities
            keep theirs.
        scenario: world, robot, start, goal and settings.
        time_limit: time to stop after, without that of compilation [s]; 1 s where nothing else is asked for.
        max_iterations: Newton steps to stop after: the result is then the same on every run, unless the time ends it.
        objective: what to optimise; the duration if not given.
        callback: called with each improvement.
        should_stop: asked every few milliseconds whether to stop with the best so far.

    Returns:
        A trajectory whose cost is at most that of the given one; its rows are at most an integration step apart.

    Raises:
        ScenarioError: if this is no scenario.
        TrajectoryError: if this is no trajectory, or one that does not lead from the start to the goal.
        SettingsError: if a limit or the objective make no sense.
    """
    check_scenario(scenario)
    check_improvement(time_limit, max_iterations, objective, callback, should_stop)
    objective = Objective() if objective is None else objective
    _check_trajectory(trajectory, scenario)
    if time_limit is None:
        time_limit = TIME_LIMIT if max_iterations is None else math.inf
    warm_up()
    improver = Improver(
        scenario, objective, time_limit, max_iterations, callback, should_stop, is_kinematic=trajectory.kinematic
    )
    improver.improve(trajectory, "given")
    assert improver.best is not None
    return improver.best


class Improver:
    """Tries guesses, one after the other, and keeps the best trajectory.

    Attributes:
        best: the best trajectory so far; None where there is none yet.
        history: when which guess led to it.
        iterations: Newton steps so far.
    """

    def __init__(
        self,
        scenario: Scenario,
        objective: Objective,
        time_limit: float = math.inf,
        max_iterations: int | None = None,
        callback: Callable[[Found], None] | None = None,
        should_stop: Callable[[], bool] | None = None,
        *,
        is_kinematic: bool = False,
    ) -> None:
        """Begin to count the time.

        Args:
            scenario: world, robot, start and goal.
            objective: what to optimise.
            time_limit: time to stop after [s].
            max_iterations: Newton steps to stop after.
            callback: called with each row of the history.
            should_stop: asked every few milliseconds whether to stop.
            is_kinematic: whether the velocities jump, as those of a robot of first order always do.
        """
        self.begin(time_limit, time.perf_counter())
        self._scenario, self._objective = scenario, objective
        is_kinematic = is_kinematic or scenario.robot.limits.is_first_order
        self._transcription = Transcription(scenario, objective, is_kinematic=is_kinematic)
        self._lead: Trajectory | None = None
        self._max_iterations = max_iterations
        self._callback, self._should_stop = callback, should_stop
        self._best_guess: Guess | None = None
        self._best_cost = math.inf
        self.best: Trajectory | None = None
        self.history: list[Found] = []
        self.iterations = 0

    def begin(self, time_limit: float, began: float) -> None:
        """Stop after a time from now on [s]; the history counts from another one, by `time.perf_counter` [s]."""
        self._began, self._deadline = began, time.perf_counter() + time_limit

    def improve(self, trajectory: Trajectory, source: str, others: list[Guess] | None = None) -> None:
        """Adopt a trajectory that passed all checks, and try it and others as guesses, the geodesics if not given.

        What comes before the robot has the room that a motion needs is kept as it is.
        """
        if self.best is None:
            row = lead_rows(trajectory, self._scenario, self._transcription.margin)
            if row > 0:
                others = None  # those begin at the start
                self._lead, trajectory = split_at(trajectory, row)
                self._scenario = begun_later(self._scenario, self._lead)
                self._transcription = Transcription(
                    self._scenario, self._objective, is_kinematic=self._transcription.is_kinematic
                )
        self.adopt(trajectory, source)
        if trajectory.duration > 0.0 and not self.has_ended():
            guess = guess_from_trajectory(trajectory, self._scenario.robot.limits, f"{source}, optimised")
            guesses = [guess, *(geodesic_guesses(self._scenario) if others is None else others)]
            self.run(guesses, self._guesses_from_lattice if source != STATE_LATTICE else None)

    def run(self, guesses: list[Guess], more: Callable[[], list[Guess]] | None = None) -> None:
        """Try guesses, the shortest first, and then refine the best of what came of them.

        Where nothing came of any, further ones are asked for, and then all are tried again in twice as many intervals.
        """
        self._try_all(guesses)
        if self._best_guess is None and more is not None and not self.has_ended():
            further = more()
            self._try_all(further)
            guesses = guesses + further
        if self._best_guess is None:
            self._try_all([refined(guess, is_kinematic=False) for guess in guesses])
        self.refine()

    def _try_all(self, guesses: list[Guess]) -> None:
        """Try guesses, the shortest first."""
        for guess in sorted(guesses, key=lambda guess: guess.duration):
            self.try_guess(guess)

    def _guesses_from_lattice(self) -> list[Guess]:
        """Guesses made of the plan over the state lattice, which is kept where it is better than the best."""
        found = lattice_plan(self._scenario, self.has_ended, is_kinematic=self._transcription.is_kinematic)
        if found is None:
            return []
        self.adopt(found, STATE_LATTICE)
        limits = self._scenario.robot.limits
        return [
            full_speed_guess(found, limits),
            guess_from_trajectory(found, limits, f"{STATE_LATTICE}, optimised"),
        ]

    def explore(self, guesses: Iterator[Guess]) -> None:
        """Try one guess after the other, and refine at once what is better than the best."""
        for guess in guesses:
            if self.try_guess(guess):
                self.refine()
            if self.has_ended():
                return

    def adopt(self, trajectory: Trajectory, source: str, guess: Guess | None = None) -> bool:
        """Keep a trajectory that passed all checks, where it is better than the best; says whether it is.

        It begins where the lead ends, if there is one.
        """
        cost = self._objective.cost(trajectory, self._scenario)
        if not cost < self._best_cost - LEAST_GAIN:
            return False
        self.best = trajectory if self._lead is None else joined(self._lead, trajectory)
        self._best_cost, self._best_guess = cost, guess
        self.history.append(Found(self.elapsed(), self.best.duration, source))
        if self._callback is not None:
            self._callback(self.history[-1])
        return True

    def try_guess(self, guess: Guess, last_barrier: float = ROUGH) -> bool:
        """Solve for a guess and keep what comes of it, where it is better than the best; says whether it is."""
        if self.has_ended():
            return False
        before = self.iterations
        if self._lead is not None:
            guess.states[0, :STEP] = self._scenario.start

        def may_iterate(done: int) -> int:
            self.iterations = before + done
            return 0 if self.has_ended() else min(ITERATIONS_A_GUESS - done, self._left())

        found = solve_and_repair(self._transcription, guess, last_barrier, may_iterate, most_cost=self._best_cost)
        return found is not None and self.adopt(found.trajectory, guess.source, found.guess)

    def refine(self) -> bool:
        """Solve for the best with twice as many intervals and more precisely."""
        if self._best_guess is None:
            return False
        guess = refined(self._best_guess, is_kinematic=self._transcription.is_kinematic)
        return self.try_guess(guess._replace(source=f"{guess.source}, refined"), FINE)

    def elapsed(self) -> float:
        """Time since the beginning [s]."""
        return time.perf_counter() - self._began

    def has_ended(self) -> bool:
        """Whether time or Newton steps are used up, or the caller wants to stop."""
        if self._left() <= 0 or time.perf_counter() >= self._deadline:
            return True
        return self._should_stop is not None and bool(self._should_stop())

    def _left(self) -> int:
        """Newton steps that are left."""
        return ITERATIONS_A_GUESS if self._max_iterations is None else self._max_iterations - self.iterations


def geodesic_guesses(scenario: Scenario) -> list[Guess]:
    """The shortest path on the distance field, driven ahead and, where the robot can, backwards."""
    path = geodesic(scenario)
    if path is None:
        return []
    gears = {AHEAD: "geodesic ahead"}
    if scenario.robot.limits.v_min < 0.0:
        gears[BACKWARDS] = "geodesic backwards"
    return [guess_along(path, scenario, gear, source) for gear, source in gears.items()]


@cache
def warm_up() -> None:
    """Load or compile all kernels of this wing, before a clock runs."""
    world = World(Bounds((0.0, 0.0), (2.0, 2.0)), [Box((0.0, 1.5), (0.2, 2.0)), Box((1.8, 1.5), (2.0, 2.0))])
    scenario = Scenario(name="warm up", world=world, start=State(0.5, 0.5), goal=Goal(1.5, 0.5, tolerance=0.1))
    Improver(scenario, Objective(room=0.1), max_iterations=40).run(geodesic_guesses(scenario))
    clearances(np.array([scenario.start]), scenario)
    lattice_plan(scenario, lambda: False)


def _check_trajectory(trajectory: object, scenario: Scenario) -> None:
    """Refuse what cannot be improved."""
    if not isinstance(trajectory, Trajectory):
        raise TrajectoryError(Problem("trajectory", trajectory, "a value of type Trajectory"))
    problems = []
    error = trajectory.states[0] - scenario.start
    error[2] = wrapped(error[2])
    if not (abs(error) <= START_TOLERANCE).all():
        problems.append(Problem("trajectory", trajectory.states[0].tolist(), f"the start {list(scenario.start)} first"))
    for violation in scenario.goal.violations(State(*trajectory.states[-1].tolist())):
        problems.append(Problem("trajectory", violation, "an end in the goal region"))
    if problems:
        raise TrajectoryError(problems)


def check_improvement(
    time_limit: object,
    max_iterations: object,
    objective: object,
    callback: object,
    should_stop: object,
    name: str = "time_limit",
) -> None:
    """Refuse what no improvement can start with; the time limit goes by some name."""
    problems = []
    is_infinite = isinstance(time_limit, float) and time_limit == math.inf
    if time_limit is not None and not (is_infinite or (is_number(time_limit) and time_limit > 0.0)):
        problems.append(Problem(name, time_limit, "a number above 0 [s], or None"))
    if max_iterations is not None and not (
        is_number(max_iterations) and isinstance(max_iterations, Integral) and max_iterations >= 0
    ):
        problems.append(Problem("max_iterations", max_iterations, "a whole number of 0 or more, or None"))
    if not isinstance(objective, Objective | None):
        problems.append(Problem("objective", objective, "a value of type Objective, or None"))
    for argument, value in (("callback", callback), ("should_stop", should_stop)):
        if value is not None and not callable(value):
            problems.append(Problem(argument, value, "something to call, or None"))
    if problems:
        raise SettingsError(problems)
