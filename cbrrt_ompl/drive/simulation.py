"""Driving at speed through what a sensor shows, one cycle at a time.

At every look the robot is already committed to the cycle that begins and to braking after it, both proven free. While
it drives that cycle, it decides upon the next: a cycle of its plan with the braking after that, if they are free in all
that is known; else the braking that is ready. The sensor reaches farther than all of that, so nothing unknown is in the
way: there is always a way to rest that is proven free, and the robot never leaves it. Where obstacles hide what is
behind them, none of it may lead through space that no look has shown.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from cbrrt_ompl.collision.motion_check import is_free
from cbrrt_ompl.collision.world import World
from cbrrt_ompl.drive.improving import improved
from cbrrt_ompl.drive.knowledge import Knowledge
from cbrrt_ompl.drive.result import IMPROVED, LATE, NO_ROOM, REACHED, STOPPED, UNSAFE, Cycle, DriveResult, Replan
from cbrrt_ompl.drive.settings import DriveSettings, grown, hides_itself, needed_range
from cbrrt_ompl.drive.sight import warm_up as warm_up_sight
from cbrrt_ompl.errors import Problem, ScenarioError, SettingsError
from cbrrt_ompl.planning import plan, warm_up_improvement, warm_up_planner
from cbrrt_ompl.problem.obstacles import Obstacle
from cbrrt_ompl.problem.settings import State
from cbrrt_ompl.scenario.scenario import Scenario
from cbrrt_ompl.trajectory.trajectory import Trajectory

COMPUTING_SHARE = 0.9
"""Share of the time that is left in which a search or an improvement has to end; the rest is for checking its plan."""

SHORTEST_SEARCH = 1e-3
"""Time that every search gets [s]."""


class Drive:
    """A drive, cycle by cycle.

    Attributes:
        scenario: what is driven, in the world as it is known at the start.
        hidden: the obstacles that are not known at the start.
        world: the true world, with the hidden obstacles last.
        settings: how to drive.
        status: ``reached`` or ``stopped``; None while it goes on.
        cycles: what was seen and decided so far.
    """

    def __init__(
        self,
        scenario: Scenario,
        hidden: Sequence[Obstacle] | None = None,
        settings: DriveSettings | None = None,
        seed: int | None = None,
    ) -> None:
        """Place the robot at the start.

        Args:
            scenario: known world, robot, start and goal.
            hidden: obstacles that stand there as well and are unknown until seen; None hides those of the scenario.
            settings: how to drive; the defaults if not given.
            seed: of all plans together; None draws a fresh one.

        Raises:
            SettingsError: if the cycle is not whole planning steps, the sensor does not reach as far as the robot may
                be committed, or there is a line of sight and the footprint hides a part of itself from its origin.
            ScenarioError: if an obstacle is nearer to the start than the margin, or in the way of braking from there.
        """
        self.settings = settings or DriveSettings()
        known = World(scenario.world.bounds) if hidden is None else scenario.world
        self.hidden = tuple(scenario.world.obstacles if hidden is None else hidden)
        self.scenario = replace(scenario, world=known)
        self.world = known.with_more(self.hidden) if hidden else scenario.world
        self._dt, self._cycle_steps = scenario.planning.step, self.settings.steps(scenario.planning)
        needed = _checked_range(scenario, self.settings)
        self._robot = replace(scenario.robot, footprint=grown(scenario.robot.footprint, self.settings.margin))
        self._planning = self.settings.planning(scenario.planning)
        self._knowledge = Knowledge(known, self.hidden, needed if self.settings.line_of_sight else None)
        self._rng = np.random.default_rng(seed)
        self._driven, self._steps_driven = [_at_start(scenario)], 0
        self._last: Trajectory | None = None  # the plan before, from the next look on
        self._plan: Trajectory | None = None  # the rest of it from now on; None while braking
        self._committed = self._driven[0].stopping_at(0.0, self._robot.limits, self._dt)
        self._is_cut_short = False  # whether the plan's improvement was
        self._failures = 0
        self.status = None if scenario.goal.violations(scenario.start) else REACHED
        self.cycles: list[Cycle] = []
        warm_up_planner(self.settings.planner)
        if self.settings.max_iterations > 0:
            warm_up_improvement()
        if self.settings.line_of_sight:
            warm_up_sight()
        if not self._is_free_in(self.world, self._committed):
            expected = f"a state with {self.settings.margin:g} m of room (the margin), on the way to rest as well"
            raise ScenarioError(Problem("start", list(scenario.start), expected))

    @property
    def time(self) -> float:
        """Time driven so far [s]."""
        return self._dt * self._steps_driven

    @property
    def state(self) -> State:
        """Where the robot is."""
        return State(*self._driven[-1].states[-1].tolist())

    def run(self, progress: Callable[[float, float], None] | None = None) -> DriveResult:
        """Drive until the robot is in the goal region or has stopped for good.

        Args:
            progress: called after every cycle with the time driven [s] and the distance from the goal [m].

        Returns:
            The result; a robot that has stopped is a status of it and no error.
        """
        goal = self.scenario.goal
        while self.status is None:
            self.cycle()
            if progress is not None:
                progress(self.time, math.hypot(self.state.x - goal.x, self.state.y - goal.y))
        return DriveResult(
            status=self.status,
            trajectory=replace(_joined(self._driven, self._dt), limits=self._robot.limits),
            braking=_joined([*self._driven, self._committed], self._dt),
            cycles=tuple(self.cycles),
            scenario=self.scenario,
            hidden=self.hidden,
            world=self.world,
            settings=self.settings,
        )

    def cycle(self) -> None:
        """Look, decide what comes after this cycle, and drive it; a robot that stands and has no plan takes longer."""
        stands = len(self._committed) == 1
        is_over = self.time >= self.settings.time_limit
        if stands and (is_over or self._failures == self.settings.tries):
            self.status = STOPPED
            return
        began, looked_at = time.perf_counter(), self.time
        if self._plan is not None:
            self._last = _part(self._plan, self._cycle_steps, None, self._dt)
        seen = self._knowledge.look(*self.state[:2], self.settings.sensor_range)
        portions = 2**self._failures if stands else 1
        steps = portions * self._cycle_steps
        piece = _part(self._committed, 0, steps, self._dt)
        at_goal = self._first_row_at_goal(piece)
        replan = None
        if at_goal is not None:
            piece = _part(piece, 0, at_goal, self._dt)
            self._committed = _part(self._committed, at_goal, None, self._dt)
            self.status = REACHED
        else:
            is_ready, start = not is_over and self._continue_plan(bool(seen)), State(*piece.states[-1].tolist())
            if is_ready and self._is_cut_short:
                replan = self._improve_on(start, looked_at, began)
            elif not is_ready and not is_over:
                replan = self._replan(start, looked_at, portions, began)
                is_ready = replan.trajectory is not None
            if not is_ready:
                self._plan = None
                self._committed = _part(self._committed, steps, None, self._dt)
                self._failures += stands
        self._driven.append(piece)
        self._steps_driven += len(piece) - 1
        elapsed = time.perf_counter() - began
        self.cycles.append(Cycle(looked_at, tuple(seen), replan, elapsed, self._plan is None))

    def _first_row_at_goal(self, piece: Trajectory) -> int | None:
        """The first row of a piece in the goal region."""
        inside = (row for row, state in enumerate(piece.states.tolist()) if not self._goal_violations(state))
        return next(inside, None)

    def _goal_violations(self, state: Sequence[float]) -> list[str]:
        return self.scenario.goal.violations(State(*state))

    def _continue_plan(self, has_seen: bool) -> bool:
        """Commit to the next cycle of the present plan; False where there is none, or none that is safe and free."""
        if self._plan is None:
            return False
        rest = _part(self._plan, self._cycle_steps, None, self._dt)
        if has_seen and not self._is_free(rest):
            return False
        return self._commit(rest)

    def _replan(self, start: State, looked_at: float, portions: int, began: float) -> Replan:
        """Plan from where the robot is to be when the plan is ready, and commit to it if it is safe."""
        settings, limit = self.settings, portions * self.settings.cycle
        seed = int(self._rng.integers(2**31))
        record = partial(Replan, looked_at, start, looked_at + limit)
        scenario = self._scenario_from(start, portions)
        if scenario is None:
            return record(NO_ROOM, 0, 0.0, None)
        result = plan(scenario, settings.planner, seed, self._time_left(limit, began))
        status, found, taken = result.status, result.trajectory, None
        if found is not None and self._is_late(limit, began):
            status = LATE
        elif found is not None:
            taken = found if self._commit(found) else None
            if settings.max_iterations > 0:
                taken = self._improve(found, scenario, limit, began) or taken
            status = UNSAFE if taken is None else status
        shown = None if taken is None else _begun_at(looked_at + limit, taken)
        return record(status, result.samples, result.planning_time, shown)

    def _improve_on(self, start: State, looked_at: float, began: float) -> Replan | None:
        """Make what is left of the plan shorter, where its improvement was cut short; None where that fails."""
        limit, rest = self.settings.cycle, self._plan
        scenario = self._scenario_from(start, 1)
        if scenario is None or rest is None:
            return None
        taken = self._improve(rest, scenario, limit, began)
        if taken is None:
            return None
        ready = looked_at + limit
        return Replan(looked_at, start, ready, IMPROVED, 0, 0.0, _begun_at(ready, taken))

    def _improve(self, found: Trajectory, scenario: Scenario, limit: float, began: float) -> Trajectory | None:
        """Commit to a plan made shorter, with what is left of the plan before as a guess; None where that fails."""
        last = self._last if self._last is not None and len(self._last) > 1 else None
        better, self._is_cut_short = improved(
            found, scenario, self.settings.max_iterations, self._time_left(limit, began), last
        )
        if better is found or not self._is_free(better) or self._is_late(limit, began) or not self._commit(better):
            return None
        return better

    def _scenario_from(self, start: State, portions: int) -> Scenario | None:
        """What to plan for in the world as it is known; None where that covers the start or the goal."""
        knowledge, planning = self._knowledge, self._planning
        if self.settings.max_samples is not None:
            planning = replace(planning, max_samples=portions * self.settings.max_samples)
        if planning.clearance > 0.0:  # from where the robot is nearer to something, it must not get nearer still
            here = knowledge.world.clearance(self._robot.footprint, start[:3])
            planning = replace(planning, clearance=min(planning.clearance, here))
        try:
            return replace(self.scenario, world=knowledge.world, robot=self._robot, start=start, planning=planning)
        except ScenarioError:
            return None

    def _time_left(self, limit: float, began: float) -> float:
        """Time that a search or an improvement may take [s]; infinite where samples and Newton steps limit it."""
        if self.settings.max_samples is not None:
            return math.inf
        return max(COMPUTING_SHARE * (limit - time.perf_counter() + began), SHORTEST_SEARCH)

    def _is_late(self, limit: float, began: float) -> bool:
        """Whether the time is over in which a plan has to be ready."""
        return self.settings.max_samples is None and time.perf_counter() - began > limit

    def _commit(self, rest: Trajectory) -> bool:
        """Follow a plan from the next look on, if its first cycle and the braking after that are free and seen."""
        row = min(self._cycle_steps, len(rest) - 1)
        committed = rest.stopping_at(rest.t[row], self._robot.limits, self._dt)
        if not self._is_free(committed):
            return False
        if not self._knowledge.is_seen(committed.states, self._dt, self._robot.footprint):
            return False
        self._plan, self._committed = rest, committed
        self._failures = 0
        return True

    def _is_free(self, motion: Trajectory) -> bool:
        """Whether a motion is free in all that is known."""
        return self._is_free_in(self._knowledge.world, motion)

    def _is_free_in(self, world: World, motion: Trajectory) -> bool:
        return is_free(motion.states, self._dt, world.scene(self._robot.footprint), is_kinematic=motion.kinematic)


def drive(
    scenario: Scenario,
    hidden: Sequence[Obstacle] | None = None,
    settings: DriveSettings | None = None,
    seed: int | None = None,
    progress: Callable[[float, float], None] | None = None,
) -> DriveResult:
    """Drive to the goal through what a sensor shows, planning again whenever something is in the way.

    Args:
        scenario: known world, robot, start and goal.
        hidden: obstacles that stand there as well and are unknown until seen; None hides those of the scenario.
        settings: how to drive; the defaults if not given.
        seed: of all plans together; None draws a fresh one.
        progress: see :meth:`Drive.run`.

    Returns:
        The result; a robot that has stopped is a status of it and no error.

    Raises:
        SettingsError: see :class:`Drive`.
        ScenarioError: see :class:`Drive`.
    """
    return Drive(scenario, hidden, settings, seed).run(progress)


def _checked_range(scenario: Scenario, settings: DriveSettings) -> float:
    """How far the robot may be committed [m]; refuses a sensor that does not see as far, or not past the robot."""
    needed = needed_range(scenario.robot, settings, scenario.planning.step)
    if not settings.sensor_range > needed:
        expected = f"more than {needed:.4g} m: two cycles at full speed, braking, the robot's size and the margin"
        raise SettingsError(Problem("sensor_range", settings.sensor_range, expected))
    if settings.line_of_sight and hides_itself(scenario.robot.footprint):
        expected = "False for a footprint that hides a part of itself from its origin, where the sensor is"
        raise SettingsError(Problem("line_of_sight", True, expected))
    return needed


def _at_start(scenario: Scenario) -> Trajectory:
    """A trajectory of one row."""
    start = scenario.start
    columns = [np.array([value]) for value in (0.0, *start, start.v, start.omega)]
    return Trajectory(*columns, kinematic=scenario.robot.limits.is_first_order)


def _part(trajectory: Trajectory, first: int, last: int | None, dt: float) -> Trajectory:
    """Some rows of a trajectory, from time 0 on; one that ends at rest goes on standing as long as is asked for."""
    states, commands = trajectory.states, np.column_stack([trajectory.v_command, trajectory.omega_command])
    missing = max(first, last or 0) + 1 - len(trajectory)
    if missing > 0:
        commands[-1] = 0.0
        states = np.concatenate([states, np.repeat(states[-1:], missing, axis=0)])
        commands = np.concatenate([commands, np.zeros((missing, 2))])
    rows = slice(first, None if last is None else last + 1)
    return _from_rows(states[rows], commands[rows], dt, trajectory.kinematic)


def _begun_at(start: float, trajectory: Trajectory) -> Trajectory:
    """A trajectory in the drive's time, which begins at some time [s]."""
    return replace(trajectory, t=trajectory.t + start)


def _joined(pieces: Sequence[Trajectory], dt: float) -> Trajectory:
    """One trajectory of several, each of which begins where the one before ends."""
    states = np.concatenate([pieces[0].states[:1], *(piece.states[1:] for piece in pieces)])
    commands = [np.column_stack([piece.v_command, piece.omega_command])[:-1] for piece in pieces]
    last = pieces[-1]
    commands.append(np.array([[last.v_command[-1], last.omega_command[-1]]]))
    return _from_rows(states, np.concatenate(commands), dt, last.kinematic)


def _from_rows(states: NDArray[np.float64], commands: NDArray[np.float64], dt: float, is_kinematic: bool) -> Trajectory:
    t: NDArray[np.float64] = dt * np.arange(len(states), dtype=np.float64)
    return Trajectory(t, *states.T, *commands.T, kinematic=is_kinematic)
