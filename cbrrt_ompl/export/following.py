"""Following a trajectory at a fixed rate: feed-forward from the trajectory, and a law that takes back the error."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cbrrt_ompl.checks import is_number
from cbrrt_ompl.errors import MISSING, Problem, SettingsError, TrajectoryError
from cbrrt_ompl.trajectory.displacement import displacement, wrapped
from cbrrt_ompl.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from cbrrt_ompl.problem.robot import Limits

RATE = 20.0
"""Commands a second [Hz]."""

LONGEST_LAG = 0.2
"""How far the robot may be behind before the trajectory stands still [m]."""

_ROUNDING = 1e-9
"""Times nearer than this are the same [s]."""

SLOWEST = 3.0
"""Multiple of a trajectory's duration after which a simulation ends."""

_SUBSTEPS = 10
"""Steps of the simulation between two commands."""


class Law(Protocol):
    """Makes a command of where the robot is and where it should be."""

    def __call__(self, error: NDArray[np.float64], v: float, omega: float) -> tuple[float, float]:
        """Command (v, omega) [m/s, rad/s].

        Args:
            error: pose of the reference in the robot's frame, shape (3,) [m, m, rad].
            v: forward velocity of the reference [m/s].
            omega: turning rate of the reference [rad/s].
        """


@dataclass(frozen=True)
class KanayamaLaw:
    r"""The law of Kanayama et al. (1990), with a gain on the heading that does not vanish at rest.

    $$v = v_r \cos\theta_e + k_x x_e, \qquad \omega = \omega_r + v_r k_y y_e + k_\theta \sin\theta_e$$

    Note:
        In the original, the last term has the factor $v_r$, so that a robot that turns on the spot is not corrected.
    """

    k_x: float = 1.5
    """Gain on the error ahead [1/s]."""
    k_y: float = 6.0
    """Gain on the error to the left [rad/m^2]."""
    k_theta: float = 2.5
    """Gain on the heading error [1/s]."""

    def __call__(self, error: NDArray[np.float64], v: float, omega: float) -> tuple[float, float]:
        """See :class:`Law`."""
        x, y, theta = error.tolist()
        return v * math.cos(theta) + self.k_x * x, omega + v * self.k_y * y + self.k_theta * math.sin(theta)


class Follower:
    """Commands for a robot that is to follow a trajectory; call :meth:`command` at a fixed rate.

    A trajectory that does not end at rest is braked at its end. Commands keep the ranges, the accelerations and the
    limits of the wheels, starting from the trajectory's first velocities.

    A robot that slips can not catch up with a trajectory that drives at full speed already. So the trajectory waits for
    it: its time goes by the more slowly, the farther it is ahead.

    Attributes:
        time: time on the trajectory that the robot is to be at [s].
    """

    def __init__(
        self, trajectory: Trajectory, limits: Limits | None = None, law: Law | None = None, rate: float = RATE
    ) -> None:
        """Prepare to follow a trajectory.

        Args:
            trajectory: what is followed.
            limits: limits of the robot; those of the trajectory if not given.
            law: what takes back the error; Kanayama's if not given.
            rate: how often a command will be asked for [Hz].

        Raises:
            TrajectoryError: if no limits are given or known.
            SettingsError: if the rate is no number above 0.
        """
        limits = trajectory.limits if limits is None else limits
        if limits is None:
            raise TrajectoryError(Problem("limits", MISSING, "the limits of the robot: the trajectory has none"))
        if not (is_number(rate) and rate > 0.0):
            raise SettingsError(Problem("rate", rate, "a number above 0 [Hz]"))
        at_rest = trajectory.ends_at_rest
        self.trajectory = trajectory if at_rest else trajectory.stopping_at(float(trajectory.t[-1]), limits)
        self.limits, self.step = limits, 1.0 / rate
        self._law: Law = KanayamaLaw() if law is None else law
        self.time = float(trajectory.t[0])
        self._last: tuple[float, float] = (float(trajectory.v[0]), float(trajectory.omega[0]))

    def command(self, pose: ArrayLike) -> tuple[float, float]:
        """The command until the next call, a step later.

        Args:
            pose: where the robot is: (x, y, theta) [m, m, rad].

        Returns:
            v and omega [m/s, rad/s]; after the end of the trajectory the robot is braked.
        """
        if self.is_done:
            wanted = (0.0, 0.0)
        else:
            end = float(self.trajectory.t[-1])
            reference, ahead = self.trajectory.at([self.time, min(self.time + self.step, end)])
            error = error_of(pose, reference[:3])
            wanted = self._law(error, float(ahead[3]), float(ahead[4]))
            lag = float(error[0]) * math.copysign(1.0, ahead[3])
            pace = min(max(1.0 - lag / LONGEST_LAG, 0.0), 1.0) if ahead[3] else 1.0
            self.time = min(self.time + self.step * pace, end)
        self._last = self.limits.reachable(self._last, wanted, self.step)
        return self._last

    @property
    def is_done(self) -> bool:
        """Whether the end of the trajectory has come."""
        return self.time >= float(self.trajectory.t[-1]) - _ROUNDING


