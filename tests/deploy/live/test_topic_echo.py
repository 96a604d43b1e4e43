"""``topic echo`` on a running fleet: fields, counts, styles, CSV, truncation, unknown types."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from contextlib import nullcontext
from typing import Any

import pytest

from deploy.live import echo as topic_echo
from deploy.live import topics
from deploy.live.echo import EchoFormat, EchoRequest
from messages.base import encode
from messages.std import Float64
from messages.topics import Quality
from models.yaml_reader import read_yaml
from services.runtime.errors import BadInput
from services.runtime.light_node import LightNode
from services.runtime.network_address import NetworkAddress
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from tests.harness.background_fleet import WEATHER, BackgroundFleet, external_publisher, interrupt


def test_echo_goes_on_after_samples_that_are_not_messagepack(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bus = MemoryBus()
    live, outlet = LightNode(MemoryTransport(bus), "echo"), MemoryTransport(bus).advertise("json", "", Quality.SENSOR)

    def samples(*_: Any) -> Iterator[None]:
        for payload in (b'{"a": 1', b'{"b": 2', encode(Float64(data=2.5))):
            outlet.put(payload, attachment=b"")
            yield
        live.stop()

    monkeypatch.setattr(topic_echo, "cli_node", lambda *_: nullcontext(live))
    monkeypatch.setattr(topic_echo, "spin", samples)
    publication = LightNode(MemoryTransport(bus), "other")
    publication.declare_publication("/json", "", "SENSOR")
    address = NetworkAddress("tcp/127.0.0.1:1", "")
    assert topic_echo.echo(address, EchoRequest("/json"), EchoFormat()) == 0
    shown = capsys.readouterr()
    assert shown.out == "data: 2.5\n---\n"
    assert "bytes that are not MessagePack are left out" in shown.err


def test_a_topic_that_nobody_declares_is_found_by_its_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without ``--wait``, a command listens for them for a second."""
    bus = MemoryBus()
    live = LightNode(MemoryTransport(bus), "echo")
    outlet = MemoryTransport(bus).advertise("lab/weather", "", Quality.SENSOR)
    monkeypatch.setattr(topics, "spin", lambda *_: iter([None]))
    with pytest.raises(BadInput, match="no topic /lab/weather is on the network"):
        topics.find_topic(live, "/lab/weather")

    def samples(*_: Any) -> Iterator[None]:
        outlet.put(encode(Float64(data=2.5)), attachment=b"")
        yield

    monkeypatch.setattr(topics, "spin", samples)
    assert topics.find_topic(live, "/lab/weather") == topics.TopicEndpoints("/lab/weather")


def test_echo_of_a_field(running: BackgroundFleet) -> None:
    shown = running.run("topic", "echo", "--once", "--field", "pose.pose.position", "/tb3_1/odom").out
    body, mark = shown.split("---")
    assert mark == "\n"
    assert read_yaml(body)["y"] == pytest.approx(1.0, abs=1e-3)
    # As in rostopic, the field follows the topic's name.
    assert running.run("topic", "echo", "-n", "1", "/tb3_1/odom/header/frame_id").out == "tb3_1/odom\n---\n"
    assert running.run_json_lines("topic", "echo", "--once", "tb3_0/joint_states", "--field", "name[0]") == [
        "wheel_left_joint"
    ]
    many = running.run_json_lines(
        "topic", "echo", "--once", "tb3_0/odom", "--field", "child_frame_id", "--field", "header.stamp.sec"
    )
    assert list(many[0]) == ["child_frame_id", "header.stamp.sec"]


def test_echo_counts_and_styles(running: BackgroundFleet) -> None:
    shown = running.run("topic", "echo", "-n", "3", "/clock").out
    assert [read_yaml(each)["epoch"] for each in shown.split("---\n")[:-1]] == [0, 0, 0]
    flowing = running.run("topic", "echo", "-n", "2", "/clock", "--flow-style").out.splitlines()
    assert flowing[1::2] == ["---", "---"]
    assert read_yaml(flowing[0]).keys() == {"clock", "tick", "epoch", "paused"}
    ticks = [each["tick"] for each in running.run_json_lines("topic", "echo", "-n", "5", "/clock")]
    assert ticks == sorted(set(ticks))
    assert {each % 4 for each in ticks} == {0}


