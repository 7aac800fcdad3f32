"""A motion put into a bag by the conventions of ROS comes back as it was."""

import numpy as np
import pytest
from rosbags import rosbag2
from rosbags.rosbag2 import StoragePlugin
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

from auvid_cli.config.enums import shipped_configs
from auvid_cli.config.log_map import load_map
from auvid_cli.logs.convert import convert
from auvid_cli.logs.formats.open_log import open_log

START = 1_743_805_382
TICKS = np.arange(50) * 100_000_000
MAP = f"""\
name: bag
vehicle: {shipped_configs() / "vehicles" / "vt690.yaml"}
logs: {{bag: x}}
sensors:
  gyroscope:
    table: /imu
    columns: {{p: angular_velocity.x, q: angular_velocity.y, r: angular_velocity.z}}
    frame: FLU
    standard_deviation: 0.1 deg/s
  attitude: {{table: /imu, quaternion: orientation, frame: FLU, reference: ENU, standard_deviation: 1 deg}}
  dvl:
    table: /dvl
    columns: {{u: twist.linear.x, v: twist.linear.y, w: twist.linear.z}}
    frame: FLU
    position: [0.4 m, 0 m, 0.1 m]
    standard_deviation: 1 mm/s
inputs:
  table: /fins
  rudder: {{column: vector.x, unit: deg, sign: -1}}
  elevator: {{column: vector.y, unit: deg}}
  surge_force: vector.z
"""
FLU = np.diag([1.0, -1.0, -1.0])
NED_OF_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


@pytest.mark.slow
@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_motion_comes_back_from_a_bag(tmp_path, plugin):
    seconds = TICKS * 1e-9
    wave = 0.3 * np.sin(seconds[:, None] + np.arange(12))
    rates, angles, velocity, inputs = np.split(wave, 4, axis=1)
    at_dvl = velocity + np.cross(rates, [0.4, 0.0, 0.1])
    rotation = Rotation.from_euler("ZYX", angles[:, ::-1]).as_matrix()
    quaternion = Rotation.from_matrix(NED_OF_ENU.T @ rotation @ FLU).as_quat()

    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    vector = types["geometry_msgs/msg/Vector3"]
    unknown = np.zeros(9)
    with rosbag2.Writer(tmp_path / "bag", version=9, storage_plugin=plugin) as writer:
        kinds = {
            "/imu": "sensor_msgs/msg/Imu",
            "/dvl": "geometry_msgs/msg/TwistStamped",
            "/fins": "geometry_msgs/msg/Vector3Stamped",
        }
        topics = {topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in kinds.items()}
        for k, tick in enumerate(TICKS.tolist()):
            stamp = types["builtin_interfaces/msg/Time"](START + tick // 10**9, tick % 10**9)
            header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="base_link")
            turned = types["geometry_msgs/msg/Quaternion"](*quaternion[k])
            messages = {
                "/imu": types["sensor_msgs/msg/Imu"](
                    header, turned, unknown, vector(*(FLU @ rates[k])), unknown, vector(0.0, 0.0, 9.8), unknown
                ),
                "/dvl": types["geometry_msgs/msg/TwistStamped"](
                    header, types["geometry_msgs/msg/Twist"](vector(*(FLU @ at_dvl[k])), vector(0.0, 0.0, 0.0))
                ),
                "/fins": types["geometry_msgs/msg/Vector3Stamped"](
                    header, vector(-np.degrees(inputs[k, 0]), np.degrees(inputs[k, 1]), inputs[k, 2])
                ),
            }
            for topic, message in messages.items():
                # Recorded late, by a varying delay: the header says when it was measured.
                late = START * 10**9 + tick + 50_000_000 + 1_000_000 * (k % 7)
                writer.write(topics[topic], late, store.serialize_cdr(message, kinds[topic]))

    path = tmp_path / "map.yaml"
    path.write_text(MAP)
    found = convert(*load_map(path), {"bag": open_log(tmp_path / "bag")})
    assert found.origin == START
    for name, expected in (("gyroscope", rates), ("attitude", angles), ("dvl", velocity)):
        assert found.sensors[name].time == pytest.approx(seconds, abs=1e-6)
        assert found.sensors[name].values == pytest.approx(expected, abs=1e-12)
    assert found.inputs.values[:, :3] == pytest.approx(inputs, abs=1e-12)
