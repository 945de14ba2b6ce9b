"""Trajectories as the YAML of a nav_msgs/Path, which ``ros2 topic pub`` takes and ``ros2 topic echo`` prints."""

from __future__ import annotations

from pathlib import Path

from cbrrt_ompl.errors import TrajectoryError
from cbrrt_ompl.export.messages import path_message
from cbrrt_ompl.files import write_file
from cbrrt_ompl.scenario.plain_yaml import dump_line
from cbrrt_ompl.trajectory.trajectory import Trajectory


def write_path(trajectory: Trajectory, path: Path, scenario: object = None) -> None:
    """Write the poses of a trajectory with their times, a line each.

    Args:
        trajectory: what is written.
        path: the file.
        scenario: without meaning; a path has room for poses only.

    Raises:
        TrajectoryError: if the file cannot be written.
    """
    message = path_message(trajectory)
    lines = [dump_line({"header": message["header"]}), "poses:", *(f"  - {{{dump_line(p)}}}" for p in message["poses"])]
    write_file(path, "\n".join(lines) + "\n", TrajectoryError)
