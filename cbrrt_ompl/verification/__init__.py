"""Verification of trajectories, by code that shares nothing with the planners.

The velocities are computed again from the commands and the limits, the poses from the velocities by an integrator of
SciPy's, the collisions by FCL; the planners' kernels and the clearance map have no part in it. A motion is proven free
between the states that FCL is asked about: whatever moves by less than its clearance touches nothing.
"""

from __future__ import annotations

from cbrrt_ompl.verification.result import Verification
from cbrrt_ompl.verification.verifying import verify
from cbrrt_ompl.verification.violation import Violation

__all__ = ["Verification", "Violation", "verify"]
