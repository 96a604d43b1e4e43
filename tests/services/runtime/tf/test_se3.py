"""Rigid transforms obey the laws of a group, and interpolate along lines and arcs."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.se3 import IDENTITY, SE3, Rotation, Vector, rotate

small = st.floats(-10, 10, allow_nan=False)
angle = st.floats(-math.pi, math.pi)
shares = st.floats(0, 1)


def about(axis: Vector, turn: float) -> Rotation:
    """The rotation by ``turn`` [rad] about a unit axis."""
    s = math.sin(turn / 2)
    return axis[0] * s, axis[1] * s, axis[2] * s, math.cos(turn / 2)


@st.composite
def rigids(draw: st.DrawFn) -> SE3:
    q = np.array([draw(st.floats(-1, 1)) for _ in range(4)])
    length = float(np.linalg.norm(q))
    x, y, z, w = (float(each) for each in (q / length if length > 0.1 else (0.0, 0.0, 0.0, 1.0)))
    return SE3((draw(small), draw(small), draw(small)), (x, y, z, w))


def same(one: SE3, other: SE3, within: float = 1e-9) -> bool:
    """Equal as transforms: q and -q are one rotation."""
    sign = math.copysign(1, sum(a * b for a, b in zip(one.rotation, other.rotation, strict=True)))
    apart = [a - b for a, b in zip(one.translation, other.translation, strict=True)]
    apart += [a - sign * b for a, b in zip(one.rotation, other.rotation, strict=True)]
    return max(map(abs, apart)) <= within


def matrix(rigid: SE3) -> np.ndarray:
    """The homogeneous matrix, from where the axes go: an independent way to compose."""
    made = np.eye(4)
    for column, axis in enumerate(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))):
        made[:3, column] = rotate(rigid.rotation, axis)
    made[:3, 3] = rigid.translation
    return made


@given(rigids(), rigids())
def test_composition_is_that_of_matrices(one: SE3, other: SE3) -> None:
    assert np.allclose(matrix(one.compose(other)), matrix(one) @ matrix(other), atol=1e-9)


@given(rigids())
def test_an_inverse_leads_back(one: SE3) -> None:
    assert same(one.compose(one.inverse()), IDENTITY)
    assert same(one.inverse().compose(one), IDENTITY)
    assert same(one.inverse().inverse(), one)


@given(rigids(), rigids(), rigids())
def test_composition_is_associative(a: SE3, b: SE3, c: SE3) -> None:
    assert same(a.compose(b).compose(c), a.compose(b.compose(c)), 1e-8)


@given(rigids(), rigids())
def test_interpolation_meets_its_ends(one: SE3, other: SE3) -> None:
    assert same(one.interpolate(other, 0.0), one)
    assert same(one.interpolate(other, 1.0), other)


@given(rigids(), rigids(), shares)
def test_interpolation_is_a_unit_rotation_and_the_same_from_both_ends(one: SE3, other: SE3, share: float) -> None:
    between = one.interpolate(other, share)
    assert math.hypot(*between.rotation) == pytest.approx(1)
    cosine = sum(a * b for a, b in zip(one.rotation, other.rotation, strict=True))
    if abs(cosine) > 1e-6:  # else both arcs are as short
        assert same(between, other.interpolate(one, 1 - share), 1e-7)


@given(st.floats(-math.pi + 0.01, math.pi - 0.01), shares)
def test_a_turn_about_one_axis_is_shared_in_proportion(turn: float, share: float) -> None:
    end = SE3((2.0, 0.0, -4.0), about((0.0, 0.6, 0.8), turn))
    wanted = SE3((2 * share, 0.0, -4 * share), about((0.0, 0.6, 0.8), share * turn))
    assert same(IDENTITY.interpolate(end, share), wanted, 1e-6)


@given(st.floats(-math.pi, math.pi), st.floats(-1.57, 1.57), angle)
def test_roll_pitch_and_yaw_are_found_again(roll: float, pitch: float, yaw: float) -> None:
    made = SE3(rotation=about((0.0, 0.0, 1.0), yaw))
    made = made.compose(SE3(rotation=about((0.0, 1.0, 0.0), pitch))).compose(SE3(rotation=about((1.0, 0.0, 0.0), roll)))
    found = made.rpy
    again = SE3(rotation=about((0.0, 0.0, 1.0), found[2]))
    again = again.compose(SE3(rotation=about((0.0, 1.0, 0.0), found[1]))).compose(
        SE3(rotation=about((1.0, 0.0, 0.0), found[0]))
    )
    assert same(made, again, 1e-6)


@pytest.mark.parametrize("sign", [1, -1])
def test_straight_up_and_down_have_a_yaw_and_no_roll(sign: int) -> None:
    upright = SE3(rotation=about((0.0, 0.0, 1.0), 0.7)).compose(
        SE3(rotation=about((0.0, 1.0, 0.0), sign * math.pi / 2))
    )
    assert upright.rpy == pytest.approx((0.0, sign * math.pi / 2, 0.7))


@given(rigids())
def test_a_message_keeps_it(one: SE3) -> None:
    assert same(SE3.from_msg(one.to_msg), one)
