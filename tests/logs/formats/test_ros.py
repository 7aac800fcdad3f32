"""Bags written by rosbags, with an own type of message."""

import os
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from rosbags import rosbag1, rosbag2
from rosbags.rosbag2 import StoragePlugin
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from auvid_cli.errors import FileError
from auvid_cli.logs.formats.log import HEADER_STAMP, LOG_TIME, LogColumn
from auvid_cli.logs.formats.open_log import open_log

SHARED = Path(os.environ.get("AUVID_SHARED", Path(__file__).parents[3] / "../shared"))
COUGUV = SHARED / "recorded/couguv"
BAGS = ("SO_bag_0", "SO_lastbag_mcap_0")

DVL = """\
std_msgs/Header header
uint8 BOTTOM=1
geometry_msgs/Vector3 velocity
bool valid
string mode
float32[2] range
string[] notes
dvl_msgs/Beam[] beams
"""
START = 1_743_805_382
COUNT = 20


def typestore(release):
    store = get_typestore(release)
    store.register(get_types_from_msg(DVL, "dvl_msgs/msg/DVL"))
    store.register(get_types_from_msg("float64 distance\n", "dvl_msgs/msg/Beam"))
    return store


def messages(store, release):
    """Measurements of a DVL: u = 0.1 k m/s at k / 5 s, recorded 0.25 s later, with k % 3 beams."""
    types = store.types
    header_type, time_type = types["std_msgs/msg/Header"], types["builtin_interfaces/msg/Time"]
    for k in range(COUNT):
        stamp = time_type(START + k // 5, k % 5 * 200_000_000)
        sequence = {"seq": k} if release == Stores.ROS1_NOETIC else {}
        yield (
            START * 10**9 + k * 200_000_000 + 250_000_000,
            types["dvl_msgs/msg/DVL"](
                header=header_type(stamp=stamp, frame_id="dvl", **sequence),
                velocity=types["geometry_msgs/msg/Vector3"](0.1 * k, -0.2, 0.3),
                valid=k % 2 == 0,
                mode=f"ping {k}",
                range=np.array([1.5, 2.5], np.float32),
                notes=["even"] * (1 - k % 2),
                beams=[types["dvl_msgs/msg/Beam"](10.0 * k + beam) for beam in range(k % 3)],
            ),
        )


def write_bag1(folder):
    store = typestore(Stores.ROS1_NOETIC)
    path = folder / "dive.bag"
    with rosbag1.Writer(path) as writer:
        dvl = writer.add_connection("/dvl", "dvl_msgs/msg/DVL", typestore=store)
        writer.add_connection("/silent", "std_msgs/msg/Float64", typestore=store)
        for stamp, message in messages(store, Stores.ROS1_NOETIC):
            writer.write(dvl, stamp, store.serialize_ros1(message, "dvl_msgs/msg/DVL"))
    return path


def write_bag2(folder, plugin):
    store = typestore(Stores.ROS2_HUMBLE)
    path = folder / "dive"
    with rosbag2.Writer(path, version=9, storage_plugin=plugin) as writer:
        dvl = writer.add_connection("/dvl", "dvl_msgs/msg/DVL", typestore=store)
        writer.add_connection("/silent", "std_msgs/msg/Float64", typestore=store)
        for stamp, message in messages(store, Stores.ROS2_HUMBLE):
            writer.write(dvl, stamp, store.serialize_cdr(message, "dvl_msgs/msg/DVL"))
    return path


WRITERS = {
    ".bag": write_bag1,
    "folder of mcap": lambda folder: write_bag2(folder, StoragePlugin.MCAP),
    ".mcap": lambda folder: next(write_bag2(folder, StoragePlugin.MCAP).glob("*.mcap")),
    "folder of db3": lambda folder: write_bag2(folder, StoragePlugin.SQLITE3),
    ".db3": lambda folder: next(write_bag2(folder, StoragePlugin.SQLITE3).glob("*.db3")),
}


@pytest.fixture(params=WRITERS)
def bag(request, tmp_path):
    return WRITERS[request.param](tmp_path)


def test_numbers_and_texts_of_message_are_columns(bag):
    columns = open_log(bag).tables()["/dvl"]
    assert [column for column in columns if column.name != "header.seq"] == [
        LogColumn(LOG_TIME),
        LogColumn(HEADER_STAMP),
        LogColumn("header.stamp.sec"),
        LogColumn("header.stamp.nanosec"),
        LogColumn("header.frame_id", is_text=True),
        LogColumn("velocity.x"),
        LogColumn("velocity.y"),
        LogColumn("velocity.z"),
        LogColumn("valid"),
        LogColumn("mode", is_text=True),
        LogColumn("range[0]"),
        LogColumn("range[1]"),
        LogColumn("notes[0]", is_text=True),
        LogColumn("beams[0].distance"),
        LogColumn("beams[1].distance"),
    ]


def write_some(folder, version, topics):
    """Write a bag with 20 messages of each topic: type and bytes."""
    store = typestore(Stores.ROS2_HUMBLE)
    with rosbag2.Writer(folder / "dive", version=version, storage_plugin=StoragePlugin.SQLITE3) as writer:
        for topic, (msgtype, contents) in topics.items():
            connection = writer.add_connection(topic, msgtype, typestore=store)
            for k in range(COUNT):
                writer.write(connection, START * 10**9 + k, contents(store, k))
    return folder / "dive"


def depth(store, k):
    return store.serialize_cdr(store.types["std_msgs/msg/Float64"](0.5 * k), "std_msgs/msg/Float64")


def beam(store, k):
    return store.serialize_cdr(store.types["dvl_msgs/msg/Beam"](1.5 * k), "dvl_msgs/msg/Beam")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["Beam.msg", "dvl_msgs/msg/Beam.msg"])
