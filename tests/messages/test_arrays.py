"""Arrays and numpy numbers on the wire."""

import math
from collections.abc import Sequence
from typing import Any

import msgpack
import numpy as np
import pytest

from messages import base
from messages.base import Float32Array, Float64Array, WrongPayload, covariance, decoder, encode, unpack36
from messages.geometry import Twist, Vector3
from messages.sensor import ChannelFloat32, JointState, LaserScan, Range
from tests.messages.strategies import unpack

decode = decoder(LaserScan)
RAW = bytes(8)


def extension(*parts: Any, code: int = 1) -> bytes:
    payload: bytes = msgpack.packb({"ranges": msgpack.ExtType(code, msgpack.packb(parts))})
    return payload


def test_an_array_keeps_the_values_of_any_iterable() -> None:
    for values in ([1, 2.5], (1.0, 2.5), np.array([1, 2.5]), np.array([9.0, 1.0, 9.0, 2.5])[1::2], iter((1, 2.5))):
        assert Float32Array(values).tolist() == [1.0, 2.5]
    assert Float64Array([1 / 3]).tolist() == [1 / 3]
    assert Float64Array([]) != Float32Array([])
    assert len({Float64Array([1]), Float64Array([1.0])}) == 1


def test_no_echo_and_no_reading_travel() -> None:
    seen = decode(encode(LaserScan(ranges=Float32Array([math.inf, math.nan, 1.5])))).ranges.tolist()
    assert seen[0] == math.inf
    assert math.isnan(seen[1])
    assert seen[2] == 1.5


def test_numpy_sees_the_shape_and_may_not_write_into_a_record() -> None:
    square = Float64Array(np.arange(6.0).reshape(2, 3))
    assert square.numpy().tolist() == [[0, 1, 2], [3, 4, 5]]
    assert len(square) == 2
    assert not square.numpy().flags.writeable
    copy = np.array(square)
    copy[0, 0] = 7
    assert square.tolist()[0] == 0
    assert np.asarray(square, np.float32).dtype == np.float32


def test_a_plain_list_is_taken_as_an_array() -> None:
    assert decode(msgpack.packb({"ranges": [1, 2.5]})).ranges == Float32Array([1, 2.5])


@pytest.mark.parametrize("ranges", [[0.5, 1.0], (0.5, 1.0), np.array([0.5, 1.0]), Float32Array([0.5, 1.0])])
def test_a_program_builds_a_scan_of_any_sequence(ranges: Any) -> None:
    scan = LaserScan(ranges=ranges, intensities=ranges)
    assert scan.ranges == scan.intensities == Float32Array([0.5, 1.0])
    assert decode(encode(scan)) == scan
    assert ChannelFloat32(values=ranges).values == scan.ranges
    with pytest.raises(TypeError):
        LaserScan(ranges=["near"])  # type: ignore[arg-type]


def test_numpy_numbers_are_sent_as_plain_ones() -> None:
    twist = Twist.planar(np.float64(0.1), np.float32(0.5))  # type: ignore[arg-type]
    assert unpack(encode(twist)) == unpack(encode(Twist.planar(0.1, 0.5)))
    joints = JointState(name=("a", "b"), position=np.array([1.0, 2.0]))  # type: ignore[arg-type]
    assert decoder(JointState)(encode(joints)).position == (1.0, 2.0)
    with pytest.raises(NotImplementedError, match="complex cannot be put in a message"):
        encode(Vector3(x=1j))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("payload", "says"),
    [
        (extension("<f4", [2], RAW, code=2), "unknown extension type 2; only 1"),
        (extension("<f8", [1], RAW), "expected an array of <f4, got <f8"),
        (extension(">f4", [2], RAW), "got >f4"),
        (extension("O", [1], RAW), "got O"),
        (extension("<f4", [3], RAW), r"8 bytes are not an array of <f4 of shape \(3,\)"),
        (extension("<f4", [-2], RAW), r"the shape \(-2,\)"),
        (extension("<f4", [2, 2**63], RAW), "the shape"),
        (extension("<f4", [0, 2**28, 2**28], b""), "at most 268435456 values"),
        (extension("<f4", [1] * 900, RAW[:4]), "at most 3 dimensions, got 900"),
        (extension("<f4", [1, 2], RAW), "flat"),
        (extension("<f4", [], RAW[:4]), "flat"),
        (extension("<f4", [2.0], RAW), "Expected `int`, got `float`"),
        (extension("<f4", 2, RAW), "Expected `array`, got `int`"),
        (extension("<f4", [2], "text"), "Expected `bytes`"),
        (extension("<f4", [2]), "of length 3"),
        (extension("<f4", [2], RAW, 0), "of length 3"),
        (extension(), "of length 3"),
        (msgpack.packb({"ranges": msgpack.ExtType(1, b"")}), "truncated"),
        (msgpack.packb({"ranges": msgpack.ExtType(1, b"\x91" * 90_000)}), "Expected"),
        (msgpack.packb({"ranges": msgpack.Timestamp(1, 2)}), "expected an array, got datetime"),
    ],
    ids=lambda part: part if isinstance(part, str) else "",
)
def test_a_wrong_extension_is_refused(payload: bytes, says: str) -> None:
    with pytest.raises(WrongPayload, match=says):
        decode(payload)


