"""Payloads of any type as plain values, checked against the independent reader."""

from __future__ import annotations

from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.base import Float32Array, WrongPayload, encode
from messages.geometry import PoseWithCovariance
from messages.plain import plain, plain_record
from messages.records import RECORDS
from messages.sensor import LaserScan
from tests.harness.cases import case

SCALARS = st.none() | st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False) | st.text()
VALUES = st.recursive(
    SCALARS | st.binary(), lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=20
)


def packed(array: np.ndarray) -> msgpack.ExtType:
    return msgpack.ExtType(1, msgpack.packb([array.dtype.str, list(array.shape), array.tobytes()]))


@pytest.mark.slow
@given(VALUES)
def test_what_messagepack_holds_is_shown(value: Any) -> None:
    assert plain(msgpack.packb(value)) == value


def test_arrays_are_lists_by_their_shape() -> None:
    for dtype in ("<f4", "<f8", ">f8", "<f2", "|i1", "|u1", "<i2", ">u2", "<i4", "<u8", "|b1"):
        for shape in ((), (4,), (2, 2), (2, 1, 2)):
            array = np.arange(4)[: int(np.prod(shape))].reshape(shape).astype(dtype)
            assert plain(msgpack.packb({"grid": packed(array)})) == {"grid": array.tolist()}, (dtype, shape)


def test_an_array_without_values_takes_no_room() -> None:
    huge = msgpack.ExtType(1, msgpack.packb(["<f8", [2**28, 0], b""]))
    assert plain(msgpack.packb(huge)) == []


@pytest.mark.parametrize(
    "data",
    [
        b"",
        msgpack.packb(["<c8", [1], bytes(8)]),
        msgpack.packb(["<f8", [2], bytes(8)]),
        msgpack.packb(["<f8", [-1], bytes(8)]),
        msgpack.packb(["<f8", [1, 1, 1, 1], bytes(8)]),
        msgpack.packb("x"),
    ],
)
def test_extensions_that_are_no_arrays_are_shown_as_they_are(data: bytes) -> None:
    assert plain(msgpack.packb(msgpack.ExtType(1, data))) == {"extension": 1, "data": data}
    assert plain(msgpack.packb([msgpack.ExtType(9, data)])) == [{"extension": 9, "data": data}]


@pytest.mark.parametrize("payload", [b"", b"\xc1", b"\x91" * 100_000, b"\x01\x02", b"\x92\x01"])
def test_what_is_no_messagepack_is_refused(payload: bytes) -> None:
    with pytest.raises(WrongPayload):
        plain(payload)


def test_a_record_shows_its_fields_by_their_names_on_the_wire() -> None:
    for name, kind in RECORDS.items():
        with case(name):
            on_the_wire = msgpack.unpackb(encode(kind()), ext_hook=lambda code, data: None)
            assert list(plain_record(kind())) == list(on_the_wire)


def test_packed_fields_are_numbers() -> None:
    assert plain_record(PoseWithCovariance())["covariance"] == [0.0] * 36
    assert plain_record(LaserScan(ranges=Float32Array([1.5, 2.5])))["ranges"] == [1.5, 2.5]
    assert plain(msgpack.packb({1: 2, "t": msgpack.Timestamp(0, 0)})) == {"1": 2, "t": "1970-01-01 00:00:00+00:00"}
