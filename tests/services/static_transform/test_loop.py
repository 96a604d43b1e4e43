"""The static transform service: one latched transform, and invalid ones."""

from __future__ import annotations

import math

import pytest

from messages.topics import TF_STATIC
from services.runtime.errors import BadInput
from services.runtime.testing import run_service
from services.static_transform import SERVICE, StaticTransformParameters
from services.static_transform.loop import static_transform


def test_the_transform_is_published_before_time_begins() -> None:
    params = StaticTransformParameters(x=1.0, yaw=math.pi / 2, frame_id="/map", child_frame_id="odom")
    with run_service(SERVICE, "/", params) as service:
        (made,) = service.next(TF_STATIC).transforms
        assert (made.header.frame_id, made.child_frame_id, made.transform.translation.x) == ("map", "odom", 1.0)
        assert made.transform.rotation.yaw == pytest.approx(math.pi / 2)


def test_angles_and_quaternions_are_the_same_and_nonsense_is_refused() -> None:
    names = {"frame_id": "a", "child_frame_id": "b"}
    by_angles = static_transform(StaticTransformParameters(roll=0.1, pitch=0.2, yaw=0.3, **names)).transform.rotation
    given = by_angles.x, by_angles.y, by_angles.z, by_angles.w
    assert static_transform(StaticTransformParameters(quaternion=given, **names)).transform.rotation == by_angles
    for params, why in (
        ({}, "both frames need a name"),
        ({"frame_id": "a", "child_frame_id": "/a"}, "a frame is not its own parent"),
        ({**names, "quaternion": (0.0, 0.0, 1.0)}, "norm 1, and has 3 with norm 1.000"),
        ({**names, "quaternion": (0.0, 0.0, 0.0, 0.5)}, "has 4 with norm 0.500"),
        ({**names, "quaternion": given, "yaw": 1.0}, "both a quaternion and angles are given"),
    ):
        with pytest.raises(BadInput, match=why):
            static_transform(StaticTransformParameters(**params))
