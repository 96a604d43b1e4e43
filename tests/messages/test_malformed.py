"""A malformed payload is rejected as a whole, with the path of the fault."""

import math
import re
from typing import Any

import msgpack
import msgspec.inspect as kinds
import pytest

from messages.base import Message, WrongPayload, decoder
from messages.parameters import Assignment, Value
from messages.records import RECORDS
from tests.harness.cases import case
from tests.messages.payload_mutations import filled_payload, mutation_points
from tests.messages.strategies import bare, struct

TRUNCATED = (
    "geometry_msgs/Twist",
    "sensor_msgs/LaserScan",
    "nav_msgs/Path",
    "elea_msgs/Parameter",
    "tf2_msgs/TFMessage",
)
"""Records that together have every kind of field: numbers, texts, arrays, lists, maps, a value of any type."""
EXT = msgpack.ExtType(7, b"x")
WRONG: dict[type[kinds.Type], tuple[Any, ...]] = {
    kinds.FloatType: ("x", b"x", True, None, [], {}, EXT),
    kinds.IntType: ("x", b"x", 1.0, 1.5, True, None, [], {}, EXT),
    kinds.BoolType: ("x", b"x", 0, 1, 1.0, None, [], {}, EXT),
    kinds.StrType: (b"x", 1, 1.5, True, None, [], {}, EXT),
    kinds.BytesType: (1, 1.5, True, None, [], {}, EXT),
    kinds.LiteralType: ("nonsense", b"x", 1, True, None, [], {}, EXT),
    kinds.NoneType: ("x", b"x", 0, 1, 1.5, True, [], {}, EXT),
    kinds.ExtType: ("x", b"x", 1, 1.5, True, None, [], {}, EXT),
    kinds.StructType: ("x", b"x", 1, 1.5, True, None, [], EXT),
    kinds.VarTupleType: ("x", b"x", 1, 1.5, True, None, [], {}, EXT),
    kinds.CustomType: ("x", b"x", 1, 1.5, True, None, {}, ["x"], [[1.0]], [True], EXT),
}


def refusal(kind: type[Message], payload: bytes) -> str:
    with pytest.raises(WrongPayload) as caught:
        decoder(kind)(payload)
    return str(caught.value)


def at(path: str) -> str:
    """Return the suffix by which an error names a path; none for the payload as a whole."""
    return "" if path == "$" else f" - at `{path}`"


def whole(kind: type[Message]) -> bytes:
    payload: bytes = msgpack.packb(filled_payload(struct(kind)))
    decoder(kind)(payload)  # the payload itself is valid
    return payload


def test_every_truncation_is_refused() -> None:
    for name in TRUNCATED:
        with case(name):
            kind = RECORDS[name]
            payload = whole(kind)
            for end in range(len(payload)):
                assert "truncated" in refusal(kind, payload[:end])


def test_trailing_bytes_are_refused() -> None:
    for name, kind in RECORDS.items():
        with case(name):
            assert "trailing" in refusal(kind, whole(kind) + b"\x00")


def test_a_wrong_type_is_refused_at_every_spot() -> None:
    for name, kind in RECORDS.items():
        with case(name):
            whole(kind)
            for spot in mutation_points(kind):
                for wrong in _wrong(spot.kind):
                    text = refusal(kind, msgpack.packb(spot.with_value(wrong)))
                    assert text.endswith(at(spot.path)) or named_by_its_owner(text, spot.path), (spot.path, wrong, text)


def _wrong(kind: kinds.Type) -> list[Any]:
    """Return values of wrong types; for a union, those that all of its types reject."""
    if isinstance(kind, kinds.UnionType):
        first, *others = (_wrong(bare(each)) for each in kind.types)
        return [each for each in first if all(any(_alike(each, one) for one in other) for other in others)]
    free = isinstance(kind, kinds.VarTupleType) and not kind.min_length
    return [each for each in WRONG[type(kind)] if not (free and each == [])]


def _alike(one: Any, other: Any) -> bool:
    return type(one) is type(other) and bool(one == other)


