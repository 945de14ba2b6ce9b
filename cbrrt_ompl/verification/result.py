"""The result of a verification, and its summary."""

from __future__ import annotations

from dataclasses import dataclass

from cbrrt_ompl.verification.row_checks import START_TOLERANCE
from cbrrt_ompl.verification.violation import Violation, place

ALL, ROWS, PATH, COLLISIONS = "all", "rows", "path", "collisions"
"""What was checked: everything; what can be without commands; or without times; or collisions alone."""


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
    scope: str = ALL
    """``all``; ``rows`` of a track, which has no commands; ``path`` without times; or ``collisions`` alone."""

    @property
    def ok(self) -> bool:
        """Whether nothing was violated."""
        return not self.violations

    def summary(self) -> str:
        """What was checked, to which tolerance, and what failed where and when, a line each."""
        count = len(self.violations)
        verdict = "valid" if self.ok else f"NOT VALID, {count} violation{'s' if count > 1 else ''}"
        bound = (
            f"proven not to fall below {self.clearance_bound:.4g} m"
            if self.clearance_bound > 0.0
            else "not proven to be above 0 everywhere"
        )
        again = ", stored and integrated again," if self.scope == ALL else ""
        lines = [
            f"trajectory of {self.rows} rows, {self.duration:g} s: {verdict}",
            *(f"  {violation.message}" for violation in self.violations),
            *([f"  hint: {self.hint}"] if self.hint else []),
            "checked:",
            *(f"  {line}" for line in self._checked()),
            f"  no collision of the motion{again} at any time: by distances of GEOS",
            f"  at {self.checks} states and the way between them; "
            f"intervals of at most {self.resolution:g} m accepted for their free ends: {self.unproven}",
            f"smallest clearance: {self.smallest_clearance:.4g} m at t = {self.smallest_clearance_time:.6g} s, "
            f"at {place(self.smallest_clearance_pose)}; {bound}",
        ]
        return "\n".join(lines)

    def _checked(self) -> list[str]:
        """What was checked besides collisions, a line each."""
        accelerations = (
            "accelerations not checked: the trajectory is kinematic, its velocities may jump"
            if self.kinematic
            else "velocities, commands and accelerations within the limits"
        )
        if self.scope == ALL:
            return [
                f"first row at the start to {START_TOLERANCE:g}; last row in the goal region",
                *(["velocities and commands within the limits"] if self.kinematic else []),
                accelerations,
                f"motion integrated again from the commands, to {self.tolerance:g} (m, rad, m/s, rad/s) at every row",
            ]
        if self.scope == COLLISIONS:
            return []
        ends = f"first row at the start to {self.tolerance:g}; last row in the goal region"
        if self.scope == PATH:
            return [ends, "no velocities: the path has no times"]
        return [
            ends,
            f"velocities within the limits, to {self.tolerance:g}",
            accelerations.replace(", commands", "") + ("" if self.kinematic else f", to {self.tolerance:g}"),
            f"every row where the one before leads, to {self.tolerance:g} (m, rad); no commands to integrate again",
        ]
