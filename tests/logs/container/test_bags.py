"""ROS bags of both versions and MCAP files, made by the library that reads them."""

import numpy as np
import pytest

from rotcli.errors import LogError
from rotcli.logs.imu import read_imu
from rotcli.rig.rig import default_rig, rig_from_dict

rosbags = pytest.importorskip("rosbags", reason="extra rotcli[ros] is not installed")
COUNT = 60


def bag(folder, kind, topics=("/imu/data",)):
    """Write a bag with messages sensor_msgs/Imu every 10 ms; return its path."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if kind == "bag" else Stores.ROS2_HUMBLE)
    types = store.types
    path = folder / f"log.{kind}" if kind == "bag" else folder / kind
    plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
    writer = Writer1(path) if kind == "bag" else Writer2(path, version=9, storage_plugin=plugin)
    name = "sensor_msgs/msg/Imu"
    serialize = store.serialize_ros1 if kind == "bag" else store.serialize_cdr
    with writer:
        for number, topic in enumerate(topics):
            connection = writer.add_connection(topic, name, typestore=store)
            for k in range(COUNT):
                nano = 1_700_000_000_000_000_000 + 10_000_000 * k
                stamp = types["builtin_interfaces/msg/Time"](nano // 10**9, nano % 10**9)
                more = {"seq": k} if kind == "bag" else {}
                header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="imu", **more)
                vector, zero = types["geometry_msgs/msg/Vector3"], np.zeros(9)
                message = types[name](
                    header=header,
                    orientation=types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0),
                    orientation_covariance=zero,
                    angular_velocity=vector(0.01 * k + number, -0.2, 0.3),
                    angular_velocity_covariance=zero,
                    linear_acceleration=vector(0.1, 0.2, 9.8),
                    linear_acceleration_covariance=zero,
                )
                # The time of recording is late; the stamp of the message counts.
                writer.write(connection, nano + 5_000_000, serialize(message, name))
    return path


@pytest.mark.parametrize("kind", ["bag", "db3", "mcap"])
def test_a_bag_is_read_by_the_stamps_of_its_messages(tmp_path, kind):
    path = bag(tmp_path, kind)
    files = [path, *(path.glob(f"*.{kind}") if path.is_dir() else [])]
    for file in files:
        log = read_imu(file, default_rig())
        assert log.samples == COUNT
        assert log.time[0] == pytest.approx(1.7e9, abs=1e-6)
        assert log.interval == pytest.approx(0.01, rel=1e-6)
        np.testing.assert_allclose(log.gyro[:, 0], 0.01 * np.arange(COUNT), atol=1e-12)
        np.testing.assert_array_equal(log.accel[5], [0.1, 0.2, 9.8])
        assert log.warnings == ()


def test_a_bag_of_two_imus_asks_for_the_topic(tmp_path):
    path = bag(tmp_path, "bag", ("/imu/left", "/imu/right"))
    with pytest.raises(LogError, match=r'set \[imu\] topic = "/imu/left" or another one'):
        read_imu(path, default_rig())
    log = read_imu(path, rig_from_dict({"imu": {"topic": "/imu/right"}}))
    assert log.gyro[0, 0] == 1.0
    with pytest.raises(LogError, match="no topic /imu; topics: /imu/left, /imu/right"):
        read_imu(path, rig_from_dict({"imu": {"topic": "/imu"}}))


def test_a_damaged_bag_is_one_error(tmp_path):
    path = bag(tmp_path, "bag")
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(LogError, match="the bag may be damaged"):
        read_imu(path, default_rig())
