"""Verification of trajectories, by code that shares nothing with the planners.

The velocities are computed again from the commands and the limits, the poses from the velocities, the collisions by
FCL; the planners' kernels and the clearance map have no part in it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cbrrt_ompl.errors import Problem, SettingsError
from cbrrt_ompl.settings import State
from cbrrt_ompl.trajectory import Trajectory, displacement, wrapped

if TYPE_CHECKING:
    from cbrrt_ompl.robot import Limits
    from cbrrt_ompl.scenario import Scenario

START_TOLERANCE = 1e-6
"""Largest deviation of the first row from the scenario's start, in each value [m, rad, m/s, rad/s]."""

CHECKS_PER_STEP = 4
"""States between two rows, or in a planning step where the rows are farther apart, that FCL is asked about."""

MAX_CHECKS_PER_STEP = 4000
"""States between two rows beyond which the rows are too far apart to be checked."""

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
    """Smallest distance of the footprint from obstacles and walls at the rows, by FCL [m]."""
    smallest_clearance_time: float
    """When it is smallest [s]."""
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
            f"  collisions by FCL at {self.checks} states, stored and integrated again, {CHECKS_PER_STEP} a step",
            f"smallest clearance: {self.smallest_clearance:.4g} m at t = {self.smallest_clearance_time:.6g} s",
        ]
        return "\n".join(lines)


def verify(trajectory: Trajectory, scenario: Scenario, *, tolerance: float = 1e-3) -> Verification:
    """Check a trajectory against everything that its scenario asks for.

    From the first row on, the motion is computed again from the commands and the limits: the velocities ramp towards
    the command at the limits of acceleration (kinematic: jump to it), heading and position follow in closed form and
    by quadrature. Every row has to agree with that; start, goal, limits and collisions are checked besides.

    Args:
        trajectory: what is to be checked.
        scenario: world, robot, start and goal.
        tolerance: largest deviation of a row from the motion computed again: of the position [m], the heading [rad],
            v [m/s] and omega [rad/s].

    Returns:
        The violations found, and the smallest clearance.

    Raises:
        SettingsError: if the tolerance is no number above 0.
    """
    if not (math.isfinite(tolerance) and tolerance > 0.0):
        raise SettingsError(Problem("tolerance", tolerance, "a number above 0"))
    limits = scenario.robot.limits
    with np.errstate(all="ignore"):  # absurd numbers overflow, and are reported as violations
        grid = _Grid.of(trajectory, scenario.planning.step)
        again = _integrate_again(trajectory, limits, grid)
        accelerations = [] if trajectory.kinematic else list(_acceleration_violations(trajectory, limits))
        if limits.has_wheel_limits and not trajectory.kinematic:
            accelerations += _wheel_acceleration_violations(trajectory, limits)
        collisions, checks = _collisions(trajectory, again, scenario, grid)
        violations = (
            *_start_violations(trajectory, scenario),
            *_limit_violations(trajectory, limits),
            *_wheel_speed_violations(trajectory, limits),
            *accelerations,
            *_motion_violations(trajectory, again, tolerance),
            *collisions,
            *_goal_violations(trajectory, scenario),
        )
    checker = scenario.world.checker(scenario.robot.footprint)
    clearances = [checker.clearance(*pose) for pose in trajectory.poses.tolist()]
    nearest = int(np.argmin(clearances))
    return Verification(
        violations=violations,
        smallest_clearance=clearances[nearest],
        smallest_clearance_time=float(trajectory.t[nearest]),
        tolerance=tolerance,
        kinematic=trajectory.kinematic,
        rows=len(trajectory),
        duration=trajectory.duration,
        checks=checks,
        hint=KINEMATIC_HINT if accelerations and _jumps_to_commands(trajectory) else "",
    )


@dataclass(frozen=True)
class _Grid:
    """Parts into which the steps between the rows are cut, m in all."""

    row: NDArray[np.int64]
    """Row before each part, shape (m,)."""
    begin: NDArray[np.float64]
    """Where each part begins, as a share of its step, shape (m,)."""
    end: NDArray[np.float64]
    """Where each part ends, as a share of its step, shape (m,)."""
    last: NDArray[np.int64]
    """Last part of each step, shape (n - 1,)."""
    times: NDArray[np.float64]
    """When each part ends, shape (m,) [s]."""
    too_long: NDArray[np.int64]
    """Steps that would need more than MAX_CHECKS_PER_STEP parts."""

    @classmethod
    def of(cls, trajectory: Trajectory, planning_step: float) -> _Grid:
        """Cut every step into four, and steps that are longer than the planning step into more."""
        steps = np.diff(trajectory.t)
        wanted = CHECKS_PER_STEP * np.ceil(steps / planning_step * (1.0 - 1e-6))
        parts = np.clip(wanted, CHECKS_PER_STEP, MAX_CHECKS_PER_STEP).astype(np.int64)
        row = np.repeat(np.arange(len(steps)), parts)
        last = np.cumsum(parts) - 1
        part = np.arange(len(row)) - (last - parts + 1)[row]
        end = (part + 1) / parts[row]
        times = trajectory.t[:-1][row] + steps[row] * end
        return cls(row, part / parts[row], end, last, times, np.flatnonzero(wanted > MAX_CHECKS_PER_STEP))


@dataclass(frozen=True)
class _Motion:
    """A motion computed again."""

    states: NDArray[np.float64]
    """States at the rows, the heading not wrapped, shape (n, 5)."""
    poses: NDArray[np.float64]
    """Poses at the ends of the grid's parts, shape (m, 3)."""


