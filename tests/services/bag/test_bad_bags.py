"""Files that aren't bags, foreign bags, unknown types: each is read as far as possible, or rejected with the reason."""

from __future__ import annotations

import json
import tracemalloc
from pathlib import Path

import pytest
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter

from messages.cdr.write import writer
from messages.geometry import Twist, Vector3
from messages.rosgraph import Log
from messages.std import Header, String, Time
from messages.topics import Quality
from services.bag.channel import Channel, channel_of
from services.bag.csv_export import export_csv, flatten
from services.bag.info import bag_info
from services.bag.mcap_reader import read_stats
from services.bag.reader import MessageDecoder, open_bag, unreadable_reason
from services.bag.writer import BagWriter
from services.runtime.errors import BadInput
from tests.services.bag.sample_bags import START, make_bag, make_rosbag2_bag


def test_a_bag_of_ros_2_is_read(tmp_path: Path) -> None:
    bag = open_bag(make_rosbag2_bag(tmp_path / "ros"))
    typed = MessageDecoder()
    found = [typed.decode(each) for each in bag.entries() if not unreadable_reason(each.channel)]
    assert found.count(Twist(linear=Vector3(x=0.5), angular=Vector3(z=-1.0))) == 3
    line = Log(
        header=Header(stamp=Time(sec=3, nanosec=4)), level=4, name="n", msg="careful", file="f", function="g", line=7
    )
    assert line in found
    told = {each.topic: each for each in bag_info(bag).topics}
    assert told["/cmd_vel"].rate == pytest.approx(10)
    assert told["/battery"].playable, "a type without a record of ours is read by its own schema"


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("chunking", [True, False])
def test_every_way_to_pack_a_file_is_read(tmp_path: Path, compression: CompressionType, chunking: bool) -> None:
    file = tmp_path / "other.mcap"
    with file.open("wb") as stream:
        writer = McapWriter(stream, compression=compression, use_chunking=chunking)
        writer.start("ros2", "somebody")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/s", "cdr", schema)
        for number in (2, 1, 3):
            writer.add_message(channel, number, b"\0\1\0\0\2\0\0\0a\0", number)
        writer.finish()
    found = list(open_bag(file).entries())
    assert [each.log_time for each in found] == ([1, 2, 3] if chunking else [2, 1, 3])
    assert found[0].data[-2:] == b"a\0"


