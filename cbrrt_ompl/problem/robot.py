"""What the robot is and can do: velocity limits, controller gains and footprint."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from cbrrt_ompl.checks import A_NUMBER, A_POSITIVE_NUMBER, LARGEST, SMALLEST, counter_clockwise_ring, is_number
from cbrrt_ompl.errors import Problem, RobotError, WorldError

_UNLIMITED = (
    *("acceleration", "angular_acceleration", "wheel_speed", "wheel_acceleration"),
    *("deceleration", "angular_deceleration"),
)
"""Limits that may be infinite."""


REST = 1e-9
"""Velocities up to this are rounding of a rest [m/s, rad/s]."""


class Limits(NamedTuple):
    """Velocity ranges and the largest accelerations; the defaults are the paper's Tetra-DS II.

    A named tuple, since the compiled kernels take it as it is; :class:`Robot` checks it.
    """

    v_min: float = 0.0
    """Smallest forward velocity [m/s]; negative where the robot may reverse."""
    v_max: float = 1.0
    """Largest forward velocity [m/s]."""
    omega_min: float = -math.radians(30.0)
    """Smallest turning rate [rad/s]."""
    omega_max: float = math.radians(30.0)
    """Largest turning rate [rad/s]."""
    acceleration: float = 0.6
    """Largest change of v [m/s^2]; infinite, as the next one, for a robot of first order, whose velocities jump."""
    angular_acceleration: float = math.radians(30.0)
    """Largest change of omega [rad/s^2]."""
    wheel_separation: float = 0.0
    """Distance between the wheels [m]; 0 where no wheel limit is given."""
    wheel_speed: float = math.inf
    """Largest speed of a wheel over the ground, |v| + |omega| wheel_separation / 2 [m/s]."""
    wheel_acceleration: float = math.inf
    """Largest change of a wheel's speed [m/s^2]."""
    deceleration: float = math.inf
    """Largest decrease of |v| [m/s^2]; infinite where the acceleration is that, too."""
    angular_deceleration: float = math.inf
    """Largest decrease of |omega| [rad/s^2]; infinite where the angular acceleration is that, too."""

    @property
    def has_wheel_limits(self) -> bool:
        """Whether a wheel limits the robot; v and omega then change together, not each on its own."""
        return self.wheel_speed < math.inf or self.wheel_acceleration < math.inf

    @property
    def is_first_order(self) -> bool:
        """Whether nothing limits the accelerations, so that the velocities jump."""
        return self.acceleration == math.inf

    def saturated(self, v: float, omega: float) -> tuple[float, float]:
        """Velocities cut to their ranges, then both scaled to what the wheels can do [m/s, rad/s]."""
        v, omega = min(max(v, self.v_min), self.v_max), min(max(omega, self.omega_min), self.omega_max)
        rim = abs(v) + 0.5 * self.wheel_separation * abs(omega)
        share = self.wheel_speed / rim if rim > self.wheel_speed else 1.0
        return v * share, omega * share

    def reachable(self, old: Sequence[float], wanted: Sequence[float], duration: float) -> tuple[float, float]:
        """Velocities as near to wanted ones as the limits allow some time after old ones.

        Where a wheel limits the robot, both change by the same share of what is wanted, else each by itself.

        Args:
            old: v and omega before [m/s, rad/s].
            wanted: v and omega asked for.
            duration: time for the change, in which the velocities are linear [s].
        """
        new = self.saturated(*wanted)
        rates = zip((self.acceleration, self.angular_acceleration), decelerations(self), strict=True)
        within = tuple(
            _reachable(before, after, faster * duration, slower * duration)
            for before, after, (faster, slower) in zip(old, new, rates, strict=True)
        )
        if not self.has_wheel_limits:
            return within[0], within[1]
        changes = (new[0] - old[0], new[1] - old[1])
        rim = abs(changes[0]) + 0.5 * self.wheel_separation * abs(changes[1])
        shares = [min(1.0, self.wheel_acceleration * duration / rim) if rim > 0.0 else 1.0]
        shares += [(w - o) / c for w, o, n, c in zip(within, old, new, changes, strict=True) if w != n]
        share = min(shares)
        return new if share == 1.0 else (old[0] + share * changes[0], old[1] + share * changes[1])

    def problems(self) -> list[Problem]:
        """What is wrong with these limits, one entry a mistake."""
        found = [
            Problem(f"limits.{name}", value, A_NUMBER)
            for name, value in zip(self._fields, self, strict=True)
            if not (
                is_number(value, LARGEST) or (name in _UNLIMITED and isinstance(value, float) and value == math.inf)
            )
        ]
        if found:
            return found
        for name, low, high in (("v", self.v_min, self.v_max), ("omega", self.omega_min, self.omega_max)):
            if not (low <= 0.0 and high >= SMALLEST):
                expected = f"a range [low, high] with low <= 0 < high, high at least {SMALLEST:g}"
                found.append(Problem(f"limits.{name}", [low, high], expected))
        for name in _UNLIMITED:
            if getattr(self, name) < SMALLEST:
                found.append(Problem(f"limits.{name}", getattr(self, name), A_POSITIVE_NUMBER))
        for name in ("wheel_acceleration", "deceleration", "angular_deceleration"):
            if self.is_first_order and getattr(self, name) < math.inf:
                expected = "no limit for a robot without one of its acceleration"
                found.append(Problem(f"limits.{name}", getattr(self, name), expected))
        if self.is_first_order != (self.angular_acceleration == math.inf):
            limit = f"{'a' if self.angular_acceleration == math.inf else 'no'} limit, as of the acceleration"
            found.append(Problem("limits.angular_acceleration", self.angular_acceleration, limit))
        if self.wheel_separation < 0.0 or (self.has_wheel_limits and self.wheel_separation < SMALLEST):
            expected = "the distance between the wheels, above 0 [m]"
            found.append(Problem("limits.wheel_separation", self.wheel_separation, expected))
        return found


