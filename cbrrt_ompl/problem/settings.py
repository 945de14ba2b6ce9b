"""What to plan for and how: the goal region and the settings of Algorithms I and II."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from numbers import Integral
from typing import Any, NamedTuple

import numpy as np

from cbrrt_ompl.checks import A_NUMBER, A_POSITIVE_NUMBER, LARGEST, SMALLEST, is_number
from cbrrt_ompl.errors import Problem, SettingsError
from cbrrt_ompl.problem.robot import Limits

CUT_EXTENSION = ("discard", "keep")
"""What may become of an extension that meets an obstacle before its horizon."""

NEAREST_NEIGHBOUR = ("grid", "kd-tree", "brute-force")
"""Ways in which the compiled planners find the node nearest to a sample."""


class State(NamedTuple):
    """A state of SE(2) x R^2, of start poses and of trajectories alike."""

    x: float
    """Position [m]."""
    y: float
    """Position [m]."""
    theta: float = 0.0
    """Heading, counter-clockwise from the x axis [rad]."""
    v: float = 0.0
    """Forward velocity [m/s]."""
    omega: float = 0.0
    """Turning rate [rad/s]."""


def goal_distance(goal: Any, x: float, y: float) -> float:
    """Distance of a position from a goal's centre, as OMPL computes it to the last bit [m].

    Args:
        goal: a :class:`Goal`, or the record of one in a kernel.
        x: position [m].
        y: position [m].
    """
    dx, dy = x - goal.x, y - goal.y
    return math.sqrt(dx * dx + dy * dy)


def heading_error(goal: Any, theta: float) -> float:
    """How far a heading is from that of a goal which has one, 0 to pi [rad]; see :func:`goal_distance`."""
    error = abs(theta - goal.theta) % (2.0 * math.pi)
    return min(error, 2.0 * math.pi - error)


@dataclass(frozen=True)
class Goal:
    """The goal region: a disc in (x, y), with the heading and the speed restricted on request.

    A state is in it where its distance to (x, y) is below ``tolerance`` (as in OMPL, strictly), the heading is at
    most ``heading_tolerance`` away from ``theta``, and neither speed, of v [m/s] or omega [rad/s], is above
    ``speed_tolerance``.

    Raises:
        SettingsError: with every value that makes no sense.
    """

    x: float
    """Centre [m]."""
    y: float
    """Centre [m]."""
    tolerance: float = 0.5
    """Radius of the disc [m]."""
    theta: float | None = None
    """Heading to arrive in [rad]; None leaves it free."""
    heading_tolerance: float = math.radians(10.0)
    """Largest deviation from ``theta`` [rad]; without meaning where ``theta`` is None."""
    speed_tolerance: float | None = None
    """Largest speed to arrive with, of v [m/s] and of omega [rad/s]; None leaves them free."""

    def __post_init__(self) -> None:
        """Check all values together."""
        optional = [name for name in ("theta", "speed_tolerance") if getattr(self, name) is None]
        problems = [
            Problem(f"goal.{name}", getattr(self, name), A_NUMBER)
            for name in ("x", "y", "theta")
            if name not in optional and not is_number(getattr(self, name), LARGEST)
        ]
        for name in ("tolerance", "heading_tolerance", "speed_tolerance"):
            value = getattr(self, name)
            if name not in optional and not (is_number(value, LARGEST) and value > 0.0):
                problems.append(Problem(f"goal.{name}", value, f"a number above 0, at most {LARGEST:g}"))
        if problems:
            raise SettingsError(problems)
        _keep_floats(self, "x", "y", "tolerance", "theta", "heading_tolerance", "speed_tolerance")

    @property
    def is_position_only(self) -> bool:
        """Whether heading and speed are both free, as in the paper."""
        return self.theta is None and self.speed_tolerance is None

    def violations(self, state: State) -> list[str]:
        """What keeps a state out of the goal region; empty where the state is inside.

        Args:
            state: the state to judge.

        Returns:
            A line a violated condition, with the figure and the tolerance.
        """
        found = []
        distance = goal_distance(self, state.x, state.y)
        if not distance < self.tolerance:
            found.append(f"{distance:.6g} m from the goal, tolerance {self.tolerance:g} m")
        if self.theta is not None:
            error = heading_error(self, state.theta)
            if error > self.heading_tolerance:
                found.append(f"heading off by {error:.6g} rad, tolerance {self.heading_tolerance:g} rad")
        if self.speed_tolerance is not None:
            for name, speed, unit in (("v", state.v, "m/s"), ("omega", state.omega, "rad/s")):
                if abs(speed) > self.speed_tolerance:
                    found.append(f"arrives with {name} = {speed:.6g} {unit}, tolerance {self.speed_tolerance:g}")
        return found


@dataclass(frozen=True)
class PlanningSettings:
    """Settings of the planners, as far as they are given; the other defaults are our readings of the paper.

    What suits one planner and not another is None where it is left out: each planner fills it with its own defaults,
    see :meth:`filled`.

    Raises:
        SettingsError: with every value that makes no sense.
    """

    horizon: float = 2.0
    """Duration t_h of one extension [s]."""
    step: float = 0.05
    """Integration step dt, and the spacing of the checked states [s]."""
    goal_bias: float | None = None
    """Share of samples that are the goal itself, 0 to 1; None is the planner's default."""
    max_samples: int | None = None
    """Samples after which a plan has failed: K of Algorithm I; None is the planner's default."""
    cut_extension: str = "discard"
    """``discard`` or ``keep`` the free part of an extension that meets an obstacle."""
    equal_control_tolerance: float = 0.1
    """eps_u of Algorithm II, line 5 [m/s and rad/s]; 0 refuses only an identical control, a negative one nothing."""
    look_ahead: float | None = None
    """Largest distance of the reference from its node [m]; None is ``v_max * horizon``."""
    closed_loop: bool | None = None
    """Evaluate the control law at every step instead of once an extension, which then ends where the robot passes its
    reference; None is the planner's default."""
    law: str = "kanayama"
    """Control law of CB-RRT by name: ``kanayama``, ``posq``, or one of :func:`cbrrt_ompl.register_law`."""
    final_approach: bool = True
    """Try from every node to brake, turn, drive straight onto the goal's centre and turn to its heading, at rest; only
    for goals that restrict heading or speed."""
    brake_safe: bool = False
    """Keep only what the robot can brake from to rest without collision, from every step on (CB-RRT; the velocities of
    S-RRT jump, so that it always can)."""
    clearance: float = 0.0
    """Distance that motions keep from obstacles and bounds [m]; never less than half a millimetre."""
    nearest_neighbour: str = "grid"
    """How the compiled planners find the nearest node: ``grid``, ``kd-tree`` or ``brute-force``."""

    def __post_init__(self) -> None:
        """Check all values together."""
        problems = [
            Problem(f"planning.{name}", getattr(self, name), f"{A_POSITIVE_NUMBER} [s]")
            for name in ("horizon", "step")
            if not _is_positive(getattr(self, name))
        ]
        if not problems and not 0.5 < float(self.horizon) / float(self.step) <= MAX_STEPS + 0.5:
            problems.append(
                Problem("planning.horizon", self.horizon, f"1 to {MAX_STEPS} steps of {self.step:g} s (planning.step)")
            )
        if self.goal_bias is not None and not (is_number(self.goal_bias) and 0.0 <= self.goal_bias <= 1.0):
            problems.append(Problem("planning.goal_bias", self.goal_bias, "a number from 0 to 1"))
        if self.max_samples is not None and not (
            is_number(self.max_samples)
            and isinstance(self.max_samples, Integral)
            and 1 <= self.max_samples <= MAX_SAMPLES
        ):
            expected = f"a whole number of 1 or more, at most {MAX_SAMPLES}"
            problems.append(Problem("planning.max_samples", self.max_samples, expected))
        for name, known in (("cut_extension", CUT_EXTENSION), ("nearest_neighbour", NEAREST_NEIGHBOUR)):
            if not (isinstance(getattr(self, name), str) and getattr(self, name) in known):
                problems.append(Problem(f"planning.{name}", getattr(self, name), f"one of {', '.join(known)}"))
        if not is_number(self.equal_control_tolerance, LARGEST):
            problems.append(Problem("planning.equal_control_tolerance", self.equal_control_tolerance, A_NUMBER))
        if not (is_number(self.clearance, LARGEST) and self.clearance >= 0.0):
            problems.append(Problem("planning.clearance", self.clearance, "a distance of 0 or more [m]"))
        if not (isinstance(self.law, str) and self.law):
            problems.append(Problem("planning.law", self.law, "the name of a control law"))
        if self.look_ahead is not None and not _is_positive(self.look_ahead):
            problems.append(Problem("planning.look_ahead", self.look_ahead, f"{A_POSITIVE_NUMBER} [m]"))
        if not isinstance(self.closed_loop, bool | np.bool_ | None):
            problems.append(Problem("planning.closed_loop", self.closed_loop, "True or False"))
        if problems:
            raise SettingsError(problems)
        _keep_floats(self, "horizon", "step", "goal_bias", "equal_control_tolerance", "look_ahead", "clearance")

    def filled(self, defaults: FilledSettings | None = None) -> FilledSettings:
        """These settings with defaults for what is left out.

        Args:
            defaults: of a planner; the paper's if not given.
        """
        if isinstance(self, FilledSettings):
            return self
        usual = FilledSettings() if defaults is None else defaults
        given = {field.name: getattr(self, field.name) for field in fields(self)}
        return FilledSettings(
            **{name: getattr(usual, name) if value is None else value for name, value in given.items()}
        )

    def approaches(self, goal: Goal) -> bool:
        """Whether final approaches to a goal are tried."""
        return self.final_approach and not goal.is_position_only

    @property
    def steps(self) -> int:
        """Integration steps of a whole extension."""
        return round(self.horizon / self.step)

    def reference_distance(self, limits: Limits) -> float:
        """Largest distance of the reference from its node for a robot [m]."""
        return limits.v_max * self.horizon if self.look_ahead is None else self.look_ahead


@dataclass(frozen=True)
class FilledSettings(PlanningSettings):
    """Settings of which none is left out; the defaults are the paper's."""

    goal_bias: float = 0.0
    max_samples: int = 50_000
    closed_loop: bool = False


def _is_positive(value: object) -> bool:
    """Whether a value is a number above 0 of a size that we can compute with."""
    return is_number(value, LARGEST) and value >= SMALLEST


def _keep_floats(settings: Goal | PlanningSettings, *names: str) -> None:
    """Turn numbers of other kinds into floats, so that all code computes with the same ones."""
    for name in names:
        if getattr(settings, name) is not None:
            object.__setattr__(settings, name, float(getattr(settings, name)))


MAX_SAMPLES = 1_000_000_000
"""Samples that a plan may draw at most: nodes are counted in 32 bits."""

MAX_STEPS = 100_000
"""Steps that one extension may have: what a control duration and its buffers are made for."""

FOR_MAPS = FilledSettings(goal_bias=0.2, max_samples=500_000, closed_loop=True)
"""Settings that suit a map."""
