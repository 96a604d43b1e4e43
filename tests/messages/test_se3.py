"""Rigid transforms obey the group laws and interpolate along lines and arcs."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.se3 import (
    IDENTITY,
    Pose3,
    Rotation,
    Vector,
    quaternion_from_rpy,
    rotate,
    rotate_inverse,
    rotated_axes,
)

small = st.floats(-10, 10, allow_nan=False)
angle = st.floats(-math.pi, math.pi)
shares = st.floats(0, 1)


def about(axis: Vector, turn: float) -> Rotation:
    """Return the rotation by ``turn`` [rad] about a unit axis."""
    s = math.sin(turn / 2)
    return axis[0] * s, axis[1] * s, axis[2] * s, math.cos(turn / 2)


@st.composite
def poses(draw: st.DrawFn) -> Pose3:
    q = np.array([draw(st.floats(-1, 1)) for _ in range(4)])
    length = float(np.linalg.norm(q))
    x, y, z, w = (float(each) for each in (q / length if length > 0.1 else (0.0, 0.0, 0.0, 1.0)))
    return Pose3((draw(small), draw(small), draw(small)), (x, y, z, w))


def same(one: Pose3, other: Pose3, within: float = 1e-9) -> bool:
    """Whether transforms are equal; q and -q are the same rotation."""
    sign = math.copysign(1, sum(a * b for a, b in zip(one.orientation, other.orientation, strict=True)))
    apart = [a - b for a, b in zip(one.position, other.position, strict=True)]
    apart += [a - sign * b for a, b in zip(one.orientation, other.orientation, strict=True)]
    return max(map(abs, apart)) <= within


def matrix(pose: Pose3) -> np.ndarray:
    """Return the homogeneous matrix, from the rotated axes: an independent way to compose."""
    made = np.eye(4)
    for column, axis in enumerate(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))):
        made[:3, column] = rotate(pose.orientation, axis)
    made[:3, 3] = pose.position
    return made


@given(poses(), poses())
def test_composition_is_that_of_matrices(one: Pose3, other: Pose3) -> None:
    assert np.allclose(matrix(one.compose(other)), matrix(one) @ matrix(other), atol=1e-9)


@given(poses())
def test_an_inverse_leads_back(one: Pose3) -> None:
    assert same(one.compose(one.inverse()), IDENTITY)
    assert same(one.inverse().compose(one), IDENTITY)
    assert same(one.inverse().inverse(), one)


@given(poses(), poses(), poses())
def test_composition_is_associative(a: Pose3, b: Pose3, c: Pose3) -> None:
    assert same(a.compose(b).compose(c), a.compose(b.compose(c)), 1e-8)


@given(poses(), poses())
def test_interpolation_meets_its_ends(one: Pose3, other: Pose3) -> None:
    assert same(one.interpolate(other, 0.0), one)
    assert same(one.interpolate(other, 1.0), other)


@given(poses(), poses(), shares)
def test_interpolation_is_a_unit_rotation_and_the_same_from_both_ends(one: Pose3, other: Pose3, share: float) -> None:
    between = one.interpolate(other, share)
    assert math.hypot(*between.orientation) == pytest.approx(1)
    cosine = sum(a * b for a, b in zip(one.orientation, other.orientation, strict=True))
    if abs(cosine) > 1e-6:  # else both arcs are equally short
        assert same(between, other.interpolate(one, 1 - share), 1e-7)


@given(st.floats(-math.pi + 0.01, math.pi - 0.01), shares)
def test_a_turn_about_one_axis_is_shared_in_proportion(turn: float, share: float) -> None:
    end = Pose3((2.0, 0.0, -4.0), about((0.0, 0.6, 0.8), turn))
    wanted = Pose3((2 * share, 0.0, -4 * share), about((0.0, 0.6, 0.8), share * turn))
    assert same(IDENTITY.interpolate(end, share), wanted, 1e-6)


@given(st.floats(-math.pi, math.pi), st.floats(-1.57, 1.57), angle)
def test_roll_pitch_and_yaw_are_found_again(roll: float, pitch: float, yaw: float) -> None:
    made = (
        Pose3(orientation=about((0.0, 0.0, 1.0), yaw))
        @ Pose3(orientation=about((0.0, 1.0, 0.0), pitch))
        @ Pose3(orientation=about((1.0, 0.0, 0.0), roll))
    )
    assert same(Pose3(orientation=quaternion_from_rpy(roll, pitch, yaw)), made)
    assert same(Pose3(orientation=quaternion_from_rpy(*made.rpy)), made, 1e-6)


@pytest.mark.parametrize("sign", [1, -1])
def test_straight_up_and_down_have_a_yaw_and_no_roll(sign: int) -> None:
    upright = Pose3(orientation=about((0.0, 0.0, 1.0), 0.7)).compose(
        Pose3(orientation=about((0.0, 1.0, 0.0), sign * math.pi / 2))
    )
    assert upright.rpy == pytest.approx((0.0, sign * math.pi / 2, 0.7))


@given(poses())
def test_a_message_keeps_it(one: Pose3) -> None:
    assert same(Pose3.from_msg(one.to_transform()), one)
    assert same(Pose3.from_msg(one.to_msg()), one)


@given(poses(), st.tuples(small, small, small))
def test_rotations_agree_with_the_textbook_matrix(pose: Pose3, vector: Vector) -> None:
    x, y, z, w = rotation = pose.orientation
    textbook = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    assert np.allclose(np.array(rotated_axes(rotation)).T, textbook, atol=1e-12)
    assert rotate(rotation, vector) == pytest.approx(tuple(textbook @ vector), abs=1e-11)
    assert rotate_inverse(rotation, vector) == pytest.approx(tuple(textbook.T @ vector), abs=1e-11)
    assert rotate(rotation, rotate_inverse(rotation, vector)) == pytest.approx(vector, abs=1e-11)


def test_components_may_be_arrays() -> None:
    q = about((0.0, 0.6, 0.8), 0.7)
    columns = np.arange(6.0).reshape(3, 2)
    found = np.column_stack(rotate(q, (columns[0], columns[1], columns[2])))
    assert found.tolist() == [list(rotate(q, (x, y, z))) for x, y, z in columns.T.tolist()]
