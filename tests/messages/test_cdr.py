"""Every record as CDR: two independent readers get the same values, field by field, and ours restores the record."""

from __future__ import annotations

import contextlib
import json
import math
import struct
from typing import Any, ClassVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap_ros2._dynamic import generate_dynamic
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from messages.base import Message, WrongPayload
from messages.cdr.definitions import definitions, fields_in, long_type_name, parse, text_of
from messages.cdr.read import LARGEST_READ, plain_reader, record_reader
from messages.cdr.sidecar import EXTRAS, ROS_RECORDS, join, split
from messages.cdr.write import NotWritable, writer
from messages.elea import ProcessState
from messages.geometry import Twist, Vector3
from messages.interfaces import BadDefinition, Catalogue
from messages.parameters import Parameter, Value
from messages.records import RECORDS
from messages.sensor import Range
from messages.std import Empty
from tests.harness.cases import case
from tests.messages.ros_values import assert_same, ros_view, with_float32
from tests.messages.strategies import DETERMINISTIC, FEW, values

STORE = get_typestore(Stores.ROS2_JAZZY)
RECORDED = sorted(
    {ROS_RECORDS.get(each, each) for each in RECORDS.values()} | set(EXTRAS.values()), key=lambda each: each.ROS_TYPE
)


def independent(record: type[Message]) -> tuple[Any, str, Any]:
    """Return the readers of rosbags and mcap-ros2-support for a record, from the schema that we write."""
    name = long_type_name(record.ROS_TYPE)
    text = text_of(record.ROS_TYPE, definitions(record))
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(text, name))
    return store, name, generate_dynamic(name, text)[name]


def test_a_standard_type_is_that_of_ros_2() -> None:
    catalogue = Catalogue()
    ours = {long_type_name(name) for name in catalogue.all_types("msg")} - {"rosgraph_msgs/msg/Log"}
    compared = sorted(ours & set(STORE.fielddefs))
    assert len(compared) > 150
    for long in compared:
        name = long.replace("/msg/", "/")
        with case(name):
            store = get_typestore(Stores.EMPTY)
            store.register(get_types_from_msg(text_of(name, catalogue.definitions(name)), long))
            assert store.hash_rihs01(long) == STORE.hash_rihs01(long)


@pytest.mark.slow
def test_others_read_what_is_written_field_by_field_and_ours_gives_the_record_back() -> None:
    for record in dict.fromkeys((*RECORDS.values(), *RECORDED)):
        with case(record.ROS_TYPE):
            _check_readers(record)


def _check_readers(record: type[Message]) -> None:
    ros, extra = ROS_RECORDS.get(record, record), EXTRAS.get(record)
    store, name, dynamic = independent(ros)
    write, read = writer(ros), record_reader(ros, definitions(ros))
    read_extra = record_reader(extra, definitions(extra)) if extra else None
    on_the_bus = record in RECORDS.values()

    @FEW
    @given(values(record).filter(_fits_int64))
    def check(message: Message) -> None:
        main, beside = split(message)
        data = write(main)
        wanted = ros_view(main)
        assert_same(wanted, store.deserialize_cdr(data, name))
        assert_same(wanted, dynamic(data))
        if on_the_bus:
            again = read_extra(writer(type(beside))(beside)) if read_extra and beside is not None else None
            assert join(read(data), again) == with_float32(message)

    check()


def _fits_int64(value: object) -> bool:
    """Whether all integers fit int64: MessagePack allows uint64, ROS 2's fields don't."""
    if isinstance(value, Message):
        return all(_fits_int64(getattr(value, name)) for name in value.__struct_fields__)
    if isinstance(value, tuple):
        return all(map(_fits_int64, value))
    return not isinstance(value, int) or value < 2**63


def test_what_a_float32_cannot_hold_is_infinite_as_in_every_cast() -> None:
    read = plain_reader("sensor_msgs/Range", definitions(Range))
    for value, wanted in ((1e300, math.inf), (-1e300, -math.inf), (3.4028234e38, float(np.float32(3.4028234e38)))):
        assert read(writer(Range)(Range(range=value)))["range"] == wanted


def test_a_whole_number_beyond_int64_is_refused() -> None:
    with pytest.raises(NotWritable, match="elea_msgs/ProcessState"):
        writer(ProcessState)(ProcessState(exit_status=2**64 - 1))


