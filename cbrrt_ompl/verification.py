"""Verification of trajectories, by code that shares nothing with the planners.

The velocities are computed again from the commands and the limits, the poses from the velocities by an integrator of
SciPy's, the collisions by FCL; the planners' kernels and the clearance map have no part in it. A motion is proven free
between the states that FCL is asked about: whatever moves by less than its clearance touches nothing.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from cbrrt_ompl.errors import Problem, SettingsError, TrajectoryError
from cbrrt_ompl.sections import is_number
from cbrrt_ompl.settings import State
from cbrrt_ompl.trajectory import Trajectory, displacement, wrapped

if TYPE_CHECKING:
    from cbrrt_ompl.robot import Limits
    from cbrrt_ompl.scenario import Scenario
    from cbrrt_ompl.world import CollisionChecker

START_TOLERANCE = 1e-6
"""Largest deviation of the first row from the scenario's start, in each value [m, rad, m/s, rad/s]."""

RESOLUTION = 1e-4
"""Intervals in which no point of the footprint moves more than this need no proof: their ends are to be free [m]."""

PROVEN_SHARE = 0.95
"""The bound on the clearance is pursued until it is this share of the smallest clearance found."""

MAX_CHECKS = 200_000
"""States of a motion that FCL is asked about at most: some seconds."""

LONGEST_TURN = 2.0 * math.pi
"""Largest turn from one row to the next that can be checked [rad]: a stored heading says nothing of full turns."""

LONGEST_WAY = 1e6
"""Largest way from one row to the next that can be checked [m]."""

RELATIVE_ERROR, ABSOLUTE_ERROR = 1e-10, 1e-12
"""What SciPy's integrator keeps its error below, relative and absolute [m, rad]."""

KINEMATIC_HINT = (
    "the velocities jump exactly to their commands, as those of a kinematic planner (s-rrt) do: "
    "its trajectories are to be verified as kinematic (cbrrt verify --kinematic, Trajectory.load(path, kinematic=True))"
)

_SLACK = 1e-9
"""Relative excess over a limit that is rounding."""


@dataclass(frozen=True)
class Violation:
    """One condition that a trajectory breaks, once or for a while."""

    kind: str
    """What is broken: ``start``, ``goal``, ``velocity``, ``command``, ``acceleration``, ``wheel speed``, ``wheel
    acceleration``, ``motion``, ``collision`` or ``sampling``."""
    time: float
    """When it is broken first [s]."""
    message: str
    """What was found there and what was expected, in one line."""
    count: int = 1
    """How many rows, steps or states break it."""
    last_time: float = math.nan
    """When it is broken last [s]."""


@dataclass(frozen=True)
class Verification:
    """What :func:`verify` found."""

    violations: tuple[Violation, ...]
    """Every broken condition, in the order of the checks."""
    smallest_clearance: float
    """Smallest distance of the footprint from obstacles and walls that was found, by FCL [m]."""
    smallest_clearance_time: float
    """When it was found [s]."""
    smallest_clearance_pose: tuple[float, float, float]
    """Where it was found: (x, y, theta), [m, m, rad]."""
    clearance_bound: float
    """What the clearance is proven not to fall below at any time [m]: 0 or less where a stretch is not proven free."""
    resolution: float
    """Intervals in which no point of the footprint moves more than this were accepted for their free ends [m]."""
    unproven: int
    """How many intervals were accepted for their free ends alone."""
    tolerance: float
    """Largest deviation from the motion computed again that was accepted [m, rad, m/s, rad/s]."""
    kinematic: bool
    """Whether the velocities were allowed to jump."""
    rows: int
    """Rows of the trajectory."""
    duration: float
    """Duration of the trajectory [s]."""
    checks: int
    """States that FCL was asked about."""
    hint: str = ""
    """What may have gone wrong in the use of the trajectory; empty where nothing comes to mind."""

    @property
    def ok(self) -> bool:
        """Whether nothing was violated."""
        return not self.violations

    def summary(self) -> str:
        """What was checked, to which tolerance, and what failed where and when, a line each."""
        count = len(self.violations)
        verdict = "valid" if self.ok else f"NOT VALID, {count} violation{'s' if count > 1 else ''}"
        accelerations = (
            "accelerations not checked: the trajectory is kinematic, its velocities may jump"
            if self.kinematic
            else "velocities, commands and accelerations within the limits"
        )
        lines = [
            f"trajectory of {self.rows} rows, {self.duration:g} s: {verdict}",
            *(f"  {violation.message}" for violation in self.violations),
            *([f"  hint: {self.hint}"] if self.hint else []),
            "checked:",
            f"  first row at the start to {START_TOLERANCE:g}; last row in the goal region",
            *(["  velocities and commands within the limits"] if self.kinematic else []),
            f"  {accelerations}",
            f"  motion integrated again from the commands, to {self.tolerance:g} (m, rad, m/s, rad/s) at every row",
            "  no collision of the motion, stored and integrated again, at any time: by the clearance that FCL finds",
            f"  at {self.checks} states and the way between them; "
            f"intervals of at most {self.resolution:g} m accepted for their free ends: {self.unproven}",
            f"smallest clearance: {self.smallest_clearance:.4g} m at t = {self.smallest_clearance_time:.6g} s, "
            f"at {_place(self.smallest_clearance_pose)}; proven not to fall below {self.clearance_bound:.4g} m",
        ]
        return "\n".join(lines)


