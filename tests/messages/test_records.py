"""Every record is unchanged by a round trip through our codec and an independent MessagePack library."""

import json
from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import given

from messages.base import Message, decoder, encode
from messages.interfaces.records import GeneratedMessage, need_record
from messages.records import RECORDS, UnknownRecord
from tests.harness.cases import case
from tests.messages.strategies import FEW, plain, struct, unpack, values, write_array


def same(ours: Any, theirs: Any) -> bool:
    """Whether plain values are equal: arrays in type, shape and bytes, numbers also in type."""
    if isinstance(ours, dict):
        return list(ours) == list(theirs) and all(same(ours[name], theirs[name]) for name in ours)
    if isinstance(ours, list):
        return len(ours) == len(theirs) and all(map(same, ours, theirs))
    if isinstance(ours, np.ndarray):
        return bool(ours.dtype == theirs.dtype and ours.shape == theirs.shape and ours.tobytes() == theirs.tobytes())
    return bool(ours == theirs) and type(ours) is type(theirs)


@pytest.mark.slow
def test_a_record_survives_both_codecs() -> None:
    for name, kind in RECORDS.items():
        with case(name):
            _check_both_codecs(kind)


def _check_both_codecs(kind: type[Message]) -> None:
    @FEW
    @given(values(kind))
    def check(value: Message) -> None:
        payload = encode(value)
        assert decoder(kind)(payload) == value
        seen = unpack(payload)
        assert same(plain(value), seen)
        assert decoder(kind)(msgpack.packb(seen, default=write_array)) == value

    check()


def test_an_empty_map_is_the_record_of_defaults() -> None:
    for name, kind in RECORDS.items():
        with case(name):
            assert decoder(kind)(b"\x80") == kind()


def test_each_record_has_a_type_of_its_own_and_says_what_it_is() -> None:
    for name, kind in RECORDS.items():
        with case(name):
            package, _, own = vars(kind)["ROS_TYPE"].partition("/")
            assert package.endswith(("_msgs", "_srvs", "_interfaces")) or package == "turtlesim"
            assert own == kind.__name__
            assert kind.__doc__
            with pytest.raises(AttributeError, match="immutable"):
                setattr(kind(), struct(kind).fields[0].name if struct(kind).fields else "x", None)


def of_the_bus(module: str) -> bool:
    """Whether a module's records occur on the bus; those of ``messages.cdr`` occur only in bags, and
    ``messages.records`` makes some that stand for unknown types.
    """
    return module.startswith("messages.") and not module.startswith(("messages.cdr.", "messages.records"))


def test_the_table_has_every_record() -> None:
    def below(parent: type[Message]) -> set[type[Message]]:
        children = {child for child in parent.__subclasses__() if of_the_bus(child.__module__)} - {GeneratedMessage}
        return children.union(*map(below, children)) if children else set()

    assert set(RECORDS.values()) == below(Message)
    assert json.dumps(sorted(RECORDS))


def test_the_records_that_ros_users_expect_are_there() -> None:
    expected = {
        "std_msgs": "String Bool Float32 Float64 Header Empty",
        "geometry_msgs": "Vector3 Quaternion Point Point32 Pose PoseStamped PoseWithCovariance Twist TwistStamped"
        " TwistWithCovariance Transform TransformStamped",
        "nav_msgs": "Odometry Path",
        "sensor_msgs": "JointState LaserScan Range PointCloud ChannelFloat32 Imu Image CameraInfo",
        "tf2_msgs": "TFMessage",
        "rosgraph_msgs": "Clock Log",
        "diagnostic_msgs": "DiagnosticArray",
    }
    assert {f"{package}/{name}" for package, names in expected.items() for name in names.split()} <= RECORDS.keys()


def test_a_record_is_found_by_its_name_and_a_wrong_name_gets_the_nearest() -> None:
    twist = RECORDS["geometry_msgs/Twist"]
    assert need_record("geometry_msgs/Twist") is need_record("geometry_msgs/msg/Twist") is twist
    with pytest.raises(UnknownRecord, match=r"'geometry_msgs/Twits'; did you mean 'geometry_msgs/Twist' or "):
        need_record("geometry_msgs/Twits")
    with pytest.raises(UnknownRecord, match=r"unknown record '42'$"):
        need_record("42")
