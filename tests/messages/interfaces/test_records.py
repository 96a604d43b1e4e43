"""Records generated for types without a class of ours: on the bus, in CDR, and learned from other processes."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from messages.base import WrongPayload, decoder, encode
from messages.cdr.definitions import definitions, long_type_name, text_of
from messages.cdr.read import record_reader
from messages.cdr.write import writer
from messages.errors import BadInput
from messages.interfaces import catalogue
from messages.interfaces.records import definition_text, find_record, forget_learned, learn, need_record
from messages.records import RECORDS, UnknownRecord
from messages.std import Header, Time
from tests.harness.cases import case

STEP = """\
std_msgs/Header header
float32[] xs
uint8[4] id
int64 from
walk/Foot[<=2] feet
===
MSG: walk/Foot
bool left
===
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
"""


@pytest.fixture(autouse=True)
def forgotten() -> Iterator[None]:
    yield
    forget_learned()


@pytest.mark.slow
def test_every_standard_message_is_written_as_ros_2_reads_it() -> None:
    for name in catalogue().all_types("msg"):
        with case(name):
            record, long = need_record(name), long_type_name(name)
            message = record()
            assert decoder(record)(encode(message)) == message
            data = writer(record)(message)
            assert record_reader(record, definitions(record))(data) == message
            if name not in RECORDS:
                store = get_typestore(Stores.EMPTY)
                store.register(get_types_from_msg(text_of(name, definitions(record)), long))
                store.deserialize_cdr(data, long)


def test_a_type_is_learned_from_its_definition() -> None:
    assert find_record("walk/Step") is None
    assert learn("walk/msg/Step", STEP)
    assert not learn("walk/Step", STEP)
    record = need_record("walk/msg/Step")
    assert record.ROS_TYPE == "walk/Step"
    foot = definitions(record)["walk/Foot"]
    assert [str(field) for field in foot] == ["bool left"]
    wire = {
        "header": {"seq": 3, "stamp": {"sec": 1, "nanosec": 2}, "frame_id": "odom"},
        "xs": [1, 2.5],
        "id": b"abcd",
        "from": -7,
        "feet": [{"left": True}],
    }
    read = decoder(record)(encode(wire))
    assert read.header == Header(stamp=Time(sec=1, nanosec=2), frame_id="odom")  # type: ignore[attr-defined]
    assert (list(read.xs), read.id, read.from_) == ([1.0, 2.5], b"abcd", -7)  # type: ignore[attr-defined]
    assert record_reader(record, definitions(record))(writer(record)(read)) == read
    for name, value in (("xs", "many"), ("id", b"ab"), ("from", 2**64 - 1), ("feet", [{"left": True}] * 3)):
        with case(name), pytest.raises(WrongPayload):
            decoder(record)(encode(wire | {name: value}))


def test_what_others_announce_is_bounded() -> None:
    learn("walk/Step", STEP)
    for name, text, reason in (
        ("walk/Step", "int32 a\n", "is defined in two ways: the first definition is kept"),
        ("walk/Odd", "12 wheels", "'12 wheels' is not a field"),
        ("walk/Long", "#" * 70_000, "has 70000 bytes, the limit is 65536"),
        ("walk/Self", "walk/Self[] a\n", "contains itself"),
        ("walk/Wide", "float64[900000000] a\n", "the limit is"),
        ("walk/Large", "float64[8000000] a\n", "has 64000000 bytes, the limit for a record is 1048576"),
        ("walk/Lost", "walk/Other a\n", "walk/Other is not defined"),
        ("walk/\x1b[2J", "int32 a\n", "is not the name of a type"),
    ):
        with case(name), pytest.raises(BadInput, match=reason.replace("[", r"\[")):
            learn(name, text)
    assert not learn("std_msgs/String", "int32 data\n"), "a standard type stays as it is"
    assert not learn("sensor_msgs/BatteryState", "int32 data\n")
    for number in range(999):
        learn(f"walk/T{number}", "int32 a\n")
    with pytest.raises(BadInput, match="one type too many"):
        learn("walk/More", "int32 a\n")


def test_only_what_is_not_standard_is_announced() -> None:
    assert definition_text("geometry_msgs/Twist") == definition_text("nav_msgs/GridCells") == ""
    assert definition_text("nowhere/Nothing") == ""
    with pytest.raises(UnknownRecord, match=r"did you mean 'sensor_msgs/BatteryState'"):
        need_record("sensor_msgs/BateryState")
