"""Groups of templates give the same results as single templates."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence

import msgspec
import numpy as np

from messages.geometry import Point, Pose, Quaternion
from messages.nav import Odometry
from messages.sensor import JointState
from messages.std import Header, Time
from messages.template import Template, encode_stamp
from services.sim.template_groups import GroupEncoder, TemplateGroup

AWKWARD = (0.0, -0.0, math.inf, -math.inf, math.nan, 5e-324, 1e12, -1e308)


def _pose(stamp: Time, numbers: Sequence[float]) -> Odometry:
    w, x, y, z = numbers  # in another order on the wire
    record = Odometry(header=Header(stamp=stamp, frame_id="odom"), child_frame_id="base")
    pose = Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(w=w))
    return msgspec.structs.replace(record, pose=msgspec.structs.replace(record.pose, pose=pose))


def _joints(stamp: Time, numbers: Sequence[float]) -> JointState:
    return JointState(
        header=Header(stamp=stamp), name=("a", "b"), position=tuple(numbers[:2]), velocity=tuple(numbers[2:])
    )


def test_a_group_gives_what_its_templates_give() -> None:
    dice, encoder = random.Random(5), GroupEncoder()
    every = [Template(make, 4) for make in (_pose, _joints, _pose)]
    for stamp in (0, 127, 128, 2**31 * 10**9 - 1, *(dice.randrange(2**60) for _ in range(20))):
        templates = dice.sample(every, dice.randrange(1, 4))
        rows = [[dice.choice((*AWKWARD, dice.gauss(0, 1))) for _ in range(4)] for _ in templates]
        encoded = encode_stamp(stamp)
        expected = [each.encode(encoded, row) for each, row in zip(templates, rows, strict=True)]
        assert TemplateGroup(templates).encode(encoded, np.array(rows)) == expected
        assert encoder.encode(templates, encoded, np.array(rows)) == expected
        assert encoder.encode(templates, encoded, np.asfortranarray(rows)) == expected, "the numbers alone change"
    assert encoder.encode([], encoded, np.empty((0, 4))) == []
