"""Driving through a world that is known within a sensor's range only, planning again on the way."""

from __future__ import annotations

from cbrrt_ompl.drive.result import Cycle, DriveResult
from cbrrt_ompl.drive.settings import DriveSettings
from cbrrt_ompl.drive.simulation import Drive, drive

__all__ = ["Cycle", "Drive", "DriveResult", "DriveSettings", "drive"]
