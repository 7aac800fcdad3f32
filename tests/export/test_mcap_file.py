"""A written run as two readers know it that had no part in writing it: mcap-ros2 and rosbags."""

from dataclasses import replace

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from auvid_cli.export.recording import topics_of, write_mcap

TIME = np.array([0.0, 0.1, 1.0 / 3.0])
ORIGIN = {"made from": f"the dataset with SHA-256 {'d' * 64}"}


@pytest.fixture
def topics(hand_made, short_run):
    estimate = hand_made(TIME, {"X_u|u|": [-1.0, -2.0, -3.0], "Y_uudr": [1.0, 2.0, np.nan]})
    estimate.mean[:, 2:] = np.arange(27.0).reshape(3, 9) / 30.0
    truth = short_run.truth
    few = replace(truth, time=truth.time[:4], motion=truth.motion[:4], position=truth.position[:4])
    return topics_of(replace(short_run, truth=few), estimate)


@pytest.fixture
def file(topics, tmp_path):
    write_mcap(tmp_path / "run.mcap", topics, ORIGIN)
    return tmp_path / "run.mcap"


def test_mcap_reader_gets_every_number(topics, file):
    with file.open("rb") as stream:
        decoded = list(make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages())
    rows = {topic.name: [] for topic in topics}
    for _, channel, message, content in decoded:
        if channel.topic in rows:
            rows[channel.topic].append((message.log_time, content))
    for topic in topics:
        stamps = [stamp for stamp, _ in rows[topic.name]]
        assert stamps == (topic.time * 1e9).round().astype(int).tolist()
        for (stamp, content), row in zip(rows[topic.name], topic.values, strict=True):
            assert content.header.stamp.sec * 10**9 + content.header.stamp.nanosec == stamp
            match topic.kind.value:
                case "pose":
                    place, turn = content.pose.position, content.pose.orientation
                    held = [place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w]
                case "velocity":
                    along, about = content.twist.linear, content.twist.angular
                    held = [along.x, along.y, along.z, about.x, about.y, about.z]
                case _:
                    held = [getattr(content, field) for field in topic.fields]
            np.testing.assert_array_equal(held, row)


def test_rosbags_reads_transforms_paths_and_tables(topics, file):
    with AnyReader([file]) as reader:
        messages = {}
        for connection, stamp, raw in reader.messages():
            messages.setdefault(connection.topic, []).append((stamp, reader.deserialize(raw, connection.msgtype)))
    moved = {transform.child_frame_id for _, message in messages["/tf"] for transform in message.transforms}
    assert moved == {"vehicle", "vehicle_true"}
    assert {transform.header.frame_id for _, message in messages["/tf"] for transform in message.transforms} == {"map"}
    assert len(messages["/path"][0][1].poses) == 3
    assert len(messages["/truth/path"][0][1].poses) == 4
    assert messages["/states"][1][1].x_uu == -2.0
    assert np.isnan(messages["/states"][2][1].y_uudr)
    stamps = [stamp for of_topic in messages.values() for stamp, _ in of_topic]
    assert len(stamps) == sum(len(topic.time) * (2 if topic.kind.value == "pose" else 1) for topic in topics) + 2


def test_recording_begins_with_its_origin(file):
    with file.open("rb") as stream:
        assert [record.metadata for record in make_reader(stream).iter_metadata()] == [ORIGIN]
    assert b"SHA-256 ddd" in file.read_bytes()[:200]


def test_failed_recording_keeps_the_earlier_file(topics, tmp_path):
    path = tmp_path / "run.mcap"
    path.write_bytes(b"as it was")
    broken = topics[0]._replace(values=topics[0].values[:, :2])
    with pytest.raises(TypeError):
        write_mcap(path, [broken], ORIGIN)
    assert [(each.name, each.read_bytes()) for each in tmp_path.iterdir()] == [("run.mcap", b"as it was")]
