"""Planar poses obey the group laws, agree with poses in space, and keep an unbounded yaw."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.se2 import IDENTITY, Pose2, Twist2, wrap
from messages.se3 import Pose3

number = st.floats(-100, 100)
poses = st.builds(Pose2, number, number, st.floats(-5, 5))


def near(one: Pose2, other: Pose2) -> bool:
    return one == pytest.approx(other, abs=1e-9)


@given(poses, poses)
def test_poses_compose_and_undo(one: Pose2, other: Pose2) -> None:
    assert near(one @ other @ other.inverse(), one)
    assert near(one @ one.inverse(), IDENTITY)
    assert near(one @ one.between(other), other)
    assert near(Pose2.aligning(one, other) @ other, one)
    assert one.compose(other) == one @ other


@given(poses, poses)
def test_it_is_the_part_on_the_ground_of_a_pose_in_space(one: Pose2, other: Pose2) -> None:
    spatial, planar = Pose3.planar(*one) @ Pose3.planar(*other), one @ other
    assert spatial.position == pytest.approx((planar.x, planar.y, 0.0), abs=1e-9)
    assert wrap(spatial.rpy[2] - planar.yaw) == pytest.approx(0.0, abs=1e-9)


@given(poses)
def test_messages_keep_it(pose: Pose2) -> None:
    for found in (Pose2.from_msg(pose.to_msg()), Pose2.from_msg(Pose3.planar(*pose).to_transform())):
        assert (found.x, found.y) == (pose.x, pose.y)
        assert wrap(found.yaw - pose.yaw) == pytest.approx(0.0, abs=1e-9)
    assert Twist2.from_msg(Twist2(0.5, -1.0).to_msg()) == Twist2(0.5, -1.0)


def test_a_yaw_grows_without_bounds_until_it_is_wrapped() -> None:
    turned = Pose2(yaw=3.0) @ Pose2(yaw=3.0)
    assert turned.yaw == 6.0
    assert turned.wrapped.yaw == pytest.approx(6.0 - math.tau)