def test_undefined_topic_is_named_and_read_with_given_definition(tmp_path, name):
    bag = write_some(tmp_path, 8, {"/depth": ("std_msgs/msg/Float64", depth), "/beam": ("dvl_msgs/msg/Beam", beam)})
    with closing(sqlite3.connect(bag / "dive.db3")) as storage, storage:
        storage.execute("DELETE FROM message_definitions")
    log = open_log(bag)
    (remark,) = log.remarks()
    assert "/beam" in remark
    assert "dvl_msgs/msg/Beam.msg" in remark
    assert log.read("/depth", ["data"])["data"].tolist() == [0.5 * k for k in range(COUNT)]
    path = tmp_path / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("float64 distance\n")
    log = open_log(bag, definitions=[path])
    assert log.remarks() == ()
    assert log.read("/beam", ["distance"])["distance"].tolist() == [1.5 * k for k in range(COUNT)]


def test_undecodable_topic_is_skipped_and_named(tmp_path):
    wrong = "dvl_msgs/msg/Beam", lambda store, k: bytes([0, 1, 0, 0, 1])
    log = open_log(write_some(tmp_path, 9, {"/depth": ("std_msgs/msg/Float64", depth), "/beam": wrong}))
    assert log.tables()["/beam"] == (LogColumn(LOG_TIME),)
    assert "/beam" in log.remarks()[0]
    assert log.read("/depth", ["data"])["data"].size == COUNT


def test_invalid_definition_raises_file_error(tmp_path):
    bag = write_some(tmp_path, 9, {"/beam": ("dvl_msgs/msg/Beam", beam)})
    path = tmp_path / "Beam.msg"
    path.write_text("float64 = = distance\n")
    with pytest.raises(FileError, match=r"Beam\.msg: not a definition"):
        open_log(bag, definitions=[path]).tables()