def _integrate_again(trajectory: Trajectory, limits: Limits, grid: _Grid) -> _Motion:
    """The motion that follows from the first row, the commands and the limits."""
    steps = np.diff(trajectory.t)
    columns = []
    for start, commands, most in (
        (trajectory.v[0], trajectory.v_command[:-1], limits.acceleration * steps),
        (trajectory.omega[0], trajectory.omega_command[:-1], limits.angular_acceleration * steps),
    ):
        ends = commands if trajectory.kinematic else _ramp(start, commands, most)
        columns.append(np.concatenate([[start], ends]))
    v, omega = columns
    if limits.has_wheel_limits and not trajectory.kinematic:
        v, omega = _ramp_together(trajectory, limits)
    v0, w0 = (v[1:], omega[1:]) if trajectory.kinematic else (v[:-1], omega[:-1])
    velocities = np.array([v0, v[1:], w0, omega[1:]])  # (4, n - 1)
    theta = trajectory.theta[0] + np.concatenate([[0.0], np.cumsum(0.5 * (w0 + omega[1:]) * steps)])
    offsets = _offsets(theta[:-1], velocities, steps, grid)  # (m, 3)
    x, y = (
        start + np.concatenate([[0.0], np.cumsum(offsets[grid.last, axis])])
        for axis, start in enumerate((trajectory.x[0], trajectory.y[0]))
    )
    states = np.column_stack([x, y, theta, v, omega])
    return _Motion(states, states[grid.row, :3] + offsets)


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


def _offsets(
    theta: NDArray[np.float64], velocities: NDArray[np.float64], steps: NDArray[np.float64], grid: _Grid
) -> NDArray[np.float64]:
    """Change of pose from the beginning of its step to the end of each part, shape (m, 3).

    Args:
        theta: heading at the beginning of each step, shape (n - 1,) [rad].
        velocities: v, v at the end, omega, omega at the end of each step, shape (4, n - 1) [m/s, rad/s].
        steps: durations, shape (n - 1,) [s].
        grid: the parts.
    """
    v0, v1, w0, w1 = velocities[:, grid.row]
    dt, a, b = steps[grid.row], grid.begin, grid.end
    heading = theta[grid.row] + dt * a * (w0 + 0.5 * (w1 - w0) * a)
    v_a, v_b, w_a, w_b = (x0 + (x1 - x0) * share for x0, x1 in ((v0, v1), (w0, w1)) for share in (a, b))
    total = np.cumsum(displacement(heading, v_a, v_b, w_a, w_b, dt * (b - a)), axis=0)
    before = np.concatenate([np.zeros((1, 3)), total[grid.last]])[:-1]  # (n - 1, 3)
    return total - before[grid.row]


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


def _motion_violations(trajectory: Trajectory, again: _Motion, tolerance: float) -> Iterator[Violation]:
    """Rows that differ from the motion computed again."""
    error = trajectory.states - again.states  # (n, 5)
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


def _collisions(trajectory: Trajectory, again: _Motion, scenario: Scenario, grid: _Grid) -> tuple[list[Violation], int]:
    """Collisions of the stored motion and of the one computed again, and the number of states asked about."""
    offsets = _offsets(trajectory.theta[:-1], trajectory.step_velocities, np.diff(trajectory.t), grid)
    stored = np.concatenate([trajectory.poses, trajectory.poses[grid.row] + offsets])
    stored_times = np.concatenate([trajectory.t, grid.times])
    integrated = np.concatenate([again.states[:1, :3], again.poses])
    integrated_times = np.concatenate([trajectory.t[:1], grid.times])
    collides = scenario.world.checker(scenario.robot.footprint).collides
    found: list[Violation] = []
    for text, poses, times in (
        ("stored motion", stored, stored_times),
        ("motion computed again", integrated, integrated_times),
    ):
        order = np.argsort(times, kind="stable")
        poses, times = poses[order], times[order]
        hits = np.array([collides(*pose) for pose in poses.tolist()])
        if hits.any():
            found.append(_collision(text, poses[hits], times[hits]))
    for row in grid.too_long[:1]:
        step, t = trajectory.t[row + 1] - trajectory.t[row], float(trajectory.t[row])
        most = MAX_CHECKS_PER_STEP // CHECKS_PER_STEP * scenario.planning.step
        message = f"sampling: the next row is {step:.6g} s away at t = {t:.6g} s, at most {most:.6g} s can be checked"
        found.append(Violation("sampling", t, message, len(grid.too_long), float(trajectory.t[grid.too_long[-1]])))
    return found, len(stored) + len(integrated)


def _collision(text: str, poses: NDArray[np.float64], times: NDArray[np.float64]) -> Violation:
    """The violation for the states of a motion that collide."""
    x, y, theta = poses[0]
    first, last = float(times[0]), float(times[-1])
    message = (
        f"collision: the {text} touches an obstacle or a wall at t = {first:.6g} s, "
        f"at ({x:.6g} m, {y:.6g} m, {float(wrapped(theta)):.6g} rad)"
    )
    if len(times) > 1:
        message += f" ({len(times)} states, until t = {last:.6g} s)"
    return Violation("collision", first, message, len(times), last)


def _jumps_to_commands(trajectory: Trajectory) -> bool:
    """Whether every velocity is the command before it."""
    return np.array_equal(trajectory.v[1:], trajectory.v_command[:-1]) and np.array_equal(
        trajectory.omega[1:], trajectory.omega_command[:-1]
    )


_UNITS = {"x": "m", "y": "m", "theta": "rad", "v": "m/s", "omega": "rad/s"}
