"""Ways out to a robot: ROS bags and paths, and followers that drive a trajectory."""

from __future__ import annotations