def verify(
    trajectory: Trajectory, scenario: Scenario, *, tolerance: float = 1e-3, resolution: float = RESOLUTION
) -> Verification:
    """Check a trajectory against everything that its scenario asks for.

    From the first row on, the motion is computed again from the commands and the limits: the velocities ramp towards
    the command at the limits of acceleration (kinematic: jump to it), and SciPy integrates heading and position. Every
    row has to agree with that; start, goal and limits are checked besides.

    Both motions, stored and computed again, have to be free of collision at any time. FCL's clearances at two times
    prove all between them, if together they exceed a bound on the way of any point of the footprint; else the interval
    is halved, until no point moves more than ``resolution`` in it.

    Args:
        trajectory: what is to be checked.
        scenario: world, robot, start and goal.
        tolerance: largest deviation of a row from the motion computed again: of the position [m], the heading [rad],
            v [m/s] and omega [rad/s].
        resolution: way of any point of the footprint down to which an interval is proven [m]; a shorter one is accepted
            if its ends are free.

    Returns:
        The violations found, and the smallest clearance.

    Raises:
        ScenarioError: if this is no scenario.
        TrajectoryError: if this is no trajectory.
        SettingsError: if the tolerance or the resolution is no number above 0.
    """
    from cbrrt_ompl.scenario import check_scenario

    check_scenario(scenario)
    if not isinstance(trajectory, Trajectory):
        raise TrajectoryError(Problem("trajectory", trajectory, "a value of type Trajectory"))
    for name, value in (("tolerance", tolerance), ("resolution", resolution)):
        if not (is_number(value) and value > 0.0):
            raise SettingsError(Problem(name, value, "a number above 0"))
    footprint = scenario.robot.footprint
    checker = scenario.world.checker(footprint)
    reach = 0.0 if footprint.is_round else footprint.circumscribed_radius
    limits = scenario.robot.limits
    with np.errstate(all="ignore"):  # absurd numbers overflow, and are reported as violations
        velocities = _velocities_again(trajectory, limits)
        states = _integrate_again(trajectory, velocities)
        accelerations = [] if trajectory.kinematic else list(_acceleration_violations(trajectory, limits))
        if limits.has_wheel_limits and not trajectory.kinematic:
            accelerations += _wheel_acceleration_violations(trajectory, limits)
        motions = {
            "stored motion": _Motion.through(trajectory.t, trajectory.poses, trajectory.step_velocities, reach),
            "motion computed again": _Motion.through(trajectory.t, states[:, :3], velocities, reach),
        }
        sweeps = {name: _sweep(motion, checker, resolution) for name, motion in motions.items()}
        violations = (
            *_start_violations(trajectory, scenario),
            *_limit_violations(trajectory, limits),
            *_wheel_speed_violations(trajectory, limits),
            *accelerations,
            *_motion_violations(trajectory, states, tolerance),
            *_collision_violations(sweeps),
            *_sampling_violations(trajectory, motions.values(), sweeps.values()),
            *_goal_violations(trajectory, scenario),
        )
    nearest = min(sweeps.values(), key=lambda sweep: sweep.smallest_margin)
    return Verification(
        violations=violations,
        smallest_clearance=checker.clearance(*nearest.pose),
        smallest_clearance_time=nearest.time,
        smallest_clearance_pose=nearest.pose,
        clearance_bound=min(sweep.bound for sweep in sweeps.values()),
        resolution=resolution,
        unproven=sum(sweep.unproven for sweep in sweeps.values()),
        tolerance=tolerance,
        kinematic=trajectory.kinematic,
        rows=len(trajectory),
        duration=trajectory.duration,
        checks=sum(sweep.checks for sweep in sweeps.values()),
        hint=KINEMATIC_HINT if accelerations and _jumps_to_commands(trajectory) else "",
    )