def error_of(pose: ArrayLike, reference: ArrayLike) -> NDArray[np.float64]:
    """Pose of a reference in the frame of a robot at a pose, shape (3,) [m, m, rad]."""
    x, y, theta = np.asarray(pose, dtype=float)
    dx, dy, turn = np.asarray(reference, dtype=float) - (x, y, theta)
    c, s = math.cos(theta), math.sin(theta)
    return np.array([c * dx + s * dy, -s * dx + c * dy, float(wrapped(turn))])


class Disturbance(NamedTuple):
    """What keeps a simulated robot from doing as it is told."""

    slip: float = 0.0
    """Largest fraction of each velocity that is lost, or gained: drawn once a run, and half of it at every command."""
    noise: float = 0.0
    """Standard deviation of the measured position along each axis [m]."""
    heading_noise: float = 0.0
    """Standard deviation of the measured heading [rad]."""


@dataclass(frozen=True, eq=False)
class FollowResult:
    """What became of a simulated robot that followed a trajectory."""

    t: NDArray[np.float64]
    """Times of the commands and of the end, shape (n,) [s]."""
    states: NDArray[np.float64]
    """Where the robot was then and how fast: rows of (x, y, theta, v, omega), shape (n, 5)."""
    commands: NDArray[np.float64]
    """What it was told: rows of (v, omega), shape (n - 1, 2)."""
    times: NDArray[np.float64]
    """Where the trajectory was then: its own times, which wait for a robot that lags, shape (n,) [s]."""
    errors: NDArray[np.float64]
    """Where the trajectory was, seen from the robot: rows of (ahead, left, heading), shape (n, 3) [m, m, rad]."""

    @property
    def largest_error(self) -> float:
        """Largest distance from where the trajectory was at the same time [m]."""
        return float(np.hypot(self.errors[:, 0], self.errors[:, 1]).max())

    @property
    def mean_error(self) -> float:
        """Root mean square of the distance from where the trajectory was at the same time [m]."""
        return float(np.sqrt((self.errors[:, :2] ** 2).sum(axis=1).mean()))

    @property
    def largest_heading_error(self) -> float:
        """Largest deviation from the heading at the same time [rad]."""
        return float(np.abs(self.errors[:, 2]).max())


def follow(
    trajectory: Trajectory,
    limits: Limits | None = None,
    *,
    law: Law | None = None,
    rate: float = RATE,
    disturbance: Disturbance = Disturbance(),  # noqa: B008  # a tuple, which nobody changes
    seed: int | None = None,
) -> FollowResult:
    """Let a simulated robot follow a trajectory, and report its error.

    Args:
        trajectory: what is followed, to its end or, where that is not at rest, until it is braked.
        limits: limits of the robot; those of the trajectory if not given.
        law: what takes back the error; Kanayama's if not given.
        rate: commands a second [Hz].
        disturbance: slip of the wheels and noise of the measured poses.
        seed: seed of the disturbance.

    Returns:
        The way of the robot, the commands and the errors.

    Raises:
        TrajectoryError: if no limits are given or known.
        SettingsError: if the rate or the disturbance make no sense.
    """
    for name, value in disturbance._asdict().items():
        if not (is_number(value) and value >= 0.0):
            raise SettingsError(Problem(f"disturbance.{name}", value, "a number of 0 or more"))
    follower = Follower(trajectory, limits, law, rate)
    rng = np.random.default_rng(seed)
    slip = rng.uniform(-1.0, 1.0, 2) * disturbance.slip
    spread = np.array([disturbance.noise, disturbance.noise, disturbance.heading_noise])
    most = math.ceil(SLOWEST * follower.trajectory.duration / follower.step)
    states, times = [trajectory.states[0].copy()], [follower.time]
    commands: list[tuple[float, float]] = []
    while not follower.is_done and len(commands) < most:
        command = follower.command(states[-1][:3] + rng.normal(size=3) * spread)
        kept = 1.0 - slip - rng.uniform(-0.5, 0.5, 2) * disturbance.slip
        states.append(_driven(states[-1], np.array(command), kept, follower))
        commands.append(command)
        times.append(follower.time)
    references = follower.trajectory.at(times)[:, :3]
    errors = np.array([error_of(state[:3], reference) for state, reference in zip(states, references, strict=True)])
    return FollowResult(
        t=times[0] + follower.step * np.arange(len(states), dtype=np.float64),
        states=np.array(states),
        commands=np.array(commands).reshape(-1, 2),
        times=np.array(times),
        errors=errors,
    )


def _driven(
    state: NDArray[np.float64], command: NDArray[np.float64], kept: NDArray[np.float64], follower: Follower
) -> NDArray[np.float64]:
    """A robot's state after one command, whose velocities ramp to it; a fraction of them is driven."""
    dt = follower.step / _SUBSTEPS
    pose, velocity = state[:3], state[3:]
    for _ in range(_SUBSTEPS):
        reached = follower.limits.reachable(velocity.tolist(), command.tolist(), dt)
        after: NDArray[np.float64] = np.array(reached)
        before = after if follower.limits.is_first_order else velocity
        (v0, w0), (v1, w1) = before * kept, after * kept
        pose = pose + displacement(*(np.array([value]) for value in (pose[2], v0, v1, w0, w1, dt)))[0]
        velocity = after
    return np.concatenate([pose[:2], wrapped(pose[2:]), velocity])
