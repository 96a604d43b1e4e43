"""The panel's mathematics and limits: fields, times, binary frames, send queues, poses, ports, the address."""

from __future__ import annotations

import os
import re
import struct
import subprocess
import sys
from math import pi
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.geometry import Pose, PoseWithCovariance
from messages.nav import Odometry
from messages.rosgraph import Clock
from messages.sensor import Imu, LaserScan
from messages.std import Float32, Header, Time, stamp_of
from services import panel
from services.panel.address import Address, read_address, token_for, write_address
from services.panel.channels import ProcessUsage
from services.panel.clock import SimTimeMap
from services.panel.graph import expected_rate
from services.panel.pages import MAX_PACKETS, Page
from services.panel.plots import field_unit, list_fields, read_number
from services.panel.protocol import MAGIC, Samples, pack_samples
from services.panel.server import listen
from services.runtime.errors import BadInput
from services.runtime.field_path import parse_path
from services.runtime.parameters.validation import build
from services.runtime.transport.wire import SampleInfo

ODOMETRY = Odometry(
    header=Header(stamp=Time.of(2_500_000_000)), pose=PoseWithCovariance(pose=Pose.planar(1.5, -2.0, pi / 2))
)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("pose.pose.position.x", 1.5),
        ("pose.pose.orientation.yaw", pi / 2),
        ("pose.covariance[35]", 0.0),
        ("pose.covariance[36]", None),
        ("header.stamp.sec", 2.0),
        ("header.frame_id", None),
        ("pose.pose.position.nothing", None),
        ("pose.pose.position.x.y", None),
        ("pose[3]", None),
        ("__class__", None),
        ("pose.__dict__", None),
    ],
)
def test_a_number_by_its_path(path: str, value: float | None) -> None:
    assert read_number(ODOMETRY, parse_path(path)) == (value if value is None else pytest.approx(value))


def test_numbers_in_arrays_maps_and_flags() -> None:
    scan = LaserScan(ranges=LaserScan().ranges.__class__([0.5, 1.5]))
    assert read_number(scan, parse_path("ranges[1]")) == 1.5
    assert read_number(scan, parse_path("ranges[2]")) is None
    assert read_number({"a": [{"b": True}]}, parse_path("a[0].b")) == 1.0
    assert read_number({"a": float("nan")}, parse_path("a")) is None
    assert read_number({"a": float("inf")}, parse_path("a")) is None


def test_every_listed_number_is_reached_by_its_path() -> None:
    for message in (ODOMETRY, LaserScan(ranges=LaserScan().ranges.__class__([1.0] * 500)), Float32(data=2.0)):
        found = list_fields(message)
        assert len(found) <= 600
        for path, value in found:
            if isinstance(value, int | float):
                assert read_number(message, parse_path(path)) == float(value), path


def test_the_stamp_of_a_message() -> None:
    assert stamp_of(ODOMETRY) == 2_500_000_000
    assert stamp_of(Float32()) is None
    assert stamp_of({"header": 1}) is None


def test_a_message_without_a_stamp_gets_the_time_that_the_clock_showed_when_it_was_sent() -> None:
    time = SimTimeMap()
    for tick in range(2000):
        time.add(Clock(clock=Time.of(tick * 20_000_000)), SampleInfo(tick + 1, 10**15 + tick * 10_000_000, 16, b"c"))
    now = 1999 * 20_000_000
    assert time.now == now
    assert time.at(SampleInfo(1, 10**15 + 1990 * 10_000_000 + 5_000_000, 16, b"p")) == 1990 * 20_000_000 + 10_000_000
    assert time.at(SampleInfo(1, 10**18, 16, b"p")) == now
    assert time.at(None) == now
    assert time.at(SampleInfo(1, 0, 16, b"p")) <= now - 512 * 20_000_000, "older than what is remembered: the oldest"
    assert time.epoch == 0
    time.add(Clock(clock=Time.of(0), epoch=1), None)
    assert (time.epoch, time.now) == (1, 0)


