"""ROS 1 and ROS 2 bags and MCAP files, read with the library rosbags (extra `rotcli[ros]`).

One topic of type sensor_msgs/Imu is read for an IMU; for a table the first topic with a joint
state or a stamped number. The stamps of the messages are used, not the times of recording.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rotcli.errors import LogError
from rotcli.lazy import lazily
from rotcli.logs.container.columns import Loaded, Wanted
from rotcli.logs.container.header import Header, with_names
from rotcli.rig.rig import ImuSettings, LogSettings

with lazily():  # an extra that may be absent
    from rosbags import highlevel, typesys

_IMU_TYPES = ("sensor_msgs/msg/Imu", "sensor_msgs/Imu")
_JOINT_TYPES = ("sensor_msgs/msg/JointState", "sensor_msgs/JointState")
_IMU_COLUMNS = (
    "sec", "nanosec",
    "gyro_x [rad/s]", "gyro_y [rad/s]", "gyro_z [rad/s]",
    "accel_x [m/s^2]", "accel_y [m/s^2]", "accel_z [m/s^2]",
)  # fmt: skip
_JOINT_COLUMNS = ("sec", "nanosec", "angle [rad]")


def bag_header(path: str, settings: LogSettings) -> Header:
    """Return the header of one topic of a bag, its columns read; raises LogError."""
    try:
        store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    except ImportError as error:
        finding = "a ROS bag; its reader is not installed"
        raise LogError(path, f'{finding}; run pip install "rotcli[ros]"') from error
    types = _IMU_TYPES if isinstance(settings, ImuSettings) else _JOINT_TYPES
    names = _IMU_COLUMNS if types is _IMU_TYPES else _JOINT_COLUMNS
    try:
        with highlevel.AnyReader([Path(path)], default_typestore=store) as reader:
            connections = _connections(path, reader, settings, types)
            rows = [
                _row(reader.deserialize(raw, connection.msgtype), types)
                for connection, _, raw in reader.messages(connections=connections)
            ]
            topic = connections[0].topic
    except LogError:
        raise
    except Exception as error:  # the library raises errors of many kinds for damaged files
        finding = f"cannot be read: {' '.join(str(error).split())[:160]}"
        raise LogError(path, f"{finding}; the bag may be damaged") from error
    if not rows:
        raise LogError(path, f"no messages in topic {topic}; at least 2 are needed")
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    columns[:2] = [column.astype(np.int64) for column in columns[:2]]
    header = with_names(Header(path, "bag", names))
    return replace(header, topic=topic, arrays=tuple(columns), header_line=1)


def _connections(path: str, reader: Any, settings: LogSettings, types: tuple[str, ...]) -> Any:
    """Return the connections of the topic that the rig names, or of the only one of its type."""
    fitting = {c.topic: c for c in reader.connections if c.msgtype in types}
    if settings.topic is not None:
        found = [c for c in reader.connections if c.topic == settings.topic]
        if not found:
            topics = ", ".join(sorted({c.topic for c in reader.connections}))
            raise LogError(path, f"no topic {settings.topic}; topics: {topics}")
        if found[0].msgtype not in types:
            finding = f"topic {settings.topic} has type {found[0].msgtype}, not {types[0]}"
            raise LogError(path, f"{finding}; topics of this type: {', '.join(fitting) or 'none'}")
        return found
    section = "imu" if types is _IMU_TYPES else "table"
    if not fitting:
        topics = ", ".join(f"{c.topic} ({c.msgtype})" for c in reader.connections)
        raise LogError(path, f"no topic of type {types[0]}; topics: {topics or 'none'}")
    if len(fitting) > 1:
        listed = ", ".join(sorted(fitting))
        first = sorted(fitting)[0]
        finding = f"{len(fitting)} topics of type {types[0]} ({listed})"
        raise LogError(path, f'{finding}; set [{section}] topic = "{first}" or another one')
    topic = next(iter(fitting))
    return [c for c in reader.connections if c.topic == topic]


def _row(message: Any, types: tuple[str, ...]) -> tuple[float, ...]:
    """Return stamp and numbers of one message."""
    stamp = message.header.stamp
    nanosec = getattr(stamp, "nanosec", getattr(stamp, "nsec", 0))
    if types is _JOINT_TYPES:
        return (stamp.sec, nanosec, float(message.position[0]))
    w, f = message.angular_velocity, message.linear_acceleration
    return (stamp.sec, nanosec, w.x, w.y, w.z, f.x, f.y, f.z)


def load(header: Header, wanted: Wanted) -> Loaded:
    """Return the wanted columns of a bag whose header was read."""
    if header.arrays is None:
        raise LogError(header.path, "the bag was not read")
    columns = [[np.ascontiguousarray(header.arrays[i])] for i in wanted.columns]
    return Loaded(header, len(header.arrays[0]), columns)
