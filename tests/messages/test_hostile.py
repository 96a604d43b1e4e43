"""Payloads made to break a decoder cost little and raise nothing but WrongPayload."""

import random
import struct
import tracemalloc

import msgpack
import pytest

from messages.base import Message, WrongPayload, decoder
from messages.records import RECORDS
from tests.messages import strategies
from tests.messages.payload_mutations import filled_payload

HOSTED = ("geometry_msgs/Twist", "nav_msgs/Odometry", "sensor_msgs/LaserScan", "elea_msgs/Health", "tf2_msgs/TFMessage")
SOME_RECORDS = pytest.mark.parametrize("kind", [RECORDS[name] for name in HOSTED], ids=HOSTED)
ENDLESS = struct.pack(">I", 2**32 - 1)
DEEP = 100_000


def outcome(kind: type[Message], payload: bytes) -> str:
    try:
        decoder(kind)(payload)
    except WrongPayload:
        return "refused"
    return "taken"


@SOME_RECORDS
def test_random_bytes_never_raise_anything_else(kind: type[Message]) -> None:
    chance = random.Random(20)
    outcomes = {outcome(kind, chance.randbytes(chance.randrange(1, 60))) for _ in range(3000)}
    assert "refused" in outcomes


@SOME_RECORDS
def test_damaged_payloads_never_raise_anything_else(kind: type[Message]) -> None:
    chance = random.Random(21)
    whole = msgpack.packb(filled_payload(strategies.struct(kind)))
    outcomes = set()
    for _ in range(3000):
        damaged = bytearray(whole)
        for _ in range(chance.randrange(1, 5)):
            damaged[chance.randrange(len(damaged))] = chance.randrange(256)
        outcomes.add(outcome(kind, bytes(damaged)))
    assert outcomes == {"refused", "taken"}


@pytest.mark.parametrize(
    ("type_name", "field", "head"),
    [
        ("nav_msgs/Path", "poses", b"\xdd"),
        ("sensor_msgs/JointState", "position", b"\xdd"),
        ("sensor_msgs/LaserScan", "ranges", b"\xdd"),
        ("sensor_msgs/LaserScan", "ranges", b"\xc9"),
        ("sensor_msgs/Image", "data", b"\xc6"),
        ("std_msgs/String", "data", b"\xdb"),
        ("std_msgs/Header", "stamp", b"\xdf"),
        ("std_msgs/Header", "unknown", b"\xdd"),
        ("std_msgs/Header", "unknown", b"\xdf"),
    ],
)
def test_a_huge_declared_length_costs_no_memory(type_name: str, field: str, head: bytes) -> None:
    payload = b"\x81" + msgpack.packb(field) + head + ENDLESS + b"\x01"
    tracemalloc.start()
    try:
        assert outcome(RECORDS[type_name], payload) == "refused"
        assert tracemalloc.get_traced_memory()[1] < 1 << 20
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("nest", [b"\x91", b"\x81\xa1x", b"\x81\x01"], ids=["lists", "maps", "integer keys"])
@pytest.mark.parametrize("field", ["ranges", "header", "unknown"])
def test_deep_nesting_is_refused(field: str, nest: bytes) -> None:
    payload = b"\x81" + msgpack.packb(field) + nest * DEEP + b"\x01"
    assert outcome(RECORDS["sensor_msgs/LaserScan"], payload) == "refused"


@SOME_RECORDS
def test_what_is_no_map_of_fields_is_refused(kind: type[Message]) -> None:
    for payload in (b"", b"\xc1", b"\xc0", b"\x90", b"\x01", b"\xa1x", b"{}", b"\x81\x01\x01", b"\xff"):
        assert outcome(kind, payload) == "refused", payload


def test_text_that_is_not_utf_8_is_refused() -> None:
    assert outcome(RECORDS["std_msgs/String"], b"\x81\xa4data\xa2\xff\xfe") == "refused"