def test_written_values_are_read(bag):
    names = [LOG_TIME, HEADER_STAMP, "velocity.x", "valid", "mode", "range[1]", "beams[1].distance", "notes[0]"]
    values = open_log(bag).read("/dvl", names)
    k = np.arange(COUNT)
    assert list(values) == names
    # Seconds since 1970 have a resolution of 0.24 us.
    np.testing.assert_allclose(values[LOG_TIME], START + 0.2 * k + 0.25, rtol=0, atol=3e-7)
    np.testing.assert_allclose(values[HEADER_STAMP], START + 0.2 * k, rtol=0, atol=3e-7)
    np.testing.assert_array_equal(values["velocity.x"], 0.1 * k)
    np.testing.assert_array_equal(values["valid"], (k + 1) % 2)
    np.testing.assert_array_equal(values["mode"], [f"ping {number}" for number in k])
    np.testing.assert_array_equal(values["range[1]"], 2.5)
    np.testing.assert_array_equal(values["beams[1].distance"], np.where(k % 3 == 2, 10.0 * k + 1, np.nan))
    np.testing.assert_array_equal(values["notes[0]"], np.where(k % 2 == 0, "even", ""))


def test_topic_without_messages_has_no_fields(bag):
    log = open_log(bag)
    assert log.tables()["/silent"] == (LogColumn(LOG_TIME),)
    assert len(log.read("/silent", [LOG_TIME])[LOG_TIME]) == 0
    with pytest.raises(FileError, match=r"no field in /silent named 'data'.*the topic has no messages"):
        log.read("/silent", ["data"])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("table", "column", "complaint"),
    [
        ("/dvl/data", "velocity.x", "no topic named '/dvl/data'.*'/dvl'"),
        (
            "/dvl",
            "velocity.u",
            "no field in /dvl named 'velocity.u'.*'velocity.x'",
        ),
        ("/dvl", "beams[0].range", "no number in /dvl named 'beams\\[0\\].range'"),
        ("/dvl", "beams[0]", "no number in /dvl named 'beams\\[0\\]'"),
    ],
)
def test_missing_name_raises_file_error_with_nearest(bag, table, column, complaint):
    with pytest.raises(FileError, match=complaint):
        open_log(bag).read(table, [column])


def test_truncated_bag_raises_file_error(bag):
    path = bag if bag.is_file() else next(file for file in bag.iterdir() if file.suffix != ".yaml")
    whole = path.read_bytes()
    for part in (0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99):
        path.write_bytes(whole[: int(part * len(whole))])
        with pytest.raises(FileError, match="may be repaired with"):
            open_log(bag).read("/dvl", ["velocity.x"])


@pytest.mark.recorded
@pytest.mark.skipif(not COUGUV.is_dir(), reason="the recorded bags are not here")
class TestRecorded:
    """A lake run of a CougUV against a conversion of the same bag by another program."""

    def test_the_messages_of_its_own_drivers_are_decoded(self):
        csv = open_log(COUGUV / "csv/dvl_velocity.csv").read("", ["unix_s", "u_m_s", "w_m_s", "valid"])
        names = [HEADER_STAMP, "velocity.x", "velocity.z", "velocity_valid"]
        parts = [open_log(COUGUV / f"{name}.mcap").read("/coug2/dvl/data", names) for name in BAGS]
        merged = [np.concatenate([part[name] for part in parts]) for name in names]
        # The bags overlap, and another program merged them.
        stamps, first = np.unique(np.round(merged[0], 6), return_index=True)
        np.testing.assert_allclose(stamps, csv["unix_s"], rtol=0, atol=2e-6)
        for found, name in zip(merged[1:], ["u_m_s", "w_m_s", "valid"], strict=True):
            np.testing.assert_allclose(found[first], csv[name], rtol=0, atol=1e-12)

    @pytest.mark.parametrize("name", BAGS)
    def test_other_sensors_of_the_vehicle_are_found(self, name):
        log = open_log(COUGUV / f"{name}.mcap")
        for topic, column in {
            "/coug2/modem_status": "attitude_roll",
            "/coug2/depth_data": "pose.pose.position.z",
            "/coug2/controls/command": "fin[2]",
            "/coug2/modem_imu": "angular_velocity.z",
        }.items():
            assert column in [found.name for found in log.tables()[topic]]
            assert np.isfinite(log.read(topic, [column])[column]).all()
