"""Trajectories: states and commands over time, as planned, saved and loaded."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cbrrt_ompl.checks import is_number
from cbrrt_ompl.errors import MISSING, Problem, TrajectoryError
from cbrrt_ompl.files import as_path, refusal, write_file
from cbrrt_ompl.problem.settings import MAX_STEPS
from cbrrt_ompl.shown import Shown
from cbrrt_ompl.trajectory.columns import COLUMNS, column, column_problems
from cbrrt_ompl.trajectory.displacement import displacement, wrapped
from cbrrt_ompl.trajectory.formats import FORMATS
from cbrrt_ompl.trajectory.resampling import resample

if TYPE_CHECKING:
    from cbrrt_ompl.problem.robot import Limits
    from cbrrt_ompl.scenario.scenario import Scenario

EXPORTERS = {
    ".mcap": "cbrrt_ompl.export.ros_bag.write_bag",
    ".yaml": "cbrrt_ompl.export.path_yaml.write_path",
    ".yml": "cbrrt_ompl.export.path_yaml.write_path",
}
"""What writes other formats, by the suffix; by name, since the wing of exports lies above this one."""

STANDING_SPEED = 1e-6
"""Forward velocities below this are standing still [m/s]."""

SMALLEST_POINT_TURN = math.radians(1.0)
"""Turns on the spot up to this are none [rad]."""


class PointTurn(NamedTuple):
    """A stretch in which the robot turns on the spot."""

    start: float
    """Time at which it stands [s]."""
    end: float
    """Time at which it moves on [s]."""
    x: float
    """Position [m]."""
    y: float
    """Position [m]."""
    angle: float
    """Heading at the end minus that at the start, counted through full turns [rad]."""


@dataclass(frozen=True, eq=False)
class Trajectory(Shown):
    """States and commands over time.

    Row k is the state at ``t[k]``; its command acts from ``t[k]`` to ``t[k + 1]``; the last row repeats the command
    before it. Between the rows, v and omega are linear in time. Where ``kinematic`` is set (S-RRT), they jump instead:
    from ``t[k]`` to ``t[k + 1]`` they are the command of row k, and row k + 1 still holds it.

    The arrays are copied and read-only, each of shape (n,) with n >= 1.

    Raises:
        TrajectoryError: with every array that is not finite, not one-dimensional or of another length than ``t``,
            or if ``t`` does not increase strictly.
    """

    t: NDArray[np.float64]
    """Times [s]."""
    x: NDArray[np.float64]
    """Positions [m]."""
    y: NDArray[np.float64]
    """Positions [m]."""
    theta: NDArray[np.float64]
    """Headings [rad]; planners wrap them to [-pi, pi)."""
    v: NDArray[np.float64]
    """Forward velocities [m/s]."""
    omega: NDArray[np.float64]
    """Turning rates [rad/s]."""
    v_command: NDArray[np.float64]
    """Commanded forward velocities [m/s]."""
    omega_command: NDArray[np.float64]
    """Commanded turning rates [rad/s]."""
    kinematic: bool = field(default=False, kw_only=True)
    """Whether the velocities jump to their commands."""
    limits: Limits | None = field(default=None, kw_only=True)
    """Limits of the robot that it was planned for, if they are known; no part of its equality or of its files."""

    def __post_init__(self) -> None:
        """Check, copy and freeze the arrays."""
        arrays = {name: column(name, getattr(self, name)) for name in COLUMNS}
        problems = column_problems(arrays, lambda name, row: f"{name}[{row}]")
        if problems:
            raise TrajectoryError(problems)
        if not isinstance(self.kinematic, bool | np.bool_):
            raise TrajectoryError(Problem("kinematic", self.kinematic, "True or False"))
        for name, array in arrays.items():
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        object.__setattr__(self, "kinematic", bool(self.kinematic))

    def __repr__(self) -> str:
        """Duration, length and rows."""
        kind = ", kinematic" if self.kinematic else ""
        return f"Trajectory({self.duration:.2f} s, {self.length:.2f} m, {len(self):,} rows{kind})"

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.t)

    def __eq__(self, other: object) -> bool:
        """Equal where all arrays are, number for number, and the model is the same."""
        if not isinstance(other, Trajectory):
            return NotImplemented
        same = (np.array_equal(getattr(self, name), getattr(other, name)) for name in COLUMNS)
        return self.kinematic == other.kinematic and all(same)

    @property
    def duration(self) -> float:
        """Time from the first to the last row [s]."""
        return float(self.t[-1] - self.t[0])

    @property
    def ends_at_rest(self) -> bool:
        """Whether the robot stands still at the end."""
        return float(self.v[-1]) == 0.0 == float(self.omega[-1])

    @property
    def length(self) -> float:
        """Way driven, backwards and forwards alike: the integral of the speed [m]."""
        v0, v1 = self.step_velocities[:2]
        area = np.abs(0.5 * v0 + 0.5 * v1)  # no sum, square or product of velocities, which may overflow
        crosses = np.sign(v0) * np.sign(v1) < 0.0
        before, after = 0.5 * np.abs(v0[crosses]), 0.5 * np.abs(v1[crosses])
        area[crosses] = before * (before / (before + after)) + after * (after / (before + after))
        return float(np.sum(area * np.diff(self.t)))

    @property
    def poses(self) -> NDArray[np.float64]:
        """Rows of (x, y, theta), shape (n, 3) [m, m, rad]."""
        return np.column_stack([self.x, self.y, self.theta])

    @property
    def states(self) -> NDArray[np.float64]:
        """Rows of (x, y, theta, v, omega), shape (n, 5) [m, m, rad, m/s, rad/s]."""
        return np.column_stack([self.x, self.y, self.theta, self.v, self.omega])

    @property
    def step_velocities(self) -> NDArray[np.float64]:
        """Velocities at both ends of each step: v, v at the end, omega, omega at the end, shape (4, n - 1)."""
        if self.kinematic:
            v, omega = self.v_command[:-1], self.omega_command[:-1]
            return np.array([v, v, omega, omega])
        return np.array([self.v[:-1], self.v[1:], self.omega[:-1], self.omega[1:]])

    @property
    def point_turns(self) -> list[PointTurn]:
        """Longest stretches of standing still in which the heading turns through more than a degree."""
        v0, v1 = self.step_velocities[:2]
        standing = (np.abs(v0) < STANDING_SPEED) & (np.abs(v1) < STANDING_SPEED)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], standing, [False]])))
        turned = wrapped(np.diff(self.theta))
        return [
            PointTurn(*(float(value) for value in (self.t[a], self.t[b], self.x[a], self.y[a], turned[a:b].sum())))
            for a, b in edges.reshape(-1, 2)
            if np.abs(turned[a:b]).sum() > SMALLEST_POINT_TURN
        ]

    def at(self, times: ArrayLike) -> NDArray[np.float64]:
        """States at any times, by the trajectory's own model from the row before.

        Args:
            times: times from ``t[0]`` to ``t[-1]``, shape (m,) or a number [s]; later ones too where the robot is at
                rest by then, which it stays.

        Returns:
            Rows of (x, y, theta, v, omega), shape (m, 5) [m, m, rad, m/s, rad/s]; the stored rows at their times.

        Raises:
            TrajectoryError: if a time is no number, or outside the trajectory.
        """
        asked = column("times", [times] if is_number(times) else times)
        outside = ~((asked >= self.t[0]) & (asked <= (math.inf if self.ends_at_rest else self.t[-1])))
        if outside.any():
            expected = f"times from {self.t[0]:g} to {self.t[-1]:g} s"
            if not self.ends_at_rest:
                expected += f", where the robot still moves: stopping_at({self.t[-1]:g}) brakes it"
            raise TrajectoryError(Problem("times", float(asked[outside][0]), expected))
        asked = np.minimum(asked, self.t[-1])
        row = np.searchsorted(self.t, asked, side="right") - 1
        states = self.states[row]  # (m, 5)
        between = asked > self.t[row]
        row = row[between]
        elapsed = asked[between] - self.t[row]
        v0, v1, w0, w1 = self.step_velocities[:, row]
        fraction = elapsed / (self.t[row + 1] - self.t[row])
        v, omega = v0 + (v1 - v0) * fraction, w0 + (w1 - w0) * fraction
        poses = self.poses[row] + displacement(self.theta[row], v0, v, w0, omega, elapsed)
        states[between] = np.column_stack([poses[:, :2], wrapped(poses[:, 2]), v, omega])
        return states

    def resampled(self, hz: float, limits: Limits | None = None) -> Trajectory:
        """The same motion with rows at a fixed rate, for a controller that runs at that rate.

        Where the rate has a row at every row of this trajectory, the motion is the very same. Else velocities that ramp
        from row to row at the new rate follow it within the limits, closely (see
        :mod:`cbrrt_ompl.trajectory.resampling`), and the poses are those that they lead to.

        Args:
            hz: rows a second [Hz].
            limits: limits of the robot; those of the trajectory if not given; without any, nothing bounds velocities.

        Returns:
            Rows at ``t[0]``, ``t[0] + 1 / hz`` and so on; the last step is shorter where the robot still moves at the
            end, and none is where it comes to rest.

        Raises:
            TrajectoryError: if the rate is no number above 0, or makes more than a million rows.
        """
        return resample(self, hz, self.limits if limits is None else limits)

    def stopping_at(self, t: float, limits: Limits | None = None, step: float | None = None) -> Trajectory:
        """Drive on until a time and then brake to rest: v and omega at once, each under its full deceleration.

        Braking begins at the first row at or after the time. A kinematic trajectory stands after one more step.

        Args:
            t: time from ``t[0]`` to ``t[-1]`` [s].
            limits: limits of the robot; those of the trajectory if not given.
            step: integration step while braking [s]; that of the trajectory at this row if not given.

        Returns:
            The rows up to there and those of the braking, which ends with v = omega = 0; nothing is added to a row
            that is at rest already.

        Raises:
            TrajectoryError: if the time is outside the trajectory, the limits or the step are neither given nor known,
                or no robot has such limits or comes to rest in `MAX_STEPS` steps.
        """
        if not self.t[0] <= t <= self.t[-1]:
            raise TrajectoryError(Problem("t", t, f"a time from {self.t[0]:g} to {self.t[-1]:g} s"))
        row = int(np.searchsorted(self.t, t))
        at_rest = self.v[row] == 0.0 and self.omega[row] == 0.0
        limits = self.limits if limits is None else limits
        step = self._step_at(row) if step is None else step
        problems = [] if limits is None else limits.problems()
        if limits is None and not (self.kinematic or at_rest):
            problems.append(Problem("limits", MISSING, "the limits of the robot: the trajectory has none of its own"))
        if not at_rest and not (math.isfinite(step) and step > 0.0):
            problems.append(Problem("step", MISSING if math.isnan(step) else step, "an integration step above 0 [s]"))
        if problems:
            raise TrajectoryError(problems)
        states = self.states[row : row + 1] if at_rest else self._braking(row, limits, step)  # (m + 1, 5)
        commands = np.column_stack([self.v_command, self.omega_command])[: row + 1]
        commands[row] = commands[row - 1] if at_rest and row > 0 else 0.0
        times = self.t[row] + step * np.arange(1, len(states))
        return Trajectory(
            np.concatenate([self.t[: row + 1], times]),
            *np.concatenate([self.states[:row], states]).T,
            *np.concatenate([commands, np.zeros((len(times), 2))]).T,
            kinematic=self.kinematic,
            limits=limits,
        )

    def _step_at(self, row: int) -> float:
        """Duration of the step after a row, or before the last one [s]; NaN where there is only one row."""
        return float(np.diff(self.t)[min(row, len(self) - 2)]) if len(self) > 1 else math.nan

    def _braking(self, row: int, limits: Limits | None, step: float) -> NDArray[np.float64]:
        """States of the braking from a row on, shape (m + 1, 5)."""
        from cbrrt_ompl.motion.kinematics import brake  # here, since files are read and verified without any kernel

        if self.kinematic:
            return np.array([self.states[row], [*self.poses[row], 0.0, 0.0]])
        assert limits is not None
        x, y, theta, v, omega = self.states[row].tolist()
        states = brake(x, y, theta, v, omega, limits, step, MAX_STEPS)
        if len(states) > MAX_STEPS:
            expected = f"a step in which {MAX_STEPS} of them bring the robot to rest"
            raise TrajectoryError(Problem("step", step, expected))
        return np.asarray(states)

    def save(self, path: str | os.PathLike[str], scenario: Scenario | None = None) -> None:
        """Write a file in the format of its suffix; an existing one stays whole until the new one is.

        CSV, NPZ and JSON hold the trajectory number for number. MCAP is a bag of ROS 2 (see
        :func:`cbrrt_ompl.export.ros_bag.write_bag`; it needs the extra ``ros``), YAML a nav_msgs/Path.

        Args:
            path: the file, ``.csv``, ``.npz``, ``.json``, ``.mcap`` or ``.yaml``; CSV has no room for ``kinematic``.
            scenario: whose map and footprint go into a bag.

        Raises:
            TrajectoryError: if the suffix is another one or the file cannot be written.
        """
        path = as_path(path, TrajectoryError)
        exporter = EXPORTERS.get(path.suffix.lower())
        if exporter is not None:
            module, _, function = exporter.rpartition(".")
            getattr(import_module(module), function)(self, path, scenario)
            return
        suffix = _known_suffix(path, (*sorted(FORMATS), *EXPORTERS))
        columns = {name: getattr(self, name) for name in COLUMNS}
        write_file(path, FORMATS[suffix].encode(columns, self.kinematic), TrajectoryError)

    @classmethod
    def load(cls, path: str | os.PathLike[str], kinematic: bool = False) -> Trajectory:
        """Read a file that :meth:`save` wrote.

        Args:
            path: a CSV, NPZ or JSON file, by its suffix.
            kinematic: the model of a CSV file, which has no room for it; the other formats know it themselves.

        Returns:
            The trajectory, number for number.

        Raises:
            TrajectoryError: if the file is missing, has another suffix or holds no trajectory.
        """
        path = as_path(path, TrajectoryError)
        decode = FORMATS[_known_suffix(path, sorted(FORMATS))].decode
        try:
            content = path.read_bytes()
        except (OSError, ValueError) as error:
            raise TrajectoryError(Problem("", refusal(error), "a trajectory file"), str(path)) from None
        try:
            return cls(**{"kinematic": kinematic, **decode(content)})
        except TrajectoryError as error:
            raise TrajectoryError(error.problems, str(path)) from error


def _known_suffix(path: Path, known: Iterable[str]) -> str:
    """The suffix of a file of one of the `FORMATS`, in lower case.

    Args:
        path: the file.
        known: what messages name.

    Raises:
        TrajectoryError: if no format has it.
    """
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        raise TrajectoryError(Problem("suffix", path.suffix, f"one of {', '.join(known)}"), str(path))
    return suffix
