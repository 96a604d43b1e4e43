"""Messages and times behave as in ROS 1, compared with output and errors of real rospy, line by line."""

from __future__ import annotations

import copy
import io
import pickle
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.harness.cases import case
from tests.harness.ros1 import ros1_imports


@pytest.fixture(scope="module")
def ros() -> Iterator[Any]:
    """The names that the tests use, as a script imports them."""
    names: dict[str, Any] = {}
    with ros1_imports():
        exec(
            "import genpy\n"
            "from geometry_msgs.msg import *\n"
            "from std_msgs.msg import *\n"
            "from sensor_msgs.msg import LaserScan, JointState, Image, Imu, CameraInfo\n"
            "from nav_msgs.msg import Odometry\n"
            "from std_srvs.srv import SetBool, SetBoolRequest, SetBoolResponse\n"
            "from actionlib_tutorials.msg import FibonacciAction, FibonacciGoal\n"
            "from genpy import Time as T, Duration as D\n",
            names,
        )
        yield SimpleNamespace(**{name: each for name, each in names.items() if not name.startswith("__")})


def outcome(do: Callable[[], Any]) -> str:
    """Return a call's result or exception as one line of text."""
    try:
        given = do()
    except Exception as error:  # noqa: BLE001 - it is what is compared
        return f"!! {type(error).__name__}: {error}"
    return given if isinstance(given, str) else repr(given)


def sent(message: Any) -> Any:
    """Return a message after ROS 1's binary format; assert that Elea's bus gives the same."""
    import genpy

    buffer = io.BytesIO()
    message.serialize(buffer)
    read = type(message)().deserialize(buffer.getvalue())
    assert str(genpy.decode(type(message), genpy.encode(message))) == str(read)
    return read


def check(ros: Any, expected: dict[str, str]) -> None:
    names = {**vars(ros), "rt": sent, "np": np}
    for expression, wanted in expected.items():
        with case(expression):
            assert outcome(lambda expression=expression: eval(expression, names)) == wanted


def test_times(ros: Any) -> None:
    check(
        ros,
        {
            "T()": "genpy.Time[0]",
            "T(1.5)": "genpy.Time[1500000000]",
            "T(1, 5)": "genpy.Time[1000000005]",
            "T.from_sec(1.25)": "genpy.Time[1250000000]",
            "D(0.1)": "genpy.Duration[100000000]",
            "D.from_sec(-0.5)": "genpy.Duration[-500000000]",
            "T(3)-T(1.5)": "genpy.Duration[1500000000]",
            "T(1)+D(2)": "genpy.Time[3000000000]",
            "D(1)*2": "genpy.Duration[2000000000]",
            "D(2)/4": "genpy.Duration[500000000]",
            "D(3)/D(2)": "1.5",
            "D(7)//D(2)": "3",
            "D(7)%D(2)": "genpy.Duration[1000000000]",
            "divmod(D(7), D(2))": "(3, genpy.Duration[1000000000])",
            "-D(1)": "genpy.Duration[-1000000000]",
            "abs(D(-1))": "genpy.Duration[1000000000]",
            "T(1.5).to_sec()": "1.5",
            "T(1.5).to_nsec()": "1500000000",
            "str(T(1,5))": "1000000005",
            "T(1)<T(2)": "True",
            "T()==0": "False",
            "bool(T())": "False",
            "T().is_zero()": "True",
            "T(1.5).secs": "1",
            "T(1.5).nsecs": "500000000",
            "T(1.5, 3)": "!! ValueError: if secs is a float, nsecs cannot be set",
            "T(-1)": "!! TypeError: time values must be positive",
            "T(1)-D(2)": "!! TypeError: time values must be positive",
            "D(1)<2": "!! TypeError: '<' not supported between instances of 'Duration' and 'int'",
            "int(D(1.9).to_sec())": "1",
            "T(1)+T(1)": "!! TypeError: unsupported operand type(s) for +: 'Time' and 'Time'",
            "D('1')": "!! TypeError: unsupported operand type(s) for -: 'str' and 'int'",
            "hash(T(1,2)) == hash(T(1,2))": "True",
        },
    )