def test_a_covariance_has_its_variances_on_the_diagonal() -> None:
    assert np.array_equal(np.reshape(unpack36(covariance(1, 2, 3, 4, 5, 6)), (6, 6)), np.diag([1, 2, 3, 4, 5, 6]))
    with pytest.raises(ValueError, match="6 values, got 2"):
        covariance(1, 2)


def test_an_array_is_a_sequence() -> None:
    values = [3.0, 0.5, 2.0, 0.5]
    for array in (Float32Array(values), decode(encode(LaserScan(ranges=Float32Array(values)))).ranges):
        assert isinstance(array, Sequence)
        assert [*array] == values
        assert [*reversed(array)] == values[::-1]
        assert array == values
        assert array == tuple(values)
        assert array != values[:3]
        assert array != "text"
        assert (len(array), min(array), max(array), sum(array), sorted(array)[0]) == (4, 0.5, 3.0, 6.0, 0.5)
        assert (array[0], array[-1], array[np.int64(2)]) == (3.0, 0.5, 2.0)
        for part in (slice(1, 3), slice(None, None, -1), slice(0, 9, 2), slice(2, 2)):
            assert array[part] == Float32Array(values[part])
        assert 2.0 in array
        assert 1.0 not in array
        assert (array.index(0.5), array.count(0.5)) == (1, 2)
        for index in (4, -5):
            with pytest.raises(IndexError):
                array[index]
        with pytest.raises(ValueError, match="not in the array"):
            array.index(9.0)
        assert np.asarray(array).tolist() == values
        assert np.shares_memory(np.asarray(array), np.frombuffer(array.raw, "<f4"))
        assert np.min(array) == 0.5
    square = Float64Array(range(6), shape=(2, 3))
    assert [row.tolist() for row in square] == [[0, 1, 2], [3, 4, 5]]
    assert square[1] == [3.0, 4.0, 5.0]
    assert square[::-1] == Float64Array([3, 4, 5, 0, 1, 2], shape=(2, 3))
    with pytest.raises(IndexError):
        square[2]
    for empty in (Float32Array(), Float32Array([])[1:]):
        assert ([*empty], len(empty), empty) == ([], 0, [])


def test_one_sound_array_vouches_for_no_other() -> None:
    """Validated arrays are recognised by their first bytes; another size, type, shape or code is validated again."""
    sound = extension("<f4", [2], RAW)
    for _ in range(3):
        assert decode(sound).ranges == [0.0, 0.0]
        for wrong in (
            extension("<f4", [2], RAW, code=2),
            extension("<i4", [2], RAW),
            extension("<f4", [3], RAW),
            extension("<f4", [2], RAW[:-1]),
            extension("<f4", [2], RAW + b"x"),
            sound[:-1],
        ):
            with pytest.raises(WrongPayload):
                decode(wrong)
    for size in range(200):
        assert len(decode(extension("<f4", [size], bytes(4 * size))).ranges) == size
    assert len(base._HEADS) <= base._MOST_HEADS


def test_a_list_of_other_things_than_numbers_is_no_array() -> None:
    for wrong in ([True], [1.0, "2"], [None], [[1.0]], {}, "1"):
        with pytest.raises(WrongPayload, match="expected an array"):
            decode(msgpack.packb({"ranges": wrong}))


def test_an_effort_that_nobody_measures_and_a_reading_that_is_none_travel() -> None:
    joints = decoder(JointState)(encode(JointState(name=("a", "b"), effort=(math.nan, 1.0))))
    assert math.isnan(joints.effort[0])
    for part in ("position", "velocity"):
        with pytest.raises(WrongPayload, match=part):
            decoder(JointState)(msgpack.packb({"name": ["a"], part: [math.nan]}))
    for reading in (math.nan, math.inf, -math.inf):
        said = decoder(Range)(encode(Range(range=reading))).range
        assert said == reading or (math.isnan(said) and math.isnan(reading))
