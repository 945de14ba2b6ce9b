"""Trajectories improved by optimal control: guesses, a transcription, a solver, exact checks and repairs."""

from __future__ import annotations

from cbrrt_ompl.optimise.improving import Found, improve
from cbrrt_ompl.optimise.objective import Objective

__all__ = ["Found", "Objective", "improve"]