@pytest.mark.parametrize("off", [-(10**6), -3600 * 10**9, 3600 * 10**9])
def test_time_is_known_again_with_the_first_clock_after_the_wall_clock_was_set(off: int) -> None:
    for forged in (False, True):
        time, tick = SimTimeMap(), 20_000_000
        for beat in range(1, 30):
            wrong = beat == 20 if forged else beat >= 20
            time.add(Clock(clock=Time.of(beat * tick)), SampleInfo(beat, 10**18 + beat * tick + off * wrong, 16, b"c"))
        shift = 0 if forged else off
        assert time.at(SampleInfo(1, 10**18 + 25 * tick + tick // 2 + shift, 16, b"p")) == 25 * tick + tick // 2
        assert time.at(SampleInfo(1, 10**18 + 30 * tick + shift, 16, b"p")) == 29 * tick
        assert time.epoch == 0


@given(st.lists(st.tuples(st.floats(0, 1e6), st.floats(-1e12, 1e12)), max_size=50))
def test_a_frame_holds_what_was_put_into_it(points: list[tuple[float, float]]) -> None:
    samples = Samples()
    for point in points:
        samples.add(*point)
    frame = pack_samples(3, [(9, len(samples), samples.encode())])
    assert struct.unpack_from("<4I2I", frame) == (MAGIC, 3, 1, 0, 9, len(points))
    assert len(frame) == 24 + 16 * len(points)
    assert list(struct.unpack_from(f"<{len(points)}d", frame, 24)) == [t for t, _ in points]


def test_a_slow_page_keeps_the_newest_state_and_a_bounded_stream() -> None:
    roused = []
    page = Page(1, lambda: roused.append(1))
    for count in range(1000):
        page.set_state("clock", f"clock {count}")
        page.enqueue(b"frame %d" % count)
        page.enqueue(f"text {count}")
    page.flush()
    page.flush()
    assert len(roused) == 1
    taken = page.drain()
    assert taken[0] == "clock 999"
    assert taken[1:1001] == [f"text {count}" for count in range(1000)], "answers and values wait longer than samples"
    assert taken[1001:] == [b"frame %d" % count for count in range(1000 - MAX_PACKETS, 1000)]
    assert page.dropped == 1000 - MAX_PACKETS
    page.enqueue(b"x" * (5 << 20))
    assert page.drain() == []


@pytest.mark.parametrize(
    ("name", "rate"), [("/clock", 50), ("/tb3_0/odom", 25), ("/x/sonar/range", 160), ("/odometry", 0)]
)
def test_promised_rates(name: str, rate: float) -> None:
    assert expected_rate(name) == rate


def test_a_taken_port_gives_way_to_the_next() -> None:
    with listen(0) as first:
        port = first.getsockname()[1]
        with listen(port) as second:
            assert port < second.getsockname()[1] < port + 20
            assert second.getsockname()[0] == "127.0.0.1"


def test_the_port_of_an_earlier_life_comes_before_a_lower_one_that_has_become_free() -> None:
    with listen(0) as first:
        port = first.getsockname()[1]
        with listen(port) as second:
            earlier = second.getsockname()[1]
    with listen(port, earlier) as again, listen(port, earlier) as other:
        assert again.getsockname()[1] == earlier
        assert other.getsockname()[1] == port, "it is taken"
    with listen(port, port + 30) as third:
        assert third.getsockname()[1] == port, "that is not one of the ports that were asked for"


def test_all_ports_taken_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("services.panel.server.PORT_TRIES", 1)
    with listen(0) as first, pytest.raises(BadInput, match="are all taken: choose another with port=N"):
        listen(first.getsockname()[1])


def test_the_address_is_for_its_owner_alone_and_the_token_outlives_a_restart(tmp_path: Path) -> None:
    file = tmp_path / "panel.json"
    token = token_for(file, 1)
    write_address(file, Address(port=1, token=token, pid=2))
    assert file.stat().st_mode & 0o777 == 0o600
    assert read_address(file) == Address(port=1, token=token, pid=2)
    assert token_for(file, 1) == token
    assert token_for(file, 2) != token, "on another port it is told to somebody else"
    assert token_for(None, 1) != token_for(None, 1)
    file.write_bytes(b'{"port": 1, "token": "\xe5", "pid": 2}')
    assert read_address(file) is None
    file.write_text("{")
    assert read_address(file) is None
    assert token_for(file, 1) != token


def test_the_unit_of_a_field_is_that_of_its_quantity() -> None:
    scan, imu = LaserScan(ranges=LaserScan().ranges.__class__([1.0])), Imu()
    for topic, message, path, expected in (
        ("/a/odom", ODOMETRY, "pose.pose.position.x", "m"),
        ("/a/odom", ODOMETRY, "pose.pose.orientation.yaw", "rad"),
        ("/a/odom", ODOMETRY, "pose.pose.orientation.w", ""),
        ("/a/odom", ODOMETRY, "pose.covariance[0]", ""),
        ("/a/odom", ODOMETRY, "twist.twist.linear.x", "m/s"),
        ("/a/odom", ODOMETRY, "twist.twist.angular.z", "rad/s"),
        ("/a/odom", ODOMETRY, "header.stamp.sec", "s"),
        ("/a/scan", scan, "ranges[0]", "m"),
        ("/a/scan", scan, "angle_increment", "rad"),
        ("/a/imu", imu, "linear_acceleration.z", "m/s²"),
        ("/robot_control/error", Float32(), "data", "deg"),
        ("/a/error", Float32(), "data", ""),
        ("/foreign", {"speed": {"x": 1.0}}, "speed.x", ""),
    ):
        assert field_unit(topic, message, parse_path(path)) == expected, (topic, path)


def test_usage_is_measured_while_a_process_lives() -> None:
    usage = ProcessUsage()
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as child:
        pids = {"own": os.getpid(), "child": child.pid}
        assert usage.measure(pids)
        assert usage.by_name["own"][1] > 10, "MiB"
        assert "child" in usage.by_name
        began = sum(os.times()[:2])
        while sum(os.times()[:2]) - began < 0.02:  # the kernel's unit is a hundredth of a second
            pass
        usage.measure(pids)
        assert usage.by_name["own"][0] > 0, "percent of a core"
        child.communicate(b"\n")
    usage.measure(pids)
    assert set(usage.by_name) == {"own"}


def test_the_page_waits_longer_for_an_answer_than_the_panel() -> None:
    """The panel's own error names the reason."""
    script = Path(panel.__file__).parent / "static" / "js" / "link.js"
    found = re.search(r"const DEADLINE = (\d+);", script.read_text())
    assert found is not None
    with pytest.raises(BadInput, match="deadline"):
        build(panel.PanelParameters, {"deadline": int(found[1]) / 1000})
