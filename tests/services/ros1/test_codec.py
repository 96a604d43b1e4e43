"""ROS 1 messages and our records are identical on the bus; invalid payloads are rejected."""

from __future__ import annotations

import random
import struct
import tracemalloc
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import msgpack
import pytest
from hypothesis import given, settings

from messages.base import Float32Array, Message, WrongPayload, decoder, encode
from messages.interfaces import UnknownType, catalogue
from messages.plain import plain
from messages.records import RECORDS
from messages.rosgraph import Clock, Log
from messages.sensor import LaserScan
from messages.std import Time
from tests.harness.cases import case
from tests.harness.ros1 import ros1_imports
from tests.messages.payload_mutations import filled_payload
from tests.messages.ros_values import with_float32
from tests.messages.strategies import DETERMINISTIC, values
from tests.messages.strategies import struct as struct_of

FEW = settings(DETERMINISTIC, max_examples=5)
ENDLESS = struct.pack(">I", 2**32 - 1)


@pytest.fixture(scope="module")
def genpy() -> Iterator[ModuleType]:
    with ros1_imports():
        import genpy

        yield genpy


def ros_records() -> dict[str, type[Message]]:
    """Return our records of types that ROS 1 knows."""
    found = {}
    for name, record in RECORDS.items():
        try:
            catalogue().message(name)
        except UnknownType:
            continue
        found[name] = record
    return found


@pytest.mark.slow
def test_each_record_of_ours_goes_through_ros_1s_class_and_back(genpy: Any) -> None:
    records = ros_records()
    assert len(records) > 55
    for name, record in records.items():
        if record is Clock or name.startswith("controller_manager_msgs/"):
            continue  # tick, epoch and pause are Elea's own, and claimed interfaces ROS 2's
        with case(name):
            _check_round_trip(genpy, name, record)


def _check_round_trip(genpy: Any, name: str, record: type[Message]) -> None:
    cls, read = genpy.message_class(name), decoder(record)

    @FEW
    @given(values(record).filter(_fits_ros1))
    def check(message: Message) -> None:
        assert read(genpy.encode(genpy.decode(cls, encode(message)))) == with_float32(message)

    check()


def _fits_ros1(value: object) -> bool:
    """Whether all times in a message are non-negative and all bytes fit a signed byte."""
    match value:
        case Time(sec=sec):
            return sec >= 0
        case Log(level=level) if level > 127:
            return False
        case Message():
            return all(_fits_ros1(getattr(value, name)) for name in value.__struct_fields__)
        case tuple():
            return all(map(_fits_ros1, value))
    return True


@pytest.mark.slow
def test_each_standard_message_is_read_as_it_was_sent(genpy: Any) -> None:
    """Round trips of every type's default message, through the bus and through ROS 1's binary format."""
    import io

    for name in [*catalogue().all_types("msg"), *catalogue().all_types("action")]:
        with case(name):
            cls = genpy.message_class(name if name in catalogue().all_types("msg") else f"{name}Action")
            message = cls()
            buffer = io.BytesIO()
            message.serialize(buffer)
            assert cls().deserialize(buffer.getvalue()) == message
            assert genpy.decode(cls, genpy.encode(message)) == message


def test_names_on_the_bus_are_those_of_ros_2(genpy: Any) -> None:
    info = genpy.message_class("sensor_msgs/CameraInfo")(D=[1.0], K=[2.0] * 9)
    info.header.seq, info.header.stamp = 7, genpy.Time(3, 4)
    sent = plain(genpy.encode(info))
    assert sent["header"] == {"seq": 7, "stamp": {"sec": 3, "nanosec": 4}, "frame_id": ""}
    assert (sent["d"], sent["k"]) == ([1.0], [2.0] * 9)
    assert genpy.decode(type(info), genpy.encode(info)).header.seq == 7
    physics = plain(genpy.encode(genpy.message_class("gazebo_msgs/ODEJointProperties")(hiStop=[1.0])))
    assert physics["hi_stop"] == [1.0]


def test_what_a_sender_leaves_out_is_ros_1s_default(genpy: Any) -> None:
    pose = genpy.decode(genpy.message_class("geometry_msgs/PoseWithCovariance"), b"\x80")
    assert pose == type(pose)()
    scan = genpy.decode(genpy.message_class("sensor_msgs/LaserScan"), msgpack.packb({"ranges": [1, 0.1], "novel": {}}))
    assert scan.ranges == (1.0, 0.10000000149011612)