def test_messages_are_made_and_shown(ros: Any) -> None:
    stamp = "header: \n  seq: 0\n  stamp: \n    secs: 0\n    nsecs:         0\n  frame_id: ''\n"
    figures = "angle_min", "angle_max", "angle_increment", "time_increment", "scan_time", "range_min", "range_max"
    scan = "".join(f"{name}: 0.0\n" for name in figures)
    check(
        ros,
        {
            "str(Twist())": "linear: \n  x: 0.0\n  y: 0.0\n  z: 0.0\nangular: \n  x: 0.0\n  y: 0.0\n  z: 0.0",
            "repr(Vector3(1,2,3))": "x: 1\ny: 2\nz: 3",
            "str(Quaternion())": "x: 0.0\ny: 0.0\nz: 0.0\nw: 0.0",
            "str(Header(3, T(1, 5), 'odom'))": 'seq: 3\nstamp: \n  secs: 1\n  nsecs:         5\nframe_id: "odom"',
            "str(String('a'))": 'data: "a"',
            "str(String('a: b'))": 'data: "a: b"',
            "str(LaserScan(ranges=[1.0, float('inf'), 2.5]))": f"{stamp}{scan}ranges: [1.0, inf, 2.5]\nintensities: []",
            "str(JointState(name=['a'], position=[1]))": (
                f"{stamp}name: \n  - a\nposition: [1]\nvelocity: []\neffort: []"
            ),
            "Vector3(1,2)": "!! TypeError: Invalid number of arguments, args should be ['x', 'y', 'z'] args are(1, 2)",
            "Vector3([1,2,3])": (
                "!! TypeError: Invalid number of arguments, args should be ['x', 'y', 'z'] args are([1, 2, 3],)"
            ),
            "Vector3(q=1)": "!! AttributeError: q is not an attribute of Vector3",
            "Vector3(1, y=2)": "!! TypeError: Message constructor may only use args OR keywords, not both",
            "Vector3(x=1)": "x: 1\ny: 0.0\nz: 0.0",
            "Twist._type, Twist._md5sum": "('geometry_msgs/Twist', '9f195f881246fdfa2798d1d3eebca84a')",
            "Odometry.__slots__": "['header', 'child_frame_id', 'pose', 'twist']",
            "Odometry._slot_types": (
                "['std_msgs/Header', 'string', 'geometry_msgs/PoseWithCovariance', 'geometry_msgs/TwistWithCovariance']"
            ),
            "Twist() == Twist()": "True",
            "hash(Twist())": "!! TypeError: unhashable type: 'Twist'",
            "Image().data, UInt8MultiArray().data, Odometry().pose.covariance": f"(b'', b'', {[0.0] * 36})",
            "Imu.__module__": "sensor_msgs.msg._Imu",
            "SetBool._type, SetBool._request_class.__name__": "('std_srvs/SetBool', 'SetBoolRequest')",
            "SetBool._md5sum": "09fb03525b03e7ea1fd3992bafd87e16",
            "SetBoolResponse(True, 'm')": 'success: True\nmessage: "m"',
            "FibonacciAction().action_goal.goal == FibonacciGoal()": "True",
            "setattr(SetBool(), 'effort', 1)": "None",
        },
    )
    with pytest.raises(AttributeError, match=r"^'Twist' object has no attribute 'speed'"):  # Python 3.13 adds more text
        ros.Twist().speed = 1


def test_values_on_the_wire(ros: Any) -> None:
    check(
        ros,
        {
            "rt(LaserScan(ranges=[1, 2])).ranges": "(1.0, 2.0)",
            "rt(JointState(name=['a'])).name": "['a']",
            "type(rt(Odometry()).pose.covariance)": "<class 'tuple'>",
            "rt(Image(data=b'ab')).data": "b'ab'",
            "rt(UInt8MultiArray(data=[1, 2])).data": r"b'\x01\x02'",
            "rt(Vector3(1, 2, 3))": "x: 1.0\ny: 2.0\nz: 3.0",
            "rt(Vector3(None, 2, 3))": "x: 0.0\ny: 2.0\nz: 3.0",
            "rt(Float32(np.float64(1.1)))": "data: 1.100000023841858",
            "rt(Float64MultiArray(data=np.arange(3.0))).data": "(0.0, 1.0, 2.0)",
            "rt(Float32(True))": "data: 1.0",
            "rt(String('\\u00e9')).data": "é",
            "rt(Float32(0.1)).data": "0.10000000149011612",
            "rt(Float32(float('nan'))).data": "nan",
            "rt(Header(0, T(1.5, 0), ''))": "seq: 0\nstamp: \n  secs: 1\n  nsecs: 500000000\nframe_id: ''",
            "rt(Header(0, D(1), '')).stamp": "genpy.Time[1000000000]",
            "rt(Vector3('1', 2, 3))": "!! SerializationError: field x must be float type",
            "rt(Int32(1.5))": "!! SerializationError: field data must be an integer type",
            "rt(Int32(2**40))": "!! SerializationError: field data exceeds specified width [int32]",
            "rt(UInt8(-1))": "!! SerializationError: field data must be unsigned integer type",
            "rt(String(b'ab'))": "!! AttributeError: 'bytes' object has no attribute 'encode'",
            "rt(String(3))": "!! SerializationError: field data must be of type bytes or an ascii string",
            "rt(Header(0, 1.5, ''))": "!! AttributeError: 'float' object has no attribute 'secs'",
            "rt(Float32([4]))": "!! SerializationError: field data must be float type",
            "rt(Float32({'data': 5}))": "!! SerializationError: field data must be float type",
        },
    )
    for broken in (
        "Float32([4])",
        "Vector3('1', 2, 3)",
        "Int32(2**40)",
        "String(3)",
        "JointState(name='ab', position=3)",
    ):
        with case(broken):
            message = eval(broken, vars(ros))
            on_the_bus = outcome(lambda message=message: ros.genpy.encode(message))
            assert on_the_bus == outcome(lambda message=message: message.serialize(io.BytesIO()))
            assert on_the_bus.startswith("!! SerializationError")


def test_messages_are_copied_and_pickled(ros: Any) -> None:
    message = ros.Odometry(child_frame_id="base")
    message.header.stamp = ros.T(3, 4)
    assert pickle.loads(pickle.dumps(message)) == message
    twin = copy.deepcopy(message)
    twin.pose.pose.position.x = 1.0
    assert message.pose.pose.position.x == 0.0
    assert twin != message
    assert not hasattr(message, "_connection_header")