def decelerations(limits: Limits) -> tuple[float, float]:
    """Largest decreases of |v| and |omega| [m/s^2, rad/s^2]; kernels are made of this, too."""
    slower, turns_slower = limits.deceleration, limits.angular_deceleration
    return (
        slower if slower < math.inf else limits.acceleration,
        turns_slower if turns_slower < math.inf else limits.angular_acceleration,
    )


def velocity_changes(velocity: float, faster: float, slower: float) -> tuple[float, float]:
    """How far a velocity may fall and rise in a step, in which it is linear in time; kernels are made of this, too.

    A step that leads through rest is one of deceleration and of acceleration, and keeps the lesser limit; what is no
    faster than `REST` is at rest.

    Args:
        velocity: at the start of the step.
        faster: most that its magnitude may grow.
        slower: most that its magnitude may shrink.

    Returns:
        Largest decrease and largest increase, both 0 or more.
    """
    if abs(velocity) <= REST or faster == slower:
        return faster, faster
    size = abs(velocity)
    back = slower if slower <= size else max(size, min(faster, slower))
    return (back, faster) if velocity > 0.0 else (faster, back)


def _reachable(velocity: float, wanted: float, faster: float, slower: float) -> float:
    """The velocity nearest to a wanted one that a step can lead to; see :func:`velocity_changes`."""
    fall, rise = velocity_changes(velocity, faster, slower)
    if -fall <= wanted - velocity <= rise:
        return wanted
    return velocity + rise if wanted > velocity else velocity - fall


class Gains(NamedTuple):
    """Gains of the Kanayama law, Eq. (2) of the paper; the defaults are the paper's."""

    k_x: float = 1.5
    """Gain on the error ahead [1/s]."""
    k_y: float = 0.5
    """Gain on the error to the left [rad/m^2]."""
    k_theta: float = 0.1
    """Gain on the heading error [rad/m]."""

    def problems(self) -> list[Problem]:
        """What is wrong with these gains, one entry a mistake."""
        return [
            Problem(f"gains.{name}", value, f"a finite number, 0 or more and at most {LARGEST:g}")
            for name, value in zip(self._fields, self, strict=True)
            if not (is_number(value, LARGEST) and value >= 0.0)
        ]


def gains_for(limits: Limits) -> Gains:
    """Gains that follow from what a robot can do.

        k_theta = min(omega_max, sqrt(alpha_max * 1 rad)) / v_max,    k_y = k_theta^2 / 4,    k_x = 0

    An error of a radian is turned away as fast as the robot can turn through one, and the robot approaches its line
    without overshooting (critical damping: along the line, y'' + k_theta y' + k_y y = 0). Without k_x the robot drives
    at v_max cos(theta_e): slowly while it faces elsewhere.

    Args:
        limits: of the robot.
    """
    k_theta = min(limits.omega_max, math.sqrt(limits.angular_acceleration)) / limits.v_max
    return Gains(0.0, 0.25 * k_theta * k_theta, k_theta)


