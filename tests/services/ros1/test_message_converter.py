"""rospy_message_converter: messages as dicts and as JSON, and back."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from services.script.kernel import ScriptKernel
from tests.harness.ros1 import ros1_imports


@pytest.fixture(scope="module", autouse=True)
def kernel() -> Iterator[ScriptKernel]:
    with ros1_imports() as made:
        yield made


def back(ros_type: str, fields: dict[str, Any], **options: Any) -> Any:
    from rospy_message_converter import message_converter

    return message_converter.convert_dictionary_to_ros_message(ros_type, fields, **options)


def test_messages_become_dicts_and_come_back() -> None:
    import rospy
    from geometry_msgs.msg import PoseArray
    from rospy_message_converter import json_message_converter, message_converter
    from sensor_msgs.msg import Image

    poses = {
        "header": {"seq": 2, "stamp": {"secs": 3, "nsecs": 5}, "frame_id": "map"},
        "poses": [
            {"position": {"x": 1.0, "y": 0.0, "z": 0.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
        ],
    }
    made = back("geometry_msgs/PoseArray", poses)
    assert isinstance(made, PoseArray)
    assert made.header.stamp == rospy.Time(3, 5)
    assert message_converter.convert_ros_message_to_dictionary(made) == poses
    image = Image(encoding="mono8", height=1, width=3, data=b"abc")
    plain = message_converter.convert_ros_message_to_dictionary(image)
    assert plain["data"] == "YWJj"
    assert message_converter.convert_ros_message_to_dictionary(image, binary_array_as_bytes=False)["data"] == [
        97,
        98,
        99,
    ]
    assert back("sensor_msgs/Image", plain) == image
    text = json_message_converter.convert_ros_message_to_json(made)
    assert json.loads(text) == poses
    assert json_message_converter.convert_json_to_ros_message("geometry_msgs/PoseArray", text) == made
    request = back("std_srvs/SetBool", {"data": True}, kind="request")
    assert (type(request).__name__, request.data) == ("SetBoolRequest", True)
    assert back("std_msgs/Float32", {"data": np.float32(0.5)}).data == 0.5
    assert back("std_msgs/String", {"data": None}).data == ""


def test_wrong_fields_are_refused() -> None:
    for fields, options, error, text in (
        ({"speed": 1}, {}, ValueError, 'ROS message type "std_msgs/Int8" has no field named "speed"'),
        ({}, {"check_missing_fields": True}, ValueError, "Missing fields \"{'data': 'int8'}\""),
        ({"data": "1"}, {}, TypeError, "Field 'data' has wrong type"),
        ({"data": np.int64(1)}, {}, TypeError, "Field 'data' has wrong type"),
        ({}, {"kind": "reply"}, ValueError, 'Unknown kind "reply"'),
    ):
        with pytest.raises(error) as raised:
            back("std_msgs/Int8", fields, **options)
        assert text in str(raised.value)
    assert back("std_msgs/Int8", {"speed": 1, "data": 4}, strict_mode=False).data == 4
