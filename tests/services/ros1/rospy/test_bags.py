"""The module rosbag: writes and reads ROS 1 bags, reads Elea's bags."""

from collections.abc import Iterator
from hashlib import md5
from pathlib import Path
from typing import Any

import pytest

from messages.cdr.write import writer
from messages.geometry import Twist, Vector3
from messages.topics import Quality
from services.bag.channel import channel_of
from services.bag.writer import BagWriter
from services.script.loader import SITE_PACKAGES
from tests.harness.ros1 import ros1_imports

TOOLS = SITE_PACKAGES.parent / "command_line"


@pytest.fixture
def rosbag() -> Iterator[Any]:
    with ros1_imports():
        import rosbag

        yield rosbag


def test_a_bag_is_written_continued_and_read(rosbag: Any, tmp_path: Path) -> None:
    import genpy
    from std_msgs.msg import Int32, String

    path = str(tmp_path / "round.bag")
    with rosbag.Bag(path, "w", compression="lz4") as bag:
        for number in range(4):
            bag.write("counts", Int32(number), genpy.Time(100 + number))
        bag.write("/words", String("hello"), genpy.Time(102.5))
        with pytest.raises(ValueError, match="open for writing"):
            list(bag.read_messages())
    with rosbag.Bag(path, "a") as bag:
        bag.write("counts", Int32(9), genpy.Time(110))
    bag = rosbag.Bag(path)
    assert [(m.topic, m.message.data, m.timestamp.to_sec()) for m in bag.read_messages(start_time=genpy.Time(102))] == [
        ("counts", 2, 102.0),
        ("/words", "hello", 102.5),
        ("counts", 3, 103.0),
        ("counts", 9, 110.0),
    ]
    assert [m.data for _, m, _ in bag.read_messages(topics="words")] == ["hello"]
    assert [m.data for _, m, _ in bag.read_messages(["/counts"], end_time=genpy.Time(101))] == [0, 1]
    assert (bag.get_message_count(), bag.get_message_count("words")) == (6, 1)
    assert (bag.get_start_time(), bag.get_end_time()) == (100.0, 110.0)
    types, topics = bag.get_type_and_topic_info()
    assert types == {"std_msgs/Int32": Int32._md5sum, "std_msgs/String": String._md5sum}
    assert topics["counts"] == ("std_msgs/Int32", 5, 1, 1.0)
    _, (datatype, data, md5sum, _, _), _ = next(bag.read_messages("words", raw=True))
    assert (datatype, data, md5sum) == ("std_msgs/String", b"\x05\0\0\0hello", String._md5sum)
    bag.close()
    with pytest.raises(ValueError, match="closed"):
        list(bag)


def test_a_topic_of_several_publishers_is_one_in_the_overview(rosbag: Any, tmp_path: Path) -> None:
    import genpy
    import yaml
    from std_msgs.msg import Int32

    path = str(tmp_path / "two.bag")
    with rosbag.Bag(path, "w") as bag:
        for number, node in enumerate(("/b", "/a", "/b")):
            bag.write("/counts", Int32(number), genpy.Time(5 + number), connection_header={"callerid": node})
    with rosbag.Bag(path) as bag:
        assert bag.get_type_and_topic_info("/counts").topics["/counts"] == ("std_msgs/Int32", 3, 2, 1.0)
        told = yaml.safe_load(bag._get_yaml_info())
        assert (told["duration"], told["messages"], told["topics"][0]["connections"]) == (2.0, 3, 2)
        assert bag._get_yaml_info("start") == "5.0"


def test_the_command_shows_and_plays_a_bag(
    rosbag: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    import genpy
    import rospy
    from std_msgs.msg import Int32, String

    monkeypatch.syspath_prepend(str(TOOLS))
    import rosbag_command  # type: ignore[import-not-found]

    path = str(tmp_path / "lesson.bag")
    with rosbag.Bag(path, "w") as bag:
        for number in range(65):
            bag.write("/counts", Int32(number), genpy.Time(100 + number))
        bag.write("/words", String("hello"), genpy.Time(103.5))
    rosbag_command.info([path])
    shown = capsys.readouterr().out.splitlines()
    assert shown[2] == "duration:    1:04s (64s)"
    assert shown[6:] == [
        "messages:    66",
        "compression: none",
        f"types:       std_msgs/Int32  [{Int32._md5sum}]",
        f"             std_msgs/String [{String._md5sum}]",
        "topics:      /counts   65 msgs    : std_msgs/Int32",
        "             /words     1 msgs    : std_msgs/String",
    ]
    got: list[Any] = []
    rospy.init_node("reader", disable_signals=True)
    rospy.Subscriber("/counts", Int32, lambda message: got.append(message.data))
    rospy.Subscriber("/words", String, lambda message: got.append(message.data))
    rosbag_command.play([path, "-i", "-s", "2", "-u", "2", "-d", "0", "--queue=100"])
    assert sorted(map(str, got)) == ["2", "3", "4", "hello"]
    assert capsys.readouterr().out.endswith("done.\nDone.\n")


def test_types_that_only_the_bag_knows_are_read(rosbag: Any, tmp_path: Path) -> None:
    from rosbags.rosbag1 import Writer

    with Writer(tmp_path / "foreign.bag") as foreign:
        text = f"float32 level\n{'=' * 80}\nMSG: far_msgs/Unused\nint8 x\n"
        md5sum = md5(b"float32 level").hexdigest()
        connection = foreign.add_connection("/t", "far_msgs/msg/Level", msgdef=text, md5sum=md5sum)
        foreign.write(connection, 1_500_000_000, b"\x00\x00\x20\x40")
    ((topic, message, time),) = rosbag.Bag(tmp_path / "foreign.bag")
    assert (topic, message._type, message.level, time.to_sec()) == ("/t", "far_msgs/Level", 2.5, 1.5)


def test_bags_of_elea_are_read_in_simulated_time(rosbag: Any, tmp_path: Path) -> None:
    with BagWriter(tmp_path / "run") as made:
        channel = channel_of("/cmd_vel", Twist, Quality.EVENT)
        data = writer(Twist)(Twist(linear=Vector3(x=0.25)))
        made.write(channel, 1, 7_000_000_000, 3_000_000_000, data)
    bag = rosbag.Bag(tmp_path / "run")
    ((topic, message, time),) = bag.read_messages()
    assert (topic, message.linear.x, time.to_sec()) == ("/cmd_vel", 0.25, 3.0)
    assert message._connection_header["type"] == "geometry_msgs/Twist"
    assert bag.get_type_and_topic_info().topics["/cmd_vel"].message_count == 1
    assert bag.get_start_time() == 3.0


def test_what_is_no_bag_says_so(rosbag: Any, tmp_path: Path) -> None:
    (tmp_path / "text.bag").write_text("no bag")
    (tmp_path / "torn.bag").write_bytes(b"#ROSBAG V2.0\n" + b"\xff" * 40)
    with pytest.raises(rosbag.ROSBagFormatException, match=r"text\.bag is not a bag"):
        rosbag.Bag(tmp_path / "text.bag")
    with pytest.raises(rosbag.ROSBagException, match=r"torn\.bag|Unindexed"):
        rosbag.Bag(tmp_path / "torn.bag")
    with pytest.raises(FileNotFoundError):
        rosbag.Bag(tmp_path / "missing.bag")
    with pytest.raises(rosbag.ROSBagException, match=r"ends in \.bag"):
        rosbag.Bag(tmp_path / "x.mcap", "w")
    with pytest.raises(ValueError, match="mode must be"):
        rosbag.Bag(tmp_path / "x.bag", "rw")
