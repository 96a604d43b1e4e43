"""Templates give the same bytes as the codec, for any numbers and stamp."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence

import pytest

from messages.base import covariance, encode
from messages.geometry import Point, Pose, PoseWithCovariance, Quaternion, TransformStamped
from messages.nav import Odometry
from messages.sensor import JointState
from messages.std import Header, Time
from messages.template import Template, encode_stamp
from messages.tf import EncodedSplit, split, transform_size

AWKWARD = (0.0, -0.0, math.inf, -math.inf, math.nan, 5e-324, 1e12, -1e308)
STAMPS = (0, 1, 127, 128, 4_999_999_999, 2**31 * 10**9 - 1)


def _odometry(stamp: Time, numbers: Sequence[float]) -> Odometry:
    w, x, y, z = numbers  # in another order on the wire
    pose = Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(w=w))
    packed = covariance(1, 2, 3, 4, 5, 6)
    header = Header(stamp=stamp, frame_id="odom")
    return Odometry(header=header, child_frame_id="base", pose=PoseWithCovariance(pose=pose, packed=packed))


def _joints(stamp: Time, numbers: Sequence[float]) -> JointState:
    return JointState(
        header=Header(stamp=stamp), name=("a", "b"), position=tuple(numbers[:2]), velocity=tuple(numbers[2:])
    )


def _nothing(stamp: Time, numbers: Sequence[float]) -> JointState:
    assert not numbers
    return JointState(header=Header(stamp=stamp))


def test_a_template_gives_the_bytes_of_the_codec() -> None:
    dice = random.Random(4)
    for make, count in ((_odometry, 4), (_joints, 4), (_nothing, 0)):
        template = Template(make, count)
        for stamp in (*STAMPS, *(dice.randrange(2**60) for _ in range(20))):
            numbers = [dice.choice((*AWKWARD, dice.gauss(0, 1), dice.uniform(-1e9, 1e9))) for _ in range(count)]
            assert template.encode(encode_stamp(stamp), numbers) == encode(make(Time.of(stamp), numbers))
    without = Template(lambda _, numbers: Point(x=numbers[0], z=numbers[1]), 2, stamped=False)
    assert without.encode(b"", AWKWARD[:2]) == encode(Point(x=AWKWARD[0], z=AWKWARD[1]))


def test_every_number_has_one_place_of_its_own() -> None:
    def twice(stamp: Time, numbers: Sequence[float]) -> JointState:
        return JointState(header=Header(stamp=stamp), name=("a", "b"), position=(numbers[0], numbers[0]))

    with pytest.raises(ValueError, match="a number of JointState has to stand in one place"):
        Template(twice, 1)
    with pytest.raises(ValueError, match="a number of JointState has to stand"):
        Template(_nothing_of_one, 1)
    with pytest.raises(ValueError, match="JointState has its stamp in 0 places"):
        Template(lambda stamp, numbers: JointState(), 0)
    with pytest.raises(ValueError, match="JointState has its stamp in 1 places, not in 0"):
        Template(_joints, 4, stamped=False)
    with pytest.raises(ValueError, match="assign sequence of size 3"):
        Template(_joints, 4).encode(encode_stamp(0), (1.0, 2.0, 3.0))


def _nothing_of_one(stamp: Time, numbers: Sequence[float]) -> JointState:
    return JointState(header=Header(stamp=stamp))


def test_encoded_transforms_are_split_as_records_are() -> None:
    for count in (0, 1, 15, 16, 17, 450):
        transforms = [
            TransformStamped(
                header=Header(stamp=Time.of(7), frame_id=f"frame{place}" * 3), child_frame_id="child" * (place % 5 + 1)
            )
            for place in range(count)
        ]
        sizes = [transform_size(each.header.frame_id, each.child_frame_id) for each in transforms]
        assert EncodedSplit(sizes).join(list(map(encode, transforms))) == list(map(encode, split(transforms)))