def _velocities_again(trajectory: Trajectory, limits: Limits) -> NDArray[np.float64]:
    """The velocities that follow from the first row, the commands and the limits.

    Returns:
        v, v at the end, omega, omega at the end of each step, shape (4, n - 1) [m/s, rad/s].
    """
    steps = np.diff(trajectory.t)
    if limits.has_wheel_limits and not trajectory.kinematic:
        v, omega = _ramp_together(trajectory, limits)
        return np.array([v[:-1], v[1:], omega[:-1], omega[1:]])
    rows: list[NDArray[np.float64]] = []
    for start, commands, most in (
        (trajectory.v[0], trajectory.v_command[:-1], limits.acceleration * steps),
        (trajectory.omega[0], trajectory.omega_command[:-1], limits.angular_acceleration * steps),
    ):
        if trajectory.kinematic:
            rows += [commands, commands]
        else:
            ends = _ramp(start, commands, most)
            rows += [np.concatenate([[start], ends])[:-1], ends]
    return np.array(rows)


def _ramp(start: float, commands: NDArray[np.float64], most: NDArray[np.float64]) -> NDArray[np.float64]:
    """Velocity at the end of each step, which approaches the command by ``most`` at most, shape (n - 1,)."""
    value, ends = float(start), []
    for command, change in zip(commands.tolist(), most.tolist(), strict=True):
        value += min(max(command - value, -change), change)
        ends.append(value)
    return np.array(ends)


def _ramp_together(trajectory: Trajectory, limits: Limits) -> NDArray[np.float64]:
    """Both velocities at the rows where wheels limit the robot, shape (2, n).

    They approach the command along the straight line between them, as far as v, omega and either wheel get in a step.
    """
    velocity = np.array([trajectory.v[0], trajectory.omega[0]])
    ends = [velocity]
    rates = np.array([limits.acceleration, limits.angular_acceleration, *2 * (limits.wheel_acceleration,)])
    commands = np.column_stack([trajectory.v_command, trajectory.omega_command])
    for command, step in zip(commands[:-1], np.diff(trajectory.t), strict=True):
        change = command - velocity
        duration = np.abs([*change, *_wheel_speeds(change[0], change[1], limits)]) / rates
        velocity = command if duration.max() <= step else velocity + change * (step / duration.max())
        ends.append(velocity)
    return np.transpose(ends)


def _wheel_speeds(v: ArrayLike, omega: ArrayLike, limits: Limits) -> tuple[Any, Any]:
    """Speeds of the left and the right wheel over the ground [m/s]."""
    turn = np.multiply(omega, 0.5 * limits.wheel_separation)
    return np.subtract(v, turn), np.add(v, turn)