def test_echo_as_csv(running: BackgroundFleet) -> None:
    text = running.run(
        "topic", "echo", "--csv", "-n", "2", "tb3_0/imu", "--field", "header.stamp", "--field", "orientation"
    ).out
    head, *rows = csv.reader(io.StringIO(text))
    assert head == ["header.stamp.sec", "header.stamp.nanosec", *(f"orientation.{each}" for each in "xyzw")]
    assert [len(each) for each in rows] == [6, 6]
    assert float(rows[0][5]) == pytest.approx(1.0, abs=1e-6)
    whole = running.run("topic", "echo", "-p", "--no-header", "--once", "tb3_0/scan").out
    assert len(next(csv.reader(io.StringIO(whole)))) == 10 + 2 * 360


def test_echo_cuts_lists_and_texts(running: BackgroundFleet) -> None:
    assert "ranges: '<array of 360 values>'\n" in running.run("topic", "echo", "--once", "tb3_0/scan", "--no-arr").out
    ranges = ("topic", "echo", "--once", "tb3_0/scan", "--field", "ranges")
    assert len(running.run(*ranges).out.splitlines()) == 128 + 2
    assert len(running.run(*ranges, "-l", "5").out.splitlines()) == 5 + 2
    assert len(running.run(*ranges, "-f").out.splitlines()) == 360 + 1
    assert len(running.run_json_lines(*ranges)[0]) == 360
    late = running.run("topic", "echo", "--once", "tb3_0/robot_description", "--no-str").out
    assert late.startswith("data: '<string of ")


def test_echo_with_what_comes_beside_the_message(running: BackgroundFleet) -> None:
    first, second = running.run_json_lines("topic", "echo", "-n", "2", "tb3_0/odom", "--include-message-info")
    assert second["info"]["sequence"] == first["info"]["sequence"] + 1 + second["info"]["lost_before"]
    assert first["info"]["type"] == "nav_msgs/Odometry"
    assert not first["info"]["foreign"]
    assert first["message"]["child_frame_id"] == "tb3_0/base_footprint"


def test_echo_of_unknown_types_and_foreign_senders(running: BackgroundFleet) -> None:
    with external_publisher(running.endpoint, "lab/weather", WEATHER, encoding="application/msgpack;lab_msgs/Weather"):
        ended = running.run("topic", "echo", "--wait", "--once", "lab/weather")
        assert read_yaml(ended.out.removesuffix("---\n")) == {
            "temperature": 20.5,
            "wind": [1, 2],
            "grid": [[0, 1], [2, 3]],
        }
        assert "unknown type lab_msgs/Weather" in ended.err
        assert "an external program publishes here" in ended.err
        assert (
            "unknown field 'hail'"
            in running.run("topic", "echo", "--wait", "--once", "lab/weather", "--field", "hail", status=2).err
        )
    with external_publisher(running.endpoint, "lab/speed", {"linear": {"x": 1}}):
        [typed] = running.run_json_lines("topic", "echo", "--wait", "--once", "lab/speed", "geometry_msgs/msg/Twist")
        assert typed["angular"] == {"x": 0, "y": 0, "z": 0}
    with external_publisher(running.endpoint, "tb3_1/cmd_vel", {"linear": {"x": "fast"}}):
        ended = running.run("topic", "echo", "--once", "tb3_1/cmd_vel")
        assert read_yaml(ended.out.removesuffix("---\n")) == {"linear": {"x": "fast"}}
        assert "not geometry_msgs/Twist: subscribers refuse them" in ended.err
    with (
        external_publisher(running.endpoint, "lab/noise", b"\xc1\xc1"),
        running.start("topic", "echo", "--wait", "--once", "lab/noise") as process,
    ):
        assert process.stderr is not None
        assert any("2 bytes that are not MessagePack" in line for line in process.stderr)
        ended = interrupt(process)
        assert (ended.status, ended.out) == (130, "")