@pytest.mark.parametrize("value", [None, True, 3, 3.0, 0.1, "3", (), (1, 2.5, "x", None), ((1, 2), (3.0,))])
def test_a_parameter_of_any_type_is_kept_as_json(value: Value) -> None:
    data = writer(Parameter)(Parameter(name="p", value=value))
    assert plain_reader("elea_msgs/Parameter", definitions(Parameter))(data)["value"] == json.dumps(value)
    again = record_reader(Parameter, definitions(Parameter))(data)
    assert (again.value, type(again.value)) == (value, type(value))


def test_fields_are_matched_by_name_with_the_types_of_another_version() -> None:
    """A bag of another version, or with another order of fields, is read with its own schema."""
    types = parse(
        "geometry_msgs/msg/Twist",
        "float32 novel\nVector3 linear # m/s\nuint8 FAST=1\nstring<=5 note 'none'\n===\n"
        "MSG: geometry_msgs/Vector3\nfloat64 y\nfloat64 x 1.5",
    )
    data = b"\0\1\0\0" + struct.pack("<f4xddI2s", 9.0, 2.0, 1.0, 2, b"a\0")
    assert record_reader(Twist, types)(data) == Twist(linear=Vector3(x=1.0, y=2.0))
    assert plain_reader("geometry_msgs/Twist", types)(data)["note"] == "a"


PROBE = text_of(
    "probe_msgs/Probe",
    {
        "probe_msgs/Probe": fields_in(
            "probe_msgs/Probe",
            (
                "int8 small",
                "float64 wide",
                "Inner inner",
                "Inner[] many",
                "Nil nothing",
                "Nil[2] nothings",
                "string[] words",
                "int64[] longs",
            ),
        ),
        "probe_msgs/Inner": fields_in("probe_msgs/Inner", ("int16 a", "int64 b")),
        "probe_msgs/Nil": (),
    },
)
WANTED = {
    "small": -1,
    "wide": 0.25,
    "inner": {"a": 2, "b": -3},
    "many": [{"a": 4, "b": 5}, {"a": 6, "b": 7}],
    "nothing": {},
    "nothings": [{}, {}],
    "words": ["a", ""],
    "longs": [8, 9],
}


def test_every_encapsulation_is_read_or_refused() -> None:
    """CDR of both byte orders as written by rosbags; XCDR2 assembled by the rules of DDS-XTypes 1.3, 7.4.3."""
    read = plain_reader("probe_msgs/Probe", parse("probe_msgs/Probe", PROBE))
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(PROBE, "probe_msgs/msg/Probe"))
    types = store.types
    inner, empty = types["probe_msgs/msg/Inner"], types["probe_msgs/msg/Nil"]
    probe = types["probe_msgs/msg/Probe"](
        small=-1,
        wide=0.25,
        inner=inner(a=2, b=-3),
        many=[inner(a=4, b=5), inner(a=6, b=7)],
        nothing=empty(),
        nothings=[empty(), empty()],
        words=["a", ""],
        longs=np.array([8, 9]),
    )
    for little in (True, False):
        data = bytes(store.serialize_cdr(probe, "probe_msgs/msg/Probe", little_endian=little))
        assert read(data) == WANTED, data[:2]
    inner_, words = "h2xq", "III2s2xI1s3xI2q"  # eight bytes are aligned to four
    texts = (17, 2, 2, b"a\0", 1, b"\0", 2, 8, 9)
    plain = f"b3xd{inner_}II{inner_}{inner_}B3xI2B2x{words}"
    sized = f"b3xdI{inner_}III{inner_}I{inner_}IB3xIIB3xIB3x{words}"
    bare_parts = (-1, 0.25, 2, -3, 28, 2, 4, 5, 6, 7, 0, 2, 0, 0, *texts)
    sized_parts = (-1, 0.25, 12, 2, -3, 36, 2, 12, 4, 5, 12, 6, 7, 1, 0, 13, 1, 0, 1, 0, *texts)
    for first in ("0006", "0007", "0008", "0009"):
        order = "<" if int(first, 16) % 2 else ">"
        body = struct.pack(order + plain, *bare_parts)
        if first > "0007":
            body = struct.pack(order + sized, *sized_parts)
            body = struct.pack(f"{order}I", len(body)) + body
        data = bytes.fromhex(first) + bytes(2) + body
        assert read(data) == WANTED, first
        with pytest.raises(WrongPayload, match="not a message of its type"):
            read(b"\0\1\0\0" + data[4:])
    for first, reason in (
        ("0002", r"a parameter list \(PL_CDR\)"),
        ("000b", r"a parameter list \(PL_CDR\)"),
        ("0011", "plain and delimited CDR and XCDR2 are: 0000, 0001, 0006"),
        ("28b52ffd", "individually compressed"),
        ("", "nothing is not supported"),
    ):
        with pytest.raises(WrongPayload, match=reason):
            read(bytes.fromhex(first))