def test_large_numbers_become_infinite_as_float32(genpy: Any) -> None:
    scan = genpy.message_class("sensor_msgs/LaserScan")
    read = genpy.decode(scan, msgpack.packb({"ranges": [1e300, float("nan")], "range_max": -1e300}))
    assert (read.ranges[0], read.range_max) == (float("inf"), float("-inf"))
    assert read.ranges[1] != read.ranges[1]


def test_arrays_of_any_dtype_are_read(genpy: Any) -> None:
    def packed(dtype: str, shape: list[int], raw: bytes) -> msgpack.ExtType:
        return msgpack.ExtType(1, msgpack.packb([dtype, shape, raw]))

    scan, grid = genpy.message_class("sensor_msgs/LaserScan"), genpy.message_class("nav_msgs/OccupancyGrid")
    image = genpy.message_class("sensor_msgs/Image")
    for cls, field, value, wanted in (
        (scan, "ranges", packed("<f8", [2], struct.pack("<2d", 1, 0.1)), (1.0, 0.10000000149011612)),
        (scan, "ranges", packed("<f4", [1, 2], struct.pack("<2f", 1, 2)), (1.0, 2.0)),
        (scan, "ranges", packed("<i4", [2], struct.pack("<2i", 1, 2)), (1.0, 2.0)),
        (grid, "data", packed("|i1", [2], b"\xff\x02"), (-1, 2)),
        (image, "data", packed("|u1", [2, 1], b"\xff\x02"), b"\xff\x02"),
        (image, "data", [255, 2], b"\xff\x02"),
    ):
        with case(f"{field} {value}"):
            assert getattr(genpy.decode(cls, msgpack.packb({field: value})), field) == wanted
    for cls, field, value, reason in (
        (grid, "data", packed("<f4", [1], bytes(4)), "cannot be read as int8"),
        (image, "data", packed("<f4", [1], bytes(4)), "not an array of bytes"),
        (scan, "ranges", packed("<f4", [3], bytes(4)), "not an array"),
        (scan, "ranges", msgpack.ExtType(5, b"1"), "not an array"),
        (grid, "data", [1000], "int8|<= 127|127|255"),
        (image, "data", [256], "255"),
    ):
        with case(f"{field} {value}"), pytest.raises(WrongPayload, match=reason):
            genpy.decode(cls, msgpack.packb({field: value}))


def test_hostile_payloads_raise_nothing_else(genpy: Any) -> None:
    chance = random.Random(7)
    for name in ("geometry_msgs/Twist", "nav_msgs/Odometry", "sensor_msgs/LaserScan", "tf2_msgs/TFMessage"):
        cls = genpy.message_class(name)
        whole = msgpack.packb(filled_payload(struct_of(RECORDS[name])))
        outcomes = set()
        for _ in range(1500):
            damaged = bytearray(whole)
            for _ in range(chance.randrange(1, 5)):
                damaged[chance.randrange(len(damaged))] = chance.randrange(256)
            try:
                genpy.decode(cls, bytes(damaged))
                outcomes.add("taken")
            except WrongPayload:
                outcomes.add("refused")
        assert outcomes == {"taken", "refused"}
    scan = genpy.message_class("sensor_msgs/LaserScan")
    tracemalloc.start()
    try:
        for field, head in (("ranges", b"\xdd"), ("ranges", b"\xc9"), ("header", b"\xdf"), ("unknown", b"\xdd")):
            with pytest.raises(WrongPayload):
                genpy.decode(scan, b"\x81" + msgpack.packb(field) + head + ENDLESS + b"\x01")
            with pytest.raises(WrongPayload):
                genpy.decode(scan, b"\x81" + msgpack.packb(field) + b"\x91" * 100_000 + b"\x01")
        assert tracemalloc.get_traced_memory()[1] < 1 << 22
    finally:
        tracemalloc.stop()


def test_ranges_travel_as_our_scans_do(genpy: Any) -> None:
    scan = genpy.message_class("sensor_msgs/LaserScan")(ranges=[1.0, 2.5], angle_max=0.1)
    read = decoder(LaserScan)(genpy.encode(scan))
    assert read.ranges == Float32Array([1.0, 2.5])
    assert read.angle_max == 0.10000000149011612
    assert len(genpy.encode(genpy.message_class("sensor_msgs/LaserScan")(ranges=[1.0] * 360))) < 1800