@pytest.mark.parametrize(
    ("channel", "reason"),
    [
        (Channel("/t", "foxglove.Log", "protobuf", "", "protobuf"), "encoding of its messages is protobuf, not cdr"),
        (Channel("/t", "", "", "", ""), "encoding of its messages is unnamed, not cdr"),
        (Channel("/t", "geometry_msgs/Twist", "cdr", "module {}", "ros2idl"), "encoding is ros2idl"),
        (Channel("/t", "geometry_msgs/Twist", "cdr", "12 wheels", "ros2msg"), "'12 wheels' is not a field"),
    ],
)
def test_what_cannot_be_played_is_told_why(channel: Channel, reason: str) -> None:
    assert reason in unreadable_reason(channel)


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("empty.mcap", b"", "is empty: its recorder was killed"),
        ("text.mcap", b"hello, this is no bag", "not an MCAP file"),
        ("old.bag", b"#ROSBAG V2.0\n", "a bag of ROS 1"),
    ],
)
def test_a_file_that_is_no_bag_is_told_for_what_it_is(tmp_path: Path, name: str, content: bytes, reason: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(BadInput, match=reason):
        open_bag(tmp_path / name)


def test_a_folder_that_is_no_bag_is_told_for_what_it_is(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="there is no bag"):
        open_bag(tmp_path / "nowhere")
    with pytest.raises(BadInput, match=r"not a bag: no \.mcap file"):
        open_bag(tmp_path)
    (tmp_path / "bag_0.db3").touch()
    with pytest.raises(BadInput, match="SQLite"):
        open_bag(tmp_path)


def test_a_claim_of_much_memory_is_not_believed(tmp_path: Path) -> None:
    data = bytearray((make_bag(tmp_path / "bag", 0.1) / "bag_0.mcap").read_bytes())
    at = data.index(b"\x06", 8 + 9 + 20)
    data[at + 25 : at + 33] = (2**50).to_bytes(8, "little")
    (tmp_path / "huge.mcap").write_bytes(data)
    bag = open_bag(tmp_path / "huge.mcap")
    assert list(bag.entries()) == []
    assert "damaged" in bag.problems[0]


def test_a_summary_that_claims_much_memory_is_not_believed(tmp_path: Path) -> None:
    """The recorder reads the summaries in a folder when it resumes there."""
    file = make_bag(tmp_path / "bag", 0.1) / "bag_0.mcap"
    data = bytearray(file.read_bytes())
    summary = int.from_bytes(data[-28:-20], "little")
    assert data[summary] == 3, "a schema comes first"
    data[summary + 1 : summary + 9] = (1 << 30).to_bytes(8, "little")
    (tmp_path / "claims.mcap").write_bytes(data)
    tracemalloc.start()
    try:
        assert read_stats(tmp_path / "claims.mcap") is None
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 16 << 20
    whole = read_stats(file)
    assert whole is not None
    assert whole.messages == 25


def test_tables_have_a_column_for_each_field(tmp_path: Path) -> None:
    bag = open_bag(make_bag(tmp_path / "bag", 0.1))
    told = {each.topic: each for each in export_csv(bag, tmp_path / "csv", lambda topic: "_elea" not in topic)}
    assert {topic: each.rows for topic, each in told.items()} == {
        "/clock": 6,
        "/r/cmd_vel": 6,
        "/r/odom": 6,
        "/r/robot_description": 1,
    }
    lines = (tmp_path / "csv" / "r__cmd_vel.csv").read_text().splitlines()
    assert lines[0] == "time,log_time,linear.x,linear.y,linear.z,angular.x,angular.y,angular.z"
    assert lines[3] == f"0.040000000,{START // 10**9}.040000000,0.02,0.0,0.0,0.0,0.0,0.0"
    odom = (tmp_path / "csv" / "r__odom.csv").read_text().splitlines()[0]
    assert "pose.covariance[35]" in odom


def test_topics_of_one_file_name_do_not_mix_their_tables(tmp_path: Path) -> None:
    """One topic with two types, and another whose name gives the same file name."""
    with BagWriter(tmp_path / "bag") as made:
        for number, (topic, message) in enumerate(
            (("/a/b", String(data="one")), ("/a/b", Twist()), ("/a__b", String(data="two")), ("/a/b", String(data="3")))
        ):
            channel = channel_of(topic, type(message), Quality.EVENT)
            made.write(channel, 1, START + number, number, writer(type(message))(message))
    told = export_csv(open_bag(tmp_path / "bag"), tmp_path / "csv", lambda _: True)
    assert [(each.topic, each.rows) for each in told] == [("/a/b", 2), ("/a/b", 1), ("/a__b", 1)]
    assert len({each.file for each in told}) == 3
    texts = [each.file.read_text() for each in told if each.file is not None]
    assert [len(text.splitlines()) for text in texts] == [3, 2, 2]


def test_notes_that_are_none_are_left_out(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as made:
        made.write(channel_of("/s", String, Quality.EVENT), 1, START, 0, writer(String)(String()))
        made.metadata |= {"unwritten": "many", "lost": "[]"}
    told = bag_info(open_bag(tmp_path / "bag"))
    assert (told.unwritten, told.lost, told.messages) == (0, {}, 1)


def test_a_foreign_bag_becomes_tables_too(tmp_path: Path) -> None:
    told = {
        each.topic: each
        for each in export_csv(open_bag(make_rosbag2_bag(tmp_path / "r")), tmp_path / "csv", lambda _: True)
    }
    assert told["/cmd_vel"].rows == 3
    assert told["/battery"].rows + len(told["/battery"].reason) > 0


def test_long_lists_are_told_by_their_length() -> None:
    assert dict(flatten({"data": [0] * 2000, "a": [1, {"b": 2}]})) == {"data.length": 2000, "a[0]": 1, "a[1].b": 2}
    assert json.dumps(dict(flatten({}))) == "{}"
