"""Trajectories in ROS 2 bags, through the library rosbags, which needs no ROS: written as MCAP, read from any bag."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from cbrrt_ompl.errors import Problem, Remark, TrajectoryError
from cbrrt_ompl.export.messages import entries_of, nanoseconds, pose_of
from cbrrt_ompl.files import refusal, write_file
from cbrrt_ompl.trajectory.track import Track, stamped_track
from cbrrt_ompl.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from cbrrt_ompl.scenario.scenario import Scenario

SUFFIXES = (".mcap", ".db3", ".bag")
"""What files of bags end in; a ROS 2 bag may also be a folder with a metadata.yaml."""

PATH_TYPE = "nav_msgs/msg/Path"

TRANSIENT = ("/map", "/tf_static", "/footprint", "/plan")
"""Topics whose last message is kept for whoever comes later."""


def write_bag(trajectory: Trajectory, path: Path, scenario: Scenario | None = None) -> None:
    """Write a trajectory as a single MCAP file, which ``ros2 bag play`` and Foxglove read.

    Topics: ``/plan`` (nav_msgs/Path, the poses with their times), ``/cmd_vel`` (geometry_msgs/Twist, the commands),
    ``/odom`` (nav_msgs/Odometry), ``/tf`` (odom to base_link), ``/tf_static`` (map to odom); with a scenario also
    ``/map`` (nav_msgs/OccupancyGrid) and ``/footprint`` (geometry_msgs/PolygonStamped).

    Args:
        trajectory: what is written; its times are those of the messages.
        path: the file, which ends in ``.mcap``.
        scenario: whose world and robot are written too.

    Raises:
        TrajectoryError: if rosbags is not installed, the file cannot be written, or times are below 0.
    """
    rosbags = _rosbags()
    if trajectory.t[0] < 0.0:
        raise TrajectoryError(Problem("t[0]", float(trajectory.t[0]), "a time of 0 or more, which messages can have"))
    store = rosbags.get_typestore(rosbags.Stores.ROS2_HUMBLE)
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / "bag"
        with rosbags.Writer(bag, version=8, storage_plugin=rosbags.StoragePlugin.MCAP) as writer:
            connections: dict[str, Any] = {}
            for entry in entries_of(trajectory, scenario):
                if entry.topic not in connections:
                    connections[entry.topic] = writer.add_connection(
                        entry.topic, entry.kind, typestore=store, offered_qos_profiles=_qos(rosbags, entry.topic)
                    )
                message = _message(store, entry.kind, entry.content)
                data = store.serialize_cdr(message, entry.kind)
                writer.write(connections[entry.topic], nanoseconds(entry.time), data)
        (written,) = bag.glob("*.mcap")
        write_file(path, written.read_bytes(), TrajectoryError)


def is_bag(path: Path) -> bool:
    """Whether a path is that of a bag: of its file, or of its folder."""
    return path.suffix.lower() in SUFFIXES or (path.is_dir() and (path / "metadata.yaml").is_file())


def read_track(path: Path, topic: str | None = None) -> Track:
    """The last nav_msgs/Path of a topic of a bag.

    Args:
        path: a ``.mcap`` or ``.db3`` file, the folder of a ROS 2 bag, or a ``.bag`` of ROS 1.
        topic: its name; the first one with paths if not given.

    Returns:
        The poses, at the times of their stamps where those increase, else without times. Where all orientations are the
        same, as planners of positions leave them, the headings are those of the way ahead.

    Raises:
        TrajectoryError: if rosbags is not installed, or the bag cannot be read or has no such path.
    """
    rosbags = _rosbags()
    store = rosbags.get_typestore(rosbags.Stores.ROS2_HUMBLE)
    last: Any = None
    try:
        with rosbags.AnyReader([path], default_typestore=store) as reader:
            paths = [c for c in reader.connections if c.msgtype == PATH_TYPE and topic in (None, c.topic)]
            for connection, _, data in reader.messages(connections=paths[:1] if paths else []):
                if paths and connection.topic == paths[0].topic:
                    last = reader.deserialize(data, connection.msgtype)
            found = sorted({f"{c.topic} ({c.msgtype})" for c in reader.connections})
    except Exception as error:  # of files of all kinds, broken in all ways
        told = Remark(str(error) or type(error).__name__)
        reason = refusal(error) if isinstance(error, OSError) and error.strerror else told
        raise TrajectoryError(Problem("", reason, "a bag of ROS that can be read"), str(path)) from None
    if last is None or not len(last.poses):
        wanted = f"a path on the topic {topic}" if topic else f"a topic of type {PATH_TYPE}"
        raise TrajectoryError(Problem("", Remark(f"the topics {', '.join(found) or 'none'}"), wanted), str(path))
    poses = np.array([pose_of(stamped.pose) for stamped in last.poses])
    stamps = [stamped.header.stamp for stamped in last.poses]
    return stamped_track(np.array([s.sec + 1e-9 * s.nanosec for s in stamps]), poses)


def check_rosbags() -> None:
    """Find out whether bags can be written.

    Raises:
        TrajectoryError: if rosbags is not installed.
    """
    _rosbags()


def _rosbags() -> SimpleNamespace:
    """The parts of rosbags that are used; it is no dependency, but an extra."""
    names = {
        "rosbags.interfaces": ["Qos", "QosDurability", "QosHistory", "QosLiveliness", "QosReliability", "QosTime"],
        "rosbags.highlevel": ["AnyReader"],
        "rosbags.rosbag2": ["StoragePlugin", "Writer"],
        "rosbags.typesys": ["Stores", "get_typestore"],
    }
    try:
        modules = {name: import_module(name) for name in names}
    except ImportError as error:
        expected = "the library rosbags: pip install 'cbrrt-ompl[ros]'"
        raise TrajectoryError(Problem("", Remark(f"no module {error.name}"), expected)) from None
    return SimpleNamespace(**{name: getattr(modules[module], name) for module in names for name in names[module]})


def _qos(rosbags: SimpleNamespace, topic: str) -> list[Any]:
    """Reliable, and kept for whoever comes later where a topic has one message only."""
    i = rosbags
    durability = i.QosDurability.TRANSIENT_LOCAL if topic in TRANSIENT else i.QosDurability.VOLATILE
    depth = 1 if topic in TRANSIENT else 10
    never, is_odd = i.QosTime(2147483647, 4294967295), False
    history, reliability, liveliness = i.QosHistory.KEEP_LAST, i.QosReliability.RELIABLE, i.QosLiveliness.AUTOMATIC
    return [i.Qos(history, depth, reliability, durability, never, never, liveliness, never, is_odd)]


def _message(store: Any, kind: str, content: Mapping[str, Any]) -> Any:
    """A message of plain values, its fields filled by the definition of its type."""
    fields = dict(store.get_msgdef(kind).fields)
    return store.types[kind](**{name: _field(store, fields[name], value) for name, value in content.items()})


def _field(store: Any, definition: Any, value: Any) -> Any:
    """One field of a message: a message itself, a list of them, or plain."""
    if isinstance(value, Mapping):
        return _message(store, definition[1], value)
    if isinstance(value, list) and value and isinstance(value[0], Mapping):
        inner = definition[1][0][1]
        return [_message(store, inner, entry) for entry in value]
    return value