class Holder(Message, frozen=True, kw_only=True):
    """A record with a member that has no fields."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/Holder"
    before: float = 0.0
    nothing: Empty = Empty()
    nothings: tuple[Empty, ...] = ()
    after: float = 0.0


def test_a_record_without_fields_takes_a_byte_wherever_it_stands() -> None:
    message = Holder(before=1.0, nothings=(Empty(),) * 3, after=2.0)
    data = writer(Holder)(message)
    assert data[4:] == struct.pack("<dB3xI3B5xd", 1.0, 0, 3, 0, 0, 0, 2.0)
    assert record_reader(Holder, definitions(Holder))(data) == message
    store, name, dynamic = independent(Holder)
    assert store.deserialize_cdr(data, name).after == dynamic(data).after == 2.0
    assert writer(Empty)(Empty()) == b"\0\1\0\0\0"
    for whole in (b"\0\1\0\0", b"\0\1\0\0\0"):
        assert record_reader(Empty, definitions(Empty))(whole) == Empty()


def test_few_bytes_never_become_many_values() -> None:
    """Fixed sizes are limited by the smallest message, and counted ones by the remaining bytes."""
    deep = "===\n".join(["", *(f"MSG: x/T{n}\nT{n + 1}[9] a\nT{n + 1}[9] b\n" for n in range(1, 12)), "MSG: x/T12\n"])
    for text, reason in (
        ("Nil[9999999999] x\n===\nMSG: x/Nil\n", "the smallest x/T has 9999999999 bytes, the limit is 67108864"),
        (f"T1[2] x\n{deep}", "the limit is 67108864"),
        ("uint8[0] x", "an array of length 0"),
        (f"uint8[{'9' * 5000}] x", "is not a field"),
    ):
        with pytest.raises(BadDefinition, match=reason):
            parse("x/T", text)
    read = plain_reader("x/T", parse("x/T", "Nil[] x\n===\nMSG: x/Nil\n"))
    with pytest.raises(WrongPayload, match=r"a length of 4294967295 with 3 bytes left"):
        read(b"\0\1\0\0\xff\xff\xff\xff\0\0\0")
    wide = plain_reader("x/T", parse("x/T", "Nil[1000000] x\n===\nMSG: x/Nil\n"))
    with pytest.raises(WrongPayload, match="1000000 of at least 1 bytes each, with 4 bytes left"):
        wide(b"\0\1\0\0\0\0\0\0")
    nested = json.dumps("x").join(("[" * 100_000, "]" * 100_000))
    data = nested.encode()
    name = b"\2\0\0\0p\0\0\0"
    value = struct.pack("<I", len(data) + 1) + data + b"\0"
    with pytest.raises(WrongPayload, match="recursion"):
        record_reader(Parameter, definitions(Parameter))(b"\0\1\0\0" + name + value)
    with pytest.raises(WrongPayload, match="the limit for decoding is"):
        read(b"\0\1" + bytes(LARGEST_READ))


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("float64 x\n4 wheels", "'4 wheels' is not a field"),
        ("Other o", "x_msgs/Other is not defined"),
        ("Self s\n===\nMSG: x_msgs/Self\nSelf s", "contains itself"),
        ("float64 x\n=====\nnothing", "expected 'MSG:"),
    ],
)
def test_a_text_that_defines_nothing_is_refused(text: str, reason: str) -> None:
    with pytest.raises(BadDefinition, match=reason):
        parse("x_msgs/T", text)


@given(data=st.binary(max_size=200), record=st.sampled_from(RECORDED))
@DETERMINISTIC
def test_any_bytes_are_read_or_refused(data: bytes, record: type[Message]) -> None:
    for read in (record_reader(record, definitions(record)), plain_reader(record.ROS_TYPE, definitions(record))):
        for each in (data, b"\0\1\0\0" + data):
            with contextlib.suppress(WrongPayload):
                read(each)


def test_values_out_of_bounds_are_refused() -> None:
    good = writer(Twist)(Twist.planar(0.1, 0.2))
    bad = good[:4] + struct.pack("<d", math.nan) + good[12:]
    with pytest.raises(WrongPayload, match=r"linear\.x"):
        record_reader(Twist, definitions(Twist))(bad)