@dataclass(frozen=True, eq=False)
class Footprint:
    """The area that the robot covers, in its own frame; make one by ``point``, ``disc`` or ``polygon``.

    Attributes:
        radius: radius of a disc about the robot's origin [m]; 0 for a point and for a polygon.
        vertices: corners of a simple polygon, counter-clockwise, shape (n, 2) [m]; None for a point or a disc.
    """

    radius: float = 0.0
    vertices: NDArray[np.float64] | None = None

    @classmethod
    def point(cls) -> Footprint:
        """A robot of no size: planning in configuration space, as in the paper."""
        return cls()

    @classmethod
    def disc(cls, radius: float) -> Footprint:
        """A round robot.

        Args:
            radius: radius about the robot's origin [m], 0 or more.

        Raises:
            RobotError: if the radius is negative or not finite.
        """
        return cls(radius=radius)

    @classmethod
    def polygon(cls, vertices: ArrayLike) -> Footprint:
        """A robot with corners.

        Args:
            vertices: corners in the robot's frame in either direction of turn, shape (n, 2) [m]; convex or not.

        Raises:
            RobotError: if the corners do not make a simple polygon with an area.
        """
        return cls(vertices=_ring(vertices))

    def __post_init__(self) -> None:
        """Check the shape, turn it counter-clockwise and freeze it."""
        if not (is_number(self.radius, LARGEST) and self.radius >= 0.0):
            raise RobotError(Problem("footprint.radius", self.radius, "a radius of 0 or more [m]"))
        if self.vertices is not None:
            object.__setattr__(self, "vertices", _ring(self.vertices))

    def __eq__(self, other: object) -> bool:
        """Equal where the shapes are equal number for number."""
        if not isinstance(other, Footprint):
            return NotImplemented
        return self._key() == other._key()

    def __hash__(self) -> int:
        """Hash of the shape."""
        return hash(self._key())

    def _key(self) -> tuple[float, bytes]:
        return self.radius, b"" if self.vertices is None else self.vertices.tobytes()

    @property
    def kind(self) -> str:
        """``point``, ``disc`` or ``polygon``."""
        if self.vertices is not None:
            return "polygon"
        return "disc" if self.radius > 0.0 else "point"

    @property
    def is_round(self) -> bool:
        """Whether the heading makes no difference to the area covered."""
        return self.vertices is None

    @property
    def inscribed_radius(self) -> float:
        """Radius of the largest disc about the robot's origin inside the footprint [m]; 0 if the origin is outside."""
        if self.vertices is None:
            return self.radius
        shape, origin = shapely.Polygon(self.vertices), shapely.Point(0.0, 0.0)
        return float(shapely.distance(shape.exterior, origin)) if shape.contains(origin) else 0.0

    @property
    def distance_from_origin(self) -> float:
        """Distance of the nearest point of the footprint from the robot's origin [m]."""
        if self.vertices is None:
            return 0.0
        return float(shapely.distance(shapely.Polygon(self.vertices), shapely.Point(0.0, 0.0)))

    @property
    def circumscribed_radius(self) -> float:
        """Radius of the smallest disc about the robot's origin that holds the footprint [m]."""
        if self.vertices is None:
            return self.radius
        return float(np.hypot(*self.vertices.T).max())

    def outline_at(self, pose: ArrayLike, segments: int = 64) -> NDArray[np.float64]:
        """Border of the footprint at a pose.

        Args:
            pose: (x, y, theta) of the robot in the world, [m, m, rad].
            segments: corners that stand for a disc.

        Returns:
            Corners in the world, shape (n, 2) [m].
        """
        x, y, theta = np.asarray(pose, dtype=float)[:3]
        if self.vertices is None:
            angles = np.linspace(0.0, 2.0 * np.pi, segments, endpoint=False)
            return np.array([x, y]) + self.radius * np.column_stack([np.cos(angles), np.sin(angles)])  # (segments, 2)
        world_from_robot = np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])
        return np.array([x, y]) + self.vertices @ world_from_robot.T  # (n, 2)


@dataclass(frozen=True)
class Robot:
    """A two-wheeled robot; the defaults are the paper's (a point with the limits of Tetra-DS II).

    Gains that are left out are None: each planner fills them with its own defaults, the paper's or such that follow
    from the limits.

    Raises:
        RobotError: with every limit and gain that is wrong.
    """

    footprint: Footprint = Footprint()
    limits: Limits = Limits()
    gains: Gains | None = None

    def __post_init__(self) -> None:
        """Check limits and gains together."""
        parts = (("footprint", Footprint), ("limits", Limits), ("gains", Gains))
        wrong = [
            Problem(f"robot.{name}", getattr(self, name), f"a value of type {kind.__name__}")
            for name, kind in parts
            if not (isinstance(getattr(self, name), kind) or (name == "gains" and self.gains is None))
        ]
        if wrong:
            raise RobotError(wrong)
        problems = self.limits.problems() + ([] if self.gains is None else self.gains.problems())
        if problems:
            raise RobotError([Problem(f"robot.{p.field}", p.value, p.expected) for p in problems])


def _ring(vertices: ArrayLike) -> NDArray[np.float64]:
    """Corners of a footprint, checked and ordered."""
    try:
        return counter_clockwise_ring(vertices, "footprint.vertices")
    except WorldError as error:
        raise RobotError(error.problems) from None
