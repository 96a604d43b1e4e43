"""Field paths: their syntax, the fields of types and messages, and listing of leaves."""

from __future__ import annotations

import pytest

from messages.base import Float32Array, covariance
from messages.geometry import Pose
from messages.nav import Odometry
from messages.plain import plain_record
from messages.sensor import LaserScan
from messages.tf import TFMessage
from services.runtime.errors import BadInput
from services.runtime.field_path import (
    MAX_DEPTH,
    check_path,
    child,
    complete_path,
    format_path,
    get_field,
    leaves,
    parse_path,
)

ODOMETRY = plain_record(Odometry())


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("pose.pose.position", {"x": 0.0, "y": 0.0, "z": 0.0}),
        ("pose/pose/position/x", 0.0),
        ("pose.covariance[35]", 0.0),
        ("pose.covariance.-1", 0.0),
    ],
)
def test_paths(path: str, value: object) -> None:
    steps = parse_path(path)
    check_path(Odometry, steps)
    assert get_field(ODOMETRY, steps) == value


@pytest.mark.parametrize(
    ("path", "said"),
    [
        ("pose.poze", "unknown field 'poze'; did you mean 'pose'"),
        ("pose.pose.position.x.y", "a single value has no element"),
        ("pose.covariance.x", "selected by its index"),
        ("pose..x", "is not a field path"),
        ("", "is not a field path"),
        ("a[", "is not a field path"),
    ],
)
def test_bad_paths(path: str, said: str) -> None:
    with pytest.raises(BadInput, match=said.replace("[", r"\[")):
        check_path(Odometry, parse_path(path))


def test_bad_paths_in_messages_of_unknown_types() -> None:
    for path, said in (
        ("b", "unknown field 'b'"),
        ("a[3]", "there are 2 elements"),
        ("a[0].x", "a single value has no element"),
    ):
        with pytest.raises(BadInput, match=said):
            get_field({"a": [1, 2]}, parse_path(path))


def test_paths_are_completed_a_step_at_a_time() -> None:
    assert complete_path(Odometry, "") == ["header", "child_frame_id", "pose", "twist"]
    assert complete_path(Odometry, "pose.pose.p") == ["pose.pose.position", "pose.pose.orientation"]
    assert "transforms.0.header" in complete_path(TFMessage, "transforms.0.")
    assert complete_path(Odometry, "nothing.x") == []


@pytest.mark.parametrize("path", ["", "a..b", "a[", "a[x]", "a[1", "a]b", ".".join("abcdefgh" * 5)])
def test_what_is_no_path(path: str) -> None:
    with pytest.raises(BadInput):
        parse_path(path)


def test_records_and_plain_values_are_read_alike() -> None:
    scan = LaserScan(ranges=Float32Array([0.5, 1.5, 2.5]))
    for path, value in (("ranges[1]", 1.5), ("ranges[-1]", 2.5), ("header.frame_id", "")):
        assert get_field(scan, parse_path(path)) == get_field(plain_record(scan), parse_path(path)) == value
    assert dict(leaves(scan)) == dict(leaves(plain_record(scan)))
    assert child(covariance(1, 2, 3, 4, 5, 6), -1) == 6
    with pytest.raises(BadInput, match="unknown field '__class__'"):
        get_field(scan, parse_path("__class__"))


def test_every_leaf_is_reached_by_its_path() -> None:
    for message in (Pose.planar(1, 2, 3), plain_record(TFMessage()), {"a": [{"0": True}, [1, 2]]}):
        for path, value in leaves(message):
            assert get_field(message, parse_path(path)) == value
            assert parse_path(format_path(parse_path(path))) == parse_path(path)


def test_long_lists_and_deep_values_end() -> None:
    assert dict(leaves({"a": [1] * 9, "b": [2]}, max_elements=2)) == {"a[0]": 1, "a[1]": 1, "b[0]": 2}
    assert dict(leaves({"a": [1] * 9, "b": [2]}, max_elements=2, lengths=True)) == {"a.length": 9, "b[0]": 2}
    deep: object = 1
    for _ in range(10 * MAX_DEPTH):
        deep = [deep]
    ((path, _),) = leaves(deep)
    assert path == "[0]" * MAX_DEPTH