def test_what_is_wrong_for_a_union_is_wrong_for_all_of_its_types() -> None:
    """Tests the generator: a parameter's value allows almost any type, but not all."""
    value, maybe = (kinds.type_info(each) for each in (Value, float | None))
    assert _wrong(value) == [b"x", {}, EXT]
    assert _wrong(maybe) == ["x", b"x", True, [], {}, EXT]
    assert any(spot.path.endswith("value[0][0]") for spot in mutation_points(Assignment))


def named_by_its_owner(text: str, path: str) -> bool:
    """Whether an error of a packed field names the field, then the path of its record."""
    owner, _, field = path.rpartition(".")
    return text.startswith(f"{field}: ") and text.endswith(at(owner))


def test_numbers_beyond_their_bounds_are_refused() -> None:
    for name, kind in RECORDS.items():
        with case(name):
            for spot in mutation_points(kind):
                for beyond in _beyond(spot.kind):
                    assert refusal(kind, msgpack.packb(spot.with_value(beyond))).endswith(at(spot.path)), (
                        spot.path,
                        beyond,
                    )


def _beyond(kind: kinds.Type) -> list[float]:
    """Return numbers out of bounds that MessagePack can encode; for a union, out of each of its types' bounds."""
    kind = bare(kind)
    if isinstance(kind, kinds.UnionType):
        return [each for one in kind.types for each in _beyond(one)]
    if isinstance(kind, kinds.FloatType) and kind.ge is not None and kind.le is not None:
        return [math.nan, math.inf, -math.inf, math.nextafter(kind.le, math.inf), math.nextafter(kind.ge, -math.inf)]
    if isinstance(kind, kinds.IntType) and kind.ge is not None:
        high = kind.lt if kind.lt is not None else kind.le + 1 if kind.le is not None else None
        return [each for each in (kind.ge - 1, high) if each is not None and -(2**63) <= each < 2**64]
    return []


def test_what_moves_a_robot_is_finite() -> None:
    movers = [spot for name in ("Twist", "Pose") for spot in mutation_points(RECORDS[f"geometry_msgs/{name}"])]
    floats = [spot.kind for spot in movers if isinstance(spot.kind, kinds.FloatType)]
    assert len(floats) == 6 + 7
    assert all(_beyond(kind) for kind in floats)


def test_unknown_fields_are_ignored_at_every_level() -> None:
    for name, kind in RECORDS.items():
        with case(name):
            expected = decoder(kind)(whole(kind))
            more = {"of_a_newer_sender": {"deep": [1, None, EXT]}}
            for spot in mutation_points(kind):
                if isinstance(spot.kind, kinds.StructType):
                    assert decoder(kind)(msgpack.packb(spot.with_value(filled_payload(spot.kind) | more))) == expected


def test_fixed_lengths_are_kept() -> None:
    for name, kind in RECORDS.items():
        with case(name):
            for spot in mutation_points(kind):
                if isinstance(spot.kind, kinds.VarTupleType) and spot.kind.min_length is not None:
                    assert spot.kind.min_length == spot.kind.max_length
                    for length in (0, spot.kind.min_length - 1, spot.kind.min_length + 1):
                        refused = refusal(kind, msgpack.packb(spot.with_value([0.0] * length)))
                        assert re.search(rf"of length [<>]= {spot.kind.min_length}", refused)
                        assert refused.endswith(at(spot.path))


@pytest.mark.parametrize(
    ("type_name", "payload", "says"),
    [
        ("sensor_msgs/JointState", {"name": ["a"], "effort": [1.0, 2.0]}, "effort has 2 values for 1 joint names"),
        ("sensor_msgs/Image", {"height": 2, "step": 3, "data": b"12345"}, "5 bytes, but 2 rows of 3 bytes need 6"),
        ("sensor_msgs/LaserScan", {"ranges": [1.0, 2.0], "intensities": [1.0]}, "of equal length"),
        (
            "sensor_msgs/PointCloud",
            {"points": [{}, {}], "channels": [{"name": "range", "values": [1.0]}]},
            r"channel 'range' has the shape \(1,\), 2 points need one value each",
        ),
    ],
)
def test_fields_that_contradict_each_other_are_refused(type_name: str, payload: Any, says: str) -> None:
    assert re.search(says.replace("$.", r"\$\."), refusal(RECORDS[type_name], msgpack.packb(payload)))
