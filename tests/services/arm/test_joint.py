"""The joint's angle and mean rate from joint states, and the fallback where there is no mean."""

from __future__ import annotations

import math

import pytest

from messages.sensor import JointState
from messages.std import Header, Time
from services.arm.joint import JointReader, JointReading

MS = 1_000_000
LONGEST = 20 * MS


def state(ms: int, degrees: float, rate: float | None = None, name: str = "j") -> JointState:
    velocity = () if rate is None else (math.radians(rate),)
    header = Header(stamp=Time.of(ms * MS))
    return JointState(header=header, name=(name,), position=(math.radians(degrees),), velocity=velocity)


def read(joint: JointReader, told: JointState) -> JointReading:
    reading = joint.read(told, LONGEST)
    assert reading is not None
    return reading


def test_the_rate_is_the_mean_since_the_states_before() -> None:
    joint = JointReader("j")
    assert read(joint, state(100, 1.0, 20.0)) == pytest.approx((1.0, 20.0, 5 * MS))
    assert read(joint, state(110, 1.3, 40.0)) == pytest.approx((1.3, 30.0, 10 * MS))
    assert read(joint, state(110, 1.3, 40.0)) == pytest.approx((1.3, 30.0, 10 * MS)), "the same states again"
    assert read(joint, state(115, 1.5, 40.0)) == pytest.approx((1.5, 40.0, 5 * MS))


def test_after_a_gap_it_is_what_is_told() -> None:
    joint = JointReader("j")
    read(joint, state(100, 1.0, 20.0))
    assert read(joint, state(121, 9.0, 40.0)) == pytest.approx((9.0, 40.0, 5 * MS))
    assert read(joint, state(90, 3.0, -1.0)) == pytest.approx((3.0, -1.0, 5 * MS)), "time was set back"


def test_an_arm_that_is_put_elsewhere_has_not_moved_fast() -> None:
    """The difference of its angles would give 4000 deg/s, and an effort at saturation."""
    joint = JointReader("j")
    read(joint, state(100, 0.0, 2.0))
    assert read(joint, state(110, 40.0, 0.0)).rate == pytest.approx(2.0)


def test_without_velocities_there_is_a_rate_all_the_same() -> None:
    joint = JointReader("j")
    assert read(joint, state(100, 1.0)).rate == 0.0
    assert read(joint, state(110, 1.3)).rate == pytest.approx(30.0)
    assert read(joint, state(210, 4.3)) == pytest.approx((4.3, 30.0, 100 * MS)), "a gap, but nothing better is known"


def test_states_without_the_joint_or_without_angles_say_what_they_have() -> None:
    joint = JointReader("j")
    assert joint.read(state(100, 1.0, name="k"), LONGEST) is None
    assert joint.error == "the joint states have no position of 'j' (only of: k)"
    assert joint.read(JointState(name=("j",)), LONGEST) is None