def _checkable(velocities: NDArray[np.float64], steps: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether each step is short enough to be integrated and checked, shape (n - 1,)."""
    v0, v1, w0, w1 = np.abs(velocities)
    return (np.maximum(v0, v1) * steps <= LONGEST_WAY) & (np.maximum(w0, w1) * steps <= LONGEST_TURN)


def _integrate_again(trajectory: Trajectory, velocities: NDArray[np.float64]) -> NDArray[np.float64]:
    """States at the rows of the motion that follows from its first pose and the velocities.

    Within a step the velocities are linear in time, so that the right-hand side is smooth. All steps are integrated at
    once, each in the frame of its own beginning, and then put end to end.

    Args:
        trajectory: start and times.
        velocities: see :func:`_velocities_again`; steps that are not checkable are left out.

    Returns:
        Rows of (x, y, theta, v, omega), the heading not wrapped, shape (n, 5).
    """
    steps = np.diff(trajectory.t)
    count = len(steps)
    v0, v1, w0, w1 = np.where(_checkable(velocities, steps), velocities, 0.0)

    def rates(share: float, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        heading = pose[2 * count :]
        way = steps * (v0 + (v1 - v0) * share)
        return np.concatenate([way * np.cos(heading), way * np.sin(heading), steps * (w0 + (w1 - w0) * share)])

    begin = np.zeros(3 * count)
    found = solve_ivp(rates, (0.0, 1.0), begin, "DOP853", (1.0,), rtol=RELATIVE_ERROR, atol=ABSOLUTE_ERROR)
    dx, dy, turn = found.y.reshape(3, count)
    theta = trajectory.theta[0] + np.concatenate([[0.0], np.cumsum(turn)])
    c, s = np.cos(theta[:-1]), np.sin(theta[:-1])
    x = trajectory.x[0] + np.concatenate([[0.0], np.cumsum(c * dx - s * dy)])
    y = trajectory.y[0] + np.concatenate([[0.0], np.cumsum(s * dx + c * dy)])
    v, omega = (
        np.concatenate([[trajectory.v[0]], velocities[1]]),
        np.concatenate([[trajectory.omega[0]], velocities[3]]),
    )
    return np.column_stack([x, y, theta, v, omega])


@dataclass(frozen=True)
class _Motion:
    """A motion through n poses; places on it are counted in rows, 2.5 is halfway through the step from row 2.

    Each step follows its velocities, linear in time; what they miss the next pose by is added evenly along the step.
    """

    times: NDArray[np.float64]
    """When the robot is at each pose, shape (n,) [s]."""
    poses: NDArray[np.float64]
    """The poses, shape (n, 3) [m, m, rad]."""
    velocities: NDArray[np.float64]
    """v, v at the end, omega, omega at the end of each step, shape (4, n - 1) [m/s, rad/s]."""
    gaps: NDArray[np.float64]
    """What the velocities miss the next pose by, shape (n - 1, 3) [m, m, rad]."""
    gap_ways: NDArray[np.float64]
    """How far that moves a point of the footprint at most, shape (n - 1,) [m]."""
    reach: float
    """Distance from the origin that turning moves the footprint at [m]: 0 where turning makes no difference."""
    ways: NDArray[np.float64]
    """Bound on the way of any point of the footprint up to each pose, shape (n,) [m]."""
    left_out: NDArray[np.bool_]
    """Steps that are too long to be checked, shape (n - 1,)."""

    @classmethod
    def through(
        cls, times: NDArray[np.float64], poses: NDArray[np.float64], velocities: NDArray[np.float64], reach: float
    ) -> _Motion:
        """The motion through poses by the velocities of the steps between them."""
        steps = np.diff(times)
        v0, v1, w0, w1 = velocities
        gaps = np.diff(poses, axis=0) - displacement(poses[:-1, 2], v0, v1, w0, w1, steps)
        gaps[:, 2] = wrapped(gaps[:, 2])
        gap_ways = np.hypot(gaps[:, 0], gaps[:, 1]) + reach * np.abs(gaps[:, 2])
        checkable = _checkable(velocities, steps) & (gap_ways <= LONGEST_WAY)
        velocities = np.where(checkable, velocities, 0.0)
        gaps, gap_ways = np.where(checkable[:, None], gaps, 0.0), np.where(checkable, gap_ways, 0.0)
        v0, v1, w0, w1 = np.abs(velocities)
        ways = 0.5 * steps * (v0 + v1 + reach * (w0 + w1)) + gap_ways
        ways = np.concatenate([[0.0], np.cumsum(ways)])
        return cls(times, poses, velocities, gaps, gap_ways, reach, ways, ~checkable)

    def _split(self, places: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Row before each place, and the share of the step from there that is behind it."""
        rows = np.minimum(places.astype(np.int64), len(self.times) - 2)
        return rows, places - rows

    def times_at(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """When the robot is at each place, shape (m,) [s]."""
        return np.interp(places, np.arange(len(self.times)), self.times)

    def poses_at(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Poses at places, the heading not wrapped, shape (m, 3)."""
        if len(self.times) == 1:
            return np.repeat(self.poses, len(places), axis=0)
        rows, share = self._split(places)
        v0, v1, w0, w1 = self.velocities[:, rows]
        v, omega = v0 + (v1 - v0) * share, w0 + (w1 - w0) * share
        elapsed = share * (self.times[rows + 1] - self.times[rows])
        moved = displacement(self.poses[rows, 2], v0, v, w0, omega, elapsed) + share[:, None] * self.gaps[rows]
        return self.poses[rows] + moved

    def ways_between(self, begin: NDArray[np.float64], end: NDArray[np.float64]) -> NDArray[np.float64]:
        """Bound on the way of any point of the footprint in each interval: whole rows or a part of one step [m].

        The speeds are convex functions of the time within a step, so their mean at two times is not below that between.
        """
        rows, a = self._split(begin)
        b = end - rows
        v0, v1, w0, w1 = self.velocities[:, rows]
        speeds = [
            np.abs(v0 + (v1 - v0) * share) + self.reach * np.abs(w0 + (w1 - w0) * share) for share in (a, b)
        ]  # (2, m)
        steps = self.times[rows + 1] - self.times[rows]
        parts = (b - a) * (0.5 * steps * (speeds[0] + speeds[1]) + self.gap_ways[rows])
        whole = self.ways[end.astype(np.int64)] - self.ways[begin.astype(np.int64)]
        return np.where(end - begin > 1.0, whole, parts)


@dataclass(frozen=True)
class _Sweep:
    """What became of a motion that was swept for collisions."""

    smallest_margin: float
    """Smallest margin found [m]."""
    time: float
    """When [s]."""
    pose: tuple[float, float, float]
    """Where, the heading wrapped [m, m, rad]."""
    bound: float
    """What no margin is below [m]."""
    checks: int
    """States that FCL was asked about."""
    unproven: int
    """Intervals accepted for their free ends alone."""
    hit_times: NDArray[np.float64]
    """When a collision was found, shape (k,) [s]."""
    hit_poses: NDArray[np.float64]
    """Where, shape (k, 3)."""
    given_up_at: float
    """Time from which on the checks did not suffice [s]; infinite where they did."""


def _sweep(motion: _Motion, checker: CollisionChecker, resolution: float) -> _Sweep:
    """Prove a motion free, an interval at a time, or find where it is not.

    An interval between two states with margins a and b, on which no point moves further than s, holds no state with a
    margin below (a + b - s) / 2. Where this proves too little, the interval is halved.

    Args:
        motion: what is to be proven free.
        checker: FCL's answers.
        resolution: way of any point of the footprint at which halving ends [m].
    """

    def margins_at(places: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.array([checker.margin(*pose) for pose in motion.poses_at(places).tolist()])

    ends = np.unique([0.0, len(motion.times) - 1.0])
    asked, found = [ends], [margins_at(ends)]
    begin, end = ends[:-1], ends[1:]
    margin, margin_end = found[0][:-1], found[0][1:]
    smallest, checks, unproven, given_up_at = float(found[0].min()), len(ends), 0, math.inf
    bound = smallest
    while len(begin):
        ways = motion.ways_between(begin, end)
        bounds = 0.5 * (margin + margin_end - ways)
        hits, free = (margin <= 0.0) & (margin_end <= 0.0), (margin > 0.0) & (margin_end > 0.0)
        short = ways <= resolution
        settled = free & (bounds > 0.0) & (bounds >= PROVEN_SHARE * smallest) | short | hits & (end - begin <= 1.0)
        bound = min(bound, float(bounds[settled].min(initial=math.inf)))
        unproven += int(np.count_nonzero(settled & free & (bounds <= 0.0)))
        begin, end, margin, margin_end = (values[~settled] for values in (begin, end, margin, margin_end))
        checks += len(begin)
        if checks > MAX_CHECKS:
            bound, given_up_at = -math.inf, float(motion.times_at(begin).min())
            break
        middle = 0.5 * (begin + end)
        middle = np.where(end - begin > 1.0, np.floor(middle), middle)
        asked.append(middle)
        found.append(margins_at(middle))
        smallest = min(smallest, float(found[-1].min(initial=math.inf)))
        begin, end = np.concatenate([begin, middle]), np.concatenate([middle, end])
        margin, margin_end = np.concatenate([margin, found[-1]]), np.concatenate([found[-1], margin_end])
    places, margins = np.concatenate(asked), np.concatenate(found)
    order = np.argsort(places)
    places, margins = places[order], margins[order]
    nearest, hit = places[[np.argmin(margins)]], places[margins <= 0.0]
    x, y, theta = motion.poses_at(nearest)[0].tolist()
    return _Sweep(
        smallest_margin=smallest,
        time=float(motion.times_at(nearest)[0]),
        pose=(x, y, float(wrapped(theta))),
        bound=-math.inf if motion.left_out.any() else bound,
        checks=len(places),
        unproven=unproven,
        hit_times=motion.times_at(hit),
        hit_poses=motion.poses_at(hit),
        given_up_at=given_up_at,
    )


def _violation(
    kind: str,
    text: str,
    limit: str,
    figures: ArrayLike,
    broken: NDArray[np.bool_],
    times: NDArray[np.float64],
    noun: str,
) -> Iterator[Violation]:
    """The violation of one condition, if there is one.

    Args:
        kind: kind of the violation.
        text: what was found, with ``{}`` for the figure of the first time.
        limit: what was expected.
        figures: the figures found, shape (n,).
        broken: where the condition is broken, shape (n,).
        times: when, shape (n,) [s].
        noun: what is counted.
    """
    where = np.flatnonzero(broken)
    if not len(where):
        return
    found = np.asarray(figures, dtype=float)[where]
    first, last = float(times[where[0]]), float(times[where[-1]])
    message = f"{kind}: {text.format(f'{found[0]:.6g}')} at t = {first:.6g} s, {limit}"
    if len(where) > 1:
        extreme = found[np.argmax(np.abs(found))]
        message += f" ({len(where)} {noun}, until t = {last:.6g} s, worst {extreme:.6g})"
    yield Violation(kind, first, message, len(where), last)


def _start_violations(trajectory: Trajectory, scenario: Scenario) -> Iterator[Violation]:
    """Deviations of the first row from the start."""
    found, start = trajectory.states[0], np.array(scenario.start, dtype=float)
    error = found - start
    error[2] = wrapped(error[2])
    for name, value, wanted, off in zip(State._fields, found, start, error, strict=True):
        if not abs(off) <= START_TOLERANCE:
            t, unit = float(trajectory.t[0]), _UNITS[name]
            message = (
                f"start: {name} = {value:.9g} {unit} at t = {t:.6g} s, expected {wanted:.9g} {unit} "
                f"to {START_TOLERANCE:g}"
            )
            yield Violation("start", t, message, last_time=t)


def _goal_violations(trajectory: Trajectory, scenario: Scenario) -> Iterator[Violation]:
    """What keeps the last row out of the goal region."""
    t = float(trajectory.t[-1])
    for problem in scenario.goal.violations(State(*trajectory.states[-1].tolist())):
        yield Violation("goal", t, f"goal: {problem}, at the end, t = {t:.6g} s", last_time=t)


def _limit_violations(trajectory: Trajectory, limits: Limits) -> Iterator[Violation]:
    """Velocities and commands out of their ranges."""
    ranges = {"v": (limits.v_min, limits.v_max), "omega": (limits.omega_min, limits.omega_max)}
    for kind, suffix in (("velocity", ""), ("command", "_command")):
        for name, (low, high) in ranges.items():
            values = getattr(trajectory, name + suffix)
            slack = _SLACK * max(-low, high)
            broken = ~((values >= low - slack) & (values <= high + slack))
            limit = f"limits {low:.6g} to {high:.6g} {_UNITS[name]}"
            yield from _violation(
                kind, f"{name + suffix} = {{}} {_UNITS[name]}", limit, values, broken, trajectory.t, "rows"
            )


def _acceleration_violations(trajectory: Trajectory, limits: Limits) -> Iterator[Violation]:
    """Velocities that change faster than the limits allow."""
    steps = np.diff(trajectory.t)
    for name, most in (("v", limits.acceleration), ("omega", limits.angular_acceleration)):
        values = getattr(trajectory, name)
        changes = np.diff(values)
        rounding = 4.0 * np.spacing(np.maximum(np.abs(values[1:]), np.abs(values[:-1])))
        rounding += 4.0 * most * np.spacing(np.abs(trajectory.t[1:]))
        broken = ~(np.abs(changes) <= most * steps * (1.0 + _SLACK) + rounding)
        unit = f"{_UNITS[name]}^2"
        yield from _violation(
            "acceleration",
            f"{name} changes by {{}} {unit}",
            f"limit {most:.6g} {unit}",
            changes / steps,
            broken,
            trajectory.t[:-1],
            "steps",
        )


def _wheel_speed_violations(trajectory: Trajectory, limits: Limits) -> Iterator[Violation]:
    """Wheels that are too fast, or would be by the command."""
    for text, v, omega in (
        ("", trajectory.v, trajectory.omega),
        (" by command", trajectory.v_command, trajectory.omega_command),
    ):
        for side, speeds in zip(("left", "right"), _wheel_speeds(v, omega, limits), strict=True):
            broken = ~(np.abs(speeds) <= limits.wheel_speed * (1.0 + _SLACK))
            text_of_side, limit = f"{side} wheel at {{}} m/s{text}", f"limit {limits.wheel_speed:.6g} m/s"
            yield from _violation("wheel speed", text_of_side, limit, speeds, broken, trajectory.t, "rows")


def _wheel_acceleration_violations(trajectory: Trajectory, limits: Limits) -> Iterator[Violation]:
    """Wheels whose speed changes faster than the limit allows."""
    steps, most = np.diff(trajectory.t), limits.wheel_acceleration
    size = np.abs(trajectory.v) + np.abs(trajectory.omega) * limits.wheel_separation
    rounding = 8.0 * np.spacing(np.maximum(size[1:], size[:-1]))
    if math.isfinite(most):
        rounding += 4.0 * most * np.spacing(np.abs(trajectory.t[1:]))
    for side, speeds in zip(("left", "right"), _wheel_speeds(trajectory.v, trajectory.omega, limits), strict=True):
        changes = np.diff(speeds)
        yield from _violation(
            "wheel acceleration",
            f"speed of the {side} wheel changes by {{}} m/s^2",
            f"limit {most:.6g} m/s^2",
            changes / steps,
            ~(np.abs(changes) <= most * steps * (1.0 + _SLACK) + rounding),
            trajectory.t[:-1],
            "steps",
        )


def _motion_violations(trajectory: Trajectory, states: NDArray[np.float64], tolerance: float) -> Iterator[Violation]:
    """Rows that differ from the motion computed again."""
    error = trajectory.states - states  # (n, 5)
    deviations = {
        "position": (np.hypot(error[:, 0], error[:, 1]), "m"),
        "heading": (wrapped(error[:, 2]), "rad"),
        "v": (error[:, 3], "m/s"),
        "omega": (error[:, 4], "rad/s"),
    }
    for name, (off, unit) in deviations.items():
        yield from _violation(
            "motion",
            f"{name} differs by {{}} {unit} from what the commands lead to",
            f"tolerance {tolerance:g} {unit}",
            off,
            ~(np.abs(off) <= tolerance),
            trajectory.t,
            "rows",
        )


def _collision_violations(sweeps: Mapping[str, _Sweep]) -> Iterator[Violation]:
    """Collisions of the motions, by their names."""
    for name, sweep in sweeps.items():
        times = sweep.hit_times
        if not len(times):
            continue
        first, last = float(times[0]), float(times[-1])
        place = _place(sweep.hit_poses[0])
        message = f"collision: the {name} touches an obstacle or a wall at t = {first:.6g} s, at {place}"
        if len(times) > 1:
            message += f" ({len(times)} states, until t = {last:.6g} s)"
        yield Violation("collision", first, message, len(times), last)


def _sampling_violations(
    trajectory: Trajectory, motions: Iterable[_Motion], sweeps: Iterable[_Sweep]
) -> Iterator[Violation]:
    """What could not be checked."""
    where = np.flatnonzero(np.any([motion.left_out for motion in motions], axis=0))
    if len(where):
        first, last = (float(trajectory.t[row]) for row in where[[0, -1]])
        message = (
            f"sampling: the next row is too far away to be checked at t = {first:.6g} s, "
            f"at most {LONGEST_WAY:g} m and {LONGEST_TURN:.6g} rad from row to row"
        )
        if len(where) > 1:
            message += f" ({len(where)} steps, until t = {last:.6g} s)"
        yield Violation("sampling", first, message, len(where), last)
    first = min(sweep.given_up_at for sweep in sweeps)
    if first < math.inf:
        message = f"sampling: {MAX_CHECKS} states do not prove the motion free from t = {first:.6g} s on"
        yield Violation("sampling", first, message, last_time=float(trajectory.t[-1]))


def _place(pose: Sequence[float] | NDArray[np.float64]) -> str:
    """A pose in words."""
    x, y, theta = pose
    return f"({x:.6g} m, {y:.6g} m, {float(wrapped(theta)):.6g} rad)"


def _jumps_to_commands(trajectory: Trajectory) -> bool:
    """Whether every velocity is the command before it."""
    return np.array_equal(trajectory.v[1:], trajectory.v_command[:-1]) and np.array_equal(
        trajectory.omega[1:], trajectory.omega_command[:-1]
    )


_UNITS = {"x": "m", "y": "m", "theta": "rad", "v": "m/s", "omega": "rad/s"}
